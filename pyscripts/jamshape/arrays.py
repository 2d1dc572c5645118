"""Array types of the library, and validation of numbers in arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
LongArray = NDArray[np.longdouble]


def real_numbers(name: str, values: ArrayLike) -> NDArray[np.generic]:
    """Return an array of integers or floating-point numbers of any size.

    Raises
    ------
    ValueError
        If it is masked, or holds anything else: complex numbers, text, dates, objects.

    Examples
    --------
    >>> real_numbers("size", [1, 2])
    array([1, 2])
    >>> real_numbers("size", [1, 2j])
    Traceback (most recent call last):
    ValueError: size has dtype complex128, expected real numbers
    """
    if isinstance(values, np.ma.MaskedArray):
        msg = f"{name} is a masked array, expected plain numbers: fill or remove masked values"
        raise ValueError(msg)  # noqa: TRY004 - the same for all faults of arrays
    try:
        array = np.asarray(values)
    except ValueError:
        msg = f"{name} has rows of different lengths, expected an array of numbers"
        raise ValueError(msg) from None
    if array.dtype.kind not in "iuf":
        msg = f"{name} has dtype {array.dtype}, expected real numbers"
        raise ValueError(msg)
    return array


def whole_numbers(name: str, values: ArrayLike) -> NDArray[np.generic]:
    """Return an array of integers of any size; errors as `real_numbers`."""
    array = real_numbers(name, values)
    if array.dtype.kind == "f":
        msg = f"{name} has dtype {array.dtype}, expected integers"
        raise ValueError(msg)
    return array
