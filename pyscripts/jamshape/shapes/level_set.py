"""Triangle meshes of bodies given by a function that is negative inside."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from jamshape.arrays import FloatArray, IntArray
from jamshape.shapes.mesh import SurfaceMesh

# A cube is cut into six tetrahedra about its diagonal, each along one order of the axes.
_TETRAHEDRA = np.array(
    [
        np.cumsum([[0, 0, 0], *np.eye(3, dtype=int)[list(order)]], axis=0)
        for order in itertools.permutations(range(3))
    ]
)
_CELLS = 6  # along the longest edge, at level 0; each level has twice as many
_AROUND = 1.1  # the box of the grid over that of the body
_SMALL = 1e-3  # step of differences over a cell


def level_set_mesh(
    height: Callable[[FloatArray], FloatArray], half_extents: FloatArray, level: int
) -> SurfaceMesh:
    """Cover the surface where a function is 0 with triangles: marching tetrahedra.

    Parameters
    ----------
    height : callable
        From points (P, 3) to (P,) lengths, negative inside; like the distance from the surface near it.
    half_extents : (3,) array of float64, [length]
        Half edges of a box about 0 that holds the body.
    level : int
        Each level halves the cells of the grid.

    Returns
    -------
    SurfaceMesh
        Closed; vertices are off the surface by the square of a cell over its radius of curvature.
    """
    cell = 2 * _AROUND * half_extents.max() / (_CELLS * 2**level)
    counts = np.ceil(2 * _AROUND * half_extents / cell).astype(int)
    corner = -cell * counts / 2
    grid = np.stack(np.meshgrid(*(np.arange(n + 1) for n in counts), indexing="ij"), axis=-1)
    value = height((corner + cell * grid).reshape(-1, 3))
    value = np.where(value == 0, np.finfo(float).tiny, value)
    number = np.arange(len(value)).reshape(counts + 1)
    stride = np.array([number[1, 0, 0], number[0, 1, 0], number[0, 0, 1]])
    inside = value.reshape(counts + 1) < 0
    places = (tuple(slice(s, n + s) for s, n in zip(shift, counts, strict=True)) for shift in itertools.product((0, 1), repeat=3))  # fmt: skip
    cut = [inside[at] for at in places]
    near = np.any(cut, axis=0) & ~np.all(cut, axis=0)
    origin = number[:-1, :-1, :-1][near]
    four = (origin[:, None, None] + (_TETRAHEDRA @ stride)[None]).reshape(-1, 4)
    edges = _cut_edges(four, value)
    # One number for both ends of an edge, which is sorted in a fraction of the time of two.
    low, high = np.sort(edges.reshape(-1, 2), axis=1).T
    both, which = np.unique(low * len(value) + high, return_inverse=True)
    ends = np.column_stack(np.divmod(both, len(value)))
    triangles = which.reshape(-1, 3)
    points = (corner + cell * grid).reshape(-1, 3)
    a, b = (points[ends[:, k]] for k in (0, 1))
    share = (value[ends[:, 0]] / (value[ends[:, 0]] - value[ends[:, 1]]))[:, None]
    vertices = a + share * (b - a)
    out = (points[edges[..., 1]] - points[edges[..., 0]]).sum(axis=1)
    corners = _outward(vertices, triangles, out)
    return SurfaceMesh(vertices, corners, _slopes(height, vertices, _SMALL * cell))


def _slopes(
    height: Callable[[FloatArray], FloatArray], points: FloatArray, step: float
) -> FloatArray:
    """(P, 3) unit vectors along the gradient."""
    found = np.stack(
        [height(points + step * axis) - height(points - step * axis) for axis in np.eye(3)], axis=1
    )
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def _cut_edges(four: IntArray, value: FloatArray) -> IntArray:
    """Return, for tetrahedra (T, 4), the triangles (M, 3, 2) between edges that the surface cuts, from inside to outside."""
    found: list[list[tuple[IntArray, IntArray]]] = []
    order = np.argsort(value[four] >= 0, axis=1, kind="stable")  # corners inside come first
    four = np.take_along_axis(four, order, axis=1)
    n_inside = (value[four] < 0).sum(axis=1)
    a, b, c, d = (four[n_inside == 1][:, k] for k in range(4))
    found.append([(a, b), (a, c), (a, d)])
    a, b, c, d = (four[n_inside == 3][:, k] for k in range(4))
    found.append([(a, d), (b, d), (c, d)])
    a, b, c, d = (four[n_inside == 2][:, k] for k in range(4))
    found += [[(a, c), (a, d), (b, d)], [(a, c), (b, d), (b, c)]]
    return np.concatenate(
        [np.stack([np.stack(edge, axis=-1) for edge in three], axis=1) for three in found]
    )


def _outward(vertices: FloatArray, triangles: IntArray, out: FloatArray) -> IntArray:
    """Order corners counter-clockwise seen from outside, where directions (M, 3) point."""
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    inward = (np.cross(b - a, c - a) * out).sum(axis=1) < 0
    return np.where(inward[:, None], triangles[:, ::-1], triangles)
