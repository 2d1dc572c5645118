"""The scale at which two superellipsoids touch, against bounds, optimisers and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar
from superellipsoid_pairs import (
    EXPONENTS,
    Bodies,
    at_scale,
    contacts,
    gauge,
    in_body,
    matrix_of,
    random_bodies,
    random_pairs,
    scales,
    support,
)

from jamshape import _contact
from jamshape.contacts import find_contacts
from jamshape.landscape import Landscape, State
from jamshape.packing import Box, Packing

ROUNDING = 1e-13


def one(bodies, n):
    return bodies[n : n + 1]


class Oracle:
    """Bounds of one pair's scale by SciPy, from the definitions alone."""

    def __init__(self, i, j):
        self.r = (i.centre - j.centre)[0]
        self.bodies = [(matrix_of(b.turn)[0], b.semi_axes[0], b.p[0]) for b in (i, j)]

    def below(self, n):
        """The two scaled bodies lie on both sides of a plane with this normal."""
        return self.r @ n / sum(support(n @ turn, axes, p) for turn, axes, p in self.bodies)

    def gauges(self, y):
        both = zip((y, self.r - y), self.bodies, strict=True)
        return np.array([gauge(x @ turn, axes, p) for x, (turn, axes, p) in both])

    def above(self, y):
        """The point lies in both scaled bodies."""
        return self.gauges(y).max()

    def normal(self):
        """Maximises `below` in the plane r.n = const. by a quasi-Newton method, then a simplex."""
        base = self.r / np.linalg.norm(self.r)
        across = np.linalg.svd(base[None])[2][1:]

        def cost(u):
            return -np.log(self.below(base + u @ across))

        u = minimize(cost, np.zeros(len(across)), method="BFGS", options={"gtol": 1e-12}).x
        simplex = {"xatol": 1e-12, "fatol": 1e-15, "maxiter": 200}
        u = minimize(cost, u, method="Nelder-Mead", options=simplex).x
        return base + u @ across

    def point(self, eta):
        """Minimises t with both gauges at most t."""
        D = len(self.r)
        room = {"type": "ineq", "fun": lambda z: z[D] - self.gauges(z[:D])}
        lengths = [axes.max() for _, axes, _ in self.bodies]
        best = np.append(self.r * lengths[0] / sum(lengths), eta)
        for _ in range(2):
            best = minimize(
                lambda z: z[D], best, method="SLSQP", constraints=room,
                options={"ftol": 1e-16, "maxiter": 100},
            ).x  # fmt: skip
        return best[:D]


def check_against_oracle(i, j, measured, tolerance):
    """Both of its bounds must hold, and the closer one must be met."""
    eta = scales(i, j)["eta"]
    worst_outside, misses = 0.0, []
    for n, found in enumerate(eta):
        oracle = Oracle(one(i, n), one(j, n))
        below = oracle.below(oracle.normal())
        miss, outside = 1.0 - below / found, below / found - 1.0
        if miss > 0.1 * tolerance:
            above = oracle.above(oracle.point(found))
            miss, outside = min(miss, above / found - 1.0), max(outside, 1.0 - above / found)
        misses.append(miss)
        worst_outside = max(worst_outside, outside)
    measured(outside=worst_outside, miss=max(misses), median=float(np.median(misses)))
    assert worst_outside < 1e-13
    assert np.max(misses) < tolerance


@pytest.mark.parametrize("size", [5, pytest.param(20, marks=pytest.mark.validate)])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("p", EXPONENTS)
def test_scale_is_that_of_independent_optimisers(p, dimension, size, measured):
    rng = np.random.default_rng(round(1000 * p) + dimension)
    i, j = random_pairs(rng, size, dimension, p)
    check_against_oracle(i, j, measured, 1e-7 if p in (0.55, 10.0) else 1e-10)


@pytest.mark.parametrize("size", [10, pytest.param(30, marks=pytest.mark.validate)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_scale_of_unequal_exponents(dimension, size, measured):
    rng = np.random.default_rng(dimension)
    p_i, p_j = rng.choice(EXPONENTS, (2, size))
    i, j = random_pairs(rng, size, dimension, p_i, p_j)
    check_against_oracle(i, j, measured, 1e-7)


@pytest.mark.validate
@pytest.mark.parametrize("p", EXPONENTS)
def test_scale_of_many_pairs(p, measured):
    rng = np.random.default_rng(7)
    p_j = rng.choice(EXPONENTS, 1250)
    i, j = random_pairs(rng, 1250, 3, p, np.where(rng.random(1250) < 0.5, p, p_j))
    check_against_oracle(i, j, measured, 1e-6)


@pytest.mark.parametrize("dimension", [2, 3])
def test_bounds_hold_and_meet_over_the_whole_range(dimension, measured):
    """Every pair's normal and point, put into the definitions, bound its scale to rounding."""
    rng = np.random.default_rng(3)
    n = 20000
    i, j = random_pairs(rng, n, dimension, *np.exp(rng.uniform(np.log(0.55), np.log(10.0), (2, n))))
    found = scales(i, j)
    r, eta = i.centre - j.centre, found["eta"]
    widths = [support(in_body(found["normal"], b), b.semi_axes, b.p) for b in (i, j)]
    below = (r * found["normal"]).sum(1) / sum(widths)
    y = -found["point_i"]
    above = np.maximum(
        gauge(in_body(y, i), i.semi_axes, i.p), gauge(in_body(r - y, j), j.semi_axes, j.p)
    )
    gap = (above - below) / eta
    measured(gap=gap.max(), reported=found["gap"].max(), fallbacks=found["fallback"].sum())
    assert gap.max() < 5e-14
    assert found["gap"].max() < 2e-14
    assert np.all((below < eta * (1 + ROUNDING)) & (above > eta * (1 - ROUNDING)))


@pytest.mark.validate
def test_no_random_pair_is_left_without_bounds(measured):
    rng = np.random.default_rng(11)
    uncertain = fallbacks = 0
    for _ in range(100):
        p = np.exp(rng.uniform(np.log(0.55), np.log(10.0), (2, 10000)))
        i, j = random_pairs(rng, 10000, 3, *p)
        found = scales(i, j)
        uncertain += np.sum(~(found["gap"] < 2e-14))
        fallbacks += found["fallback"].sum()
    measured(uncertain=uncertain, fallbacks=fallbacks)
    assert uncertain <= 1


CORNERS = np.array(
    [(0.5, 0.5, 5.0), (0.1, 1.0, 1.0), (1.0, 1.0, 10.0), (0.1, 1.0, 10.0), (0.1, 0.1, 1.0)]
)


def corner_pairs(rng, n, dimension, p_i, p_j):
    """Needles, plates and both at once, far apart to nearly concentric."""
    i, j = (random_bodies(rng, n, dimension, p) for p in (p_i, p_j))
    kinds = rng.integers(len(CORNERS), size=(2, n))
    kinds[1] = np.where(rng.random(n) < 0.5, kinds[0], kinds[1])
    axes = [rng.permuted(CORNERS[kind], axis=1)[:, :dimension] for kind in kinds]
    i, j = i.replaced(semi_axes=axes[0]), j.replaced(semi_axes=axes[1])
    r = rng.normal(size=(n, dimension))
    sizes = axes[0].max(1) + axes[1].max(1)
    distance = sizes * np.exp(rng.uniform(np.log(0.05), np.log(3.0), n))
    any_length = rng.random(n) < 0.5
    r *= np.where(any_length, 1.0, distance / np.linalg.norm(r, axis=1))[:, None]
    return i.replaced(centre=j.centre + r), j


def check_bounds(i, j, measured, tolerance):
    """Rounding of points 100 times as far as a surface is near limits the bounds to 1e-13."""
    found = scales(i, j)
    r, n = i.centre - j.centre, found["normal"]
    below = (r * n).sum(1) / sum(support(in_body(n, b), b.semi_axes, b.p) for b in (i, j))
    y = -found["point_i"]
    above = np.maximum(
        gauge(in_body(y, i), i.semi_axes, i.p), gauge(in_body(r - y, j), j.semi_axes, j.p)
    )
    gap = np.maximum(found["gap"], (above - below) / found["eta"])
    measured(
        gap=gap.max(), above_1e_13=int(np.sum(~(gap < 1e-13))), fallbacks=found["fallback"].sum(),
        iterations=found["iterations"].max(),
    )  # fmt: skip
    assert np.all(gap < tolerance)


# Centre of i, quaternions, semi-axes and p of pairs that no stages by exponent lead to.
LOST = [
    ((0.588, -0.427, -1.199), (-0.184, -0.111, -0.967, -0.135), (0.1, 1.0, 10.0), 2.0,
     (0.339, 0.429, 0.459, -0.7), (0.1, 1.0, 10.0), 2.0),
    ((-0.971, -0.42, 0.603), (0.316, 0.581, 0.601, -0.449), (0.1, 1.0, 10.0), 10.0,
     (-0.383, 0.331, 0.649, -0.568), (0.1, 1.0, 10.0), 10.0),
    ((0.336, 0.53, 1.828), (-0.361, 0.634, -0.6, 0.328), (0.1, 1.0, 10.0), 5.0,
     (-0.984, 0.125, -0.128, -0.011), (0.1, 1.0, 10.0), 5.0),
    ((0.425, -0.711, 0.938), (-0.087, -0.75, 0.403, 0.517), (0.5, 0.5, 5.0), 0.55,
     (-0.521, 0.341, 0.55, -0.556), (0.5, 0.5, 5.0), 0.55),
    ((-1.214, -0.62, -0.396), (0.391, -0.468, -0.753, 0.247), (0.5, 0.5, 5.0), 2.0,
     (0.314, -0.876, -0.354, -0.094), (0.1, 1.0, 10.0), 0.55),
    ((0.429, 0.88, 0.367), (0.571, -0.282, 0.108, -0.763), (0.1, 1.0, 10.0), 0.6,
     (0.4, -0.821, 0.401, 0.076), (0.1, 1.0, 1.0), 10.0),
    ((-0.447, -1.332, -0.185), (0.122, -0.828, -0.548, 0.01), (0.1, 1.0, 10.0), 1.0,
     (-0.195, -0.796, 0.301, 0.488), (0.1, 1.0, 1.0), 5.0),
    ((0.558, -0.503, 1.568), (0.644, 0.386, 0.023, 0.66), (0.5, 0.5, 5.0), 10.0,
     (-0.579, 0.673, 0.228, 0.4), (0.1, 1.0, 10.0), 1.0),
]  # fmt: skip


def test_pairs_that_were_lost(measured):
    centre, turn_i, axes_i, p_i, turn_j, axes_j, p_j = (
        np.array(c) for c in zip(*LOST, strict=True)
    )
    turn_i, turn_j = (q / np.linalg.norm(q, axis=1)[:, None] for q in (turn_i, turn_j))
    i, j = Bodies(centre, turn_i, axes_i, p_i), Bodies(0.0 * centre, turn_j, axes_j, p_j)
    check_bounds(i, j, measured, 1e-13)
    assert np.all(contacts(at_scale(i, j, 0.9), j)["status"] == 1)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("p", EXPONENTS)
def test_bounds_meet_in_the_corner_of_the_range(p, dimension, measured):
    rng = np.random.default_rng(15)
    p_j = np.where(rng.random(4000) < 0.5, p, rng.choice(EXPONENTS, 4000))
    check_bounds(*corner_pairs(rng, 4000, dimension, p, p_j), measured, 1e-12)


@pytest.mark.validate
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("p", EXPONENTS)
def test_bounds_of_many_pairs_in_the_corner(p, dimension, measured):
    rng = np.random.default_rng(16)
    p_j = np.where(rng.random(70000) < 0.5, p, rng.choice(EXPONENTS, 70000))
    check_bounds(*corner_pairs(rng, 70000, dimension, p, p_j), measured, 1e-10)


def perram_wertheim(i, j):
    """max over w of w (1 - w) r.[(1 - w) A_i + w A_j]^-1 r (Perram & Wertheim 1985, Eq. 3.7)."""
    r = (i.centre - j.centre)[0]

    def matrix(b):
        turn = matrix_of(b.turn)[0]
        return turn @ np.diag(b.semi_axes[0] ** 2) @ turn.T

    A_i, A_j = matrix(i), matrix(j)

    def cost(w):
        return -w * (1.0 - w) * r @ np.linalg.solve((1.0 - w) * A_i + w * A_j, r)

    return np.sqrt(-minimize_scalar(cost, bounds=(0, 1), options={"xatol": 1e-10}).fun)


@pytest.mark.parametrize("dimension", [2, 3])
def test_ellipsoids_are_those_of_perram_and_wertheim(dimension, measured):
    rng = np.random.default_rng(4)
    i, j = random_pairs(rng, 300, dimension, 1.0)
    exact = np.array([perram_wertheim(one(i, n), one(j, n)) for n in range(300)])
    worst = np.abs(scales(i, j)["eta"] / exact - 1.0).max()
    measured(worst=worst)
    assert worst < 1e-12


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("beside", [np.nextafter(1.0, 0.0), np.nextafter(1.0, 2.0)])
def test_ellipsoids_have_one_path_and_one_result(dimension, beside, measured):
    """The smallest step away from p = 1 takes the path of all other exponents."""
    rng = np.random.default_rng(5)
    i, j = random_pairs(rng, 2000, dimension, 1.0)
    i = at_scale(i, j, 0.9)
    general = contacts(i.replaced(p=i.p * beside), j.replaced(p=j.p * beside))
    special = contacts(i, j)
    force = np.linalg.norm(special["force"], axis=1)
    arm = np.maximum(i.semi_axes.max(1), j.semi_axes.max(1))
    for name, size in (("force", force), ("torque_i", arm * force), ("torque_j", arm * force)):
        worst = (np.abs(general[name] - special[name]).max(1) / size).max()
        measured(**{name: worst})
        assert worst < 1e-11


@pytest.mark.parametrize("dimension", [2, 3])
def test_spheres_in_closed_form(dimension):
    rng = np.random.default_rng(6)
    i, j = random_pairs(rng, 200, dimension, 1.0)
    i = i.replaced(semi_axes=np.repeat(i.semi_axes[:, :1], dimension, 1))
    j = j.replaced(semi_axes=np.repeat(j.semi_axes[:, :1], dimension, 1))
    d = i.semi_axes[:, 0] + j.semi_axes[:, 0]
    r = i.centre - j.centre
    distance = np.linalg.norm(r, axis=1)
    np.testing.assert_allclose(scales(i, j)["eta"], distance / d, rtol=2e-15)
    found = contacts(i, j, 2.0)
    touching = distance < d
    np.testing.assert_array_equal(found["status"] == 1, touching)
    overlap = np.where(touching, 1.0 - (distance / d) ** 2, 0.0)
    np.testing.assert_allclose(found["energy"], overlap**2, rtol=1e-13)
    force = (2.0 * overlap * 2.0 / d**2)[:, None] * r
    np.testing.assert_allclose(found["force"], force, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(found["torque_i"], 0.0, atol=1e-13)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("p", EXPONENTS)
def test_aligned_copies_of_two_sizes(p, dimension):
    rng = np.random.default_rng(8)
    i = random_bodies(rng, 300, dimension, p)
    t = np.exp(rng.uniform(-2.3, 2.3, (300, 1)))
    j = i.replaced(centre=rng.normal(size=i.centre.shape), semi_axes=t * i.semi_axes)
    r = in_body(i.centre - j.centre, i)
    np.testing.assert_allclose(
        scales(i, j)["eta"], gauge(r, (1.0 + t) * i.semi_axes, i.p), rtol=1e-13
    )


@pytest.mark.parametrize(("p_i", "p_j"), [(0.75, 0.75), (1.0, 1.0), (2.0, 2.0), (0.6, 4.0)])
def test_bodies_in_a_plane_are_those_of_two_dimensions(p_i, p_j):
    """Mirror symmetry puts the point of contact into the plane, whatever the third axes."""
    rng = np.random.default_rng(9)
    i, j = random_pairs(rng, 200, 2, p_i, p_j)

    def raised(b):
        zero = np.zeros(len(b))
        half = 0.5 * b.turn[:, 0]
        turn = np.column_stack([np.cos(half), zero, zero, np.sin(half)])
        axes = np.column_stack([b.semi_axes, np.exp(rng.uniform(-1.0, 1.0, len(b)))])
        return Bodies(np.column_stack([b.centre, zero]), turn, axes, b.p)

    flat, solid = contacts(i, j), contacts(raised(i), raised(j))
    np.testing.assert_array_equal(flat["status"], solid["status"])
    np.testing.assert_allclose(flat["force"], solid["force"][:, :2], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(
        flat["torque_i"][:, 0], solid["torque_i"][:, 2], rtol=1e-9, atol=1e-10
    )
    np.testing.assert_allclose(solid["torque_i"][:, :2], 0.0, atol=1e-9)


@pytest.mark.parametrize("p", EXPONENTS)
def test_a_start_beside_the_solution_ends_in_it(p, measured):
    rng = np.random.default_rng(10)
    i, j = random_pairs(rng, 1000, 3, p)
    cold = scales(i, j)
    near = cold["normal"] + 1e-4 * rng.normal(size=cold["normal"].shape)
    warm = scales(i, j, np.ascontiguousarray(near))
    measured(cold=cold["iterations"].mean(), warm=warm["iterations"].mean())
    np.testing.assert_allclose(warm["eta"], cold["eta"], rtol=2e-14)
    anywhere = scales(i, j, rng.normal(size=(1000, 3)))
    np.testing.assert_allclose(anywhere["eta"], cold["eta"], rtol=2e-14)


def cubes(centre, angle, p=10.0):
    half = 0.5 * angle
    turn = [[np.cos(half), 0.0, np.sin(half), 0.0]]
    return Bodies(np.array([centre]), np.array(turn), np.ones((1, 3)), np.array([p]))


@pytest.mark.parametrize("p", [0.55, 2.0, 10.0])
@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-6, 1e-3])
@pytest.mark.parametrize("offset", [0.0, 1e-9, 0.1])
def test_face_on_face_and_tip_on_tip(p, tilt, offset):
    """Contacts where second derivatives vanish or diverge still have bounds, and finite forces."""
    i, j = cubes([offset, 0.3 * offset, 1.8], tilt, p), cubes([0.0, 0.0, 0.0], 0.0, p)
    found = scales(i, j)
    assert found["gap"][0] < 2e-14
    assert np.all(np.isfinite(found["normal"]))
    result = contacts(i, j)
    for name in ("energy", "force", "torque_i", "torque_j"):
        assert np.all(np.isfinite(result[name]))
    if tilt == offset == 0.0:
        assert found["eta"][0] == pytest.approx(0.9, rel=1e-15)


@pytest.mark.parametrize("p", EXPONENTS)
def test_extreme_axes_and_deep_overlaps(p, measured):
    rng = np.random.default_rng(12)
    i, j = random_pairs(rng, 2000, 3, p)
    needle, plate = np.array([10.0, 1.0, 1.0]), np.array([0.1, 1.0, 1.0])
    i = i.replaced(semi_axes=np.where(rng.random((2000, 1)) < 0.5, needle, plate))
    j = j.replaced(semi_axes=np.where(rng.random((2000, 1)) < 0.5, needle, 10.0 * plate))
    i = at_scale(i, j, 0.33)
    found, result = scales(i, j), contacts(i, j)
    measured(gap=found["gap"].max())
    np.testing.assert_allclose(found["eta"], 0.33, rtol=1e-13)
    assert found["gap"].max() < 2e-14
    assert np.all(result["status"] == 1)


@pytest.mark.parametrize("dimension", [2, 3])
def test_concentric_bodies_have_no_normal(dimension):
    rng = np.random.default_rng(13)
    i, j = random_pairs(rng, 5, dimension, 1.5)
    i = i.replaced(centre=j.centre)
    found = contacts(i, j)
    assert np.all(found["status"] == 2)
    assert not np.any(found["force"])
    with pytest.raises(ValueError, match="pair 0 have the same centre"):
        scales(i, j)
    assert np.all(_contact.superellipsoid_overlap(i.rows, j.rows))


def test_what_does_not_converge_is_no_crossing():
    """Beside p = 1/2, where faces are flat to rounding, bounds of needles stay 1e-5 apart in long doubles, too."""
    rng = np.random.default_rng(0)
    i, j = random_pairs(rng, 2, 3, 0.5 + 1e-9)
    axes = np.tile([1e-4, 1.0, 1e4], (2, 1))
    i = i.replaced(semi_axes=axes, centre=j.centre + 0.3 * rng.normal(size=(2, 3)))
    j = j.replaced(semi_axes=axes)
    found = contacts(i, j)
    lost = np.flatnonzero(found["status"] == 3)
    assert len(lost) > 0
    assert np.all(scales(i, j)["gap"][lost] >= 1e-6)
    assert not np.any(found["force"][lost])
    assert not np.any(found["status"] == 2)

    worst = np.argmax(np.minimum(scales(i, j)["gap"], scales(j, i)["gap"]))  # in either order
    i, j = one(i, worst), one(j, worst)
    packing = Packing(
        position=np.vstack([i.centre, j.centre]) - j.centre,
        orientation=np.vstack([i.turn, j.turn]),
        diameters=2.0 * axes[:2],
        species=np.ones(2, int),
        id=np.array([7, 3]),
        box=Box(np.full(3, -5e4), np.full(3, 1e5)),
        shape_style="superellipsoid",
        exponent=np.full(2, 0.5 + 1e-9),
    )
    sentence = "contact of particles (7 and 3|3 and 7) did not converge"
    with pytest.raises(ValueError, match=sentence):
        find_contacts(packing)
    with pytest.raises(ValueError, match=sentence):
        Landscape(packing).evaluate(State.of(packing), extended=False)


@pytest.mark.parametrize("factor", [1e-9, 1e9])
def test_nothing_depends_on_the_unit_of_length(factor):
    rng = np.random.default_rng(14)
    i, j = random_pairs(rng, 500, 3, *rng.choice(EXPONENTS, (2, 500)))
    i = at_scale(i, j, 0.9)

    def larger(b):
        return b.replaced(centre=factor * b.centre, semi_axes=factor * b.semi_axes)

    small, large = contacts(i, j), contacts(larger(i), larger(j))
    np.testing.assert_allclose(large["energy"], small["energy"], rtol=1e-12)
    scale = np.abs(small["force"]).max(1, keepdims=True)
    np.testing.assert_allclose(large["force"] * factor / scale, small["force"] / scale, atol=1e-9)


@pytest.mark.parametrize("p", [1.5, 2.0, 3.0, 8.0])
def test_faces_along_each_other_take_few_steps(p):
    """Their equations have a root of multiplicity 2p - 1 there."""
    tilt, shift = (a.ravel() for a in np.meshgrid([0, 1e-15, 1e-12, 1e-8], [0, 1e-8, 1e-3, 0.1]))
    ones = np.ones_like(tilt)
    i = np.stack([shift, 1.999 * ones, tilt, ones, ones, p * ones], axis=1)
    j = np.stack([0 * ones, 0 * ones, 0 * ones, ones, ones, p * ones], axis=1)
    found = _contact.superellipsoid_scales(i, j)
    # Judged by the length of steps alone, the search took hundreds of them, and its fallback.
    assert found["iterations"].max() < 50
    assert found["gap"].max() < ROUNDING
    np.testing.assert_allclose(found["eta"], 1.999 / 2, rtol=1e-4)
