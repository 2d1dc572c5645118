import numpy as np
import pytest
from exchanged import PLACES, mixed, tilted
from scenes import pressed

from jamshape.contacts import find_contacts
from jamshape.exchange.freud import to_freud, to_neighbors
from jamshape.measures.order import orientational_order
from jamshape.measures.order3d import nematic_order

freud = pytest.importorskip("freud")

SINGLE = 1e-6  # freud computes in single precision


@pytest.mark.parametrize(("name", "dimension"), PLACES)
@pytest.mark.parametrize("make", [mixed, tilted])
def test_box_points_and_orientations_are_those_of_the_packing(make, name, dimension):
    packing = make(name, dimension)
    found = to_freud(packing)
    D, box = dimension, found.box
    assert box.is2D == (D == 2)
    np.testing.assert_allclose(box.L[:D], packing.box.edges, rtol=SINGLE)
    np.testing.assert_allclose(box.to_matrix()[:D, :D], packing.box.matrix, rtol=SINGLE)
    np.testing.assert_allclose(box.wrap(found.points), found.points, atol=1e-5)
    apart = packing.position - packing.box.center - found.points[:, :D]
    turns = packing.box.fractions(apart)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-5)
    np.testing.assert_allclose(found.orientations, packing.quaternions, atol=SINGLE)
    np.testing.assert_allclose(found.directors[:, :D], packing.directors, atol=SINGLE)


def test_freud_finds_our_nematic_order_in_space():
    packing = pressed(dimension=3)
    nematic = freud.order.Nematic().compute(to_freud(packing).directors)
    ours = nematic_order(packing.directors)
    assert nematic.order == pytest.approx(ours.magnitude, rel=1e-5)
    assert abs(nematic.director @ ours.direction) == pytest.approx(1, abs=1e-5)


def test_freud_finds_our_nematic_order_in_the_plane():
    packing = pressed()
    nematic = freud.order.Nematic().compute(to_freud(packing).directors)
    S2, theta = orientational_order(packing.orientation, 2)
    assert S2 > 0.05
    # The largest eigenvalue of (3 <s s> - 1) / 2, which freud calls order, of directors in a plane.
    assert nematic.order == pytest.approx(1 / 4 + 3 / 4 * S2, rel=1e-5)
    along = [np.cos(theta), np.sin(theta), 0]
    assert abs(nematic.director @ along) == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("dimension", [2, 3])
def test_contacts_are_neighbours_from_both_sides(dimension):
    packing = pressed(dimension=dimension)
    network = find_contacts(packing)
    found = to_neighbors(packing, network)
    assert len(found) == 2 * len(network.pairs) > 0
    pairs, distances = np.array(found[:]), np.linalg.norm(network.separation, axis=1)
    expected = sorted([*map(tuple, network.pairs), *map(tuple, network.pairs[:, ::-1])])
    assert sorted(map(tuple, pairs)) == expected
    np.testing.assert_allclose(
        np.sort(found.distances), np.sort(np.tile(distances, 2)), rtol=SINGLE
    )
    points = to_freud(packing).points
    box = to_freud(packing).box
    between = box.wrap(points[pairs[:, 1]] - points[pairs[:, 0]])
    near = np.linalg.norm(between, axis=1) < box.L[:dimension].min() / 2
    np.testing.assert_allclose(found.vectors[near], between[near], atol=1e-5)


def test_freud_averages_over_our_contacts():
    packing = pressed()
    network, there = find_contacts(packing), to_freud(packing)
    hexatic = freud.order.Hexatic(k=6).compute(
        there.system, neighbors=to_neighbors(packing, network)
    )
    angle = np.arctan2(network.separation[:, 1], network.separation[:, 0])
    psi, count = np.zeros(packing.n, complex), np.zeros(packing.n)
    for k in range(2):  # a sixfold bond looks the same from both ends
        np.add.at(psi, network.pairs[:, k], np.exp(6j * angle))
        np.add.at(count, network.pairs[:, k], 1)
    touched = count > 0
    expected = psi[touched] / count[touched]
    np.testing.assert_allclose(hexatic.particle_order[touched], expected, atol=1e-5)
