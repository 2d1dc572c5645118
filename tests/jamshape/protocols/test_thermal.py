import numpy as np
import pytest
from mixtures import bidisperse
from superellipsoid_packings import scattered

from jamshape.contacts import find_contacts
from jamshape.landscape import Landscape, State
from jamshape.minima import Stop, minimise
from jamshape.packing import Box, body_axes
from jamshape.protocols.random_start import random_packing
from jamshape.protocols.thermal import Thermal, equilibrate, without_overlaps
from methods.lbfgs import lbfgs


def loose(diameters, exponent, phi, dimension=3):
    """Without overlaps."""
    packing = scattered(
        np.asarray(diameters, float), np.asarray(exponent, float), phi, 5, dimension
    )
    found = minimise(Landscape(packing), State.of(packing), lbfgs, Stop(lowest=1e-12))
    return without_overlaps(found.state.packing(packing))


def spheroids(phi=0.3):
    return loose(np.tile([1.0, 1.0, 1.6], (40, 1)), np.ones(40), phi)


def test_no_particles_ever_overlap():
    thermal = Thermal(spheroids())
    start = thermal.packing
    for _ in equilibrate(thermal, 60, seed=1):
        assert len(find_contacts(thermal.packing).pairs) == 0
    moved = thermal.packing.position - start.position
    assert (np.abs(moved) > 1e-3).all(axis=1).mean() > 0.9
    assert thermal.n_done == 60


def test_moves_are_led_to_an_acceptance():
    thermal = Thermal(spheroids(), size=2.0)
    for _ in equilibrate(thermal, 400, seed=1):
        pass
    assert 0.25 < thermal.acceptance < 0.45
    assert thermal.size < 2.0


def test_the_sequence_depends_on_the_seed_and_may_be_cut():
    whole, cut, other = (Thermal(spheroids()) for _ in range(3))
    for thermal, seed in ((whole, 1), (other, 2)):
        for _ in equilibrate(thermal, 30, seed):
            pass
    for k, _ in enumerate(equilibrate(cut, 30, 1)):
        if k == 1:
            break
    assert cut.n_done == 20
    fresh = Thermal(cut.packing, cut.n_done, cut.size)
    for _ in equilibrate(fresh, 30, 1):
        pass
    np.testing.assert_array_equal(fresh.packing.position, whole.packing.position)
    assert not np.array_equal(other.packing.position, whole.packing.position)


def test_two_spheres_have_the_distribution_of_free_places():
    # All places outside the other sphere are equally likely: the mean of any function is an integral.
    edge, n = 4.2, 4000
    packing = scattered(np.ones((2, 3)), np.ones(2), 0.01)
    packing = packing.with_(box=Box(np.zeros(3), np.full(3, edge)))
    compiled, position, distance = packing.compiled(), np.array([[0.0, 0, 0], [2.0, 2, 2]]), []
    for k in range(n):
        found = compiled.sweeps(position, packing.orientation, packing.box.edges, 2.0, 0.5, 3, k)
        position = found["position"]
        r = position[0] - position[1]
        distance.append(np.linalg.norm(r - edge * np.round(r / edge)))
    assert min(distance) >= 1.0
    grid = (np.arange(64) + 0.5) / 64 * edge - edge / 2
    place = np.stack(np.meshgrid(grid, grid, grid), axis=-1).reshape(-1, 3)
    free = np.linalg.norm(place, axis=1)
    free = free[free >= 1]
    error = free.std() / np.sqrt(n)
    assert np.mean(distance) == pytest.approx(free.mean(), abs=5 * error)


def test_orientations_of_a_lone_particle_become_uniform():
    packing = scattered(np.array([[1.0, 1, 3], [1, 1, 3]]), np.ones(2), 0.01)
    compiled, orientation, axis = packing.compiled(), packing.orientation, []
    position = np.array([[0.0, 0, 0], [1, 1, 1]]) * packing.box.edges / 2
    for k in range(3000):
        found = compiled.sweeps(position, orientation, packing.box.edges, 0.1, 1.0, 3, k)
        position, orientation = found["position"], found["orientation"]
        axis.append(body_axes(orientation)[0, 2])
    mean = np.mean([np.outer(a, a) for a in axis], axis=0)
    np.testing.assert_allclose(mean, np.eye(3) / 3, atol=0.03)


def test_discs_in_the_plane_turn_and_keep_apart():
    packing = loose(np.tile([1.0, 2.0, 1.0], (20, 1)), np.full(20, 2.0), 0.4, dimension=2)
    thermal = Thermal(packing)
    for _ in equilibrate(thermal, 30, seed=3):
        assert len(find_contacts(thermal.packing).pairs) == 0
    assert np.abs(thermal.packing.orientation - packing.orientation).max() > 1e-2


def test_overlaps_and_small_boxes_are_refused():
    packing = spheroids()
    close = packing.with_(position=0.5 * packing.position)
    with pytest.raises(ValueError, match="particles overlap, expected a start without overlaps"):
        next(equilibrate(Thermal(close), 10, 1))
    alone = scattered(np.ones((1, 3)), np.ones(1), 0.2)
    with pytest.raises(ValueError, match="box is shorter than two particles"):
        next(equilibrate(Thermal(alone), 10, 1))


@pytest.mark.parametrize("size", [0.0, -1.0, np.nan, np.inf])
def test_moves_without_a_size_are_refused(size):
    with pytest.raises(ValueError, match=f"size is {size}, expected a positive number"):
        next(equilibrate(Thermal(spheroids(), size=size), 10, 1))


@pytest.mark.parametrize("dimension", [2, 3])
def test_rods_move_and_keep_apart(dimension):
    start = random_packing(100, 0.3, 1, bidisperse(1.0), dimension)
    thermal = Thermal(start)
    for _ in equilibrate(thermal, 30, 2):
        assert not len(find_contacts(thermal.packing).pairs)
    assert 0.1 < thermal.acceptance < 1
    assert (np.abs(thermal.packing.position - start.position).max(axis=1) > 0).all()


def test_opening_the_box_removes_the_last_overlaps():
    packing = scattered(np.tile([1.0, 1.0, 1.5], (30, 1)), np.ones(30), 0.55)
    found = minimise(Landscape(packing), State.of(packing), lbfgs, Stop(lowest=1e-10))
    touching = found.state.packing(packing)
    assert len(find_contacts(touching).pairs) > 0
    opened = without_overlaps(touching)
    assert len(find_contacts(opened).pairs) == 0
    assert 0.999 < opened.phi / touching.phi < 1
