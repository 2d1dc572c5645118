"""Contacts of rods and dimers a second time, in long double, from `tests/contact`'s formulas over all images."""

from typing import NamedTuple

import numpy as np
from dimer_pairs import forces, overlaps
from packings_in_a_box import every_image
from reference_energy import closest_foot, end_feet
from spherocylinder_pairs import Pairs, cross, row_dot, scaled

PARALLEL_SINE = 1e-8


class Expected(NamedTuple):
    force: np.ndarray
    torque: np.ndarray
    n_bonds: int
    n_contacts: int
    largest: float
    """Largest force of a bond."""


def in_long(pairs):
    return Pairs(**{name: np.asarray(x, np.longdouble) for name, x in vars(pairs).items()})


def crossing(pairs):
    """Whether spines of the plane cross: each has its tips on both sides of the other."""
    sine = np.abs(cross(pairs.u_i, pairs.u_j)[:, 0])
    on_i = np.abs(cross(pairs.u_j, pairs.r)[:, 0]) < pairs.A_i * sine
    return on_i & (np.abs(cross(pairs.u_i, pairs.r)[:, 0]) < pairs.A_j * sine)


def nearest(pairs):
    """Feet on both spines of the shortest distance, and that distance."""
    foot = closest_foot(pairs, *end_feet(pairs))
    return foot.s, foot.t, np.sqrt(foot.exact)


def bond_at(pairs, s, t, distance=None):
    """Energy, force on i and torques of a bond between two feet, of this distance or the one between them."""
    delta = pairs.r + scaled(s, pairs.u_i) - scaled(t, pairs.u_j)
    length = np.sqrt(row_dot(delta, delta))
    overlap = np.maximum(1 - (length if distance is None else distance) / pairs.d, 0)
    force = scaled(overlap / pairs.d / np.maximum(length, np.longdouble(1e-300)), delta)
    torques = cross(scaled(s, pairs.u_i), force), -cross(scaled(t, pairs.u_j), force)
    return overlap**2 / 2, force, *torques


def one_bond(pairs):
    """The contact with one bond; nearly parallel spines have it at the middle of what overlaps."""
    s, t, distance = nearest(pairs)
    across = pairs.u_i - scaled(np.sign(row_dot(pairs.u_i, pairs.u_j)), pairs.u_j)
    across = across - scaled(row_dot(across, pairs.u_j), pairs.u_j)

    def middle(at, own, other):
        low, high = np.maximum(-own, at - other), np.minimum(own, at + other)
        return (low + high) / 2, high > low

    middle_s, opposite = middle(-row_dot(pairs.r, pairs.u_i), pairs.A_i, pairs.A_j)
    middle_t, _ = middle(row_dot(pairs.r, pairs.u_j), pairs.A_j, pairs.A_i)
    flat = (row_dot(across, across) < PARALLEL_SINE**2) & opposite
    return bond_at(pairs, np.where(flat, middle_s, s), np.where(flat, middle_t, t), distance)


# --- over packings -------------------------------------------------------------------------------


def long_axes(packing, quaternion=None):
    """(N, D) unit axes from the poses, or from quaternions as LAMMPS holds them."""
    if quaternion is None and packing.dimension == 2:
        angle = packing.poses()[1]
        return np.column_stack([np.cos(angle), np.sin(angle)])
    q = packing.poses()[1] if quaternion is None else np.asarray(quaternion, np.longdouble)
    w, i, j, k = q.T
    x = np.column_stack([w * w + i * i - j * j - k * k, 2 * (i * j + w * k), 2 * (i * k - w * j)])
    return (x / (q**2).sum(axis=1, keepdims=True))[:, : packing.dimension]


def summed(packing, contact_of, k_e, quaternion):
    """Add up force, torques on both and overlaps (M, bonds) of all pairs and images."""
    particles, shift = every_image(packing)
    x, _, cell = packing.poses()
    u, A, R = long_axes(packing, quaternion), packing.half_length, packing.radius
    i, j = particles.T
    pairs = in_long(Pairs(x[i] - x[j] - shift @ cell.T, u[i], u[j], A[i], A[j], R[i], R[j]))
    force, torque_i, torque_j, overlap = contact_of(pairs)
    total = np.zeros((packing.n, packing.dimension), np.longdouble)
    torque = np.zeros((packing.n, torque_i.shape[1]), np.longdouble)
    for which, pull, turn in ((i, force, torque_i), (j, -force, torque_j)):
        np.add.at(total, which, k_e * pull)
        np.add.at(torque, which, k_e * turn)
    touching = overlap > 0
    largest = k_e * float((overlap / pairs.d[:, None]).max(initial=0))
    return Expected(total, torque, int(touching.sum()), int(touching.any(axis=1).sum()), largest)


def rod_contacts(pairs):
    touching = nearest(pairs)[2] < pairs.d
    assert pairs.dimension == 3 or not (crossing(pairs) & touching).any()
    energy, *pulls = one_bond(pairs)
    return *pulls, np.sqrt(2 * energy)[:, None]


def of_rods(packing, k_e=1.0, quaternion=None):
    return summed(packing, rod_contacts, k_e, quaternion)


def of_dimers(packing, k_e=1.0, quaternion=None):
    return summed(packing, lambda pairs: (*forces(pairs), overlaps(pairs)), k_e, quaternion)
