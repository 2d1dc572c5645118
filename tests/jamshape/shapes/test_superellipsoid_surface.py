import numpy as np
import pytest

from jamshape.shapes.roundness import surface_area, volume
from jamshape.shapes.superellipsoid_surface import surface_mesh

EXPONENTS = [0.5, 0.55, 0.75, 1.0, 1.5, 2.0, 10.0, 20.0]
AXES = np.array([[1, 1, 1], [0.1, 1, 10], [3, 0.5, 1]])


def faces(mesh):
    """Twice the area of each triangle, along its normal, and its middle."""
    corner = mesh.vertices[mesh.triangles]
    return np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), corner.mean(axis=1)


@pytest.mark.parametrize("p", EXPONENTS)
@pytest.mark.parametrize("axes", AXES)
def test_vertices_are_on_the_surface_and_triangles_close_it(axes, p):
    mesh = surface_mesh(axes, p, level=2)
    assert (np.abs(mesh.vertices / axes) ** (2 * p)).sum(axis=1) == pytest.approx(1, rel=1e-13)
    assert mesh.triangles.shape == (768, 3)
    assert len(mesh.vertices) == 768 // 2 + 2  # Euler
    sides = mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    assert {tuple(side) for side in sides.tolist()} == {(j, i) for i, j in sides.tolist()}
    assert len(np.unique(sides, axis=0)) == len(sides)
    area, middle = faces(mesh)
    assert ((area * middle).sum(axis=1) > 0).all()


@pytest.mark.parametrize("p", EXPONENTS)
@pytest.mark.parametrize("axes", AXES)
def test_mesh_converges_to_the_body(axes, p, measured):
    mesh = surface_mesh(axes, p, level=4)
    area, middle = faces(mesh)
    off_area = np.linalg.norm(area, axis=1).sum() / 2 / surface_area(axes, p).area - 1
    off_volume = (area * middle).sum() / 6 / volume(axes, p) - 1
    measured(area=off_area, volume=off_volume)
    assert abs(off_area) < 1e-3
    assert -1e-3 < off_volume < 1e-12  # inside a convex body


@pytest.mark.parametrize("p", [0.75, 1.0, 1.5, 10.0])
def test_normals_are_those_of_the_surface(p):
    axes = AXES[2]
    mesh = surface_mesh(axes, p)
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1)
    slope = np.sign(mesh.vertices) * np.abs(mesh.vertices / axes) ** (2 * p - 1) / axes
    slope /= np.linalg.norm(slope, axis=1, keepdims=True)
    np.testing.assert_allclose(mesh.normals, slope, atol=1e-12)


def test_sphere_is_covered_evenly():
    mesh = surface_mesh((2, 2, 2), 1, level=3)
    area = np.linalg.norm(faces(mesh)[0], axis=1)
    assert area.max() / area.min() < 2.5
    np.testing.assert_allclose(mesh.vertices, 2 * mesh.normals, atol=1e-14)


@pytest.mark.parametrize("p", EXPONENTS)
def test_neither_flat_nor_sharp_parts_are_left_without_vertices(p):
    mesh = surface_mesh((1, 1, 1), p, level=4)
    corner, normal = mesh.vertices[mesh.triangles], mesh.normals[mesh.triangles]
    side = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=-1)
    assert side.max() < 0.17
    if p >= 0.75:  # below, edges are sharp
        turn = np.arccos(np.clip((normal * np.roll(normal, 1, axis=1)).sum(axis=-1), -1, 1))
        assert np.degrees(turn.max()) < 13


@pytest.mark.parametrize("p", [0.6, 2.0])
def test_mesh_has_the_symmetry_of_a_cube(p):
    points = {tuple(v) for v in np.round(surface_mesh((1, 1, 1), p, 2).vertices, 9) + 0.0}
    for order in ([1, 0, 2], [1, 2, 0]):
        assert {tuple(np.array(v)[order]) for v in points} == points
    assert {(-x + 0.0, y, z) for x, y, z in points} == points


def test_what_is_no_body_is_refused():
    for axes, level in ((np.ones((2, 3)), 1), ((1, 1, 1), -1)):
        with pytest.raises(ValueError, match=r"expected \(3,\) for one body and a level from 0"):
            surface_mesh(axes, 1, level)
    with pytest.raises(ValueError, match="expected at least 1/2"):
        surface_mesh((1, 1, 1), 0.3)
