"""Triangle meshes of surfaces, for drawing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jamshape.arrays import FloatArray, IntArray


class SurfaceMesh(NamedTuple):
    """Triangles on the surface of a body, in body coordinates."""

    vertices: FloatArray
    """(V, 3), [length], on the surface up to rounding."""
    triangles: IntArray
    """(T, 3) rows of vertices, counter-clockwise seen from outside."""
    normals: FloatArray
    """(V, 3) outward unit normals of the surface at the vertices."""


def revolved(profile: FloatArray, slope: FloatArray, turns: int) -> SurfaceMesh:
    """Revolve a profile about the body's x.

    Parameters
    ----------
    profile : (K, 2) array of float64, [length]
        x, ascending, and the distance from the axis, which is 0 at both ends.
    slope : (K, 2) array of float64
        Unit normals along x and away from the axis.
    turns : int
        Vertices of a ring.

    Returns
    -------
    SurfaceMesh
        Mesh with K rings.
    """
    angle = 2 * np.pi * np.arange(turns) / turns
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def rings(along: FloatArray) -> FloatArray:
        x = np.broadcast_to(along[:, None, :1], (len(along), turns, 1))
        return np.concatenate([x, along[:, None, 1:] * around], axis=2).reshape(-1, 3)

    ring, corner = np.meshgrid(np.arange(len(profile) - 1), np.arange(turns), indexing="ij")
    a, b = ring * turns + corner, ring * turns + (corner + 1) % turns
    c, d = a + turns, b + turns
    faces = np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, b, c), (b, d, c))])
    return SurfaceMesh(rings(profile), faces.astype(np.int64), rings(slope))


def arc(begin: float, end: float, points: int) -> FloatArray:
    """(points, 2) cosines and sines of angles from `begin` to `end`, [radian]."""
    angle = np.linspace(begin, end, points)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)
