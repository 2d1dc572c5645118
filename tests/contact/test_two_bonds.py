"""The energy of two bonds has no jumps, and where they sit."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import pytest
from reference_energy import (
    Approach,
    one_bond_energy,
    printed_two_bond_energy,
    repulsive_law,
    smooth_step,
)
from spherocylinder_pairs import (
    EPS,
    SHALLOW,
    SIDE_TO_SIDE,
    SMALL_SINE,
    TIP_TO_SIDE,
    TOUCHING,
    Pairs,
    contacts,
    cross,
    growth_of,
    least_whole,
    log_uniform,
    overlaps,
    parallel,
    placed,
    random_directions,
    random_perpendicular,
    random_shapes,
    row_dot,
    scaled,
)
from thinned import in_turn

# --- smooth paths through contact --------------------------------------------------------------

N_PATHS = 100
GRID = np.linspace(0.0, 1.0, 801)
WORST_INTERVALS = 24
HALVINGS = 36  # leaves a path step of 1.8e-14 of a path that moves rods by their own size
DEEPEST = 0.5  # overlaps beyond are on their way to spines that cross


@dataclass
class Wave:
    """middle + amplitude sin(2 pi (frequency path + phase)), one of each a path."""

    middle: np.ndarray
    amplitude: np.ndarray
    frequency: np.ndarray
    phase: np.ndarray

    @classmethod
    def random(cls, rng, middle, amplitude):
        n = len(middle)
        return cls(middle, amplitude, rng.uniform(0.3, 1.5, n), rng.uniform(0.0, 1.0, n))

    def at(self, which, path):
        middle, amplitude, frequency, phase = (getattr(self, f.name)[which] for f in fields(self))
        return middle + amplitude * np.sin(2.0 * np.pi * (frequency * path + phase))


class Paths:
    """Relative poses held together at two anchors that slide over the spines, ends included.

    The anchors stay within reach, so that the rods touch all along; they tilt and, in 3D, twist about
    parallel (or about some other angle), roll about each other, and sink in by up to 0.3.
    """

    def __init__(self, rng, shapes, dimension):
        self.A_i, self.A_j, self.R_i, self.R_j = shapes
        n, d = len(self.A_i), self.R_i + self.R_j
        self.dimension = dimension
        self.s = Wave.random(rng, np.zeros(n), self.A_i * rng.uniform(0.5, 1.0, n))
        self.t = Wave.random(rng, np.zeros(n), self.A_j * rng.uniform(0.5, 1.0, n))
        self.overlap = Wave.random(rng, np.full(n, 0.15), rng.uniform(0.0, 0.15, n))
        self.elevation = Wave.random(rng, np.full(n, 0.5 * np.pi), rng.uniform(0.0, 1.2, n))
        flat = np.minimum(1.0, d / (self.A_i + self.A_j)) * log_uniform(rng, 1e-3, 1.5, n)
        middle = np.where(rng.uniform(size=n) < 0.7, 0.0, rng.uniform(-np.pi, np.pi, n))
        self.tilt = Wave.random(rng, middle, np.minimum(flat, 1.5))
        self.twist = Wave.random(rng, np.zeros(n), np.minimum(flat, 1.5)[::-1])
        self.roll = Wave.random(rng, np.zeros(n), rng.uniform(0.0, 1.0, n))

    def overlap_at(self, which, path):
        return self.overlap.at(which, path)

    def pairs(self, which, path):
        tilt, elevation = self.tilt.at(which, path), self.elevation.at(which, path)
        u_i = np.column_stack([np.cos(tilt), np.sin(tilt)])
        normal = np.column_stack([np.cos(elevation), np.sin(elevation)])
        u_j = np.zeros_like(u_i)
        u_j[:, 0] = 1.0
        if self.dimension == 3:
            twist, roll = self.twist.at(which, path), self.roll.at(which, path)
            u_i = np.column_stack([u_i[:, 0] * np.cos(twist), u_i[:, 1], u_i[:, 0] * np.sin(twist)])
            normal = np.column_stack(
                [normal[:, 0], normal[:, 1] * np.cos(roll), normal[:, 1] * np.sin(roll)]
            )
            u_j = np.column_stack([u_j, np.zeros(len(u_j))])
        A_i, A_j, R_i, R_j = (x[which] for x in (self.A_i, self.A_j, self.R_i, self.R_j))
        r = (
            scaled((1.0 - self.overlap_at(which, path)) * (R_i + R_j), normal)
            - scaled(self.s.at(which, path), u_i)
            + scaled(self.t.at(which, path), u_j)
        )
        return Pairs(r, u_i, u_j, A_i, A_j, R_i, R_j)


def equal(rng, n):
    A, R = log_uniform(rng, 0.2, 20.0, n), np.ones(n)
    return A, A, R, R


def unequal(rng, n):
    A, R = log_uniform(rng, 0.2, 20.0, n), np.ones(n)
    return A, 1.4 * A * rng.uniform(0.7, 1.3, n), R, 1.4 * R


def nearly_round(rng, n):
    alpha = log_uniform(rng, 3e-3, 0.5, n)
    return alpha, 1.4 * alpha, np.ones(n), np.full(n, 1.4)


def very_unequal(rng, n):
    A_i, A_j, R_i, R_j = random_shapes(rng, n, alpha=(0.05, 20.0))
    return A_i, A_j, R_i, R_j


def library(sides):
    def energy(pairs):
        result = contacts(pairs, sides)
        shallow = (result["status"] == TOUCHING) & (result["energy"] < 2.0 * 0.5 * DEEPEST**2)
        closest = np.where(shallow, result["bond_distance"][:, 0], 0.0)
        return result["energy"], shallow & (closest > (1.0 - DEEPEST) * pairs.d)

    return energy


def as_printed(pairs):
    _, shallow = library(1)(pairs)
    return printed_two_bond_energy(pairs), shallow


def forces_of_two_bonds(pairs):
    """Force and torques over the force of one bond, lengths in half lengths of the rods."""
    result, one = contacts(pairs, 2), contacts(pairs, 1)
    _, shallow = library(2)(pairs)
    unit = np.where(shallow, np.linalg.norm(one["force"], axis=1), 1.0)
    torque_i, torque_j = (
        scaled(1.0 / length, result[name])
        for name, length in (
            ("torque_i", pairs.A_i + pairs.R_i),
            ("torque_j", pairs.A_j + pairs.R_j),
        )
    )
    every = np.column_stack([result["force"], torque_i, torque_j])
    return scaled(1.0 / unit, every), shallow


def largest_jump(paths, function):
    """Largest step of a function left in each path when its worst intervals are halved many times.

    Each halving keeps the half with the larger step: what is smooth shrinks with the interval, a
    jump stays. Also returns which points of the grid count.
    """

    def size(steps):
        return np.linalg.norm(steps, axis=-1)

    def at(which, path):
        values, valid = function(paths.pairs(which, path))
        return values.reshape(len(which), -1), valid

    n = len(paths.A_i)
    which = np.repeat(np.arange(n), len(GRID))
    values, valid = at(which, np.tile(GRID, n))
    values, valid = values.reshape(n, len(GRID), -1), valid.reshape(n, -1)
    steps = np.diff(values, axis=1)
    usable = valid[:, 1:] & valid[:, :-1]
    bend = np.pad(size(2.0 * steps[:, 1:-1] - steps[:, :-2] - steps[:, 2:]), ((0, 0), (1, 1)))
    half = WORST_INTERVALS // 2
    chosen = np.hstack([
        np.argsort(np.where(usable, -size(steps), 0.0), axis=1)[:, :half],
        np.argsort(np.where(usable, -bend, 0.0), axis=1)[:, :half],
    ])  # fmt: skip
    row = np.repeat(np.arange(n), WORST_INTERVALS)
    chosen = chosen.ravel()
    kept = usable[row, chosen]
    row, chosen = row[kept], chosen[kept]
    low, high = GRID[chosen], GRID[chosen + 1]
    at_low, at_high = values[row, chosen], values[row, chosen + 1]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        at_middle, fine = at(row, middle)
        right = size(at_high - at_middle) > size(at_middle - at_low)
        low, at_low = np.where(right, middle, low), np.where(right[:, None], at_middle, at_low)
        high, at_high = np.where(right, high, middle), np.where(right[:, None], at_high, at_middle)
        # ran into spines that cross: no step to speak of
        at_low = np.where(fine[:, None], at_low, at_high)
    left = np.zeros(n)
    np.maximum.at(left, row, size(at_high - at_low))
    return left, valid


SHAPES = [equal, unequal, nearly_round, very_unequal]


def paths_of(shapes, dimension, n=N_PATHS):
    rng = np.random.default_rng([31, dimension, SHAPES.index(shapes)])
    return Paths(rng, shapes(rng, n), dimension)


@pytest.mark.parametrize(
    ("shapes", "bonds"),
    [
        *in_turn(SHAPES, [(2, 2), (3, 2)]),
        *in_turn(SHAPES, [(3, 1), (2, 1)], kept={equal, unequal}),
    ],
)
def test_energy_has_no_jumps(shapes, bonds, measured):
    dimension, sides = bonds
    paths = paths_of(shapes, dimension)
    jumps, valid = largest_jump(paths, library(sides))
    measured(largest_jump=jumps.max(), scanned=valid.mean())
    assert valid.mean() > 0.5
    assert jumps.max() < 1e-9


@pytest.mark.parametrize("shapes", SHAPES, ids=lambda shapes: shapes.__name__)
def test_kinks_of_two_bonds_in_the_plane_are_small(shapes, measured):
    """At these the far end passes from a tip to the other's; a weighted second bond has 0.13."""
    kinks, _ = largest_jump(paths_of(shapes, 2), forces_of_two_bonds)
    measured(largest=kinks.max(), of_90_in_100=np.quantile(kinks, 0.9))
    assert kinks.max() < 0.06
    assert np.quantile(kinks, 0.9) < 0.03


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("shapes", SHAPES, ids=lambda shapes: shapes.__name__)
def test_the_same_scan_sees_the_printed_rule_jump(shapes, dimension, measured):
    jumps, _ = largest_jump(paths_of(shapes, dimension, 60), as_printed)
    measured(largest_jump=jumps.max(), paths_that_jump=np.mean(jumps > 1e-4))
    assert jumps.max() > 1e-2
    assert np.mean(jumps > 1e-4) > 0.1


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_same_scan_sees_a_spread_on_one_spine_jump(dimension, measured):
    """Were l the distance of the feet on spine i alone: it changes with the nearer tip of an end."""

    def one_spine_energy(pairs):
        x = Approach(pairs)
        fade = smooth_step(np.abs(x.plus.s - x.minus.s) / x.fade_length)
        second = fade * smooth_step(x.steps[1])
        _, shallow = library(1)(pairs)
        return one_bond_energy(pairs) + second * repulsive_law(x.far_overlap), shallow

    jumps, _ = largest_jump(paths_of(nearly_round, dimension, 60), one_spine_energy)
    measured(largest_jump=jumps.max(), paths_that_jump=np.mean(jumps > 1e-4))
    assert jumps.max() > 1e-3


def exponents_on(paths):
    """At all points of the grid, 0 without a second bond."""
    which = np.repeat(np.arange(len(paths.A_i)), len(GRID))
    x = Approach(paths.pairs(which, np.tile(GRID, len(paths.A_i))))
    return np.where(x.has_two, x.exponent, 0.0), x


@pytest.mark.parametrize(("shapes", "dimension"), in_turn(SHAPES, [2, 3]))
def test_the_scan_visits_whole_fading_and_absent_second_bonds(shapes, dimension):
    w, _ = exponents_on(paths_of(shapes, dimension))
    visited = [(w > 0.001) & (w < 0.999), w == 0.0]
    # Nearly round rods overlap by more than A^2 / d here; `RoundPaths` have whole bonds.
    if shapes is not nearly_round:
        visited.append(w > 0.999)
    for exponents in visited:
        assert exponents.mean() > 0.01


# --- nearly round rods ------------------------------------------------------------------------


class RoundPaths(Paths):
    """alpha of 1e-6 to 0.01, side by side at the sines and overlaps where two bonds become one.

    The overlap of the anchors moves by decades between 1e-8 and 0.1, in many paths through 0.01 to 10
    times (A_min / d)^2.
    """

    def __init__(self, rng, n, dimension, *, aligned):
        self.dimension = dimension
        self.R_i, self.R_j = np.ones(n), rng.uniform(1.0, 1.4, n)
        d = self.R_i + self.R_j
        middle = log_uniform(rng, 1e-8, 0.1, n)
        room = np.log(np.minimum(middle / 1e-8, 0.1 / middle))
        self.log_overlap = Wave.random(rng, np.log(middle), room * rng.uniform(0.3, 1.0, n))
        least, most = 1e-6 * self.R_j, 0.01 * self.R_i
        shorter = np.clip(d * np.sqrt(middle / log_uniform(rng, 1e-4, 300.0, n)), least, most)
        longer = np.minimum(shorter * rng.uniform(1.0, 3.0, n), most)
        self.A_i, self.A_j = (longer, longer) if aligned else (shorter, longer)
        sine = SMALL_SINE * shorter / d
        self.tilt = Wave.random(rng, np.zeros(n), sine * log_uniform(rng, 0.1, 10.0, n))
        self.twist = Wave.random(rng, np.zeros(n), sine * log_uniform(rng, 0.1, 10.0, n))
        self.roll = Wave.random(rng, np.zeros(n), rng.uniform(0.0, 1.0, n))
        self.s = Wave.random(rng, np.zeros(n), self.A_i * rng.uniform(0.0, 1.0, n))
        if aligned:  # at no tilt, tip by tip
            self.t, past = self.s, np.zeros(n)
        else:
            self.t = Wave.random(rng, np.zeros(n), self.A_j * rng.uniform(0.0, 1.0, n))
            past = (self.A_i + self.A_j) / d * rng.uniform(0.0, 1.0, n)
        self.elevation = Wave.random(rng, np.full(n, 0.5 * np.pi), past)

    def overlap_at(self, which, path):
        return np.exp(self.log_overlap.at(which, path))


def over_one_bond(pairs):
    energy, shallow = library(2)(pairs)
    one, _ = library(1)(pairs)
    return energy / np.where(one > 0.0, one, 1.0), shallow & (one > 0.0)


def round_paths(dimension, aligned):
    rng = np.random.default_rng([33, dimension, aligned])
    return RoundPaths(rng, 120, dimension, aligned=aligned)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("aligned", [False, True])
def test_energy_of_nearly_round_rods_has_no_jumps_in_units_of_one_bond(
    dimension, aligned, measured
):
    paths = round_paths(dimension, aligned)
    jumps, valid = largest_jump(paths, over_one_bond)
    assert valid.mean() > 0.9
    rounding = EPS / np.exp(paths.log_overlap.middle - paths.log_overlap.amplitude)
    in_roundings = np.max(jumps / rounding)
    measured(largest_jump=jumps.max(), in_roundings=in_roundings, scanned=valid.mean())
    assert np.all(jumps < 1e-9 + 16.0 * rounding)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("aligned", [False, True])
def test_the_scan_of_nearly_round_rods_visits_two_bonds_one_bond_and_what_is_between(
    dimension, aligned
):
    w, x = exponents_on(round_paths(dimension, aligned))
    for exponents in (w > 0.999, (w > 0.1) & (w < 0.9), w < 0.1):
        assert exponents.mean() > 0.01
    between = x.has_two & (x.depth > 0.1) & (x.depth < 10.0)
    assert np.mean(between & (x.by_steps > 1.0)) > 0.01
    fading = between & (x.by_steps > 0.0) & (x.by_steps < 1.0)
    assert np.mean(fading) > 0.001 or aligned
    assert x.overlap[x.overlap > 0.0].min() < 1e-7
    assert x.overlap.max() > 0.05


# --- two bonds that become one ----------------------------------------------------------------


def side_by_side(rng, n, dimension, overlap, depth):
    """Exactly parallel rods whose mean overlap is `depth` times (A_min / d)^2, weights of 1."""
    _, _, R_i, R_j = random_shapes(rng, n)
    shorter = (R_i + R_j) * np.sqrt(overlap / depth)
    longer = shorter * log_uniform(rng, 1.0, 10.0, n)
    i_is_shorter = rng.uniform(size=n) < 0.5
    A_i, A_j = np.where(i_is_shorter, [shorter, longer], [longer, shorter])
    u_j = random_directions(rng, n, dimension)
    normal = random_perpendicular(rng, u_j)
    past = (A_i + A_j - 1.01 * least_whole(shorter, depth)) * rng.uniform(-1.0, 1.0, n)
    u_i = scaled(rng.choice([-1.0, 1.0], n), u_j)
    zero = np.zeros(n)
    pairs = placed((A_i, A_j, R_i, R_j), u_i, u_j, zero, zero, normal, overlap)
    return pairs.replaced(r=pairs.r + scaled(past, u_j)), normal


@pytest.mark.parametrize("dimension", [2, 3])
def test_parallel_rods_have_two_bonds_when_shallow_and_one_when_deep(dimension, measured):
    """2^w E, w = 1 up to 0.01 times (A_min / d)^2, and one over the depth far above."""
    rng = np.random.default_rng([34, dimension])
    n = 10_000
    depth, overlap = log_uniform(rng, 1e-3, 1e4, n), overlaps(rng, n, 1e-6)
    pairs, _ = side_by_side(rng, n, dimension, overlap, depth)
    result = contacts(pairs, 2)
    ratio = result["energy"] / contacts(pairs, 1)["energy"]
    rounding = 4.0 * EPS * pairs.extent / (pairs.d * overlap)
    expected = 2.0 ** (1.0 / np.sqrt(1.0 + growth_of(depth) ** 2))
    error = np.abs(ratio / expected - 1.0) / rounding
    shallow, deep = depth < 0.999 * SHALLOW, depth > 1e3
    measured(in_roundings=error.max(), deepest=ratio[deep].max())
    assert np.all(error < 1.0)
    assert np.all(expected[shallow] == 2.0)
    assert np.all(expected[deep] < 1.001)
    assert min(shallow.sum(), deep.sum()) > 1000
    assert np.all(result["kind"] == SIDE_TO_SIDE)
    assert np.all(result["n_bonds"] == 2)


@pytest.mark.parametrize("dimension", [2, 3])
def test_energy_of_parallel_rods_grows_on_approach_and_never_pulls(dimension, measured):
    """From 0.1 to 100 times (A_min / d)^2, at whole and at fading overlap of the spines."""
    rng = np.random.default_rng([35, dimension])
    n, steps = 400, 400
    deepest = overlaps(rng, n, 1e-4)
    start, normal = side_by_side(rng, n, dimension, deepest, np.full(n, 100.0))
    slid = row_dot(start.r, start.u_j)
    whole = start.A_i + start.A_j
    fade = least_whole(np.minimum(start.A_i, start.A_j), np.full(n, 100.0))
    lengths = fade * rng.uniform(0.1, 1.2, n)
    fading = np.arange(n) % 2 == 0
    slide = np.where(fading, np.sign(slid) * (whole - lengths) - slid, 0.0)
    start = start.replaced(r=start.r + scaled(slide, start.u_j))

    before = np.zeros(n)
    least_push, least_rise = np.inf, np.inf
    for depth in np.geomspace(0.1, 100.0, steps):
        overlap = deepest * depth / 100.0
        pairs = start.replaced(r=start.r + scaled((deepest - overlap) * start.d, normal))
        result = contacts(pairs, 2)
        least_push = min(least_push, np.min(row_dot(result["force"], normal) * pairs.d / overlap))
        least_rise = min(least_rise, np.min(result["energy"] / np.maximum(before, 1e-300)))
        before = result["energy"]
    measured(least_push_over_one_bond=least_push, least_rise=least_rise)
    # V = 2^w E(m) pushes by 2^w (1 + m w'(m) ln 2 / 2) of one bond.
    assert least_push > 0.9
    assert least_rise > 1.0


@pytest.mark.parametrize("dimension", [2, 3])
def test_deep_contacts_of_parallel_rods_have_no_kink(dimension, measured):
    """Force and torques change in proportion to the turn through sin = 0; one bond's jump there."""
    rng = np.random.default_rng([36, dimension])
    n = 5000
    pairs, _ = side_by_side(rng, n, dimension, overlaps(rng, n), log_uniform(rng, 16.1, 1e4, n))
    sideways = random_perpendicular(rng, pairs.u_i)

    def torques_at(fraction, sides):
        sine = fraction * SMALL_SINE * np.minimum(pairs.A_i, pairs.A_j) / pairs.d
        turned = scaled(np.sqrt(1.0 - sine**2), pairs.u_i) + scaled(sine, sideways)
        result = contacts(pairs.replaced(u_i=turned), sides)
        # in units of one bond at an end of the shorter rod
        force = np.linalg.norm(result["force"], axis=1)
        lever = (force * np.minimum(pairs.A_i, pairs.A_j))[:, None]
        return (
            result["force"] / force[:, None],
            result["torque_i"] / lever,
            result["torque_j"] / lever,
        )

    def jump(fraction, sides):
        across = zip(torques_at(fraction, sides), torques_at(-fraction, sides), strict=True)
        return np.array([np.abs(a - b).max(axis=1) for a, b in across])

    near, nearer, one_bond = jump(1e-3, 2), jump(1e-6, 2), jump(1e-3, 1)
    measured(force=nearer[0].max(), torque=nearer[1:].max(), at_a_wider_turn=near.max(),
             one_bond=np.median(one_bond[1]))  # fmt: skip
    assert near.max() < 1e-3
    assert nearer.max() < 1e-6
    assert np.median(one_bond[1]) > 0.5


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("depth", [0.01, 1.0])
def test_fading_second_bonds_have_no_kink_where_rods_are_parallel(dimension, depth, measured):
    """Torques through sin = 0 where w is from 0.01 to 0.99, at all depths."""
    n = 8000
    rng = np.random.default_rng([37, dimension])
    pairs, half = parallel(rng, n, dimension, overlaps(rng, n), (0.01, 1.0), True, depth)
    w = Approach(pairs).exponent
    chosen = (w > 0.01) & (w < 0.99) & (pairs.A_i < 3.0 * pairs.A_j)
    pairs, half, w = (y[chosen] for y in (pairs, half, w))

    def jump(fraction):
        """Jump of the torque about the middle of the contact, about which i is rotated."""
        sine = fraction * w * pairs.overlap * pairs.d / (2.0 * half)
        torque = []
        for turn in (sine, -sine):
            u_i = scaled(np.sqrt(1.0 - turn**2), pairs.u_i) + scaled(turn, pairs.normal)
            r = pairs.r + scaled(pairs.s, pairs.u_i - u_i)
            result = contacts(pairs.replaced(r=r, u_i=u_i), 2)
            arm = cross(scaled(pairs.s, u_i), result["force"])
            torque.append(result["torque_i"] - arm)
        lever = np.linalg.norm(result["force"], axis=1) * half
        return np.abs(torque[0] - torque[1]).max(axis=1) / lever

    near, nearer = jump(1e-3), jump(1e-5)
    measured(near=near.max(), nearer=nearer.max(), pairs=len(near))
    assert len(near) > 1000
    assert near.max() < 0.5
    assert np.all(nearer < 0.011 * near + 1e-6)  # in proportion to the turn


# --- the parallel band of the one-bond law -----------------------------------------------------


@pytest.mark.parametrize("dimension", [2, 3])
def test_one_bond_energy_is_continuous_through_the_parallel_band(dimension, measured):
    """|sin| = 1e-8, where the bond leaves the middle: the lever arm jumps, the energy does not."""
    rng = np.random.default_rng([32, dimension])
    pairs, _ = parallel(rng, 4000, dimension, overlaps(rng, 4000), alpha=(0.1, 100.0))
    sideways = random_perpendicular(rng, pairs.u_i)

    def tilted_by(sine):
        return pairs.replaced(u_i=np.sqrt(1.0 - sine**2) * pairs.u_i + sine * sideways)

    within, beyond = contacts(tilted_by(0.999e-8), 1), contacts(tilted_by(1.001e-8), 1)
    assert np.all(within["kind"] == SIDE_TO_SIDE)
    assert np.mean(beyond["kind"] == TIP_TO_SIDE) > (0.99 if dimension == 2 else 0.5)
    # No more than the 2e-11 in between are worth, and rounding.
    overlap = np.sqrt(2.0 * within["energy"])
    worth = overlap * (pairs.extent * 2e-11 + 8.0 * EPS * pairs.extent) / pairs.d
    step = np.abs(beyond["energy"] - within["energy"])
    jump = np.linalg.norm(beyond["torque_i"] - within["torque_i"], axis=1) / (
        np.linalg.norm(within["force"], axis=1) * pairs.extent
    )
    measured(energy_step=step.max(), of_what_the_turn_is_worth=np.max(step / worth),
             torque_step=jump.max())  # fmt: skip
    assert np.all(step < worth)
    assert jump.max() > 0.1


# --- where the bonds sit -----------------------------------------------------------------------


def bonds_of_tilted_rods(A_i, A_j, offset, angle, height=0.9):
    """j along x at the origin; i above it, tilted about its own centre."""
    i = Pairs(np.array([[offset, height]]), np.array([[np.cos(angle), np.sin(angle)]]),
              np.array([[1.0, 0.0]]), np.array([A_i]), np.array([A_j]), np.array([0.5]),
              np.array([0.5]))  # fmt: skip
    return i, contacts(i, 2)


@pytest.mark.parametrize("angle", [0.0, 0.004, -0.004])
@pytest.mark.parametrize("head", [1.0, -1.0])
def test_staggered_rods_are_held_at_a_tip_of_each(angle, head):
    """Eqs. 25-29 with the second term of 29 corrected: the tip of i over j, the tip of j under i."""
    A, offset, height = 4.0, 3.0, 0.9
    pairs, _ = bonds_of_tilted_rods(A, A, offset, angle, height)
    result = contacts(pairs.replaced(u_i=head * pairs.u_i), 2)
    tip_of_i = height - A * np.sin(angle)
    tip_of_j = height * np.cos(angle) + (A - offset) * np.sin(angle)
    assert result["n_bonds"] == 2
    assert result["kind"] == SIDE_TO_SIDE
    np.testing.assert_allclose(np.sort(result["bond_distance"][0]), np.sort([tip_of_i, tip_of_j]))
    expected = 0.5 * np.sum((1.0 - np.array([tip_of_i, tip_of_j])) ** 2)
    np.testing.assert_allclose(result["energy"], expected)


@pytest.mark.parametrize("angle", [0.0, 0.004, -0.004])
def test_nested_rods_are_held_at_both_tips_of_the_shorter(angle):
    """Eq. 29 as printed does not apply here: both tips of i lie over the spine of j."""
    pairs, result = bonds_of_tilted_rods(3.0, 8.0, 1.0, angle)
    tips = 0.9 + 3.0 * np.sin(angle) * np.array([1.0, -1.0])
    assert result["n_bonds"] == 2
    np.testing.assert_allclose(np.sort(result["bond_distance"][0]), np.sort(tips))
    np.testing.assert_allclose(result["energy"], 0.5 * np.sum((1.0 - tips) ** 2))
    # and of the shorter, whichever comes first
    swapped = contacts(pairs.swapped(), 2)
    np.testing.assert_allclose(swapped["energy"], result["energy"])
    np.testing.assert_allclose(np.sort(swapped["bond_distance"][0]), np.sort(tips))


def test_rods_that_only_meet_at_a_tip_have_one_bond():
    _, past_the_end = bonds_of_tilted_rods(4.0, 4.0, 8.2, 0.0)
    assert past_the_end["n_bonds"] == 1
    _, tilted_away = bonds_of_tilted_rods(4.0, 4.0, 1.0, 0.3, height=1.9)
    assert tilted_away["n_bonds"] == 1
    assert tilted_away["kind"] == TIP_TO_SIDE
