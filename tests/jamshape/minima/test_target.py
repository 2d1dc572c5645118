import math
from copy import deepcopy
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from squeezed import quickly_squeezed, squeezed_at_once

from jamshape.contacts import coordination, find_contacts
from jamshape.landscape import Landscape
from jamshape.minima import History, Outcome, minimise, residual_of
from jamshape.minima import target as target_of
from jamshape.minima.checkpoints import search_of, told_search
from jamshape.minima.target import (
    Leading,
    Search,
    Target,
    TargetError,
    bisection,
    extrapolation,
    find,
)
from jamshape.shapes.particles import Particles

# n, alpha, and the packing fraction just below jamming where the search begins
STARTS = {"16 discs": (16, 0, 0.77), "32 discs": (32, 0, 0.815), "16 rods": (16, 1, 0.86)}
ENERGIES = (1e-4, 1e-9, 1e-15, 1e-18)


def start_of(name):
    packing, state = quickly_squeezed(*STARTS[name])
    return Landscape(packing), state


@cache
def found(name, u0):
    landscape, state = start_of(name)
    return find(landscape, state, Target(u0))


def coordination_of(landscape, minimum):
    packing = minimum.state.packing(landscape.particles)
    return coordination(packing, find_contacts(packing, landscape.k_e, 2))


def phi_J_of(landscape, minimum):
    """Extrapolate the tangent of sqrt(u) over phi to zero."""
    phi = minimum.state.packing(landscape.particles).phi
    u = minimum.energy_density
    pressure = -minimum.evaluation.strain_gradient / (2 * minimum.state.volume)
    return phi - 2 * phi * u / (pressure + u)


@pytest.mark.parametrize("name", STARTS)
@pytest.mark.parametrize("u0", ENERGIES)
def test_direct_search_finds_the_energy_and_a_minimum(name, u0):
    landscape, _ = start_of(name)
    minimum = found(name, u0)
    assert minimum.energy_density == pytest.approx(u0, rel=1e-7, abs=0)
    assert minimum.outcome in {Outcome.CONVERGED, Outcome.SLIDING}
    if minimum.outcome is Outcome.CONVERGED:
        assert minimum.residual.largest <= 1e-8
    # One who comes to it fresh finds the same.
    again = Landscape(landscape.particles).evaluate(minimum.state)
    assert again.energy / minimum.state.volume == pytest.approx(u0, rel=1e-7, abs=0)
    assert residual_of(landscape, again).largest <= 2 * max(minimum.residual.largest, 1e-8)
    hessian = landscape.curvature(minimum.state).hessian.toarray()
    values = np.linalg.eigvalsh(hessian)
    assert values.min() > -max(1e-10, 10 * math.sqrt(u0)) * values.max()


@pytest.mark.parametrize("name", STARTS)
@pytest.mark.parametrize("u0", [1e-15, 1e-13, 1e-11])
def test_a_packing_is_no_unjammed_start(name, u0):
    # One at 1e-15 is led to its energy or a higher one as it is, not compressed to another packing before.
    start = found(name, 1e-15)
    landscape, _ = start_of(name)
    minimum = find(landscape, start.state, Target(u0))
    shrunk = 1 - minimum.state.volume / start.state.volume
    assert abs(shrunk) < 1e-5
    far = Search(start.state, 5e-4)
    first = next(iter(extrapolation(landscape, far, Target(u0))))
    assert first.loose is None


@pytest.mark.parametrize("name", ["16 discs", "32 discs"])
@pytest.mark.parametrize("u0", ENERGIES)
def test_discs_end_converged(name, u0):
    assert found(name, u0).outcome is Outcome.CONVERGED
    assert found(name, u0).residual.largest <= 1e-8


@pytest.mark.parametrize("name", ["16 discs", "32 discs"])
@pytest.mark.parametrize("u0", [1e-9, 1e-15, 1e-18])
def test_discs_are_isostatic_at_jamming(name, u0):
    # D N' coordinates, less D translations, and one more contact for a pressure.
    landscape, _ = start_of(name)
    counts = coordination_of(landscape, found(name, u0))
    N = landscape.particles.n - counts.n_rattlers
    assert landscape.particles.n / 2 < N
    assert counts.n_bonds == counts.n_contacts == 2 * N - 1
    assert counts.z == pytest.approx(2 * (2 * N - 1) / N)


def test_discs_far_above_jamming_have_more_contacts():
    landscape, _ = start_of("32 discs")
    counts = coordination_of(landscape, found("32 discs", 1e-4))
    assert counts.n_bonds > 2 * (32 - counts.n_rattlers) - 1


@pytest.mark.parametrize("name", STARTS)
def test_energies_of_one_packing_lead_to_one_jamming_density(name):
    # sqrt(u) is linear in phi: at u0 = 1e-9 phi is 1e-4 above phi_J, and known to a thousandth of it.
    landscape, _ = start_of(name)
    far, near = (found(name, u0) for u0 in (1e-9, 1e-15))
    phi_J = phi_J_of(landscape, near)
    assert far.state.packing(landscape.particles).phi - phi_J > 1e-5
    assert phi_J_of(landscape, far) == pytest.approx(phi_J, abs=1e-6)


@pytest.mark.parametrize("name", ["16 discs", "32 discs"])
def test_halving_comes_back_to_the_packing_of_the_direct_search(name):
    landscape, _ = start_of(name)
    expected, target = found(name, 1e-9), Target(1e-9)
    search = Search(expected.state.strained(1.03e-7), step=1e-8)
    for _ in bisection(landscape, search, target):
        pass
    assert search.minimum.energy_density == pytest.approx(1e-9, rel=1e-7, abs=0)
    assert search.minimum.residual.largest <= 1e-8
    assert search.step < 1e-8
    np.testing.assert_allclose(
        search.minimum.state.edges.astype(float), expected.state.edges.astype(float), rtol=1e-10
    )
    held = ~landscape.rattlers(expected.state)
    moved = (search.minimum.state.position - expected.state.position)[held].astype(float)
    assert np.abs(moved - moved.mean(axis=0)).max() < 1e-7


def test_halving_reverses_where_it_passes_the_energy():
    landscape, _ = start_of("16 discs")
    state = found("16 discs", 1e-9).state.strained(1e-6)
    steps, opens = [], []
    for search in bisection(landscape, Search(state, step=4e-7), Target(1e-9)):
        steps.append(search.step)
        opens.append(search.opening)
    assert opens[0] is False  # below u0: the box is compressed
    halved = np.diff(steps[:-1]) < 0
    turned = np.diff(np.array(opens[:-1], int)) != 0
    np.testing.assert_array_equal(halved, turned)
    assert set(np.divide(steps[1:], steps[:-1])) == {0.5, 1.0}


def test_halving_ends_with_a_sentence_where_lambda_is_too_short():
    landscape, _ = start_of("16 discs")
    search = Search(found("16 discs", 1e-9).state.strained(1.03e-7), step=1e-8)
    sentence = r"lambda fell below 1e-09 at u = .*, expected u = 1e-09; use extrapolation$"
    with pytest.raises(TargetError, match=sentence):
        for _ in bisection(landscape, search, Target(1e-9), shortest=1e-9):
            pass


def copied(search):
    """As from a checkpoint."""
    told = deepcopy(
        {name: value for name, value in told_search(search).items() if value is not None}
    )
    return search_of(told, History())


@pytest.mark.parametrize("name", ["16 discs", "16 rods"])
def test_resumed_from_any_point_it_gives_the_same_bits(name):
    landscape, state = start_of(name)
    target = Target(1e-12)
    halfway = [Search(state, target.step)]
    halfway += [copied(s) for s in extrapolation(landscape, copied(halfway[0]), target)]
    whole = halfway.pop().minimum
    assert len(halfway) > 4
    for point in (halfway[0], halfway[len(halfway) // 2], halfway[-1]):
        search = copied(point)
        for _ in extrapolation(Landscape(landscape.particles), search, target):
            pass
        for part in ("position", "orientation", "edges"):
            np.testing.assert_array_equal(
                getattr(search.minimum.state, part), getattr(whole.state, part)
            )
        assert search.minimum.evaluation.energy == whole.evaluation.energy
        assert search.minimum.outcome is whole.outcome


@pytest.fixture
def slides(monkeypatch):
    """Energies on the way to u0, where nearly every packing counts as sliding."""
    monkeypatch.setattr(target_of, "_SLID", 0.99)
    energies = []

    def seen(landscape, start, method, stop, *more):
        u = landscape.evaluate(start).energy / start.volume
        energies.append(0.99 * u / (stop.lowest or math.nan))
        return minimise(landscape, start, method, stop, *more)

    monkeypatch.setattr(target_of, "minimise", seen)
    return energies


def long_rods():
    packing, state = quickly_squeezed(24, 4, 0.78)
    return Landscape(packing), state


@pytest.mark.usefixtures("slides")
def test_a_search_resumed_while_a_packing_slides_gives_the_same_bits():
    landscape, state = long_rods()
    target = Target(1e-12)
    points = [copied(s) for s in extrapolation(landscape, Search(state, target.step), target)]
    whole = points.pop().minimum
    within = [p for p in points if p.leading is not None and p.leading.unfinished is not None]
    assert within
    for search in (within[0], within[-1]):
        for _ in extrapolation(Landscape(landscape.particles), search, target):
            pass
        np.testing.assert_array_equal(search.minimum.state.position, whole.state.position)
        assert search.minimum.evaluation.energy == whole.evaluation.energy
    assert whole.energy_density == pytest.approx(1e-12, rel=1e-7, abs=0)
    assert whole.residual.largest <= 1e-8


def test_a_packing_that_slides_is_compressed_to_the_energy_that_is_expected(slides, monkeypatch):
    """To the same one as before, since only for small strains energies follow from their slope."""
    monkeypatch.setattr(target_of, "_DRIVEN", 1.0)
    landscape, state = long_rods()
    target = Target(1e-12)
    for search in extrapolation(landscape, Search(state, 5e-4), target):
        if search.leading is not None and search.leading.unfinished is not None:
            before, slid = len(slides), search.leading.unfinished
            search.leading.advance(landscape, target)
            assert slid.outcome is Outcome.UNJAMMED
            assert slides[before] == pytest.approx(1, abs=1e-3), slides[before]
            return
    pytest.fail("nothing slid")


def test_a_packing_that_takes_long_is_compressed_to_higher_energies(monkeypatch):
    """To twice the root of u, at most that where the step began, or by a step below jamming; never opened; it arrives at u0."""
    monkeypatch.setattr(target_of, "_LONG", 40)
    monkeypatch.setattr(target_of, "_LONG_FOR_EACH", 0)
    landscape, state = long_rods()
    target, starts, outcomes, limited, beyond = Target(1e-12), [], set(), [], []

    def seen(landscape, start, method, stop, *more):
        starts.append(start)
        return minimise(landscape, start, method, stop, *more)

    monkeypatch.setattr(target_of, "minimise", seen)
    for search in extrapolation(landscape, Search(state, 5e-4), target):
        leading = search.leading
        if leading is None or leading.unfinished is None:
            continue
        outcomes.add(leading.unfinished.outcome)
        again = copied(search).leading
        again.advance(landscape, target)
        strain = 1 - (starts[-1].volume / leading.unfinished.state.volume) ** 0.5
        limited.append(strain == pytest.approx(target.step, rel=1e-6))
        assert strain <= target.step * (1 + 1e-6)
        begun = landscape.law.root(leading.jammed.energy_density)
        beyond.append(leading.root > begun)
        now = landscape.law.root(leading.unfinished.energy_density)
        doubled = pytest.approx(max(now, 2 * min(leading.root, begun)), rel=1e-12)
        assert again.root == doubled or limited[-1]
        assert strain >= -1e-15
    assert Outcome.EXHAUSTED in outcomes <= {Outcome.EXHAUSTED, Outcome.UNJAMMED}
    for some in (limited, beyond):
        assert any(some)
        assert not all(some)
    assert search.minimum.energy_density == pytest.approx(1e-12, rel=1e-7, abs=0)
    assert search.minimum.residual.largest <= 1e-8


def begun_at(start, monkeypatch, outcome, force):
    """A way to u0 whose minimisations end like this, with such forces."""
    landscape, state = start_of(start)
    jammed = find(landscape, state, Target(1e-6))

    def ended(*of):
        left = minimise(*of)
        return replace(left, outcome=outcome, residual=left.residual._replace(force=force))

    monkeypatch.setattr(target_of, "minimise", ended)
    return landscape, Leading(jammed, jammed, is_new=False, aim=1e-12, tolerance=1e-8)


@pytest.mark.parametrize(("force", "is_driven"), [(0.1, True), (1e-3, False)])
def test_what_takes_long_is_compressed_only_far_from_rest(force, is_driven, monkeypatch):
    landscape, leading = begun_at("16 rods", monkeypatch, Outcome.EXHAUSTED, force)
    leading.advance(landscape, Target(1e-12))
    assert (leading.unfinished is not None) == is_driven
    assert (leading.jammed is leading.start) == is_driven


@pytest.mark.parametrize(
    ("particles", "dimension", "tolerance"),
    [
        (Particles.of("superellipsoid", p=1.0, w1=1.0, w2=1.0), 3, 1e-2),
        (Particles.of("superellipsoid", p=1.0, w1=0.6, w2=1.0), 3, 1e-4),
        (Particles.of("spherocylinder", alpha=0.0), 2, 1e-4),
    ],
    ids=["spheres", "spheroids", "discs"],
)
def test_spheres_are_led_on_from_rough_minima(particles, dimension, tolerance, monkeypatch):
    landscape, dense = squeezed_at_once(32, particles, dimension)
    jammed = minimise(landscape, dense)
    assert jammed.energy_density > 1e-5
    tolerances = []

    def told(landscape, start, method, stop, *more):
        tolerances.append(stop.tolerance)
        return minimise(landscape, start, method, stop, *more)

    monkeypatch.setattr(target_of, "minimise", told)
    leading = Leading(jammed, jammed, is_new=False, aim=1e-12, tolerance=1e-8)
    leading.advance(landscape, Target(1e-12))
    assert tolerances == [tolerance]


@pytest.mark.parametrize(("start", "is_driven"), [("16 discs", True), ("16 rods", False)])
def test_round_particles_that_stall_far_from_rest_are_compressed(start, is_driven, monkeypatch):
    """Others may have stalled on a kink."""
    landscape, leading = begun_at(start, monkeypatch, Outcome.STALLED, 0.1)
    leading.advance(landscape, Target(1e-12))
    root = leading.root
    assert root < 0.5e-3
    assert (leading.unfinished is not None) == is_driven
    if is_driven:
        leading.advance(landscape, Target(1e-12))
        assert leading.root == pytest.approx(2 * root)


def test_search_yields_after_every_minimisation_and_has_its_minimum_in_the_end_only():
    landscape, state = start_of("16 discs")
    minima, rows = [], []
    for search in extrapolation(landscape, Search(state, 5e-4), Target(1e-9)):
        minima.append(search.minimum)
        rows.append(len(search.history.residual))
    assert minima[-1] is not None
    assert all(m is None for m in minima[:-1])
    assert search.state is minima[-1].state
    assert np.all(np.diff(rows) > 0)
    assert not list(extrapolation(landscape, search, Target(1e-9)))  # nothing is left to do


@pytest.mark.parametrize("strain", [-0.01, 0.01])
def test_starts_above_and_below_jamming_both_arrive(strain):
    landscape, _ = start_of("16 discs")
    start = found("16 discs", 1e-9).state.strained(strain)
    minimum = find(landscape, start, Target(1e-9))
    assert minimum.energy_density == pytest.approx(1e-9, rel=1e-7, abs=0)
    assert minimum.residual.largest <= 1e-8


def test_result_is_a_minimum_at_fixed_box_already():
    landscape, _ = start_of("32 discs")
    minimum = found("32 discs", 1e-9)
    again = minimise(landscape, minimum.state, "newton")
    assert again.outcome is Outcome.CONVERGED
    assert len(again.history.residual) == 1
    assert again.energy_density == pytest.approx(minimum.energy_density, rel=1e-9)


def test_steps_finer_than_the_strain_above_jamming_grow_at_once():
    landscape, _ = start_of("16 discs")
    target = Target(1e-9)
    fine = target.strain_above_jamming(landscape)
    assert 0.1 < fine / math.sqrt(1e-9) < 10
    below = found("16 discs", 1e-9).state.strained(20 * fine)
    search = Search(below, fine / 100)
    steps = [s.step for s in extrapolation(landscape, search, target)]
    growing = steps[: steps.index(max(steps))]
    assert max(steps) > fine
    assert len(growing) < 20
    assert search.minimum is not None


@pytest.mark.parametrize("name", ["u0", "accuracy", "tolerance", "step"])
@pytest.mark.parametrize("value", [0, -1e-9, math.nan, math.inf])
def test_target_refuses(name, value):
    with pytest.raises(ValueError, match=f"^{name} is {value}, expected a positive number$"):
        Target(**{name: value})


@pytest.mark.parametrize("u0", [1e-30, 1e-300, 0.1, 1.0])
def test_energies_out_of_reach_are_refused_before_anything_is_done(u0):
    landscape, state = start_of("16 discs")
    with pytest.raises(ValueError, match=rf"^u0 is {u0:g}, whose overlaps are .*take another u0$"):
        find(landscape, state, Target(u0))
    assert landscape.evaluations == 0


def test_a_start_far_above_jamming_is_opened_until_it_unjams():
    packing, state = quickly_squeezed(24, 0.01, 0.80)
    landscape = Landscape(packing)
    above = find(landscape, state, Target(1e-12)).state.strained(-6e-3)
    minimum = find(landscape, above, Target(1e-15))
    assert minimum.energy_density == pytest.approx(1e-15, rel=1e-7, abs=0)
    assert minimum.residual.largest <= 1e-8


def test_target_is_met_within_its_accuracy():
    target = Target(1e-12, accuracy=1e-3)
    assert [target.is_met(1e-12 * x) for x in (1, 1.0009, 0.9991)] == [True] * 3
    assert [target.is_met(1e-12 * x) for x in (1.0011, 0.9989, 0, math.nan)] == [False] * 4


def stalled(residual, u):
    """A minimum with what an approach to u0 looks at."""
    return SimpleNamespace(
        outcome=Outcome.STALLED, residual=SimpleNamespace(largest=residual), energy_density=u
    )


def test_an_approach_ends_where_minimisations_stall_alike():
    target, way = Target(u0=1e-12), Leading(None, None, tolerance=1e-8, aim=1e-12)
    falling = [0.5, 0.4, 0.3]
    seen = []
    for residual in [*falling, *10 * [0.3]]:
        way.jammed = stalled(residual, 1e-12)
        seen.append(way._is_there(target))
    assert seen.index(True) == len(falling) + 5
    way.jammed = stalled(0.3, 2e-12)  # another energy, not yet there
    assert not way._is_there(target)
