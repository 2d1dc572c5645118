"""Discs and spheres turned into rods."""

from __future__ import annotations

import math

import numpy as np

from jamshape.packing.packing import Packing


def with_spines(discs: Packing, alpha: float, seed: int) -> Packing:
    """Give each disc a spine of random direction, and expand the box so that phi is kept.

    Parameters
    ----------
    discs : Packing
        In two dimensions.
    alpha : float
        A / R of all rods; R stays.
    seed : int
        Random seed of the directions.

    Raises
    ------
    ValueError
        If a particle has a spine already.
    """
    if discs.half_length.any():
        msg = f"half lengths up to {discs.half_length.max():g}, expected discs"
        raise ValueError(msg)
    R = discs.radius
    rods = discs.with_(
        diameters=2 * np.column_stack([(1 + alpha) * R, R, R]),
        orientation=np.random.default_rng(seed).uniform(0, np.pi, discs.n),
    )
    factor = 1 + np.longdouble(math.sqrt(rods.phi / discs.phi) - 1)
    position, orientation, cell = rods.poses()
    return rods.with_poses(factor * position, orientation, factor * cell)
