"""Shortest distance of two spines against a bounded least-squares solver and against duality."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from spherocylinder_pairs import (
    EPS,
    EVERY_CLASS,
    Pairs,
    concatenated,
    contacts,
    log_uniform,
    normalised,
    overlaps,
    parallel,
    random_directions,
    random_perpendicular,
    random_shapes,
    row_dot,
    scaled,
    touching,
)

from jamshape import _contact

PER_CASE = 500


def distances(pairs):
    return _contact.spine_distances(*pairs.bodies())


def solved(pairs):
    """Per pair, a distance that is reached and one that is not undercut.

    min |r + s u_i - t u_j| over |s| <= A_i, |t| <= A_j is a bounded linear least-squares problem. Its
    minimum lies between the distance at any (s, t) and, for any direction n, the width of the gap
    that n leaves between the projections of both spines.
    """
    upper, lower = np.empty(len(pairs)), np.empty(len(pairs))
    for m in range(len(pairs)):
        bounds = np.array([pairs.A_i[m], pairs.A_j[m]])
        axes = np.column_stack([pairs.u_i[m], -pairs.u_j[m]])
        free = bounds > 0.0
        feet = np.zeros(2)
        if free.any():
            # In units of the half lengths.
            feet[free] = (
                bounds[free]
                * lsq_linear(
                    axes[:, free] * bounds[free], -pairs.r[m], (-1.0, 1.0), method="bvls", tol=1e-15
                ).x
            )
        delta = pairs.r[m] + axes @ feet
        upper[m] = np.linalg.norm(delta)
        normal = delta / upper[m] if upper[m] > 0.0 else delta
        lower[m] = normal @ pairs.r[m] - np.abs(normal @ axes) @ bounds
    return lower, upper


def shapes_near(rng, n, dimension):
    """Spines within a few lengths of each other, thin or nearly points."""
    A_i, A_j, R_i, R_j = random_shapes(rng, n)
    r = scaled(
        rng.uniform(0.0, 1.2, n) * (A_i + A_j + R_i + R_j), random_directions(rng, n, dimension)
    )
    return r, A_i, A_j, R_i, R_j


def generic(rng, n, dimension):
    r, *shapes = shapes_near(rng, n, dimension)
    return Pairs(
        r, random_directions(rng, n, dimension), random_directions(rng, n, dimension), *shapes
    )


def nearly_parallel_spines(rng, n, dimension):
    """Tilted and, in 3D, twisted by 1e-12 to 1e-2."""
    built, _ = parallel(rng, n, dimension, overlaps(rng, n))
    u_i = normalised(
        built.u_i + scaled(log_uniform(rng, 1e-12, 1e-2, n), random_perpendicular(rng, built.u_i))
    )
    return built.replaced(u_i=u_i)


def exactly_parallel(rng, n, dimension):
    """Side by side, staggered, and past each other's ends."""
    r, *shapes = shapes_near(rng, n, dimension)
    u = random_directions(rng, n, dimension)
    return Pairs(r, u, scaled(rng.choice([-1.0, 1.0], n), u), *shapes)


def end_to_end(rng, n, dimension):
    """On one line, with a gap of 1e-12 to 1 of d, or of nothing."""
    A_i, A_j, R_i, R_j = random_shapes(rng, n)
    u = random_directions(rng, n, dimension)
    gap = np.where(np.arange(n) % 5 == 0, 0.0, (R_i + R_j) * log_uniform(rng, 1e-12, 1.0, n))
    return Pairs(
        scaled(A_i + A_j + gap, u), scaled(rng.choice([-1.0, 1.0], n), u), u, A_i, A_j, R_i, R_j
    )


def crossing(rng, n, dimension):
    A_i, A_j, R_i, R_j = random_shapes(rng, n)
    u_i, u_j = random_directions(rng, n, dimension), random_directions(rng, n, dimension)
    s, t = A_i * rng.uniform(-0.99, 0.99, n), A_j * rng.uniform(-0.99, 0.99, n)
    return Pairs(scaled(t, u_j) - scaled(s, u_i), u_i, u_j, A_i, A_j, R_i, R_j)


def almost_crossing(rng, n, dimension):
    """A tip 1e-12 to 1e-2 of d before or beyond the other spine."""
    A_i, A_j, R_i, R_j = random_shapes(rng, n)
    u_i, u_j = random_directions(rng, n, dimension), random_directions(rng, n, dimension)
    s = A_i + rng.choice([-1.0, 1.0], n) * (R_i + R_j) * log_uniform(rng, 1e-12, 1e-2, n)
    t = A_j * rng.uniform(-1.0, 1.0, n)
    return Pairs(scaled(t, u_j) - scaled(s, u_i), u_i, u_j, A_i, A_j, R_i, R_j)


def with_points(rng, n, dimension):
    """One spine, or both, of no length."""
    pairs = generic(rng, n, dimension)
    pairs.A_i[::2] = 0.0
    pairs.A_j[::3] = 0.0
    return pairs


def needles(rng, n, dimension):
    """alpha = 100 at every angle, offset by a few widths."""
    R_i, R_j = rng.uniform(0.5, 5.0, n), rng.uniform(0.5, 5.0, n)
    u_j = random_directions(rng, n, dimension)
    u_i = normalised(
        u_j + scaled(log_uniform(rng, 1e-6, 10.0, n), random_directions(rng, n, dimension))
    )
    along = scaled(100.0 * (R_i + R_j) * rng.uniform(-1.0, 1.0, n), u_j)
    r = along + scaled((R_i + R_j) * rng.uniform(0.5, 1.5, n), random_perpendicular(rng, u_j))
    return Pairs(r, u_i, u_j, 100.0 * R_i, 100.0 * R_j, R_i, R_j)


CASES = [generic, nearly_parallel_spines, exactly_parallel, end_to_end, crossing, almost_crossing,
         with_points, needles]  # fmt: skip


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
def test_distance_is_the_minimum_over_both_spines(case, dimension, measured):
    rng = np.random.default_rng([21, dimension, CASES.index(case)])
    pairs = case(rng, PER_CASE, dimension)
    distance = distances(pairs)
    lower, upper = solved(pairs)
    of_d = np.max(np.abs(distance - upper) / pairs.d)
    of_extent = np.max(np.abs(distance - upper) / (pairs.extent + pairs.d))
    # The oracle is as good as it claims, up to the rounding of the direction n.
    gap = np.max((upper - np.maximum(lower, 0.0)) * upper / (EPS * (pairs.extent + pairs.d) ** 2))
    measured(of_d=of_d, of_extent=of_extent, oracle_gap_in_roundings=gap)
    assert gap < 8.0
    assert of_d < 1e-12


def test_spines_that_cross_have_no_distance():
    pairs = crossing(np.random.default_rng(22), 5000, 2)
    assert not np.any(distances(pairs))
    in_space = crossing(np.random.default_rng(22), 5000, 3)
    assert np.max(distances(in_space) / in_space.extent) < 8.0 * EPS


def test_every_contact_is_certified_by_its_normal(measured):
    """The gap that the normal leaves between both spines is the distance: none can be shorter."""
    for dimension, sides, kind in EVERY_CLASS:
        pairs = touching(dimension, sides, kind)
        if (dimension, sides) == (2, 1):
            rng = np.random.default_rng(23)
            pairs = concatenated(pairs, parallel(rng, 4000, 2, overlaps(rng, 4000))[0])
        result = contacts(pairs, sides)
        normal, distance = result["bond_normal"][:, 0], result["bond_distance"][:, 0]
        gap = row_dot(normal, pairs.r) - (pairs.A_i * np.abs(row_dot(normal, pairs.u_i))
                                          + pairs.A_j * np.abs(row_dot(normal, pairs.u_j)))  # fmt: skip
        turn = 1.0 + pairs.extent / pairs.d  # rounding turns the normal by EPS * extent / d
        worst = np.max(np.abs(gap - distance) / (EPS * pairs.extent * turn))
        measured(**{f"in_roundings_{dimension}d_{sides}_{kind}": worst})
        assert worst < 8.0
