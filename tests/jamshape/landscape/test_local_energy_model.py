import numpy as np
import pytest
from mixtures import superellipsoids
from pressed import PRESSED, pressed_named
from scenes import pressed
from squeezed import quickly_squeezed
from superellipsoid_packings import pressed_superellipsoids

import jamshape as js
from jamshape import _contact
from jamshape.contacts import find_contacts
from jamshape.landscape import CrossingError, Landscape, State
from jamshape.landscape.local_energy_model import LocalEnergyModel
from jamshape.minima import Stop, minimise
from jamshape.minima.descent import rounding_of_a_bond
from jamshape.packing import body_axes
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles

STRAIN = -2e-4
RODS = "rods of alpha 4"


@pytest.fixture(params=PRESSED)
def packing(request):
    return pressed_named(request.param)


def about(packing, size=1e-4):
    """Give a local energy model, coordinates near it, and the state there."""
    landscape, state = Landscape(packing), State.of(packing)
    x = size * np.random.default_rng(3).normal(size=landscape.size)
    local_model = LocalEnergyModel(landscape, state)
    return local_model, x, landscape.displaced(state, x).strained(STRAIN)


def shifts_only(landscape, x):
    """Leave out what turns in space: second derivatives are for points that turn nothing there."""
    components = landscape.components(x)
    if landscape.particles.dimension == 3:
        components[:, 3:] = 0.0
    return landscape.coordinates(components)


def test_gradient_is_the_slope_of_the_energy_where_particles_have_turned(packing):
    local_model, x, _ = about(packing, size=2e-2)
    rng, step = np.random.default_rng(8), 1e-7
    slope = (
        stretch_of(local_model.landscape) * local_model.evaluate(x, STRAIN, extended=True).gradient
    )
    for along in rng.normal(size=(5, len(x))):
        up, down = (local_model.evaluate(x + k * step * along, STRAIN, extended=True).energy
                    for k in (1, -1))  # fmt: skip
        size = np.abs(slope).max() * np.linalg.norm(along)
        assert (up - down) / (2 * step) == pytest.approx(slope @ along, rel=0, abs=1e-7 * size)


def test_where_nothing_has_turned_torques_are_those_of_the_landscape(packing):
    local_model, x, _ = about(packing)
    x = shifts_only(local_model.landscape, x)
    found = local_model.evaluate(x, STRAIN, extended=True)
    expected = Landscape(packing).evaluate(local_model.at(x, STRAIN))
    scale = np.abs(expected.gradient).max()
    assert found.gradient == pytest.approx(expected.gradient, rel=0, abs=1e-14 * scale)


def test_particles_that_touch_their_own_images_have_the_factors_of_the_hessian():
    packing, state = quickly_squeezed(2, 4.0, 1.0)
    i, j = find_contacts(state.packing(packing), sides=2).pairs.T
    assert (i == j).any()
    require_factors_of_the_hessian(state.packing(packing))


def spheres_and_spheroids():
    """Pairs of two spheres, of two spheroids, and mixed ones."""
    diameters = np.ones((14, 3))
    diameters[::3, 2] = 1.5
    diameters[1::3] *= 1.3
    return pressed_superellipsoids(diameters, np.ones(14), 0.3)


ROUND = {
    "discs": lambda: pressed_named("discs"),
    "discs and rods": lambda: pressed_named("discs and rods"),
    "spheres and rods in space": lambda: pressed_named("spheres and rods in space"),
    "discs as superellipses": lambda: pressed_superellipsoids(
        np.repeat(1 + 0.4 * (np.arange(16) % 2)[:, None], 3, 1), np.ones(16), 0.5, dimension=2
    ),
    "spheres": lambda: pressed(n=16, dimension=3, mixture=superellipsoids(), phi=0.3),
    "spheres and spheroids": spheres_and_spheroids,
}


@pytest.mark.parametrize("name", ROUND)
def test_second_derivatives_of_round_pairs_in_closed_form_are_those_by_dual_numbers(name):
    require_factors_of_the_hessian(ROUND[name]())


def test_doubles_lose_no_digits_to_the_size_of_the_box(packing):
    """Particles that have moved in many steps, far from the origin: only rounding of overlaps remains."""
    far = packing.with_(position=packing.position + 1000 * packing.box.edges)
    landscape, state = Landscape(far), State.of(far)
    local_model, rng = LocalEnergyModel(landscape, state), np.random.default_rng(5)
    for _ in range(40):
        local_model.move(1e-3 * landscape.length * rng.normal(size=landscape.size), -1e-5)
    still = np.zeros(landscape.size)
    found, exact = (local_model.evaluate(still, 0.0, extended=wide) for wide in (False, True))
    assert found.n_bonds == exact.n_bonds > 0
    rounding = rounding_of_a_bond(landscape, extended=False)
    if packing.shape_style == "superellipsoid":  # by iteration
        rounding *= 100
    assert found.gradient == pytest.approx(exact.gradient, rel=0, abs=10 * rounding)


@pytest.mark.parametrize("name", ["discs", "discs and rods"])
def test_minimisers_have_the_same_bits_with_every_instruction_set(name, monkeypatch):
    start, ends = ROUND[name](), []
    for instructions in _contact.instruction_sets():
        monkeypatch.setenv("JAMSHAPE_SIMD", instructions)
        if instructions != "scalar":  # which adds up pairs in another order
            ends.append(minimise(Landscape(start), State.of(start), stop=Stop(1e-6)))
    assert len(ends[0].history.evaluations) > 10
    for other in ends[1:]:
        assert other.history.evaluations == ends[0].history.evaluations
        assert (other.state.position == ends[0].state.position).all()


def stretch_of(landscape):
    """Displacement of a particle per coordinate in the strained box; rotations stay."""
    of_particle = np.ones(landscape.column.shape[1])
    of_particle[: landscape.particles.dimension] += STRAIN
    return landscape.coordinates(np.tile(of_particle, (landscape.particles.n, 1)))


def require_factors_of_the_hessian(packing):
    local_model, x, _ = about(packing)
    landscape = local_model.landscape
    x = shifts_only(landscape, x)
    state, stretch = local_model.at(x, STRAIN), stretch_of(landscape)
    hessian = stretch[:, None] * landscape.curvature(state).hessian.toarray() * stretch
    least = min(np.linalg.eigvalsh(hessian)[0], 0.0)
    diagonal = 1.0 + np.arange(landscape.size) / landscape.size - least
    right = np.random.default_rng(4).normal(size=landscape.size)
    local_model.evaluate(x, STRAIN, extended=False)
    found = local_model.factorise(x, STRAIN, diagonal).solve(right)
    expected = np.linalg.solve(hessian + np.diag(diagonal), right)
    assert found == pytest.approx(expected, rel=0, abs=1e-11 * np.abs(expected).max())


def test_what_is_not_positive_definite_is_shifted_no_more_than_tenfold():
    local_model, x, _ = about(pressed_named(RODS))
    hessian = local_model.landscape.curvature(local_model.at(x, 0.0)).hessian.toarray()
    least = np.linalg.eigvalsh(hessian)[0]
    assert least < -1e-3
    diagonal = np.full(len(x), -0.01 * least)
    local_model.evaluate(x, 0.0, extended=False)
    factors = local_model.factorise(x, 0.0, diagonal)
    right = np.random.default_rng(6).normal(size=len(x))
    solution = factors.solve(right)
    rest = right - hessian @ solution - diagonal * solution
    shift = float(rest @ solution) / float(solution @ solution)
    assert rest == pytest.approx(shift * solution, rel=0, abs=1e-9 * np.abs(rest).max())
    assert -0.99 * least < shift < -10 * least


@pytest.mark.parametrize("moves", [1, 30])
def test_pairs_are_found_anew_where_they_no_longer_hold(packing, moves):
    landscape, state = Landscape(packing), State.of(packing)
    local_model, rng = LocalEnergyModel(landscape, state), np.random.default_rng(5)
    still = np.zeros(landscape.size)
    for _ in range(moves):
        x = 0.05 * landscape.length / np.sqrt(moves) * rng.normal(size=landscape.size)
        try:
            there = local_model.evaluate(x, STRAIN, extended=True)
        except CrossingError:
            continue
        local_model.move_to(local_model.at(x, STRAIN))
        here = local_model.evaluate(still, 0.0, extended=True)
    expected = Landscape(packing).evaluate(local_model.base)
    assert there.energy == pytest.approx(expected.energy, rel=1e-12)
    assert here.energy == pytest.approx(expected.energy, rel=1e-12)
    assert here.gradient == pytest.approx(expected.gradient, rel=0, abs=1e-12)


def test_wide_turns_find_all_pairs(packing):
    """All particles turn by up to nearly half a rotation, from one base."""
    landscape, state = Landscape(packing), State.of(packing)
    local_model, rng = LocalEnergyModel(landscape, state), np.random.default_rng(9)
    D, compared = packing.dimension, 0
    for angle in (0.3, -0.3, 1.0, -1.0, 3.0):
        components = np.zeros((packing.n, D + (1 if D == 2 else 3)))
        axis = rng.normal(size=(packing.n, components.shape[1] - D))
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        components[:, D:] = angle * axis * landscape.rotation_length[:, None]
        x = landscape.coordinates(components)
        try:
            expected = Landscape(packing).evaluate(local_model.at(x, 0.0))
        except CrossingError:
            with pytest.raises(CrossingError):
                local_model.evaluate(x, 0.0, extended=True)
            continue
        found = local_model.evaluate(x, 0.0, extended=True)
        assert found.n_bonds == expected.n_bonds
        assert found.energy == pytest.approx(expected.energy, rel=1e-12)
        compared += 1
    assert compared or packing.shape_style == "spherocylinder"


def test_factors_that_are_held_outlive_later_ones(packing):
    local_model, x, _ = about(packing)
    right = np.ones(len(x))
    held = local_model.factorise(x, 0.0, np.full(len(x), 1e2))
    before = held.solve(right)
    for diagonal in (1e3, 1e4, 1e5):
        local_model.factorise(x, 0.0, np.full(len(x), diagonal))
    assert (held.solve(right) == before).all()


def test_a_whole_turn_changes_nothing_and_needs_no_new_pairs():
    local_model, x, _ = about(pressed_named(RODS))
    landscape = local_model.landscape
    turns = np.zeros((landscape.particles.n, 3))
    turns[:, 2] = 2 * np.pi * landscape.rotation_length
    pairs = landscape.pairs_at(local_model.base)
    expected = local_model.evaluate(x, 0.0, extended=True).energy
    local_model.move_to(local_model.at(landscape.coordinates(turns), 0.0))
    assert local_model.evaluate(x, 0.0, extended=True).energy == pytest.approx(expected, rel=1e-13)
    assert landscape.pairs_at(local_model.base) is pairs


def test_spines_that_cross_are_named():
    local_model, _, _ = about(pressed_named(RODS))
    landscape = local_model.landscape
    i, j = landscape.pairs_at(local_model.base).particles[0]
    shift = landscape.pairs_at(local_model.base).shift[0]
    moves = np.zeros((landscape.particles.n, 3))
    base = local_model.base
    moves[i, :2] = base.position[j] + shift * base.edges - base.position[i]
    moves[i, 2] = 0.3 * landscape.rotation_length[i]
    with pytest.raises(CrossingError, match="cross"):
        local_model.evaluate(landscape.coordinates(moves), 0.0, extended=False)


def test_coordinates_of_another_length_are_refused():
    local_model, x, _ = about(pressed_named(RODS))
    with pytest.raises(ValueError, match=f"has {len(x) - 1} components, expected one for each of"):
        local_model.evaluate(x[1:], 0.0, extended=False)
    with pytest.raises(ValueError, match="diagonal"):
        local_model.factorise(x, 0.0, x[1:])


def test_a_law_that_does_not_exist_is_refused():
    packing = pressed_named(RODS)
    with pytest.raises(ValueError, match="sides is 3, expected 1 or 2"):
        LocalEnergyModel(Landscape(packing, sides=3), State.of(packing))
    with pytest.raises(ValueError, match="k_e is -1e-07, expected a positive energy"):
        LocalEnergyModel(Landscape(packing, k_e=-1e-7), State.of(packing))


IN_SPACE = [name for name in PRESSED if pressed_named(name).dimension == 3]


@pytest.mark.parametrize("name", IN_SPACE)
def test_along_bodies_the_gradient_is_the_slope_of_the_energy(name):
    packing = pressed_named(name)
    landscape, state = Landscape(packing), State.of(packing)
    local_model = LocalEnergyModel(landscape, state, along_bodies=True)
    rng, step = np.random.default_rng(8), 1e-7
    x = 2e-2 * rng.normal(size=landscape.size)
    slope = local_model.evaluate(x, 0.0, extended=True).gradient
    there = Landscape(packing).evaluate(local_model.at(x, 0.0))
    assert local_model.evaluate(x, 0.0, extended=True).energy == pytest.approx(
        there.energy, rel=1e-12
    )
    for along in rng.normal(size=(5, len(x))):
        up, down = (local_model.evaluate(x + k * step * along, 0.0, extended=True).energy
                    for k in (1, -1))  # fmt: skip
        size = np.abs(slope).max() * np.linalg.norm(along)
        assert (up - down) / (2 * step) == pytest.approx(slope @ along, rel=0, abs=1e-7 * size)


def about_bodies(landscape, state):
    """(n, n) derivative of coordinates about the axes of space by those about the axes of bodies."""
    D, axes = 3, body_axes(state.orientation.astype(float))
    columns = []
    for unit in np.eye(landscape.size):
        components = landscape.components(unit)
        components[:, D:] = np.einsum("nb,nbk->nk", components[:, D:], axes)
        columns.append(landscape.coordinates(components))
    return np.array(columns).T


@pytest.mark.parametrize("name", IN_SPACE)
def test_along_bodies_factors_are_those_of_the_hessian_about_their_axes(name):
    packing = pressed_named(name)
    landscape, state = Landscape(packing), State.of(packing)
    local_model = LocalEnergyModel(landscape, state, along_bodies=True)
    x = shifts_only(landscape, 1e-4 * np.random.default_rng(3).normal(size=landscape.size))
    to_space = about_bodies(landscape, state)
    there = local_model.at(x, 0.0)
    hessian = to_space.T @ landscape.curvature(there).hessian.toarray() @ to_space
    diagonal = 1.0 + np.arange(landscape.size) / landscape.size - np.linalg.eigvalsh(hessian)[0]
    right = np.random.default_rng(4).normal(size=landscape.size)
    local_model.evaluate(x, 0.0, extended=False)
    found = local_model.factorise(x, 0.0, diagonal).solve(right)
    expected = np.linalg.solve(hessian + np.diag(diagonal), right)
    assert found == pytest.approx(expected, rel=0, abs=1e-10 * np.abs(expected).max())


def test_along_bodies_factors_follow_particles_that_have_turned():
    """The Jacobian of the rotation vector is in them, so that Newton's steps stay Newton's: without it 0.12."""
    packing = pressed_named(next(name for name in IN_SPACE if "ellipsoids" in name))
    landscape, state = Landscape(packing), State.of(packing)
    local_model = LocalEnergyModel(landscape, state, along_bodies=True)
    x = 0.1 * np.random.default_rng(3).normal(size=landscape.size)
    x -= shifts_only(landscape, x)

    def gradient(at):
        return local_model.evaluate(at, 0.0, extended=True).gradient

    steps = 1e-6 * np.eye(landscape.size)
    slopes = np.array([(gradient(x + step) - gradient(x - step)) / 2e-6 for step in steps])
    large = np.full(landscape.size, 1e3 * np.abs(slopes).max())
    gradient(x)
    factors = local_model.factorise(x, 0.0, large)
    found = np.linalg.inv(np.array([factors.solve(unit) for unit in np.eye(landscape.size)]))
    off = np.abs(found - np.diag(large) - slopes).max() / np.abs(slopes).max()
    assert off < 0.02


def test_many_particles_in_space_have_solutions_by_iteration():
    """Stages need solutions, not approximations to them, though their factors are incomplete."""
    start = random_packing(160, 0.4, 1, Particles.of("spherocylinder", alpha=1.0), 3)
    packing, state = start, State.of(start).strained(-0.15)
    landscape = Landscape(packing)
    local_model = LocalEnergyModel(landscape, state, along_bodies=True)
    still = np.zeros(landscape.size)
    to_space = about_bodies(landscape, state)
    hessian = to_space.T @ landscape.curvature(state).hessian.toarray() @ to_space
    least = np.linalg.eigvalsh(hessian)[0]
    diagonal = np.full(landscape.size, 1e-4 * np.diagonal(hessian).max() - min(least, 0.0))
    right = np.random.default_rng(4).normal(size=landscape.size)
    assert local_model.evaluate(still, 0.0, extended=False).n_bonds > 160
    found = local_model.factorise(still, 0.0, diagonal).solve(right)
    remainder = hessian @ found + diagonal * found - right
    assert np.linalg.norm(remainder) < 1e-4 * np.linalg.norm(right)


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_factors_contain_pairs_that_were_apart_when_the_first_ones_were_made(alpha):
    """A row of particles with gaps that are closed by moving every other one, without new pairs."""
    n, gap = 6, 0.06
    packing = js.Packing.of(
        "spherocylinder",
        [[(1.0 + gap) * k, 1.0] for k in range(n)],
        np.full(n, np.pi / 2),
        box=[(1.0 + gap) * n, 8.0],
        alpha=alpha,
    )
    landscape = Landscape(packing)
    x = landscape.coordinates(
        np.pad(np.where(np.arange(n) % 2, -1.2 * gap, 0.0)[:, None], ((0, 0), (0, 2)))
    )
    diagonal, right = np.full(landscape.size, 1e-2), np.arange(1.0, landscape.size + 1)
    model, fresh = (LocalEnergyModel(landscape, State.of(packing)) for _ in range(2))
    apart = model.factorise(np.zeros(landscape.size), 0.0, diagonal).solve(right)
    assert apart == pytest.approx(right / 1e-2)
    expected = fresh.factorise(x, 0.0, diagonal).solve(right)
    assert not np.allclose(expected, apart, rtol=0.1)
    assert model.factorise(x, 0.0, diagonal).solve(right) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("evaluations", [5, 40])
def test_a_minimisation_that_is_cut_short_ends_with_the_sums_of_its_state(packing, evaluations):
    """The base moves seldom, and the virial is not summed on the way."""
    landscape, state = Landscape(packing), State.of(packing)
    x = 0.02 * np.random.default_rng(5).normal(size=landscape.size)
    found = minimise(
        landscape, landscape.displaced(state, x), "auto", Stop(1e-14, 0.0, evaluations)
    )
    there = Landscape(packing).evaluate(found.state)
    last = found.history.energy_density[-1]
    assert found.energy_density == pytest.approx(last, rel=1e-11, abs=1e-28)
    assert found.evaluation.energy == pytest.approx(there.energy, rel=1e-11, abs=1e-28)
    for name in ("gradient", "virial", "strain_gradient"):
        value = getattr(there, name)
        atol = 1e-11 * max(np.abs(value).max(), 1e-4)
        np.testing.assert_allclose(getattr(found.evaluation, name), value, rtol=0, atol=atol)
