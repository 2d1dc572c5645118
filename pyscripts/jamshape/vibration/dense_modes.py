"""All modes of a dynamical matrix in two blocks: low modes, and the rest.

Eigenvectors in doubles mix by some roundings of the largest eigenvalue over their distance, and their eigenvalues by the square of
that, apart from those of low modes among themselves: these are turned in long double. Each eigenvalue is the quotient |C v|^2 - v.S v
of its mode, in long double.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy  # loads its parts once they are used
from numpy.typing import NDArray

from jamshape.arrays import FloatArray, LongArray
from jamshape.vibration.extended import dense_product
from jamshape.vibration.hessian import LARGEST_RESIDUAL, DynamicalMatrix
from jamshape.vibration.quotients import (
    CLOSE,
    EPS,
    Images,
    Products,
    Quotients,
    grouped_error,
    isolated_error,
    norms,
)

# Singular values below this fraction of the largest belong to states of self stress, which vanish in force balance.
RANK_TOLERANCE = 1e-6
_RESIDUALS = 10.0  # likewise, relative to the largest times the residual

_SWEEPS = 30

# Limits, relative to the largest, of the eigenvalue at which the spectrum is divided.
_LOWEST, _LOW = 1e-6, 1e-3


class Found(NamedTuple):
    """Result of a method, in no particular order."""

    eigenvalues: FloatArray
    vectors: FloatArray
    solver_error: FloatArray
    entry_error: FloatArray
    overlap_error: FloatArray
    singular_values: FloatArray


def rank_of(singular_values: FloatArray, residual: float = 0.0) -> int:
    """Count singular values of C that do not belong to states of self stress.

    The forces of a minimum are one, up to their residual; those of other states are not.
    """
    largest = singular_values.max(initial=0.0)
    return int((singular_values > rank_tolerance(residual) * largest).sum())


def rank_tolerance(residual: float) -> float:
    """Return the fraction of the largest singular value of C below which one belongs to a state of self stress."""
    balanced = residual if residual <= LARGEST_RESIDUAL else 0.0
    return max(RANK_TOLERANCE, _RESIDUALS * balanced)


def two_levels(matrix: DynamicalMatrix, *, refine: bool) -> Found:
    """Find all modes; `refine` the low ones in long double (see `modes.spectrum`)."""
    products = Products(matrix)
    soft, vectors = _divided(matrix)
    high = products.quotients(vectors)
    high_values = high.value.astype(np.float64)
    clean = _cleaned(products, _turned(products, soft), vectors, high_values)
    low = _low_modes(products, np.column_stack([matrix.translations, clean]), refine)
    # The rest of the space, which is stiffer, lowers low modes by at most leak.leak.
    leak = low.outside / np.sqrt(0.5 * high_values.min(initial=np.inf))
    pull = low.coupling + np.outer(leak, leak)
    low_error = grouped_error(low.values, pull, high_values) + leak**2
    low_error += low.quotients.rounding
    both = np.concatenate([low.values, high_values])
    residual = np.concatenate([low.quotients.residual, high.residual])
    high_error = isolated_error(both, residual)[len(low.values) :] + high.rounding
    return Found(
        eigenvalues=both,
        vectors=np.column_stack([low.vectors, vectors]),
        solver_error=np.concatenate([low_error, high_error]),
        entry_error=np.concatenate([low.quotients.entries, high.entries]),
        overlap_error=np.concatenate([low.quotients.overlaps, high.overlaps]),
        singular_values=_singular_values(matrix),
    )


def _divided(matrix: DynamicalMatrix) -> tuple[FloatArray, FloatArray]:
    """(n, z) low and (n, r) high modes in doubles, without translations, divided at a wide gap of the spectrum."""
    M, T = matrix.matrix.toarray(), matrix.translations
    # Translations become the stiffest modes, to be left out.
    M += 2 * float(np.abs(M).sum(axis=0).max(initial=1e-300)) * (T @ T.T)
    values, vectors = scipy.linalg.eigh(M, overwrite_a=True, check_finite=False, driver="evr")
    n = len(values) - T.shape[1]
    values, vectors = values[:n], vectors[:, :n]
    largest = float(np.abs(values).max(initial=0.0))
    least = _LOWEST * largest
    low, most = np.searchsorted(values, [least, _LOW * largest])
    edges = np.maximum(values[max(low - 1, 0) : most + 1], least)
    if len(edges) > 1:
        low = max(low - 1, 0) + 1 + int(np.argmax(edges[1:] / np.maximum(edges[:-1], 1e-300)))
    return vectors[:, :low], vectors[:, low:]


def _singular_values(matrix: DynamicalMatrix) -> FloatArray:
    """(min(m, n),) singular values of C, descending, known to 1e-7 of the largest."""
    C = matrix.compatibility
    squares = scipy.linalg.eigvalsh((C.T @ C).toarray(), overwrite_a=True, check_finite=False)
    return np.asarray(np.sqrt(np.maximum(squares[::-1][: min(C.shape)], 0.0)))


class _LowModes(NamedTuple):
    """Modes of a subspace, with contributions to their errors."""

    values: FloatArray
    vectors: FloatArray
    coupling: FloatArray
    """(k, k) couplings of modes i of the subspace to modes j; 0 on the diagonal."""
    outside: FloatArray
    """(k,) coupling to the rest of the space."""
    quotients: Quotients


def _turned(products: Products, vectors: FloatArray) -> FloatArray:
    """(n, k) modes within the span of unit columns (n, k)."""
    A, N = _within(vectors, products.images(vectors))
    found = vectors @ scipy.linalg.eigh(A.astype(np.float64), N.astype(np.float64))[1]
    return np.asarray(found / np.linalg.norm(found, axis=0))


def _cleaned(
    products: Products, vectors: FloatArray, high: FloatArray, values: FloatArray
) -> LongArray:
    """(n, k) low modes in long double, without what they have of the high ones (n, r), to first order."""
    at = products.images(vectors)
    pull = high.T @ at.residual.astype(np.float64)
    gap = values[:, None] - at.quotients.value.astype(np.float64)
    part = np.where(np.abs(pull) < CLOSE * gap, pull, 0.0) / np.where(gap > 0, gap, 1.0)
    return np.asarray(vectors - (high @ part).astype(np.longdouble))


def _low_modes(products: Products, vectors: NDArray[Any], refine: bool) -> _LowModes:
    """Evaluate modes in long double, and optionally refine them within their span."""
    at = products.images(vectors)
    A, N = _within(vectors, at)
    if refine:
        vectors = dense_product(vectors, _refined_vectors(A, N))
        at = products.images(vectors)
        A, N = _within(vectors, at)
    off = A - at.quotients.value * N
    np.fill_diagonal(off, 0.0)
    outside = at.residual - dense_product(vectors, off)
    values = at.quotients.value.astype(np.float64)
    coupling = np.abs(off).astype(np.float64)
    return _LowModes(values, vectors.astype(np.float64), coupling, norms(outside), at.quotients)


def _within(vectors: NDArray[Any], at: Images) -> tuple[LongArray, LongArray]:
    """V^T M V and V^T V, (k, k)."""
    squared = dense_product(at.stretched.T, at.stretched)
    return squared - dense_product(vectors.T, at.pushed), dense_product(vectors.T, vectors)


def _refined_vectors(A: LongArray, N: LongArray) -> LongArray:
    """Refine eigenvectors of A x = lambda N x that are nearly unit vectors (Ogita & Aishima 2018).

    Each step squares their errors, after rotating close eigenvectors among themselves.
    """
    one = np.eye(len(N), dtype=np.longdouble)
    X, best, best_X = one, np.inf, one
    for _ in range(_SWEEPS):
        F, G = (dense_product(X.T, dense_product(matrix, X)) for matrix in (A, N))
        off, gap = _pulls(F, G)
        error, askew = np.abs(off).max(initial=0.0), np.abs(one - G).max(initial=0.0)
        if askew < EPS:
            if error >= 0.5 * best:
                break
            best, best_X = error, X
        close = _are_close(off, gap)
        if close.any():
            turn = _turn_together(F, G, close)
            X = dense_product(X, turn)
            F, G = (dense_product(turn.T, dense_product(matrix, turn)) for matrix in (F, G))
            off, gap = _pulls(F, G)
            close = _are_close(off, gap)
        np.fill_diagonal(close, True)
        step = np.where(close, 0.5 * (one - G), off / np.where(close, 1.0, gap))
        X = X + dense_product(X, step)
    return best_X


def _pulls(F: LongArray, G: LongArray) -> tuple[LongArray, LongArray]:
    """Return the couplings of modes i to j, (F - lambda_j G)_ij, and lambda_j - lambda_i."""
    values = np.diag(F) / np.diag(G)
    off = F - values * G
    np.fill_diagonal(off, 0.0)
    return off, values[None, :] - values[:, None]


def _are_close(off: LongArray, gap: LongArray) -> NDArray[np.bool_]:
    close = np.maximum(np.abs(off), np.abs(off.T)) >= CLOSE * np.abs(gap)
    np.fill_diagonal(close, False)
    return np.asarray(close)


def _turn_together(F: LongArray, G: LongArray, close: NDArray[np.bool_]) -> LongArray:
    """Diagonalise the blocks of close modes, in doubles."""
    turn = np.eye(len(F), dtype=np.longdouble)
    n_groups, group = scipy.sparse.csgraph.connected_components(close, directed=False)
    for g in np.flatnonzero(np.bincount(group, minlength=n_groups) > 1):
        rows = np.flatnonzero(group == g)
        block = np.ix_(rows, rows)
        middle = F[rows[0], rows[0]] / G[rows[0], rows[0]]
        small = (F[block] - middle * G[block]).astype(np.float64)
        turn[block] = scipy.linalg.eigh(small, G[block].astype(np.float64))[1]
    return turn
