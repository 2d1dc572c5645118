"""The pair energies written a second time, in NumPy, from PHYSICS and not from the C++.

Every formula is analytic between its branches and branches look at real parts only, so that a step
along the imaginary axis gives derivatives to rounding, without a step size.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from spherocylinder_pairs import (
    FADE_COSINE_RANGE,
    FADE_COSINE_START,
    FADE_DEPTH,
    FADE_LENGTH,
    row_dot,
    scaled,
)

IMAGINARY_STEP = 1e-30


class Foot(NamedTuple):
    """s on the spine of i, t on that of j, and the squared distance between the two points.

    `exact` is its value in more digits: of feet closer together than 1e-8 d, doubles cannot tell
    which are the closest.
    """

    s: np.ndarray
    t: np.ndarray
    square: np.ndarray
    exact: np.ndarray


def clamp(x, bound):
    return np.where(x.real < -bound, -bound, np.where(x.real > bound, bound, x))


def absolute(x):
    return np.where(x.real < 0.0, -x, x)


def nearer_of(a, b):
    first = a.exact <= b.exact
    return Foot(*(np.where(first, x, y) for x, y in zip(a, b, strict=True)))


def foot(pairs, s, t):
    delta = pairs.r + scaled(s, pairs.u_i) - scaled(t, pairs.u_j)
    r, u_i, u_j, s_, t_ = (
        x.real.astype(np.longdouble) for x in (pairs.r, pairs.u_i, pairs.u_j, s, t)
    )
    exact = ((r + scaled(s_, u_i) - scaled(t_, u_j)) ** 2).sum(axis=1)
    return Foot(s, t, row_dot(delta, delta), exact)


def from_tip_of_i(pairs, s):
    t = clamp(row_dot(pairs.u_j, pairs.r + scaled(s, pairs.u_i)), pairs.A_j)
    return foot(pairs, s + 0.0 * t, t)


def from_tip_of_j(pairs, t):
    s = clamp(row_dot(pairs.u_i, scaled(t, pairs.u_j) - pairs.r), pairs.A_i)
    return foot(pairs, s, t + 0.0 * s)


def end_feet(pairs):
    sign = np.where(row_dot(pairs.u_i, pairs.u_j).real < 0.0, -1.0, 1.0)
    return [
        nearer_of(from_tip_of_i(pairs, e * pairs.A_i), from_tip_of_j(pairs, e * sign * pairs.A_j))
        for e in (1.0, -1.0)
    ]


def closest_foot(pairs):
    """Shortest distance; of crossing spines in 2D that of a tip, as there is no energy to take."""
    best = nearer_of(*end_feet(pairs))
    if pairs.dimension == 2:
        return best
    # u_i less its part along u_j, through the difference of nearly parallel axes; |across| is |sin|.
    sign = np.where(row_dot(pairs.u_i, pairs.u_j).real < 0.0, -1.0, 1.0)
    difference = pairs.u_i - scaled(sign, pairs.u_j)
    across = difference - scaled(row_dot(difference, pairs.u_j), pairs.u_j)
    sine_square = row_dot(across, across)
    skewed = sine_square.real > 0.0
    s = -row_dot(pairs.r, across) / np.where(skewed, sine_square, 1.0)
    t = row_dot(pairs.u_j, pairs.r + scaled(s, pairs.u_i))
    inside = skewed & (np.abs(s.real) < pairs.A_i) & (np.abs(t.real) < pairs.A_j)
    passing = foot(pairs, s, t)
    return Foot(*(np.where(inside, x, y) for x, y in zip(passing, best, strict=True)))


def smooth_step(x):
    x = np.where(x.real < 0.0, 0.0, np.where(x.real > 1.0, 1.0, x))
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def spread(pairs):
    """Distance between the two bonds along the spines, the mean over both."""
    plus, minus = end_feet(pairs)
    return 0.5 * (absolute(plus.s - minus.s) + absolute(plus.t - minus.t))


def fade_length(pairs):
    """Spine overlap over which the second bond fades in; none for discs, which have no second."""
    shorter = np.minimum(pairs.A_i, pairs.A_j)
    return np.where(shorter > 0.0, FADE_LENGTH * shorter, np.inf)


def fade_arguments(pairs):
    """What the two quintic steps of the second bond's weight are taken of."""
    by_length = spread(pairs) / fade_length(pairs)
    cosine = absolute(row_dot(pairs.u_i, pairs.u_j))
    return by_length, (cosine - FADE_COSINE_START) / FADE_COSINE_RANGE


def fade_depth(pairs):
    """Overlap of the second bond over A^2 / d, at least 1: there it begins to fade out."""
    shorter = np.minimum(pairs.A_i, pairs.A_j)
    overlap = pairs.d - np.sqrt(far_square(pairs))
    depth = overlap * pairs.d / np.where(shorter > 0.0, shorter, np.inf) ** 2
    return np.where(depth.real > 1.0, depth, 1.0)


def weight(pairs):
    by_length, by_cosine = fade_arguments(pairs)
    by_depth = 1.0 - smooth_step(np.log(fade_depth(pairs)) / np.log(FADE_DEPTH))
    return smooth_step(by_length) * smooth_step(by_cosine) * by_depth


def bond_energy(square, d):
    overlap = (d - np.sqrt(square)) / d
    return np.where(overlap.real > 0.0, 0.5 * overlap**2, 0.0)


def far_square(pairs):
    plus, minus = end_feet(pairs)
    return np.where(plus.exact <= minus.exact, minus.square, plus.square)


def one_bond_energy(pairs):
    return bond_energy(closest_foot(pairs).square, pairs.d)


def two_bond_energy(pairs):
    return one_bond_energy(pairs) + weight(pairs) * bond_energy(far_square(pairs), pairs.d)


def printed_two_bond_energy(pairs):
    """The rule as printed: both ends of the overlap of the spines counted wherever both overlap."""
    second = np.where(spread(pairs).real > 0.0, bond_energy(far_square(pairs), pairs.d), 0.0)
    return one_bond_energy(pairs) + second


ENERGIES = {1: one_bond_energy, 2: two_bond_energy}


def complex_step_gradient(pairs, energy):
    """Derivatives by r, by rotations of i and by rotations of j, one array each."""
    n, dimension = pairs.r.shape
    rotation_axes = np.eye(3) if dimension == 3 else [None]

    def rate(u, axis):
        if axis is None:
            return np.column_stack([-u[:, 1], u[:, 0]])
        return np.cross(np.broadcast_to(axis, u.shape), u)

    def derivative(name, direction):
        stepped = {name: getattr(pairs, name) + 1j * IMAGINARY_STEP * direction}
        return energy(pairs.replaced(**stepped)).imag / IMAGINARY_STEP

    by_r = [derivative("r", np.broadcast_to(e, (n, dimension))) for e in np.eye(dimension)]
    by_i = [derivative("u_i", rate(pairs.u_i, axis)) for axis in rotation_axes]
    by_j = [derivative("u_j", rate(pairs.u_j, axis)) for axis in rotation_axes]
    return np.column_stack(by_r), np.column_stack(by_i), np.column_stack(by_j)
