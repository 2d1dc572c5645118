"""Clumps: against plain sums over all pairs of their discs, and integrals over unions."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from bodies_in_pairs import at_random, largest_jump, sized
from spherocylinder_pairs import APART, CROSSING, EPS, TIP_TO_TIP, TOUCHING

import jamshape as js
from jamshape import _contact
from jamshape.contacts import CrossingError, find_contacts
from jamshape.shapes.clump import bumpy_discs, dimer_discs, trimer_discs
from jamshape.shapes.table import SHAPES

K_E = 1.7
SHAPE = SHAPES["clump"]
IN_BOTH = pytest.mark.parametrize("dimension", [2, 3])
LONG = np.longdouble


def random_discs(rng, dimension, most=7):
    """Discs (n, 3) or balls (n, 4) at random: overlapping, nested or apart."""
    n = int(rng.integers(1, most))
    place = rng.normal(size=(n, dimension)) * rng.uniform(0.2, 1.5)
    return np.column_stack([place, rng.uniform(0.3, 1.0, n)])


def random_bodies(rng, dimension, n=40):
    """Diameters and forms of random clumps, among them dimers, trimers and rough discs."""
    discs = [random_discs(rng, dimension) for _ in range(n)]
    discs += [dimer_discs(0.6, 1.3), trimer_discs(60), trimer_discs(150), bumpy_discs(7, 0.5)]
    told = [{"discs": rows} for rows in discs]
    if dimension == 3:
        flat = [np.insert(rows, 2, 0.0, axis=1) if rows.shape[1] == 3 else rows for rows in discs]
        told = [{"discs": rows} for rows in flat]
    return sized("clump", told, rng.uniform(0.5, 2.0, len(told)))


def pairs_of(n, dimension, seed=1, reach=(0.35, 1.05)):
    rng = np.random.default_rng([seed, dimension])
    return at_random(rng, "clump", random_bodies(rng, dimension), n, dimension, reach)


def discs_of(pairs):
    """Arms from the centres (2M, n, D), and radii (2M, n), 0 for discs that fill up, in long double."""
    rows = pairs.form.reshape(len(pairs.form), -1, 4).astype(LONG)
    D = pairs.dimension
    used = rows[..., 3] > 0
    extent = np.where(used, np.abs(rows[..., 0]) + rows[..., 3], 0).max(axis=1)
    scale = pairs.diameters[:, 0] / (2 * extent)
    matrix = dataclasses.replace(pairs, turn=pairs.turn.astype(LONG)).matrices()
    arms = np.einsum("kab,knb->kna", matrix, rows[..., :D]) * scale[:, None, None]
    return arms, rows[..., 3] * scale[:, None]


def plain_sums(pairs):
    """Energies, forces on i, torques, and overlaps (M, n, n) of all pairs of discs: a plain double loop."""
    arms, radii = discs_of(pairs)
    r = (pairs.centre[::2].astype(LONG) - pairs.centre[1::2]).astype(LONG)
    arm_i, arm_j, R_i, R_j = arms[::2], arms[1::2], radii[::2], radii[1::2]
    M, n, D = arm_i.shape
    energy, force = np.zeros(M, LONG), np.zeros((M, D), LONG)
    torque = np.zeros((2, M, 3), LONG)
    overlap = np.full((M, n, n), -np.inf, LONG)
    for a, b in itertools.product(range(n), range(n)):
        used = (R_i[:, a] > 0) & (R_j[:, b] > 0)
        apart = r + arm_i[:, a] - arm_j[:, b]
        distance, reach = np.sqrt((apart**2).sum(axis=1)), np.where(used, R_i[:, a] + R_j[:, b], 1)
        overlap[used, a, b] = (1 - distance / reach)[used]
        x = np.where(used, np.maximum(1 - distance / reach, 0), 0)
        energy += 0.5 * K_E * x**2
        f = (K_E * x / reach / np.where(distance > 0, distance, 1))[:, None] * apart
        force += f
        for k, (arm, sign) in enumerate(((arm_i[:, a], 1), (arm_j[:, b], -1))):
            torque[k] += sign * np.cross(in_space(arm), in_space(f))
    return energy, force, torque, overlap


def in_space(vectors):
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def as_in_space(torque):
    torque = torque.reshape(len(torque), -1)
    return torque if torque.shape[1] == 3 else np.pad(torque, ((0, 0), (2, 0)))


# --- energies ------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [2000, pytest.param(100_000, marks=pytest.mark.validate)])
@IN_BOTH
def test_a_contact_is_the_sum_over_pairs_of_discs(dimension, n, measured):
    pairs = pairs_of(n, dimension)
    energy, force, torque, overlap = plain_sums(pairs)
    bonds = (overlap > 0).sum(axis=(1, 2))
    found = pairs.contacts(K_E)
    # Within rounding of first touch either is right; more bonds than a contact holds are refused.
    clear = (np.abs(overlap) > 1e-13).all(axis=(1, 2))
    expected = np.where(bonds > 16, CROSSING, np.where(bonds > 0, TOUCHING, APART))
    assert np.array_equal(found["status"][clear], expected[clear])
    touching = clear & (expected == TOUCHING)
    assert np.array_equal(found["n_bonds"][touching], bonds[touching])
    assert (found["kind"] == TIP_TO_TIP).all()
    least = discs_of(pairs)[1]
    least = np.where(least > 0, least, np.inf).min(axis=1).reshape(-1, 2).sum(axis=1).astype(float)
    outer = pairs.compiled().outer_radius.reshape(-1, 2).sum(axis=1)
    inside = np.where(overlap > 0, 1 - overlap, np.inf).min(axis=(1, 2)).astype(float)
    unit = K_E * bonds * EPS * outer / least
    units = {
        "energy": (energy, unit),
        "force": (force, unit / least / np.minimum(inside, 1)),
        "torque_i": (torque[0], unit * outer / least / np.minimum(inside, 1)),
        "torque_j": (torque[1], unit * outer / least / np.minimum(inside, 1)),
    }
    worst = {}
    for name, (exact, by) in units.items():
        value = as_in_space(found[name]) if "torque" in name else found[name]
        off = np.abs(value - exact).reshape(n, -1).max(axis=1)
        worst[name] = float((off[touching] / by[touching]).max())
    measured(**worst, touching=touching.mean(), most=bonds[touching].max())
    assert max(worst.values()) < 8
    assert 0.2 < touching.mean() < 0.95
    assert bonds[touching].max() > 8


@IN_BOTH
def test_bodies_with_a_notch_touch_wherever_two_discs_do(dimension):
    """Rings of discs that reach around each other: never apart while any two discs overlap."""
    angle = np.linspace(0, 1.6 * np.pi, 9)
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle, 0 * angle + 0.15])
    rng = np.random.default_rng([2, dimension])
    bodies = sized("clump", [{"discs": ring if dimension == 3 else ring[:, [0, 1, 3]]}], [1.0])
    pairs = at_random(rng, "clump", bodies, 4000, dimension, (0.0, 1.0))
    overlap = plain_sums(pairs)[-1].max(axis=(1, 2))
    clear = np.abs(overlap) > 1e-13
    status = pairs.contacts(K_E)["status"]
    assert np.array_equal((status != APART)[clear], (overlap > 0)[clear])
    assert np.array_equal(pairs.overlaps()[clear], (overlap > 0)[clear])
    # Some are free although the centre of one lies well within the other's circle.
    outer = pairs.compiled().outer_radius.reshape(-1, 2).sum(axis=1)
    near = np.linalg.norm(pairs.centre[::2], axis=1) < 0.5 * outer
    assert (near & (status == APART)).sum() > 20


@IN_BOTH
def test_near_and_overlapping_are_gaps_of_discs(dimension):
    pairs = pairs_of(2000, dimension, seed=3, reach=(0.5, 1.5))
    arms, radii = discs_of(pairs)
    apart = (pairs.centre[::2, None] + arms[::2])[:, :, None] - arms[1::2][:, None]
    reach = radii[::2][:, :, None] + radii[1::2][:, None]
    used = (radii[::2] > 0)[:, :, None] & (radii[1::2] > 0)[:, None]
    gap = np.where(used, np.sqrt((apart**2).sum(axis=3)) - reach, np.inf).min(axis=(1, 2))
    for margin in (0.0, 0.3):
        clear = np.abs(gap - margin) > 1e-12
        assert np.array_equal(pairs.near(margin)[clear], (gap < margin)[clear])
    assert 0.1 < (gap < 0).mean() < 0.9


@IN_BOTH
def test_energies_do_not_jump_along_paths(dimension, measured):
    worst = largest_jump(pairs_of(300, dimension, seed=4, reach=(0.5, 1.0)))
    measured(worst=worst)
    assert worst < 1


# --- limits --------------------------------------------------------------------------------------


def compared(pairs, others):
    one, other = pairs.contacts(K_E), others.contacts(K_E)
    assert np.array_equal(one["status"], other["status"])
    assert np.array_equal(one["n_bonds"], other["n_bonds"])
    unit = K_E * EPS * pairs.compiled().outer_radius.reshape(-1, 2).sum(axis=1)
    near = np.where(
        one["n_bonds"] > 0,
        one["bond_distance"].min(axis=1, initial=1e9, where=one["bond_distance"] > 0),
        1,
    )
    worst = {}
    for name in ("energy", "force", "torque_i", "torque_j"):
        off = np.abs(one[name] - other[name]).reshape(len(pairs), -1).max(axis=1)
        worst[name] = float((off / unit * np.minimum(near, 1)).max())
    return worst


@IN_BOTH
def test_one_disc_is_a_disc(dimension, measured):
    rng = np.random.default_rng([5, dimension])
    row = [[0.0] * dimension + [0.5]]
    pairs = at_random(
        rng,
        "clump",
        sized("clump", [{"discs": row}] * 8, rng.uniform(0.5, 2, 8)),
        2000,
        dimension,
        (0.05, 1.1),
    )
    discs = dataclasses.replace(pairs, shape="spherocylinder", form=np.empty((4000, 0)))
    worst = compared(pairs, discs)
    measured(**worst)
    assert max(worst.values()) < 8
    for name in ("measure", "moment", "outer_radius", "inner_radius", "rotation_length"):
        one, other = (getattr(x.compiled(), name) for x in (pairs, discs))
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-15)


@IN_BOTH
def test_two_equal_discs_are_a_dimer(dimension, measured):
    rng = np.random.default_rng([6, dimension])
    half = 10.0 ** rng.uniform(-1, 0.7, 12)
    zero = [0.0] * (dimension - 1)
    told = [{"discs": [[-a, *zero, 0.5], [a, *zero, 0.5]]} for a in half]
    pairs = at_random(
        rng, "clump", sized("clump", told, rng.uniform(0.5, 2, 12)), 4000, dimension, (0.1, 1.05)
    )
    dimers = dataclasses.replace(pairs, shape="dimer", form=np.empty((8000, 0)))
    # Radii of both, which differ by rounding.
    short = dimers.diameters[:, 1:2]
    dimers.diameters = np.column_stack([dimers.diameters[:, 0], short, short])
    worst = compared(pairs, dimers)
    measured(**worst)
    assert max(worst.values()) < 40
    for name in ("measure", "moment", "outer_radius", "inner_radius", "symmetry_axis", "director"):
        one, other = (getattr(x.compiled(), name) for x in (pairs, dimers))
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


@IN_BOTH
def test_coinciding_discs_and_too_many_bonds_cross(dimension):
    zero = [0.0] * (dimension - 1)
    told = [{"discs": [[-1.0, *zero, 0.5], [1.0, *zero, 0.5]]}]
    pairs = at_random(
        np.random.default_rng(7), "clump", sized("clump", told, [1.0]), 3, dimension, (1, 1)
    )
    pairs.turn[:] = 0.0
    if dimension == 3:
        pairs.turn[:, 0] = 1.0
    pairs.centre[::2] = 0.0
    pairs.centre[::2, 0] = 0.0, 2.0, 1.999
    assert pairs.contacts(K_E)["status"].tolist() == [CROSSING, CROSSING, TOUCHING]
    packing = js.Packing.of(
        "clump",
        position=[[2.0] * dimension, [4.0, *[2.0] * (dimension - 1)]],
        orientation=[0, 0] if dimension == 2 else [[1, 0, 0, 0]] * 2,
        discs=told[0]["discs"],
        box=js.Box(lo=[0] * dimension, edges=[9] * dimension),
    )
    with pytest.raises(CrossingError, match="centres of discs"):
        find_contacts(packing)


# --- area, volume and moments --------------------------------------------------------------------


def lens(R, S, d):
    """Area that two discs share, and volume that two balls share."""
    a, b = (np.arccos((d * d + s * (R * R - S * S)) / (2 * d * T)) for T, s in ((R, 1), (S, -1)))
    area = R * R * (a - np.sin(2 * a) / 2) + S * S * (b - np.sin(2 * b) / 2)
    caps = (
        np.pi * (T - c) ** 2 * (2 * T + c) / 3 for T, c in ((R, R * np.cos(a)), (S, S * np.cos(b)))
    )
    return area, sum(caps)


@IN_BOTH
def test_two_discs_have_a_closed_form(dimension, measured):
    rng = np.random.default_rng(8)
    worst = 0.0
    for _ in range(200):
        R, S = rng.uniform(0.3, 2, 2)
        d = rng.uniform(abs(R - S), R + S)
        direction = rng.normal(size=3) * [1, 1, dimension == 3]
        direction /= np.linalg.norm(direction)
        at = rng.normal(size=3) * [1, 1, dimension == 3]
        rows = np.array([[*at, R], [*(at + d * direction), S]])
        one = {2: np.pi * rows[:, 3] ** 2, 3: 4 / 3 * np.pi * rows[:, 3] ** 3}[dimension]
        expected = one.sum() - lens(R, S, d)[dimension - 2]
        found = _contact.union_moments(rows, dimension)
        worst = max(worst, abs(found[0] / expected - 1))
    measured(worst=worst)
    assert worst < 1e-11  # of balls by quadrature; bodies lie at their centre within 1e-9


def test_discs_apart_nested_and_repeated():
    """Closed forms: apart they add up; a disc inside another one, or the same again, adds nothing."""
    big, other = [0.3, -0.2, 0.0, 1.0], [5.0, 1.0, 0.0, 0.5]
    for dimension in (2, 3):
        alone = [_contact.union_moments(np.array([x]), dimension) for x in (big, other)]
        rows = np.array([big, [0.5, -0.1, 0.0, 0.3], big, other])
        found = _contact.union_moments(rows, dimension)
        np.testing.assert_allclose(found, alone[0] + alone[1], rtol=1e-13, atol=1e-13)
        touching = np.array([big, [1.8, -0.2, 0.0, 0.5]])  # from outside
        inner = np.array([big, [0.8, -0.2, 0.0, 0.5]])  # from inside
        np.testing.assert_allclose(
            _contact.union_moments(inner, dimension), alone[0], rtol=1e-12, atol=1e-12
        )
        added = alone[0] + _contact.union_moments(touching[1:], dimension)
        np.testing.assert_allclose(
            _contact.union_moments(touching, dimension), added, rtol=1e-12, atol=1e-12
        )
    x, y, _, R = big
    area = np.pi * R * R
    expected = area * np.array([1, x, y, 0, x * x + R * R / 4, y * y + R * R / 4, 0, x * y, 0, 0])
    np.testing.assert_allclose(
        _contact.union_moments(np.array([big]), 2), expected, rtol=1e-14, atol=1e-14
    )


def test_moments_of_discs_are_those_of_strips(measured):
    """Integrals over x of the union of intervals in which each line crosses the discs, to sixth order of the grid."""
    rng = np.random.default_rng(9)
    worst = 0.0
    for _ in range(20):
        rows = random_discs(rng, 2, 8)
        edges = [(x - R, x + R) for x, _, R in rows]
        low, high = min(e[0] for e in edges), max(e[1] for e in edges)
        at = crossings(rows)
        breaks = np.unique([low, high, *(b for e in edges for b in e), *at])
        total = np.zeros(6)
        nodes, weights = np.polynomial.legendre.leggauss(60)
        for a, b in itertools.pairwise(breaks):
            t = 0.5 * np.pi * nodes
            xs = 0.5 * (a + b) + 0.5 * (b - a) * np.sin(t)
            for x, w in zip(xs, 0.5 * np.pi * weights * 0.5 * (b - a) * np.cos(t), strict=True):
                for lo, hi in intervals(rows, x):
                    h, s, q = hi - lo, (hi**2 - lo**2) / 2, (hi**3 - lo**3) / 3
                    total += w * np.array([h, x * h, s, x * x * h, q, x * s])
        flat = np.insert(rows, 2, 0.0, axis=1)
        found = _contact.union_moments(flat, 2)[[0, 1, 2, 4, 5, 7]]
        worst = max(worst, float(np.abs(found - total).max() / np.abs(total).max()))
    measured(worst=worst)
    assert worst < 1e-11


def crossings(rows):
    """x where two circles cross."""
    found = []
    for (x, y, R), (u, v, S) in itertools.combinations(rows, 2):
        d = np.hypot(u - x, v - y)
        if abs(R - S) < d < R + S:
            along = (d * d + R * R - S * S) / (2 * d)
            across = np.sqrt(R * R - along**2)
            found += [x + (along * (u - x) + s * across * (v - y)) / d for s in (1, -1)]
    return found


def intervals(rows, x):
    """Union of the intervals of y in which the line at x crosses the discs."""
    spans = sorted(
        (y - np.sqrt(R * R - (x - u) ** 2), y + np.sqrt(R * R - (x - u) ** 2))
        for u, y, R in rows
        if abs(x - u) < R
    )
    merged = []
    for lo, hi in spans:
        if merged and lo <= merged[-1][1]:
            merged[-1][1] = max(merged[-1][1], hi)
        else:
            merged.append([lo, hi])
    return merged


def test_moments_of_balls_are_means_over_points(measured):
    """Quasi-random points in a box: a scrambled Sobol sequence."""
    qmc = pytest.importorskip("scipy.stats").qmc
    rng = np.random.default_rng(10)
    worst = 0.0
    for k in range(8):
        rows = random_discs(rng, 3, 8)
        low, high = (rows[:, :3] - rows[:, 3:]).min(axis=0), (rows[:, :3] + rows[:, 3:]).max(axis=0)
        points = low + (high - low) * qmc.Sobol(3, seed=k).random_base2(17)
        inside = (np.linalg.norm(points[:, None] - rows[:, :3], axis=2) < rows[:, 3]).any(axis=1)
        x, y, z = points[inside].T
        one = np.ones(len(x))
        values = np.stack([one, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z])
        expected = values.sum(axis=1) / len(points) * np.prod(high - low)
        found = _contact.union_moments(np.ascontiguousarray(rows), 3)
        size = found[0] * np.abs(np.stack([low, high])).max() ** np.array([0, 1, 1, 1, *[2] * 6])
        worst = max(worst, float((np.abs(found - expected) / size).max()))
    measured(worst=worst)
    assert worst < 2e-3


def test_moments_of_balls_do_not_depend_on_the_direction_of_z(measured):
    """The quadrature runs along z; the union rotated is the same body."""
    rng = np.random.default_rng(11)
    worst = 0.0
    for _ in range(20):
        rows = random_discs(rng, 3, 8)
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        other = np.column_stack([rows[:, :3] @ turn.T, rows[:, 3]])
        one, two = (_contact.union_moments(np.ascontiguousarray(x), 3) for x in (rows, other))
        square = second(two), turn @ second(one) @ turn.T
        errors = [two[0] / one[0] - 1, *(two[1:4] - turn @ one[1:4]) / one[0]]
        worst = max(worst, np.abs(errors).max(), np.abs(square[0] - square[1]).max() / one[0])
    measured(worst=worst)
    assert worst < 1e-9


def second(found):
    xx, yy, zz, xy, xz, yz = found[4:]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def test_the_outline_encloses_the_area():
    rng = np.random.default_rng(12)
    diameters, form = random_bodies(rng, 2, 5)
    area = SHAPE.compiled((diameters, form), 2, js.Interaction()).measure
    for d, f, expected in zip(diameters, form, area, strict=True):
        x, y = SHAPE.outline(d, f, 4000).T
        found = 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
        assert found == pytest.approx(expected, rel=1e-4)


# --- input ---------------------------------------------------------------------------------------


@IN_BOTH
def test_moved_and_rotated_lists_give_the_same_body(dimension, measured):
    rng = np.random.default_rng([13, dimension])
    rows = np.column_stack([rng.normal(size=(5, dimension)), rng.uniform(0.3, 1, 5)])
    turn, _ = np.linalg.qr(rng.normal(size=(dimension, dimension)))
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    moved = np.column_stack([rows[:, :-1] @ turn.T + rng.normal(size=dimension), rows[:, -1]])
    worst = 0.0
    bodies = [js.Clumps(discs=x).sample(1, rng) for x in (rows, moved, moved[::-1])]
    compiled = [SHAPE.compiled((x.diameters, x.form), dimension, js.Interaction()) for x in bodies]
    for its, body in zip(compiled[1:], bodies[1:], strict=True):
        # Axes may be exchanged: distances of the discs from the centre stay.
        away = [
            np.sort(np.linalg.norm(x.form.reshape(-1, 4)[:, :3], axis=1)) for x in (body, bodies[0])
        ]
        worst = max(worst, np.abs(away[0] - away[1]).max())
        unit = [x.measure[0] ** (1 / dimension) for x in (its, compiled[0])]
        sorted_moments = [
            np.sort(x.moment[0]) / u**2 for x, u in zip((its, compiled[0]), unit, strict=True)
        ]
        worst = max(worst, np.abs(sorted_moments[0] / sorted_moments[1] - 1).max())
    measured(worst=worst)
    assert worst < 1e-8


def test_bodies_lie_about_their_centre_along_principal_axes():
    rng = np.random.default_rng(14)
    for rows, dimension in (
        (random_discs(rng, 2, 6) + np.array([3, 1, 0]), 2),
        (random_discs(rng, 3, 6), 3),
        (bumpy_discs(), 2),
    ):
        form = js.Clumps(discs=rows).sample(1, rng).form.reshape(-1, 4)
        measure, *first, xx, yy, zz, xy, xz, yz = _contact.union_moments(form, dimension)
        size = np.sqrt((xx + yy + zz) / measure)
        assert np.abs(first).max() < 1e-8 * measure * size
        assert np.abs([xy, xz, yz]).max() < 1e-8 * measure * size**2


def test_text_files_and_arrays_are_one_input(tmp_path):
    rows = [[0, 0, 1], [1.5, 0, 0.5], [0, 1, 0.7]]
    path = tmp_path / "discs.txt"
    path.write_text("# x y r\n0 0 1\n1.5 0 0.5  # small\n\n0 1 0.7\n")
    found = [
        js.Clumps(discs=given).told["discs"]
        for given in (rows, np.array(rows), "0 0 1/1.5 0 0.5/0 1 0.7", str(path))
    ]
    assert len(set(found)) == 1
    assert js.Clumps(discs=found[0]).told["discs"] == found[0]


@pytest.mark.parametrize(
    "discs",
    [
        [[0, 0, 0]],
        [[0, 0, -1]],
        [[0, 0]],
        [[0, 0, 0, 0, 1]],
        [[0, np.inf, 1]],
        "0 0 1/1 x 1",
        "0 0 1/1 1",
        "no_such_file.txt",
        np.ones((256, 3)),
    ],
)
def test_other_discs_are_refused_in_a_sentence(discs):
    with pytest.raises(ValueError, match=r"discs .*expected x y r of each disc") as error:
        js.Clumps(discs=discs)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: dimer_discs(-1), "ratio is -1, expected a ratio"),
        (lambda: dimer_discs(1, -1), "distance is -1, expected a distance"),
        (lambda: trimer_discs(400), "angle is 400, expected an angle in degrees from 0 to 180"),
    ],
)
def test_discs_of_no_body_are_refused(make, sentence):
    with pytest.raises(ValueError, match=sentence):
        make()


def test_balls_in_the_plane_are_refused_with_what_to_do():
    balls = js.Clumps(discs=[[0, 0, 0, 0.5], [0.6, 0, 0, 0.5], [0, 0.6, 0, 0.4]])
    with pytest.raises(ValueError, match=r"give rows x y r .* or make a packing of dimension 3"):
        js.make_packing(balls, n=4, progress=False)


def test_forms_off_their_centre_are_refused():
    """Files and arrays of other programs: the compiled class takes bodies about their centre only."""
    form = np.array([[0.1, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.5]])
    with pytest.raises(ValueError, match="particle 0 is not a valid shape: a clump"):
        _contact.Clumps(np.array([[3.0, 1.0, 1.0]]), form, 2, 1.0, 1)
    diagonal = np.array([[-0.3, -0.3, 0.0, 0.5, 0.3, 0.3, 0.0, 0.5]])
    with pytest.raises(ValueError, match="particle 0 is not a valid shape: a clump"):
        _contact.Clumps(np.array([[1.6, 1.6, 1.0]]), diagonal, 2, 1.0, 1)


def test_forms_of_different_lengths_mix():
    mixture = js.Clumps(discs=[dimer_discs(), trimer_discs(), "0 0 0.5"], size=[1, 1.2, 0.8])
    sizes = mixture.sample(6, np.random.default_rng(1))
    assert sizes.form.shape == (6, 12)
    area = SHAPE.compiled((sizes.diameters, sizes.form), 2, js.Interaction()).measure
    expected = np.pi / 4 * np.array([2, 3 * 1.44, 0.64])
    np.testing.assert_allclose(np.unique(area.round(12)), np.sort(expected), rtol=1e-11)


@pytest.mark.parametrize("bumps", [5, 9, 12, 30])
def test_outlines_of_rough_discs_are_one_curve(bumps):
    """The large disc passes through all notches, where rounding leaves arcs of no length."""
    sizes = js.Clumps(discs=bumpy_discs(bumps, 0.5)).sample(1, np.random.default_rng(1))
    points = SHAPE.outline(sizes.diameters[0], sizes.form[0], 20 * bumps)
    longest = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).max()
    assert longest < 0.1
