"""Validation of array arguments: checked, copied and made read-only."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray, IntArray, real_numbers, whole_numbers


def as_floats(name: str, values: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """Return finite numbers of a shape, or raise a ValueError."""
    array = np.array(real_numbers(name, values), dtype=np.float64, order="C")
    _check_shape(name, array.shape, shape)
    if not np.isfinite(array).all():
        msg = f"{name} holds NaN or infinity, expected finite numbers"
        raise ValueError(msg)
    array.flags.writeable = False
    return array


def as_integers(name: str, values: ArrayLike, shape: tuple[int, ...]) -> IntArray:
    """Return integers of a shape, or raise a ValueError."""
    array = np.array(whole_numbers(name, values), dtype=np.int64, order="C")
    _check_shape(name, array.shape, shape)
    array.flags.writeable = False
    return array


def _check_shape(name: str, found: tuple[int, ...], expected: tuple[int, ...]) -> None:
    if found != expected:
        msg = f"{name} has shape {found}, expected {expected}"
        raise ValueError(msg)
