"""The periodic box with and without a tilt, and pairs that are near each other across it."""

import itertools

import numpy as np
import pytest

from jamshape.contacts.near import near_spheres
from jamshape.packing import Box, affine_change

PLANE = Box([0.5, -1], [4, 5], [1])
SPACE = Box([0.5, -1, 2], [4, 5, 6], [1, -2, 2.5])
BOXES = pytest.mark.parametrize("box", [PLANE, SPACE], ids=["plane", "space"])


def test_cell_vectors_are_the_columns_of_an_upper_triangular_matrix():
    assert PLANE.matrix.tolist() == [[4, 1], [0, 5]]
    assert SPACE.matrix.tolist() == [[4, 1, -2], [0, 5, 2.5], [0, 0, 6]]
    assert (PLANE.is_tilted, Box([0, 0], [1, 2]).is_tilted) == (True, False)
    assert SPACE.volume == 120
    for box in (PLANE, SPACE):
        again = Box.of(box.lo, box.matrix)
        assert (again.edges.tolist(), again.tilt.tolist()) == (
            box.edges.tolist(),
            box.tilt.tolist(),
        )


def test_tilt_factors_are_those_of_hoomd():
    """xy over ly, xz over lz, yz over lz."""
    np.testing.assert_allclose(SPACE.tilt_factors, [1 / 5, -2 / 6, 2.5 / 6], rtol=1e-15)


def test_the_cuboid_around_the_box():
    assert [x.tolist() for x in PLANE.bounds] == [[0.5, -1], [5.5, 4]]
    low, high = SPACE.bounds
    corners = SPACE.lo + SPACE.vectors(np.array(list(np.ndindex(2, 2, 2))))
    np.testing.assert_array_equal(low, corners.min(axis=0))
    np.testing.assert_array_equal(high, corners.max(axis=0))
    np.testing.assert_allclose(SPACE.center, corners.mean(axis=0))


@BOXES
def test_points_are_moved_into_the_box(box):
    D, rng = box.dimension, np.random.default_rng(1)
    position = rng.uniform(-30, 30, (200, D))
    inside, turns = box.wrapped(position)
    np.testing.assert_allclose(inside + box.lo + box.vectors(turns), position, atol=1e-13)
    np.testing.assert_allclose(np.linalg.solve(box.matrix, inside.T).T, box.fractions(inside))
    assert box.fractions(inside).min() >= 0
    assert box.fractions(inside).max() < 1
    heights = box.heights(inside)
    assert (heights >= 0).all()
    assert (heights < box.spacings).all()
    # A distance from a face is one along its normal.
    for k in range(D):
        in_face = np.delete(box.matrix, k, axis=1)
        normal = np.linalg.svd(in_face.T)[2][-1]
        np.testing.assert_allclose(np.abs(inside @ normal), heights[:, k], atol=1e-13)


def test_without_a_tilt_bits_are_those_of_the_edges():
    box, x = Box([1 / 3, 0, -1 / 7], [4 / 3, 5, 6.1]), np.random.default_rng(2).normal(size=(99, 3))
    turns = np.random.default_rng(3).integers(-9, 9, (99, 3))
    np.testing.assert_array_equal(box.fractions(x), x / box.edges)
    np.testing.assert_array_equal(box.vectors(turns), turns * box.edges)
    np.testing.assert_array_equal(box.heights(x), x)
    np.testing.assert_array_equal(box.spacings, box.edges)
    np.testing.assert_array_equal(box.bounds[1], box.lo + box.edges)
    change = affine_change(box.matrix, 1.1 * box.matrix)
    np.testing.assert_array_equal(change, np.diag(1.1 * box.edges / box.edges))


@BOXES
def test_what_takes_one_box_to_another(box):
    other = Box(box.lo, 1.1 * box.edges, box.tilt + 0.3)
    change = affine_change(box.matrix, other.matrix)
    np.testing.assert_allclose(change @ box.matrix, other.matrix, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize(
    ("edges", "tilt", "sentence"),
    [
        ([1, 1], [0.1, 0], r"box tilt has shape \(2,\), expected \(1,\)"),
        ([1, 1, 1], [0.1], r"box tilt has shape \(1,\), expected \(3,\)"),
        ([1, 1], 0.1, r"box tilt has shape \(\), expected \(1,\)"),
        ([1, 1], [np.nan], "box tilt holds NaN or infinity, expected finite numbers"),
        ([1, 1, 1], [0, np.inf, 0], "box tilt holds NaN or infinity, expected finite numbers"),
    ],
)
def test_tilts_that_are_none_are_refused(edges, tilt, sentence):
    with pytest.raises(ValueError, match=sentence):
        Box(np.zeros(len(edges)), edges, tilt)


@pytest.mark.parametrize("matrix", [np.ones((2, 2)), np.ones((2, 3)), np.eye(4), np.ones(2)])
def test_cell_vectors_that_are_turned_are_refused(matrix):
    with pytest.raises(ValueError, match=r"cell vectors are .*, expected the first one along x"):
        Box.of([0, 0], matrix)


# --- pairs ---------------------------------------------------------------------------------------


def tried(centre, radius, box):
    """Pairs of spheres that overlap, by trying so many images that none is left out."""
    apart = centre[:, None] - centre
    reach = radius[:, None] + radius
    most = np.ceil((reach.max() + np.abs(apart).max()) / box.spacings).astype(int)
    found = set()
    for turn in itertools.product(*(range(-m, m + 1) for m in most)):
        i, j = np.nonzero(np.linalg.norm(apart - box.vectors(np.array(turn)), axis=2) < reach)
        found |= {(*pair, *turn) for pair in zip(i.tolist(), j.tolist(), strict=True)}
    zero = (0,) * box.dimension
    return {row for row in found if row[0] < row[1] or (row[0] == row[1] and row[2:] > zero)}


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("strength", [0.0, 0.5, -0.5, 3.3])
@pytest.mark.parametrize("edge", [0.4, 1.5, 6.0])
def test_near_spheres_are_those_of_all_images(dimension, strength, edge):
    """Also of boxes much shorter than the spheres, and of cells that are all but flat."""
    rng = np.random.default_rng(7)
    strength = min(
        strength, 3.3 if dimension == 2 else 1.3
    )  # in space more has too many images to try
    edges = edge * np.array([1.0, 0.8, 1.2])[:dimension]
    tilt = strength * edge * np.array([1.0, -0.7, 0.6])[: 2 * dimension - 3]
    box = Box(np.linspace(-1, 0.3, dimension), edges, tilt)
    n = {0.4: 4, 1.5: 12, 6.0: 12 if dimension == 2 else 24}[edge]
    centre = box.lo + box.vectors(rng.uniform(-1.5, 1.5, (n, dimension)))
    radius = rng.uniform(0.2, 0.7, n)
    near = near_spheres(centre, radius, box)
    rows = np.column_stack([near.first, near.second, near.shift]).tolist()
    assert len(rows) == len(set(map(tuple, rows)))
    assert set(map(tuple, rows)) == tried(centre, radius, box)
    assert rows == sorted(rows)
    assert len(rows) > 0


def test_boxes_that_are_no_match_for_their_spheres_are_refused():
    with pytest.raises(ValueError, match="the box is far shorter than its particles"):
        near_spheres(np.zeros((1, 2)), np.ones(1), Box([0, 0], [1e-4, 1e-4]))
    with pytest.raises(ValueError, match="more than 1e15 cell vectors away from the box"):
        near_spheres(np.full((1, 2), 1e20), np.ones(1), Box([0, 0], [9, 9]))


def test_what_rounding_leaves_below_the_diagonal_is_no_rotation():
    assert Box.of([0, 0], [[10, 3], [1e-16, 12]]).matrix.tolist() == [[10, 3], [0, 12]]
    with pytest.raises(ValueError, match="expected the first one along x"):
        Box.of([0, 0], [[10, 3], [1e-9, 12]])
