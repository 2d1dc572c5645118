"""Orientational order in three dimensions: global and local nematic S_2 and cubatic C_4.

Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019), Sec. 2.4 and Appendix B. Particles are numbered by
row; `pairs` are (M, 2) rows of particles in contact, each pair once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.packing import UNIT_QUATERNION_TOLERANCE

# Number of cosines in memory at a time, 16 MB.
_BLOCK = 2_000_000

# The same tolerance as for quaternions of a packing.
_UNIT_TOLERANCE = 2 * UNIT_QUATERNION_TOLERANCE


class Order(NamedTuple):
    """Magnitude and direction of orientational order."""

    magnitude: float
    """S_2 or C_4, 1 for perfect order; for random orientations 0.044 or 0.064 at N = 400."""
    direction: FloatArray
    """(3,) unit vector, of either sign; arbitrary without order."""


def nematic_order(directors: ArrayLike) -> Order:
    r"""S_2, the largest eigenvalue of :math:`\frac32 \langle s s^T \rangle - \frac12`.

    Yuan et al. 2019, Eq. 6, with the average over particles. (Over all pairs i and j, as printed, it
    would not vanish for random directions.)

    Parameters
    ----------
    directors : (N, 3) array_like
        Unit vectors s, such as `Packing.directors`; their signs do not matter.

    Returns
    -------
    Order

    Raises
    ------
    ValueError
        If there is no particle, the array has another shape, or a norm is not 1.
    """
    s = _units("directors", directors, 2)
    values, vectors = np.linalg.eigh(_tensors(s.T @ s / len(s)))
    return Order(float(values[-1]), vectors[:, -1])


def cubatic_order(axes: ArrayLike) -> Order:
    r"""C_4, the largest :math:`\langle P_4(t \cdot u_i) \rangle` over all axes t of all particles.

    u_i is the axis of particle i nearest to t (Yuan et al. 2019, Eq. 7). That is not always the one that
    maximises P_4, as they say: P_4 is 3/8 also for an axis perpendicular to t, with which random
    orientations would have C_4 = 0.29 instead of their 0.07 (N = 400). For many particles C_4 is at least
    0.015, the average of P_4 over all directions t.

    Parameters
    ----------
    axes : (N, 3, 3) array_like
        Unit vectors u along the rows, from `jamshape.packing.body_axes`, of any order and sign.

    Returns
    -------
    Order
        Its direction is the axis t.

    Raises
    ------
    ValueError
        If there is no particle, the array has another shape, or a norm is not 1.
    """
    u = _units("axes", axes, 3)
    tried = u.reshape(-1, 3)
    blocks = np.array_split(tried, 1 + tried.size * len(u) // _BLOCK)
    cosines = ((t @ tried.T).reshape(len(t), *u.shape[:2]) for t in blocks)
    means = np.concatenate([_of_nearest(cosine).mean(axis=-1) for cosine in cosines])
    best = int(means.argmax())
    return Order(float(means[best]), tried[best])


def local_nematic_order(directors: ArrayLike, pairs: IntArray) -> FloatArray:
    """S_2 of the particles in contact with each particle, excluding the particle.

    Yuan et al. 2019, Eq. 10, with the average over single particles as in `nematic_order`. Few
    neighbours appear ordered: one has S_2 = 1, ten random ones 0.27 on average.

    Parameters
    ----------
    directors : (N, 3) array_like
        As in `nematic_order`.
    pairs : (M, 2) array of int64

    Returns
    -------
    (N,) array of float64
        NaN for particles without contacts.

    Raises
    ------
    ValueError
        As in `nematic_order`, or if pairs are invalid.
    """
    s = _units("directors", directors, 2)
    of, neighbour = _both_ways(pairs, len(s))
    mean, has_any = _averaged(s[neighbour, :, None] * s[neighbour, None, :], of, len(s))
    return np.where(has_any, np.linalg.eigvalsh(_tensors(mean))[:, -1], np.nan)


def local_cubatic_order(axes: ArrayLike, pairs: IntArray) -> FloatArray:
    """C_4 about each particle: the best of its axes t, averaged over the particles in contact.

    Yuan et al. 2019, Appendix B, with the nearest axis of each neighbour as in `cubatic_order`. (Their
    text lets t run over the axes of the neighbours, which are not a single
    set.) Ten random neighbours have 0.11 on average.

    Parameters
    ----------
    axes : (N, 3, 3) array_like
        As in `cubatic_order`.
    pairs : (M, 2) array of int64

    Returns
    -------
    (N,) array of float64
        NaN for particles without contacts.

    Raises
    ------
    ValueError
        As in `cubatic_order`, or if pairs are invalid.
    """
    u = _units("axes", axes, 3)
    of, neighbour = _both_ways(pairs, len(u))
    along = _of_nearest(np.einsum("mtx,mkx->mtk", u[of], u[neighbour]))
    mean, has_any = _averaged(along, of, len(u))
    return np.where(has_any, mean.max(axis=1), np.nan)


def _units(name: str, vectors: ArrayLike, dimensions: int) -> FloatArray:
    """Check (N, 3) or (N, 3, 3) unit vectors."""
    v = np.asarray(vectors, np.float64)
    if v.ndim != dimensions or v.shape[1:] != (3,) * (dimensions - 1) or not len(v):
        expected = "(N, 3)" if dimensions == 2 else "(N, 3, 3)"
        msg = f"{name} have shape {v.shape}, expected {expected} with N > 0"
        raise ValueError(msg)
    error = np.abs(np.linalg.norm(v, axis=-1) - 1).max()
    if not error < _UNIT_TOLERANCE:
        msg = f"the norm of one of the {name} differs from 1 by {error:.2g}, expected unit vectors"
        raise ValueError(msg)
    return v


def _both_ways(pairs: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """Return each contact from i and from j: (2M,) particles and (2M,) their neighbours."""
    given = np.asarray(pairs)
    if given.ndim != 2 or given.shape[1] != 2 or given.dtype.kind not in "iu":
        msg = f"pairs have shape {given.shape} and dtype {given.dtype}, expected (M, 2) integers"
        raise ValueError(msg)
    if given.size and (given.min() < 0 or given.max() >= n):
        found = f"pairs hold rows from {given.min()} to {given.max()}"
        msg = f"{found}, expected 0 to {n - 1}"
        raise ValueError(msg)
    return given.ravel(), given[:, ::-1].ravel()


def _averaged(values: FloatArray, of: IntArray, n: int) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Average the (M, ...) values of neighbours over each of n particles, and flag those with neighbours."""
    total = np.zeros((n, *values.shape[1:]))
    np.add.at(total, of, values)
    count = np.bincount(of, minlength=n)
    return total / np.maximum(count, 1).reshape(-1, *[1] * (values.ndim - 1)), count > 0


def _tensors(mean: FloatArray) -> FloatArray:
    return np.asarray(1.5 * mean - 0.5 * np.eye(3))


def _of_nearest(cosines: FloatArray) -> FloatArray:
    """P_4 of the largest of three cosines (..., 3), of either sign."""
    square = (cosines**2).max(axis=-1)
    return np.asarray((35 * square**2 - 30 * square + 3) / 8)
