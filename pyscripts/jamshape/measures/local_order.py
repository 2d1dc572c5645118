"""Orientational order of the particles in contact with each particle, in two and three dimensions."""

from __future__ import annotations

import numpy as np

from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.measures.order3d import local_cubatic_order, local_nematic_order
from jamshape.packing import Packing, body_axes

NAMES = {2: ("S2", "S4"), 3: ("S2", "C4")}  # by dimension


def local_order(packing: Packing, pairs: IntArray) -> dict[str, FloatArray]:
    """Measure the order of the neighbours of each particle, excluding the particle.

    In space nematic S_2 and cubatic C_4 (Yuan et al. 2019, Appendix B), in the plane nematic S_2 and
    tetratic S_4, the magnitudes of the means of exp(2 i theta) and exp(4 i theta). Particles without direction
    are excluded: for S_2 bodies without a longest or shortest axis, for the others discs and spheres.

    Parameters
    ----------
    packing : Packing
    pairs : (M, 2) array of int64
        Rows of particles in contact.

    Returns
    -------
    dict of str to (N,) array of float64
        Keys are the `NAMES` of the dimension; NaN for particles without such neighbours.
    """
    directors = packing.directors
    tells = np.asarray(np.isfinite(directors).all(axis=1))
    nematic, other = _among(tells, pairs), _among(~packing.is_round, pairs)
    if packing.dimension == 2:
        return {
            "S2": _of_angles(2 * np.arctan2(directors[:, 1], directors[:, 0]), nematic),
            "S4": _of_angles(4 * packing.orientation, other),
        }
    directors[~tells] = [1.0, 0.0, 0.0]  # in no pair
    return {
        "S2": local_nematic_order(directors, nematic),
        "C4": local_cubatic_order(body_axes(packing.quaternions), other),
    }


def _among(chosen: BoolArray, pairs: IntArray) -> IntArray:
    """Select the pairs with both particles chosen."""
    return np.asarray(pairs[chosen[pairs].all(axis=1)])


def _of_angles(angle: FloatArray, pairs: IntArray) -> FloatArray:
    """(N,) magnitudes of the mean exp(i angle) of neighbours."""
    of, neighbour = pairs.ravel(), pairs[:, ::-1].ravel()
    turned, count = np.zeros(len(angle), np.complex128), np.bincount(of, minlength=len(angle))
    np.add.at(turned, of, np.exp(1j * angle[neighbour]))
    return np.where(count > 0, np.abs(turned) / np.maximum(count, 1), np.nan)
