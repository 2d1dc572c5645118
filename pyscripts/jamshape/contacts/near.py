"""Pairs of particles that are near each other, with all periodic images."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.packing import Box, Packing, State

# Bounding spheres are larger by this fraction, so that rounding never drops a contact.
_BOUNDING_MARGIN = 1e-9

# Among so many times more spheres each one is sought by itself: to go through two trees at once pays where both
# are as dense.
_MANY_MORE = 8


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
    """(M, D) cell vectors of the box to add to the second."""

    def take(self, rows: NDArray[Any]) -> NearPairs:
        """Select rows by index or mask."""
        return NearPairs(self.first[rows], self.second[rows], self.shift[rows])


class PairArrays(NamedTuple):
    """Poses and pairs as the classes of `jamshape._contact` take them."""

    position: FloatArray
    """(2, N, D) doubles and their small rests."""
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
        Of any size; a pair is there several times when it is shorter than the bodies.

    Returns
    -------
    NearPairs
        In no particular order; a row of `first` that also stands in `second` meets itself.
    """
    reach = sum(_bound(spheres).max(initial=0) for spheres in (first, second))
    return Surroundings(second, box, reach).near(first)


class Surroundings:
    """Spheres with all their periodic images within reach of the box, in a tree that is made once.

    Parameters
    ----------
    spheres : Spheres
    box : Box
    reach : float, [length]
        At least the largest sum of two radii that will be asked for.
    """

    def __init__(self, spheres: Spheres, box: Box, reach: float) -> None:
        self.box, self._bound = box, _bound(spheres)
        inside, self._turn = box.wrapped(spheres.centre)
        self._owner, self._shift = _images_near_box(inside, box, reach)
        self._tree = cKDTree(inside[self._owner] + box.vectors(self._shift))

    def near(self, first: Spheres) -> NearPairs:
        """Find all pairs of other spheres and these that overlap; as `near_pairs`."""
        inside, turn = self.box.wrapped(first.centre)
        bound = _bound(first)
        reach = bound.max(initial=0) + self._bound.max(initial=0)
        if _MANY_MORE * len(inside) < self._tree.n:
            found = self._tree.query_ball_point(inside, reach, return_sorted=False)
            count = np.fromiter(map(len, found), np.int64, len(found))
            i = np.repeat(np.arange(len(inside)), count)
            image = np.fromiter(itertools.chain.from_iterable(found), np.int64, len(i))
            apart = np.linalg.norm(inside[i] - self._tree.data[image], axis=1)
            return self._kept(i, image, apart, (bound, turn))
        near = cKDTree(inside).sparse_distance_matrix(self._tree, reach, output_type="ndarray")
        return self._kept(near["i"], near["j"], near["v"], (bound, turn))

    def nearest(self, first: Spheres, most: int) -> NearPairs:
        """Find of these pairs those with the centres nearest to each other sphere's, at most so many of each."""
        inside, turn = self.box.wrapped(first.centre)
        apart, image = self._tree.query(inside, np.arange(1, 1 + most))
        i, k = np.nonzero(np.isfinite(apart))
        return self._kept(i, image[i, k], apart[i, k], (_bound(first), turn))

    def _kept(
        self, i: IntArray, image: IntArray, apart: FloatArray, first: tuple[FloatArray, IntArray]
    ) -> NearPairs:
        """Keep pairs of spheres, of bounds and turns `first`, and images that overlap."""
        bound, turn = first
        keep = apart < bound[i] + self._bound[self._owner[image]]
        i, image = i[keep], image[keep]
        j = self._owner[image]
        return NearPairs(i, j, self._shift[image] + turn[i] - self._turn[j])


def _bound(spheres: Spheres) -> FloatArray:
    return (1 + _BOUNDING_MARGIN) * spheres.radius


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


def _images_near_box(inside: FloatArray, box: Box, reach: float) -> tuple[IntArray, IntArray]:
    """List all images of points in the box within `reach` of its faces: their owner, their shift."""
    owner = np.arange(len(inside))
    shift = np.zeros((len(inside), 0), dtype=np.int64)
    # A cell vector moves points along its own direction between faces, and along no other.
    heights = box.heights(inside)
    for d, spacing in enumerate(box.spacings):
        turns = np.arange(-np.ceil(reach / spacing), np.ceil(reach / spacing) + 1, dtype=np.int64)
        height = heights[owner, d, None] + turns * spacing
        row, column = np.nonzero((height > -reach) & (height < spacing + reach))
        owner, shift = owner[row], np.column_stack([shift[row], turns[column]])
    return owner, shift
