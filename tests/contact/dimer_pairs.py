"""Pairs of dimers that touch at discs of our choice, and their energy as a plain sum over discs."""

from __future__ import annotations

import itertools

import numpy as np
from pair_packings import PairPacking
from spherocylinder_pairs import Pairs, cross, log_uniform, random_directions, row_dot, scaled

from jamshape import _contact

LONG = np.longdouble


def dimer_packing(rng, pairs):
    """Packing of M pairs, poses in long double, with the second particles in other images."""
    return PairPacking.of(rng, pairs, _contact.Dimers)


def dimer_pairs(rng, n, dimension, overlap=(1e-3, 1 / 3), alpha=(0.05, 10.0)):
    """Random dimers of which one pair of discs has the overlap; others may touch, too."""
    R_i, R_j = log_uniform(rng, 0.3, 3.0, (2, n))
    A_i, A_j = R_i * log_uniform(rng, *alpha, n), R_j * log_uniform(rng, *alpha, n)
    u_i, u_j = random_directions(rng, n, dimension), random_directions(rng, n, dimension)
    distance = (1.0 - log_uniform(rng, *overlap, n)) * (R_i + R_j)
    a, b = rng.choice([-1.0, 1.0], (2, n))
    r = scaled(distance, random_directions(rng, n, dimension))
    return Pairs(r - scaled(a * A_i, u_i) + scaled(b * A_j, u_j), u_i, u_j, A_i, A_j, R_i, R_j)


def discs(pairs):
    """Arms (M, D) from the centres for each two discs, and the vector from that of j to that of i."""
    for a, b in itertools.product((1, -1), (1, -1)):
        arm_i, arm_j = scaled(a * pairs.A_i, pairs.u_i), scaled(b * pairs.A_j, pairs.u_j)
        yield arm_i, arm_j, pairs.r + arm_i - arm_j


def overlaps(pairs):
    """(M, 4) overlaps 1 - r/d, negative for discs that are apart."""
    return np.stack([1 - np.sqrt(row_dot(x, x)) / pairs.d for *_, x in discs(pairs)], axis=1)


def clear_of_edges(pairs, margin=1e-3):
    """Pairs of which no two discs just begin to touch, or nearly coincide."""
    x = overlaps(pairs).astype(float)
    return pairs[(np.abs(x) > margin).all(axis=1) & (x < 0.9).all(axis=1)]


def energy(pairs, k_e=1.0):
    return 0.5 * k_e * (np.maximum(overlaps(pairs), 0) ** 2).sum(axis=1)


def forces(pairs, k_e=1.0):
    """Force on i and the torques on i and j."""
    force, torque_i, torque_j = 0, 0, 0
    for arm_i, arm_j, x in discs(pairs):
        distance = np.sqrt(row_dot(x, x))
        push = k_e * np.maximum(1 - distance / pairs.d, 0) / pairs.d
        f = scaled(push / distance, x)
        force, torque_i, torque_j = (
            force + f,
            torque_i + cross(arm_i, f),
            torque_j - cross(arm_j, f),
        )
    return force, torque_i, torque_j
