import numpy as np
import pytest
from matplotlib.figure import Figure

from jamshape.drawing.plane import images, outlines, show_box, spines
from jamshape.packing import Box, Packing
from jamshape.shapes.table import SHAPES

BOX = Box(np.array([-1.0, 2.0]), np.array([4.0, 7.0]))


def one(shape, **parameters):
    known = {p.name: p.default for p in SHAPES[shape].needed} | parameters
    diameters, form = SHAPES[shape].sizes(known, np.ones(1))
    return Packing(
        position=np.array([[-20.0, 31.0]]),
        orientation=np.array([0.3]),
        diameters=diameters,
        form=form,
        species=np.ones(1, int),
        id=np.ones(1, int),
        box=BOX,
        shape_style=shape,
    )


def area(polygon):
    x, y = polygon.T
    return 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))


def test_images_that_reach_into_the_box():
    at = images(np.array([[0.0, 2.1], [1.0, 5.0]]), np.array([0.5, 0.5]), BOX)
    assert at.owner.tolist() == [0, 1, 0]
    assert sorted(at.center[at.owner == 0].tolist()) == [[0.0, 2.1], [0.0, 9.1]]
    # One that is longer than the box is there many times.
    assert len(images(np.zeros((1, 2)), np.array([20.0]), BOX).owner) > 20


def test_images_fill_the_rectangle_around_a_tilted_box():
    """The same number as in a search over far more images, for a box with a large tilt."""
    rng = np.random.default_rng(1)
    for tilt in (2.0, -5.5, 13.0):
        box = Box(BOX.lo, BOX.edges, [tilt])
        position, reach = rng.uniform(-20, 20, (9, 2)), rng.uniform(0.1, 3.0, 9)
        at = images(position, reach, box)
        shifts = np.array(list(np.ndindex(61, 61))) - 30
        every = position[:, None] + box.vectors(shifts)
        low, high = box.bounds
        near = reach[:, None, None]
        seen = ((every > low - near) & (every < high + near)).all(axis=2)
        assert sorted(at.owner.tolist()) == sorted(np.nonzero(seen)[0].tolist())
        found = np.column_stack([at.owner, at.center])
        expected = np.column_stack([np.nonzero(seen)[0], every[seen]])
        found, expected = (x[np.lexsort(np.round(x, 6).T)] for x in (found, expected))
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_tilted_box_is_drawn_as_a_parallelogram():
    axes = Figure().subplots()
    show_box(axes, Box(BOX.lo, BOX.edges, [-2.0]))
    (line,) = axes.lines
    assert line.get_xydata().tolist() == [[-1, 2], [3, 2], [1, 9], [-3, 9], [-1, 2]]
    assert (axes.get_xlim(), axes.get_ylim()) == ((-3, 3), (2, 9))
    plain = Figure().subplots()
    show_box(plain, BOX)
    assert not len(plain.lines)
    assert (plain.get_xlim(), plain.get_ylim()) == ((-1, 3), (2, 9))


@pytest.mark.parametrize("shape", SHAPES)
def test_outlines_enclose_the_area_of_the_particle(shape):
    packing = one(shape)
    at = images(packing.position, packing.outer_radius, packing.box)
    polygons = outlines(packing, at)
    assert len(polygons) == len(at.owner) >= 1
    for polygon, center in zip(polygons, at.center, strict=True):
        assert area(polygon) == pytest.approx(float(packing.measures[0]), rel=0.01)
        reach = np.linalg.norm(polygon - center, axis=1).max()
        assert reach == pytest.approx(float(packing.outer_radius[0]), rel=0.01)


def test_spines_lie_along_the_particle_and_discs_have_none():
    rod = one("spherocylinder", alpha=4.0)
    at = images(rod.position, rod.outer_radius, rod.box)
    lines = spines(rod, at)
    assert np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1) == pytest.approx(4.0)
    np.testing.assert_allclose(lines.mean(axis=1), at.center, atol=1e-12)
    disc = one("spherocylinder", alpha=0.0)
    assert not len(spines(disc, images(disc.position, disc.outer_radius, disc.box)))
