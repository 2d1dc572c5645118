"""A Verlet list: pairs that may touch, valid until particles have moved too far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jamshape.arrays import FloatArray, IntArray
from jamshape.contacts.near import NearPairs
from jamshape.packing import State, affine_change


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of particles whose surfaces were within a skin at a state."""

    particles: IntArray
    """(M, 2)"""
    shift: IntArray
    """(M, D) cell vectors of the box to add to the second."""
    then: State
    skin: float
    reach: float
    """Largest distance of their centres."""

    @classmethod
    def of(cls, near: NearPairs, state: State, skin: float, reach: float) -> Pairs:
        """Select pairs with surfaces within a skin, and centres within a reach plus that skin."""
        pairs = np.column_stack([near.first, near.second])
        return cls(pairs, near.shift, state, skin, reach + skin)

    def outrun_by(self, now: State, turning_radius: FloatArray) -> bool:
        """Whether two surfaces may have approached by `skin`."""
        position, orientation, cell = (part[0] for part in now.split)
        position_then, orientation_then, cell_then = (part[0] for part in self.then.split)
        grown = affine_change(cell_then, cell)
        left = self.skin - _strain_of(grown) * self.reach
        moved = np.sqrt(((position - position_then @ grown.T) ** 2).sum(axis=1))
        turn = orientation - orientation_then
        if now.dimension == 2:
            turned = np.abs(turn - 2 * np.pi * np.rint(turn / (2 * np.pi)))[:, 0]
        else:  # the chord of the quaternions is half of the angle, or a little less
            turned = 2.3 * np.sqrt((turn**2).sum(axis=1))
        return bool(2 * (moved + turning_radius * turned).max(initial=0.0) >= left)


def _strain_of(change: FloatArray) -> float:
    """Bound the relative change of length of a vector under an upper triangular map."""
    stretched = np.abs(np.diagonal(change) - 1).max()
    return float(stretched + np.linalg.norm(np.triu(change, 1)))
