"""Area, volume and moments of dimers: integrals over the union of their discs or balls."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from jamshape import _contact

ALPHAS = [0.0, 1e-6, 0.3, 0.999999, 1.0, 1.5, 100.0]


def integral(function, low, high):
    value, error = quad(function, low, high, epsabs=0, epsrel=1e-13, limit=400)
    assert error <= 1e-10 * abs(value)
    return value


def over_half(weight, A, R):
    """Twice the integral of weight(x, half height) over x > 0; x = A - R cos(t) has no corners."""
    begin = np.arccos(min(A / R, 1.0))

    def along(t):
        return weight(A - R * np.cos(t), R * np.sin(t)) * R * np.sin(t)

    return 2 * integral(along, begin, np.pi)


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("R", [0.5, 13.0])
def test_measure_and_moments_are_integrals_over_the_union(alpha, R, measured):
    A = alpha * R
    diameters, one = 2 * np.array([[A + R, R, R]]), np.ones(1)
    A = 0.5 * (diameters[0, 0] - diameters[0, 1])
    area = over_half(lambda _, y: 2 * y, A, R)
    flat_x = over_half(lambda _, y: 2 / 3 * y**3, A, R) / area
    flat_y = over_half(lambda x, y: 2 * y * x**2, A, R) / area
    plane = _contact.Dimers(diameters, one, 2, 1.0, 1)
    volume = over_half(lambda _, y: np.pi * y**2, A, R)
    about_x = over_half(lambda _, y: 0.5 * np.pi * y**4, A, R) / volume
    about_y = over_half(lambda x, y: np.pi * (y**2 * x**2 + 0.25 * y**4), A, R) / volume
    space = _contact.Dimers(diameters, one, 3, 1.0, 1)
    errors = [plane.measure[0] / area, space.measure[0] / volume]
    errors += list(plane.moment[0] / [flat_x, flat_y, flat_x + flat_y])
    errors += list(space.moment[0] / [about_x, about_y, about_y])
    worst = np.abs(np.array(errors) - 1).max()
    measured(worst=worst)
    assert worst < 1e-10


def test_discs_that_do_not_meet_are_two():
    shape = _contact.Dimers(np.array([[5.0, 1.0, 1.0]]), np.ones(1), 2, 1.0, 1)
    np.testing.assert_allclose(shape.measure, np.pi / 2, rtol=1e-15)
    np.testing.assert_allclose(shape.moment[0], [1 / 16, 4 + 1 / 16, 4 + 1 / 8], rtol=1e-15)
    shape = _contact.Dimers(np.array([[5.0, 1.0, 1.0]]), np.ones(1), 3, 1.0, 1)
    np.testing.assert_allclose(shape.measure, np.pi / 3, rtol=1e-15)
    np.testing.assert_allclose(shape.moment[0], [0.1, 4.1, 4.1], rtol=1e-14)
