"""Energy along modes: against closed forms, eigenvalues and exact differences."""

import numpy as np
import pytest
from mixtures import superellipsoids
from numpy.testing import assert_allclose, assert_array_equal
from small_packings import jammed, matrix_of

from common.energy_along import AlongModes, EnergyAlong, fit_crossover, quartic_crossover
from jamshape.files.h5md import read_packing
from jamshape.landscape import Landscape, State
from jamshape.minima.target import Target
from jamshape.packing import Box, Packing
from jamshape.protocols.make import Recipe, Steps, make
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.vibration.hessian import Coordinates, dynamical_matrix
from jamshape.vibration.spectrum import spectrum

D, OVERLAP = 1.0, 1e-8


def row_of_discs():
    """Two discs in a row that closes through the box, and how far apart they are."""
    a = np.longdouble(D) * (1 - np.longdouble(OVERLAP))
    edges = np.array([2 * a, 10], np.longdouble)
    packing = Packing(
        position=np.array([[0.5, 5.0], [1.5, 5.0]]),
        orientation=np.zeros(2),
        diameters=np.full((2, 3), D),
        species=np.ones(2, np.int64),
        id=np.array([1, 2]),
        box=Box(np.zeros(2), edges.astype(np.float64)),
    )
    position = np.array([[a / 2, 5], [3 * a / 2, 5]], np.longdouble)
    return packing.with_poses(position, np.zeros(2, np.longdouble), np.diag(edges)), a


def all_coordinates(packing):
    """Displacements of all particles."""
    particle, kind = np.repeat(np.arange(packing.n), 2), np.tile(np.arange(2), packing.n)
    return Coordinates(particle, kind, np.tile(np.eye(2, 3), (packing.n, 1)), packing.n, 2)


def along_zigzag(delta):
    packing, a = row_of_discs()
    vector = np.array([0, 1, 0, -1]) / np.sqrt(2)
    return AlongModes(packing, all_coordinates(packing)).energy(vector, delta), a


def test_zigzag_of_a_row_of_discs_is_its_closed_form():
    delta = np.geomspace(1e-9, 3e-5, 60)
    found, a = along_zigzag(delta)
    y = np.sqrt(np.longdouble(2)) * delta
    r = np.hypot(a, y)
    # 1 - r/d without cancellation
    grown = y**2 / (a + r)
    overlap = np.longdouble(OVERLAP) - grown / D
    exact = (overlap**2 - np.longdouble(OVERLAP) ** 2).astype(np.float64)
    slope = (-2 * overlap / D * 2 * delta / r).astype(np.float64)
    assert_allclose(found.slope, [slope, slope], rtol=1e-8)
    assert_allclose(found.energy, [exact, exact], rtol=1e-8)
    assert found.n_bonds == 2
    assert_array_equal([found.broken, found.formed], 0)
    assert np.isnan(found.first_change)
    assert abs(found.slope_at_0) < 1e-24


def test_differences_of_energies_drown():
    found, _ = along_zigzag(np.geomspace(1e-12, 1e-5, 60))
    assert 1e-10 < found.differences_from < 1e-6
    late = found.delta > 30 * found.differences_from
    assert_allclose(found.difference[:, late], found.energy[:, late], rtol=1e-3)


def test_bonds_that_break_are_counted_where_they_do():
    delta = np.geomspace(1e-6, 1e-2, 100)
    found, a = along_zigzag(delta)
    opens = np.sqrt((D**2 - float(a) ** 2) / 2)
    assert_array_equal(found.broken[0], 2.0 * (delta > opens))
    assert found.first_change == delta[delta > opens][0]
    assert_allclose(found.energy[:, -1], -(OVERLAP**2), rtol=1e-6)


def test_amplitudes_ascend():
    packing, _ = row_of_discs()
    modes = AlongModes(packing, all_coordinates(packing))
    for wrong in ([0.0, 1.0], [2.0, 1.0], [[1.0]]):
        with pytest.raises(ValueError, match="not positive and ascending"):
            modes.energy(np.zeros(4), wrong)


@pytest.mark.parametrize("name", ["discs", "rods of alpha 1"])
def test_force_along_modes_is_their_eigenvalue(name):
    landscape, minimum = jammed(name)
    packing = minimum.state.packing(landscape.particles)
    matrix = matrix_of(name)
    found = spectrum(matrix)
    modes = AlongModes(packing, matrix.coordinates)
    real = np.flatnonzero(~found.is_translation)
    for k in (*real[:2], real[len(real) // 2], real[-1]):
        delta = 1e-10 if found.eigenvalues[k] < 1e-6 else 1e-13  # stiff modes open weak bonds soon
        slope = modes.energy(found.vectors[:, k], [delta]).slope[:, 0]
        assert_allclose(slope.max() / delta, found.eigenvalues[k], rtol=0.02, atol=1e-15)


def test_rattlers_are_not_in_the_way():
    landscape, minimum = jammed("discs")
    packing, matrix = minimum.state.packing(landscape.particles), matrix_of("discs")
    assert matrix.n_particles < packing.n
    modes = AlongModes(packing, matrix.coordinates)
    vector = np.linalg.qr(np.random.default_rng(1).normal(size=(matrix.size, 1)))[0][:, 0]
    along = modes.energy(vector, np.geomspace(1e-3, 0.3, 20))
    held = State.of(packing)
    rows = matrix.coordinates.backbone
    assert len(held.position[rows]) == len(modes.particles.position)
    # The same from the energies of those that are left.
    small, shift = Landscape(modes.particles), matrix.coordinates.motion(0.3 * vector)
    moved = State.of(modes.particles).displaced(*(part[rows] for part in shift))
    start = small.evaluate(State.of(modes.particles)).energy
    exact = small.evaluate(moved).energy - start - 0.3 * along.slope_at_0
    assert_allclose(along.energy[0, -1], exact, rtol=1e-9)


def test_paths_end_where_spines_cross():
    landscape, minimum = jammed("rods of alpha 1")
    packing, matrix = minimum.state.packing(landscape.particles), matrix_of("rods of alpha 1")
    vector = np.zeros(matrix.size)
    vector[0] = 1.0  # one rod through the others
    along = AlongModes(packing, matrix.coordinates).energy(vector, np.geomspace(0.01, 3, 40))
    assert np.isnan(along.energy[:, -1]).any()
    assert np.isfinite(along.energy[:, 0]).all()
    crossed = np.isnan(along.slope)
    assert_array_equal(np.isnan(along.broken), crossed)
    assert_array_equal(np.diff(crossed.astype(int), axis=1) >= 0, True)


def made_up(delta, slope):
    both = np.stack([slope, slope])
    nothing = np.zeros_like(both)
    return EnergyAlong(delta, both, nothing, nothing, nothing, nothing, 0.0, 10)


def test_crossover_of_a_known_energy():
    delta = np.geomspace(1e-10, 1, 121)
    a, c = 3e-9, 2e-3
    slope = a * delta + 4 * c * delta**3
    slope[delta > 0.1] = 2.0 * delta[delta > 0.1]  # contacts push back
    slope += 1e-22 * np.random.default_rng(2).normal(size=len(delta))
    found = fit_crossover(made_up(delta, slope))
    assert_allclose(found.delta, np.sqrt(a / (2 * c)), rtol=1e-3)
    assert_allclose([found.stiffness, found.quartic], [a, c], rtol=1e-3)
    assert found.delta_error < 0.01 * found.delta
    assert found.begin < 1e-6
    assert 0.05 < found.end < 0.12


def test_no_crossover_where_none_is():
    delta = np.geomspace(1e-10, 1, 121)
    for slope in (delta, -delta, -delta + 4 * delta**3, delta + delta**2, np.full(121, np.nan)):
        assert fit_crossover(made_up(delta, slope)) is None


def test_crossover_after_a_weak_bond_has_closed():
    """The range of the fit begins behind a step of the stiffness over many orders."""
    delta = np.geomspace(1e-10, 1, 121)
    a, c = 2e-6, 5e-1
    slope = np.where(delta > 1e-7, a * delta + 4 * c * delta**3, -1e-16 * delta)
    found = fit_crossover(made_up(delta, slope))
    assert_allclose([found.stiffness, found.quartic], [a, c], rtol=1e-6)
    assert_allclose(found.delta, np.sqrt(a / (2 * c)), rtol=1e-6)
    assert 1e-7 < found.begin < 2e-7


def energy_of(delta, energy, slope):
    both = np.stack([energy, energy])
    nothing = np.zeros_like(both)
    return EnergyAlong(delta, np.stack([slope, slope]), both, nothing, nothing, nothing, 0.0, 10)


@pytest.mark.parametrize("a", [3e-9, -3e-9])
def test_quartic_crossover_is_where_both_terms_are_equal(a):
    delta, c = np.geomspace(1e-7, 1, 100), 2e-3
    energy, slope = a * delta**2 / 2 + c * delta**4, a * delta + 4 * c * delta**3
    energy[delta > 0.05] *= 7.0  # other contacts push back
    found = quartic_crossover(energy_of(delta, energy, slope))
    assert_allclose(found, np.sqrt(abs(a) / (2 * c)), rtol=0.02)


def test_what_opens_bonds_or_stays_quadratic_has_no_quartic_crossover():
    delta = np.geomspace(1e-7, 1, 100)
    energy, slope = 0.5 * delta**2, delta
    assert np.isnan(quartic_crossover(energy_of(delta, energy, slope)))
    opened = np.where(delta > 1e-4, 0.9, 1.0) * energy + 1e3 * delta**4
    assert np.isnan(quartic_crossover(energy_of(delta, opened, slope)))


def test_force_along_modes_of_superellipsoids_is_their_eigenvalue(tmp_path):
    """Rotations in space, about all three axes."""
    shape, way = superellipsoids(1.5, 0.8), Steps(Quasistatic(step=0.01))
    recipe = Recipe(shape, 10, 3, phi_start=0.4, way=way, target=Target(1e-10))
    make(recipe, tmp_path / "a.h5")
    packing = read_packing(tmp_path / "a.h5")
    matrix = dynamical_matrix(Landscape(packing), State.of(packing))
    found = spectrum(matrix)
    modes = AlongModes(packing, matrix.coordinates)
    real = np.flatnonzero(~found.is_translation)
    for k in (real[0], real[len(real) // 2], real[-1]):
        along = modes.energy(found.vectors[:, k], [1e-9, 1e-8])
        assert_allclose(along.mean_slope[1] / 1e-8, found.eigenvalues[k], rtol=1e-3)
        assert_allclose(along.mean_energy[1], 0.5 * found.eigenvalues[k] * 1e-16, rtol=1e-3)
