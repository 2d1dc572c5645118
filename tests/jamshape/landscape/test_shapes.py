"""Pairs and contacts of superellipsoids in packings; derivatives are in test_landscape and test_hessian."""

import numpy as np
import pytest
from superellipsoid_packings import (
    ellipsoids,
    octahedra_and_boxes,
    pressed_superellipsoids,
    scattered,
    superellipses,
)

from jamshape.contacts import forces
from jamshape.landscape import State
from jamshape.shapes.roundness import volume


def test_packing_fraction_is_that_of_the_volumes():
    packing = octahedra_and_boxes()
    expected = volume(packing.diameters / 2, packing.exponent).sum() / packing.box.volume
    assert packing.phi == pytest.approx(expected, rel=1e-13)


def test_body_axes_are_those_of_the_quaternions():
    packing = ellipsoids()
    axes = np.stack([packing.body_axes(k) for k in range(3)], axis=1)
    np.testing.assert_allclose(
        axes @ axes.transpose(0, 2, 1), np.tile(np.eye(3), (12, 1, 1)), atol=1e-14
    )
    np.testing.assert_allclose(packing.body_axes(0), packing.axes, atol=1e-14)
    np.testing.assert_allclose(np.cross(axes[:, 0], axes[:, 1]), axes[:, 2], atol=1e-14)
    flat = superellipses()
    np.testing.assert_allclose((flat.body_axes(0) * flat.body_axes(1)).sum(axis=1), 0, atol=1e-15)


def test_spheroids_have_an_axis_that_nothing_turns_them_about():
    diameters = np.array([[1.0, 1, 3], [1, 2, 2], [2, 1, 2], [1, 2, 3], [1, 1, 1], [1, 1, 3]])
    packing = scattered(diameters, np.array([1.0, 1, 1, 1, 1, 2]), 0.1)
    assert packing.symmetry_axis.tolist()[:4] == [2, 0, 1, -1]
    assert packing.symmetry_axis[5] == -1  # its section is no circle
    assert packing.is_round.tolist() == [False] * 4 + [True, False]
    axes = packing.turning_axes
    assert (axes != 0).any(axis=2).sum(axis=1).tolist() == [2, 2, 2, 3, 2, 3]
    own = np.stack([packing.body_axes(k)[m] for m, k in enumerate((2, 0, 1))])
    np.testing.assert_allclose(np.einsum("nrt,nt->nr", axes[:3], own), 0, atol=1e-14)


def test_exponents_below_a_half_are_refused():
    with pytest.raises(ValueError, match=r"exponents hold 0.5, expected p > 0.5"):
        scattered(np.ones((2, 3)), np.array([1.0, 0.5]), 0.1)


def test_deep_overlaps_and_extreme_shapes_give_finite_forces():
    for p in (0.55, 10.0):
        diameters = np.array([[0.1, 1.0, 1.0], [1.0, 1.0, 10.0], [1.0, 1.0, 1.0]] * 4)
        packing = pressed_superellipsoids(diameters, np.full(12, p), 0.1)
        squeezed = State.of(packing).strained(-0.1).packing(packing)
        found = forces(squeezed)
        assert np.isfinite(found.force).all()
        assert np.isfinite(found.torque).all()
        assert found.energy > forces(packing).energy
