"""The softest modes of a large packing, without dense matrices: Lanczos iteration on the inverse of M - shift.

M and its factors, in which rounding would bury the prestress, are never formed; instead

    [ -(S + shift) / s   C^T ] [ v ]   [ b / s ]
    [        C           -s  ] [ y ] = [  0    ]

is factorised, with (M - shift) v = b and s y = C v. With s of the size of the prestress its entries are all of
order one (but for the small s itself), so that rounding errors in the factors are like those of the
entries of C and S.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import scipy  # loads its parts once they are used

from jamshape.arrays import FloatArray, IntArray
from jamshape.vibration.hessian import DynamicalMatrix
from jamshape.vibration.quotients import Products, isolated_error, norms
from jamshape.vibration.spectrum import COLUMNS, Spectrum, is_unsettled, spectrum

# Shift for the lowest modes, over the square of the prestress that causes sliding modes.
_BELOW = -4.0

_RESOLVED = 1e-9  # relative error of resolved modes
_FAR = 100.0  # distance of others over the shift above which the shift moves up
_CLIMBS = 4  # of the shift, at most

# Initial number of softest modes among which floppy ones are sought.
_SOME = 8

# Lanczos iteration cannot find the last few modes; dense methods do.
_BEYOND = 2


class Solution(NamedTuple):
    """Solutions v of (M - shift) v = b, and the residuals of both equations."""

    v: FloatArray
    """(n, k)"""
    y: FloatArray
    """(m, k)"""


class ShiftedInverse:
    """Solves (M - shift) v = b.

    Parameters
    ----------
    matrix : DynamicalMatrix
    shift : float, [energy / length^2]
        Not an eigenvalue, except 0, that of translations: there, one particle of each cluster is fixed.
    floppy : (n, k) array of float64, optional
        Orthonormal zero modes beside translations; at a shift of 0 the same number of coordinates are fixed.
    """

    def __init__(
        self, matrix: DynamicalMatrix, shift: float, floppy: FloatArray | None = None
    ) -> None:
        self.matrix, self.shift = matrix, shift
        floppy = np.empty((matrix.size, 0)) if floppy is None else floppy
        self.held = np.column_stack([matrix.translations, floppy])
        """(n, l) modes that are fixed at a shift of 0."""
        C, S = matrix.compatibility, matrix.prestress
        self.scale = max(typical_prestress(matrix), abs(shift))
        held = shift * np.ones(matrix.size)
        if shift == 0.0:
            held[_supports(matrix.translations, floppy)] = -self.scale
        one = scipy.sparse.identity(C.shape[0])
        blocks = [[-(S + scipy.sparse.diags(held)) / self.scale, C.T], [C, -self.scale * one]]
        self._factors = scipy.sparse.linalg.splu(scipy.sparse.bmat(blocks, format="csc"))

    def solve(self, b: FloatArray) -> Solution:
        """Solve for (n, k) or (n,) right-hand sides, without net force on any cluster if shift is 0."""
        n_rows = self.matrix.compatibility.shape[0]
        return self._solved(b / self.scale, np.zeros((n_rows, *b.shape[1:])))

    def solve_both(self, b: FloatArray, c: FloatArray) -> Solution:
        """Solve -(S + shift) v + C^T y = b, C v - y = c for (n, k) and (m, k) right-hand sides."""
        found = self._solved(b / self.scale, c)
        return Solution(found.v, self.scale * found.y)

    def _solved(self, b: FloatArray, c: FloatArray) -> Solution:
        both = self._factors.solve(np.concatenate([b, c]))
        return Solution(both[: self.matrix.size], both[self.matrix.size :])


def _supports(translations: FloatArray, floppy: FloatArray) -> IntArray:
    """Choose as many coordinates as modes, such that fixing them fixes every mode."""
    first = np.abs(translations).argmax(axis=0)
    if not floppy.shape[1]:
        return np.asarray(first)
    both = np.column_stack([translations, floppy]).T
    order = scipy.linalg.qr(both, mode="r", pivoting=True)[1]
    return np.asarray(order[: len(both)])


def typical_prestress(matrix: DynamicalMatrix) -> float:
    """Typical size of S: the median over its rows of their largest entry."""
    largest = abs(matrix.prestress).max(axis=1).toarray()
    typical = float(np.median(largest[largest > 0])) if (largest > 0).any() else 0.0
    return max(typical, 1e-15 * _stiffest(matrix))


def below_sliding(matrix: DynamicalMatrix) -> float:
    """Shift slightly below zero, of the size of the eigenvalues of sliding modes."""
    return _BELOW * typical_prestress(matrix) ** 2 / _stiffest(matrix)


def _stiffest(matrix: DynamicalMatrix) -> float:
    return float((matrix.compatibility.data**2).max(initial=0.0)) or 1.0


def lowest(matrix: DynamicalMatrix, k: int) -> Spectrum:
    """Find the k softest modes without translations, from sliding modes up into the high band.

    Softest means nearest to a shift slightly below zero, of the size of the eigenvalues of sliding
    modes. Where one shift does not resolve the next band, it moves up.

    Parameters
    ----------
    matrix : DynamicalMatrix
    k : int

    Returns
    -------
    Spectrum
        Without translations. Bounds assume that no mode between them was missed.

    Raises
    ------
    ValueError
        If k is less than one, or exceeds the number of modes.
    """
    began, known = time.perf_counter(), matrix.translations
    if _is_most(matrix, k):
        return _nearest(matrix, k, 0.0)
    shift = below_sliding(matrix)
    found: list[Spectrum] = []
    for climb in range(_CLIMBS):
        missing = k - sum(len(part.eigenvalues) for part in found)
        some = _near(matrix, missing, shift, known)
        size = np.abs(some.eigenvalues)
        resolved = (some.solver_error <= _RESOLVED * size) | (size <= _FAR * -shift)
        if resolved.all() or climb == _CLIMBS - 1:
            found.append(some)
            break
        found.append(some.picked(resolved))
        known = np.linalg.qr(np.column_stack([known, some.vectors[:, resolved]]))[0]
        shift = -0.5 * float(size[~resolved].min())
    return _joined(found, time.perf_counter() - began)


def near(matrix: DynamicalMatrix, k: int, shift: float) -> Spectrum:
    """Find the k modes whose eigenvalues are nearest to a shift that is not an eigenvalue itself.

    Arguments, result and errors otherwise as `lowest`.
    """
    if _is_most(matrix, k):
        return _nearest(matrix, k, shift)
    return replace(_near(matrix, k, shift, matrix.translations), has_softest=False)


def softest(matrix: DynamicalMatrix, known: Spectrum | None = None) -> Spectrum:
    """Find the softest modes, up to some that are neither floppy nor unsettled, unless already known."""
    most, k = matrix.size - matrix.translations.shape[1], _SOME
    found = known if known is not None and known.has_softest else None
    while found is None or not (found.is_firm & ~is_unsettled(matrix, found)).any():
        if k >= most:
            return spectrum(matrix)
        found = lowest(matrix, k)
        k *= 2
    return found


def with_translations(matrix: DynamicalMatrix, found: Spectrum) -> Spectrum:
    """Add the translations to modes found without them, flagged as in a whole spectrum."""
    n = matrix.translations.shape[1]
    if not n or found.is_translation.any():
        return found
    nothing: dict[str, Any] = dict.fromkeys(COLUMNS, np.zeros(n))
    nothing["is_translation"] = np.ones(n, bool)
    own = replace(found, vectors=matrix.translations, **nothing)
    return _joined([own, found], found.wall_seconds)


def _is_most(matrix: DynamicalMatrix, k: int) -> bool:
    """Whether k is nearly all modes, which dense methods must find."""
    n = matrix.size - matrix.translations.shape[1]
    if n == 0:
        msg = (
            f"the packing has no vibrational modes: all its {matrix.size} modes are translations;"
            " compute the whole spectrum to see them"
        )
        raise ValueError(msg)
    if not 1 <= k <= n:
        msg = (
            f"{k} modes were requested, expected from 1 to {n}, the number of vibrational modes;"
            " leave the number out for the whole spectrum"
        )
        raise ValueError(msg)
    return bool(k > n - _BEYOND)


def _nearest(matrix: DynamicalMatrix, k: int, shift: float) -> Spectrum:
    """Select the k modes nearest to a shift from the whole spectrum."""
    whole = spectrum(matrix)
    own = np.flatnonzero(~whole.is_translation)
    nearest = own[np.argsort(np.abs(whole.eigenvalues[own] - shift), kind="stable")[:k]]
    some = whole.picked(np.sort(nearest))
    return replace(some, n_before=-1, singular_values=np.empty(0), has_softest=shift == 0.0)


def _near(matrix: DynamicalMatrix, k: int, shift: float, known: FloatArray) -> Spectrum:
    """Find k modes besides the known ones, orthonormal columns."""
    began = time.perf_counter()
    inverse = ShiftedInverse(matrix, shift)

    def apply(b: FloatArray) -> FloatArray:
        return _without(known, inverse.solve(_without(known, b)).v)

    operator = scipy.sparse.linalg.LinearOperator(
        (matrix.size,) * 2, matvec=apply, dtype=np.float64
    )
    start = _without(known, np.random.default_rng(0).normal(size=matrix.size))
    count = min(matrix.size - 1, max(2 * k + 1, k + 40))
    v = scipy.sparse.linalg.eigsh(operator, k, which="LM", v0=start, ncv=count, tol=0.0)[1]
    return _bounded(inverse, _without(known, v), time.perf_counter() - began)


def _joined(parts: list[Spectrum], seconds: float) -> Spectrum:
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(p, name) for p in parts]) for name in COLUMNS
    }
    vectors = np.column_stack([p.vectors for p in parts])
    whole = replace(parts[0], vectors=vectors, wall_seconds=seconds, **columns)
    return whole.picked(np.argsort(whole.eigenvalues))


def _without(T: FloatArray, vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors - T @ (T.T @ vectors))


def _bounded(inverse: ShiftedInverse, v: FloatArray, seconds: float) -> Spectrum:
    """Solve once more, and compute quotients of the solutions w with bounds.

    (M - lambda) w = v - (lambda - shift) w is known without cancellation. The residual r2 of the second
    equation is equivalent to a change of C by r2 w^T / |w|^2.
    """
    matrix, shift, scale = inverse.matrix, inverse.shift, np.longdouble(inverse.scale)
    w, y = inverse.solve(v)
    size = np.linalg.norm(w, axis=0)
    w, y, b = w / size, y / size, v / size
    products = Products(matrix)
    at = products.images(w)
    values = at.quotients.value
    r2 = scale * y - at.stretched
    r1 = b + at.pushed + shift * np.asarray(w, np.longdouble) - scale * (products.Ct @ y)
    left = b - r1 + scale * w * (r2 * y).sum(axis=0) - (values - shift) * w
    residual, by_C = norms(left), norms(r2)
    change = 2 * norms(at.stretched) * by_C + by_C**2
    doubles = values.astype(np.float64)
    order = np.argsort(doubles)
    error = isolated_error(doubles, residual) + change + at.quotients.rounding
    return Spectrum(
        eigenvalues=doubles[order],
        vectors=w[:, order],
        solver_error=error[order],
        entry_error=at.quotients.entries[order],
        overlap_error=at.quotients.overlaps[order],
        is_translation=np.zeros(len(order), bool),
        method="sparse",
        wall_seconds=seconds,
        n_before=-1,
        singular_values=np.empty(0),
    )
