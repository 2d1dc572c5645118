"""Arguments of the compiled module are checked: sizes, indices and that numbers are numbers.

What passes unchecked ends in SIGSEGV, or in contacts that are dropped in silence.
"""

from __future__ import annotations

import numpy as np
import pytest

from jamshape import _contact
from jamshape.shapes.table import SHAPES as TABLE

BAD_NUMBERS = (np.nan, np.inf, -np.inf)
N = 3


def dimensions_of(shape):
    """Dimensions that a compiled shape exists in."""
    return next(s.dimensions for s in TABLE.values() if s.compiled_name == shape.__name__)


SHAPES = {
    _contact.Spherocylinders: ((4.0, 2.0, 2.0), ()),
    _contact.Superellipsoids: ((4.0, 2.0, 3.0), (1.0,)),
    _contact.Dimers: ((4.0, 2.0, 2.0), ()),
    _contact.Spheropolygons: ((4.0, 2.0, 1.0), (0.5, -1.5, -0.5, 1.5, -0.5, 1.5, 0.5, -1.5, 0.5)),
    _contact.Clumps: ((4.0, 2.0, 2.0), (-1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0)),
}
in_each_space = pytest.mark.parametrize("dimension", [2, 3])
every_shape_in_each_space = pytest.mark.parametrize(
    ("shape", "dimension"),
    [(shape, D) for shape in SHAPES for D in dimensions_of(shape)],
    ids=lambda x: getattr(x, "__name__", x),
)


def particles(shape, dimension, k_e=1.0):
    return shape(*(np.tile(row, (N, 1)) for row in SHAPES[shape]), dimension, k_e, 1)


def poses(dimension):
    """Three particles of which the first two touch, as doubles alone."""
    position = np.zeros((N, dimension))
    position[:, 0] = 0.0, 3.5, 9.0
    turn = np.zeros((N, 1)) if dimension == 2 else np.tile([1.0, 0.0, 0.0, 0.0], (N, 1))
    return {"position": position, "orientation": turn, "cell": 30.0 * np.eye(dimension)}


def hard_poses(dimension):
    """Three that are apart, as Monte Carlo takes them."""
    given = poses(dimension)
    given["position"][:, 0] = 0.0, 10.0, 20.0
    return given | {"edges": np.diagonal(given.pop("cell")).copy()}


def split(of):
    return {name: np.stack([x, np.zeros_like(x)]) for name, x in of.items()}


def arguments(dimension):
    pairs = np.array([[0, 1], [1, 2]])
    return split(poses(dimension)) | {
        "pairs": pairs, "shift": np.zeros((len(pairs), dimension), np.int64)
    }  # fmt: skip


OVER_PAIRS = ("contacts", "sums", "derivatives", "overlaps", "near")


def call(of, method, given):
    more = {"margin": 0.1} if method == "near" else {}
    return getattr(of, method)(**given, **more)


@every_shape_in_each_space
@pytest.mark.parametrize("method", OVER_PAIRS)
@pytest.mark.parametrize("name", ["position", "orientation", "cell"])
def test_poses_that_are_no_numbers_are_refused(shape, dimension, method, name):
    of, given = particles(shape, dimension), arguments(dimension)
    call(of, method, given)
    for bad in BAD_NUMBERS:
        for part in range(2):
            spoilt = given[name].copy()
            spoilt[part].flat[-1] = bad
            with pytest.raises(
                ValueError, match=f"of {name} is -?(nan|inf), expected a finite one"
            ):
                call(of, method, given | {name: spoilt})


@every_shape_in_each_space
def test_what_is_no_box_orientation_or_pair_is_refused(shape, dimension):
    of, given = particles(shape, dimension), arguments(dimension)
    no_turn = given["orientation"].copy()
    no_turn[0, 1] = 0.0
    wrong = [
        ({"cell": 0.0 * given["cell"]}, "cell has an edge that is not a positive length"),
        ({"cell": given["cell"][:1].copy()}, r"not have the shape \(2, D, D\)"),
        ({"cell": np.ones((2, dimension, dimension))}, "cell is not upper triangular"),
        ({"pairs": given["pairs"] + 2}, "a particle that does not exist"),
        ({"pairs": given["pairs"] - 1}, "a particle that does not exist"),
        ({"shift": given["shift"][:1]}, "pairs and shift"),
        ({"position": given["position"][:, :2].copy()}, "position does not have the shape"),
    ]
    if dimension == 3:
        wrong.append(({"orientation": no_turn}, "the quaternion of particle 1 has no direction"))
    for change, sentence in wrong:
        with pytest.raises(ValueError, match=sentence):
            of.sums(**given | change)
    for margin in BAD_NUMBERS:
        with pytest.raises(ValueError, match="margin is"):
            of.near(**given, margin=margin)
    for k_e in (0.0, -1.0, *BAD_NUMBERS):
        with pytest.raises(ValueError, match="k_e is"):
            particles(shape, dimension, k_e)


@every_shape_in_each_space
def test_sweeps_of_particles_that_are_nowhere_are_refused(shape, dimension):
    of, given = particles(shape, dimension), hard_poses(dimension)
    moves = {"shift": 0.1, "turn": 0.1, "n_sweeps": 1, "seed": 1}
    assert of.sweeps(**given, **moves)["tried"] == N
    for name in given:
        for bad in BAD_NUMBERS:
            spoilt = given[name].copy()
            spoilt.flat[0] = bad
            with pytest.raises(ValueError, match=r"finite|positive length"):
                of.sweeps(**given | {name: spoilt}, **moves)
    for bad in (0.0, -1.0):
        with pytest.raises(ValueError, match="positive length"):
            of.sweeps(**given | {"edges": np.full(dimension, bad)}, **moves)
    for name, wrong in (("shift", (-0.1, 31.0, *BAD_NUMBERS)), ("turn", BAD_NUMBERS)):
        for bad in wrong:
            with pytest.raises(ValueError, match=f"{name} is"):
                of.sweeps(**given, **moves | {name: bad})


@in_each_space
def test_sweeps_keep_to_a_box_however_wide_it_is(dimension):
    of, given = particles(_contact.Spherocylinders, dimension), hard_poses(dimension)
    for edge in (1e9, 1e300):
        given["edges"] = np.full(dimension, edge)
        found = of.sweeps(**given, shift=edge, turn=1.0, n_sweeps=5, seed=1)
        assert np.all((found["position"] >= 0.0) & (found["position"] <= edge))
        assert found["accepted"] > 0


# --- probes ------------------------------------------------------------------------------------


@in_each_space
def test_bodies_that_are_nowhere_are_refused(dimension):
    rods = np.zeros((2, 2 * dimension + 2))
    rods[:, dimension], rods[:, -2:] = 1.0, (2.0, 1.0)
    rods[1, 0] = 5.5  # two half lengths of 2 and two radii of 1 away, less 0.5
    turn = [0.3] if dimension == 2 else [1.0, 0.0, 0.0, 0.0]
    boxes = np.tile([0.0] * dimension + turn + [1.0] * dimension + [2.0], (2, 1))
    boxes[1, 0] = 1.5

    def of_rods(i, j):
        _contact.spine_distances(i, j)
        return _contact.spherocylinder_contacts(i, j, 1.0, 2)

    def of_boxes(i, j):
        _contact.superellipsoid_scales(i, j)
        return _contact.superellipsoid_contacts(i, j, 1.0)

    for probe, rows in ((of_rods, rods), (of_boxes, boxes)):
        assert probe(rows[:1], rows[1:])["status"][0] == 1
        for column in range(rows.shape[1]):
            for bad in BAD_NUMBERS:
                spoilt = rows.copy()
                spoilt[1, column] = bad
                for pair in ((spoilt[:1], spoilt[1:]), (spoilt[1:], spoilt[:1])):
                    with pytest.raises(
                        ValueError, match=r"body 0 is (without a finite pose|not a valid shape)"
                    ):
                        probe(*pair)
    for bad in (-1.0, 0.0):
        spoilt = rods.copy()
        spoilt[0, -1] = bad
        with pytest.raises(ValueError, match="not a valid shape"):
            of_rods(spoilt[:1], spoilt[1:])
    with pytest.raises(ValueError, match="of normals is nan"):
        _contact.superellipsoid_scales(boxes[:1], boxes[1:], np.full((1, dimension), np.nan))


def test_a_network_of_contacts_that_is_none_is_refused():
    given = [3, 2, np.array([[0, 1]]), np.array([[1.0, 0.0, 0.0]]), np.zeros((1, 2), bool)]
    assert _contact.find_rattlers(*given).all()
    for at, bad, sentence in (
        (1, 4, "dimension is 4"),
        (2, np.array([[0, 3]]), "does not exist"),
        (2, np.array([[-1, 0]]), "does not exist"),
        (3, np.array([[np.nan, 0.0, 0.0]]), "of normals is nan"),
        (4, np.zeros((2, 2), bool), "differ in length"),
    ):
        with pytest.raises(ValueError, match=sentence):
            _contact.find_rattlers(*given[:at], bad, *given[at + 1 :])


# --- landscapes and factors -------------------------------------------------------------------


def local_model(skin=0.5):
    return particles(_contact.Spherocylinders, 2).local_energy_model(skin)


def about_a_base():
    of, given = local_model(), arguments(2)
    del given["pairs"], given["shift"]
    of.move_to(**given)
    return of, given


def test_skins_that_are_no_lengths_are_refused():
    for bad in (*BAD_NUMBERS, 0.0, -1.0):
        with pytest.raises(ValueError, match=r"skin is .*, expected a positive length"):
            local_model(skin=bad)


def test_a_landscape_without_a_base_has_no_energy():
    of, x = local_model(), np.zeros(9)
    for ask in (of.move, lambda *at: of.evaluate(*at, False)):
        with pytest.raises(ValueError, match="there is no base yet"):
            ask(x, 0.0)
    with pytest.raises(ValueError, match="there is no base yet"):
        of.solve_stage(stage(), None, 0)


@pytest.mark.parametrize("bad", BAD_NUMBERS)
def test_points_of_a_landscape_that_are_no_numbers_are_refused(bad):
    of, given = about_a_base()
    x, y = np.zeros(9), np.zeros(9)
    assert of.evaluate(x, 0.0, False) is not None
    y[4] = bad
    for ask in (of.move, lambda *at: of.evaluate(*at, False)):
        with pytest.raises(ValueError, match="number 4 of x is"):
            ask(y, 0.0)
        with pytest.raises(ValueError, match="strain is"):
            ask(x, bad)
    with pytest.raises(ValueError, match="expected one for each of 9"):
        of.evaluate(x[:8], 0.0, False)
    for name in given:
        spoilt = given[name].copy()
        spoilt.flat[1] = bad
        with pytest.raises(ValueError, match=f"of {name} is"):
            of.move_to(**given | {name: spoilt})


def stage(**parts):
    units = _contact.StageUnits(1.0, 1.0, 1.0, N)
    given = {"drag": np.ones(9), "centre": np.zeros(9), "guess": np.zeros(9), "other": np.zeros(9)}
    given |= {"extended": False} | parts
    return _contact.Stage(units=units, limits=_contact.StageLimits(1e-9, 0.1, 0.1), **given)


def test_stages_and_factors_of_another_size_are_refused():
    of, given = about_a_base()
    end = of.solve_stage(stage(), None, 0)
    assert end.solved
    for name in ("drag", "centre", "guess", "other"):
        with pytest.raises(ValueError, match="a vector of a stage does not have one number"):
            of.solve_stage(stage(**{name: np.zeros(8)}), None, 0)
        with pytest.raises(ValueError, match="a vector of a stage is nan"):
            of.solve_stage(stage(**{name: np.full(9, np.nan)}), None, 0)
    discs = _contact.Spherocylinders(np.full((N, 3), 2.0), np.zeros((N, 0)), 2, 1.0, 1)
    round_ones = discs.local_energy_model(0.5)
    round_ones.move_to(**given)
    fewer = round_ones.factorise(np.zeros(6), 0.0, np.ones(6))
    with pytest.raises(ValueError, match="right does not have"):
        fewer.solve(np.ones((1, 9)))
    with pytest.raises(ValueError, match="factors have another number of coordinates"):
        of.solve_stage(stage(), fewer, 0)


def test_a_pair_that_crosses_is_named_by_its_particles():
    of, given = about_a_base()
    assert [len(rows) for rows in of.evaluate(np.zeros(9), 0.0, False)[5:7]] == [0, 0]
    given["position"][0, 2] = given["position"][0, 1]
    given["orientation"][0, 2] = 1.0
    of.move_to(**given)
    np.testing.assert_array_equal(of.evaluate(np.zeros(9), 0.0, False)[5], [[1, 2]])


def deformation(dimension=2):
    return np.stack([np.eye(dimension), np.zeros((dimension, dimension))]), np.zeros((N, 1))


def test_only_a_base_that_is_held_can_be_deformed():
    of = local_model()
    with pytest.raises(ValueError, match="there is no base yet, expected move_to before"):
        of.hold()
    for prepare in (lambda: None, lambda: of.move_to(**split(poses(2)))):
        prepare()
        with pytest.raises(ValueError, match="no base is held, expected move_to and hold before"):
            of.deform(*deformation())
    of.hold()
    of.deform(*deformation())
    np.testing.assert_array_equal(of.poses[0], split(poses(2))["position"])


def test_deformations_that_are_none_are_refused():
    of, *_ = about_a_base()
    of.hold()
    before = [x.copy() for x in of.poses]
    for bad in BAD_NUMBERS:
        matrix, turns = deformation()
        matrix[1, 0, 1] = bad
        with pytest.raises(ValueError, match="of matrix is"):
            of.deform(matrix, turns)
        matrix, turns = deformation()
        turns[1] = bad
        with pytest.raises(ValueError, match="of turns is"):
            of.deform(matrix, turns)
    for matrix, sentence in (
        (np.ones((2, 2, 2)), "matrix is not upper triangular"),
        (-deformation()[0], "matrix has an edge that is not a positive length"),
        (np.ones((2, 3, 3)), "matrix does not have the shape"),
    ):
        with pytest.raises(ValueError, match=sentence):
            of.deform(matrix, np.zeros((N, 1)))
    for found, expected in zip(of.poses, before, strict=True):
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("threads", [0, -1, 1025, 2**40])
def test_teams_of_no_size_are_refused(threads):
    with pytest.raises(ValueError, match=f"threads is {threads}, expected from 1 to 1024"):
        _contact.counts_of_team(threads, 1, 1)
    with pytest.raises(ValueError, match=f"threads is {threads}, expected from 1 to 1024"):
        local_model().share(threads)


def test_no_particles_have_an_empty_gradient():
    """Arrays without rows have no place to begin at."""
    of = _contact.Spherocylinders(np.zeros((0, 3)), np.zeros((0, 0)), 2, 1.0, 1)
    of = of.local_energy_model(0.5)
    of.move_to(np.zeros((2, 0, 2)), np.zeros((2, 0, 1)), split(poses(2))["cell"])
    assert of.evaluate(np.zeros(0), 0.0, False)[1].shape == (0,)
    assert _contact.find_rattlers(
        0, 2, np.zeros((0, 2), int), np.zeros((0, 3)), np.zeros((0, 2), bool)
    ).shape == (0,)
