"""Slopes by differences that know their own error."""

import numpy as np

EPS = float(np.finfo(float).eps)


def slope_at_0(function, step):
    """Slope of a function of one number, and a bound of its error.

    A central difference over a step twice as long is off four times as much: what both differ by, over
    three, is the error of the shorter one. It is taken off, and three times as much is allowed.
    """
    near, far = ((function(s) - function(-s)) / (2 * s) for s in (step, 2 * step))
    return near + (near - far) / 3, np.abs(near - far).max()


def assert_is_slope(found, function, step, scale):
    """A slope as differences give it, within their error, which must be below a millionth of the scale.

    The function's values are rounded to doubles, its argument to many more digits.
    """
    expected, error = slope_at_0(function, step)
    tolerance = error + 4 * EPS * np.abs([function(step), function(-step)]).max() / step
    assert tolerance < 1e-6 * scale
    off = float(np.abs(found - expected).max())
    assert off <= tolerance
    return off / scale
