"""Rounded polygons: against distances of convex sets by other methods, rods, and integrals."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from bodies_in_pairs import at_random, largest_jump, sized
from scipy.integrate import quad
from scipy.optimize import linprog
from scipy.spatial import ConvexHull
from spherocylinder_pairs import APART, CROSSING, EPS, TOUCHING

import jamshape as js
from jamshape import _contact
from jamshape.contacts import CrossingError, find_contacts
from jamshape.shapes.spheropolygon import regular_polygon
from jamshape.shapes.table import SHAPES

K_E = 1.7
SHAPE = SHAPES["spheropolygon"]


def random_polygon(rng, most=9):
    """Corners of a convex polygon of any proportions; some have sides much shorter than others."""
    n = int(rng.integers(3, most))
    points = rng.normal(size=(3 * n, 2)) * [rng.uniform(0.3, 3.0), 1.0]
    return points[ConvexHull(points).vertices]


def random_bodies(rng, n=60):
    """Diameters and forms of random polygons, among them regular ones, rods and discs."""
    corners = [random_polygon(rng) for _ in range(n)]
    corners += [regular_polygon(k) for k in (3, 4, 5, 6, 8, 12)]
    corners += [np.array([[-1.0, 0.0], [1.0, 0.0]]), np.zeros((1, 2))]
    rounding = 10.0 ** rng.uniform(-2, 0.5, len(corners))
    told = [{"corners": c, "rounding": R} for c, R in zip(corners, rounding, strict=True)]
    return sized("spheropolygon", told, rng.uniform(0.5, 2.0, len(told)))


def cores(pairs):
    """Corners of each body in space, and the radii (2M,)."""
    extent = np.array([np.abs(c).max(axis=0)[0] for c in map(corners_of, pairs.form)])
    scale = 0.5 * pairs.diameters[:, 0] / (extent + pairs.form[:, 0])
    turned = [
        centre + s * corners_of(form) @ matrix.T
        for centre, s, form, matrix in zip(
            pairs.centre, scale, pairs.form, pairs.matrices(), strict=True
        )
    ]
    return turned, scale * pairs.form[:, 0]


def corners_of(form):
    rows = form[1:].reshape(-1, 2)
    used = np.flatnonzero(rows.any(axis=1))
    return rows[: used.max() + 1] if used.size else np.zeros((1, 2))


def hull_distance(a, b):
    """Distance of two convex sets of corners: that of the origin from their Minkowski difference; negative inside."""
    points = (a[:, None] - b).reshape(-1, 2)
    if np.linalg.matrix_rank(points - points[0], 1e-9) < 2:
        return segment_from_origin(points)
    hull = ConvexHull(points)
    offset = hull.equations[:, 2]
    if (offset < 0).all():
        return float(offset.max())
    ring = points[hull.vertices]
    return min(
        segment_from_origin(np.stack(two))
        for two in zip(ring, np.roll(ring, 1, axis=0), strict=True)
    )


def segment_from_origin(points):
    """Distance of the origin from the segment that collinear points span."""
    span = points - points[0]
    along = span @ span[np.linalg.norm(span, axis=1).argmax()]
    start = points[along.argmin()]
    step = points[along.argmax()] - start
    square = step @ step
    t = np.clip(-(start @ step) / square, 0, 1) if square else 0.0
    return float(np.linalg.norm(start + t * step))


def have_common_point(a, b):
    """Whether convex hulls meet: a linear programme."""
    equal = np.block(
        [
            [a.T, -b.T],
            [np.ones((1, len(a))), np.zeros((1, len(b)))],
            [np.zeros((1, len(a))), np.ones((1, len(b)))],
        ]
    )
    found = linprog(np.zeros(len(a) + len(b)), A_eq=equal, b_eq=[0, 0, 1, 1], bounds=(0, None))
    return found.status == 0


def separation(a, b, directions=4096):
    """Largest separation of two sets along sampled directions, refined about the best one."""
    best, width = None, np.pi
    at = 0.0
    for _ in range(6):
        angle = at + np.linspace(-width, width, directions)
        n = np.column_stack([np.cos(angle), np.sin(angle)])
        gap = (a @ n.T).min(axis=0) - (b @ n.T).max(axis=0)
        best, at = float(gap.max()), float(angle[gap.argmax()])
        width *= 8 / directions
    return best


def distances(pairs):
    """Distances of cores (M,), negative where they overlap, and the sums of radii."""
    corners, radius = cores(pairs)
    found = [hull_distance(a, b) for a, b in zip(corners[::2], corners[1::2], strict=True)]
    return np.array(found), radius.reshape(-1, 2).sum(axis=1)


def pairs_of(n, seed=1, reach=(0.2, 1.0)):
    rng = np.random.default_rng(seed)
    return at_random(rng, "spheropolygon", random_bodies(rng), n, 2, reach)


# --- distances -----------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1000, pytest.param(100_000, marks=pytest.mark.validate)])
def test_contacts_are_those_of_distances_of_convex_sets(n, measured):
    pairs = pairs_of(n)
    r, d = distances(pairs)
    found = pairs.contacts(K_E, sides=1)
    expected = np.where(r < 0, CROSSING, np.where(r < d, TOUCHING, APART))
    # Within rounding of a boundary either is right.
    clear = (np.abs(r) > 1e-11) & (np.abs(r - d) > 1e-11)
    wrong = clear & (found["status"] != expected)
    assert not wrong.any(), np.flatnonzero(wrong)[:5]
    touching = clear & (expected == TOUCHING)
    energy = 0.5 * K_E * (1 - r / d) ** 2
    unit = EPS * np.linalg.norm(pairs.centre[::2], axis=1)[touching] / d[touching]
    error = np.abs(found["energy"] - energy)[touching] / (K_E * unit)
    counts = np.bincount(expected, minlength=3) / n
    measured(worst=error.max(), apart=counts[0], touching=counts[1], crossing=counts[2])
    assert error.max() < 40
    assert counts.min() > 0.1


def test_distances_agree_with_linear_programmes_and_sampled_directions():
    pairs = pairs_of(60, seed=2)
    r, _ = distances(pairs)
    corners, _ = cores(pairs)
    status = pairs.contacts(K_E, sides=1)["status"]
    for m, (a, b) in enumerate(zip(corners[::2], corners[1::2], strict=True)):
        assert have_common_point(a, b) == (r[m] < 0) == (status[m] == CROSSING)
        assert separation(a, b) == pytest.approx(r[m], abs=1e-9)


def test_energies_are_the_largest_of_two_sides(measured):
    """With two bonds: each side as a rod of its own, by the code of rods."""
    pairs = pairs_of(600, seed=3, reach=(0.4, 1.0))
    corners, radius = cores(pairs)
    found = pairs.contacts(K_E, sides=2)
    worst, several = 0.0, 0
    for m in np.flatnonzero(found["status"] == TOUCHING):
        rows = []
        for which in (2 * m, 2 * m + 1):
            ring = corners[which]
            sides = list(zip(ring, np.roll(ring, -1, axis=0), strict=True))[
                : 1 if len(ring) < 3 else None
            ]
            rows.append([rod(*side, radius[which]) for side in sides])
        i = np.repeat(rows[0], len(rows[1]), axis=0)
        j = np.tile(rows[1], (len(rows[0]), 1))
        rods = _contact.spherocylinder_contacts(i, j, K_E, 2)
        best = int(rods["energy"].argmax())
        worst = max(worst, abs(found["energy"][m] - rods["energy"][best]) / K_E)
        several += found["n_bonds"][m] == 2
        np.testing.assert_allclose(found["energy"][m], rods["energy"][best], rtol=1e-9, atol=1e-14)
    measured(worst=worst, two_bonds=several)
    assert several > 20


def rod(start, end, radius):
    length = np.linalg.norm(end - start)
    along = (end - start) / length if length else np.array([1.0, 0.0])
    return np.array([*(start + end) / 2, *along, length / 2, radius])


@pytest.mark.parametrize("sides", [1, 2])
def test_energies_do_not_jump_along_paths(sides, measured):
    pairs = pairs_of(300, seed=4, reach=(0.3, 1.0))
    worst = largest_jump(pairs, sides=sides)
    measured(worst=worst)
    assert worst < 1


def test_near_and_overlapping_are_gaps():
    pairs = pairs_of(500, seed=5, reach=(0.2, 1.4))
    r, d = distances(pairs)
    gap = np.maximum(r, 0) - d
    clear = np.abs(gap) > 1e-11
    assert np.array_equal(pairs.overlaps()[clear], (gap < 0)[clear])
    for margin in (0.0, 0.4):
        clear = np.abs(gap - margin) > 1e-11
        assert np.array_equal(pairs.near(margin)[clear], (gap < margin)[clear])


@pytest.mark.parametrize("sides", [1, 2])
def test_swapped_bodies_feel_the_opposite(sides):
    pairs = pairs_of(800, seed=6, reach=(0.4, 1.0))
    order = np.arange(2 * len(pairs)).reshape(-1, 2)[:, ::-1].ravel()
    fields = ("diameters", "form", "centre", "turn")
    swapped = dataclasses.replace(pairs, **{name: getattr(pairs, name)[order] for name in fields})
    one, other = pairs.contacts(K_E, sides), swapped.contacts(K_E, sides)
    assert np.array_equal(one["status"], other["status"])
    # An overlap of 1e-12 is rounding, which counts a bond or not.
    closed, others = ((x["bond_energy"] > 1e-24 * K_E).sum(axis=1) for x in (one, other))
    assert np.array_equal(closed, others)
    size = np.abs(one["force"]).max(axis=1, initial=0)[:, None] + 1e-300
    for name, opposite, sign in (("force", "force", -1), ("torque_i", "torque_j", 1)):
        a, b = (x.reshape(len(pairs), -1) for x in (one[name], sign * other[opposite]))
        assert (np.abs(a - b) / size).max() < 1e-9
    np.testing.assert_allclose(one["energy"], other["energy"], rtol=1e-10, atol=1e-16)


# --- limits --------------------------------------------------------------------------------------


@pytest.mark.parametrize("sides", [1, 2])
def test_two_corners_are_a_rod_and_one_is_a_disc(sides, measured):
    rng = np.random.default_rng(7)
    half = np.append(10.0 ** rng.uniform(-1, 1, 20), 0.0)
    told = [{"corners": [[-a, 0], [a, 0]] if a else [[0, 0]], "rounding": 0.5} for a in half]
    pairs = at_random(
        rng, "spheropolygon", sized("spheropolygon", told, np.ones(21)), 3000, 2, (0.1, 1.0)
    )
    found = pairs.contacts(K_E, sides)
    nothing = np.empty((len(pairs.form), 0))
    rods = dataclasses.replace(pairs, shape="spherocylinder", form=nothing).contacts(K_E, sides)
    assert np.array_equal(found["status"], rods["status"])
    assert np.array_equal(found["n_bonds"], rods["n_bonds"])
    assert np.array_equal(found["kind"], rods["kind"])
    extent = pairs.compiled().outer_radius.reshape(-1, 2).sum(axis=1)
    unit = K_E * EPS * extent  # what an overlap rounds; d is 1
    touching = found["status"] == TOUCHING
    distance = np.where(
        touching, found["bond_distance"][:, 0], 1.0
    )  # what a direction is relative to
    units = {"energy": unit, "force": unit / distance} | dict.fromkeys(
        ("torque_i", "torque_j"), unit * extent / distance
    )
    worst = {
        name: float(
            (np.abs(found[name] - rods[name]).reshape(len(pairs), -1).max(axis=1) / by).max()
        )
        for name, by in units.items()
    }
    measured(**worst)
    assert max(worst.values()) < 8
    assert 0.2 < touching.mean() < 0.9
    one = pairs.compiled()
    other = dataclasses.replace(pairs, shape="spherocylinder", form=nothing).compiled()
    np.testing.assert_allclose(one.measure, other.measure, rtol=1e-13)
    np.testing.assert_allclose(one.moment, other.moment, rtol=1e-12)
    for name in ("outer_radius", "inner_radius", "rotation_length", "symmetry_axis", "director"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-13)


def contact_distance(pairs):
    """Distance (M,) of the centres at which hard bodies first touch, along the lines between them, by bisection."""
    direction = pairs.centre[::2] / np.linalg.norm(pairs.centre[::2], axis=1, keepdims=True)
    outer = pairs.compiled().outer_radius.reshape(-1, 2).sum(axis=1)
    low, high = np.zeros(len(pairs)), outer
    for _ in range(40):
        middle = 0.5 * (low + high)
        there = pairs.centre.copy()
        there[::2] = middle[:, None] * direction
        inside = dataclasses.replace(pairs, centre=there).overlaps()
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return 0.5 * (low + high)


@pytest.mark.parametrize("rounding", [1e-2, 1e-3])
@pytest.mark.parametrize("p", [5.0, 10.0])
def test_squares_with_small_rounding_lie_beside_superellipses(p, rounding, measured):
    """Contact distances are bounded by those of the squares inside and around both bodies.

    A superellipse of semi-axes 1 holds the square scaled by 2^(-1/2p), and a rounded square that
    scaled by 1 - (1 - 2^(-1/2)) R, if both fit into the square of side 2.
    """
    rng = np.random.default_rng(8)
    R = 2 * rounding
    square = {"corners": (1 - R) * 2 * regular_polygon(4), "rounding": R}
    rounded = at_random(
        rng, "spheropolygon", sized("spheropolygon", [square], [1.0]), 500, 2, (0.9, 1.0)
    )
    of_square = contact_distance(rounded)
    n = len(rounded.form)
    other = dataclasses.replace(
        rounded, shape="superellipsoid", diameters=np.full((n, 3), 2.0), form=np.full((n, 1), p)
    )
    ratio = contact_distance(other) / of_square
    low, high = 2 ** (-0.5 / p), 1 / (1 - (1 - 0.5**0.5) * R)
    measured(least=ratio.min(), most=ratio.max(), low=low, high=high)
    assert low - 1e-9 <= ratio.min() < ratio.max() <= high + 1e-9
    # And the bounds are reached: corners against sides, and sides against sides.
    assert ratio.min() < 0.5 * (1 + low)
    assert ratio.max() > 1 - 5e-3


# --- area and moments ----------------------------------------------------------------------------


def test_area_and_centre_have_a_closed_form(measured):
    rng = np.random.default_rng(9)
    worst = 0.0
    for _ in range(50):
        corners, R = random_polygon(rng) + rng.normal(size=2), rng.uniform(0.01, 2)
        after = np.roll(corners, -1, axis=0)
        crossed = corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]
        around = np.linalg.norm(after - corners, axis=1).sum()
        area = 0.5 * crossed.sum() + around * R + np.pi * R * R
        found = _contact.polygon_moments(R, np.ascontiguousarray(corners))
        worst = max(worst, abs(found[0] / area - 1))
    measured(worst=worst)
    assert worst < 1e-13


def test_moments_are_integrals_over_sections(measured):
    """Integrals over x of the height of the body: the largest of all corners' circles and sides moved outwards."""
    rng = np.random.default_rng(10)
    worst = 0.0
    for _ in range(6):
        corners, R = random_polygon(rng), rng.uniform(0.1, 1)
        after = np.roll(corners, -1, axis=0)
        step = after - corners
        out = R * np.column_stack([step[:, 1], -step[:, 0]]) / np.linalg.norm(step, axis=1)[:, None]

        def height(x, sign, corners=corners, R=R, out=out, after=after):
            found = [
                sign * at[1] + np.sqrt(R * R - (x - at[0]) ** 2)
                for at in corners
                if abs(x - at[0]) <= R
            ]
            for a, b in zip(corners + out, after + out, strict=True):
                if (x - a[0]) * (x - b[0]) <= 0 and a[0] != b[0]:
                    found.append(sign * (a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0])))
            return max(found)

        low, high = corners[:, 0].min() - R, corners[:, 0].max() + R
        breaks = np.unique([*(corners + out)[:, 0], *(after + out)[:, 0], low, high])

        def integral(weight, breaks=breaks, height=height):
            total = 0.0
            for a, b in itertools.pairwise(breaks):
                middle, half = 0.5 * (a + b), 0.5 * (b - a)

                def at(t, middle=middle, half=half):
                    x = middle + half * np.sin(t)
                    return weight(x, -height(x, -1), height(x, 1)) * half * np.cos(t)

                total += quad(at, -np.pi / 2, np.pi / 2, epsabs=1e-13, epsrel=1e-12)[0]
            return total

        expected = [
            integral(lambda x, lo, hi, k=k, m=m: x**k * (hi ** (m + 1) - lo ** (m + 1)) / (m + 1))
            for k, m in ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1))
        ]
        found = _contact.polygon_moments(R, np.ascontiguousarray(corners))[[0, 1, 2, 4, 5, 7]]
        worst = max(worst, float(np.abs(found - expected).max() / max(expected[3:5])))
    measured(worst=worst)
    assert worst < 1e-10


def test_the_outline_encloses_the_area():
    rng = np.random.default_rng(11)
    diameters, form = random_bodies(rng, 10)
    area = SHAPE.compiled((diameters, form), 2, js.Interaction()).measure
    for d, f, expected in zip(diameters, form, area, strict=True):
        x, y = SHAPE.outline(d, f, 4000).T
        found = 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
        assert found == pytest.approx(expected, rel=1e-5)


# --- input ---------------------------------------------------------------------------------------


def test_moved_and_rotated_corners_give_the_same_body():
    rng = np.random.default_rng(12)
    corners = random_polygon(rng)
    angle = 0.3
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    bodies = [
        js.Spheropolygons(corners=given, rounding=0.2).sample(2, rng)
        for given in (
            corners,
            corners + np.array([3.0, -1.0]),
            corners[::-1],
            corners @ turn.T - 2.0,
        )
    ]
    for body in bodies:
        shape = SHAPE.compiled((body.diameters, body.form), 2, js.Interaction())
        other = SHAPE.compiled((bodies[0].diameters, bodies[0].form), 2, js.Interaction())
        np.testing.assert_allclose(shape.measure, other.measure, rtol=1e-12)
        # The frame may differ by quarter turns.
        np.testing.assert_allclose(np.sort(shape.moment), np.sort(other.moment), rtol=1e-10)
        np.testing.assert_allclose(
            np.sort(np.linalg.norm(body.form[0, 1:].reshape(-1, 2), axis=1)),
            np.sort(np.linalg.norm(bodies[0].form[0, 1:].reshape(-1, 2), axis=1)),
            rtol=1e-10,
        )


def test_text_files_and_arrays_are_one_input(tmp_path):
    rows = [[0, 0], [2, 0], [0, 1]]
    path = tmp_path / "corners.txt"
    path.write_text("# a triangle\n0 0\n2 0   # along x\n\n0 1\n")
    found = [
        js.Spheropolygons(corners=given, rounding=0.2).told["corners"]
        for given in (rows, np.array(rows), "0 0/2 0/0 1", str(path))
    ]
    assert len(set(found)) == 1
    again = js.Spheropolygons(corners=found[0], rounding=0.2).told["corners"]
    np.testing.assert_allclose(
        np.fromstring(again.replace("/", " "), sep=" "),
        np.fromstring(found[0].replace("/", " "), sep=" "),
        atol=1e-12,
    )


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        ([[0, 0], [1, 0], [1, 1], [0.9, 0.1]], "convex"),
        ([[0, 0], [1, 0], [2, 0]], "1 0 on a line with its neighbours, .* leave it out"),
        (
            [[0, 0], [1, 0], [1, 0.5], [1, 1]],
            "1 0.5 on a line with its neighbours, .* leave it out",
        ),
        ([[0, 0], [0, 0], [1, 1]], "0 0 twice in a row, expected each corner once"),
        ([[0, 1], [1, 1], [1, 0], [0, 1]], "0 1 twice in a row, .* the last of a closed ring"),
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0]], "x y of each corner"),
        ("0 0/1 x", "x y of each corner"),
        ("no_such_file.txt", "x y of each corner"),
        ([[0, np.nan], [1, 0], [1, 1]], "x y of each corner"),
    ],
)
def test_other_corners_are_refused_in_a_sentence(corners, message):
    with pytest.raises(ValueError, match=message) as error:
        js.Spheropolygons(corners=corners)
    assert "expected" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("n", [-1, 2, 256])
def test_regular_polygons_have_three_corners_or_more(n):
    with pytest.raises(
        ValueError, match=f"n is {n}, expected a whole number of corners from 3 to 255"
    ):
        regular_polygon(n)


@pytest.mark.parametrize("rounding", [0.0, -1.0, np.inf, np.nan])
def test_other_rounding_radii_are_refused(rounding):
    with pytest.raises(ValueError, match="rounding"):
        js.Spheropolygons(rounding=rounding)


def test_polygons_do_not_live_in_space():
    with pytest.raises(ValueError, match="2"):
        js.make_packing(js.Spheropolygons(), n=4, dimension=3, progress=False)
    with pytest.raises(ValueError, match="not a valid shape"):
        _contact.Spheropolygons(np.full((1, 3), 1.2), np.array([[0.1, 0.0, 0.0]]), 3, 1.0, 2)


def test_overlapping_cores_are_refused():
    packing = js.Packing.of(
        "spheropolygon",
        position=[[2, 2], [2.6, 2.3]],
        orientation=[0, 0.4],
        corners=regular_polygon(4),
        rounding=0.1,
        box=js.Box(lo=[0, 0], edges=[9, 9]),
    )
    with pytest.raises(CrossingError, match="cores"):
        find_contacts(packing)


def test_forms_of_different_lengths_mix():
    mixture = js.Spheropolygons(
        corners=[regular_polygon(3), regular_polygon(6), "0 0"], rounding=[0.1, 0.2, 0.3]
    )
    sizes = mixture.sample(6, np.random.default_rng(1))
    assert sizes.form.shape == (6, 13)
    shape = SHAPE.compiled((sizes.diameters, sizes.form), 2, js.Interaction())
    expected = [k / 4 / np.tan(np.pi / k) + k * R + np.pi * R * R for k, R in ((3, 0.1), (6, 0.2))]
    np.testing.assert_allclose(
        np.unique(shape.measure.round(12)), sorted([*expected, np.pi * 0.09]), rtol=1e-11
    )
    assert "kinds" in mixture.told


def test_rounding_radii_may_differ_from_particle_to_particle():
    rounding = [0.1, 0.3, 0.1]
    packing = js.Packing.of(
        "spheropolygon",
        position=[[1, 1], [4, 4], [7, 7]],
        orientation=[0, 0, 0],
        corners=regular_polygon(4),
        rounding=rounding,
        box=[9, 9],
    )
    np.testing.assert_array_equal(packing.form[:, 0], rounding)
    area = [1 + 4 * R + np.pi * R * R for R in rounding]
    np.testing.assert_allclose(packing.compiled().measure, area, rtol=1e-13)
