"""Pairs of particles that are near each other, with all periodic images."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jamshape import _contact
from jamshape.arrays import FloatArray, IntArray
from jamshape.packing import Box, State


class NearPairs(NamedTuple):
    """Pairs of bodies, one row for each image of the second that is close enough."""

    first: IntArray
    second: IntArray
    shift: IntArray
    """(M, D) cell vectors of the box to add to the second."""

    def take(self, rows: NDArray[Any]) -> NearPairs:
        """Select rows by index or mask."""
        return NearPairs(self.first[rows], self.second[rows], self.shift[rows])


class PairArrays(NamedTuple):
    """Poses and pairs as arguments of the classes of `jamshape._contact`."""

    position: FloatArray
    """(2, N, D) high and low parts."""
    orientation: FloatArray
    """(2, N, 1) or (2, N, 4)"""
    cell: FloatArray
    """(2, D, D) cell vectors of the box as columns."""
    pairs: IntArray
    """(M, 2)"""
    shift: IntArray
    """(M, D)"""

    @classmethod
    def of(cls, state: State, near: NearPairs) -> PairArrays:
        """Take the poses of a state."""
        return cls(*state.split, np.column_stack([near.first, near.second]), near.shift)


def near_spheres(centre: FloatArray, radius: FloatArray, box: Box) -> NearPairs:
    """Find all pairs of spheres (discs) that overlap, with all periodic images, in ascending order.

    Parameters
    ----------
    centre : (N, D) array of float64, [length]
        Inside or outside the box.
    radius : (N,) array of float64, [length]
    box : Box
        Box of any size; if it is shorter than the spheres, a pair occurs several times.

    Returns
    -------
    NearPairs
        Of (i, j) and (j, i) the one with i <= j; of the images of a sphere itself, one of two opposite ones.

    Raises
    ------
    ValueError
        If the box is so short that a sphere overlaps with a million images.
    """
    particles, shift = _contact.near_spheres(centre, radius, box.matrix)
    return NearPairs(particles[:, 0], particles[:, 1], shift)


def near_particles(state: State, bodies: Any, margin: float = 0.0) -> NearPairs:
    """Find all pairs whose surfaces are closer than a margin, once each, as `near_spheres`.

    Parameters
    ----------
    state : State
    bodies : object of `Packing.compiled`
    margin : float, [length]

    Returns
    -------
    NearPairs
        May include pairs somewhat farther apart.
    """
    particles, shift = bodies.near_particles(*state.split, margin)
    return NearPairs(particles[:, 0], particles[:, 1], shift)
