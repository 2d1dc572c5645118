r"""Gaussian curvature of superellipsoids: Yuan et al., Soft Matter (2019), Appendix C.

With u, v, w = :math:`|x/a|^{2p}, |y/b|^{2p}, |z/c|^{2p}` at a point of the surface, u + v + w = 1,

.. math:: K_G (abc)^{2/3} = \frac{(2p - 1)^2 (u v w)^{1 - 1/p}}
    {(abc)^{4/3} (u^m / a^2 + v^m / b^2 + w^m / c^2)^2}, \quad m = 2 - 1/p.

It is 1 on a sphere. Where one of u, v, w is 0, at the three symmetry planes normal to the
axes, it is 0 for p > 1 (flat in one direction, at the six points on the axes in both) and infinite for
p < 1 (an edge, at the axes a tip). Shapes are given as in `jamshape.shapes.roundness`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray, IntArray
from jamshape.shapes.roundness import OCTAHEDRON, checked


def curvature_at_normals(semi_axes: ArrayLike, p: ArrayLike, normals: ArrayLike) -> FloatArray:
    """K_G (abc)^(2/3) at given outward normals.

    There u is proportional to |a n_x|^(2p/(2p-1)), and likewise v and w.

    Parameters
    ----------
    semi_axes : (..., 3) array_like, [length]
    p : (...) array_like
        Above 1/2.
    normals : (..., 3) array_like
        In body coordinates; of any length, signs of components do not matter.

    Returns
    -------
    (...) array of float64
        In [0, inf], never NaN.

    Raises
    ------
    ValueError
        If a normal is zero or not finite, p is 1/2 (an octahedron: flat faces, and edges that have no
        curvature), or the shape is invalid (`checked`).
    """
    axes, exponent = _curved(semi_axes, p)
    log_n = _log_of_direction("normals", normals) + np.log(axes)
    return _scaled_curvature(axes, exponent, (2 * exponent / (2 * exponent - 1))[..., None] * log_n)


def curvature_at_points(semi_axes: ArrayLike, p: ArrayLike, points: ArrayLike) -> FloatArray:
    """K_G (abc)^(2/3) at points of the surface.

    Parameters
    ----------
    semi_axes : (..., 3) array_like, [length]
    p : (...) array_like
        Above 1/2.
    points : (..., 3) array_like, [length]
        In body coordinates. A point off the surface, such as the point where two scaled bodies touch,
        is projected along its ray from the centre.

    Returns
    -------
    (...) array of float64
        In [0, inf], never NaN.

    Raises
    ------
    ValueError
        If a point is the centre or not finite, p is 1/2, or the shape is invalid (`checked`).
    """
    axes, exponent = _curved(semi_axes, p)
    log_x = _log_of_direction("points", points) - np.log(axes)
    return _scaled_curvature(axes, exponent, 2 * exponent[..., None] * log_x)


def contact_curvatures(
    shape: tuple[ArrayLike, ArrayLike], axes: FloatArray, pairs: IntArray, normals: FloatArray
) -> FloatArray:
    """K_G (abc)^(2/3) on both sides of each contact (Appendix C).

    Parameters
    ----------
    shape : tuple of semi-axes and exponent
        (3,) and a number for all particles, or (N, 3) and (N,).
    axes : (N, 3, 3) array of float64
        Unit vectors along the body's axes, from `jamshape.packing.body_axes`.
    pairs : (M, 2) array of int64
    normals : (M, 3) array of float64
        Normals of the plane between the two particles, of either sign.

    Returns
    -------
    (M, 2) array of float64
        On i and on j.

    Raises
    ------
    ValueError
        As for `curvature_at_normals`.
    """
    semi_axes, p = checked(*shape)
    every = np.broadcast_to(semi_axes, (len(axes), 3))[pairs]
    exponent = np.broadcast_to(p, len(axes))[pairs]
    # A body looks the same from n and from -n.
    in_body = np.einsum("msak,mk->msa", axes[pairs], normals)
    return curvature_at_normals(every, exponent, in_body)


def _curved(semi_axes: ArrayLike, p: ArrayLike) -> tuple[FloatArray, FloatArray]:
    axes, exponent = checked(semi_axes, p)
    if (exponent == OCTAHEDRON).any():
        msg = "exponent p is 1/2, expected more: the curvature of an octahedron is undefined at its edges"
        raise ValueError(msg)
    return axes, exponent


def _log_of_direction(name: str, vectors: ArrayLike) -> FloatArray:
    """Logarithms of absolute components relative to the largest, -inf for 0."""
    v = np.abs(np.asarray(vectors, np.float64))
    if v.ndim < 1 or v.shape[-1] != 3:
        msg = f"{name} have shape {v.shape}, expected (..., 3)"
        raise ValueError(msg)
    largest = v.max(axis=-1, keepdims=True)
    if not (np.isfinite(largest) & (largest > 0)).all():
        msg = f"{name} hold zero, NaN or infinity, expected finite vectors with a direction"
        raise ValueError(msg)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(v / largest))


def _scaled_curvature(axes: FloatArray, p: FloatArray, log_u: FloatArray) -> FloatArray:
    """Evaluate the formula at log u, known up to a constant.

    In logarithms: u v w underflows long before the curvature does.
    """
    log_u = log_u - _log_sum(log_u)[..., None]
    log_volume = np.log(axes).sum(axis=-1)
    slope = _log_sum((2 - 1 / p)[..., None] * log_u - 2 * np.log(axes))
    # 0 times -inf: for an ellipsoid u v w does not matter.
    off_planes = np.where((p == 1)[..., None], 0.0, log_u).sum(axis=-1)
    log_k = 2 * np.log(2 * p - 1) + (1 - 1 / p) * off_planes - 4 / 3 * log_volume - 2 * slope
    with np.errstate(over="ignore", under="ignore"):
        return np.asarray(np.exp(log_k))


def _log_sum(logs: FloatArray) -> FloatArray:
    return np.asarray(np.logaddexp.reduce(logs, axis=-1))
