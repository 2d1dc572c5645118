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
    pressed,
    size_of,
)
from slopes import assert_is_slope

from jamshape.contacts import forces, sum_forces
from jamshape.landscape import CrossingError, Landscape
from jamshape.landscape.vicinity import Vicinity
from jamshape.packing import State


def directions(landscape, number=3, seed=5):
    """Of unit length in the largest coordinate."""
    vectors = np.random.default_rng(seed).normal(size=(number, landscape.size))
    return vectors / np.abs(vectors).max(axis=1, keepdims=True)


def step_of(landscape):
    """Of differences: so little of the smallest length on which energies depend."""
    turning = landscape.rotation_length[landscape.rotation_length > 0]
    return 2e-6 * float(np.min([landscape.inner_radius.min(), *turning]))


# --- slopes --------------------------------------------------------------------------------------


def test_the_gradient_is_the_slope_of_the_energy(packing, measured):
    landscape, state = Landscape(packing), State.of(packing)
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
    landscape, state = Landscape(packing), State.of(packing)
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


def test_the_virial_is_the_slope_of_the_energy_along_each_axis(packing):
    landscape, state = Landscape(packing), State.of(packing)
    found = forces(packing, sides=SIDES)
    scale = np.abs(found.virial).max()
    assert np.trace(found.virial) / (packing.dimension * packing.box.volume) == close_to(
        found.pressure, 4 * EPS
    )
    for axis in range(packing.dimension):

        def energy(s, axis=axis):
            factor = np.ones(packing.dimension, np.longdouble)
            factor[axis] += np.longdouble(s)
            there = State(factor * state.position, state.orientation, factor * state.edges)
            return landscape.evaluate(there).energy

        assert_is_slope(-found.virial[axis, axis], energy, 1e-6, scale)


# --- the same by other ways ---------------------------------------------------------------------


def test_the_landscape_is_the_sum_of_the_contacts(packing, network):
    landscape, found = Landscape(packing), sum_forces(packing, network)
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
    rng, renewed, lists = np.random.default_rng(9), 0, None
    for _ in range(60):
        step = 0.03 * landscape.length * rng.uniform(-1, 1, landscape.size)
        state = landscape.displaced(state, step).strained(rng.uniform(-3e-3, 3e-3))
        try:
            expected = Landscape(packing).evaluate(state, extended=False)
        except CrossingError:
            break
        found = landscape.evaluate(state, extended=False)
        assert found.n_bonds == expected.n_bonds
        assert found.energy == close_to(expected.energy, ROUNDING)
        renewed += landscape.pairs_at(state) is not lists
        lists = landscape.pairs_at(state)
    measured(renewed=renewed)
    assert renewed >= 2


PLANE = pytest.mark.parametrize("case", [case for case in ALL if case.dimension == 2], ids=str)
STRAIN = -2e-4


def about(case):
    """A vicinity, coordinates in it, and the state there."""
    packing = pressed(case)
    landscape, state = Landscape(packing), State.of(packing)
    x = 1e-4 * np.random.default_rng(3).normal(size=landscape.size)
    return Vicinity(landscape, state), x, landscape.displaced(state, x).strained(STRAIN)


@PLANE
@pytest.mark.parametrize("extended", [False, True])
def test_the_vicinity_has_the_energy_of_the_landscape(case, extended):
    vicinity, x, state = about(case)
    found = vicinity.evaluate(x, STRAIN, extended=extended)
    expected = Landscape(pressed(case)).evaluate(state, extended=extended)
    size = ROUNDING * expected.bond_force
    np.testing.assert_allclose(found.gradient, expected.gradient, rtol=0, atol=size)
    for name in ("energy", "strain_gradient", "bond_force", "n_bonds"):
        assert getattr(found, name) == close_to(getattr(expected, name), ROUNDING)


@PLANE
def test_the_vicinity_factorises_the_hessian_of_the_landscape(case):
    vicinity, x, state = about(case)
    landscape, packing = vicinity.landscape, pressed(case)
    stretch = 1 + landscape.coordinates(np.tile([STRAIN, STRAIN, 0.0], (packing.n, 1)))
    hessian = stretch[:, None] * landscape.curvature(state).hessian.toarray() * stretch
    diagonal = 1 + np.arange(landscape.size) / landscape.size
    diagonal = diagonal - min(np.linalg.eigvalsh(hessian)[0], 0.0)
    right = np.random.default_rng(4).normal(size=landscape.size)
    vicinity.evaluate(x, STRAIN, extended=False)
    found = vicinity.factorise(x, STRAIN, diagonal).solve(right)
    left = hessian + np.diag(diagonal)
    rounding = 100 * EPS * np.linalg.norm(left, 2) * np.linalg.norm(found)
    assert np.linalg.norm(left @ found - right) <= rounding
