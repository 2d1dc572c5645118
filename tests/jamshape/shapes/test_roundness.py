import numpy as np
import pytest

from jamshape.shapes.roundness import (
    asphericity,
    axes_from,
    reduced_aspect_ratio,
    surface_area,
    volume,
)
from jamshape.shapes.shape import Interaction
from jamshape.shapes.table import shape_named

SHAPES = [(1, 1, 1), (0.3, 1, 1), (0.7, 1, 2)]
EXTREMES = [(0.1, 1, 1), (1, 1, 10), (0.1, 1, 10)]


def directions(theta, phi):
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    x = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    return np.abs(np.stack(x, axis=-1))


def area_over_directions(axes, p, n):
    """Integrate over directions from the centre of the body before it is stretched to its axes.

    By Gauss-Legendre rules crowded at the planes of symmetry.
    """
    x, w = np.polynomial.legendre.leggauss(n)
    s = (x + 1) / 2
    angle, weight = np.pi / 2 * s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3), 140 * (s - s**2) ** 3
    unit = directions(angle, angle)
    reach = (unit ** (2 * p)).sum(axis=-1) ** (-0.5 / p)
    slope = np.linalg.norm((reach[..., None] * unit) ** (2 * p - 1) / axes, axis=-1)
    density = np.prod(axes) * reach**3 * slope * np.sin(angle)[:, None]
    return 8 * (np.pi / 4) ** 2 * np.einsum("i,j,ij", w * weight, w * weight, density)


def area_of_triangles(axes, p, n):
    """Sum flat triangles between points in equal steps of the polar angles."""
    unit = directions(*[np.linspace(0, np.pi / 2, n + 1)] * 2)
    x = axes * unit / ((np.abs(unit) ** (2 * p)).sum(axis=-1, keepdims=True)) ** (0.5 / p)
    lower = np.cross(x[1:, :-1] - x[:-1, :-1], x[:-1, 1:] - x[:-1, :-1])
    upper = np.cross(x[1:, :-1] - x[1:, 1:], x[:-1, 1:] - x[1:, 1:])
    return 4 * (np.linalg.norm(lower, axis=-1).sum() + np.linalg.norm(upper, axis=-1).sum())


@pytest.mark.parametrize("p", [0.55, 0.75, 1.0, 1.5, 4.0])
def test_volume_is_that_of_random_points_inside(p):
    rng, axes = np.random.default_rng(3), np.array([0.7, 1.1, 2.0])
    n = 400_000
    inside = ((np.abs(rng.uniform(-1, 1, (n, 3))) ** (2 * p)).sum(axis=1) < 1).mean()
    error = 8 * axes.prod() * np.sqrt(inside * (1 - inside) / n)
    assert abs(volume(axes, p) - 8 * axes.prod() * inside) < 4 * error


def test_volumes_in_closed_form():
    axes = np.array([0.5, 1.5, 2.0])
    assert volume(axes, 1) == pytest.approx(4 * np.pi / 3 * 1.5, rel=1e-14)
    assert volume(axes, 0.5) == pytest.approx(4 / 3 * 1.5, rel=1e-14)
    assert volume(axes, 1e6) == pytest.approx(8 * 1.5, rel=1e-5)


@pytest.mark.parametrize("p", [0.5, 0.55, 0.75, 0.85, 1.0, 1.25, 1.5, 2.0, 4.0, 10.0])
@pytest.mark.parametrize("axes", SHAPES + EXTREMES)
def test_area_is_that_of_another_quadrature(axes, p, measured):
    area, error = surface_area(axes, p)
    relative = abs(area / area_over_directions(axes, p, n=400 if p > 4 else 200) - 1)
    measured(relative=relative)
    assert relative < (1e-10 if p > 2 else 1e-12)
    assert error < 1e-12 * area


@pytest.mark.parametrize("p", [0.75, 2.0])
def test_area_is_the_limit_of_triangles(p, measured):
    axes = np.array(EXTREMES[-1])
    off = [area_of_triangles(axes, p, n) / surface_area(axes, p).area - 1 for n in (100, 400)]
    measured(coarse=off[0], fine=off[1])
    assert abs(off[1]) < 2e-5
    assert abs(off[1]) < 0.2 * abs(off[0])


def test_area_of_ellipsoids_is_continuous_in_p(measured):
    axes = np.array(SHAPES + EXTREMES)
    step = 1e-5
    below, at, above = (surface_area(axes, p).area for p in (1 - step, 1.0, 1 + step))
    off = np.abs((below + above) / 2 / at - 1).max()
    measured(relative=off)
    assert off < 1e-9  # step squared times the curvature in p


def test_area_of_octahedra_and_boxes():
    a, b, c = axes = np.array([0.3, 1.1, 2.0])
    face = np.sqrt((a * b) ** 2 + (b * c) ** 2 + (c * a) ** 2) / 2
    assert surface_area(axes, 0.5).area == pytest.approx(8 * face, rel=1e-14)
    box = 8 * (a * b + b * c + c * a)
    below = [1 - surface_area(axes, p).area / box for p in (10, 100, 1000)]
    assert 0 < below[2] < below[1] / 9 < below[0] / 70


def test_area_does_not_depend_on_the_order_or_the_number_of_shapes():
    axes, p = np.array([[0.1, 1, 10], [10, 0.1, 1], [1, 1, 2], [2, 4, 2]]), np.array([3, 3, 1, 1.0])
    area, error = surface_area(axes, p)
    assert area.shape == error.shape == (4,)
    assert area[0] == area[1]
    assert area[3] == pytest.approx(4 * area[2], rel=1e-13)
    assert area[0] == surface_area(axes[0], 3.0).area
    assert surface_area(axes[:, None], p).area.shape == (4, 4)


def printed_oblate(beta):
    gamma = np.arccos(beta)
    logarithm = np.log((1 + np.sin(gamma)) / np.cos(gamma))
    return 2 * beta ** (2 / 3) / (1 + beta**2 / np.sin(gamma) * logarithm)


def printed_prolate(beta):
    alpha = np.arccos(1 / beta)
    return 2 * beta ** (2 / 3) / (1 + beta * alpha / np.sin(alpha))


def test_asphericity_of_spheroids_is_one_minus_equations_8_and_9():
    flat, long = np.array([0.05, 0.3, 0.6, 0.99]), np.array([1.01, 1.5, 3.0, 20.0])
    ones = np.ones(4)
    found = asphericity(axes_from(flat, ones), 1)
    np.testing.assert_allclose(found, 1 - printed_oblate(flat), rtol=1e-9, atol=1e-14)
    found = asphericity(axes_from(ones, long), 1)
    np.testing.assert_allclose(found, 1 - printed_prolate(long), rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(reduced_aspect_ratio(axes_from(flat, ones)), flat)
    np.testing.assert_allclose(reduced_aspect_ratio(axes_from(ones, long)), long)


def test_asphericity_is_0_for_spheres_and_grows_to_1():
    assert asphericity((2.5, 2.5, 2.5), 1) == pytest.approx(0, abs=1e-15)
    for p in (0.9, 1.1):
        assert asphericity((1, 1, 1), p) > 1e-4
    cube = 1 - np.cbrt(np.pi / 6)
    octahedron = 1 - np.cbrt(4 * np.pi * 16) / (4 * np.sqrt(3))
    assert asphericity((1, 1, 1), 1e4) == pytest.approx(cube, rel=1e-3)
    assert asphericity((1, 1, 1), 0.5) == pytest.approx(octahedron, rel=1e-13)
    assert asphericity((1, 1, 1e6), 1) > 0.97
    assert asphericity((1, 1e6, 1e6), 1) > 0.999


@pytest.mark.parametrize("beta", [0.3, 0.6, 1.5, 3.0])
def test_spheroids_are_the_roundest_ellipsoids_of_their_beta(beta):  # Fig. 12
    w1 = np.linspace(0.2, min(beta, 1.0), 30)
    found = asphericity(axes_from(w1, beta / w1), 1)
    assert found[-1] == asphericity(axes_from(min(beta, 1), max(beta, 1)), 1)
    assert (np.diff(found) < 0).all()


def test_axes_have_the_papers_ratios_in_units_of_a():
    a, b, c = axes_from(0.6, 2.36)
    assert a == 1
    assert (a / b, c / b) == pytest.approx((0.6, 2.36))
    assert axes_from(1, 1).tolist() == [1, 1, 1]
    assert axes_from([0.5, 0.25], 2).tolist() == [[1, 2, 4], [1, 4, 8]]


def director_axis(axes):
    """Axis of the director in the compiled shape."""
    d = 2 * np.atleast_2d(axes)
    ellipsoids = shape_named("superellipsoid").compiled((d, np.ones((len(d), 1))), 3, Interaction())
    return ellipsoids.director.reshape(np.shape(axes)[:-1])


def test_director_is_the_short_axis_of_flat_and_the_long_axis_of_long_shapes():
    flat, long = axes_from(0.3, 1.2), axes_from(0.9, 2.0)
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        assert flat[order][director_axis(flat[order])] == flat.min()
        assert long[order][director_axis(long[order])] == long.max()
    assert director_axis(np.array([flat, long])).tolist() == [0, 2]
    self_dual = axes_from([0.8, 0.7, 1.0], [1.25, 1 / 0.7, 1.0])  # beta = 1 but for rounding
    assert director_axis(self_dual).tolist() == [0, 0, -1]  # the last one is a sphere


@pytest.mark.parametrize(
    ("axes", "p", "message"),
    [
        ((1, 1), 1, r"shape \(2,\), expected \(..., 3\)"),
        ((1, 1, 0), 1, r"hold 0.0, expected lengths > 0"),
        ((1, 1, np.nan), 1, "hold nan"),
        ((1, 1, 1), 0.49, "p is 0.49, expected at least 1/2"),
        ((1, 1, 1), [1, np.inf], "p is inf"),
        (np.ones((4, 3)), [1, 2], r"\(4,\) shapes have \(2,\) exponents"),
    ],
)
def test_what_is_no_shape_is_refused(axes, p, message):
    for of in (volume, surface_area, asphericity):
        with pytest.raises(ValueError, match=message):
            of(axes, p)


@pytest.mark.parametrize(("w1", "w2"), [(1.2, 2), (0.5, 0.9), (0, 1), (0.5, np.inf), (np.nan, 1)])
def test_aspect_ratios_out_of_range_are_refused(w1, w2):
    with pytest.raises(ValueError, match="expected 0 < w1 <= 1 <= w2"):
        axes_from(w1, w2)
