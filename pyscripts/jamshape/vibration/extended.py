"""Matrix products in extended precision: long doubles for sparse factors, slices for dense ones.

Processors multiply long doubles one by one, which suffices for sparse factors with few entries a row. Dense
factors are cut into slices of so few bits that BLAS multiplies them without rounding (Ozaki, Ogita, Oishi
and Rump, Numer. Algorithms 59, 95 (2012)).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jamshape import _contact
from jamshape.arrays import FloatArray, LongArray

EPS = float(np.finfo(np.longdouble).eps)

# Required bits of a product: those of a long double, 64 on x86-64 and 113 on aarch64.
_BITS = np.finfo(np.longdouble).nmant + 1


class SparseRows:
    """A sparse matrix of doubles that multiplies dense ones in long double.

    Parameters
    ----------
    matrix : (m, n) scipy.sparse matrix
    """

    def __init__(self, matrix: Any) -> None:
        matrix = matrix.tocsr()
        self.shape = matrix.shape
        self._first, self._column = (
            np.asarray(a, np.int64) for a in (matrix.indptr, matrix.indices)
        )
        self._value = np.asarray(matrix.data, np.float64)

    def __matmul__(self, dense: NDArray[Any]) -> LongArray:
        """(m, k) product with an (n, k) matrix, or (m,) with an (n,) vector."""
        if dense.ndim == 1:
            return np.asarray((self @ dense[:, None])[:, 0])
        is_long = dense.dtype == np.longdouble
        numbers = np.ascontiguousarray(dense if is_long else dense.astype(np.float64, copy=False))
        found = _contact.sparse_product(
            self._first, self._column, self._value, numbers.view(np.float64), is_long
        )
        return np.asarray(found.view(np.longdouble))


def dense_product(a: NDArray[Any], b: NDArray[Any]) -> LongArray:
    """Multiply dense matrices to the precision of long doubles.

    Parameters
    ----------
    a : (m, n) array of float64 or longdouble
    b : (n, k) array of float64 or longdouble

    Returns
    -------
    (m, k) array of longdouble
        Error about n EPS times the largest magnitudes in the row of a and the column of b.
    """
    n = a.shape[1]
    bits = (53 - math.ceil(math.log2(max(n, 2)))) // 2
    left, right = _slices(a, bits), [s.T for s in _slices(b.T, bits)]
    result = np.zeros((a.shape[0], b.shape[1]), np.longdouble)
    last = math.ceil(_BITS / bits) - 1
    for k in range(last, -1, -1):  # small terms first
        for i, x in enumerate(left):
            if 0 <= k - i < len(right):
                result += x @ right[k - i]
    return result


def _slices(matrix: NDArray[Any], bits: int) -> list[FloatArray]:
    """Cut (m, n) into a sum of doubles with this number of bits relative to the largest of each row."""
    rest = np.array(matrix, np.longdouble)
    largest = np.abs(rest).max(axis=1, initial=0, keepdims=True).astype(np.float64)
    exponent = np.frexp(largest)[1]
    slices = []
    for k in range(math.ceil(_BITS / bits)):
        unit = np.ldexp(np.longdouble(1.0), exponent - (k + 1) * bits)
        piece = np.rint(rest / unit) * unit
        slices.append(piece.astype(np.float64))
        rest -= piece
    return slices
