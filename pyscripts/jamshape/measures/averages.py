"""Averages over samples, with their standard errors."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray

# Digits after the point that a number is written with, at least and at most.
_DIGITS = (3, 9)


class Mean(NamedTuple):
    """An average over samples with its standard error."""

    value: float
    error: float = math.nan
    """NaN for one sample."""
    samples: int = 0
    """0 where that is not known."""

    def text(self, plus_minus: str = "+-") -> str:
        """Write the digits that the error leaves; empty for NaN."""
        if not math.isfinite(self.value):
            return ""
        if not math.isfinite(self.error):
            return f"{self.value:.4f}"
        digits = math.ceil(-math.log10(self.error)) if self.error > 0 else _DIGITS[1]
        digits = min(max(digits, _DIGITS[0]), _DIGITS[1])
        return f"{self.value:.{digits}f} {plus_minus} {self.error:.{digits}f}"


def mean(values: ArrayLike) -> Mean:
    """Average over samples; NaN are left out, and an average of none is NaN.

    Examples
    --------
    >>> mean([1.0, 3.0, float("nan")])
    Mean(value=2.0, error=1.0, samples=2)
    """
    array = np.asarray(values, np.float64)
    array = array[np.isfinite(array)]
    n = len(array)
    error = float(np.std(array, ddof=1) / np.sqrt(n)) if n > 1 else math.nan
    return Mean(float(array.mean()) if n else math.nan, error, n)


def standard_error(values: ArrayLike) -> FloatArray:
    """Return the standard error of the mean over the first axis; 0 for one sample."""
    array = np.asarray(values, np.float64)
    return np.asarray(array.std(axis=0) / np.sqrt(max(len(array) - 1, 1)))
