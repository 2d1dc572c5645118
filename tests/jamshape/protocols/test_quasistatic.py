import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from superellipsoid_packings import scattered

from jamshape.landscape import Landscape, State
from jamshape.minima import History, residual_of
from jamshape.protocols import quasistatic
from jamshape.protocols.quasistatic import Quasistatic, QuasistaticRun, compress


def begun(n=16, phi=0.5, protocol=None):
    packing = scattered(np.tile([1.0, 1.0, 1.5], (n, 1)), np.ones(n), phi)
    landscape, protocol = Landscape(packing), protocol or Quasistatic(step=5e-3, energy=1e-8)
    return landscape, QuasistaticRun.of(landscape, State.of(packing), protocol), protocol


@pytest.fixture(scope="module")
def ended():
    landscape, compression, protocol = begun()
    rows = [
        (c.phi, c.step, c.loose_phi, c.openings) for c in compress(landscape, compression, protocol)
    ]
    return landscape, compression, protocol, rows


def test_the_end_is_the_first_jammed_packing_close_to_the_tolerance(ended):
    landscape, compression, protocol, _ = ended
    found = landscape.evaluate(compression.state)
    assert 1 < found.energy / landscape.particles.n / protocol.energy <= protocol.closeness
    assert residual_of(landscape, found).largest <= protocol.tolerance
    components = landscape.components(found.gradient)
    mean_net_force = np.linalg.norm(components[:, :3], axis=1).mean()
    assert mean_net_force / found.bond_force < 1e-4  # the criterion of the paper
    loose = landscape.evaluate(compression.loose).energy / landscape.particles.n
    assert loose <= protocol.energy
    assert compression.loose_phi < compression.phi
    assert compression.state.packing(landscape.particles).phi == pytest.approx(
        compression.phi, rel=1e-12
    )


def test_a_jammed_packing_is_opened_to_the_tolerance(ended):
    *_, protocol, rows = ended
    phi, step, loose, openings = np.array(rows).T
    assert set(step) == {protocol.step}
    assert (np.diff(loose) >= 0).all()
    is_opened = openings > 0
    assert 1 <= is_opened.sum() <= 20
    assert is_opened[-1]
    assert (np.diff(phi[is_opened]) <= 0).all()
    assert (phi[is_opened] > loose[-1]).all()


def test_where_it_falls_apart_steps_are_halved_from_the_densest_unjammed_state(monkeypatch):
    usual = begun(phi=0.49)  # from 0.5 a state that jams by chance falls apart to the last halving
    list(compress(*usual))
    monkeypatch.setattr(quasistatic, "_MOST_OPENINGS", 0)
    landscape, compression, protocol = begun(phi=0.49)
    rows = [(c.step, c.loose_phi) for c in compress(landscape, compression, protocol)]
    step, loose = np.array(rows).T
    assert step[0] == protocol.step
    # Known only to the rounding of phi, of which they are differences.
    halvings = np.log2(protocol.step / step)
    np.testing.assert_allclose(halvings, np.rint(halvings), atol=1e-6)
    assert (np.diff(step) <= 1e-12).all()
    assert (np.diff(loose) >= 0).all()
    assert step[-1] < protocol.step / 4
    per_particle = compression.minimum.evaluation.energy / landscape.particles.n
    assert 1 < per_particle / protocol.energy <= protocol.closeness
    assert compression.phi == pytest.approx(usual[1].phi, abs=protocol.step)


def test_opening_too_far_ends_in_halvings(monkeypatch):
    # One that is opened far beyond where it jams.
    monkeypatch.setattr(quasistatic, "nearer", lambda _, at, __: at.state.strained(5e-3))
    landscape, compression, protocol = begun()
    openings = [c.openings for c in compress(landscape, compression, protocol)]
    assert max(openings) == 1
    assert compression.halves
    per_particle = compression.minimum.evaluation.energy / landscape.particles.n
    assert 1 < per_particle / protocol.energy <= protocol.closeness


def test_going_on_from_between_two_steps_gives_the_same_to_the_bit(ended):
    expected = ended[1]
    landscape, compression, protocol = begun()
    for at in compress(landscape, compression, protocol):
        if at.openings == 2:
            break
    fresh = replace(compression, history=History())
    for _ in compress(Landscape(landscape.particles), fresh, protocol):
        pass
    np.testing.assert_array_equal(fresh.state.position, expected.state.position)
    np.testing.assert_array_equal(fresh.state.orientation, expected.state.orientation)


ADAPTIVE = Quasistatic(step=2e-3, energy=1e-8, coarse=4e-2)


@pytest.fixture(scope="module")
def adaptive():
    """List the step before, the evaluations and the step after each minimisation that left the packing unjammed."""
    landscape, compression, protocol = begun(n=32, phi=0.33, protocol=ADAPTIVE)
    rows, loose = [], compression.loose
    step, evaluations, reached = compression.step, landscape.evaluations, []
    for at in compress(landscape, compression, protocol):
        if at.loose is not loose:
            rows.append((step, landscape.evaluations - evaluations, at.step))
            reached.append(at.loose_phi)
        loose, step, evaluations = at.loose, at.step, landscape.evaluations
    return compression, rows, reached


def test_steps_that_adapt_follow_what_minimisations_take(adaptive):
    compression, rows, _ = adaptive
    assert compression.minimum is not None
    assert rows[0][0] == ADAPTIVE.coarse
    seen = set()
    for before, evaluations, after in rows:
        if evaluations < 40:
            expected, kind = min(1.5 * before, ADAPTIVE.coarse), "grown"
        elif evaluations > 150:
            expected, kind = max(before / 2, ADAPTIVE.step), "shrunk"
        else:
            expected, kind = before, "kept"
        assert after == expected
        seen.add(kind)
    assert {"grown", "shrunk", "kept"} <= seen


def test_steps_that_adapt_are_fewer_and_end_as_close_to_the_tolerance(adaptive):
    compression, rows, reached = adaptive
    assert np.diff(reached).max() <= ADAPTIVE.coarse * (1 + 1e-9)
    assert len(rows) < (reached[-1] - reached[0]) / ADAPTIVE.step / 2
    per_particle = compression.minimum.evaluation.energy / 32
    assert 1 < per_particle / ADAPTIVE.energy <= ADAPTIVE.closeness


def test_long_minimisations_are_told_of_and_gone_on_with_in_parts(monkeypatch):
    monkeypatch.setattr(quasistatic, "_PART", 60)
    landscape, compression, protocol = begun(n=24, phi=0.5, protocol=ADAPTIVE)
    parts = [at.parts for at in compress(landscape, compression, protocol)]
    assert max(parts) >= 2
    assert compression.minimum is not None
    per_particle = compression.minimum.evaluation.energy / 24
    assert 1 < per_particle / ADAPTIVE.energy <= ADAPTIVE.closeness
    # Gone on with from the middle of a long one, it comes to the same end.
    middle = parts.index(max(parts))
    landscape, again, protocol = begun(n=24, phi=0.5, protocol=ADAPTIVE)
    for _ in zip(range(middle + 1), compress(landscape, again, protocol), strict=False):
        pass
    assert again.parts == max(parts)
    fresh = replace(again, history=History())
    assert sum(1 for _ in compress(Landscape(landscape.particles), fresh, protocol)) == (
        len(parts) - middle - 1
    )
    np.testing.assert_array_equal(fresh.state.position, compression.state.position)
    np.testing.assert_array_equal(fresh.state.orientation, compression.state.orientation)


def test_minimisations_that_do_not_end_are_given_up_after_so_many_parts(monkeypatch):
    landscape, compression, protocol = begun(n=24, phi=0.5, protocol=ADAPTIVE)
    next(compress(landscape, compression, protocol))
    assert compression.loose is not None
    monkeypatch.setattr(quasistatic, "_PART", 5)
    monkeypatch.setattr(quasistatic, "_MOST_PARTS", 3)
    parts = [at.parts for at in compress(landscape, compression, protocol)]
    assert max(parts) == 2
    for at, after in itertools.pairwise(parts):
        assert after in {0, at + 1}


def test_before_a_search_long_minimisations_are_left_once_in_a_row(monkeypatch):
    monkeypatch.setattr(quasistatic, "_PART", 60)
    monkeypatch.setattr(quasistatic, "_BRIEF", 60)
    rough = replace(ADAPTIVE, closeness=math.inf)
    landscape, compression, protocol = begun(n=30, phi=0.5, protocol=rough)
    left, loose = [], compression.loose
    for at in compress(landscape, compression, protocol):
        if at.loose is loose:  # a part of a minimisation
            continue
        loose = at.loose
        left.append(at.left)
        if at.left:  # what a step of compression adds to a jammed packing would be as much
            assert at.parts == 0
            per_particle = landscape.evaluate(at.loose).energy / 30
            assert 1 < per_particle / protocol.energy <= quasistatic._LITTLE
            assert at.phi == pytest.approx(at.loose_phi + at.step, rel=1e-12)
    assert any(left)
    assert not any(one and after for one, after in itertools.pairwise(left))
    assert compression.minimum is not None
    assert compression.minimum.is_at_rest
    # As close to the tolerance as asked for, every one is finished.
    landscape, compression, protocol = begun(n=28, phi=0.5, protocol=ADAPTIVE)
    assert not any(at.left for at in compress(landscape, compression, protocol))


def test_a_coarse_step_is_no_finer_than_the_step():
    with pytest.raises(ValueError, match=r"the coarse step is 0\.001, expected at least the step"):
        Quasistatic(step=2e-3, coarse=1e-3)


def test_a_jammed_start_is_refused():
    landscape, compression, protocol = begun(phi=1.2)
    with pytest.raises(ValueError, match=r"start at phi = 1\.2 is jammed.* start at a smaller phi"):
        list(compress(landscape, compression, protocol))


@pytest.mark.parametrize(
    ("numbers", "sentence"),
    [
        ({"step": 0.0}, "step is 0.0, expected a positive number"),
        ({"energy": np.nan}, "energy is nan, expected a positive"),
        ({"tolerance": -1.0}, "tolerance is -1.0"),
        ({"closeness": 1.0}, "closeness is 1.0, expected a factor above 1"),
    ],
)
def test_senseless_numbers_are_refused(numbers, sentence):
    with pytest.raises(ValueError, match=sentence):
        Quasistatic(**numbers)
