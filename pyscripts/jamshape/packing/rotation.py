"""Rotations: angles, quaternions and the axes of bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jamshape.arrays import FloatArray

# Loose enough for the six digits of a text dump, tight enough to catch swapped columns.
UNIT_QUATERNION_TOLERANCE = 1e-4


def angle_from_quaternion(quaternion: ArrayLike) -> FloatArray:
    """Angle of a rotation about z, 2 atan2(k, w).

    Parameters
    ----------
    quaternion : (..., 4) array_like
        w i j k; of any norm.

    Returns
    -------
    (...) array of float64
        Radians in (-pi, pi].
    """
    q = np.asarray(quaternion, dtype=np.float64)
    # q and -q are one rotation; with w >= 0 no multiple of 2 pi is subtracted, so no bit is lost.
    q = np.where(q[..., :1] < 0, -q, q)
    angle = 2 * np.arctan2(q[..., 3], q[..., 0])
    return np.where(angle <= -np.pi, np.pi, angle)


def body_axes(quaternions: ArrayLike) -> FloatArray:
    """Turn quaternions into unit vectors along the body's x, y and z axes.

    Parameters
    ----------
    quaternions : (..., 4) array_like
        w i j k; of any norm.

    Returns
    -------
    (..., 3, 3) array of float64
        Row k is the body's axis k in the coordinates of the box.

    Raises
    ------
    ValueError
        If the array has another shape, or a quaternion is zero or not finite.
    """
    q = np.asarray(quaternions, np.float64)
    if q.ndim < 1 or q.shape[-1] != 4:
        msg = f"quaternions have shape {q.shape}, expected (..., 4)"
        raise ValueError(msg)
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    if not (np.isfinite(length) & (length > 0)).all():
        msg = "quaternions hold zero, NaN or infinity, expected rotations"
        raise ValueError(msg)
    w, i, j, k = np.moveaxis(q / length, -1, 0)
    x = [w * w + i * i - j * j - k * k, 2 * (i * j + w * k), 2 * (i * k - w * j)]
    y = [2 * (i * j - w * k), w * w - i * i + j * j - k * k, 2 * (j * k + w * i)]
    z = [2 * (i * k + w * j), 2 * (j * k - w * i), w * w - i * i - j * j + k * k]
    return np.stack([np.stack(axis, axis=-1) for axis in (x, y, z)], axis=-2)


def across(axis: FloatArray) -> FloatArray:
    """(N, 2, 3) two unit vectors perpendicular to each axis (N, 3) and to each other."""
    least = np.eye(3)[np.abs(axis).argmin(axis=1)]
    first = np.cross(axis, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(axis, first)], axis=1)


def product(p: ArrayLike, q: ArrayLike) -> NDArray[Any]:
    """Multiply (N, 4) quaternions w i j k, or one with all: rotation q followed by p."""
    pw, pi, pj, pk = np.asarray(p).T
    qw, qi, qj, qk = np.asarray(q).T
    return np.column_stack([
        pw * qw - pi * qi - pj * qj - pk * qk,
        pw * qi + pi * qw + pj * qk - pk * qj,
        pw * qj - pi * qk + pj * qw + pk * qi,
        pw * qk + pi * qj - pj * qi + pk * qw,
    ])  # fmt: skip
