"""Checks of contacts that pairs of any shape share."""

import numpy as np
from spherocylinder_pairs import CROSSING, TOUCHING

OVERLAPS = (1e-14, 1e-11, 1e-8, 1e-4, 1 / 3)


def change_in_units(small, large, arms, length, energy):
    """Largest change over the sizes of each pair: energies scale with k_e alone, forces with k_e over the length."""
    if (small["status"] != large["status"]).any():
        return np.inf
    force, worst = np.linalg.norm(small["force"], axis=1), 0.0
    for name, unit, size in (
        ("energy", energy, small["energy"]),
        ("force", energy / length, force),
        ("torque_i", energy, arms * force),
    ):
        value = small[name].reshape(len(size), -1)
        change = np.abs(large[name].reshape(value.shape) / unit - value).max(axis=1)
        worst = max(worst, float((change / size).max()))
    return worst


def unnamed(found, *, must_cross):
    """Fraction of pairs that are neither named as crossing nor, unless they must, have finite forces."""
    right = found["status"] == CROSSING
    if not must_cross:
        finite = np.isfinite(found["force"]).all(axis=1) & (found["status"] == TOUCHING)
        right = right | (finite & (np.linalg.norm(found["force"], axis=1) > 0))
    return float(1 - right.mean())
