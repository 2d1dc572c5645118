import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from common.curvature import contact_curvatures, curvature_at_normals, curvature_at_points
from jamshape.packing import body_axes
from jamshape.shapes.superellipsoid_surface import surface_mesh

AXES = np.array([0.6, 1.1, 2.3])
EXPONENTS = [0.55, 0.75, 0.85, 1.0, 1.25, 1.5, 2.0, 10.0]


def surface_points(p, n=200, seed=5):
    direction = np.random.default_rng(seed).normal(size=(n, 3))
    return direction / ((np.abs(direction / AXES) ** (2 * p)).sum(axis=1) ** (0.5 / p))[:, None]


def normals_at(points, p):
    return np.sign(points) * np.abs(points / AXES) ** (2 * p - 1) / AXES


def second_fundamental_form(axes, points, p):
    """Gaussian curvature of the height z(x, y), by central differences."""
    (a, b, c), (x, y, _) = axes.T, points.T

    def z(x, y):
        return c * (1 - np.abs(x / a) ** (2 * p) - np.abs(y / b) ** (2 * p)) ** (0.5 / p)

    h, k = np.longdouble(1e-4) * np.abs(x), np.longdouble(1e-4) * np.abs(y)
    zx, zy = (z(x + h, y) - z(x - h, y)) / (2 * h), (z(x, y + k) - z(x, y - k)) / (2 * k)
    zxx = (z(x + h, y) - 2 * z(x, y) + z(x - h, y)) / h**2
    zyy = (z(x, y + k) - 2 * z(x, y) + z(x, y - k)) / k**2
    zxy = (z(x + h, y + k) - z(x + h, y - k) - z(x - h, y + k) + z(x - h, y - k)) / (4 * h * k)
    return (zxx * zyy - zxy**2) / (1 + zx**2 + zy**2) ** 2


@pytest.mark.parametrize("p", EXPONENTS)
def test_curvature_is_that_of_the_second_fundamental_form(p, measured):
    points = surface_points(p)
    shares = np.abs(points / AXES) ** (2 * p)
    far = shares.min(axis=1) > 1e-3
    points, shares = points[far], shares[far]
    order = np.argsort(shares, axis=1)  # the height along the axis that is best seen
    flattest = np.take_along_axis(points.astype(np.longdouble), order, axis=1)
    expected = second_fundamental_form(AXES.astype(np.longdouble)[order], flattest, p)
    found = curvature_at_points(AXES, p, points)
    error = np.abs(found / expected / AXES.prod() ** (2 / 3) - 1).max()
    measured(relative=error, points=len(points))
    assert len(points) > 5
    assert error < (1e-6 if p < 10 else 1e-5)


@pytest.mark.parametrize("p", EXPONENTS)
def test_points_and_their_normals_have_the_same_curvature(p):
    points = surface_points(p)
    found = curvature_at_points(AXES, p, points)
    np.testing.assert_allclose(curvature_at_normals(AXES, p, normals_at(points, p)), found, 1e-9)
    np.testing.assert_allclose(curvature_at_points(AXES, p, 0.97 * points), found, rtol=1e-11)
    np.testing.assert_allclose(
        curvature_at_normals(3 * AXES, p, -7 * normals_at(points, p)), found, 1e-9
    )


def test_curvature_of_ellipsoids_in_closed_form():
    points = surface_points(1)
    height = 1 / np.linalg.norm(points / AXES**2, axis=1)  # of the tangent plane over the centre
    expected = height**4 / AXES.prod() ** (4 / 3)
    np.testing.assert_allclose(curvature_at_points(AXES, 1, points), expected, rtol=1e-13)
    normals = np.random.default_rng(1).normal(size=(50, 3))
    np.testing.assert_allclose(curvature_at_normals((2, 2, 2), 1, normals), 1, rtol=1e-14)
    a, b, c = AXES
    tips = np.array([a**2 / (b * c) ** 2, b**2 / (c * a) ** 2, c**2 / (a * b) ** 2])
    found = curvature_at_points(AXES, 1, np.eye(3))
    np.testing.assert_allclose(found, tips * AXES.prod() ** (2 / 3), rtol=1e-13)


@pytest.mark.parametrize("p", [1.0, 1.5, 3.0])
def test_total_curvature_is_that_of_a_sphere(p, measured):
    mesh = surface_mesh(AXES, p, level=5)
    corner = mesh.vertices[mesh.triangles]
    area = np.linalg.norm(
        np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1
    )
    middle = curvature_at_points(AXES, p, corner.mean(axis=1))
    total = (middle * area).sum() / 2 / AXES.prod() ** (2 / 3)
    measured(relative=total / (4 * np.pi) - 1)
    assert total == pytest.approx(4 * np.pi, rel=2e-3)


@pytest.mark.parametrize("of", [curvature_at_points, curvature_at_normals])
def test_limits_at_the_planes_of_symmetry(of):
    special = np.array([[1, 0, 0], [0, -1, 0], [0, 0, 1], [1, 1, 0], [0, 1, -1], [1, 0, 1]])
    assert (of(AXES, 1.5, special) == 0).all()
    assert (of(AXES, 0.75, special) == np.inf).all()
    ellipsoid = of(AXES, 1, special)
    assert (np.isfinite(ellipsoid) & (ellipsoid > 0)).all()
    mixed = of(AXES, [1.5, 0.75, 1, 1, 2, 0.6], special)
    assert mixed[[0, 1, 4, 5]].tolist() == [0, np.inf, 0, np.inf]
    np.testing.assert_array_equal(mixed[2:4], ellipsoid[2:4])


@pytest.mark.parametrize("p", EXPONENTS)
@pytest.mark.parametrize("of", [curvature_at_points, curvature_at_normals])
def test_limits_are_approached_without_a_jump(of, p):
    small = np.geomspace(1e-300, 1, 601)
    for rest in ([1.0, 0.7], [small, 1.0], [1.0, small**2]):
        near = np.column_stack([small, *np.broadcast_arrays(*rest, small)[:2]])
        curvature = of(AXES, p, near)
        assert not np.isnan(curvature).any()
        assert (curvature >= 0).all()
        if p > 1:
            assert curvature[0] < 1e-10
        if p < 1:
            assert curvature[0] > 1e10


def test_curvature_at_contacts_is_of_both_sides_in_their_own_axes():
    rng = np.random.default_rng(8)
    semi_axes, p = rng.uniform(0.5, 2, (5, 3)), rng.uniform(0.7, 2, 5)
    quaternions, normals = rng.normal(size=(5, 4)), rng.normal(size=(4, 3))
    pairs = np.array([[0, 1], [1, 2], [4, 2], [3, 0]])
    found = contact_curvatures((semi_axes, p), body_axes(quaternions), pairs, normals)
    for contact, pair in enumerate(pairs):
        for side, i in enumerate(pair):
            back = Rotation.from_quat(quaternions[i, [1, 2, 3, 0]]).inv()
            sign = (-1) ** side
            expected = curvature_at_normals(semi_axes[i], p[i], sign * back.apply(normals[contact]))
            assert found[contact, side] == pytest.approx(expected, rel=1e-10)
    one = contact_curvatures((AXES, 1.5), body_axes(quaternions), pairs, normals)
    assert one.shape == (4, 2)
    none = contact_curvatures((AXES, 1.5), body_axes(quaternions), pairs[:0], normals[:0])
    assert none.shape == (0, 2)


def test_what_has_no_curvature_is_refused():
    with pytest.raises(ValueError, match="octahedron"):
        curvature_at_normals(AXES, 0.5, np.eye(3))
    with pytest.raises(ValueError, match="normals hold zero"):
        curvature_at_normals(AXES, 1.5, np.zeros((2, 3)))
    with pytest.raises(ValueError, match="points hold zero, NaN"):
        curvature_at_points(AXES, 1.5, [np.nan, 0, 1])
    with pytest.raises(ValueError, match=r"points have shape \(2,\)"):
        curvature_at_points(AXES, 1.5, [0, 1])
