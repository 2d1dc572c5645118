"""Bodies in terms of other programs, which do not know our shapes, as `Shape.solid` returns them.

All are in body coordinates, and lengths in those of the packing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from jamshape.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class RoundedSegment:
    """All points within a radius of a segment along x; a sphere where its half length is 0."""

    half_length: float
    radius: float
    GLYPH: ClassVar[str] = "Spherocylinder"
    """OVITO's name."""


@dataclass(frozen=True, eq=False)
class Superquadric:
    """(|x/a|^(2/e2) + |y/b|^(2/e2))^(e2/e1) + |z/c|^(2/e1) = 1 with the roundness e: 1 for ellipsoids, 0 for boxes."""

    semi_axes: FloatArray
    """(3,)"""
    roundness: tuple[float, float]
    """e1 from pole to pole (OVITO's Phi) and e2 around them (Theta)."""
    GLYPH: ClassVar[str] = "Sphere"
    """OVITO's name; another property sets its roundness."""


@dataclass(frozen=True, eq=False)
class Balls:
    """Several balls."""

    centers: FloatArray
    """(K, 3)"""
    radii: FloatArray
    """(K,)"""


@dataclass(frozen=True, eq=False)
class RoundedPolygon:
    """All points in the plane within a radius of a convex polygon."""

    corners: FloatArray
    """(K, 2), counter-clockwise."""
    radius: float


Solid = RoundedSegment | Superquadric | Balls | RoundedPolygon
