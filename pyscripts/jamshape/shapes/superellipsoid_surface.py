"""Triangle meshes of superellipsoids, for drawing."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray, IntArray
from jamshape.shapes.mesh import SurfaceMesh
from jamshape.shapes.roundness import checked

_STILL = 1e-12  # steps of Newton's method on logarithms below this are rounding
_MOST_STEPS = 200  # it takes about ten

# Below this exponent 2p the normals rotate within so little of the surface that triangles there would be
# slivers; this exponent is used instead.
_SHARP = 1.3

# Replaces the logarithm of 0.
_NOTHING = -600.0


def surface_mesh(
    semi_axes: ArrayLike, p: float, level: int = 3, p_across: float | None = None
) -> SurfaceMesh:
    """Cover a superellipsoid evenly with triangles.

    The vertices are those of a sphere's mesh, mapped so that position and normal count equally:
    |x|^2p + ... = 1 with x + n in place of x. So flat sides, edges and tips all get
    their share, at p from 0.5 to 20. The mesh has the symmetry of the body: edges of a box lie on
    edges of triangles, and so do those of an octahedron. With two exponents this holds of the sections across z,
    and of their size and z.

    Parameters
    ----------
    semi_axes : (3,) array_like, [length]
    p : float
    level : int
        Each level makes four triangles of one: 48, 192, 768, 3072 ...
    p_across : float, optional
        Half the exponent of sections across z; p by default.

    Returns
    -------
    SurfaceMesh

    Raises
    ------
    ValueError
        If level is negative, there are several shapes, or the shape is invalid (`checked`).
    """
    axes, exponent = checked(semi_axes, p)
    if axes.shape != (3,) or level < 0:
        found = f"semi-axes have shape {axes.shape} and the level is {level}"
        msg = f"{found}, expected (3,) for one body and a level from 0"
        raise ValueError(msg)
    directions, triangles = _sphere(level)
    sign = np.sign(directions)
    point, slope = _unit_surface(np.abs(directions), 2 * float(exponent), p_across)
    normal = sign * slope / axes
    return SurfaceMesh(
        vertices=sign * point * axes,
        triangles=triangles,
        normals=normal / np.linalg.norm(normal, axis=1, keepdims=True),
    )


def _unit_surface(
    directions: FloatArray, q: float, p_across: float | None
) -> tuple[FloatArray, FloatArray]:
    """Return points (V, 3) of a body with semi-axes 1, and their normals, in the first octant."""
    if p_across is None or 2 * p_across == q:
        log_u = _shares(directions, max(q, _SHARP))
        return np.exp(log_u / q), np.exp((1 - 1 / q) * log_u)
    q_across, across = 2 * p_across, directions[:, :2]
    outer = _shares(np.column_stack([np.hypot(*across.T), directions[:, 2]]), max(q, _SHARP))
    inner = _shares(across, max(q_across, _SHARP))
    log_point = np.column_stack([outer[:, :1] / q + inner / q_across, outer[:, 1] / q])
    rates = 1 - 1 / q, 1 - 1 / q_across
    log_slope = np.column_stack(
        [rates[0] * outer[:, :1] + rates[1] * inner, rates[0] * outer[:, 1]]
    )
    return np.exp(log_point), np.exp(log_slope)


def _shares(directions: FloatArray, q: float) -> FloatArray:
    """Logarithms of u = |x|^q, of sum 1, such that u^(1/q) + u^(1-1/q) has the given directions.

    The two terms are coordinate and slope. Newton's method for log u and the unknown length at once.
    """
    with np.errstate(divide="ignore"):
        goal = np.maximum(np.log(directions), _NOTHING)
    log_u, length = 2 * goal, np.zeros(len(goal))
    for _ in range(_MOST_STEPS):
        position, slope = log_u / q, (1 - 1 / q) * log_u
        both = np.logaddexp(position, slope)
        rate = (np.exp(position - both) + (q - 1) * np.exp(slope - both)) / q
        excess = (both - goal - length[:, None]) / rate
        total = np.logaddexp.reduce(log_u, axis=1)
        share = np.exp(log_u - total[:, None])
        longer = ((share * excess).sum(axis=1) - total) / (share / rate).sum(axis=1)
        change = longer[:, None] / rate - excess
        log_u, length = log_u + change, length + longer
        if np.abs(change).max() < _STILL * np.abs(log_u).max():
            break
    return np.asarray(log_u - np.logaddexp.reduce(log_u, axis=1)[:, None])


def _sphere(level: int) -> tuple[FloatArray, IntArray]:
    """Split a sphere along the nine mirror planes of a cube, and each part in 4^level.

    Returns
    -------
    (V, 3) unit vectors, (T, 3) triangles
    """
    corners = np.array([[1, 0, 0], [1, 1, 0], [1, 1, 1]]) / np.sqrt([[1], [2], [3]])
    orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]]
    signs = 1 - 2 * np.array(list(np.ndindex(2, 2, 2)))
    parts = np.array([corners[:, order] * sign for order in orders for sign in signs])
    for _ in range(level):
        parts = _quartered(parts)
    inward = np.linalg.det(parts) < 0
    parts[inward] = parts[inward, ::-1]
    # Rounded, so that coinciding corners compare equal.
    key = np.round(parts.reshape(-1, 3), 9) + 0.0
    _, first, which = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return parts.reshape(-1, 3)[first], which.reshape(-1, 3).astype(np.int64)


def _quartered(parts: FloatArray) -> FloatArray:
    """Split (T, 3, 3) spherical triangles at the middles of their sides."""
    middle = parts + np.roll(parts, -1, axis=1)  # of 0-1, 1-2 and 2-0
    middle /= np.linalg.norm(middle, axis=2, keepdims=True)
    a, b, c = np.moveaxis(parts, 1, 0)
    ab, bc, ca = np.moveaxis(middle, 1, 0)
    four = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(part, axis=1) for part in four])
