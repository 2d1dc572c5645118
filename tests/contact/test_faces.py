"""On which contacts particles lie on faces: what holds them without a third contact."""

from __future__ import annotations

import numpy as np
import pytest

from jamshape import _contact

FACE = 0.1  # of the curvature of the ellipsoid of the same axes


def found(shape, position, orientation, edge):
    """Contacts of all pairs of a few particles, in boxes where no image is near."""
    position = np.asarray(position, float)
    n, dimension = position.shape
    pairs = np.array([(i, j) for i in range(n) for j in range(i + 1, n)])
    shift = np.zeros((len(pairs), dimension), np.int64)
    turn = np.asarray(orientation, float).reshape(n, -1)
    poses = (position, turn, edge * np.eye(dimension))
    return shape.contacts(*(np.stack([x, np.zeros_like(x)]) for x in poses), pairs, shift)


def superellipsoids(axes, p, dimension=3):
    diameters = 2 * np.asarray(axes, float)
    return _contact.Superellipsoids(diameters, np.full(len(axes), float(p)), dimension, 1.0, 1)


def faces_of_two(axes, p, offset, tilt=0.0, dimension=3):
    """Whether i, j, each touch on a face: j above i along y, shifted and turned."""
    a = np.asarray(axes, float)
    position = np.zeros((2, dimension))
    position[1, 0], position[1, 1] = offset, 1.98 * a[1]
    turn = [[0.0], [tilt]]
    if dimension == 3:
        turn = [[1, 0, 0, 0], [np.cos(tilt / 2), 0, 0, np.sin(tilt / 2)]]
    contacts = found(superellipsoids([a, a], p, dimension), position, turn, 50.0)
    assert contacts["status"].tolist() == [1]
    return contacts["bond_on_face"][0, 0].tolist()


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("axes", [(1.0, 1.0, 1.0), (2.0, 0.5, 1.0)])
def test_cubes_touch_on_faces_and_ellipsoids_nowhere(axes, dimension):
    assert faces_of_two(axes, 5, 0.0, dimension=dimension) == [True, True]
    assert faces_of_two(axes, 5, 0.2, 1e-4, dimension=dimension) == [True, True]
    for p in (0.75, 1.0):
        assert faces_of_two(axes, p, 0.0, dimension=dimension) == [False, False]


@pytest.mark.parametrize("p", [2.0, 5.0, 10.0])
def test_a_face_ends_where_the_curvature_is_a_tenth_of_an_ellipsoids(p):
    """Equal bodies, shifted but not turned: they touch midway, off their axes by half the shift."""
    end = (FACE / (2 * p - 1)) ** (0.5 / (p - 1))
    for dimension in (2, 3):
        assert faces_of_two((1, 1, 1), p, 2 * end * 0.98, dimension=dimension) == [True, True]
        assert faces_of_two((1, 1, 1), p, 2 * end * 1.04, dimension=dimension) == [False, False]


def test_an_edge_is_flat_in_one_direction_only():
    """A cube that stands on its edge upon another: a face of that one."""
    tilt = np.pi / 4
    position = [[0.0, 0.0, 0.0], [0.0, 2.2, 0.0]]
    turn = [[1, 0, 0, 0], [np.cos(tilt / 2), 0, 0, np.sin(tilt / 2)]]
    contacts = found(superellipsoids(np.ones((2, 3)), 5), position, turn, 50.0)
    assert contacts["bond_on_face"][0, 0].tolist() == [True, False]


@pytest.mark.parametrize("sides", [1, 2])
@pytest.mark.parametrize("dimension", [2, 3])
def test_sides_of_rods_are_faces_in_the_plane_only(dimension, sides):
    diameters = np.array([[5.0, 1.0, 1.0], [5.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
    rods = _contact.Spherocylinders(diameters, np.ones(3), dimension, 1.0, sides)
    position = np.zeros((3, dimension))
    position[1, :2], position[2, :2] = (0.7, 0.95), (-1.0, -0.95)
    turn = np.zeros((3, 1)) if dimension == 2 else np.eye(4)[[0, 0, 0]]
    contacts = found(rods, position, turn, 50.0)
    n_bonds = contacts["n_bonds"]
    assert n_bonds.tolist() == [sides, 1]
    flat = contacts["bond_on_face"][0, : n_bonds[0]].any(axis=0)
    assert flat.tolist() == 2 * [dimension == 2]
    assert contacts["bond_on_face"][1, 0].tolist() == [dimension == 2, False]
    assert contacts["bond_on_side"][1, 0].tolist() == [True, False]  # as in `compute contact/local`


@pytest.mark.parametrize("extended", [False, True])
def test_derivatives_tell_the_same_faces(extended):
    rng = np.random.default_rng(3)
    shape = superellipsoids(rng.uniform(0.8, 1.2, (40, 3)), 5)
    position = np.stack(np.meshgrid(*[1.9 * np.arange(4)] * 3), -1).reshape(-1, 3)[:40]
    turn = np.array([1, 0, 0, 0]) + rng.normal(scale=0.05, size=(40, 4))
    near = [
        (i, j) for i in range(40) for j in range(i) if np.linalg.norm(position[i] - position[j]) < 2
    ]
    poses = (position, turn, 50.0 * np.eye(3))
    arguments = [np.stack([x, np.zeros_like(x)]) for x in poses]
    arguments += [np.array(near), np.zeros((len(near), 3), np.int64)]
    contacts, other = shape.contacts(*arguments), shape.derivatives(*arguments, extended)
    assert np.array_equal(contacts["pair"], other["pair"])
    assert np.array_equal(contacts["bond_on_face"], other["on_face"])
    assert 0 < contacts["bond_on_face"].mean() < 1
