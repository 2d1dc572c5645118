"""The pair energies written a second time, in NumPy, from the formula and not from the C++.

With overlaps a of the shortest distance and b of the far end of what lies opposite of the spines (b of
any sign), m = (a + b) / 2, c = u_i.u_j, E(x) = x^A / A, A = 2 unless stated, and S the quintic step:

    sides one   V = E(a)
    sides two   V = (E(a)^(1/w) + E(b)^(1/w))^w where b > 0 and w > 0, E(a) elsewhere
    w = S(q / L) S(2 A_min |c| / L) / (1 + h^2)^(1/2)
    q the harmonic mean of q_i = A_i + A_j |c| - |u_i.r| and q_j, 0 where one of them is negative
    L = A_min ((e^2 + k^2 h^2) / (1 + k^2 h^2))^(1/2),  e = 1/20, k = 4
    h = g^3 / (g^2 + 0.01^2),  g = max(y - 0.01, 0),  y = m / (A_min / d)^2

Every formula is analytic between its branches and branches look at real parts only, so that a step
along the imaginary axis gives derivatives to rounding, without a step size.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from spherocylinder_pairs import (
    FADE_LENGTH,
    SHALLOW,
    growth_of,
    length_of_fade,
    row_dot,
    scaled,
)

LEAST_EXPONENT = 1e-12
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


def least_fade_length(pairs):
    """Fade length of shallow overlaps, the least of all."""
    return FADE_LENGTH * shorter_or(pairs, np.inf)


class Approach:
    """The two ends of the overlap of the spines, and what their energy is made of."""

    def __init__(self, pairs, power=2.0):
        self.pairs, self.power = pairs, power
        self.plus, self.minus = end_feet(pairs)

    @cached_property
    def closest(self):
        """Closest points; of crossing spines in 2D that of a tip, as there is no energy to take."""
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
    def fade_length(self):
        return length_of_fade(shorter_or(self.pairs, 1.0), self.depth)

    @cached_property
    def opposite(self):
        """Harmonic mean of what lies opposite of either spine."""
        pairs = self.pairs
        cosine = absolute(row_dot(pairs.u_i, pairs.u_j))
        of_i = pairs.A_i + pairs.A_j * cosine - absolute(row_dot(pairs.u_i, pairs.r))
        of_j = pairs.A_j + pairs.A_i * cosine - absolute(row_dot(pairs.u_j, pairs.r))
        some = (of_i.real > 0.0) & (of_j.real > 0.0) & (np.minimum(pairs.A_i, pairs.A_j) > 0.0)
        of_i, of_j = np.where(some, of_i, 1.0), np.where(some, of_j, 1.0)
        return np.where(some, 2.0 * of_i * of_j / (of_i + of_j), 0.0)

    @cached_property
    def steps(self):
        """Quantities that the two steps depend on: length and cosine."""
        pairs, length = self.pairs, self.fade_length
        cosine = absolute(row_dot(pairs.u_i, pairs.u_j))
        return self.opposite / length, 2.0 * np.minimum(pairs.A_i, pairs.A_j) * cosine / length

    @cached_property
    def by_steps(self):
        """The least of them: at 0 there is one bond, above 1 nothing fades."""
        return np.min([x.real for x in self.steps], axis=0)

    @cached_property
    def exponent(self):
        """w of the norm."""
        by_length, by_cosine = (smooth_step(x) for x in self.steps)
        return by_length * by_cosine / np.sqrt(1.0 + growth_of(self.depth) ** 2)

    @cached_property
    def has_two(self):
        """Whether both ends are bonds."""
        return (self.far_overlap.real > 0.0) & (self.exponent.real > LEAST_EXPONENT)

    @cached_property
    def log_ratio(self):
        """ln(b / a), of those that have two bonds."""
        a, b = (np.where(self.has_two, x, 1.0) for x in (self.overlap, self.far_overlap))
        drop = self.drop - np.minimum(self.drop.real, 0.0)
        nearly_one = np.where(self.has_two & (drop.real < 0.5 * a.real), drop / a, 0.0)
        return np.where(drop.real < 0.5 * a.real, log_of_1_less(nearly_one), np.log(b / a))

    @cached_property
    def shares(self):
        """(M, 2) of the two bonds: V = share_a E(a) + share_b E(b)."""
        w = np.where(self.has_two, self.exponent, 1.0)
        log_t = self.power / w * self.log_ratio
        first = np.exp((w - 1.0) * np.log(1.0 + np.exp(log_t)))
        second = first * np.exp(log_t - self.power * self.log_ratio)
        return np.where(self.has_two, [first, second], [[1.0], [0.0]]).T

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
    def couplings(self):
        """(M, 2) of the two bonds: root of what the norm's second derivatives have beside the shares."""
        w = np.where(self.has_two, self.exponent, 1.0)
        t = np.exp(2.0 / w * self.log_ratio)
        first, second = self.shares.T
        root = np.sqrt((2.0 / w - 2.0) / (1.0 + t))
        coupling = [root * np.sqrt(t * first), -root * np.sqrt(second)]
        return np.where(self.has_two, coupling, 0.0).T


def log_of_1_less(x):
    """NumPy's own has lost the digits of a small complex x."""
    return np.log1p(-x.real) - (x - x.real) / (1.0 - x.real)


def overlap_of(square, d):
    return (d - np.sqrt(square)) / d


def law(overlap, power=2.0):
    return overlap**power / power


def repulsive_law(overlap, power=2.0):
    touches = overlap.real > 0.0
    return np.where(touches, law(np.where(touches, overlap, 1.0), power), 0.0)


def one_bond_energy(pairs, power=2.0):
    return repulsive_law(Approach(pairs).overlap, power)


def two_bond_energy(pairs, power=2.0):
    x = Approach(pairs, power)
    w = np.where(x.has_two, x.exponent, 1.0)
    t = np.exp(power / w * x.log_ratio)
    return repulsive_law(x.overlap, power) * np.where(x.has_two, np.exp(w * np.log(1.0 + t)), 1.0)


def printed_two_bond_energy(pairs):
    """The rule as printed: both ends of the overlap of the spines counted wherever both overlap."""
    x = Approach(pairs)
    second = np.where(x.apart.real > 0.0, repulsive_law(x.far_overlap), 0.0)
    return repulsive_law(x.overlap) + second


ENERGIES = {1: one_bond_energy, 2: two_bond_energy}


def branches(pairs, sides):
    """Integers (M, ...) that stay the same where the energy is smooth.

    Which of the ends is the nearer one changes nothing where there are two bonds.
    """
    x = Approach(pairs)

    def sliding(foot):
        return [np.sign(y.real) * (np.abs(y.real) >= A)
                for y, A in ((foot.s, pairs.A_i), (foot.t, pairs.A_j))]  # fmt: skip

    inside = (np.abs(x.closest.s.real) < pairs.A_i) & (np.abs(x.closest.t.real) < pairs.A_j)
    columns = [*sliding(x.plus), *sliding(x.minus), np.sign(row_dot(pairs.u_i, pairs.u_j)), inside]
    symmetric = (sides == 2) & x.has_two & ~inside
    columns.append(np.where(symmetric, 0.0, x.plus.exact <= x.minus.exact))
    columns += [np.sign(step) + np.sign(step - 1.0) for step in x.steps]
    columns += [x.depth > SHALLOW, x.overlap > 0.0, x.far_overlap > 0.0]
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
