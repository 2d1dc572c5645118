"""Derivatives of the pair energy by differences, with the step chosen from the energies alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from spherocylinder_pairs import EPS, FADE_LENGTH, energies, turned

# Steps fall geometrically from the first to the last of step_range.
N_STEPS = 14


@dataclass
class Differences:
    """Columns: the components of r, then the rotations of i, then those of j."""

    gradient: np.ndarray
    left: np.ndarray
    right: np.ndarray


def shortest_length(pairs, sides):
    """Length on which the energy varies: that of the shorter rod, and of its fade with two bonds."""
    shorter = np.minimum(np.where(pairs.A_i > 0.0, pairs.A_i, pairs.d),
                         np.where(pairs.A_j > 0.0, pairs.A_j, pairs.d))  # fmt: skip
    return np.minimum(pairs.d, shorter if sides == 1 else FADE_LENGTH * shorter)


def displacements(pairs):
    """One function (step) -> (moved pairs, step really taken) per coordinate, and its lever arm."""

    def translation(component):
        def move(step):
            r = pairs.r.copy()
            r[:, component] += step
            return pairs.replaced(r=r), r[:, component] - pairs.r[:, component]

        return move

    def rotation(axis, component):
        def move(step):
            return pairs.replaced(**{axis: turned(getattr(pairs, axis), step, component)}), step

        return move

    dimension = pairs.dimension
    rotations = 1 if dimension == 2 else 3
    unity = np.ones(len(pairs))
    moves = [(translation(c), unity) for c in range(dimension)]
    moves += [(rotation("u_i", c), pairs.A_i + pairs.d) for c in range(rotations)]
    moves += [(rotation("u_j", c), pairs.A_j + pairs.d) for c in range(rotations)]
    return moves


def longest_consistent(estimates, noise):
    """Per pair, the estimate of the longest step that no shorter step contradicts.

    Long steps have the least rounding but may straddle a kink or the switch of a clamped foot, or
    miss a short rod altogether; the shorter ones then differ by more than their own noise.
    """
    consistent = np.ones(estimates.shape[1:], dtype=bool)
    best = estimates[-1].copy()
    low, high = estimates[-1] - noise[-1], estimates[-1] + noise[-1]
    for estimate, error in zip(estimates[-2::-1], noise[-2::-1], strict=True):
        consistent &= (estimate >= low) & (estimate <= high)
        best = np.where(consistent, estimate, best)
        low, high = np.maximum(low, estimate - error), np.minimum(high, estimate + error)
    return best


def differentiate(pairs, sides, k_e=1.0):
    at_rest = energies(pairs, sides, k_e)
    length = shortest_length(pairs, sides)
    longest, shortest = 0.02 * pairs.d, np.minimum(3e-7 * pairs.d, 1e-3 * length)
    ratio = (longest / shortest) ** (1.0 / (N_STEPS - 1))
    rounding = EPS * pairs.extent * (np.sqrt(2.0 * k_e * at_rest) / pairs.d + 4.0 * at_rest / length)
    columns = []
    for move, lever in displacements(pairs):
        central, right, left, noise = [], [], [], []
        for level in range(N_STEPS):
            step = longest * ratio**-level / lever
            (forth, ahead), (back, behind) = move(step), move(-step)
            up, down = energies(forth, sides, k_e), energies(back, sides, k_e)
            central.append((up - down) / (ahead - behind))
            right.append((up - at_rest) / ahead)
            left.append((down - at_rest) / behind)
            noise.append(8.0 * rounding / step)
        central, right, left = np.array(central), np.array(right), np.array(left)
        noise = np.array(noise)[1:]
        even = (ratio**2 * central[1:] - central[:-1]) / (ratio**2 - 1.0)
        one_sided = [(ratio * x[1:] - x[:-1]) / (ratio - 1.0) for x in (left, right)]
        columns.append([longest_consistent(x, noise) for x in (even, *one_sided)])
    return Differences(*(np.column_stack(c) for c in zip(*columns, strict=True)))
