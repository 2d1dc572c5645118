import numpy as np
import pytest

from jamshape.drawing.space import box_edges, faces_of, painted, view
from jamshape.packing import Box, Packing
from jamshape.shapes.table import SHAPES

IN_SPACE = pytest.mark.parametrize(
    "shape", [name for name, shape in SHAPES.items() if 3 in shape.dimensions]
)


def spheres(shape, position):
    n = len(position)
    sizes, exponent = np.full((n, 3), 2.0), np.ones(n)
    is_union = SHAPES[shape].has_form
    form = (
        np.tile([0.0, 0, 0, 1], (n, 1)) if is_union else SHAPES[shape].form_of_exponents(exponent)
    )
    return Packing(
        position=np.array(position),
        orientation=np.tile([1.0, 0, 0, 0], (n, 1)),
        diameters=sizes,
        species=np.ones(n, int),
        id=np.arange(1, n + 1),
        box=Box(np.zeros(3), np.full(3, 10.0)),
        shape_style=shape,
        form=form,
    )


@IN_SPACE
def test_near_bodies_hide_far_ones(shape):
    """Two spheres behind each other: where they meet on the screen, the nearer one is painted last."""
    eye = view(20, 30)
    center = np.full(3, 5.0)
    packing = spheres(shape, [center + 1.01 * eye.eye, center - 1.01 * eye.eye])
    colors = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    polygons, shades = painted(faces_of(packing, 2, eye), colors, eye)
    middle = np.abs(polygons.mean(axis=1) - eye.flat(center)).max(axis=1) < 0.3
    assert (shades[middle][-1] * [1, 0, -1]).sum() > 0, "red is last"
    far = np.flatnonzero(shades[:, 2] > shades[:, 0])
    assert far.max() < np.flatnonzero(middle & (shades[:, 0] > shades[:, 2])).min()


@IN_SPACE
def test_faces_look_outwards_and_cover_what_is_seen(shape):
    eye = view(20, 30)
    packing = spheres(shape, [[5.0, 5.0, 5.0]])
    faces = faces_of(packing, 3, eye)
    away = faces.corners.mean(axis=1) - 5.0
    assert ((away * faces.normals).sum(axis=1) > 0.9).all()
    a, b, c = np.moveaxis(eye.flat(faces.corners), 1, 0)
    (x, y), (u, v) = (b - a).T, (c - a).T
    area = 0.5 * np.abs(x * v - y * u).sum()
    assert area == pytest.approx(np.pi, rel=0.03)


def test_a_tilted_box_is_drawn_by_its_cell_vectors():
    eye, box = view(20, 30), Box(np.full(3, -1.0), [4, 5, 6], [1, -2, 2.5])
    packing = spheres("superellipsoid", [[5.0, 5.0, 5.0]]).with_(box=box)
    hidden, seen = box_edges(packing, eye)
    assert (len(hidden), len(seen)) == (3, 9)
    lines = np.concatenate([hidden, seen])
    drawn = np.abs(lines[:, 1] - lines[:, 0])
    expected = np.abs(np.repeat([eye.flat(vector) for vector in box.matrix.T], 4, axis=0))
    found, expected = (np.sort(np.round(x, 9).view("f8,f8"), axis=0) for x in (drawn, expected))
    assert found.tolist() == expected.tolist()
    # The particle is drawn in the box.
    center = faces_of(packing, 2, eye).corners.mean(axis=(0, 1)) - eye.eye / 2
    inside = box.fractions(center - box.lo)
    assert ((inside > 0) & (inside < 1)).all()
