"""Packings on which pair styles are tried: those of every shape of the table, and special ones of some."""

from __future__ import annotations

from functools import cache, partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from every_shape import ALL, EPS, MIXTURES, ROUNDING, TYPICAL, in_a_small_box, pressed, squeezed
from lammps_scenes import (
    dense,
    dense_mixture,
    moved,
    on_grid,
    relaxed,
    rods,
    rods_3d,
    tiny_box,
    with_odd_ids,
)
from superellipsoid_scenes import CROWDS, crowd, particles
from superellipsoid_scenes import tiny_box as tiny_box_of_superellipsoids

if TYPE_CHECKING:
    from collections.abc import Callable

    from jamshape.packing import Packing


class Scene(NamedTuple):
    make: Callable[[], Packing]
    rounding: float | None
    """Of forces, relative to the largest; None where it depends on the box and the overlaps."""
    least_torque: float = 1e-3
    """As in `difference_from`."""


def with_rattlers(case):
    """Two particles become so small that they touch nothing."""
    packing = pressed(case)
    diameters = packing.diameters.copy()
    diameters[:2] /= 2
    return packing.with_(diameters=diameters)


def lone_rod():
    """A rod tip to tip with its own image, and side to side with the next row's."""
    return rods([[0.1, 0.2]], 0.01, 1.0, 0.5, [2.9, 0.9375])


def tiny_box_3d():
    quaternion = [[1.0, 0.0, 0.02, 0.0], [1.0, 0.03, 0.0, 0.01]]
    return rods_3d([[0, 0, 0], [0.25, 1.0, 0.1]], quaternion, 1.5, [0.6, 0.5], [4.0, 2.0, 1.0625])


def jammed(dimension, alpha):
    """Near a minimum; of 40 nearly round particles some rattle."""
    phi = {2: 0.83, 3: 0.64}[dimension]
    start = dense(dimension, alpha=alpha, n=40, phi=phi, kick=0.0, seed=4)
    return with_odd_ids(relaxed(start, 2000), 3)


# Positions and boxes are multiples of powers of 2, so that periodic images are exact.
RODS = {
    "rods": dense,
    "mixture": dense_mixture,
    "nearly discs": lambda: dense(alpha=0.01, phi=1.0),
    "discs": lambda: dense(alpha=0.0, phi=1.0),
    "odd ids": lambda: with_odd_ids(dense(), 5),
    "shifted": lambda: on_grid(moved(dense(), [0.37, 0.61])),
    "tiny box": tiny_box,
    "lone rod": lone_rod,
    "rods 3d": lambda: dense(3, alpha=3.0, phi=0.8),
    "mixture 3d": lambda: dense_mixture(3, phi=0.8),
    "spheres": lambda: dense(3, alpha=0.0, phi=0.85),
    "tiny box 3d": tiny_box_3d,
}
JAMMED = {
    f"jammed, {D}D, alpha {alpha:g}": partial(jammed, D, alpha)
    for D in (2, 3)
    for alpha in (0.0, 0.02, 4.0)
}
SUPERELLIPSOIDS = {
    "bodies": crowd,
    "p 0.75": lambda: crowd(kinds=(0,)),
    "p 1": lambda: crowd(kinds=(1,)),
    "p 1.5": lambda: crowd(kinds=(2,)),
    "p 2": lambda: crowd(kinds=(3,)),
    "bodies, odd ids": lambda: with_odd_ids(crowd(), 5),
    "bodies, shifted": lambda: moved(crowd(), [0.5, 0.25, 0.75]),
    "bodies, tiny box": tiny_box_of_superellipsoids,
    "equal spheres": lambda: particles(
        crowd().position, [1.0, 0, 0, 0], 0.6, 1.0, crowd().box.edges
    ),
    "spheres of sizes": lambda: crowd(kinds=(2,)).with_(exponent=np.ones(48)),
    "plane": lambda: crowd(2, phi=0.95),
    "plane p 2": lambda: crowd(2, kinds=(3,), phi=0.95),
    "plane tiny box": lambda: tiny_box_of_superellipsoids(2),
}
SCENES = {
    **{
        f"{case}{ending}": Scene(
            lambda make=make, case=case: with_odd_ids(make(case), 3), None, 1.0
        )
        for make, ending, cases in (
            (pressed, "", ALL),
            (in_a_small_box, "-small", (*TYPICAL, *MIXTURES)),
            (partial(squeezed, overlap=0.002), "-barely", ALL),
            (with_rattlers, "-loose", TYPICAL),
        )
        for case in cases
    },
    **{name: Scene(make, 1e-14) for name, make in RODS.items()},
    **{name: Scene(make, 1e-13) for name, make in JAMMED.items()},
    **{name: Scene(make, 1e-13) for name, make in SUPERELLIPSOIDS.items()},
    # Flat faces and sharp tips magnify rounding.
    **{f"extreme, {name}": Scene(make, 1e-12) for name, make in CROWDS.items()},
}


@cache
def packing_of(name):
    return SCENES[name].make()


def limit_of(name, network):
    """Rounding of forces that a scene may have."""
    found = SCENES[name].rounding
    if found is not None:
        return found
    # Coordinates are rounded to EPS of the box, forces by that over the overlap.
    overlap = 1 - network.bonds.distance / network.bonds.reach
    return max(ROUNDING, 8 * EPS * packing_of(name).box.edges.max() / np.max(overlap))
