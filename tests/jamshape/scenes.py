"""Packings of rods that many tests look at."""

import numpy as np

from jamshape.contacts import (
    find_contacts,
)
from jamshape.packing import Box, Packing
from jamshape.protocols.random_start import random_packing


def make(position, angle, half_length=1.0, edges=(20.0, 20.0), **changes):
    """Rods (discs) of radius 0.5 in the plane."""
    n = len(position)
    width = np.ones(n)
    fields = {
        "position": np.array(position, float),
        "orientation": np.broadcast_to(np.array(angle, float), n),
        "diameters": np.column_stack([2 * half_length + width, width, width]),
        "species": np.ones(n, int),
        "id": np.arange(1, n + 1),
        "box": Box(lo=np.zeros(2), edges=np.array(edges)),
    }
    return Packing(**(fields | changes))


def scaled(packing, factors):
    """Affine change of the box and of the positions at fixed orientations."""
    box = packing.box
    changed = Box(lo=box.lo * factors, edges=box.edges * factors)
    return packing.with_(position=packing.position * factors, box=changed)


def pressed(n=24, dimension=2, seed=3, mixture=None, phi=None):
    """A random packing, squeezed until the deepest overlap is 20 %, away from the origin."""
    packing = random_packing(
        n, phi or {2: 0.4, 3: 0.2}[dimension], seed, mixture, dimension=dimension
    )
    packing = packing.with_(box=Box(lo=np.full(dimension, -1.3), edges=packing.box.edges))
    for _ in range(200):
        packing = scaled(packing, 0.995)
        bonds = find_contacts(packing, sides=1).bonds
        if (1 - bonds.distance / bonds.reach).max(initial=0) > 0.2:
            return packing
    raise AssertionError


def tiny_box():
    """Two rods that wind around a box half as long, side to side and tip to own tip."""
    along, half_length = np.array([2, 1]) / np.sqrt(5), np.full(2, 4.05)
    shift = 0.7 * along + 0.88 * np.array([-along[1], along[0]])
    angle = np.arctan2(1, 2) + np.array([0.01, -0.015])
    return make([[0, 0], shift], angle, half_length, edges=(4.02, 4.02))
