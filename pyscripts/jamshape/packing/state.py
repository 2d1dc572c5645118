"""Poses of a packing in extended precision."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from jamshape.arrays import FloatArray, LongArray
from jamshape.packing.packing import Packing
from jamshape.packing.rotation import turned
from jamshape.records import Record

_TURN = 2 * np.arccos(np.longdouble(-1))


@dataclass(frozen=True, eq=False)
class State(Record):
    """Poses of particles and the box, in extended precision.

    A double has lost the last eight digits of an overlap of 1e-9 when it holds a position in a box
    of 40; `numpy.longdouble` keeps them. Files hold each number as a double and its low part.

    Parameters
    ----------
    position : (N, D) array of longdouble, [length]
    orientation : (N, 1) angles in 2D, (N, 4) quaternions w i j k in 3D, of longdouble
    cell : (D, D) array of longdouble, [length]
        The box: its cell vectors are the columns, as in `Box.matrix`.
    """

    position: LongArray
    orientation: LongArray
    cell: LongArray

    @classmethod
    def of(cls, packing: Packing) -> State:
        """Take the poses of a packing, including their low parts."""
        position, orientation, cell = (np.asarray(x, np.longdouble) for x in packing.poses())
        return cls(position, orientation.reshape(packing.n, -1), cell)

    @cached_property
    def split(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, orientation, cell, each (2, ...), as doubles and their low parts."""
        position, orientation, cell = map(_split, (self.position, self.orientation, self.cell))
        return position, orientation, cell

    @classmethod
    def joined(cls, position: FloatArray, orientation: FloatArray, cell: FloatArray) -> State:
        """Add doubles and their low parts, each array (2, ...) as `split` gives them."""
        return cls(*(np.longdouble(x[0]) + x[1] for x in (position, orientation, cell)))

    @property
    def dimension(self) -> int:
        """Number of dimensions, 2 or 3."""
        return len(self.cell)

    @property
    def edges(self) -> LongArray:
        """(D,) as in `Box.edges`, [length]."""
        return np.diagonal(self.cell)

    @property
    def volume(self) -> float:
        """Area in 2D, volume in 3D, [length^D]."""
        return float(math.prod(self.edges))

    def strained(self, strain: float) -> State:
        """Scale box and positions by 1 + strain at fixed rotations (Marschall & Teitel 2018, Eq. 20)."""
        factor = 1 + np.longdouble(strain)
        return replace(self, position=factor * self.position, cell=factor * self.cell)

    def deformed(self, gradient: LongArray) -> State:
        """Deform box and positions by an upper triangular matrix (D, D) at fixed rotations."""
        return replace(self, position=self.position @ gradient.T, cell=gradient @ self.cell)

    def with_least_tilt(self) -> State:
        """Choose cell vectors of the same lattice whose tilts are at most half of the edge along them.

        All particles and images keep their places.
        """
        cell = self.cell.copy()
        for column in range(1, self.dimension):
            for row in reversed(range(column)):
                cell[:, column] -= np.rint(cell[row, column] / cell[row, row]) * cell[:, row]
        return replace(self, cell=cell)

    def displaced(self, shift: FloatArray, turn: FloatArray) -> State:
        """Add (N, D) displacements and (N, 1) or (N, 3) rotation vectors."""
        if self.dimension == 2:
            # Full rotations would cost digits: a nearly round particle may make thousands of them.
            orientation = self.orientation + turn
            orientation = orientation - _TURN * np.rint(orientation / _TURN)
        else:
            orientation = turned(self.orientation, np.asarray(turn, np.longdouble))
        return replace(self, position=self.position + shift, orientation=orientation)

    def packing(self, like: Packing) -> Packing:
        """Return the packing of these poses and of the particles of `like`."""
        orientation = self.orientation[:, 0] if self.dimension == 2 else self.orientation
        return like.with_poses(self.position, orientation, self.cell)


def _split(values: LongArray) -> FloatArray:
    """(2, ...) doubles and their low parts."""
    double = values.astype(np.float64)
    return np.stack([double, (values - double).astype(np.float64)])
