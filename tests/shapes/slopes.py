"""Slopes by differences that know their own error."""

import numpy as np
from every_shape import EPS

LONG_EPS = float(np.finfo(np.longdouble).eps)


def slope_at_0(function, step):
    """Slope of a function of one number, and a bound of its error.

    A central difference over a step twice as long is off four times as much: what both differ by, over
    three, is the error of the shorter one. It is taken off, and three times as much is allowed.
    """
    near, far = ((function(s) - function(-s)) / (2 * s) for s in (step, 2 * step))
    return near + (near - far) / 3, np.abs(near - far).max()


def assert_is_slope(found, function, step, scale, size=1.0):
    """A slope as differences give it, within their error, which must be below a millionth of the scale.

    The function's values are rounded to doubles, what it is of, numbers up to a size, to long doubles.
    """
    expected, error = slope_at_0(function, step)
    rounding = EPS * np.abs([function(step), function(-step)]).max() + LONG_EPS * size * scale
    tolerance = error + 4 * rounding / step
    assert tolerance < 1e-6 * scale
    off = float(np.abs(found - expected).max())
    assert off <= tolerance
    return off / scale
