"""The periodic box: a rectangle (cuboid), or with a tilt a parallelogram (parallelepiped).

Its cell vectors are the columns of an upper triangular matrix, as in LAMMPS: [[lx, xy], [0, ly]] in the plane,
[[lx, xy, xz], [0, ly, yz], [0, 0, lz]] in space. Without tilt, results have the same bits as from the edges
alone: only zeros are added.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jamshape.arrays import FloatArray, IntArray, real_numbers
from jamshape.packing.given import as_floats
from jamshape.records import Record

COMPONENTS = {2: ("xx", "yy", "xy"), 3: ("xx", "yy", "zz", "yz", "xz", "xy")}
"""Components of symmetric tensors and of strains of the box, in Voigt's order, by dimension."""

# Relative size of entries that rounding leaves when a program rotates a box forth and back.
_ROUNDING = 1e-13

_ABOVE = {D: np.triu_indices(D, 1) for D in (2, 3)}  # places of the tilts in a matrix


@dataclass(frozen=True, eq=False)
class Box(Record):
    """Periodic box, orthogonal unless it has a tilt.

    Parameters
    ----------
    lo : (D,) array of float64, [length]
        Origin of the cell vectors.
    edges : (D,) array of float64, [length]
        Diagonal of the matrix: lx, ly, lz; the lengths of the edges if there is no tilt.
    tilt : (D (D - 1) / 2,) array of float64, [length], optional
        The matrix above its diagonal, in the order of LAMMPS: (xy,) in 2D, (xy, xz, yz) in 3D; zeros by default.

    Raises
    ------
    ValueError
        If D is neither 2 nor 3, a number is not finite, or an edge is not positive.

    Examples
    --------
    >>> from jamshape import Box
    >>> Box(lo=[0, 0], edges=[10, 12]).volume
    120.0
    >>> Box(lo=[0, 0], edges=[10, 12], tilt=[3]).matrix.tolist()
    [[10.0, 3.0], [0.0, 12.0]]
    """

    lo: FloatArray
    edges: FloatArray
    tilt: FloatArray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        shape = real_numbers("box edges", self.edges).shape
        if shape not in {(2,), (3,)}:
            msg = f"box edges have shape {shape}, expected (2,) or (3,)"
            raise ValueError(msg)
        n_tilts = number_of_tilts(shape[0])
        if real_numbers("box tilt", self.tilt).size == 0:
            object.__setattr__(self, "tilt", np.zeros(n_tilts))
        for name, expected in (("lo", shape), ("edges", shape), ("tilt", (n_tilts,))):
            value = as_floats(f"box {name}", getattr(self, name), expected)
            object.__setattr__(self, name, value)
        if not (self.edges > 0).all():
            msg = f"box edges are {self.edges.tolist()}, expected positive lengths"
            raise ValueError(msg)

    @classmethod
    def of(cls, lo: ArrayLike, matrix: ArrayLike) -> Box:
        """Make a box from its cell vectors.

        Parameters
        ----------
        lo : (D,) array_like, [length]
        matrix : (D, D) array_like, [length]
            Cell vectors as columns.

        Raises
        ------
        ValueError
            As for `Box`, or if the matrix is not upper triangular up to rounding.
        """
        return cls(np.asarray(lo), *Lengths.of(np.asarray(matrix, np.float64)))

    @property
    def dimension(self) -> int:
        """Number of dimensions, 2 or 3."""
        return len(self.edges)

    @property
    def volume(self) -> float:
        """Area in 2D, volume in 3D, [length^D]."""
        return float(np.prod(self.edges))

    @property
    def is_tilted(self) -> bool:
        """Whether a tilt is not zero."""
        return bool(self.tilt.any())

    @cached_property
    def matrix(self) -> FloatArray:
        """(D, D) cell vectors as columns, [length]."""
        return Lengths(self.edges, self.tilt).matrix

    @property
    def tilt_factors(self) -> FloatArray:
        """(D (D - 1) / 2,) each tilt over the edge along its direction, as in HOOMD-blue and freud."""
        return Lengths.of(self.matrix / self.edges).tilt

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner (D,) of the rectangle (cuboid) around the box, [length]."""
        low, high = cuboid_around(self.matrix)
        return self.lo + low, self.lo + high

    @property
    def center(self) -> FloatArray:
        """(D,) centre, [length]."""
        return np.asarray(self.lo + self.matrix.sum(axis=1) / 2)

    @property
    def spacings(self) -> FloatArray:
        """(D,) distances between opposite faces, [length]; at most as long as the edges."""
        return np.asarray(self.edges / np.linalg.norm(self._unsheared, axis=1))

    def heights(self, offset: FloatArray) -> FloatArray:
        """Distances of points from the faces through the lower corner; in the box from 0 to the spacing.

        Parameters
        ----------
        offset : (..., D) array of float64, [length]
            Measured from the lower corner.

        Returns
        -------
        (..., D) array of float64, [length]
        """
        along = offset @ self._unsheared.T
        return np.asarray(along / np.linalg.norm(self._unsheared, axis=1))

    def fractions(self, offset: FloatArray) -> FloatArray:
        """Components (..., D) of vectors (..., D) along the cell vectors, in units of these."""
        return np.asarray(offset @ self._unsheared.T / self.edges)

    def vectors(self, turns: NDArray[Any]) -> FloatArray:
        """Add up (..., D) multiples of the cell vectors, [length]."""
        return np.asarray(turns @ self.matrix.T)

    def wrapped(self, position: FloatArray) -> tuple[FloatArray, IntArray]:
        """Move points (M, D) into the box.

        Returns
        -------
        (M, D) offsets from the lower corner, and (M, D) numbers of cell vectors subtracted
        """
        offset = position - self.lo
        turns = np.floor(self.fractions(offset)).astype(np.int64)
        return offset - self.vectors(turns), turns

    @cached_property
    def _unsheared(self) -> FloatArray:
        """(D, D) map that removes the tilt from vectors and keeps the last component; 1 without tilt."""
        return np.asarray(np.linalg.inv(self.matrix / self.edges), np.float64)


class Lengths(NamedTuple):
    """Possibly nonzero entries of a matrix of cell vectors, of any number type."""

    edges: NDArray[Any]
    """(D,)"""
    tilt: NDArray[Any]
    """(D (D - 1) / 2,) in the order of LAMMPS."""

    @classmethod
    def of(cls, matrix: NDArray[Any]) -> Lengths:
        """Extract the entries of a matrix (D, D).

        Raises
        ------
        ValueError
            If it is not upper triangular up to rounding.
        """
        below = np.abs(np.tril(matrix, -1)).max(initial=0)
        if matrix.shape not in {(2, 2), (3, 3)} or below > _ROUNDING * np.abs(matrix).max(
            initial=0
        ):
            msg = (
                f"the cell vectors are the columns of {matrix.tolist()}, expected the first one along x"
                " and the second one in the x-y plane; rotate box and particles"
            )
            raise ValueError(msg)
        return cls(np.diagonal(matrix).copy(), matrix[_ABOVE[len(matrix)]])

    @property
    def matrix(self) -> NDArray[Any]:
        """(D, D), zero below the diagonal."""
        matrix = np.diag(self.edges)
        matrix[_ABOVE[len(matrix)]] = self.tilt
        return matrix


def cuboid_around(vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return lower and upper corner (D,) of the box around all sums of some of the columns (D, D)."""
    return np.minimum(vectors, 0).sum(axis=1), np.maximum(vectors, 0).sum(axis=1)


def number_of_tilts(dimension: int) -> int:
    """Count the tilts of a box: 1 or 3."""
    return dimension * (dimension - 1) // 2


def affine_change(then: FloatArray, now: FloatArray) -> FloatArray:
    """Return the (D, D) linear map from cell vectors, the columns of (D, D), to others."""
    edges = np.diagonal(then)
    return np.asarray(now / edges @ np.linalg.inv(then / edges))
