"""Modes of a dynamical matrix M = C^T C - S, each eigenvalue with an error bound.

The low bands lie ten to twenty orders of magnitude below the high one, where eigenvalues of M in doubles
are noise; `jamshape.vibration.dense_modes` resolves them, and `jamshape.vibration.sparse_modes` those of large packings.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import scipy  # loads its parts once they are used
from numpy.typing import NDArray

from jamshape.arrays import FloatArray
from jamshape.landscape import Landscape, State
from jamshape.vibration.dense_modes import Found, rank_of, two_levels
from jamshape.vibration.hessian import DynamicalMatrix, matrix_at
from jamshape.vibration.quotients import Products

# To estimate the error of a state, no coordinate moves by more than this fraction of a radius.
_SHORT = 1e-3

# Modes above this fraction of the largest eigenvalue follow the others adiabatically.
_STIFF = 1e-5


COLUMNS = ("eigenvalues", "solver_error", "entry_error", "overlap_error", "is_translation")
"""Fields of a spectrum with one number for each mode."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Modes of a dynamical matrix, by ascending eigenvalue.

    Parameters
    ----------
    eigenvalues : (k,) array of float64, [energy / length^2]
    vectors : (n, k) array of float64
        Unit columns in the coordinates of the matrix.
    solver_error : (k,) array of float64
        Bound of the distance to an eigenvalue of the stored matrix.
    entry_error : (k,) array of float64
        Bound of the effect of rounding of the matrix entries.
    overlap_error : (k,) array of float64
        Bound of the effect of rounding of overlaps, small differences of lengths in long double: most of the error
        of modes held by prestress.
    is_translation : (k,) array of bool
        Rigid translations of the packing's clusters, whose eigenvalues are exactly 0.
    method : str
    wall_seconds : float
    n_before : int
        Number of modes below the first of these; -1 if unknown.
    singular_values : (min(m, n),) array of float64, or empty
        Singular values of C, descending.
    has_softest : bool
        Whether these include the softest modes, resolved to their bounds.
    """

    eigenvalues: FloatArray
    vectors: FloatArray
    solver_error: FloatArray
    entry_error: FloatArray
    overlap_error: FloatArray
    is_translation: NDArray[np.bool_]
    method: str
    wall_seconds: float
    n_before: int
    singular_values: FloatArray
    has_softest: bool = True

    @property
    def bound(self) -> FloatArray:
        """(k,) bound of the error of each eigenvalue of this state."""
        return self.solver_error + self.entry_error + self.overlap_error

    @property
    def sign(self) -> NDArray[np.int64]:
        """(k,) 1 or -1 where the bound determines the sign, 0 elsewhere."""
        sure = np.abs(self.eigenvalues) > self.bound
        return np.where(sure, np.sign(self.eigenvalues), 0).astype(np.int64)

    @property
    def is_floppy(self) -> NDArray[np.bool_]:
        """(k,) modes but translations whose eigenvalues are below their bounds, so that even the sign is unknown."""
        return np.asarray((self.sign == 0) & ~self.is_translation)

    @property
    def is_firm(self) -> NDArray[np.bool_]:
        """(k,) modes that are neither floppy nor translations."""
        return np.asarray((self.sign != 0) & ~self.is_translation)

    def picked(self, rows: NDArray[Any]) -> Spectrum:
        """Select modes by rows or by a mask."""
        columns: dict[str, Any] = {name: getattr(self, name)[rows] for name in COLUMNS}
        return replace(self, vectors=self.vectors[:, rows], **columns)

    def with_exact_translations(self) -> Spectrum:
        """Set the eigenvalues of translations to their exact value 0."""
        exact: dict[str, Any] = {
            name: np.where(self.is_translation, 0.0, getattr(self, name)) for name in COLUMNS[:-1]
        }
        order = np.argsort(exact["eigenvalues"], kind="stable")
        return replace(self, **exact).picked(order)

    @property
    def omega(self) -> FloatArray:
        """(k,) frequencies sqrt(lambda); -sqrt(-lambda) of modes that lower the energy."""
        frequency: FloatArray = np.sign(self.eigenvalues) * np.sqrt(np.abs(self.eigenvalues))
        return frequency

    def rank(self, residual: float = 0.0) -> int:
        """Rank of C, and so of H; the residual of the state is that of its self stress."""
        return rank_of(self.singular_values, residual)


def spectrum(matrix: DynamicalMatrix, method: str = "projected") -> Spectrum:
    """Find all modes with dense matrices, for up to a few thousand coordinates.

    Parameters
    ----------
    matrix : DynamicalMatrix
    method : str
        ``projected``: singular vectors of C, Schur complement, quotients in long double.
        ``refined``: the same, and the low modes refined in long double (Ogita and Aishima, Japan J.
        Indust. Appl. Math. 35, 1007 (2018)).
        ``plain``: eigenvalues of M in doubles. ``first_order``: Marschall & Teitel 2018, Appendix B.
        Both are for comparison: the low bands are noise in the former, sliding modes in both.

    Returns
    -------
    Spectrum

    Raises
    ------
    ValueError
        If the method is unknown.

    See Also
    --------
    jamshape.vibration.sparse_modes.lowest : few modes of large packings.
    """
    if method not in METHODS:
        msg = f"the method is {method!r}, expected one of {', '.join(METHODS)}"
        raise ValueError(msg)
    began = time.perf_counter()
    found = METHODS[method](matrix)
    order = np.argsort(found.eigenvalues, kind="stable")
    is_translation = np.zeros(len(order), bool)
    overlap = ((matrix.translations.T @ found.vectors) ** 2).sum(axis=0)
    is_translation[np.argsort(-overlap)[: matrix.translations.shape[1]]] = True
    return Spectrum(
        eigenvalues=found.eigenvalues[order],
        vectors=found.vectors[:, order],
        solver_error=found.solver_error[order],
        entry_error=found.entry_error[order],
        overlap_error=found.overlap_error[order],
        is_translation=is_translation[order],
        method=method,
        wall_seconds=time.perf_counter() - began,
        n_before=0,
        singular_values=found.singular_values,
        has_softest=method in _EXACT,
    )


def is_unsettled(matrix: DynamicalMatrix, found: Spectrum) -> NDArray[np.bool_]:
    """Select modes but translations along which the minimum is farther away than the mean overlap.

    At this distance eigenvalues do not describe the minimum, where contacts often differ.

    Returns
    -------
    (k,) array of bool
    """
    overlap = matrix.bond_force / float(matrix.bonds.stiffness.mean())
    slope = np.abs(found.vectors.T @ matrix.gradient)
    return np.asarray((slope > overlap * np.abs(found.eigenvalues)) & ~found.is_translation)


class Nearer(NamedTuple):
    """The dynamical matrix on the way to the minimum."""

    matrix: DynamicalMatrix
    part: float
    """Fraction of the way."""


def nearer_minimum(
    landscape: Landscape, state: State, matrix: DynamicalMatrix, newton: FloatArray
) -> Nearer:
    """Take an (n,) Newton step, or the fraction of it that moves nothing by more than a thousandth of a radius."""
    farthest = float(np.abs(newton).max(initial=0.0))
    part = min(1.0, _SHORT * float(landscape.inner_radius.min()) / max(farthest, 1e-300))
    shift, turn = matrix.coordinates.motion(part * newton)
    return Nearer(matrix_at(landscape, state.displaced(shift, turn), matrix.coordinates), part)


def state_error(
    landscape: Landscape, state: State, matrix: DynamicalMatrix, found: Spectrum
) -> FloatArray:
    """Estimate the change of eigenvalues on the way to the minimum that the forces point at.

    The way is a Newton step, or the fraction of it that moves nothing by more than a thousandth of the
    smallest radius; changes are then extrapolated. Where this estimate exceeds an eigenvalue, as it
    often does for sliding modes, the packing has not settled along that mode, and even the sign at
    the minimum is unknown.

    Parameters
    ----------
    landscape, state
        State of the matrix.
    matrix : DynamicalMatrix
    found : Spectrum
        All its modes.

    Returns
    -------
    (n,) array of float64, [energy / length^2]
    """
    sure = (found.sign != 0) & ~found.is_translation
    slope = found.vectors[:, sure].T @ matrix.gradient
    newton = -(found.vectors[:, sure] @ (slope / found.eigenvalues[sure]))
    near = nearer_minimum(landscape, state, matrix, newton)
    there = Products(near.matrix)

    stiff = found.eigenvalues > _STIFF * found.eigenvalues.max(initial=0.0)
    at = there.images(found.vectors[:, ~stiff])
    bent = (there.Ct @ at.stretched - at.pushed).astype(np.float64)
    relaxed = (found.vectors[:, stiff].T @ bent) ** 2 / found.eigenvalues[stiff, None]
    values = found.eigenvalues.copy()
    values[~stiff] = at.quotients.value - relaxed.sum(axis=0)
    values[stiff] = there.quotients(found.vectors[:, stiff]).value
    change = np.abs(values - found.eigenvalues) / near.part
    return np.where(found.is_translation, 0.0, change)


def _plain(matrix: DynamicalMatrix) -> Found:
    values, vectors = scipy.linalg.eigh(matrix.matrix.toarray())
    return _found_as_is(matrix, values, vectors, np.empty(0))


def _first_order(matrix: DynamicalMatrix) -> Found:
    """Use -S on the null space of H and its mean elsewhere (Marschall & Teitel 2018, Appendix B)."""
    C, S = matrix.compatibility.toarray(), matrix.prestress
    _, sigma, right = scipy.linalg.svd(C)
    rank = rank_of(sigma, matrix.residual.largest)
    R, Z = right[:rank].T, right[rank:].T
    low, turn = scipy.linalg.eigh(-(Z.T @ (S @ Z)))
    high = sigma[:rank] ** 2 - (R * (S @ R)).sum(axis=0)
    values, vectors = np.concatenate([low, high]), np.column_stack([Z @ turn, R])
    return _found_as_is(matrix, values, vectors, sigma)


def _found_as_is(
    matrix: DynamicalMatrix, values: FloatArray, vectors: FloatArray, sigma: FloatArray
) -> Found:
    """Keep eigenvalues as they are, with their residuals as error bounds."""
    at = Products(matrix).quotients(vectors)
    off = np.abs(values - at.value).astype(np.float64)
    return Found(values, vectors, at.residual + at.rounding + off, at.entries, at.overlaps, sigma)


def _projected(matrix: DynamicalMatrix) -> Found:
    return two_levels(matrix, refine=False)


def _refined(matrix: DynamicalMatrix) -> Found:
    return two_levels(matrix, refine=True)


_EXACT = ("projected", "refined")

METHODS: dict[str, Callable[[DynamicalMatrix], Found]] = {
    "projected": _projected,
    "refined": _refined,
    "plain": _plain,
    "first_order": _first_order,
}
