"""A second evaluation of rods and dimers, in NumPy's long double, over all images one by one.

Rods from the definitions of Marschall & Teitel 2018; it shares nothing with `lammps_plugin/contact/`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from battery.scenes.making import every_image
from jamshape.arrays import BoolArray, FloatArray, IntArray, LongArray
from jamshape.packing import Packing

PARALLEL_SINE = 1e-8


class Found(NamedTuple):
    """What the oracle sees of a packing."""

    force: LongArray
    torque: LongArray
    energy: float
    n_bonds: int
    n_contacts: int
    largest: float
    """Largest force of a bond."""


class Spines(NamedTuple):
    """M pairs of spines; r is the centre of i relative to that of j."""

    r: LongArray
    u_i: LongArray
    u_j: LongArray
    A_i: LongArray
    A_j: LongArray
    d: LongArray


def dot(a: LongArray, b: LongArray) -> LongArray:
    """Products of rows."""
    return np.asarray((a * b).sum(axis=-1))


def cross(a: LongArray, b: LongArray) -> LongArray:
    """Cross products of rows; of the plane (M, 1)."""
    if a.shape[-1] == 2:
        return np.asarray((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[:, None])
    return np.asarray(np.cross(a, b))


def _across(s: Spines) -> LongArray:
    """Give the part of u_i across u_j, through their difference: nearly parallel axes keep its digits."""
    sign = np.where(dot(s.u_i, s.u_j) < 0, -1, 1)[:, None]
    turn = s.u_i - sign * s.u_j
    return np.asarray(turn - dot(turn, s.u_j)[:, None] * s.u_j)


def sine(s: Spines) -> LongArray:
    """|sin| of the angle between the spines."""
    return np.sqrt(dot(_across(s), _across(s)))


def crossing(s: Spines) -> BoolArray:
    """Whether two spines of the plane cross: each has its tips on both sides of the other."""
    bend = np.abs(cross(s.u_i, s.u_j)[:, 0])
    on_i = np.abs(cross(s.u_j, s.r)[:, 0]) < s.A_i * bend
    return np.asarray(on_i & (np.abs(cross(s.u_i, s.r)[:, 0]) < s.A_j * bend))


def closest(s: Spines) -> tuple[LongArray, LongArray, LongArray]:
    """Feet on both spines and the vector between them: the best of all candidates."""
    candidates = []
    for e in (-1, 1):
        t = np.clip(dot(s.u_j, s.r + (e * s.A_i)[:, None] * s.u_i), -s.A_j, s.A_j)
        candidates.append((e * s.A_i, t))
        f = np.clip(dot(s.u_i, (e * s.A_j)[:, None] * s.u_j - s.r), -s.A_i, s.A_i)
        candidates.append((f, e * s.A_j))
    if s.r.shape[1] == 3:
        across = _across(s)
        square = dot(across, across)
        f = -dot(s.r, across) / np.where(square > 0, square, 1)
        t = dot(s.u_j, s.r + f[:, None] * s.u_i)
        inside = (square > 0) & (np.abs(f) < s.A_i) & (np.abs(t) < s.A_j)
        candidates.append((np.where(inside, f, s.A_i), np.where(inside, t, candidates[1][1] * 0)))
        # Where it is not inside, the tip of i with the middle of j, which is never the nearest.
    feet = [np.stack(x) for x in zip(*candidates, strict=True)]
    delta = s.r + feet[0][..., None] * s.u_i - feet[1][..., None] * s.u_j
    best = (delta**2).sum(axis=-1).argmin(axis=0)
    row = np.arange(len(s.r))
    return feet[0][best, row], feet[1][best, row], delta[best, row]


def middle(s: Spines) -> tuple[LongArray, LongArray, BoolArray]:
    """Middle of the overlap of two nearly parallel spines on both, and whether they overlap."""

    def centre(at: LongArray, own: LongArray, other: LongArray) -> tuple[LongArray, LongArray]:
        low, high = np.maximum(-own, at - other), np.minimum(own, at + other)
        return (low + high) / 2, high - low

    f, length = centre(-dot(s.r, s.u_i), s.A_i, s.A_j)
    t, _ = centre(dot(s.r, s.u_j), s.A_j, s.A_i)
    return f, t, length > 0


def long_axes(packing: Packing, quaternion: FloatArray | None = None) -> LongArray:
    """(N, D) unit axes in long double, from the poses or from quaternions as LAMMPS holds them."""
    if quaternion is None and packing.dimension == 2:
        angle = packing.poses()[1]
        return np.column_stack([np.cos(angle), np.sin(angle)])
    q = packing.poses()[1] if quaternion is None else np.asarray(quaternion, np.longdouble)
    w, i, j, k = q.T
    x = np.column_stack([w * w + i * i - j * j - k * k, 2 * (i * j + w * k), 2 * (i * k - w * j)])
    unit: LongArray = (x / (q**2).sum(axis=1, keepdims=True))[:, : packing.dimension]
    return unit


class Pulls(NamedTuple):
    """Forces at points of contact: each on its first particle, the opposite on its second."""

    pairs: IntArray
    """(M, 2) particles"""
    arms: tuple[LongArray, LongArray]
    """(M, D) from the centre of either to the point"""
    force: LongArray
    """(M, D), zero where they do not touch"""
    energy: LongArray
    """(M,)"""
    touching: BoolArray
    """(M,)"""


def summed(packing: Packing, pulls: Pulls, n_contacts: int) -> Found:
    """Add the forces of all points of contact up."""
    (i, j), force = pulls.pairs.T, pulls.force
    torques = [cross(arm, force) for arm in pulls.arms]
    total = np.zeros((packing.n, packing.dimension), force.dtype)
    torque = np.zeros((packing.n, torques[0].shape[1]), force.dtype)
    for particles, sign, turning in ((i, 1, torques[0]), (j, -1, torques[1])):
        np.add.at(total, particles, sign * force)
        np.add.at(torque, particles, sign * turning)
    return Found(
        force=total,
        torque=torque,
        energy=float(pulls.energy.sum()),
        n_bonds=int(pulls.touching.sum()),
        n_contacts=n_contacts,
        largest=float(np.sqrt(dot(force, force)).max(initial=0)),
    )


def spines_of(packing: Packing, quaternion: FloatArray | None) -> tuple[IntArray, Spines]:
    """All pairs that may touch, with all images, as (M, 2) particles and their spines."""
    pairs, shift = every_image(packing)
    i, j = pairs.T
    x, _, cell = packing.poses()
    u = long_axes(packing, quaternion)
    A, R = (np.asarray(length, np.longdouble) for length in (packing.half_length, packing.radius))
    return pairs, Spines(x[i] - x[j] - shift @ cell.T, u[i], u[j], A[i], A[j], R[i] + R[j])


def of_rods(packing: Packing, k_e: float = 1.0, quaternion: FloatArray | None = None) -> Found:
    """Energy, forces and torques of one-bond contacts, over every pair and every image.

    Raises
    ------
    ValueError
        If spines cross.
    """
    pairs, s = spines_of(packing, quaternion)
    f, t, delta = closest(s)
    distance = np.sqrt(dot(delta, delta))
    touching = distance < s.d
    if packing.dimension == 2 and (crossing(s) & touching).any():
        msg = "spines cross, expected apart ones"
        raise ValueError(msg)
    middle_f, middle_t, overlapping = middle(s)
    flat = (sine(s) < PARALLEL_SINE) & overlapping
    arms = (
        np.where(flat, middle_f, f)[:, None] * s.u_i,
        np.where(flat, middle_t, t)[:, None] * s.u_j,
    )
    delta = s.r + arms[0] - arms[1]
    normal = delta / np.maximum(np.sqrt(dot(delta, delta)), np.longdouble(1e-300))[:, None]
    overlap = np.where(touching, 1 - distance / s.d, 0)
    force = (k_e * overlap / s.d)[:, None] * normal
    energy = np.asarray(0.5 * k_e * overlap**2, np.longdouble)
    pulls = Pulls(pairs, arms, force, energy, touching)
    return summed(packing, pulls, int(touching.sum()))


def of_dimers(packing: Packing, k_e: float = 1.0, quaternion: FloatArray | None = None) -> Found:
    """Energy, forces and torques of the up to four bonds of each contact of dimers."""
    pairs, s = spines_of(packing, quaternion)
    bonds = [_of_discs(s, a, b, k_e) for a in (-1, 1) for b in (-1, 1)]
    arms_i, arms_j, force, energy, touching = (np.concatenate(x) for x in zip(*bonds, strict=True))
    pulls = Pulls(np.tile(pairs, (4, 1)), (arms_i, arms_j), force, energy, touching)
    n_contacts = int(touching.reshape(4, -1).any(axis=0).sum())
    return summed(packing, pulls, n_contacts)


def _of_discs(s: Spines, a: int, b: int, k_e: float) -> tuple[Any, ...]:
    """Arms, force, energy and whether they touch, of one disc of each: at the ends a and b of the spines."""
    arms = (a * s.A_i[:, None] * s.u_i, b * s.A_j[:, None] * s.u_j)
    delta = s.r + arms[0] - arms[1]
    distance = np.sqrt(dot(delta, delta))
    overlap = np.maximum(1 - distance / s.d, 0)
    force = (k_e * overlap / s.d / np.maximum(distance, np.longdouble(1e-300)))[:, None] * delta
    return (*arms, force, np.asarray(0.5 * k_e * overlap**2), np.asarray(distance < s.d))
