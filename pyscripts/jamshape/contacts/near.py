"""Pairs of particles that are near each other, with all periodic images."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.packing import Box, State

# Bounding spheres are larger by this fraction, so that rounding never loses a contact.
_BOUNDING_MARGIN = 1e-9


class Spheres(NamedTuple):
    """Bounding spheres (discs) of bodies, inside or outside the box."""

    centre: FloatArray
    """(M, D)"""
    radius: FloatArray
    """(M,)"""


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


def near_pairs(first: Spheres, second: Spheres, box: Box) -> NearPairs:
    """Find all pairs whose bounding spheres overlap, with all periodic images.

    Parameters
    ----------
    first, second : Spheres
    box : Box
        Box of any size; if it is smaller than the bodies, a pair occurs several times.

    Returns
    -------
    NearPairs
        In no particular order; a row of `first` that is also in `second` pairs with itself.
    """
    bound_first, bound_second = (
        (1 + _BOUNDING_MARGIN) * spheres.radius for spheres in (first, second)
    )
    reach = bound_first.max(initial=0) + bound_second.max(initial=0)
    inside, turn = box.wrapped(first.centre)
    others, other_turn = box.wrapped(second.centre)
    owner, shift = _images_near_box(others, box, reach)
    images = cKDTree(others[owner] + box.vectors(shift))
    near = cKDTree(inside).sparse_distance_matrix(images, reach, output_type="ndarray")
    keep = near["v"] < bound_first[near["i"]] + bound_second[owner[near["j"]]]
    i, image = near["i"][keep], near["j"][keep]
    j = owner[image]
    return NearPairs(i, j, shift[image] + turn[i] - other_turn[j])


def each_once(near: NearPairs) -> NearPairs:
    """Keep one of (i, j) and (j, i) in the `near_pairs` of bodies among themselves, sorted.

    Returns
    -------
    NearPairs
        i <= j, ascending; of the images of a body itself, one of two opposite ones.
    """
    i, j, shift = near
    leading = np.take_along_axis(shift, np.argmax(shift != 0, axis=1)[:, None], axis=1)[:, 0]
    near = near.take((i < j) | ((i == j) & (leading > 0)))
    return near.take(np.lexsort((*near.shift.T[::-1], near.second, near.first)))


def near_particles(state: State, bodies: Any, margin: float = 0.0) -> NearPairs:
    """Find all pairs whose surfaces are closer than a margin, once each, in ascending order.

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
    position, _, cell = (both[0] for both in state.split)
    around = Spheres(position, bodies.outer_radius + 0.5 * margin)
    near = each_once(near_pairs(around, around, Box.of(np.zeros(state.dimension), cell)))
    rounding = _BOUNDING_MARGIN * float(bodies.inner_radius.min())
    return nearer(state, bodies, near, margin + rounding)


def nearer(state: State, bodies: Any, near: NearPairs, margin: float) -> NearPairs:
    """Select the pairs whose surfaces are closer than a margin."""
    is_near: BoolArray = bodies.near(*PairArrays.of(state, near), margin)
    return near.take(is_near)


def _images_near_box(inside: FloatArray, box: Box, reach: float) -> tuple[IntArray, IntArray]:
    """List images of points in the box within `reach` of its faces: their owner and shift."""
    owner = np.arange(len(inside))
    shift = np.zeros((len(inside), 0), dtype=np.int64)
    # A cell vector moves points between its own two faces, and parallel to all others.
    heights = box.heights(inside)
    for d, spacing in enumerate(box.spacings):
        turns = np.arange(-np.ceil(reach / spacing), np.ceil(reach / spacing) + 1, dtype=np.int64)
        height = heights[owner, d, None] + turns * spacing
        row, column = np.nonzero((height > -reach) & (height < spacing + reach))
        owner, shift = owner[row], np.column_stack([shift[row], turns[column]])
    return owner, shift
