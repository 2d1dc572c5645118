"""Packings that are pressed together, by name."""

from functools import cache, partial

import numpy as np
from mixtures import bidisperse, of_arrays
from scenes import pressed
from superellipsoid_packings import ellipsoids, octahedra_and_boxes, superellipses


def half_of_them_discs(n):
    """Rods of several lengths among discs."""
    index = np.arange(n)
    half_length = np.where(index % 2, 0.0, 0.5 + index / n)
    radius = np.where(index % 3, 0.5, 0.7)
    return of_arrays(half_length, radius)


PRESSED = {
    "discs": partial(pressed, mixture=bidisperse(0)),
    "rods of alpha 0.01": partial(pressed, mixture=bidisperse(0.01)),
    "rods of alpha 4": pressed,
    "discs and rods": partial(pressed, mixture=half_of_them_discs(24)),
    "rods in space": partial(pressed, n=16, dimension=3),
    "spheres and rods in space": partial(
        pressed, n=16, dimension=3, mixture=half_of_them_discs(16), phi=0.15
    ),
    "ellipsoids": ellipsoids,
    "octahedra and boxes": octahedra_and_boxes,
    "superellipses": superellipses,
}


@cache
def pressed_named(name):
    return PRESSED[name]()
