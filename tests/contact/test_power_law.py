"""Contacts of two discs under laws of any power against closed forms in fifty digits."""

import mpmath
import numpy as np
import pytest

from jamshape import _contact

K_E = 1.7
OVERLAPS = [0.5, 1e-1, 1e-2, 1e-4, 1e-6, 1e-8]
POWERS = [2.0, 2.5, 3.0, 3.7, 4.0]
EPS = np.finfo(float).eps


def two(power, overlap, dimension):
    """Discs of R = 1 and 1.5, along x, with their arguments; the overlap is rounded with the separation."""
    diameters = np.array([[2.0] * 3, [3.0] * 3])
    position = np.zeros((2, 2, dimension))
    position[0, 1, 0] = 2.5 * (1.0 - overlap)
    orientation = np.zeros((2, 2, 1 if dimension == 2 else 4))
    if dimension == 3:
        orientation[0, :, 0] = 1.0
    cell = np.zeros((2, dimension, dimension))
    cell[0] = 100.0 * np.eye(dimension)
    pairs, shift = np.array([[0, 1]]), np.zeros((1, dimension), np.int64)
    discs = _contact.Spherocylinders(diameters, np.ones(2), dimension, K_E, 2, power)
    return discs, (position, orientation, cell, pairs, shift), position[0, 1, 0]


def exact(power, distance):
    """Energy and its first two derivatives by the distance."""
    with mpmath.workdps(50):
        d, A, k = mpmath.mpf(2.5), mpmath.mpf(power), mpmath.mpf(K_E)
        x = 1 - mpmath.mpf(float(distance)) / d
        found = k / A * x**A, -k / d * x ** (A - 1), (A - 1) * k / d**2 * x ** (A - 2)
        return [float(number) for number in found]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("overlap", OVERLAPS)
@pytest.mark.parametrize("power", POWERS)
def test_energy_force_and_stiffness_are_those_of_the_formula(power, overlap, dimension):
    discs, arguments, distance = two(power, overlap, dimension)
    energy, slope, bend = exact(power, distance)
    rounding = 8 * EPS * (1 + abs(power * np.log(overlap)))  # powers of packs, and of the overlap
    for extended in (False, True):
        sums = discs.sums(*arguments, extended)
        assert sums["energy"] == pytest.approx(energy, rel=rounding, abs=0)
        assert sums["force"][0, 0] == pytest.approx(slope, rel=rounding, abs=0)
        assert sums["force"][1, 0] == -sums["force"][0, 0]
        found = discs.derivatives(*arguments, extended)
        assert found["energy"][0] == pytest.approx(energy, rel=rounding, abs=0)
        assert found["stiffness"][0, 0] == pytest.approx(bend, rel=rounding, abs=0)
        expected = np.zeros((dimension, dimension))
        expected[range(1, dimension), range(1, dimension)] = slope / distance
        curvature = found["curvature"][0, :dimension, :dimension]
        np.testing.assert_allclose(curvature, expected, rtol=0, atol=rounding * abs(slope))


@pytest.mark.parametrize("power", [1.0, 1.999, -2.5, np.nan, np.inf])
def test_other_powers_are_refused(power):
    with pytest.raises(ValueError, match=r"power is .*, expected a number from 2 on"):
        _contact.Spherocylinders(np.ones((1, 3)), np.ones(1), 2, 1.0, 2, power)
