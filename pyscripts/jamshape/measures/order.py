"""Orientational order in two dimensions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jamshape.packing import Packing


class OrientationalOrder(NamedTuple):
    """Magnitude and direction of n-fold orientational order."""

    S_n: float
    """0 for none (1 / sqrt(N) for random angles), 1 for perfect order."""
    theta_n: float
    """Ordering direction, radians in [-pi/n, pi/n]; arbitrary when S_n is 0."""


def orientational_order(angles: ArrayLike, n: int) -> OrientationalOrder:
    r"""n-fold orientational order, :math:`S_n e^{i n \theta_n} = \langle e^{i n \theta_i} \rangle`.

    Parameters
    ----------
    angles : (N,) array_like
        Radians.
    n : int
        2 for nematic, 4 for tetratic order; any positive integer.

    Returns
    -------
    OrientationalOrder
        S_n and theta_n.

    Raises
    ------
    ValueError
        If there is no angle or n is not positive.

    References
    ----------
    Marschall & Teitel, Phys. Rev. E 97, 012905 (2018), Eqs. 16 and 17.
    """
    theta = np.asarray(angles, dtype=np.float64)
    if theta.ndim != 1 or theta.size == 0:
        msg = f"angles have shape {theta.shape}, expected (N,) with N > 0"
        raise ValueError(msg)
    if n < 1:
        msg = f"n is {n}, expected a positive integer"
        raise ValueError(msg)
    c, s = np.cos(n * theta).mean(), np.sin(n * theta).mean()
    return OrientationalOrder(float(np.hypot(c, s)), float(np.arctan2(s, c) / n))


def planar_order(packing: Packing, n: int = 2) -> OrientationalOrder:
    """Order of the particles of a planar packing that have a direction; 0 without any.

    The same as in LAMMPS's `compute packing`.
    """
    directors = packing.directors[~np.isnan(packing.directors[:, 0])]
    if not len(directors):
        return OrientationalOrder(0.0, 0.0)
    return orientational_order(np.arctan2(directors[:, 1], directors[:, 0]), n)
