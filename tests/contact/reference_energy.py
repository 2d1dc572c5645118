"""The pair energies written a second time, in NumPy, from the formula and not from the C++.

With overlaps a of the shortest distance and b of the far end of the overlap of the spines (b of any
sign), m = (a + b) / 2, E(x) = x^2 / 2, S the quintic step and l how much of the spines lies opposite
the other one (`opposite_parts`; its feet slow down over a quarter of the length it is taken over):

    sides one   V = E(a)
    sides two   V = E(a) + D F + W_m (1 - D) (E(m) - E(a))
    F   = W_b E(a) (b / a)^(2 + B (1 / W_b - 1)) for b > 0, which is W_b E(b) where B = 0
    W_b = S(l / (A_min (0.05 + 0.95 B))) S((|cos| - 0.5) / 0.35)
    W_m = S(l / (0.05 A_min)) (1 - S((|sin| / (0.1 A_min / d))^2))
    B   = S(1 - ln y / ln 0.01),  D = 1 - S(ln y / ln 16),  y = m / (A_min / d)^2

Every formula is analytic between its branches and branches look at real parts only, so that a step
along the imaginary axis gives derivatives to rounding, without a step size.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from spherocylinder_pairs import (
    DEEP_SINE,
    FADE_CORNER,
    FADE_COSINE_RANGE,
    FADE_COSINE_START,
    FADE_DEPTH,
    FADE_LENGTH,
    SHALLOW,
    cross,
    row_dot,
    scaled,
)

LEAST_WEIGHT = 1e-12
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


def closest_foot(pairs, plus, minus):
    best = nearer_of(plus, minus)
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


def shorter_or(pairs, of_discs):
    """A_min, or a number to put in its place where there are no two ends: A_min = 0."""
    shorter = np.minimum(pairs.A_i, pairs.A_j)
    return np.where(shorter > 0.0, shorter, of_discs)


def fade_length(pairs):
    """Spine overlap over which the second bond fades in."""
    return Approach(pairs).fade_length.real


def mean_fade_length(pairs):
    """Spine overlap over which the mean of the two bonds fades in, at most that of the second."""
    return FADE_LENGTH * shorter_or(pairs, np.inf)


def softly_limited(x, bound, length):
    """x that slows down over a length before the bounds, and ends half of it inside them."""
    outside = np.abs(x.real) > bound
    inside = np.where(outside, bound, absolute(x))
    into = inside - bound + length
    y = np.where(into.real > 0.0, into, 0.0) / length
    return np.where(x.real < 0.0, -1.0, 1.0) * (inside - length * (y**3 - 0.5 * y**4))


def feet_of_tips(pairs):
    """On the line of the other spine, with half of the tip's sign and that spine's half length."""
    sign = np.where(row_dot(pairs.u_i, pairs.u_j).real < 0.0, -0.5, 0.5)
    for e in (1.0, -1.0):
        tip_i, tip_j = scaled(e * pairs.A_i, pairs.u_i), scaled(e * pairs.A_j, pairs.u_j)
        yield e * sign, row_dot(pairs.u_i, tip_j - pairs.r), pairs.A_i
        yield e * sign, row_dot(pairs.u_j, pairs.r + tip_i), pairs.A_j


def opposite_parts(pairs, length):
    """Of either spine what lies between the feet of the other's tips, the mean over both.

    Feet slow down over a length before they stop at a tip.
    """
    total = 0.0
    for sign, foot_at, bound in feet_of_tips(pairs):
        total = total + sign * softly_limited(foot_at, bound, length)
    return np.where(np.minimum(pairs.A_i, pairs.A_j) > 0.0, total, 0.0)


def sine_range(pairs):
    """|sin| of the angle over which the mean of the two bonds fades out."""
    return DEEP_SINE * shorter_or(pairs, np.inf) / pairs.d


class Approach:
    """The two ends of the overlap of the spines, and what their energy is made of."""

    def __init__(self, pairs):
        self.pairs = pairs
        self.plus, self.minus = end_feet(pairs)

    @cached_property
    def closest(self):
        """Of crossing spines in 2D that of a tip, as there is no energy to take."""
        return closest_foot(self.pairs, self.plus, self.minus)

    @cached_property
    def far_end(self):
        nearer = self.plus.exact <= self.minus.exact
        return Foot(*(np.where(nearer, y, x) for x, y in zip(self.plus, self.minus, strict=True)))

    @cached_property
    def apart(self):
        """Distance between the two ends, the mean over both spines."""
        plus, minus = self.plus, self.minus
        return 0.5 * (absolute(plus.s - minus.s) + absolute(plus.t - minus.t))

    @cached_property
    def wide(self):
        """B, how far the second bond fades in over all of A_min instead of a small part."""
        y = np.where(self.depth.real > SHALLOW, self.depth, SHALLOW)
        return smooth_step(1.0 - np.log(y) / np.log(SHALLOW))

    @cached_property
    def fade_length(self):
        return shorter_or(self.pairs, 1.0) * (FADE_LENGTH + (1.0 - FADE_LENGTH) * self.wide)

    @cached_property
    def by_length(self):
        """What the step of the second bond's weight is taken of."""
        return opposite_parts(self.pairs, FADE_CORNER * self.fade_length) / self.fade_length

    @cached_property
    def mean_by_length(self):
        """What that of the mean bond's weight is."""
        length = FADE_LENGTH * shorter_or(self.pairs, 1.0)
        return opposite_parts(self.pairs, FADE_CORNER * length) / length

    @cached_property
    def by_cosine(self):
        cosine = absolute(row_dot(self.pairs.u_i, self.pairs.u_j))
        return (cosine - FADE_COSINE_START) / FADE_COSINE_RANGE

    @cached_property
    def by_sine(self):
        turn = cross(self.pairs.u_i, self.pairs.u_j)
        return row_dot(turn, turn) / sine_range(self.pairs) ** 2

    @cached_property
    def second_weight(self):
        return smooth_step(self.by_length) * smooth_step(self.by_cosine)

    @cached_property
    def mean_weight(self):
        return smooth_step(self.mean_by_length) * (1.0 - smooth_step(self.by_sine))

    @cached_property
    def overlap(self):
        """a of the shortest distance."""
        return overlap_of(self.closest.square, self.pairs.d)

    @cached_property
    def far_overlap(self):
        """b of the far end; negative where that is out of reach."""
        return overlap_of(self.far_end.square, self.pairs.d)

    @cached_property
    def drop(self):
        """a - b through the difference of the squares: of nearly round rods a rounds by more."""
        near, far, pairs = self.closest, self.far_end, self.pairs
        apart = scaled(far.s - near.s, pairs.u_i) - scaled(far.t - near.t, pairs.u_j)
        s, t = 0.5 * (far.s + near.s), 0.5 * (far.t + near.t)
        middle = pairs.r + scaled(s, pairs.u_i) - scaled(t, pairs.u_j)
        distances = np.sqrt(far.square) + np.sqrt(near.square)
        return 2.0 * row_dot(apart, middle) / (distances * pairs.d)

    @cached_property
    def depth(self):
        """y, the mean overlap over (A_min / d)^2; 0 for discs, which have no second bond."""
        mean = 0.5 * (self.overlap + self.far_overlap)
        return mean / (shorter_or(self.pairs, np.inf) / self.pairs.d) ** 2

    @cached_property
    def second_energy(self):
        """F = W E(a) (b / a)^(2 + B (1 / W - 1))."""
        a, b, W = self.overlap, self.far_overlap, self.second_weight
        has = (b.real > 0.0) & (W.real > LEAST_WEIGHT)
        a, b, W = np.where(has, a, 1.0), np.where(has, b, 1.0), np.where(has, W, 1.0)
        ratio = b / a
        nearly_one = np.where(has & (ratio.real > 0.5), self.drop / a, 0.0)
        log_ratio = np.where(ratio.real > 0.5, log_of_1_less(nearly_one), np.log(ratio))
        return np.where(has, W * law(b) * np.exp(self.wide * (1.0 / W - 1.0) * log_ratio), 0.0)

    @cached_property
    def two_bonds(self):
        """D, how much of the two bonds is left."""
        y = np.where(self.depth.real > 1.0, self.depth, 1.0)
        return 1.0 - smooth_step(np.log(y) / np.log(FADE_DEPTH))


def log_of_1_less(x):
    """NumPy's own has lost the digits of a small complex x."""
    return np.log1p(-x.real) - (x - x.real) / (1.0 - x.real)


def overlap_of(square, d):
    return (d - np.sqrt(square)) / d


def law(overlap):
    return 0.5 * overlap**2


def repulsive_law(overlap):
    return np.where(overlap.real > 0.0, law(overlap), 0.0)


def one_bond_energy(pairs):
    return repulsive_law(Approach(pairs).overlap)


def two_bond_energy(pairs):
    x = Approach(pairs)
    a, D = x.overlap, x.two_bonds
    excess = -0.5 * x.drop * (a - 0.25 * x.drop)  # E(m) - E(a)
    return repulsive_law(a) + D * x.second_energy + x.mean_weight * (1.0 - D) * excess


def printed_two_bond_energy(pairs):
    """The rule as printed: both ends of the overlap of the spines counted wherever both overlap."""
    x = Approach(pairs)
    second = np.where(x.apart.real > 0.0, repulsive_law(x.far_overlap), 0.0)
    return repulsive_law(x.overlap) + second


ENERGIES = {1: one_bond_energy, 2: two_bond_energy}


def branches(pairs, sides):
    """Integers (M, ...) that stay the same where the energy is smooth.

    Where two whole bonds change places nothing happens, so the nearer end is left out there.
    """
    x = Approach(pairs)

    def sliding(foot):
        return [np.sign(y.real) * (np.abs(y.real) >= A)
                for y, A in ((foot.s, pairs.A_i), (foot.t, pairs.A_j))]  # fmt: skip

    shares = x.second_weight * x.two_bonds + x.mean_weight * (1.0 - x.two_bonds)
    whole = (sides == 2) & (shares > 1.0 - 1e-10)
    inside = (np.abs(x.closest.s.real) < pairs.A_i) & (np.abs(x.closest.t.real) < pairs.A_j)
    columns = [*sliding(x.plus), *sliding(x.minus), np.sign(row_dot(pairs.u_i, pairs.u_j)), inside]
    columns.append(np.where(whole, 0.0, x.plus.exact <= x.minus.exact))
    by_depth = np.log(np.maximum(x.depth, 0.1)) / np.log(FADE_DEPTH)
    steps = (x.by_length, x.mean_by_length, x.by_cosine, by_depth)
    columns += [np.sign(step) + np.sign(step - 1.0) for step in steps]
    for length in (x.fade_length, FADE_LENGTH * shorter_or(pairs, 1.0)):
        for _, foot_at, bound in feet_of_tips(pairs):
            into = (np.abs(foot_at) - bound) / (FADE_CORNER * length)
            columns.append(np.sign(foot_at) * (np.sign(into) + np.sign(into + 1.0)))
    columns += [x.depth > SHALLOW, x.by_sine > 1.0, x.overlap > 0.0, x.far_overlap > 0.0]
    return np.column_stack(columns).astype(int)


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
