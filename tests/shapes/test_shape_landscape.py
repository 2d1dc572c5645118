"""The energy landscape of every shape: slopes, both precisions, and what integrators ask for."""

from functools import partial

import numpy as np
import pytest
from every_shape import (
    ALL,
    EPS,
    MIXTURES,
    ROUNDING,
    SIDES,
    TYPICAL,
    as_vectors,
    close_to,
    laws,
    pressed,
    sheared,
    size_of,
    stiffnesses,
)
from slopes import assert_is_slope

from jamshape.contacts import find_contacts, forces, sum_forces
from jamshape.landscape import CrossingError, Landscape
from jamshape.landscape.local_energy_model import LocalEnergyModel
from jamshape.minima.boxes import strains_of
from jamshape.packing import Box, State


def directions(landscape, number=3, seed=5):
    """Of unit length in the largest coordinate."""
    vectors = np.random.default_rng(seed).normal(size=(number, landscape.size))
    return vectors / np.abs(vectors).max(axis=1, keepdims=True)


def step_of(landscape):
    """Of differences: so little of the smallest length on which energies depend."""
    turning = landscape.rotation_length[landscape.rotation_length > 0]
    return 2e-6 * float(np.min([landscape.inner_radius.min(), *turning]))


# --- slopes --------------------------------------------------------------------------------------


def by_each_law(packing):
    """Landscapes of a stiffness other than 1, and of one for each pair of species."""
    of_one = [Landscape(packing, 2.5, sides) for sides in laws(packing)]
    return [*of_one, Landscape(packing, stiffnesses(packing), SIDES)]


def test_the_gradient_is_the_slope_of_the_energy(packing, measured):
    for landscape in by_each_law(packing):
        require_gradient(landscape, packing, measured)


def require_gradient(landscape, packing, measured):
    state = State.of(packing)
    short, long = (landscape.evaluate(state, extended=extended) for extended in (False, True))
    h, size = step_of(landscape), np.abs(packing.position).max()

    def energy(s, direction):
        return landscape.evaluate(landscape.displaced(state, s * direction)).energy

    off = []
    for d in directions(landscape):
        scale = np.linalg.norm(d) * long.bond_force
        for here in (short, long):
            at = partial(energy, direction=d)
            off.append(assert_is_slope(here.gradient @ d, at, h, scale, size))
    measured(off=max(off), bonds=long.n_bonds)
    assert np.abs(long.gradient).max() > 1e-2 * long.bond_force
    assert long.n_bonds >= 3


def test_the_hessian_is_the_slope_of_the_gradient(packing, measured):
    for landscape in (Landscape(packing), Landscape(packing, stiffnesses(packing))):
        require_hessian(landscape, packing, measured)


def require_hessian(landscape, packing, measured):
    state = State.of(packing)
    hessian, h = landscape.curvature(state, extended=True).hessian, step_of(landscape)
    scale, size = np.abs(hessian).max(), np.abs(packing.position).max()

    def gradient(s, direction):
        return landscape.evaluate(landscape.displaced(state, s * direction)).gradient

    def along(s, direction):
        return gradient(s, direction) @ direction

    off = []
    for d in directions(landscape):
        # Rotations in space do not commute: a slope along the direction itself does not see that.
        found, length = d @ hessian @ d, d @ d
        off.append(assert_is_slope(found, partial(along, direction=d), h, length * scale, size))
        shift = landscape.components(d)
        shift[:, packing.dimension :] = 0.0
        shift = landscape.coordinates(shift)
        vectors = partial(gradient, direction=shift)
        off.append(assert_is_slope(hessian @ shift, vectors, h, np.abs(shift).sum() * scale, size))
    measured(off=max(off))
    assert abs(hessian - hessian.T).max() <= ROUNDING * scale


def test_strain_derivatives_are_slopes(packing):
    landscape, state = Landscape(packing), State.of(packing)
    here, curvature, h = landscape.evaluate(state), landscape.curvature(state), 1e-6

    def at(s):
        return landscape.evaluate(state.strained(s))

    scale = abs(here.strain_gradient)
    assert_is_slope(here.strain_gradient, lambda s: at(s).energy, h, scale)
    stiff = abs(curvature.strain_hessian)
    assert_is_slope(curvature.strain_hessian, lambda s: at(s).strain_gradient / (1 + s), h, stiff)
    scale = np.abs(curvature.coupling).max()
    assert_is_slope(curvature.coupling, lambda s: at(s).gradient, h, scale)


def test_second_derivatives_by_every_strain_are_slopes(packing):
    """Of the gradient, and of the stress that goes with each strain of the box."""
    landscape, state, D = Landscape(packing), State.of(packing), packing.dimension
    strains, h = strains_of("free", D), 1e-6
    coupling, own = landscape.strained(state, strains)

    def at(s, strain):
        return state.deformed(np.eye(D, dtype=np.longdouble) + np.longdouble(s) * strain)

    def slopes(s, strain):
        there = at(s, strain)
        deformed = np.linalg.inv(np.eye(D) + s * strain).T
        return -there.volume * np.einsum("ab,kab->k", landscape.stress(there) @ deformed, strains)

    for strain, row, column in zip(strains, coupling, own, strict=True):
        gradient = partial(
            lambda s, strain: landscape.evaluate(at(s, strain)).gradient, strain=strain
        )
        assert_is_slope(row, gradient, h, np.abs(coupling).max())
        assert_is_slope(column, partial(slopes, strain=strain), h, np.abs(own).max())


def test_the_virial_is_the_slope_of_the_energy_by_every_strain(packing):
    for landscape in by_each_law(packing):
        require_virial(landscape, packing)


def require_virial(landscape, packing):
    state, found = State.of(packing), forces(packing, landscape.k_e, landscape.sides)
    scale = np.abs(found.virial).max()
    assert np.trace(found.virial) / (packing.dimension * packing.box.volume) == close_to(
        found.pressure, 4 * EPS
    )
    # A strain of x_a by x_b; the cell stays upper triangular for a <= b.
    for a, b in zip(*np.triu_indices(packing.dimension), strict=True):

        def energy(s, a=a, b=b):
            change = np.eye(packing.dimension, dtype=np.longdouble)
            change[a, b] += np.longdouble(s)
            return landscape.evaluate(sheared(state, change)).energy

        assert_is_slope(-found.virial[b, a], energy, 1e-6, scale)


def test_the_cell_of_a_lattice_does_not_matter(packing):
    """Other cell vectors, whole cell vectors added to them, and the tilts as small as they may be."""
    whole = np.eye(packing.dimension)
    whole[np.triu_indices(packing.dimension, 1)] = [1, -2, 1][: len(packing.box.tilt)]
    matrix = packing.box.matrix @ whole
    for k in range(packing.dimension - 2, -1, -1):  # a tilt of a row changes those above it
        for m in range(k + 1, packing.dimension):
            matrix[:, m] -= np.rint(matrix[k, m] / matrix[k, k]) * matrix[:, k]
    reduced = Box.of(packing.box.lo, matrix)
    assert (np.abs(reduced.tilt_factors) <= 0.5 + EPS).all()
    for box in (reduced, Box.of(packing.box.lo, packing.box.matrix @ whole)):
        assert_same_landscape(packing, packing.with_(box=box))


def assert_same_landscape(packing, other):
    one, same = forces(packing, sides=SIDES), forces(other, sides=SIDES)
    force, torque = size_of(find_contacts(packing, sides=SIDES))
    assert same.energy == close_to(one.energy, 10 * ROUNDING)
    np.testing.assert_allclose(same.force, one.force, rtol=0, atol=10 * ROUNDING * force)
    atol = 10 * ROUNDING * max(force, torque)
    np.testing.assert_allclose(same.torque, one.torque, rtol=0, atol=atol)
    atol = 10 * ROUNDING * np.abs(one.virial).max()
    np.testing.assert_allclose(same.virial, one.virial, rtol=0, atol=atol)
    here, there = (Landscape(x).curvature(State.of(x), extended=True) for x in (packing, other))
    stiff = abs(here.hessian).max()
    assert abs(there.hessian - here.hessian).max() <= 10 * ROUNDING * stiff
    assert there.strain_hessian == close_to(here.strain_hessian, 100 * ROUNDING)


def test_a_local_energy_model_follows_a_box_that_shears(packing):
    """Its list of pairs holds as long as it says so: energies and forces are those of new lists."""
    state = State.of(packing)
    shear = np.eye(packing.dimension)
    shear[0, 1] = 4e-3
    local_model, still = (
        LocalEnergyModel(Landscape(packing), state),
        np.zeros(Landscape(packing).size),
    )
    kept = Landscape(packing)
    for _ in range(12):
        state = sheared(state, shear)
        local_model.move_to(state)
        fresh = Landscape(packing).evaluate(state, extended=False)
        for found in (
            local_model.evaluate(still, 0.0, extended=False), kept.evaluate(state, extended=False)
        ):  # fmt: skip
            assert found.n_bonds == fresh.n_bonds
            assert found.energy == close_to(fresh.energy, ROUNDING)
            assert found.strain_gradient == close_to(fresh.strain_gradient, ROUNDING)


# --- the same by other ways ---------------------------------------------------------------------


def test_the_landscape_is_the_sum_of_the_contacts(packing):
    for landscape in by_each_law(packing):
        require_sum_of_contacts(landscape, packing)


def require_sum_of_contacts(landscape, packing):
    network = find_contacts(packing, landscape.k_e, landscape.sides)
    found = sum_forces(packing, network)
    here = landscape.evaluate(State.of(packing))
    components, D = landscape.components(here.gradient), packing.dimension
    force, torque = size_of(network)
    np.testing.assert_allclose(components[:, :D], -found.force, rtol=0, atol=ROUNDING * force)
    turned = components[:, D:] * landscape.rotation_length[:, None]
    turns = landscape.rotation_length > 0
    expected = -as_vectors(found.torque)[turns]
    np.testing.assert_allclose(turned[turns], expected, rtol=0, atol=ROUNDING * max(torque, force))
    assert here.energy == close_to(found.energy, ROUNDING)
    assert here.strain_gradient == close_to(-np.trace(found.virial), ROUNDING)
    assert here.n_bonds == network.n_bonds.sum()
    bond_force = np.linalg.norm(network.bonds.force, axis=1).mean()
    assert here.bond_force == close_to(bond_force, ROUNDING)


def test_long_doubles_agree_with_doubles(packing):
    landscape, state = Landscape(packing), State.of(packing)
    short, long = (landscape.evaluate(state, extended=extended) for extended in (False, True))
    assert short.energy == close_to(long.energy, ROUNDING)
    # By rotations it is torques over the length of a radian, which may be many times the forces.
    size = max(long.bond_force, np.abs(long.gradient).max())
    assert np.abs(short.gradient - long.gradient).max() <= ROUNDING * size
    assert not np.array_equal(short.gradient, long.gradient)
    short, long = (landscape.curvature(state, extended=extended) for extended in (False, True))
    # Curvatures of contacts divide by the distance of the surfaces' feet, or by radii of curvature.
    scale = np.abs(long.hessian).max()
    assert abs(short.hessian - long.hessian).max() <= 10 * ROUNDING * scale


# --- lists of pairs, and what integrators ask for ------------------------------------------------


@pytest.mark.parametrize("case", [*TYPICAL, *MIXTURES], ids=str)
def test_lists_of_pairs_are_renewed_in_time(case, measured):
    packing = pressed(case)
    landscape, state = Landscape(packing), State.of(packing)
    local_model, origin = LocalEnergyModel(landscape, state), np.zeros(landscape.size)
    rng, renewed, lists = np.random.default_rng(9), 0, None
    for _ in range(60):
        step = 0.03 * landscape.length * rng.uniform(-1, 1, landscape.size)
        local_model.move(step, rng.uniform(-3e-3, 3e-3))
        state = local_model.base
        try:
            expected = Landscape(packing).evaluate(state, extended=False)
        except CrossingError:
            break
        for found in (
            landscape.evaluate(state, extended=False),
            local_model.evaluate(origin, 0.0, extended=False),
        ):
            assert found.n_bonds == expected.n_bonds
            assert found.energy == close_to(expected.energy, ROUNDING)
        renewed += landscape.pairs_at(state) is not lists
        lists = landscape.pairs_at(state)
    measured(renewed=renewed)
    assert renewed >= 2


EVERYWHERE = pytest.mark.parametrize("case", ALL, ids=str)
STRAIN = -2e-4


def about(case):
    """A local energy model, and coordinates in it."""
    landscape = Landscape(pressed(case))
    local_model = LocalEnergyModel(landscape, State.of(landscape.particles))
    return local_model, 1e-4 * np.random.default_rng(3).normal(size=landscape.size)


@EVERYWHERE
@pytest.mark.parametrize("extended", [False, True])
def test_the_vicinity_has_the_energy_of_the_landscape(case, extended):
    local_model, x = about(case)
    found = local_model.evaluate(x, STRAIN, extended=extended)
    expected = Landscape(pressed(case)).evaluate(local_model.at(x, STRAIN), extended=extended)
    off = local_model.landscape.components(found.gradient - expected.gradient)
    # In space a torque is not the derivative by the vector that has turned the particle already.
    off = off if case.dimension == 2 else off[:, :3]
    assert np.abs(off).max() <= ROUNDING * expected.bond_force
    for name in ("energy", "strain_gradient", "bond_force", "n_bonds"):
        assert getattr(found, name) == close_to(getattr(expected, name), ROUNDING)


@EVERYWHERE
def test_the_vicinity_factorises_the_hessian_of_the_landscape(case):
    local_model, x = about(case)
    landscape = local_model.landscape
    shifts = landscape.components(x)
    if case.dimension == 3:  # second derivatives are for points that turn nothing in space
        shifts[:, 3:] = 0.0
        x = landscape.coordinates(shifts)
    of_particle = np.ones_like(shifts)
    of_particle[:, : case.dimension] += STRAIN
    stretch = landscape.coordinates(of_particle)
    curvature = landscape.curvature(local_model.at(x, STRAIN))
    hessian = stretch[:, None] * curvature.hessian.toarray() * stretch
    diagonal = 1 + np.arange(landscape.size) / landscape.size
    diagonal = diagonal - min(np.linalg.eigvalsh(hessian)[0], 0.0)
    right = np.random.default_rng(4).normal(size=landscape.size)
    local_model.evaluate(x, STRAIN, extended=False)
    found = local_model.factorise(x, STRAIN, diagonal).solve(right)
    left = hessian + np.diag(diagonal)
    rounding = 100 * EPS * np.linalg.norm(left, 2) * np.linalg.norm(found)
    assert np.linalg.norm(left @ found - right) <= rounding
