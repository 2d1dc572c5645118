"""Rods at given places."""

import numpy as np

from jamshape.packing import Box, Packing


def rods(position, angle, half_length=1.0):
    """Rods (discs) of radius 0.5 in a large box."""
    n = len(position)
    return Packing(
        position=np.array(position, float),
        orientation=np.broadcast_to(np.array(angle, float), n),
        diameters=np.tile([2 * half_length + 1, 1.0, 1.0], (n, 1)),
        species=np.ones(n, int),
        id=np.arange(1, n + 1),
        box=Box(lo=np.zeros(2), edges=np.array([60.0, 60.0])),
    )
