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


def turned(quaternion: NDArray[Any], vector: NDArray[Any]) -> NDArray[Any]:
    """Rotate (N, 4) quaternions by (N, 3) rotation vectors, in space coordinates."""
    angle = np.sqrt((vector**2).sum(axis=1, keepdims=True))
    axis = vector / np.where(angle > 0, angle, 1)
    half = np.concatenate([np.cos(angle / 2), np.sin(angle / 2) * axis], axis=1)
    found = product(half, quaternion)
    unit: NDArray[Any] = found / np.sqrt((found**2).sum(axis=1, keepdims=True))
    return unit


def spin_of_vector(vector: FloatArray, rate: FloatArray) -> FloatArray:
    """(N, 3) angular velocities in space at (N, 3) rotation vectors that change at (N, 3) rates.

    The left Jacobian of SO(3). About body axes it is the right one: that of -vector.
    """
    angle = np.linalg.norm(vector, axis=1, keepdims=True)
    once = np.cross(vector, rate)
    first = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    # Near zero the closed form loses all digits to cancellation; its series does not.
    is_small = angle < 1e-2
    safe = np.where(is_small, 1.0, angle)
    second = np.where(is_small, 1 / 6 - angle**2 / 120, (safe - np.sin(safe)) / safe**3)
    found: FloatArray = rate + first * once + second * np.cross(vector, once)
    return found


def rate_of_vector(vector: FloatArray, spin: FloatArray) -> FloatArray:
    """(N, 3) rates of change of (N, 3) rotation vectors shorter than 2 pi; the inverse of `spin_of_vector`."""
    angle = np.linalg.norm(vector, axis=1, keepdims=True)
    once = np.cross(vector, spin)
    is_small = angle < 1e-2
    safe = np.where(is_small, 1.0, angle)
    second = np.where(
        is_small, 1 / 12 + angle**2 / 720, (1 - 0.5 * safe / np.tan(0.5 * safe)) / safe**2
    )
    found: FloatArray = spin - 0.5 * once + second * np.cross(vector, once)
    return found
