import math

import numpy as np
import pytest
from nasty import ARRAYS, nasty_packing, tilted_box, with_rests

from jamshape.packing import Box, State, angle_from_quaternion
from jamshape.shapes.table import guess_shape_style


def rotate_x_axis(quaternion):
    w, v, x = quaternion[0], quaternion[1:], np.array([1.0, 0, 0])
    return x + 2 * np.cross(v, np.cross(v, x) + w * x)


def test_box_measures_itself():
    assert Box(lo=[0, 0], edges=[2, 3]).volume == 6
    assert Box(lo=[0, 0, 0], edges=[2, 3, 4]).volume == 24
    assert Box(lo=[0, 0, 0], edges=[2, 3, 4]).dimension == 3


@pytest.mark.parametrize(
    ("lo", "edges", "sentence"),
    [
        ([0], [1], r"box edges have shape \(1,\), expected \(2,\) or \(3,\)"),
        ([0, 0, 0], [1, 1], r"box lo has shape \(3,\), expected \(2,\)"),
        ([0, np.nan], [1, 1], "box lo holds NaN or infinity, expected finite numbers"),
        ([0, 0], [1, 0], r"box edges are \[1.0, 0.0\], expected positive lengths"),
    ],
)
def test_box_refuses(lo, edges, sentence):
    with pytest.raises(ValueError, match=sentence):
        Box(lo=lo, edges=edges)


def test_lengths_of_spherocylinders():
    packing = nasty_packing(2, diameters=np.tile([5.0, 1.0, 1.0], (6, 1)))
    np.testing.assert_array_equal(packing.half_length, 2)
    np.testing.assert_array_equal(packing.radius, 0.5)
    np.testing.assert_array_equal(packing.aspect_ratio, 4)
    assert (packing.n, packing.dimension) == (6, 2)


@pytest.mark.parametrize("dimension", [2, 3])
def test_axes_are_the_rotated_x_axis(dimension):
    packing = nasty_packing(dimension)
    expected = [rotate_x_axis(q)[:dimension] for q in packing.quaternions]
    np.testing.assert_allclose(packing.axes, expected, rtol=0, atol=1e-15)


def test_axes_are_unit_for_rounded_quaternions():
    packing = nasty_packing(3)
    rounded = packing.with_(orientation=packing.orientation.round(5))
    np.testing.assert_allclose(np.linalg.norm(rounded.axes, axis=1), 1, rtol=0, atol=1e-15)


def test_angle_survives_its_quaternion():
    packing = nasty_packing(2)
    assert not packing.quaternions[:, 1:3].any()
    for sign in (1, -1):
        angle = angle_from_quaternion(sign * packing.quaternions)
        np.testing.assert_allclose(angle, packing.orientation, rtol=0, atol=5e-16)


def test_angle_lies_above_minus_pi():
    quaternions = [[0, 0, 0, 1], [0, 0, 0, -1], [1e-300, 0, 0, -1], [-1, 0, 0, 0], [-1, 0, 0, 1]]
    expected = [math.pi, math.pi, math.pi, 0, -math.pi / 2]
    np.testing.assert_array_equal(angle_from_quaternion(quaternions), expected)


def test_sorted_by_id():
    packing = nasty_packing(3)
    ordered = packing.sorted_by_id()
    np.testing.assert_array_equal(ordered.id, [1, 2, 3, 4, 5, 6])
    for name in ARRAYS:
        expected = getattr(packing, name)[packing.id.argsort()]
        np.testing.assert_array_equal(getattr(ordered, name), expected)


def test_arrays_are_copied_and_read_only():
    position = np.zeros((6, 2))
    packing = nasty_packing(2, position=position)
    position[0] = 1
    assert not packing.position.any()
    with pytest.raises(ValueError, match="read-only"):
        packing.position[0] = 1


def test_image_defaults_to_zero():
    packing = nasty_packing(3, image=np.empty((0, 0), int))
    np.testing.assert_array_equal(packing.image, np.zeros((6, 3)))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"position": np.empty((0, 2))}, "packing has no particles, expected at least one"),
        ({"position": np.zeros((6, 3))}, r"position has shape \(6, 3\), expected \(6, 2\)"),
        ({"orientation": np.zeros(5)}, r"orientation has shape \(5,\), expected \(6,\)"),
        ({"diameters": np.ones((6, 2))}, r"diameters has shape \(6, 2\), expected \(6, 3\)"),
        ({"species": np.ones(5, int)}, r"species has shape \(5,\), expected \(6,\)"),
        ({"image": np.zeros((6, 3), int)}, r"image has shape \(6, 3\), expected \(6, 2\)"),
        ({"id": np.arange(6.0)}, "id has dtype float64, expected integers"),
        ({"id": np.ones(6, int)}, "an id occurs more than once, expected one for each particle"),
        ({"id": np.arange(6)}, "id holds 0, expected numbers from 1"),
        ({"species": np.zeros(6, int)}, "species holds 0, expected numbers from 1"),
        ({"orientation": np.full(6, np.inf)}, "orientation holds NaN or infinity, expected finite"),
        ({"diameters": np.zeros((6, 3))}, "diameters hold 0.0, expected positive lengths"),
        ({"diameters": np.tile([1, 2, 2], (6, 1))}, r"\[1.0, 2.0, 2.0\], expected \(2\(A\+R\), 2R"),
        ({"diameters": np.tile([3, 2, 1], (6, 1))}, r"\[3.0, 2.0, 1.0\], expected \(2\(A\+R\), 2R"),
        ({"shape_style": "rod"}, "shape style is 'rod', expected one of"),
        ({"time": np.nan}, "time is nan, expected a finite number"),
    ],
)
def test_packing_refuses(changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        nasty_packing(2, **changes)


def test_packing_refuses_quaternions_that_are_not_unit():
    with pytest.raises(ValueError, match="differs from 1 by 1, expected unit quaternions"):
        nasty_packing(3, orientation=np.tile([2.0, 0, 0, 0], (6, 1)))


@pytest.mark.parametrize(
    ("dimension", "measure"),
    [(2, 4 * 2 * 0.5 + np.pi * 0.5**2), (3, np.pi * 0.5**2 * 4 + 4 / 3 * np.pi * 0.5**3)],
)
def test_phi_is_the_sum_of_the_measures_over_the_box(dimension, measure):
    pytest.importorskip("jamshape._contact")
    packing = nasty_packing(
        dimension,
        diameters=np.tile([5.0, 1.0, 1.0], (6, 1)),
        box=Box(lo=np.zeros(dimension), edges=np.full(dimension, 10.0)),
    )
    assert packing.phi == pytest.approx(6 * measure / 10**dimension, rel=1e-14)


def test_shape_style_is_guessed_from_the_diameters():
    assert guess_shape_style(np.array([[1, 1, 1], [3, 1, 1]])) == "spherocylinder"
    assert guess_shape_style(np.array([[1, 1, 1], [1, 3, 3]])) == "superellipsoid"


RESTS = ("position_rest", "orientation_rest", "edges_rest")


@pytest.mark.parametrize("dimension", [2, 3])
def test_poses_are_kept_to_all_digits_as_doubles_and_rests(dimension):
    packing = with_rests(dimension)
    assert all(getattr(packing, name).any() for name in RESTS)
    position, orientation, edges = packing.poses()
    np.testing.assert_array_equal(position.astype(float), packing.position)
    again = packing.with_poses(position, orientation, edges)
    for one, other in zip(again.poses(), (position, orientation, edges), strict=True):
        assert one.dtype == np.longdouble
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("changed", "dropped"),
    [("position", "position_rest"), ("orientation", "orientation_rest"), ("box", "edges_rest")],
)
def test_new_poses_are_exact_doubles_and_other_rests_stay(changed, dropped):
    packing = with_rests(2)
    new = packing.with_(**{changed: getattr(packing, changed)})
    assert not getattr(new, dropped).any()
    for name in {*RESTS} - {dropped}:
        np.testing.assert_array_equal(getattr(new, name), getattr(packing, name))
    stepped = packing.with_(step=7)
    for name in RESTS:
        np.testing.assert_array_equal(getattr(stepped, name), getattr(packing, name))


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_tilt_is_kept_to_all_digits(dimension):
    packing = with_rests(dimension, box=tilted_box(dimension))
    position, orientation, cell = packing.poses()
    assert packing.tilt_rest.all()
    np.testing.assert_array_equal(cell.astype(float), packing.box.matrix)
    again = packing.with_poses(position, orientation, cell)
    for one, other in zip(again.poses(), (position, orientation, cell), strict=True):
        np.testing.assert_array_equal(one, other)
    strained = State.of(packing).strained(-1e-3).packing(packing).poses()[2]
    np.testing.assert_array_equal(strained, (1 - np.longdouble(1e-3)) * cell)
    exact = packing.with_(box=packing.box)
    assert not exact.tilt_rest.any()
    assert not exact.edges_rest.any()


def test_rests_follow_their_particles():
    packing = with_rests(3)
    order, ordered = packing.id.argsort(), packing.sorted_by_id()
    for one, other in zip(ordered.poses()[:2], packing.poses()[:2], strict=True):
        np.testing.assert_array_equal(one, other[order])
    np.testing.assert_array_equal(ordered.poses()[2], packing.poses()[2])


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"position_rest": np.ones((6, 3))}, r"position_rest has shape \(6, 3\), expected \(6, 2"),
        ({"edges_rest": np.full(2, np.nan)}, "edges_rest holds NaN or infinity"),
        ({"tilt_rest": np.full(1, np.inf)}, "tilt_rest holds NaN or infinity"),
        ({"tilt_rest": np.zeros(3)}, r"tilt_rest has shape \(3,\), expected \(1,\)"),
    ],
)
def test_packing_refuses_rests(changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        nasty_packing(2, **changes)
