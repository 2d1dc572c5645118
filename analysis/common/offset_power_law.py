"""Fit of a + b alpha^x (Marschall & Teitel 2018, Fig. 8 b)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from jamshape.arrays import FloatArray

_EXPONENTS = (0.05, 5.0)  # range of x searched for a + b alpha^x
_AT_END = 1e-3  # distance from its ends within which a fit has failed


class OffsetPowerLaw(NamedTuple):
    """The curve a + b alpha^x, with standard errors; NaN where they cannot be estimated."""

    a: float
    b: float
    x: float
    a_error: float
    b_error: float
    x_error: float

    def at(self, alpha: ArrayLike) -> FloatArray:
        """Evaluate the curve."""
        curve: FloatArray = self.a + self.b * np.asarray(alpha, np.float64) ** self.x
        return curve


def fit_offset_power_law(
    alpha: ArrayLike, values: ArrayLike, errors: ArrayLike | None = None
) -> OffsetPowerLaw:
    """Fit a + b alpha^x by least squares.

    Marschall & Teitel 2018, Fig. 8(b): the contact number above 4 at the four smallest alpha.

    Parameters
    ----------
    alpha, values : (K,) array_like
        At least three different alpha above 0.
    errors : (K,) array_like, optional
        Standard errors of the values, above 0. Without them all values have equal weight, and the
        scatter about the curve gives the errors, if there are more than three values.

    Returns
    -------
    OffsetPowerLaw

    Raises
    ------
    ValueError
        If there are fewer than three alpha, a number is out of its range, or the best exponent is not between
        0.05 and 5.
    """
    x, y = np.asarray(alpha, np.float64), np.asarray(values, np.float64)
    sigma = np.ones_like(y) if errors is None else np.asarray(errors, np.float64)
    if x.ndim != 1 or not x.shape == y.shape == sigma.shape or len(np.unique(x)) < 3:
        found = f"alpha, values and errors have shapes {x.shape}, {y.shape} and {sigma.shape}"
        msg = f"{found} and {len(np.unique(x))} different alpha, expected (K,) with at least 3"
        raise ValueError(msg)
    if not ((x > 0).all() and (sigma > 0).all() and np.isfinite([x, y, sigma]).all()):
        msg = "alpha, values or errors hold a number out of range, expected alpha and errors > 0"
        raise ValueError(msg)

    def line(exponent: float) -> tuple[FloatArray, float]:
        powers = np.column_stack([np.ones_like(x), x**exponent]) / sigma[:, None]
        solution = np.linalg.lstsq(powers, y / sigma, rcond=None)[0].astype(np.float64)
        return solution, float(((powers @ solution - y / sigma) ** 2).sum())

    tried = np.geomspace(*_EXPONENTS, 200)
    best = tried[np.argmin([line(exponent)[1] for exponent in tried])]
    near = (best * tried[0] / tried[1], best * tried[1] / tried[0])
    exponent = float(minimize_scalar(lambda e: line(e)[1], bounds=near, method="bounded").x)
    if not _EXPONENTS[0] * (1 + _AT_END) < exponent < _EXPONENTS[1] * (1 - _AT_END):
        found = "no exponent of alpha between {:g} and {:g} fits best".format(*_EXPONENTS)
        msg = f"{found}, expected values with a limit as alpha goes to 0 and with small errors"
        raise ValueError(msg)
    (a, b), chi_squared = line(exponent)
    power = x**exponent
    slopes = np.column_stack([np.ones_like(x), power, b * power * np.log(x)]) / sigma[:, None]
    covariance = np.linalg.pinv(slopes.T @ slopes)
    if errors is None:
        covariance *= chi_squared / (len(x) - 3) if len(x) > 3 else np.nan
    return OffsetPowerLaw(float(a), float(b), exponent, *np.sqrt(np.diag(covariance)).tolist())
