"""Rayleigh quotients of a dynamical matrix in long double, with error bounds."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy  # loads its parts once they are used
from numpy.typing import NDArray

from jamshape.arrays import FloatArray, IntArray, LongArray
from jamshape.vibration.extended import EPS as LONG_EPS
from jamshape.vibration.extended import SparseRows
from jamshape.vibration.hessian import ROUNDINGS, DynamicalMatrix

EPS = float(np.finfo(np.float64).eps)

# Columns multiplied in long double at once, to bound memory.
_COLUMNS = 256

# Two modes coupled by more than this fraction of their gap are close.
CLOSE = 0.05


class Quotients(NamedTuple):
    """Rayleigh quotients of vectors with a dynamical matrix, in long double."""

    value: LongArray
    """(k,)"""
    residual: FloatArray
    """(k,) norms of M v - value v for |v| = 1; an eigenvalue lies within this distance."""
    rounding: FloatArray
    """(k,) rounding error of the value itself."""
    entries: FloatArray
    """(k,) bound of the change by rounding of the entries of C and S."""
    overlaps: FloatArray
    """(k,) bound of the change by rounding of the overlaps, from which S comes."""


class Images(NamedTuple):
    """Products of a dynamical matrix with vectors (n, k), in long double."""

    stretched: LongArray
    """(m, k) C v."""
    pushed: LongArray
    """(n, k) S v."""
    quotients: Quotients
    residual: LongArray
    """(n, k) M v - value v."""


class Products:
    """A dynamical matrix that multiplies in long double."""

    def __init__(self, matrix: DynamicalMatrix) -> None:
        self.C = SparseRows(matrix.compatibility)
        self.Ct = SparseRows(matrix.compatibility.T)
        self.S = SparseRows(matrix.prestress)
        self._sizes_C, self._sizes_S = abs(matrix.compatibility), matrix.prestress_sizes
        self._of_overlaps = matrix.prestress_rounding

    def images(self, vectors: NDArray[Any]) -> Images:
        """Multiply unit columns (n, k)."""
        stretched, pushed = self.C @ vectors, self.S @ vectors
        v = np.asarray(vectors, np.longdouble)
        square = (v**2).sum(axis=0)
        value = ((stretched**2).sum(axis=0) - (v * pushed).sum(axis=0)) / square
        residual = self.Ct @ stretched - pushed - value * v
        size = np.abs(vectors).astype(np.float64)
        by_C = (np.abs(stretched) * (self._sizes_C @ size)).sum(axis=0)
        by_S = (size * (self._sizes_S @ size)).sum(axis=0)
        sizes = np.asarray(2 * by_C + by_S, np.float64)
        digits = 2 * (np.log2(len(v)) + 8) * LONG_EPS
        quotients = Quotients(
            value=value,
            residual=norms(residual),
            rounding=digits * sizes + EPS * np.abs(value).astype(np.float64),
            entries=ROUNDINGS * EPS * sizes,
            overlaps=(size * (self._of_overlaps @ size)).sum(axis=0),
        )
        return Images(stretched, pushed, quotients, residual)

    def quotients(self, vectors: FloatArray) -> Quotients:
        """Quotients of unit columns (n, k), computed a few at a time."""
        parts = np.array_split(vectors, 1 + vectors.shape[1] // _COLUMNS, axis=1)
        found = [self.images(part).quotients for part in parts]
        return Quotients(*map(np.concatenate, zip(*found, strict=True)))


def isolated_error(values: FloatArray, residual: FloatArray) -> FloatArray:
    """Bound the distance to an eigenvalue by the residual or, if smaller, its square over the gap.

    Kato-Temple. The second bound applies where intervals of the first kind are disjoint, so that each holds
    one eigenvalue.

    Parameters
    ----------
    values : (k,) array of float64
        Rayleigh quotients.
    residual : (k,) array of float64
        Norms of M v - value v.

    Returns
    -------
    (k,) array of float64
    """
    order = np.argsort(values)
    lower, upper = (values - residual)[order], (values + residual)[order]
    # Neighbours by value are the nearest intervals if intervals do not overlap.
    below = values[order] - np.concatenate([[-np.inf], np.maximum.accumulate(upper)[:-1]])
    above = np.concatenate([np.minimum.accumulate(lower[::-1])[::-1][1:], [np.inf]]) - values[order]
    gap = np.empty(len(values))
    gap[order] = np.minimum(below, above)
    isolated = gap > residual
    squared = residual**2 / np.where(isolated, gap, 1.0)
    return np.where(isolated, np.minimum(residual, squared), residual)


def grouped_error(values: FloatArray, pull: FloatArray, others: FloatArray) -> FloatArray:
    """Bound the same for modes with known couplings.

    Modes that are close to each other form a group, with an error from the couplings within it and, squared over
    the gap, from those to the rest.

    Parameters
    ----------
    values : (k,) array of float64
        Rayleigh quotients.
    pull : (k, k) array of float64
        Coupling of modes i to modes j, |v_i.M v_j - value_j v_i.v_j|; 0 on the diagonal.
    others : (l,) array of float64
        Eigenvalues of uncoupled modes.

    Returns
    -------
    (k,) array of float64
    """
    radius = np.sqrt((pull**2).sum(axis=0))
    distance = np.abs(values[:, None] - values)
    _, group = scipy.sparse.csgraph.connected_components(
        CLOSE * distance <= np.maximum(pull, pull.T), directed=False
    )
    same, squares = group[:, None] == group, pull**2
    away = np.where(same, np.inf, distance - radius[:, None]).min(axis=0, initial=np.inf)
    gap = _least_of_group(np.minimum(away, _distance_to(others, values)), group)
    within = np.sqrt(np.where(same, squares, 0.0).sum(axis=0))
    outside = np.bincount(group, np.where(same, 0.0, squares).sum(axis=0))[group]
    far = within + outside / np.where(gap > 0, gap, 1.0)
    return np.asarray(np.where(gap > 0, np.minimum(radius, far), radius))


def _least_of_group(values: FloatArray, group: IntArray) -> FloatArray:
    """(k,) smallest value in the group of each."""
    least = np.full(len(values), np.inf)
    np.minimum.at(least, group, values)
    return np.asarray(least[group])


def _distance_to(others: FloatArray, values: FloatArray) -> FloatArray:
    """(k,) distance of each value to the nearest other."""
    known = np.concatenate([[-np.inf], np.sort(others), [np.inf]])
    above = np.searchsorted(known, values)
    return np.asarray(np.minimum(known[above] - values, values - known[above - 1]))


def norms(columns: LongArray) -> FloatArray:
    """Norms (k,) of columns (n, k)."""
    return np.sqrt(np.asarray((columns**2).sum(axis=0), np.float64))
