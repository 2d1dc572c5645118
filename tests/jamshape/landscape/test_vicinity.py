import numpy as np
import pytest
from pressed import pressed_named
from squeezed import squeezed

from jamshape.contacts import find_contacts
from jamshape.landscape import CrossingError, Landscape, State
from jamshape.landscape.vicinity import Vicinity

STRAIN = -2e-4
RODS = "rods of alpha 4"
PLANAR = ("discs", "rods of alpha 0.01", RODS, "discs and rods", "superellipses")


@pytest.fixture(params=PLANAR)
def packing(request):
    return pressed_named(request.param)


def about(packing, size=1e-4):
    """Give a vicinity, coordinates near it, and the state there."""
    landscape, state = Landscape(packing), State.of(packing)
    x = size * np.random.default_rng(3).normal(size=landscape.size)
    vicinity = Vicinity(landscape, state)
    return vicinity, x, landscape.displaced(state, x).strained(STRAIN)


@pytest.mark.parametrize("extended", [False, True])
def test_energy_and_gradient_are_those_of_the_landscape(packing, extended):
    vicinity, x, state = about(packing)
    found = vicinity.evaluate(x, STRAIN, extended=extended)
    expected = Landscape(packing).evaluate(state, extended=extended)
    scale = np.abs(expected.gradient).max()
    assert found.gradient == pytest.approx(expected.gradient, rel=0, abs=1e-14 * scale)
    for name in ("energy", "strain_gradient", "bond_force", "n_bonds"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-14)
    assert expected.n_bonds > 5


def test_factors_are_those_of_the_hessian_of_the_landscape(packing):
    require_factors_of_the_hessian(packing)


def test_particles_that_touch_their_own_images_have_the_factors_of_the_hessian():
    packing, state = squeezed(2, 4.0, 1.0)
    i, j = find_contacts(state.packing(packing), sides=2).pairs.T
    assert (i == j).any()
    require_factors_of_the_hessian(state.packing(packing))


def require_factors_of_the_hessian(packing):
    vicinity, x, state = about(packing)
    landscape = vicinity.landscape
    stretch = 1.0 + landscape.coordinates(np.tile([STRAIN, STRAIN, 0.0], (packing.n, 1)))
    hessian = stretch[:, None] * landscape.curvature(state).hessian.toarray() * stretch
    least = min(np.linalg.eigvalsh(hessian)[0], 0.0)
    diagonal = 1.0 + np.arange(landscape.size) / landscape.size - least
    right = np.random.default_rng(4).normal(size=landscape.size)
    vicinity.evaluate(x, STRAIN, extended=False)
    found = vicinity.factorise(x, STRAIN, diagonal).solve(right)
    expected = np.linalg.solve(hessian + np.diag(diagonal), right)
    assert found == pytest.approx(expected, rel=0, abs=1e-11 * np.abs(expected).max())


def test_what_is_not_positive_definite_is_shifted_no_more_than_tenfold():
    vicinity, x, _ = about(pressed_named(RODS))
    hessian = vicinity.landscape.curvature(vicinity.at(x, 0.0)).hessian.toarray()
    least = np.linalg.eigvalsh(hessian)[0]
    assert least < -1e-3
    diagonal = np.full(len(x), -0.01 * least)
    vicinity.evaluate(x, 0.0, extended=False)
    factors = vicinity.factorise(x, 0.0, diagonal)
    assert factors.n_negative == 0
    right = np.random.default_rng(6).normal(size=len(x))
    solution = factors.solve(right)
    rest = right - hessian @ solution - diagonal * solution
    shift = float(rest @ solution) / float(solution @ solution)
    assert rest == pytest.approx(shift * solution, rel=0, abs=1e-9 * np.abs(rest).max())
    assert -0.99 * least < shift < -10 * least


@pytest.mark.parametrize("moves", [1, 30])
def test_pairs_are_found_anew_where_they_no_longer_hold(packing, moves):
    landscape, state = Landscape(packing), State.of(packing)
    vicinity, rng = Vicinity(landscape, state), np.random.default_rng(5)
    for _ in range(moves):
        x = 0.05 * landscape.length / np.sqrt(moves) * rng.normal(size=landscape.size)
        try:
            found = vicinity.evaluate(x, STRAIN, extended=True)
        except CrossingError:
            continue
        vicinity.move_to(vicinity.at(x, STRAIN))
    expected = Landscape(packing).evaluate(vicinity.base)
    assert found.energy == pytest.approx(expected.energy, rel=1e-12)
    assert found.gradient == pytest.approx(expected.gradient, rel=0, abs=1e-12)


def test_factors_that_are_held_outlive_later_ones(packing):
    vicinity, x, _ = about(packing)
    right = np.ones(len(x))
    held = vicinity.factorise(x, 0.0, np.full(len(x), 1e2))
    before = held.solve(right)
    for diagonal in (1e3, 1e4, 1e5):
        vicinity.factorise(x, 0.0, np.full(len(x), diagonal))
    assert (held.solve(right) == before).all()


def test_a_whole_turn_changes_nothing_and_needs_no_new_pairs():
    vicinity, x, _ = about(pressed_named(RODS))
    landscape = vicinity.landscape
    turns = np.zeros((landscape.particles.n, 3))
    turns[:, 2] = 2 * np.pi * landscape.rotation_length
    pairs = landscape.pairs_at(vicinity.base)
    expected = vicinity.evaluate(x, 0.0, extended=True).energy
    vicinity.move_to(vicinity.at(landscape.coordinates(turns), 0.0))
    assert vicinity.evaluate(x, 0.0, extended=True).energy == pytest.approx(expected, rel=1e-13)
    assert landscape.pairs_at(vicinity.base) is pairs


def test_spines_that_cross_are_named():
    vicinity, _, _ = about(pressed_named(RODS))
    landscape = vicinity.landscape
    i, j = landscape.pairs_at(vicinity.base).particles[0]
    shift = landscape.pairs_at(vicinity.base).shift[0]
    moves = np.zeros((landscape.particles.n, 3))
    base = vicinity.base
    moves[i, :2] = base.position[j] + shift * base.edges - base.position[i]
    moves[i, 2] = 0.3 * landscape.rotation_length[i]
    with pytest.raises(CrossingError, match="cross"):
        vicinity.evaluate(landscape.coordinates(moves), 0.0, extended=False)


def test_coordinates_of_another_length_are_refused():
    vicinity, x, _ = about(pressed_named(RODS))
    with pytest.raises(ValueError, match=f"has {len(x) - 1} components, expected one for each of"):
        vicinity.evaluate(x[1:], 0.0, extended=False)
    with pytest.raises(ValueError, match="diagonal"):
        vicinity.factorise(x, 0.0, x[1:])


def test_three_dimensions_are_refused():
    packing = pressed_named("rods in space")
    with pytest.raises(ValueError, match="three dimensions, expected two"):
        Vicinity(Landscape(packing), State.of(packing))


def test_a_law_that_does_not_exist_is_refused():
    packing = pressed_named(RODS)
    with pytest.raises(ValueError, match="sides is 3, expected 1 or 2"):
        Vicinity(Landscape(packing, sides=3), State.of(packing))
    with pytest.raises(ValueError, match="k_e is -1e-07, expected a positive energy"):
        Vicinity(Landscape(packing, k_e=-1e-7), State.of(packing))
