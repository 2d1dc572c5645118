"""Orientational order: in two dimensions, and all that files have of it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray
from jamshape.measures.order3d import cubatic_order, nematic_order
from jamshape.packing import Packing, body_axes


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
    directors = _directors(packing)
    if not len(directors):
        return OrientationalOrder(0.0, 0.0)
    return orientational_order(np.arctan2(directors[:, 1], directors[:, 0]), n)


def nematic_of(packing: Packing) -> OrientationalOrder:
    """S_2 and its direction, as LAMMPS's `compute packing` has them: 0 without directors, the direction in the plane only."""
    if packing.dimension == 2:
        return planar_order(packing)
    magnitude = nematic(packing)
    return OrientationalOrder(0.0 if math.isnan(magnitude) else magnitude, 0.0)


def order(packing: Packing) -> dict[str, float]:
    """Orientational order as files have it: S2 and S4 in two dimensions, S2 and C4 in three."""
    if packing.dimension == 2:
        return {"S2": nematic(packing), "S4": tetratic(packing)}
    return {"S2": nematic(packing), "C4": cubatic(packing)}


def nematic(packing: Packing) -> float:
    """S_2 of the particles with a direction; NaN without any.

    Marschall & Teitel 2018, Eq. 16, in the plane; Yuan et al. 2019, Eq. 6, in space.
    """
    directors = _directors(packing)
    if not len(directors):
        return math.nan
    if packing.dimension == 2:
        return planar_order(packing, 2).S_n
    return float(nematic_order(directors).magnitude)


def tetratic(packing: Packing) -> float:
    """S_4 of the particles with a direction (Marschall & Teitel 2018, Eq. 16); NaN without any, and in space."""
    is_defined = packing.dimension == 2 and len(_directors(packing))
    return planar_order(packing, 4).S_n if is_defined else math.nan


def cubatic(packing: Packing) -> float:
    """C_4 of all particles (Yuan et al. 2019, Eq. 7); NaN if none has a direction, and in the plane."""
    is_defined = packing.dimension == 3 and len(_directors(packing))
    return (
        float(cubatic_order(body_axes(packing.quaternions)).magnitude) if is_defined else math.nan
    )


def _directors(packing: Packing) -> FloatArray:
    """(M, D) directions of the particles that have one."""
    directors = packing.directors
    return directors[~np.isnan(directors[:, 0])]
