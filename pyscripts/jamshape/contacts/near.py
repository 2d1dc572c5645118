"""Pairs of particles that are near each other, with all periodic images."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.packing import Box, Packing, State

# Bounding spheres are larger by this fraction, so that rounding never drops a contact.
_BOUNDING_MARGIN = 1e-9


class Spheres(NamedTuple):
    """Spheres (discs) around bodies, anywhere, in the box or not."""

    centre: FloatArray
    """(M, D)"""
    radius: FloatArray
    """(M,)"""


class NearPairs(NamedTuple):
    """Pairs of bodies, one row for each image of the second that is near enough."""

    first: IntArray
    second: IntArray
    shift: IntArray
    """(M, D) box edges to add to the second."""

    def take(self, rows: NDArray[Any]) -> NearPairs:
        """Select rows by index or mask."""
        return NearPairs(self.first[rows], self.second[rows], self.shift[rows])


class PairArrays(NamedTuple):
    """Poses and pairs as the classes of `jamshape._contact` take them."""

    position: FloatArray
    """(2, N, D) doubles and their small rests."""
    orientation: FloatArray
    """(2, N, 1) or (2, N, 4)"""
    edges: FloatArray
    """(2, D)"""
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
        Of any size; a pair is there several times when it is shorter than the bodies.

    Returns
    -------
    NearPairs
        In no particular order; a row of `first` that also stands in `second` meets itself.
    """
    edges, both = box.edges, (first, second)
    turns = [np.floor((s.centre - box.lo) / edges).astype(np.int64) for s in both]
    inside = [s.centre - box.lo - turn * edges for s, turn in zip(both, turns, strict=True)]
    bounds = [(1 + _BOUNDING_MARGIN) * s.radius for s in both]
    reach = bounds[0].max(initial=0) + bounds[1].max(initial=0)
    owner, shift = _images_near_box(inside[1], edges, reach)
    near = cKDTree(inside[0]).sparse_distance_matrix(
        cKDTree(inside[1][owner] + shift * edges), reach, output_type="ndarray"
    )
    i, j = near["i"], owner[near["j"]]
    keep = near["v"] < bounds[0][i] + bounds[1][j]
    i, j, shift = i[keep], j[keep], shift[near["j"][keep]]
    return NearPairs(i, j, shift + turns[0][i] - turns[1][j])


def each_once(near: NearPairs) -> NearPairs:
    """Of the `near_pairs` of bodies among themselves, keep one of (i, j) and (j, i), and sort.

    Returns
    -------
    NearPairs
        i <= j, ascending; of a body and its own images one of each two that are opposite.
    """
    i, j, shift = near
    leading = np.take_along_axis(shift, np.argmax(shift != 0, axis=1)[:, None], axis=1)[:, 0]
    near = near.take((i < j) | ((i == j) & (leading > 0)))
    return near.take(np.lexsort((*near.shift.T[::-1], near.second, near.first)))


def near_particles(packing: Packing, bodies: Any, margin: float = 0.0) -> NearPairs:
    """Find all pairs whose surfaces are closer than a margin, once each, in ascending order.

    Parameters
    ----------
    packing : Packing
    bodies : object of `Packing.compiled`
    margin : float, [length]

    Returns
    -------
    NearPairs
        And perhaps some that are not so close.
    """
    around = Spheres(packing.position, bodies.outer_radius + 0.5 * margin)
    near = each_once(near_pairs(around, around, packing.box))
    rounding = _BOUNDING_MARGIN * float(bodies.inner_radius.min())
    return nearer(State.of(packing), bodies, near, margin + rounding)


def nearer(state: State, bodies: Any, near: NearPairs, margin: float) -> NearPairs:
    """Select those of some pairs whose surfaces are closer than a margin."""
    is_near: BoolArray = bodies.near(*PairArrays.of(state, near), margin)
    return near.take(is_near)


def _images_near_box(
    inside: FloatArray, edges: FloatArray, reach: float
) -> tuple[IntArray, IntArray]:
    """List all images of points in [0, edges) within `reach` of it: their owner, their shift."""
    owner = np.arange(len(inside))
    shift = np.zeros((len(inside), 0), dtype=np.int64)
    for d, edge in enumerate(edges):
        turns = np.arange(-np.ceil(reach / edge), np.ceil(reach / edge) + 1, dtype=np.int64)
        coordinate = inside[owner, d, None] + turns * edge
        row, column = np.nonzero((coordinate > -reach) & (coordinate < edge + reach))
        owner, shift = owner[row], np.column_stack([shift[row], turns[column]])
    return owner, shift
