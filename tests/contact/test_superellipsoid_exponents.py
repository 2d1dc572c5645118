"""Superellipsoids with two exponents, (|x/a|^n2 + |y/b|^n2)^(n1/n2) + |z/c|^n1 = 1, from the definition alone.

Every pair's normal and point, put into the definition, bound the scale at which it touches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize
from superellipsoid_pairs import Bodies, in_body, matrix_of, power_norm, random_pairs

from jamshape import _contact
from jamshape.shapes.roundness import surface_area, volume
from jamshape.shapes.superellipsoid_surface import surface_mesh

LEAST, MOST = 1.1, 20.0
RANGES = {  # of n1 and n2, by which of the norms of a body is smooth
    "gauge": ((2, MOST), (2, MOST)),
    "support": ((LEAST, 2), (LEAST, 2)),
    "neither, across by normal": ((2, MOST), (LEAST, 2)),
    "neither, across by point": ((LEAST, 2), (2, MOST)),
    "any": ((LEAST, MOST), (LEAST, MOST)),
}
EXTREMES = [(20, 1.1), (1.1, 20), (20, 20), (1.1, 1.1), (20, 2), (2, 20), (2, 1.1), (1.1, 2)]


@dataclass
class Pairs:
    """M pairs: poses and semi-axes, and (M, 2) exponents of each body."""

    i: Bodies
    j: Bodies
    n_i: np.ndarray
    n_j: np.ndarray

    @property
    def rows(self):
        return tuple(
            np.ascontiguousarray(np.hstack([b.centre, b.turn, b.semi_axes, n]))
            for b, n in ((self.i, self.n_i), (self.j, self.n_j))
        )

    def at_scale(self, eta):
        found = _contact.superellipsoid_scales(*self.rows)["eta"]
        r = self.i.centre - self.j.centre
        moved = self.i.replaced(centre=self.j.centre + (eta / found)[:, None] * r)
        return Pairs(moved, self.j, self.n_i, self.n_j)

    def contacts(self, **options):
        return _contact.superellipsoid_contacts(*self.rows, 1.0, **options)


def nested_norm(x, n):
    """Norm of (M, 3) vectors: of z, and of the norm of x and y."""
    with np.errstate(invalid="ignore"):
        across = np.nan_to_num(power_norm(np.abs(x[:, :2]), n[:, 1]))
    return power_norm(np.column_stack([across, np.abs(x[:, 2])]), n[:, 0])


def gauge(x, axes, n):
    return nested_norm(x / axes, n)


def support(v, axes, n):
    return nested_norm(v * axes, n / (n - 1))


def random_exponents(rng, ranges, size):
    return np.column_stack([np.exp(rng.uniform(*np.log(ends), size)) for ends in ranges])


def random_of(seed, size, ranges_i, ranges_j):
    rng = np.random.default_rng(seed)
    i, j = random_pairs(rng, size, 3, 1.0)
    return Pairs(i, j, *(random_exponents(rng, r, size) for r in (ranges_i, ranges_j)))


def bounds(pairs, normal, y):
    """Bounds of the scale by planes with a normal, and by points y from the centre of i, (M,) each."""
    i, j, r = pairs.i, pairs.j, pairs.i.centre - pairs.j.centre
    widths = support(in_body(normal, i), i.semi_axes, pairs.n_i)
    widths = widths + support(in_body(normal, j), j.semi_axes, pairs.n_j)
    reach = gauge(in_body(y, i), i.semi_axes, pairs.n_i)
    return (r * normal).sum(1) / widths, np.maximum(
        reach, gauge(in_body(r - y, j), j.semi_axes, pairs.n_j)
    )


def check_bounds(pairs, measured):
    found = _contact.superellipsoid_scales(*pairs.rows)
    below, above = bounds(pairs, found["normal"], -found["point_i"])
    gap = (above - below) / found["eta"]
    measured(gap=gap.max(), stated=found["gap"].max(), fallbacks=found["fallback"].sum(),
             extended=found["extended"].sum(), iterations=found["iterations"].max())  # fmt: skip
    assert gap.max() < 5e-14
    assert found["gap"].max() < 2e-14
    assert np.all((below < found["eta"] * (1 + 1e-13)) & (above > found["eta"] * (1 - 1e-13)))


@pytest.mark.parametrize("of_i", RANGES)
def test_bounds_meet_over_the_whole_range(of_i, measured):
    for seed, of_j in enumerate(RANGES):
        check_bounds(random_of(seed, 1500, RANGES[of_i], RANGES[of_j]), measured)


@pytest.mark.parametrize("n", EXTREMES)
def test_bounds_meet_at_the_ends_of_the_range(n, measured):
    fixed = tuple((x, x) for x in n)
    check_bounds(random_of(1, 4000, fixed, fixed), measured)


@pytest.mark.parametrize("of_i", list(RANGES)[2:])
def test_bounds_meet_of_needles_and_plates(of_i, measured):
    pairs = random_of(2, 3000, RANGES[of_i], RANGES["any"])
    rng = np.random.default_rng(3)
    shapes = np.array([(0.1, 1, 10), (0.1, 1, 1), (1, 1, 10), (0.5, 0.5, 5)])
    axes = [rng.permuted(shapes[rng.integers(4, size=3000)], axis=1) for _ in range(2)]
    i, j = pairs.i.replaced(semi_axes=axes[0]), pairs.j.replaced(semi_axes=axes[1])
    pairs = Pairs(i, j, pairs.n_i, pairs.n_j)
    found = _contact.superellipsoid_scales(*pairs.rows)
    below, above = bounds(pairs, found["normal"], -found["point_i"])
    gap = np.maximum((above - below) / found["eta"], found["gap"])
    measured(gap=gap.max(), fallbacks=found["fallback"].sum(), extended=found["extended"].sum())
    assert np.all(gap < 1e-12)


@pytest.mark.parametrize("size", [1, pytest.param(10, marks=pytest.mark.validate)])
@pytest.mark.parametrize("of_i", RANGES)
def test_scale_is_that_of_an_independent_optimiser(of_i, size, measured):
    """A simplex, from the line of centres, cannot end above the largest lower bound nor far below it."""
    pairs = random_of(5, size, RANGES[of_i], RANGES["any"])
    found = _contact.superellipsoid_scales(*pairs.rows)
    misses = []
    for k, eta in enumerate(found["eta"]):
        bodies = (pairs.i[k : k + 1], pairs.j[k : k + 1])
        one = Pairs(*bodies, pairs.n_i[k : k + 1], pairs.n_j[k : k + 1])
        r = (one.i.centre - one.j.centre)[0]
        base, across = r / np.linalg.norm(r), np.linalg.svd(r[None])[2][1:]

        def cost(u, one=one, base=base, across=across):
            return -bounds(one, (base + u @ across)[None], np.ones((1, 3)))[0][0]

        options = {"xatol": 1e-11, "fatol": 1e-14, "maxiter": 2000}
        u = np.zeros(2)
        for _ in range(3):
            u = minimize(cost, u, method="Nelder-Mead", options=options).x
        misses.append(1 + cost(u) / eta)
    measured(miss=max(misses), outside=-min(misses))
    assert min(misses) > -1e-13
    assert max(misses) < 1e-8


@pytest.mark.parametrize("p", [0.55, 0.8, 1.0, 1.5, 2.3, 10.0])
def test_equal_exponents_are_p_to_the_last_bit(p):
    pairs = random_of(7, 500, ((2 * p, 2 * p),) * 2, ((2 * p, 2 * p),) * 2)
    of_p = pairs.i.replaced(p=np.full(500, p)), pairs.j.replaced(p=np.full(500, p))
    two, one = pairs.rows, [b.rows for b in of_p]
    two[0][:, -2:] = two[1][:, -2:] = 2 * p
    for function in (
        _contact.superellipsoid_scales,
        lambda i, j: _contact.superellipsoid_contacts(i, j, 1.0),
    ):
        for name, values in function(*one).items():
            np.testing.assert_array_equal(values, function(*two)[name], err_msg=name)


def along_axes(n_i, n_j, axis, size=8):
    """Bodies one behind the other along one of their axes."""
    rng = np.random.default_rng(8)
    still = np.tile([1.0, 0, 0, 0], (size, 1))
    axes = rng.uniform(0.5, 2, (2, size, 3))
    centre = np.zeros((2, size, 3))
    centre[0, :, axis] = 3.0
    i, j = (Bodies(c, still, a, np.ones(size)) for c, a in zip(centre, axes, strict=True))
    return Pairs(i, j, np.tile(n_i, (size, 1)), np.tile(n_j, (size, 1)))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("n", EXTREMES)
def test_bodies_along_an_axis_touch_at_its_ends(n, axis):
    """Face on face, tip on tip, and where neither norm is smooth."""
    for other in ((5.0, 1.5), (1.5, 5.0), n):
        pairs = along_axes(n, other, axis)
        found = _contact.superellipsoid_scales(*pairs.rows)
        reach = (pairs.i.semi_axes + pairs.j.semi_axes)[:, axis]
        np.testing.assert_allclose(found["eta"], 3.0 / reach, rtol=1e-13)
        assert np.abs(found["normal"][:, axis]) == pytest.approx(1, abs=1e-12)


def test_two_and_two_are_spheres():
    rng = np.random.default_rng(9)
    i, j = random_pairs(rng, 300, 3, 1.0)
    R = rng.uniform(0.2, 2, (2, 300, 1)) * np.ones(3)
    n = np.full((300, 2), 2.0)
    pairs = Pairs(i.replaced(semi_axes=R[0]), j.replaced(semi_axes=R[1]), n, n).at_scale(0.9)
    found = pairs.contacts()
    np.testing.assert_allclose(found["energy"], 0.5 * (1 - 0.81) ** 2, rtol=1e-12)
    assert np.abs(found["torque_i"]).max() < 1e-15


@pytest.mark.parametrize("of_i", RANGES)
def test_round_sections_make_z_an_axis_of_symmetry(of_i):
    """Turned about z by any angle, the body is the same."""
    ranges = (RANGES[of_i][0], (2.0, 2.0))
    pairs = random_of(10, 300, ranges, RANGES["any"])
    axes = pairs.i.semi_axes.copy()
    axes[:, 1] = axes[:, 0]
    pairs = Pairs(pairs.i.replaced(semi_axes=axes), pairs.j, pairs.n_i, pairs.n_j)
    angle = np.random.default_rng(11).uniform(-3, 3, 300)
    own = np.column_stack([np.cos(angle / 2), 0 * angle, 0 * angle, np.sin(angle / 2)])
    turned = Pairs(
        pairs.i.replaced(turn=_product(pairs.i.turn, own)), pairs.j, pairs.n_i, pairs.n_j
    )
    one, other = (_contact.superellipsoid_scales(*x.rows)["eta"] for x in (pairs, turned))
    np.testing.assert_allclose(one, other, rtol=2e-13)
    shape = _contact.Superellipsoids(2 * axes[:1], pairs.n_i[:1], 3, 1.0, 1)
    assert shape.symmetry_axis == shape.director == 2


def _product(p, q):
    scalar = p[:, 0] * q[:, 0] - (p[:, 1:] * q[:, 1:]).sum(axis=1)
    vector = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
    return np.column_stack([scalar, vector])


@pytest.mark.parametrize("of_i", RANGES)
def test_exchange_of_i_and_j(of_i):
    pairs = random_of(12, 500, RANGES[of_i], RANGES["any"]).at_scale(0.9)
    there = pairs.contacts()
    back = Pairs(pairs.j, pairs.i, pairs.n_j, pairs.n_i).contacts()
    np.testing.assert_allclose(there["energy"], back["energy"], rtol=1e-11)
    for a, b, sign in (("force", "force", -1), ("torque_i", "torque_j", 1)):
        size = np.abs(there[a]).max(1, keepdims=True)
        np.testing.assert_allclose(there[a] / size, sign * back[b] / size, atol=1e-8)


@pytest.mark.parametrize("of_i", RANGES)
def test_force_and_torque_are_the_gradient(of_i, measured):
    """By differences of fourth order; steps that cross a flat or sharp place of a body have larger errors."""
    pairs = random_of(13, 300, RANGES[of_i], RANGES["any"]).at_scale(0.9)
    found, h = pairs.contacts(), 1e-4

    def slope(moved):
        u = [moved(k * h).contacts()["energy"] for k in (-2, -1, 1, 2)]
        return (u[0] - 8 * u[1] + 8 * u[2] - u[3]) / (12 * h)

    def shifted(axis):
        return lambda step: Pairs(pairs.i.shifted(axis, step), pairs.j, pairs.n_i, pairs.n_j)

    def turned(axis, which):
        bodies = [pairs.i, pairs.j]

        def moved(angle):
            both = list(bodies)
            both[which] = both[which].turned(axis, angle)
            return Pairs(*both, pairs.n_i, pairs.n_j)

        return moved

    off = []
    for axis in range(3):
        for name, moved in (
            ("force", shifted(axis)),
            ("torque_i", turned(axis, 0)),
            ("torque_j", turned(axis, 1)),
        ):
            size = np.abs(found[name]).max(1) + np.abs(found["force"]).max(1)
            off.append(np.abs(found[name][:, axis] + slope(moved)) / size)
    off = np.max(off, axis=0)
    measured(median=np.median(off), worst=off.max())
    assert np.median(off) < 1e-8
    assert np.mean(off < 1e-4) > 0.97


def section(n):
    """Area of |x|^n + |y|^n < 1 and the mean of x^2, by quadrature."""

    def over(power):
        return 4 * quad(lambda x: x**power * (1 - x**n) ** (1 / n), 0, 1, epsabs=1e-13)[0]

    return over(0), over(2) / over(0)


@pytest.mark.parametrize("n", [(5.0, 1.6), (1.5, 6.0), (20.0, 2.0), (3.0, 3.0), (1.2, 1.7)])
def test_volume_and_moments_are_those_of_quadratures(n):
    axes = np.array([0.7, 1.1, 1.6])
    area, mean = section(n[1])

    def over(power, size):
        def slice_of(z):
            return z**power * (1 - z ** n[0]) ** (size / n[0])

        return 2 * quad(slice_of, 0, 1, epsabs=1e-13)[0]

    expected = axes.prod() * area * over(0, 2)
    assert float(volume(axes, n[0] / 2, n[1] / 2)) == pytest.approx(expected, rel=1e-9)
    shape = _contact.Superellipsoids(2 * axes[None], np.array([n]), 3, 1.0, 1)
    assert shape.measure[0] == pytest.approx(expected, rel=1e-9)
    x, y = (mean * over(0, 4) / over(0, 2) * a**2 for a in axes[:2])
    z = over(2, 2) / over(0, 2) * axes[2] ** 2
    np.testing.assert_allclose(shape.moment[0], [y + z, x + z, x + y], rtol=1e-9)


@pytest.mark.parametrize("n", [(5.0, 1.6), (1.5, 6.0), (20.0, 2.0), (8.0, 4.0)])
def test_meshes_converge_to_the_body(n):
    axes = np.array([0.7, 1.1, 1.6])
    mesh = surface_mesh(axes, n[0] / 2, 4, n[1] / 2)
    row = np.tile(n, (len(mesh.vertices), 1))
    np.testing.assert_allclose(gauge(mesh.vertices, axes, row), 1, rtol=1e-12)
    corner = mesh.vertices[mesh.triangles]
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    inside = (area * corner.mean(axis=1)).sum() / 6 / float(volume(axes, n[0] / 2, n[1] / 2))
    of_surface = surface_area(axes, n[0] / 2, n[1] / 2)
    around = np.linalg.norm(area, axis=1).sum() / 2 / float(of_surface.area)
    assert 0.995 < inside < 1 + 1e-12
    assert 0.995 < around < 1.0005
    assert of_surface.error < 1e-12 * of_surface.area
    shape = _contact.Superellipsoids(2 * axes[None], np.array([n]), 3, 1.0, 1)
    farthest = np.linalg.norm(mesh.vertices, axis=1).max()
    assert farthest <= shape.outer_radius[0] * (1 + 1e-12)
    assert farthest > 0.999 * shape.outer_radius[0]


def test_only_sections_count_in_the_plane():
    diameters, form = np.array([[2.0, 3, 4]]), np.array([[7.0, 3.0]])
    two = _contact.Superellipsoids(diameters, form, 2, 1.0, 1)
    one = _contact.Superellipsoids(diameters, np.array([1.5]), 2, 1.0, 1)
    assert two.measure == one.measure
    assert two.outer_radius == one.outer_radius


@pytest.mark.parametrize("n", [(1.0, 3.0), (3.0, 0.9), (np.inf, 3.0), (3.0, np.nan)])
def test_bodies_that_are_not_convex_are_refused(n):
    with pytest.raises(ValueError, match="two exponents n1 n2 above 1"):
        _contact.Superellipsoids(np.ones((1, 3)), np.array([n]), 3, 1.0, 1)


def nearly_aligned(seed, size, ranges_i, ranges_j):
    """Faces, edges and tips on each other, with tilts and offsets down to rounding, and overlaps from 1e-10."""
    pairs = random_of(seed, size, ranges_i, ranges_j)
    rng = np.random.default_rng(seed)
    tilt = 10.0 ** rng.uniform(-13, -1, (size, 1)) * (rng.random((size, 1)) < 0.7)
    turn = pairs.j.turn + tilt * rng.normal(size=(size, 4))
    aligned = turn / np.linalg.norm(turn, axis=1)[:, None]
    turn = np.where(rng.random((size, 1)) < 0.7, aligned, pairs.i.turn)
    at = matrix_of(pairs.j.turn)[np.arange(size), :, rng.integers(3, size=size)]
    beside = 10.0 ** rng.uniform(-12, 0, (size, 1)) * (rng.random((size, 1)) < 0.5)
    at = at + beside * rng.normal(size=(size, 3))
    i, j = pairs.i.replaced(centre=at, turn=turn), pairs.j.replaced(centre=0 * pairs.j.centre)
    overlap = 10.0 ** rng.uniform(-10, -2, size)
    return Pairs(i, j, pairs.n_i, pairs.n_j).at_scale(np.sqrt(1 - overlap))


@pytest.mark.parametrize("size", [10, pytest.param(60, marks=pytest.mark.validate)])
@pytest.mark.parametrize("of_i", RANGES)
def test_energy_force_and_torque_are_within_their_errors(of_i, size, study, measured):
    """Against a solution in 33 digits."""
    script, reference = study
    pairs = nearly_aligned(3, size, RANGES[of_i], RANGES["any"])
    assert np.all(pairs.contacts()["status"] == 1)
    found = script.measured(reference, script.Couples(*pairs.rows))
    for name, of in found.items():
        for k, quantity in enumerate(script.NAMES):
            measured(**{f"{name} {quantity}": of.error[:, k].max()})
        assert not of.beyond.any()
        assert np.isfinite(of.stated).all()
    assert np.all(np.median(found["double"].stated, axis=0) < 1e-8)
