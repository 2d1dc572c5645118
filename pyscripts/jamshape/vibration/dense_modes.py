"""All modes of a dynamical matrix in two blocks: modes held by stiffness, and the rest.

The singular vectors of C give the null space of H = C^T C without forming H. There the prestress
acts alone, to second order (a Schur complement with small terms only), and each eigenvalue is the
quotient |C v|^2 - v.S v of its mode, in long double.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

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

# Modes of H are stiff if they are this factor stiffer than all effects of the prestress on the rest:
# nearly round rods leave a factor of six. Each sweep gains as much.
_STIFFER = 3.0

_SWEEPS = 30

# Limits, relative to the largest, of the eigenvalue at which a spectrum without bands is divided.
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
    split = _split(matrix)
    products = Products(matrix)
    if len(split.D):
        soft, vectors = split.low_vectors(), split.high_vectors()
    else:
        soft, vectors = _without_bands(products, split)
    high = products.quotients(vectors)
    high_values = high.value.astype(np.float64)
    low = _low_modes(products, np.column_stack([matrix.translations, soft]), refine)
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
        singular_values=split.singular_values,
    )


@dataclass(frozen=True, eq=False)
class _Split:
    """Stiff modes R of H and the rest Z, without translations; M in the basis of both.

    In the order (R, Z), M is [[D, B^T], [B, E]], with D about the squares of singular values and
    B, E of the size of the prestress.
    """

    R: FloatArray
    Z: FloatArray
    D: FloatArray
    B: FloatArray
    E: FloatArray
    factors: Any
    singular_values: FloatArray

    def low_vectors(self) -> FloatArray:
        """(n, z) modes below D, to second order in the prestress.

        With y = -(D - lambda)^-1 B^T x, the modes (y, x) solve
        (E - B D^-1 B^T) x = lambda (1 + B D^-2 B^T) x + O(lambda^2).
        """
        P = self._solved(self.B.T)
        values, x = scipy.linalg.eigh(self.E - self.B @ P, np.eye(len(self.E)) + P.T @ P)
        first = -(P @ x)
        y, scale = first, np.abs(first).max(initial=1e-300)
        for _ in range(_SWEEPS):
            last, y = y, first + self._solved(y) * values
            if np.abs(y - last).max(initial=0.0) < EPS * scale:
                break
        mixed = y.T @ (self.B.T @ x)
        squared = y.T @ (self.D @ y) + mixed + mixed.T + x.T @ (self.E @ x)
        turn = scipy.linalg.eigh(squared, y.T @ y + x.T @ x)[1]
        vectors = self.Z @ (x @ turn) + self.R @ (y @ turn)
        return np.asarray(vectors / np.linalg.norm(vectors, axis=0))

    def high_vectors(self) -> FloatArray:
        """(n, r) modes above."""
        r, n = len(self.D), len(self.D) + len(self.E)
        whole = np.block([[self.D, self.B.T], [self.B, self.E]])
        vectors = scipy.linalg.eigh(whole, subset_by_index=[n - r, n - 1], overwrite_a=True)[1]
        return np.asarray(self.R @ vectors[:r] + self.Z @ vectors[r:])

    def _solved(self, right: FloatArray) -> FloatArray:
        return np.asarray(scipy.linalg.cho_solve(self.factors, right))


def _without_bands(products: Products, split: _Split) -> tuple[FloatArray, FloatArray]:
    """(n, z) low and (n, r) higher modes of a continuous spectrum, which prestress and stiffness share.

    Modes of M in doubles couple by some roundings of its largest eigenvalue. That suffices above the widest gap of some
    decades of the spectrum; those below are turned among themselves in long double.
    """
    values, turn = scipy.linalg.eigh(split.E)
    vectors = split.Z @ turn
    largest = float(np.abs(values).max(initial=0.0))
    low, high = np.searchsorted(values, [_LOWEST * largest, _LOW * largest])
    edges = np.maximum(values[max(low - 1, 0) : high + 1], _LOWEST * largest)
    n_low = max(low - 1, 0) + 1 + int(np.argmax(edges[1:] / edges[:-1])) if len(edges) > 1 else low
    soft = vectors[:, :n_low]
    A, N = _within(soft, products.images(soft))
    among = scipy.linalg.eigh(A.astype(np.float64), N.astype(np.float64))[1]
    soft = soft @ among
    return soft / np.linalg.norm(soft, axis=0), vectors[:, n_low:]


def _split(matrix: DynamicalMatrix) -> _Split:
    """Split the space by the singular values of C, where D is well above all of E."""
    C, T = matrix.compatibility.toarray(), matrix.translations
    n, n_moves = T.shape
    # Rows that make translations the stiffest modes by far: the first, to be left out.
    far = 4 * np.sqrt(float(np.max(abs(matrix.stiffness).sum(axis=0))) or 1.0)
    _, sigma, right = scipy.linalg.svd(np.vstack([far * T.T, C]))
    sigma, V = sigma[n_moves:], right[n_moves:].T
    squares = np.zeros(n - n_moves)
    squares[: len(sigma)] = sigma[: n - n_moves] ** 2
    pushed = matrix.prestress @ V
    limit = float((RANK_TOLERANCE * sigma.max(initial=0.0)) ** 2)
    while True:
        r = int((squares > limit).sum())
        whole = np.diag(squares) - V.T @ pushed if r == len(squares) else None
        Z, SZ = V[:, r:], pushed[:, r:]
        E = np.diag(squares[r:]) - Z.T @ SZ
        E = 0.5 * (E + E.T)
        top = _STIFFER * float(np.abs(np.linalg.eigvalsh(E)).max(initial=0.0))
        if r and squares[r - 1] <= top:
            limit = top
            continue
        D = whole if whole is not None else np.diag(squares[:r]) - V[:, :r].T @ pushed[:, :r]
        try:
            factors = scipy.linalg.cho_factor(D, lower=True) if r else None
        except np.linalg.LinAlgError:
            limit = max(_STIFFER * limit, float(squares[r - 1]))
            continue
        B = -(Z.T @ pushed[:, :r])
        return _Split(V[:, :r], Z, D, B, E, factors, sigma)


class _LowModes(NamedTuple):
    """Modes of a subspace, with contributions to their errors."""

    values: FloatArray
    vectors: FloatArray
    coupling: FloatArray
    """(k, k) couplings of modes i of the subspace to modes j; 0 on the diagonal."""
    outside: FloatArray
    """(k,) coupling to the rest of the space."""
    quotients: Quotients


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
    n_groups, group = connected_components(close, directed=False)
    for g in np.flatnonzero(np.bincount(group, minlength=n_groups) > 1):
        rows = np.flatnonzero(group == g)
        block = np.ix_(rows, rows)
        middle = F[rows[0], rows[0]] / G[rows[0], rows[0]]
        small = (F[block] - middle * G[block]).astype(np.float64)
        turn[block] = scipy.linalg.eigh(small, G[block].astype(np.float64))[1]
    return turn
