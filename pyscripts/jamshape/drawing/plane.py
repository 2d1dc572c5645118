"""Pictures of particles in the plane: outlines in a periodic box, spines and points of contact."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray, IntArray
from jamshape.contacts import ContactNetwork
from jamshape.drawing.styles import CONTACT
from jamshape.packing import Box, Packing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection

SHORTEST = 0.6  # smallest half length of the line along a spine, over the particle's width

_CORNERS = 800  # vertices of an outline, over the square root of the number of particles
_FEWEST, _MOST = 16, 128  # limits of that number


class Images(NamedTuple):
    """Periodic images that reach into a box."""

    owner: IntArray
    """(M,) rows of the packing."""
    center: FloatArray
    """(M, 2)"""


class Shown(NamedTuple):
    """Sizes of lines and dots in a box of this scale."""

    inch: float
    """[length]"""
    thinnest: float
    """Shortest diameter, [length]."""

    @property
    def line(self) -> float:
        """Width of outlines, in points."""
        return float(np.clip(0.025 * 72 * self.thinnest / self.inch, 0.1, 1.0))

    @property
    def dot(self) -> float:
        """Radius of points of contact, [length]."""
        return float(np.clip(0.016 * self.inch, 0.09 * self.thinnest, 0.25 * self.thinnest))


def images(position: FloatArray, reach: FloatArray, box: Box) -> Images:
    """Find all periodic images of bodies of these (N,) radii that reach into the rectangle around the box."""
    inside, near = box.lo + box.wrapped(position)[0], reach[:, None]
    low, high = box.bounds
    around = np.array(list(itertools.product(*zip(low, high, strict=True)))) - box.lo
    farthest = reach.max(initial=0) / box.spacings
    first = np.floor(box.fractions(around).min(axis=0) - farthest).astype(int)
    last = np.ceil(box.fractions(around).max(axis=0) + farthest).astype(int)
    found = []
    for shift in np.ndindex(*(last - first)):
        moved = inside + box.vectors(first + shift)
        seen = ((moved > low - near) & (moved < high + near)).all(axis=1)
        found.append((np.flatnonzero(seen), moved[seen]))
    return Images(np.concatenate([i for i, _ in found]), np.concatenate([x for _, x in found]))


def outlines(packing: Packing, at: Images) -> list[FloatArray]:
    """Trace particles: M polygons (K, 2); equal shapes share one."""
    corners = int(np.clip(_CORNERS / np.sqrt(packing.n + 1), _FEWEST, _MOST))
    rows = np.column_stack([packing.diameters, packing.form])
    kinds, kind = np.unique(rows, axis=0, return_inverse=True)
    bodies = [packing.shape.outline(row[:3], row[3:], corners) for row in kinds]
    axes = np.stack([packing.body_axes(0), packing.body_axes(1)], axis=1)
    of = zip(at.owner.tolist(), at.center, strict=True)
    return [bodies[kind.ravel()[i]] @ axes[i] + center for i, center in of]


def spines(packing: Packing, at: Images) -> FloatArray:
    """(S, 2, 2) ends of lines along the spines, extended if too short to be seen."""
    length = np.array([packing.shape.spine(row) for row in packing.diameters])
    width = packing.diameters[:, :2].min(axis=1) / 2
    half = (np.maximum(length, SHORTEST * width) * (length > 0))[:, None] * packing.axes
    seen = length[at.owner] > 0
    half, center = half[at.owner[seen]], at.center[seen]
    return np.stack([center - half, center + half], axis=1)


def discs(center: FloatArray, radius: float) -> list[FloatArray]:
    """Trace small discs."""
    turn = np.linspace(0, 2 * np.pi, 17)[:-1]
    circle = radius * np.column_stack([np.cos(turn), np.sin(turn)])
    return list(center[:, None] + circle)


def draw_bodies(axes: Axes, packing: Packing, box: Box, **style: Any) -> PolyCollection:
    """Draw particles in or around a box, which may be another part of the periodic packing.

    Parameters
    ----------
    axes : Axes
    packing : Packing
        In two dimensions.
    box : Box
        Box with the edges of the packing's box, or longer than the visible part.
    **style
        Properties of the collection; arrays of length N are taken image by image.
    """
    from matplotlib.collections import PolyCollection  # noqa: PLC0415 - not needed for --help

    at = images(packing.position, packing.outer_radius, box)
    every: dict[str, Any] = {
        name: value[at.owner]
        if isinstance(value, np.ndarray) and len(value) == packing.n
        else value
        for name, value in style.items()
    }
    shown = PolyCollection(outlines(packing, at), **every)
    axes.add_collection(shown)
    return shown


def draw_spines(axes: Axes, packing: Packing, line: float) -> None:
    """Draw lines along the spines."""
    from matplotlib.collections import LineCollection  # noqa: PLC0415 - not needed for --help

    at = images(packing.position, packing.outer_radius, packing.box)
    lines = list(spines(packing, at))
    if lines:
        axes.add_collection(LineCollection(lines, colors="k", lw=line, label="spines"))


def draw_contacts(axes: Axes, packing: Packing, network: ContactNetwork, dot: float) -> None:
    """Draw points of contact."""
    from matplotlib.collections import PolyCollection  # noqa: PLC0415 - not needed for --help

    point = network.bonds.point
    at = images(point, np.full(len(point), dot), packing.box)
    if len(point):
        dots = discs(at.center, dot)
        axes.add_collection(PolyCollection(dots, facecolors=CONTACT, lw=0))
        axes.plot([], [], "o", color=CONTACT, ms=4, label="points of contact")


def show_box(axes: Axes, box: Box) -> None:
    """Set the view to the rectangle around a box, at equal scales and without ticks; draw the box if it is tilted."""
    if box.is_tilted:
        corners = box.lo + box.vectors(np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]))
        axes.plot(*corners.T, color="k", lw=1.2, ls="--")
    (left, bottom), (right, top) = box.bounds
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", xticks=[], yticks=[])
