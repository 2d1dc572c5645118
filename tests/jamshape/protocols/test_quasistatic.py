import numpy as np
import pytest
from superellipsoid_packings import scattered

from jamshape.landscape import Landscape, State
from jamshape.minima import residual_of
from jamshape.protocols.quasistatic import Quasistatic, QuasistaticRun, compress


def begun(n=16, phi=0.5, protocol=None):
    packing = scattered(np.tile([1.0, 1.0, 1.5], (n, 1)), np.ones(n), phi)
    landscape, protocol = Landscape(packing), protocol or Quasistatic(step=5e-3, energy=1e-8)
    return landscape, QuasistaticRun.of(landscape, State.of(packing), protocol), protocol


@pytest.fixture(scope="module")
def ended():
    landscape, compression, protocol = begun()
    rows = [(c.phi, c.step, c.loose_phi) for c in compress(landscape, compression, protocol)]
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


def test_steps_are_halved_from_the_densest_unjammed_state(ended):
    *_, protocol, rows = ended
    _, step, loose = np.array(rows).T
    assert step[0] == protocol.step
    assert set(np.log2(protocol.step / step)) <= set(range(40))
    assert (np.diff(step) <= 0).all()
    assert (np.diff(loose) >= 0).all()
    assert step[-1] < protocol.step


def test_going_on_from_between_two_steps_gives_the_same_to_the_bit(ended):
    expected = ended[1]
    landscape, compression, protocol = begun()
    for k, _ in enumerate(compress(landscape, compression, protocol)):
        if k == 15:
            break
    fresh = QuasistaticRun(
        compression.state,
        compression.phi,
        compression.step,
        compression.loose,
        compression.loose_phi,
    )
    for _ in compress(Landscape(landscape.particles), fresh, protocol):
        pass
    np.testing.assert_array_equal(fresh.state.position, expected.state.position)
    np.testing.assert_array_equal(fresh.state.orientation, expected.state.orientation)


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
