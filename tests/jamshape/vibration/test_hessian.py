"""The dynamical matrix against differences of forces, closed forms, and what it must leave alone."""

from dataclasses import replace

import numpy as np
import pytest
from lattices import discs
from pressed import PRESSED, pressed_named
from scenes import make, scaled
from small_packings import SMALL, jammed, matrix_of
from thinned import in_turn

from jamshape.contacts import ContactKind
from jamshape.landscape import Landscape, State
from jamshape.packing import Box
from jamshape.vibration.hessian import (
    LARGEST_RESIDUAL,
    DynamicalMatrixOptions,
    NotAtMinimumError,
    dynamical_matrix,
    matrix_at,
)
from jamshape.vibration.spectrum import spectrum

H = 1e-6


def assert_close(found, expected, relative):
    found, expected = np.asarray(found), np.asarray(expected)
    scale = np.abs(expected).max()
    assert scale > 0
    np.testing.assert_allclose(found, expected, rtol=0, atol=relative * scale)


def slopes(state, matrix, value):
    """Central differences of a function of a state by each coordinate, in the last axis."""
    columns = []
    for unit in np.eye(matrix.size):
        ahead, behind = (
            state.displaced(*matrix.coordinates.motion(step * unit)) for step in (H, -H)
        )
        columns.append((value(ahead) - value(behind)) / (2 * H))
    return np.stack(columns, axis=-1)


def forced(packing, sides=2, **options):
    landscape, state = Landscape(packing, 2.5, sides), State.of(packing)
    everyone = np.ones(packing.n, bool)
    return (
        landscape,
        state,
        dynamical_matrix(
            landscape, state, DynamicalMatrixOptions(backbone=everyone, force=True, **options)
        ),
    )


# --- derivatives -------------------------------------------------------------------------------


OPTIONS = [(2, "half_length"), (1, "radius"), (2, "radius"), (1, "half_length")]


@pytest.mark.parametrize(("name", "options"), in_turn([*PRESSED], OPTIONS))
def test_matrix_is_the_slope_of_the_forces(name, options):
    sides, rotation = options
    landscape, state, matrix = forced(pressed_named(name), sides, rotation=rotation)

    def gradient(at):
        return matrix_at(landscape, at, matrix.coordinates).gradient

    expected = slopes(state, matrix, gradient)
    if state.dimension == 3:  # rotations about different axes do not commute
        expected = (expected + expected.T) / 2
    found = matrix.matrix.toarray()
    assert_close(found, expected, 1e-7)
    np.testing.assert_array_equal(matrix.prestress.toarray(), matrix.prestress.toarray().T)
    assert_close(found, found.T, 1e-15)


def test_packings_have_contacts_of_all_classes_and_across_the_box():
    kinds, crossing = set(), 0
    for name in PRESSED:
        contacts = forced(pressed_named(name))[2].contacts
        kinds |= set(contacts["kind"].tolist())
        crossing += np.any(contacts["shift"] != 0)
    assert kinds == {int(kind) for kind in ContactKind}
    assert crossing == len(PRESSED)


@pytest.mark.parametrize("name", ["discs", "rods of alpha 1", "rods of alpha 4"])
def test_rows_of_the_compatibility_are_slopes_of_the_bonds_lengths(name):
    landscape, minimum = jammed(name, 1e-8)
    matrix = matrix_of(name, 1e-8)

    def lengths(at):
        there = matrix_at(landscape, at, matrix.coordinates)
        assert there.n_bonds == matrix.n_bonds
        return there.contacts["distance"][there.bonds.contact, there.bonds.slot]

    step = 1e-9  # overlaps are 1e-4, the slightest 1e-8: no contact may open
    rows = []
    for unit in np.eye(matrix.size):
        shift, turn = matrix.coordinates.motion(step * unit)
        ahead, behind = (minimum.state.displaced(s * shift, s * turn) for s in (1, -1))
        rows.append((lengths(ahead) - lengths(behind)) / (2 * step))
    expected = np.sqrt(matrix.bonds.stiffness)[:, None] * np.array(rows).T
    assert_close(matrix.compatibility.toarray(), expected, 1e-6)  # doubles / step


@pytest.mark.parametrize("name", PRESSED)
def test_translations_are_null_vectors_of_both_parts(name):
    *_, matrix = forced(pressed_named(name))
    T = matrix.translations
    D = matrix.coordinates.dimension
    assert T.shape[1] % D == 0  # random packings have several clusters
    np.testing.assert_allclose(T.T @ T, np.eye(T.shape[1]), atol=1e-15)
    assert np.abs(matrix.compatibility @ T).max() < 1e-15
    assert np.abs(matrix.prestress @ T).max() < 1e-14 * np.abs(matrix.prestress).max()


def test_strains_are_second_derivatives():
    packing = pressed_named("rods of alpha 4")
    landscape, state, matrix = forced(packing)
    strain = np.array([[0.3, 0.0], [0.0, -0.7]])
    found = matrix.strained(strain[None])

    def strained(size):
        factors = (1 + size * np.diag(strain)).astype(np.longdouble)
        cell = factors[:, None] * state.cell
        return replace(state, position=state.position * factors, cell=cell)

    def gradient_and_slope(at):
        there = matrix_at(landscape, at, matrix.coordinates)
        r = there.contacts["separation"] / (at.edges / state.edges).astype(float)
        slope = -np.einsum("ca,ab,cb->", there.contacts["force"], strain, r)
        return np.append(there.gradient, slope)

    by_strain = (gradient_and_slope(strained(H)) - gradient_and_slope(strained(-H))) / (2 * H)
    coupling = matrix.compatibility.T @ found.stretched[:, 0] + found.pushed[:, 0]
    assert_close(coupling, by_strain[:-1], 1e-7)
    second = (found.stretched[:, 0] ** 2).sum() + found.affine[0, 0]
    assert second == pytest.approx(by_strain[-1], rel=1e-7)


def test_coupled_bonds_have_their_stiffness_in_the_compatibility():
    # Two bonds of nearly round rods, on their way to one; y = 100.
    n, half_length, overlap = 4, 1e-4, 1e-6
    height = 1 - overlap
    position = [[5.0, height * (i + 0.5)] for i in range(n)]
    packing = make(position, 0.0, half_length, edges=(20.0, n * height))
    *_, matrix = forced(packing)
    assert matrix.contacts["coupling"].all()
    assert matrix.n_bonds == 2 * n
    landscape = Landscape(packing, 2.5)
    whole = landscape.curvature(State.of(packing), extended=True).hessian.toarray()
    assert_close(matrix.matrix.toarray(), whole, 1e-14)
    # The forces of the bonds, and nothing else at a minimum.
    assert np.abs(matrix.compatibility.T @ matrix.bonds.pull).max() < 1e-12
    stiffness = np.sort(np.linalg.eigvalsh(matrix.stiffness.toarray()))
    moves = 2.5 * (2 - 2 * np.cos(2 * np.pi * np.arange(n) / n))
    stiff = stiffness[stiffness > 1e-6]  # turns are stiffer yet
    np.testing.assert_allclose(stiff[: n - 1], np.sort(moves)[1:], rtol=1e-2)


# --- closed forms ------------------------------------------------------------------------------


@pytest.mark.parametrize("overlap", [1e-2, 1e-8])
def test_a_hexagonal_crystal_of_discs_has_its_dispersion(overlap):
    columns, rows, k_e = 6, 6, 1.0
    a = 1 - overlap
    x, y = np.meshgrid(np.arange(columns) + 0.25, np.arange(rows) + 0.25)
    position = a * np.column_stack(
        [(x + 0.5 * (np.arange(rows)[:, None] % 2)).ravel(), np.sqrt(0.75) * y.ravel()]
    )
    edges = np.array([columns * a, rows * np.sqrt(0.75) * a])
    packing = discs(position, edges)
    matrix = dynamical_matrix(Landscape(packing), State.of(packing))
    stiffness, force = k_e, k_e * (1 - a)
    neighbours = np.array([[np.cos(t), np.sin(t)] for t in np.pi / 3 * np.arange(3)])
    expected = []
    for i in range(columns):
        for j in range(rows):
            q = 2 * np.pi * np.array([i, j]) / edges
            D = np.zeros((2, 2))
            for e in neighbours:
                along, across = stiffness, -force / a
                block = along * np.outer(e, e) + across * (np.eye(2) - np.outer(e, e))
                D += 2 * (1 - np.cos(a * q @ e)) * block
            expected.extend(np.linalg.eigvalsh(D))
    expected = np.sort(expected)
    found = spectrum(matrix)
    real = ~found.is_translation
    np.testing.assert_allclose(found.eigenvalues[real], expected[2:], rtol=1e-6 * overlap + 1e-11)
    assert matrix.n_bonds == 3 * packing.n


def stack(half_lengths, overlap=1e-8, k_e=1.0):
    """Parallel rods above each other, in a box just as high."""
    n = len(half_lengths)
    height = 1 - overlap
    packing = make([[8.0, height * (i + 0.5)] for i in range(n)], 0.0, edges=(20.0, n * height))
    A = np.asarray(half_lengths, float)
    packing = packing.with_(diameters=np.column_stack([2 * A + 1, np.ones(n), np.ones(n)]))
    return Landscape(packing, k_e), State.of(packing), A


def test_a_stack_of_two_parallel_rods_is_that_of_its_formula():
    # Above and below each other are the same two rods. A bond is a tip of the short one, at -A or A
    # along it, and a side of the long one: r = n(theta_long) . (tip - x_long).
    overlap = 1e-8
    landscape, state, A = stack([2.0, 1.5], overlap)
    matrix = dynamical_matrix(landscape, state)
    short, force, r = 1.5, overlap, 1 - overlap
    expected = np.zeros((6, 6))
    for side in (1, -1):  # the short rod above the long one, and below
        for s in (short, -short):
            n = np.array([0.0, side])
            # x, y, theta of the long rod and of the short one
            gradient = np.array([-n[0], -n[1], -side * s, n[0], n[1], side * s])
            second = np.zeros((6, 6))
            second[2, 2] = -r
            # d n / d theta_long = -side x: moves along x turn into distance
            second[2, 0] = second[0, 2] = side
            second[2, 3] = second[3, 2] = -side
            # the tip turns about its own centre: no second derivative for parallel rods but
            # with the turn of the normal, d n . d(tip) = (-side x) . (s y) = 0
            expected += np.outer(gradient, gradient) - force * second
    length = np.array([1, 1, A[0], 1, 1, A[1]])
    expected /= np.outer(length, length)
    np.testing.assert_allclose(matrix.matrix.toarray(), expected, rtol=0, atol=1e-15)
    prestress = matrix.stiffness.toarray() - expected
    assert np.abs(prestress).max() > 1e-9
    np.testing.assert_allclose(matrix.prestress.toarray(), prestress, rtol=0, atol=2e-16)
    # Rotation against each other: k A^2 for each bond; sliding: exactly nothing.
    turns = matrix.stiffness.toarray()[2::3, 2::3]
    turn = 4 * short**2 * np.array([[1, -1], [-1, 1]]) / np.outer(A, A)
    np.testing.assert_allclose(turns, turn, rtol=1e-14, atol=1e-15)
    assert np.abs(matrix.matrix.toarray()[[0, 3]][:, [0, 1, 3, 4]]).max() < 1e-23


@pytest.mark.parametrize("n", [2, 3, 6])
def test_rods_of_a_stack_slide_for_nothing_in_first_order(n):
    landscape, state, _ = stack(
        [2.0 if i % 2 else 1.5 for i in range(n)] if n != 3 else [2, 1.5, 1]
    )
    matrix = dynamical_matrix(landscape, state)
    slide = np.zeros((matrix.size, n))
    slide[np.arange(n) * 3, np.arange(n)] = 1.0
    assert np.abs(matrix.compatibility @ slide).max() == 0
    assert np.abs(slide.T @ (matrix.prestress @ slide)).max() < 1e-23
    found = spectrum(matrix)
    assert (np.abs(found.eigenvalues) < 1e-13).sum() >= n + 1  # these, and moving along y


def test_three_discs():
    # Each touches both others: a breathing mode of 3 k / 2 times 2, and two of 3 k / 2.
    side = 1 - 1e-12
    position = 5 + side / np.sqrt(3) * np.array(
        [[np.cos(t), np.sin(t)] for t in 2 * np.pi / 3 * np.arange(3)]
    )
    packing = discs(position, (20.0, 20.0))
    landscape, state = Landscape(packing), State.of(packing)
    with pytest.raises(ValueError, match="all 3 particles are rattlers"):
        dynamical_matrix(landscape, state)
    matrix = dynamical_matrix(
        landscape, state, DynamicalMatrixOptions(backbone=np.ones(3, bool), force=True)
    )
    values = np.linalg.eigvalsh(matrix.stiffness.toarray())
    np.testing.assert_allclose(values, [0, 0, 0, 1.5, 1.5, 3], rtol=1e-11, atol=1e-15)
    found = spectrum(matrix)
    assert found.rank() == 3
    # The third null mode of H turns the cluster, which costs as much as it is out of balance.
    turn = np.array([[-y, x] for x, y in position - position.mean(axis=0)]).ravel()
    turn /= np.linalg.norm(turn)
    assert np.abs(matrix.compatibility @ turn).max() < 1e-15
    rotation = found.vectors[:, :3][:, ~found.is_translation[:3]][:, 0]
    assert abs(rotation @ turn) == pytest.approx(1, abs=1e-9)
    assert np.abs(found.eigenvalues[:3]).max() < 1e-11


def test_clusters_move_apart_from_each_other():
    side = 1 - 1e-12
    triangle = (
        side / np.sqrt(3) * np.array([[np.cos(t), np.sin(t)] for t in 2 * np.pi / 3 * np.arange(3)])
    )
    packing = discs(np.concatenate([triangle + 5, triangle + 12]), (20.0, 20.0))
    matrix = dynamical_matrix(
        Landscape(packing),
        State.of(packing),
        DynamicalMatrixOptions(backbone=np.ones(6, bool), force=True),
    )
    assert matrix.translations.shape == (12, 4)
    assert spectrum(matrix).is_translation.sum() == 4
    assert np.abs(matrix.compatibility @ matrix.translations).max() < 1e-15


# --- packings ----------------------------------------------------------------------------------


def test_one_particle_that_holds_itself_by_its_images():
    # Its only freedom but moving is to turn.
    overlap = 1e-8
    box = (4.0 - overlap, 1.0 - overlap)
    packing = make([[1.0, 0.5]], 0.0, half_length=1.5, edges=box)
    matrix = dynamical_matrix(
        Landscape(packing), State.of(packing), DynamicalMatrixOptions(backbone=np.ones(1, bool))
    )
    assert matrix.size == 3
    found = spectrum(matrix)
    assert found.is_translation.sum() == 2
    assert found.sign[found.is_translation].tolist() == [0, 0]


@pytest.mark.parametrize("name", SMALL)
def test_coordinates_are_those_of_the_backbone(name):
    landscape, minimum = jammed(name)
    matrix = matrix_of(name)
    rattlers = landscape.rattlers(minimum.state)
    assert matrix.n_particles == (~rattlers).sum()
    np.testing.assert_array_equal(matrix.coordinates.backbone, np.flatnonzero(~rattlers))
    per_particle = 2 if name == "discs" else 3
    assert matrix.size == per_particle * matrix.n_particles
    assert matrix.coordinates.is_rotation.sum() == (per_particle - 2) * matrix.n_particles
    assert matrix.residual.largest <= 1e-8
    shift, turn = matrix.coordinates.motion(np.ones(matrix.size))
    np.testing.assert_array_equal(shift[rattlers], 0)
    np.testing.assert_array_equal(shift[~rattlers], 1)
    if name != "discs":
        A = landscape.particles.half_length
        np.testing.assert_allclose(turn[~rattlers, 0], 1 / A[~rattlers])


def test_rods_in_space_do_not_spin():
    *_, matrix = forced(pressed_named("rods in space"))
    packing = pressed_named("rods in space")
    assert matrix.size == 5 * packing.n
    for unit in np.eye(matrix.size)[matrix.coordinates.is_rotation]:
        _, turn = matrix.coordinates.motion(unit)
        assert np.abs((turn * packing.axes).sum(axis=1)).max() < 1e-14
        length = packing.half_length[np.abs(turn).max(axis=1) > 0]
        assert np.linalg.norm(turn) == pytest.approx(1 / length[0], rel=1e-14)


def test_lengths_of_rotation_can_be_given():
    packing = pressed_named("discs and rods")
    lengths = np.linspace(1, 2, packing.n)
    *_, matrix = forced(packing, rotation=lengths)
    *_, usual = forced(packing)
    scale = np.where(
        usual.coordinates.is_rotation, packing.half_length[usual.coordinates.particle], 1
    )
    scale = scale / np.where(
        matrix.coordinates.is_rotation, lengths[matrix.coordinates.particle], 1
    )
    expected = usual.matrix.toarray() * np.outer(scale, scale)
    assert_close(matrix.matrix.toarray(), expected, 1e-14)


@pytest.mark.parametrize("rotation", ["area", np.zeros(24), np.full(24, np.nan)])
def test_senseless_lengths_of_rotation_are_refused(rotation):
    with pytest.raises(ValueError, match="expected"):
        forced(pressed_named("rods of alpha 4"), rotation=rotation)


def test_weak_contacts_can_be_left_out():
    landscape, minimum = jammed("rods of alpha 4")
    matrix = matrix_of("rods of alpha 4")
    force = matrix.contacts["bond_force"].sum(axis=1)
    limit = np.sort(force)[3] / matrix.bond_force * 1.0001
    fewer = dynamical_matrix(landscape, minimum.state, DynamicalMatrixOptions(least_force=limit))
    assert fewer.n_left_out == 4
    assert len(fewer.contacts["kind"]) == len(force) - 4
    assert fewer.size == matrix.size
    assert matrix.n_left_out == 0


# --- errors ------------------------------------------------------------------------------------


def test_rattlers_alone_are_refused():
    apart = scaled(pressed_named("rods of alpha 4"), 2.0)
    with pytest.raises(ValueError, match="all 24 particles are rattlers, so there are no modes"):
        dynamical_matrix(Landscape(apart), State.of(apart))


def test_a_state_that_is_no_minimum_is_refused_unless_forced():
    landscape, minimum = jammed("rods of alpha 4")
    shaken = np.random.default_rng(0).normal(size=landscape.size)
    state = landscape.displaced(minimum.state, 1e-9 * shaken)
    with pytest.raises(
        NotAtMinimumError, match=r"largest net force is [0-9.]+ of the mean bond"
    ) as e:
        dynamical_matrix(landscape, state)
    assert "--force" in str(e.value)
    matrix = dynamical_matrix(landscape, state, DynamicalMatrixOptions(force=True))
    assert matrix.residual.largest > LARGEST_RESIDUAL


def test_boxes_may_lie_anywhere():
    landscape, minimum = jammed("rods of alpha 1")
    packing = minimum.state.packing(landscape.particles)
    moved = packing.with_(box=Box(packing.box.lo - 1.7, packing.box.edges))
    one, other = (
        dynamical_matrix(
            Landscape(p), State.of(p), DynamicalMatrixOptions(force=True)
        ).matrix.toarray()
        for p in (packing.with_(box=packing.box), moved)
    )
    assert_close(other, one, 1e-9)
