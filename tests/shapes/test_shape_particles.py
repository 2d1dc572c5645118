"""Sizes, moments, outlines and surfaces of particles of every shape; random starts and hard particles."""

import math
import re

import numpy as np
import pytest
from every_shape import (
    ALL,
    EPS,
    MIXTURES,
    PLACES,
    PURE,
    TYPICAL,
    close_to,
    examples,
    particles_of,
    scattered,
)
from scipy.spatial import cKDTree

from jamshape.contacts import find_contacts, find_rattlers
from jamshape.packing import Packing
from jamshape.protocols.random_start import dilute_packing, random_packing
from jamshape.protocols.thermal import Thermal, equilibrate
from jamshape.shapes.particles import Particles
from jamshape.shapes.shape import Interaction
from jamshape.shapes.table import SHAPES, guess_shape_style, shape_named

ONE_OF_EACH = pytest.mark.parametrize("case", PURE, ids=str)


def lone(case):
    """The sizes and the compiled object of one small and one big particle."""
    sizes = particles_of(case).sample(2, np.random.default_rng(1))
    shape = SHAPES[case.shape]
    return sizes, shape.compiled((sizes.diameters, sizes.form), case.dimension, Interaction())


def alike(found, expected, rounding=1e-12):
    """Whether parameters agree: numbers up to rounding, texts exactly."""
    return found.keys() == expected.keys() and all(
        value
        == (other if isinstance(other, str) else pytest.approx(other, rel=rounding, abs=rounding))
        for value, other in ((found[name], expected[name]) for name in expected)
    )


# --- sizes ---------------------------------------------------------------------------------------


@ONE_OF_EACH
def test_parameters_make_particles_that_fit_and_come_back(case):
    shape = SHAPES[case.shape]
    assert shape_named(shape.name) is shape
    usual = {p.name: p.default for p in shape.needed}
    parameters = shape.reduced(usual | examples(case.shape)[case.which])
    size = np.array([0.3, 1.0, 7.0])
    diameters, form = shape.sizes(parameters, size)
    assert diameters.shape == (3, 3)
    assert form.shape[:1] == (3,)
    assert (diameters > 0).all()
    assert shape.fits(diameters)
    np.testing.assert_allclose(diameters, size[:, None] * diameters[1], rtol=4 * EPS)
    for k in range(3):
        found, its_size = shape.parameters_of(diameters[k], form[k])
        assert alike(found, parameters, 1e-14)
        assert its_size == close_to(size[k], 1e-15)
    assert SHAPES[guess_shape_style(diameters)].fits(diameters)
    shape.check_form(form, case.dimension)
    assert "$" in shape.label(parameters)
    told = shape.described(diameters, form, case.dimension)
    assert all(map(math.isfinite, told.values()))
    assert told["aspect_ratio"] >= 1
    # It is round if and only if it fills the circle or sphere around it.
    is_round = not shape.compiled(
        (diameters[:1], form[:1]), case.dimension, Interaction()
    ).rotation_length[0]
    assert 0 < told["roundness"] < 1 + 1e-12
    assert (told["roundness"] == close_to(1.0, 1e-12)) == is_round


@pytest.mark.parametrize("name", SHAPES)
def test_names_of_files_and_labels_tell_parameters_apart(name):
    shape = SHAPES[name]
    defaults = {p.name: p.default for p in shape.needed}
    sets = [shape.reduced(defaults | given) for given in examples(name)]
    for text in (shape.stem, shape.label):
        assert len({text(parameters) for parameters in sets}) == len(sets)
    assert all(not set("/ \\") & set(shape.stem(parameters)) for parameters in sets)
    close = [{p: slightly_more(value, k) for p, value in sets[0].items()} for k in range(3)]
    assert len({shape.stem(parameters) for parameters in close}) == 3
    for parameter in shape.parameters:
        with pytest.raises(ValueError, match="expected"):
            Particles.of(name, **{parameter.name: -1.0})


def slightly_more(value, k):
    """A parameter times 1 + 1e-7 k; in texts, each number of it."""
    if not isinstance(value, str):
        return value * (1 + 1e-7 * k)
    return re.sub(r"[^\s/]+", lambda number: repr(float(number[0]) * (1 + 1e-7 * k)), value)


@ONE_OF_EACH
def test_lengths_grow_with_the_size_and_enclose_each_other(case):
    sizes, bodies = lone(case)
    D, factor = case.dimension, sizes.diameters[1, 0] / sizes.diameters[0, 0]
    assert factor > 1
    lengths = ["outer_radius", "inner_radius", "rotation_length", "turning_radius"]
    for name, power in [("measure", D), ("moment", 2), *((name, 1) for name in lengths)]:
        small, big = getattr(bodies, name)
        np.testing.assert_allclose(big, factor**power * small, rtol=1e-12, err_msg=name)
    ball = math.pi * bodies.outer_radius**2 * (1 if D == 2 else 4 / 3 * bodies.outer_radius)
    assert (bodies.measure > 0).all()
    assert (bodies.measure <= ball * (1 + 4 * EPS)).all()
    assert (bodies.moment[:, 2] > 0).all()
    assert (bodies.moment <= bodies.outer_radius[:, None] ** 2).all()
    assert (bodies.inner_radius > 0).all()
    assert (bodies.inner_radius <= bodies.outer_radius).all()
    assert (bodies.turning_radius <= bodies.outer_radius * (1 + 4 * EPS)).all()
    assert ((bodies.turning_radius > 0) == (bodies.rotation_length > 0)).all()


@ONE_OF_EACH
def test_round_particles_are_discs_and_spheres(case):
    _, bodies = lone(case)
    D = case.dimension
    is_round = bodies.rotation_length == 0
    r = bodies.outer_radius
    measure, moment = math.pi * r**2, r**2 / 2
    if D == 3:
        measure, moment = 4 / 3 * math.pi * r**3, 0.4 * r**2
    # All others have less in the same circle.
    np.testing.assert_allclose(bodies.measure[is_round], measure[is_round], rtol=8 * EPS)
    np.testing.assert_allclose(bodies.moment[is_round, 2], moment[is_round], rtol=8 * EPS)
    np.testing.assert_allclose(bodies.inner_radius[is_round], r[is_round], rtol=8 * EPS)
    assert (bodies.measure[~is_round] < measure[~is_round] * (1 - 1e-6)).all()


# --- drawings ------------------------------------------------------------------------------------


def areas_and_moments(corners):
    """Area of a closed polygon counter-clockwise, and mean of x^2 + y^2 in it."""
    a, b = corners, np.roll(corners, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    second = ((a * a + a * b + b * b).sum(axis=1) * cross).sum() / 12
    area = cross.sum() / 2
    return area, second / area


@pytest.mark.parametrize("case", [c for c in PURE if c.dimension == 2], ids=str)
def test_outlines_have_the_area_and_the_moment_of_the_particle(case, measured):
    sizes, bodies = lone(case)
    off = []
    for points in (200, 800):
        outline = SHAPES[case.shape].outline(sizes.diameters[1], sizes.form[1], points)
        area, moment = areas_and_moments(outline)
        off.append((abs(area / bodies.measure[1] - 1), abs(moment / bodies.moment[1, 2] - 1)))
        radius = np.linalg.norm(outline, axis=1)
        assert radius.max() == close_to(bodies.outer_radius[1], 1e-3)
        assert (radius <= bodies.outer_radius[1] * (1 + 1e-12)).all()
        assert len(outline) >= points / 2
    measured(area=off[1][0], moment=off[1][1])
    # The area between an arc and its chord falls as the square of its length.
    assert np.max(off[0]) < 0.03
    assert np.max(off[1]) < np.max(off[0]) / 4


def are_there_and_back(outline):
    """Whether each step of an outline is also taken the other way round."""
    after = np.roll(outline, -1, axis=0)
    there, back = np.hstack([outline, after]), np.hstack([after, outline])
    nearest, _ = cKDTree(back).query(there, p=np.inf)
    return nearest < 1e-9


@pytest.mark.parametrize("case", [c for c in PURE if c.dimension == 2], ids=str)
def test_perimeter_and_asphericity_are_those_of_the_outline(case, measured):
    sizes, bodies = lone(case)
    shape, body = SHAPES[case.shape], (sizes.diameters[1], sizes.form[1])
    length, off = shape.perimeter(*body), []
    for points in (400, 1600):
        outline = shape.outline(*body, points)
        chords = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
        # Long ones are straight sides, or lead from one closed curve to another and back.
        off.append(1 - chords[~are_there_and_back(outline)].sum() / length)
    measured(perimeter=off[1])
    # Chords are shorter than arcs, by the square of their length.
    assert 0 <= off[1] < 1e-4
    assert off[1] <= off[0] / 8 + 1e-14
    found = shape.described(sizes.diameters[1:], sizes.form[1:], 2)["asphericity"]
    assert found == close_to(length**2 / (4 * math.pi * bodies.measure[1]), 1e-14)
    assert found >= 1 - 1e-14  # the isoperimetric inequality
    is_disc = bodies.rotation_length[1] == 0
    assert (found == close_to(1.0, 1e-12)) == is_disc


def volume_and_moments(mesh):
    """Volume of a closed mesh by tetrahedra from the centre, and moments of inertia about x, y, z."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    volume = np.linalg.det(np.stack([a, b, c], axis=1)) / 6
    total = a + b + c
    square = (a * a + b * b + c * c + total * total) / 20
    means = (volume[:, None] * square).sum(axis=0) / volume.sum()
    return volume.sum(), means.sum() - means


@pytest.mark.parametrize("case", [c for c in PURE if c.dimension == 3], ids=str)
def test_surfaces_are_closed_and_have_the_volume_and_the_moments(case, measured):
    sizes, bodies = lone(case)
    off = []
    for level in (2, 4):
        mesh = SHAPES[case.shape].surface(sizes.diameters[1], sizes.form[1], level)
        volume, moments = volume_and_moments(mesh)
        off.append([abs(volume / bodies.measure[1] - 1), *np.abs(moments / bodies.moment[1] - 1)])
        assert_closed(mesh)
        outward = np.cross(*(mesh.vertices[mesh.triangles[:, k]] - mesh.vertices[mesh.triangles[:, 0]]
                             for k in (1, 2)))  # fmt: skip
        along = (outward * mesh.normals[mesh.triangles[:, 0]]).sum(axis=1)
        assert (along >= -1e-12).mean() > 0.95
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, rtol=1e-12)
        radius = np.linalg.norm(mesh.vertices, axis=1)
        assert (radius <= bodies.outer_radius[1] * (1 + 1e-12)).all()
    measured(volume=off[1][0], moments=max(off[1][1:]))
    assert np.max(off[1]) < 0.03
    assert np.max(off[1]) < np.max(off[0]) / 4


def numbers_of(rows):
    """(M,) numbers of rows, the same for equal ones."""
    order = np.lexsort(rows.T)
    differs = (rows[order][1:] != rows[order][:-1]).any(axis=1)
    found = np.empty(len(rows), int)
    found[order] = np.cumsum(np.append(0, differs))
    return found


def assert_closed(mesh):
    """Each edge of a triangle is one of another, the other way round."""
    triangles = numbers_of(np.round(mesh.vertices, 9) + 0.0)[mesh.triangles]
    whole = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    edges = np.concatenate([whole[:, [0, 1]], whole[:, [1, 2]], whole[:, [2, 0]]])
    ends = len(mesh.vertices) * edges + edges[:, ::-1]  # in one number
    there, counts = np.unique(ends[:, 0], return_counts=True)
    back, others = np.unique(ends[:, 1], return_counts=True)
    np.testing.assert_array_equal(there, back)
    np.testing.assert_array_equal(counts, others)


# --- directions ----------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ALL, ids=str)
def test_freedoms_and_directions_agree(case):
    packing = scattered(case)
    D, n_turns = case.dimension, 1 if case.dimension == 2 else 3
    turns = (packing.turning_axes != 0).any(axis=2).sum(axis=1)
    expected = packing.freedoms - D
    np.testing.assert_array_equal(np.where(packing.is_round, 0, turns), expected)
    assert set(expected.tolist()) <= {0, 1, 2, 3}
    assert expected.max(initial=0) <= n_turns
    directed = ~np.isnan(packing.directors[:, 0])
    np.testing.assert_allclose(np.linalg.norm(packing.directors[directed], axis=1), 1, rtol=8 * EPS)
    assert not (directed & packing.is_round).any()
    assert packing.phi == close_to(packing.measures.sum() / packing.box.volume, 1e-15)
    spine = SHAPES[case.shape].spine(packing.diameters[0])
    assert 0 <= spine <= packing.outer_radius[0]


# --- mixtures ------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", MIXTURES, ids=str)
def test_mixtures_hold_all_examples(case):
    packing = scattered(case, 4 * len(examples(case.shape)))
    kinds = np.unique(packing.species)
    assert len(kinds) == len(examples(case.shape))
    found = []
    for kind in kinds:
        own = np.flatnonzero(packing.species == kind)
        assert len(np.unique(packing.diameters[own], axis=0)) > 1  # sizes are spread
        told = [
            SHAPES[case.shape].parameters_of(packing.diameters[i], packing.form[i])[0] for i in own
        ]
        found.append(told[0])
        for one in told:
            assert alike(one, told[0])
    shape = SHAPES[case.shape]
    defaults = {p.name: p.default for p in shape.needed}
    for given in examples(case.shape):
        assert any(alike(one, shape.reduced(defaults | given)) for one in found)


# --- random starts -------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ALL, ids=str)
def test_random_starts_have_no_overlaps_and_follow_from_the_seed(case):
    packing = scattered(case, seed=3)
    assert not len(find_contacts(packing).pairs)
    assert find_rattlers(packing, find_contacts(packing)).all()
    again, other = scattered(case, seed=3), scattered(case, seed=4)
    np.testing.assert_array_equal(again.position, packing.position)
    np.testing.assert_array_equal(again.orientation, packing.orientation)
    assert not np.array_equal(other.position, packing.position)


@pytest.mark.parametrize("case", TYPICAL, ids=str)
def test_starts_have_the_packing_fraction_that_was_asked_for(case):
    for make in (random_packing, dilute_packing):
        packing = make(10, 0.2, 1, particles_of(case), case.dimension)
        assert packing.phi == close_to(0.2, 1e-13)
        assert packing.shape_style == case.shape


# --- hard particles ------------------------------------------------------------------------------


def dilute(case):
    """In a box that is longer than two particles."""
    for n in (12, 24, 48, 96):
        packing = scattered(case, n, phi=0.06)
        if packing.box.edges.min() > 4.1 * packing.outer_radius.max():
            return packing
    raise AssertionError


def swept(packing: Packing, n_sweeps, seed, size=0.1):
    thermal = Thermal(packing, size=size)
    for _ in equilibrate(thermal, n_sweeps, seed):
        assert not len(find_contacts(thermal.packing).pairs)
    return thermal


@pytest.mark.parametrize("case", ALL, ids=str)
def test_hard_particles_move_turn_and_keep_apart(case):
    start = dilute(case)
    found = swept(start, 40, 1)
    assert 0.05 < found.acceptance <= 1
    moved = np.abs(found.packing.position - start.position).max(axis=1)
    assert (moved > 0).all()
    turned = np.abs(found.packing.orientation - start.orientation).reshape(start.n, -1).max(axis=1)
    assert (turned[~start.is_round] > 0).all()
    for name in ("diameters", "species", "id", "form"):
        np.testing.assert_array_equal(getattr(found.packing, name), getattr(start, name))


@pytest.mark.parametrize("case", TYPICAL, ids=str)
def test_sweeps_may_be_cut_and_depend_on_the_seed(case):
    start = dilute(case)
    whole, half, other = swept(start, 30, 1), swept(start, 10, 1), swept(start, 30, 2)
    rest = Thermal(half.packing, half.n_done, half.size)
    for _ in equilibrate(rest, 30, 1):
        pass
    np.testing.assert_array_equal(rest.packing.position, whole.packing.position)
    np.testing.assert_array_equal(rest.packing.orientation, whole.packing.orientation)
    assert not np.array_equal(other.packing.position, whole.packing.position)


@pytest.mark.parametrize("case", TYPICAL, ids=str)
def test_particles_that_overlap_are_no_start_of_hard_ones(case):
    packing = dilute(case)
    position = packing.position.copy()
    position[1] = position[0] + 0.1 * packing.compiled().inner_radius[0]
    with pytest.raises(ValueError, match="overlap"):
        next(equilibrate(Thermal(packing.with_(position=position)), 10, 1))


@pytest.mark.parametrize("case", TYPICAL, ids=str)
def test_a_box_shorter_than_two_particles_is_refused(case):
    packing = scattered(case, 2, 0.3)
    with pytest.raises(ValueError, match="box is shorter than two particles"):
        next(equilibrate(Thermal(packing), 10, 1))


@pytest.mark.parametrize(("name", "dimension"), PLACES)
def test_every_shape_has_its_compiled_class(name, dimension):
    _, bodies = lone(next(c for c in PURE if c[:2] == (name, dimension)))
    assert bodies.name == name
    assert bodies.most_bonds >= 1
