import numpy as np
import pytest
from mixtures import monodisperse, superellipsoids

from jamshape.measures.local_order import local_order
from jamshape.measures.order3d import local_cubatic_order, local_nematic_order
from jamshape.packing import body_axes
from jamshape.protocols.random_start import random_packing

PAIRS = np.array([[0, 1], [0, 2], [1, 2], [3, 4]])


def test_neighbours_in_the_plane():
    packing = random_packing(6, 0.2, 1, monodisperse(2.0))
    angle = np.array([0.3, 0.3, 0.3 + np.pi / 2, 0.1, 0.1 + np.pi, 1.0])
    found = local_order(packing.with_(orientation=angle), PAIRS)
    # The neighbours of 0 are square to each other: no nematic, perfect tetratic order.
    assert found["S2"][:5] == pytest.approx([0, 0, 1, 1, 1], abs=1e-12)
    assert found["S4"][:5] == pytest.approx(np.ones(5))
    assert np.isnan([found["S2"][5], found["S4"][5]]).all(), "no neighbour"


def test_round_particles_have_no_direction():
    packing = random_packing(6, 0.2, 1, monodisperse(0.0))
    assert all(np.isnan(values).all() for values in local_order(packing, PAIRS).values())


def test_neighbours_in_space_are_those_of_the_papers_order():
    packing = random_packing(6, 0.1, 1, superellipsoids(1.0, 0.6), 3)
    found = local_order(packing, PAIRS)
    np.testing.assert_allclose(found["S2"], local_nematic_order(packing.directors, PAIRS))
    axes = body_axes(packing.quaternions)
    np.testing.assert_allclose(found["C4"], local_cubatic_order(axes, PAIRS))


def test_cubes_have_cubatic_order_without_directors():
    packing = random_packing(6, 0.1, 1, superellipsoids(2.0), 3)
    aligned = packing.with_(orientation=np.tile([1.0, 0, 0, 0], (6, 1)))
    found = local_order(aligned, PAIRS)
    assert found["C4"][:5] == pytest.approx(np.ones(5))
