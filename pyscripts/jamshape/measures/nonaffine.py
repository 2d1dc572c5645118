"""Non-affine displacements between two states: Falk & Langer, Phys. Rev. E 57, 7192 (1998)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.contacts.near import NearPairs, near_spheres
from jamshape.packing import Box, Packing, affine_change
from jamshape.records import Record

# Default cutoff, over the largest distance of the centres of touching particles.
_WIDE = 1.5

# Neighbours whose second moments have a smaller ratio than this do not span space.
_FLAT = 1e-12


@dataclass(frozen=True, eq=False)
class Nonaffine(Record):
    """Motion of N particles from one state to another beside affine maps; rows are those of the first state.

    Parameters
    ----------
    displacement : (N, D) array of float64, [length]
        x' - F x, measured from the lower corner of each box, without the affine map of the box.
    D2_min : (N,) array of float64, [length^2]
        Sum over neighbours of the squared deviation from the local map, Falk & Langer's Eq. 2.11; NaN where the
        neighbours do not span space, and so determine no map.
    local_map : (N, D, D) array of float64
        Best affine map of the neighbours: r' is about ``local_map @ r``; NaN likewise.
    n_neighbours : (N,) array of int64
        Neighbours in the first state, periodic images among them.
    box_map : (D, D) array of float64
        Affine map F of the box.
    neighbours : float, [length]
        Distance of centres up to which particles are neighbours in the first state.

    Examples
    --------
    >>> import jamshape as js
    >>> from jamshape.packing import State
    >>> packing = js.make_packing(js.Spherocylinders(alpha=1), n=16, u0=1e-8, progress=False)
    >>> moved = js.nonaffine(packing, State.of(packing).strained(0.01).packing(packing))
    >>> moved
    <Nonaffine motion of 16 particles: mean D2_min ...e-..., rms displacement ...e-1...>
    """

    displacement: FloatArray
    D2_min: FloatArray
    local_map: FloatArray
    n_neighbours: IntArray
    box_map: FloatArray
    neighbours: float

    def __repr__(self) -> str:
        known = self.D2_min[~np.isnan(self.D2_min)]
        mean = known.mean() if len(known) else np.nan
        rms = np.sqrt((self.displacement**2).sum(axis=1).mean())
        of = f"{len(self.D2_min)} particles"
        return f"<Nonaffine motion of {of}: mean D2_min {mean:.3g}, rms displacement {rms:.3g}>"


def nonaffine_motion(first: Packing, second: Packing, neighbours: float | None = None) -> Nonaffine:
    """Compare two states of the same particles; see `jamshape.nonaffine`."""
    second = _matched(first, second)
    if neighbours is None:
        neighbours = _WIDE * 2 * float(first.outer_radius.max())
    box = _least_strained(first.box, second.box)
    change = affine_change(first.box.matrix, box.matrix)
    moved = _moved(first, second, box, change)
    near = _neighbours(first, neighbours)
    r = first.position[near.first] - first.position[near.second] - first.box.vectors(near.shift)
    # Images are those of the first state; a pair moves by less than half a box relative to the affine map.
    w = moved[near.first] - moved[near.second]
    w = w - box.vectors(np.rint(box.fractions(w)))
    local, squared, count = _fitted(first.n, near, r, w)
    return Nonaffine(moved, squared, change + local, count, change, neighbours)


def relative_motion(first: Packing, second: Packing, held: BoolArray) -> FloatArray:
    """Return by how far particles moved beside a translation and the affine map of the box, to the nearest image.

    Parameters
    ----------
    first : Packing
        Reference state.
    second : Packing
        Another state of the same particles.
    held : (N,) array of bool
        Particles of the first state that count, at least one.

    Returns
    -------
    (n, D) array of float64, [length]
        Displacements of those, with the mean 0.
    """
    second = _matched(first, second)
    box = _least_strained(first.box, second.box)
    now, then = box.fractions(second.position - box.lo), first.box.fractions(first.position - first.box.lo)  # fmt: skip
    apart = (now - then)[held]
    apart -= apart[0]
    moved = box.vectors(apart - np.rint(apart))
    return np.asarray(moved - moved.mean(axis=0))


def turned_tips(first: Packing, second: Packing, held: BoolArray) -> FloatArray:
    """(n,) displacements of the tips of particles by rotation, to the nearest equal direction, [length].

    The chord of the rotation of an axis, times outer minus inner radius: the largest normal displacement of the surface
    of a rod or an ellipse, to first order in the angle.
    """
    second = _matched(first, second)
    chord = np.zeros(first.n)
    for k in range(first.dimension):
        a, b = first.body_axes(k), second.body_axes(k)
        own = np.minimum(*(np.sqrt(((a - sign * b) ** 2).sum(axis=1)) for sign in (1, -1)))
        counts = (first.dimension == 2) | np.isin(first.symmetry_axis, (-1, k))
        chord = np.maximum(chord, np.where(counts, own, 0.0))
    return np.asarray((chord * (first.outer_radius - first.inner_radius))[held])


def _matched(first: Packing, second: Packing) -> Packing:
    """Return the second state with its particles in the order of the first."""
    if first.dimension != second.dimension:
        msg = f"the second state has {second.dimension} dimensions, expected {first.dimension} as in the first"
        raise ValueError(msg)
    if set(first.id.tolist()) != set(second.id.tolist()):
        alone = np.setxor1d(first.id, second.id)
        msg = (
            f"particle {alone[0]} is in only one of the states ({len(alone)} such particles), expected the same ids;"
            " give two states of one packing"
        )
        raise ValueError(msg)
    order = np.empty(first.n, np.int64)
    order[np.argsort(first.id)] = np.argsort(second.id)
    return second.with_(**{name: getattr(second, name)[order] for name in _MOVING})


_MOVING = (
    "position", "orientation", "diameters", "form", "species", "id", "image",
)  # fmt: skip


def _least_strained(first: Box, second: Box) -> Box:
    """Choose cell vectors of the second lattice that are nearest to those of the first: tilts may have flipped."""
    then, cell = first.matrix, second.matrix.copy()
    for column in range(1, len(cell)):
        for row in reversed(range(column)):
            expected = then[row, column] * cell[row, row] / then[row, row]
            turns = np.rint((cell[row, column] - expected) / cell[row, row])
            cell[:, column] -= turns * cell[:, row]
    return Box.of(second.lo, cell)


def _moved(first: Packing, second: Packing, box: Box, change: FloatArray) -> FloatArray:
    """(N, D) displacements without an affine map of the box."""
    then, now = (one.position - one.box.lo + one.box.vectors(one.image) for one in (first, second))
    moved = now - then @ change.T
    if first.image.any() or second.image.any():
        return moved
    return np.asarray(moved - box.vectors(np.rint(box.fractions(moved))))


def _neighbours(packing: Packing, cutoff: float) -> NearPairs:
    """Find pairs of centres within a distance, each from both sides."""
    once = near_spheres(packing.position, np.full(packing.n, 0.5 * cutoff), packing.box)
    both = zip(once, (once.second, once.first, -once.shift), strict=True)
    return NearPairs(*(np.concatenate(parts) for parts in both))


def _fitted(
    n: int, near: NearPairs, r: FloatArray, w: FloatArray
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Fit w = A r around each particle: A (N, D, D), the sum of squares left (N,), and the number of pairs."""
    D = r.shape[1]
    crossed, moments = np.zeros((n, D, D)), np.zeros((n, D, D))
    np.add.at(crossed, near.first, w[:, :, None] * r[:, None, :])
    np.add.at(moments, near.first, r[:, :, None] * r[:, None, :])
    sizes = np.linalg.eigvalsh(moments)
    spans = sizes[:, 0] > _FLAT * sizes[:, -1]
    fit = np.full((n, D, D), np.nan)
    fit[spans] = crossed[spans] @ np.linalg.inv(moments[spans])
    left = w - np.einsum("pkl,pl->pk", fit[near.first], r)
    squared = np.where(spans, 0.0, np.nan)
    np.add.at(squared, near.first, (left**2).sum(axis=1))
    return fit, squared, np.bincount(near.first, minlength=n)
