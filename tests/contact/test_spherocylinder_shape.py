"""Area, volume and moments against quadrature and against the printed formula."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import nquad

from jamshape._contact import Spherocylinders

ALPHAS = [0.0, 1e-6, 0.01, 1.0, 4.0, 100.0]
RADII = [0.5, 0.7, 13.0]
HALF_TURN = (-0.5 * np.pi, 0.5 * np.pi)


def integral(function, *limits):
    value, error = nquad(function, limits, opts={"epsabs": 0.0, "epsrel": 1e-13})
    assert error <= 1e-11 * abs(value)
    return value


def over_plane(weight, A, R):
    """Integral of weight(x, y) over the two half discs (in polar coordinates) and the rectangle."""
    total = 2.0 * integral(
        lambda rho, phi: rho * weight(A + rho * np.cos(phi), rho * np.sin(phi)), (0.0, R), HALF_TURN
    )
    if A > 0.0:
        total += integral(weight, (-A, A), (-R, R))
    return total


def over_space(weight, A, R):
    """Integral of weight(x, rho^2) over the two half balls and the cylinder; rho is from the axis."""
    total = 2.0 * integral(
        lambda r, c: 2.0 * np.pi * r**2 * weight(A + r * c, r**2 * (1.0 - c**2)),
        (0.0, R),
        (0.0, 1.0),
    )
    if A > 0.0:
        total += integral(
            lambda x, rho: 2.0 * np.pi * rho * weight(x, rho**2), (-A, A), (0.0, R)
        )  # fmt: skip
    return total


def drag_of(A, R, dimension):
    """Drag of many particles; A and R as the diameters round them."""
    diameters = 2 * np.column_stack([A + R, R, R])
    found = Spherocylinders(diameters, np.ones(len(diameters)), dimension, 1.0, 1)
    return found.measure, found.moment


def drag(A, R, dimension):
    measure, moment = drag_of(np.array([A]), np.array([R]), dimension)
    return measure[0], moment[0]


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("R", RADII)
def test_area_and_moment_are_integrals_over_the_shape(alpha, R, measured):
    A = alpha * R
    area = over_plane(lambda x, y: 1.0 + 0.0 * x * y, A, R)
    about_x = over_plane(lambda x, y: y**2 + 0.0 * x, A, R) / area
    about_y = over_plane(lambda x, y: x**2 + 0.0 * y, A, R) / area
    measure, moment = drag(A, R, 2)
    expected = np.array([about_x, about_y, about_x + about_y])
    worst = max(abs(measure / area - 1.0), np.abs(moment / expected - 1.0).max())
    measured(worst=worst)
    assert worst < 1e-10


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("R", RADII)
def test_volume_and_moments_are_integrals_over_the_shape(alpha, R, measured):
    A = alpha * R
    volume = over_space(lambda x, q: 1.0 + 0.0 * x * q, A, R)
    about_x = over_space(lambda x, q: q + 0.0 * x, A, R) / volume
    about_y = over_space(lambda x, q: x**2 + 0.5 * q, A, R) / volume  # <z^2> is half of <rho^2>
    measure, moment = drag(A, R, 3)
    assert moment[1] == moment[2]
    worst = max(abs(measure / volume - 1.0), abs(moment[0] / about_x - 1.0),
                abs(moment[1] / about_y - 1.0))  # fmt: skip
    measured(worst=worst)
    assert worst < 1e-10


def test_moment_is_equation_10_as_printed():
    """Marschall & Teitel 2018, Eq. 10: I = R^2 (3 pi + 24 a + 6 pi a^2 + 8 a^3) / (6 pi + 24 a)."""
    alpha = np.concatenate([ALPHAS, np.geomspace(1e-6, 100.0, 1000)])
    R = np.resize(RADII, alpha.size)
    measure, moment = drag_of(alpha * R, R, 2)
    printed = (3.0 * np.pi + 24.0 * alpha + 6.0 * np.pi * alpha**2 + 8.0 * alpha**3) / (
        6.0 * np.pi + 24.0 * alpha
    )
    np.testing.assert_allclose(moment[:, 2], R**2 * printed, rtol=8 * np.finfo(float).eps)
    np.testing.assert_allclose(measure, R**2 * (4.0 * alpha + np.pi), rtol=4 * np.finfo(float).eps)


def test_discs_and_balls():
    R = np.array(RADII)
    area, plane = drag_of(np.zeros(3), R, 2)
    np.testing.assert_allclose(area, np.pi * R**2, rtol=1e-15)
    np.testing.assert_allclose(plane[:, 2], 0.5 * R**2, rtol=1e-15)
    volume, space = drag_of(np.zeros(3), R, 3)
    np.testing.assert_allclose(volume, 4.0 / 3.0 * np.pi * R**3, rtol=1e-15)
    np.testing.assert_allclose(space, np.tile(0.4 * R[:, None] ** 2, 3), rtol=1e-15)
