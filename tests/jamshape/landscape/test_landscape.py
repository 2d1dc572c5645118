import numpy as np
import pytest
from pressed import PRESSED, pressed_named
from scenes import make, scaled

from jamshape.contacts import find_contacts, find_rattlers
from jamshape.landscape import CrossingError, Landscape, State


@pytest.fixture(params=PRESSED)
def packing(request):
    return pressed_named(request.param)


def assert_close(found, expected, relative):
    scale = np.abs(expected).max()
    assert scale > 0
    np.testing.assert_allclose(found, expected, rtol=0, atol=relative * scale)


def test_discs_have_no_rotation_and_rods_one_or_three():
    sizes = {name: Landscape(pressed_named(name)).size for name in PRESSED}
    rods = (24 * 2, 24 * 3, 24 * 3, 24 * 2 + 12, 16 * 6, 16 * 3 + 8 * 3)
    superellipsoids = (11 * 6 + 3, 12 * 6, 14 * 3 + 2 * 2)  # a sphere, discs
    assert tuple(sizes.values()) == rods + superellipsoids
    landscape = Landscape(pressed_named("discs and rods"))
    discs = landscape.particles.half_length == 0
    spread = landscape.components(np.ones(landscape.size))
    np.testing.assert_array_equal(spread[:, 2] == 0, discs)
    np.testing.assert_array_equal(landscape.particle_of_coordinate(), np.nonzero(spread)[0])


def test_translations_cost_nothing(packing):
    landscape, state = Landscape(packing), State.of(packing)
    hessian = landscape.curvature(state).hessian
    D = packing.dimension
    n_turns = landscape.components(np.zeros(landscape.size)).shape[1] - D
    axis = np.tile(np.arange(D + n_turns), (packing.n, 1))
    free = landscape.components(np.ones(landscape.size)) > 0
    energy = landscape.evaluate(state).energy
    for direction in range(D):
        along = (axis[free] == direction).astype(float)
        assert along.sum() == packing.n
        assert np.abs(hessian @ along).max() < 1e-12 * np.abs(hessian).max()
        moved = landscape.evaluate(landscape.displaced(state, 3.21 * along)).energy
        assert moved == pytest.approx(energy, rel=1e-12)


def test_rattlers_are_those_of_the_contacts(packing):
    opened = scaled(packing, 1.03)
    expected = find_rattlers(opened, find_contacts(opened, 1.0, 2))
    found = Landscape(packing).rattlers(State.of(opened))
    np.testing.assert_array_equal(found, expected)


def test_pairs_are_looked_for_anew_after_moves_and_strains(packing):
    landscape, state = Landscape(packing), State.of(packing)
    rng = np.random.default_rng(5)
    radius = landscape.inner_radius.min()
    n_compared = n_with_new_bonds = 0
    bonds = landscape.evaluate(state).n_bonds
    for size in (1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0, 3.0):
        for strain in (0.0, -1e-3, -0.02, 0.01):
            step = rng.normal(size=landscape.size)
            state_here = landscape.displaced(
                state.strained(strain), size * radius * step / np.abs(step).max()
            )
            fresh = Landscape(packing)
            try:
                expected = fresh.evaluate(state_here)
            except CrossingError:
                with pytest.raises(CrossingError):
                    landscape.evaluate(state_here)
                continue
            found = landscape.evaluate(state_here)
            assert found.n_bonds == expected.n_bonds
            assert found.energy == pytest.approx(expected.energy, rel=1e-13)
            assert_close(found.gradient, expected.gradient, 1e-13)
            n_compared += 1
            n_with_new_bonds += expected.n_bonds != bonds
    assert n_compared >= 8
    assert n_with_new_bonds >= 4


def test_pairs_are_found_while_the_state_creeps(packing):
    # Many steps, each far smaller than what the list of pairs allows.
    landscape, state = Landscape(packing), State.of(packing)
    step = np.random.default_rng(6).normal(size=landscape.size)
    step *= 0.01 * landscape.inner_radius.min() / np.abs(step).max()
    for _ in range(30):
        state = landscape.displaced(state.strained(1e-3), step)
        found, expected = landscape.evaluate(state), Landscape(packing).evaluate(state)
        assert found.n_bonds == expected.n_bonds
        assert found.energy == pytest.approx(expected.energy, rel=1e-13)


def test_forgotten_pairs_make_the_result_that_of_a_fresh_landscape_to_the_bit(packing):
    landscape, state = Landscape(packing), State.of(packing)
    landscape.evaluate(state.strained(1e-3))
    landscape.forget_pairs()
    found, expected = landscape.evaluate(state), Landscape(packing).evaluate(state)
    assert found.energy == expected.energy
    np.testing.assert_array_equal(found.gradient, expected.gradient)


def test_rests_survive_the_way_through_a_packing(packing):
    rng = np.random.default_rng(7)
    state = State.of(packing)
    shift = np.longdouble(1e-18) * rng.normal(size=packing.position.shape)
    turn = np.longdouble(1e-18) * rng.normal(size=(packing.n, 1 if packing.dimension == 2 else 3))
    state = state.strained(1e-17).displaced(shift, turn)
    again = State.of(state.packing(packing))
    for name in ("position", "orientation", "edges"):
        one, other = getattr(state, name), getattr(again, name)
        assert other.dtype == np.longdouble
        np.testing.assert_array_equal(other, one)
    for double, rest in state.split:
        assert double.dtype == rest.dtype == np.float64
        assert np.any(rest != 0)
        np.testing.assert_array_equal(double + rest, double)  # the rest is below the last digit


@pytest.mark.parametrize("half_length", [0.0, 1.0])
def test_extended_precision_resolves_overlaps_that_doubles_do_not(half_length):
    # Two particles far from the origin, one above the other, that overlap by 1e-12.
    packing = make([[31.3, 30.1], [31.3, 31.1]], 0.0, half_length, edges=(40.0, 40.0))
    position = State.of(packing).position.copy()
    position[1, 1] = position[0, 1] + (1 - np.longdouble(1e-12))
    state = State.of(packing.with_poses(position, packing.orientation, packing.box.matrix))
    bonds = 1 if half_length == 0 else 2  # flat sides touch at both ends
    found = Landscape(packing).evaluate(state)
    assert found.n_bonds == bonds
    rounded = State.of(state.packing(packing).with_(position=position.astype(float)))
    error_of_doubles = abs(Landscape(packing).evaluate(rounded).energy / found.energy - 1)
    assert found.gradient.max() == pytest.approx(bonds * 1e-12, rel=1e-5, abs=0)
    assert error_of_doubles > 1e-4


def test_a_rotation_moves_a_tip_by_its_coordinate():
    packing = make([[5, 5]], 0.3, half_length=2.5)
    landscape = Landscape(packing)
    state = landscape.displaced(State.of(packing), np.array([0.1, -0.2, 0.05]))
    turned = state.packing(packing)
    np.testing.assert_allclose(turned.position, [[5.1, 4.8]], rtol=0, atol=1e-15)
    assert turned.orientation[0] == pytest.approx(0.3 + 0.05 / 2.5, abs=1e-15)


def test_whole_turns_cost_no_digits():
    # Minimisers turn particles that are nearly round by thousands of turns.
    packing = make([[5, 5]], 0.3, half_length=0.5)
    landscape, start = Landscape(packing), State.of(packing)
    there = landscape.displaced(start, np.array([0.0, 0.0, 0.5 * 2 * np.pi * 5000]))
    assert np.abs(there.orientation) <= np.pi
    finest = np.array([0.0, 0.0, 0.5 * 1e-18])
    moved = landscape.displaced(there, finest).orientation - there.orientation
    assert float(moved[0, 0]) == pytest.approx(1e-18, rel=0.1)


def test_rotation_vectors_turn_in_space_coordinates():
    packing = pressed_named("rods in space")
    state = State.of(packing)
    turn = np.tile([0.0, 0.0, np.pi / 2], (packing.n, 1))
    turned = state.displaced(np.zeros((packing.n, 3)), turn).packing(packing)
    x, y, z = packing.axes.T
    np.testing.assert_allclose(turned.axes, np.column_stack([-y, x, z]), rtol=0, atol=1e-14)


def test_strain_scales_box_and_positions_and_leaves_the_rotations(packing):
    state = State.of(packing)
    strained = state.strained(-0.125)
    np.testing.assert_array_equal(strained.edges, np.longdouble(0.875) * state.edges)
    np.testing.assert_array_equal(strained.position, np.longdouble(0.875) * state.position)
    np.testing.assert_array_equal(strained.orientation, state.orientation)
    assert strained.volume == pytest.approx(0.875**packing.dimension * state.volume, rel=1e-15)


def test_crossing_spines_are_named_by_their_ids():
    crossing = make([[5, 5], [5.1, 5.1], [9, 9]], [0, np.pi / 2, 0], id=np.array([7, 3, 5]))
    with pytest.raises(CrossingError, match=r"the spines of particles [73] and [73] cross"):
        Landscape(crossing).evaluate(State.of(crossing))
