"""Particle properties from the class of each shape, against formulas written a second time."""

from __future__ import annotations

import numpy as np
import pytest

from jamshape import _contact

ROD_LIKE = [_contact.Spherocylinders, _contact.Dimers]
CLASSES = [*ROD_LIKE, _contact.Superellipsoids]
EXPECTED = {
    "Spherocylinders": ("spherocylinder", "spines", 2, True, False),
    "Superellipsoids": ("superellipsoid", "centres", 1, False, False),
    "Dimers": ("dimer", "centres", 4, False, True),
}


@pytest.mark.parametrize("shape", CLASSES)
def test_each_class_says_what_it_is(shape):
    names = (shape.name, shape.core, shape.most_bonds, shape.has_sides, shape.bonds_are_contacts)
    assert names == EXPECTED[shape.__name__]
    assert shape.__name__ == shape.name.capitalize() + "s"


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("shape", ROD_LIKE)
def test_sizes_of_what_is_long_along_x(shape, dimension):
    rng = np.random.default_rng(1)
    R = rng.uniform(0.1, 3, 20)
    A = R * rng.uniform(0, 5, 20) * (np.arange(20) % 4 > 0)
    diameters = 2 * np.column_stack([A + R, R, R])
    A, R = (diameters[:, 0] - diameters[:, 1]) / 2, diameters[:, 1] / 2
    found = shape(diameters, np.ones(20), dimension, 1.0, 1)
    np.testing.assert_array_equal(found.rotation_length, A)
    np.testing.assert_array_equal(found.turning_radius, A)
    np.testing.assert_array_equal(found.inner_radius, R)
    np.testing.assert_array_equal(found.outer_radius, A + R)
    np.testing.assert_array_equal(found.symmetry_axis, np.where(A > 0, 0, -1))
    np.testing.assert_array_equal(found.director, np.where(A > 0, 0, -1))


# Diameters and exponent; in 2D and in 3D: whether round, the axis of symmetry, the director.
SUPERELLIPSOIDS = [
    ((1, 1, 1), 1.0, (True, True), 0, (-1, -1)),
    ((1, 1, 2), 1.0, (True, False), 2, (-1, 2)),
    ((2, 1, 1), 1.0, (False, False), 0, (0, 0)),
    ((1, 2, 1), 1.0, (False, False), 1, (1, 1)),
    ((1, 2, 2), 1.0, (False, False), 0, (1, 0)),
    ((1, 2, 3), 1.0, (False, False), -1, (1, 0)),
    ((1, 2, 5), 1.0, (False, False), -1, (1, 2)),
    ((1, 1, 1), 2.0, (False, False), -1, (0, 0)),
    ((1, 1, 2), 2.0, (False, False), -1, (0, 2)),
]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("diameters", "p", "is_round", "symmetric", "director"), SUPERELLIPSOIDS)
def test_sizes_of_superellipsoids(dimension, diameters, p, is_round, symmetric, director):
    shape = _contact.Superellipsoids(np.array([diameters], float), np.array([p]), dimension, 1.0, 1)
    axes = np.array(diameters[:dimension]) / 2
    is_round, director = is_round[dimension - 2], director[dimension - 2]
    outer = axes.max()
    if p > 1:
        e = 2 * p / (p - 1)
        outer *= ((axes / outer) ** e).sum() ** (1 / e)
    np.testing.assert_allclose(shape.outer_radius, [outer], rtol=1e-15)
    assert shape.inner_radius == axes.min()
    assert shape.rotation_length == (0 if is_round else axes[0])
    assert shape.turning_radius == (0 if is_round else shape.outer_radius)
    assert shape.symmetry_axis == symmetric
    assert shape.director == director
    assert shape.symmetry_axis.dtype == shape.director.dtype == np.int64


@pytest.mark.parametrize("shape", CLASSES)
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"dimension": 4}, "dimension is 4, expected 2 or 3."),
        ({"k_e": 0.0}, "k_e is 0, expected a positive energy."),
        ({"k_e": np.nan}, "k_e is nan, expected a positive energy."),
        ({"sides": 3}, "sides is 3, expected 1 or 2."),
        ({"exponent": np.ones(3)}, "diameters and exponent do not have shapes .*"),
        ({"diameters": np.ones((2, 2))}, "diameters and exponent do not have shapes .*"),
        ({"diameters": np.array([[1.0, 1, 1], [0, 0, 0]])}, "particle 1 is not a valid shape: .*"),
    ],
)
def test_bad_particles_are_refused(shape, change, sentence):
    arguments = {"diameters": np.ones((2, 3)), "exponent": np.ones(2), "dimension": 2}
    arguments |= {"k_e": 1.0, "sides": 1}
    with pytest.raises(ValueError, match=f"^{sentence}$"):
        shape(**(arguments | change))


def test_coordinates_are_displacements_and_rotations_of_those_that_turn():
    for dimension, n in ((2, 3 + 2), (3, 6 + 3)):
        diameters = np.array([[2.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
        model = _contact.Dimers(diameters, np.ones(2), dimension, 1.0, 1).local_energy_model(0.1)
        turn = np.zeros((2, 2, 1 if dimension == 2 else 4))
        turn[0, :, 0] = 1.0
        position = np.stack([np.eye(2, dimension), np.zeros((2, dimension))])
        model.move_to(
            position, turn, np.stack([9 * np.eye(dimension), np.zeros((dimension, dimension))])
        )
        assert model.evaluate(np.zeros(n), 0.0, False)[1].shape == (n,)
        with pytest.raises(ValueError, match=f"expected one for each of {n} coordinates"):
            model.evaluate(np.zeros(n + 1), 0.0, False)
