"""Random and targeted pairs over all of the stated ranges: what no contact may ever be.

1e5 pairs, or 1e7 with `-m validate`. Of each: all numbers are finite, the energy lies between that
of one bond and the sum of its bonds (with two at most twice one), and stays the same with i and j
exchanged and with both turned or shifted; the force is the gradient of the energy wherever that has
one.
"""

from __future__ import annotations

import numpy as np
import pytest
import superellipsoid_pairs as bodies
from pair_packings import PairPacking
from spherocylinder_pairs import (
    APART,
    CROSSING,
    EPS,
    TOUCHING,
    contacts,
    cross,
    deep,
    disc_to_rod,
    energies,
    log_uniform,
    nearly_parallel,
    overlaps,
    parallel,
    placed,
    random_directions,
    random_perpendicular,
    random_shapes,
    row_dot,
    scaled,
    skew,
    tip_to_side,
    tip_to_tip,
    turned,
)

from jamshape import _contact

UNCONVERGED = 3
DEEPEST = 0.5
PARALLEL_SINE = 1.1e-8  # and a little more
BATCH = 1600
MANY = 100
how_often = pytest.mark.parametrize(
    "times", [pytest.param(1, id="1e5"), pytest.param(MANY, marks=pytest.mark.validate, id="1e7")]
)
in_each_space = pytest.mark.parametrize("dimension", [2, 3])


class Worst(dict):
    """The largest that was seen of each number."""

    def see(self, **numbers):
        for name, x in numbers.items():
            self[name] = max(self.get(name, -np.inf), float(np.max(x, initial=-np.inf)))


def are_finite(result):
    return all(np.isfinite(x).all() for x in result.values())


def random_rotation(rng, dimension):
    q, _ = np.linalg.qr(rng.normal(size=(dimension, dimension)))
    q[:, 0] *= np.linalg.det(q)
    return q


# --- rods --------------------------------------------------------------------------------------


def barely_side_by_side(rng, n, dimension, alpha, least):
    """Ends of two rods that pass each other by 1e-12 of their length to all, at any small angle."""
    A_i, A_j, R_i, R_j = random_shapes(rng, n, alpha)
    A_i = np.where(rng.uniform(size=n) < 0.5, A_j, A_i)
    u_j = random_directions(rng, n, dimension)
    normal, across = random_perpendicular(rng, u_j), random_perpendicular(rng, u_j)
    away = np.where((rng.uniform(size=n) < 0.5)[:, None], normal, across)
    tilt = log_uniform(rng, 1e-16, 1.0, n) * rng.choice([-1.0, 0.0, 1.0], n)
    end = rng.choice([-1.0, 1.0], n)
    into_i = scaled(np.cos(tilt) * end, u_j) + scaled(np.sin(tilt), away)
    passed = 2.0 * np.minimum(A_i, A_j) * log_uniform(rng, 1e-12, 1.0, n)
    return placed((A_i, A_j, R_i, R_j), into_i, u_j, -A_i, end * (A_j - passed), normal,
                  overlaps(rng, n, least))  # fmt: skip


def rods_of_every_kind(rng, times, n, dimension, **depths):
    """Batches of rods that touch: those whose other ends come no closer than a stated overlap."""
    for _ in range(times):
        for pairs in kinds_of_rods(rng, n, dimension, **depths):
            one = contacts(pairs, 1)
            is_deeper = one["energy"] > 0.5 * DEEPEST**2
            yield pairs[(one["status"] != CROSSING) & ~is_deeper]


def kinds_of_rods(rng, n, dimension, least=1e-14, least_twist=1e-12):
    """Rods of every class and between the classes."""
    any_depth = overlaps(rng, n, least)
    yield tip_to_tip(rng, n, dimension, any_depth)
    yield tip_to_side(rng, n, dimension, any_depth)
    yield disc_to_rod(rng, n, dimension, any_depth, at_side=True)
    yield parallel(rng, n, dimension, any_depth)[0]
    yield parallel(rng, n, dimension, overlaps(rng, n), fading=True)[0]
    yield nearly_parallel(rng, n, dimension, any_depth, least_tilt=1e-12)
    yield deep(rng, n, dimension, overlaps(rng, n, 1e-6))
    for alpha in ((1e-6, 1.1e-6), (1e-6, 1e-3), (1e-3, 2e-3), (1e-2, 100.0)):
        yield barely_side_by_side(rng, n, dimension, alpha, least)
    if dimension == 3:
        yield skew(rng, n, any_depth, log_uniform(rng, least_twist, 0.5 * np.pi, n))


def seen_otherwise(rng, pairs, sides):
    """The contacts of the same pairs exchanged, turned as a whole, and shifted by their size."""
    yield "exchanged", contacts(pairs.swapped(), sides)
    by = random_rotation(rng, pairs.dimension)
    whole = pairs.replaced(r=pairs.r @ by, u_i=pairs.u_i @ by, u_j=pairs.u_j @ by)
    yield "turned", contacts(whole, sides)
    shift = scaled(pairs.extent, random_directions(rng, len(pairs), pairs.dimension))
    yield "shifted", _contact.spherocylinder_contacts(*pairs.bodies(shift), 1.0, sides)


def energy_of_bonds(result):
    """The harmonic law of each bond's own overlap: more than all of a contact cannot have."""
    here = np.arange(result["bond_reach"].shape[1]) < result["n_bonds"][:, None]
    ratio = np.divide(result["bond_distance"], result["bond_reach"], where=here,
                      out=np.ones(here.shape))  # fmt: skip
    return 0.5 * (np.maximum(1.0 - ratio, 0.0) ** 2).sum(axis=1)


@how_often
@in_each_space
@pytest.mark.parametrize("sides", [1, 2])
def test_energies_of_rods_are_finite_bounded_and_whoever_looks_sees_the_same(
    dimension, sides, times, measured
):
    """Rounding of poses changes the energy by at most 2.5 times the force of one bond, times the rounding."""
    rng, worst = np.random.default_rng([1600, dimension, sides]), Worst()
    for pairs in rods_of_every_kind(rng, times, BATCH, dimension):
        result = contacts(pairs, sides)
        assert are_finite(result)
        assert np.isin(result["status"], (APART, TOUCHING)).all()
        energy, rounding = result["energy"], EPS * pairs.extent / pairs.d
        overlap = np.sqrt(2.0 * energies(pairs, 1))
        unit = (overlap + rounding) * rounding
        assert np.all(energy >= 0.0)
        one = 0.5 * overlap**2
        worst.see(above_bonds=(energy - energy_of_bonds(result)) / unit)
        worst.see(below_one=(one - energy) / unit, above_all=(energy - sides * one) / unit)
        clear = overlap > 1e3 * rounding
        size = np.linalg.norm(result["force"], axis=1) * pairs.d
        worst.see(force=size[clear] / overlap[clear])
        for name, other in seen_otherwise(rng, pairs, sides):
            assert are_finite(other)
            worst.see(**{name: (np.abs(other["energy"] - energy) - 1e-12 * energy) / unit})
    measured(**worst)
    assert worst.pop("force") < 2.5
    assert max(worst.values()) < 16.0


def energy_along(pairs, sides, way, step):
    """Energies at a step along (M, D) of r and turns of both about a common axis, and its slope."""
    by_r, by_i, by_j, component = way
    moved = pairs.replaced(
        r=pairs.r + scaled(step, by_r),
        u_i=turned(pairs.u_i, step * by_i, component),
        u_j=turned(pairs.u_j, step * by_j, component),
    )
    return energies(moved, sides)


def slope_along(result, way):
    by_r, by_i, by_j, component = way
    turn = component if result["torque_i"].shape[1] == 3 else 0
    return -(
        row_dot(result["force"], by_r)
        + result["torque_i"][:, turn] * by_i
        + result["torque_j"][:, turn] * by_j
    )


def with_steps(pairs, sides):
    """Pairs whose overlaps change along a step by much more than they round, steps and overlaps.

    Without rods in 2D that count as parallel, which have one bond in their middle.
    """
    sine = np.linalg.norm(cross(pairs.u_i, pairs.u_j), axis=1)
    overlap = np.sqrt(2.0 * energies(pairs, 1))
    shorter = np.minimum(pairs.A_i, pairs.A_j)
    step = 1e-5 * np.minimum(np.where(shorter > 0.0, shorter, pairs.d), overlap * pairs.d)
    resolved = EPS * pairs.extent < 1e-5 * step
    which = resolved & ((sine > PARALLEL_SINE) | (sides == 2))
    return pairs[which], step[which], overlap[which]


@how_often
@in_each_space
@pytest.mark.parametrize("sides", [1, 2])
def test_forces_of_rods_lie_between_the_slopes_to_either_side(dimension, sides, times, measured):
    """The force is the gradient where these agree, everywhere but at the documented kinks.

    Rods in space that pass each other at a small twist have kinks closer together than any step.
    """
    rng, worst = np.random.default_rng([1601, dimension, sides]), Worst()
    smooth = []
    for drawn in rods_of_every_kind(rng, times, BATCH, dimension, least=1e-6, least_twist=0.03):
        pairs, step, overlap = with_steps(drawn, sides)
        turns = rng.normal(size=(2, len(pairs))) / (pairs.A_i + pairs.A_j + pairs.d)
        way = (random_directions(rng, len(pairs), dimension), *turns, int(rng.integers(3)))
        back, here, forth = (energy_along(pairs, sides, way, k * step) for k in (-1.0, 0.0, 1.0))
        slopes = np.stack([here - back, forth - here]) / step
        slope, unit = slope_along(contacts(pairs, sides), way), overlap / pairs.d
        beyond = np.maximum(slopes.min(axis=0) - slope, slope - slopes.max(axis=0))
        worst.see(beyond=beyond / unit)
        smooth.append(np.ptp(slopes, axis=0) < 0.01 * unit)
    share = np.concatenate(smooth).mean()
    measured(**worst, smooth=share, pairs=sum(map(len, smooth)))
    assert share > 0.8
    assert worst["beyond"] < 1e-3  # of the bend within a step; it shrinks with the step


@how_often
@in_each_space
@pytest.mark.parametrize("sides", [1, 2])
def test_long_doubles_and_second_derivatives_of_rods_are_finite(dimension, sides, times):
    rng = np.random.default_rng([1603, dimension, sides])
    for pairs in rods_of_every_kind(rng, times, BATCH // 8, dimension, least_twist=1e-3):
        packing = PairPacking.of(rng, pairs)
        given, rods = packing.arguments(), packing.compiled(sides, 1.0)
        for extended in (False, True):
            found = rods.contacts(*given, extended=extended)
            assert are_finite(found)
            most = np.sqrt(energy_of_bonds(found))
            assert np.all(np.sqrt(found["energy"]) <= most * (1.0 + 1e-9) + 4.0 * EPS)
            assert are_finite(rods.derivatives(*given, extended=extended))


# --- superellipsoids ---------------------------------------------------------------------------

# Scales are found to this relative gap; a point of a face of exponent p shifts the scale by its
# (2p)-th power, so that the gap leaves it open by its (2p)-th root.
GAP = 64.0 * EPS


def anywhere(rng, n, dimension):
    """Bodies of any exponents, axis ratios to 10, size ratios to 10 and overlaps from 1e-13 to a third."""
    p_i, p_j = rng.choice([0.55, 0.8, 1.0, 1.5, 3.0, 6.0, 10.0], (2, n))
    i, j = bodies.random_pairs(rng, n, dimension, p_i, p_j)
    return bodies.at_scale(i, j, np.sqrt(1.0 - log_uniform(rng, 1e-13, 1.0 / 3.0, n))), j


def face_to_face(rng, n, dimension):
    """Boxes of p = 2 to 10 beside each other along x, tilted by 0 or 1e-13 to 1e-2."""
    p_i = rng.uniform(2.0, 10.0, n)
    p_j = np.where(rng.uniform(size=n) < 0.5, p_i, rng.uniform(2.0, 10.0, n))
    i, j = bodies.random_pairs(rng, n, dimension, p_i, p_j, size_range=2.0)
    straight = np.zeros((n, 1)) if dimension == 2 else np.eye(4)[np.zeros(n, int)]
    side = rng.uniform(-0.7, 0.7, (n, dimension)) * np.minimum(i.semi_axes, j.semi_axes)
    side[:, 0] = (1.0 - log_uniform(rng, 1e-8, 0.3, n)) * (i.semi_axes[:, 0] + j.semi_axes[:, 0])
    i = i.replaced(centre=j.centre + side, turn=straight)
    for component in range(3 if dimension == 3 else 1):
        angle = log_uniform(rng, 1e-13, 1e-2, n) * rng.choice([-1.0, 0.0, 1.0], n)
        i = i.turned(component, angle if dimension == 3 else angle[:, None])
    return i, j.replaced(turn=straight)


def lever(i, j):
    return np.linalg.norm(i.semi_axes, axis=1) + np.linalg.norm(j.semi_axes, axis=1)


def open_point(i, j):
    """Range over a lever that the gap leaves for the point of contact of two bodies."""
    return GAP ** (0.5 / np.maximum(np.maximum(i.p, j.p), 1.0))


@how_often
@in_each_space
@pytest.mark.parametrize("draw", [anywhere, face_to_face])
def test_contacts_of_superellipsoids_are_finite_bounded_and_symmetric(
    draw, dimension, times, measured
):
    """Energies to the gap of the scale; arms of torques to how far that leaves open the point."""
    rng, worst = np.random.default_rng([1602, dimension, draw is anywhere]), Worst()
    for _ in range(times):
        i, j = draw(rng, BATCH, dimension)
        result, back = bodies.contacts(i, j), bodies.contacts(j, i)
        both = (result["status"] == TOUCHING) & (back["status"] == TOUCHING)
        assert (result["status"] != UNCONVERGED).all()
        assert both.mean() > 0.5
        assert are_finite(result)
        assert are_finite(back)
        i, j = i[both], j[both]
        result, back = ({k: x[both] for k, x in of.items()} for of in (result, back))
        overlap, other = np.sqrt(2.0 * result["energy"]), np.sqrt(2.0 * back["energy"])
        assert np.all((overlap > 0.0) & (overlap < 1.0))
        sizes = (np.linalg.norm(of["force"], axis=1) for of in (result, back))
        arms = [scaled(1.0 / size, of[name]) for size, of, name in
                zip(sizes, (result, back), ("torque_i", "torque_j"), strict=True)]  # fmt: skip
        arm = np.linalg.norm(arms[0] - arms[1], axis=1) / lever(i, j)
        worst.see(overlap=np.abs(overlap - other), arm=arm / open_point(i, j))
    measured(**worst)
    assert worst["arm"] < 1.0
    assert worst["overlap"] < 1e-14
