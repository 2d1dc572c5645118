"""The shapes that the battery tries: the only list of them."""

from battery.shapes.dimers import DIMERS
from battery.shapes.rods import RODS
from battery.shapes.superellipsoids import SUPERELLIPSOIDS

SHAPES = (RODS, SUPERELLIPSOIDS, DIMERS)

__all__ = ["RODS", "SHAPES", "SUPERELLIPSOIDS"]
