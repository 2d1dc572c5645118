from dataclasses import replace

import numpy as np
import pytest
from lattices import discs
from scenes import make
from small_packings import SMALL, jammed, matrix_of

from jamshape.landscape import Landscape, State
from jamshape.vibration.hessian import dynamical_matrix
from jamshape.vibration.spectrum import spectrum
from jamshape.vibration.statistics import (
    bands,
    components,
    count,
    density_of_states,
    mean_in_bins,
    participation,
    redundancies,
    why_no_bands,
)


def test_participation_of_the_extremes():
    matrix = matrix_of("rods of alpha 1")
    N = matrix.n_particles
    spread = np.ones((matrix.size, 1)) / np.sqrt(matrix.size)
    single = np.eye(matrix.size)[:, :1]
    pair = (np.eye(matrix.size)[:, :1] + np.eye(matrix.size)[:, 5:6]) / np.sqrt(2)
    found = participation(matrix.coordinates, np.hstack([spread, single, pair, 7 * pair]))
    np.testing.assert_allclose(found, [3, 1 / N, 2 / N, 2 / N], rtol=1e-13)
    discs = matrix_of("discs")
    spread = np.ones((discs.size, 1)) / np.sqrt(discs.size)
    assert participation(discs.coordinates, spread)[0] == pytest.approx(2, rel=1e-13)


def test_components_are_along_across_and_turning():
    landscape, minimum = jammed("rods of alpha 4")
    packing = minimum.state.packing(landscape.particles)
    coordinates = matrix_of("rods of alpha 4").coordinates
    particle = coordinates.backbone[3]
    axis = packing.axes[particle]
    x, y, turn = np.flatnonzero(coordinates.particle == particle)
    modes = np.zeros((coordinates.size, 3))
    modes[[x, y], 0] = axis
    modes[[x, y], 1] = -axis[1], axis[0]
    modes[turn, 2] = 1
    found = components(coordinates, packing, modes)
    np.testing.assert_allclose(found.parallel, [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(found.perpendicular, [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(found.rotation, [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(found.of_round, 0, atol=1e-15)


@pytest.mark.parametrize("name", SMALL)
def test_components_of_every_mode_add_up(name):
    landscape, minimum = jammed(name)
    matrix = matrix_of(name)
    packing = minimum.state.packing(landscape.particles)
    found = components(matrix.coordinates, packing, spectrum(matrix).vectors)
    np.testing.assert_allclose(sum(found), 1, rtol=1e-10)
    assert (found.of_round > 0.5).all() == (name == "discs")


def test_density_of_states_counts_every_positive_frequency_once():
    omega = np.array([-1.0, 0.0, 1e-9, 1.2e-4, 1.3e-4, 0.1, 1.0, 2.0])
    found = density_of_states(omega, per_decade=5)
    assert found.n_modes.sum() == 6
    assert (found.density * np.diff(found.edges)).sum() == pytest.approx(1, rel=1e-13)
    np.testing.assert_allclose(found.edges[1:] / found.edges[:-1], 10**0.2, rtol=1e-12)
    assert found.omega.shape == found.density.shape
    values = mean_in_bins(np.arange(8.0), omega, found.edges)
    assert values[np.searchsorted(found.edges, 1.25e-4) - 1] == 3.5
    assert np.isnan(values[found.n_modes == 0]).all()
    assert density_of_states(np.array([-1.0])).n_modes.sum() == 0


@pytest.mark.parametrize("name", SMALL)
def test_no_mode_is_unaccounted_for(name):
    matrix = matrix_of(name)
    found = spectrum(matrix)
    counts = count(matrix, found)
    assert counts.n_modes == counts.n_translations + counts.n_floppy + counts.rank
    assert counts.n_self_stress == 1
    assert counts.high_expected == counts.rank + 1  # Marschall & Teitel: N z / 2
    assert counts.low_expected == counts.n_floppy + counts.n_translations - 1
    parts = bands(matrix, found)
    rows = np.concatenate([band.modes for band in parts])
    np.testing.assert_array_equal(np.sort(rows), np.flatnonzero(~found.is_translation))
    assert parts[-1].name == "high"
    assert parts[-1].n_modes == counts.rank
    assert parts[-1].mean_omega == pytest.approx(found.omega[parts[-1].modes].mean())


def with_values(low, above):
    """A spectrum of nearly round rods with these eigenvalues, and their rank: four translations and soft modes fewer."""
    matrix = matrix_of("rods of alpha 1")
    found = spectrum(matrix)
    values = np.concatenate([low, above])
    values = np.append(values, [1.0] * (matrix.size - len(values)))[: matrix.size]
    translation = values == 0
    sigma = found.singular_values.copy()
    sigma[matrix.size - len(low) :] = 0
    return matrix, replace(
        found, eigenvalues=values, is_translation=translation, singular_values=sigma,
        solver_error=np.full(matrix.size, 1e-20), entry_error=np.zeros(matrix.size),
        overlap_error=np.zeros(matrix.size),
    )  # fmt: skip


def test_bands_of_a_spectrum_with_all_three():
    matrix, made = with_values([-1e-15, 0, 0, 1e-16, 3e-9, 4e-8], np.linspace(0.01, 1, 40))
    assert why_no_bands(matrix, made) == ""
    low, middle, high = bands(matrix, made)
    assert (low.n_modes, middle.n_modes, high.n_modes) == (2, 2, matrix.size - 6)
    assert (low.n_negative, low.n_unsure) == (1, 0)
    assert low.mean_omega == pytest.approx(1e-8)
    assert low.gap_below == np.inf
    assert middle.gap_below == pytest.approx(3e6)
    assert high.gap_below == pytest.approx(0.01 / 4e-8)


def test_there_are_no_bands_without_a_gap_where_the_rank_says_so():
    matrix, made = with_values([0, 0, 2e-3, 4e-3, 6e-3], np.geomspace(0.01, 1, 40))
    assert bands(matrix, made) == []
    assert "leaves 3 modes below the high band, but the widest gap near there" in why_no_bands(
        matrix, made
    )


def test_low_and_middle_modes_that_run_into_each_other_are_in_no_band():
    matrix, made = with_values([0, 0, *np.geomspace(1e-14, 1e-10, 12)], np.linspace(0.01, 1, 40))
    (high,) = bands(matrix, made)
    assert (high.name, high.n_modes) == ("high", matrix.size - 14)
    assert "the softest 12 modes do not split into low and middle bands" in why_no_bands(
        matrix, made
    )


def test_bonds_in_excess_of_the_modes_leave_no_bands():
    """Discs of a hexagonal crystal, far above jamming: three bonds for each, which has two coordinates."""
    a, h = 0.9, 0.9 * np.sqrt(0.75)
    position = [[(i + 0.5 * (j % 2)) * a, j * h] for j in range(4) for i in range(4)]
    packing = discs(np.array(position), (4 * a, 4 * h))
    matrix = dynamical_matrix(Landscape(packing), State.of(packing))
    found = spectrum(matrix)
    assert (matrix.n_bonds, found.rank()) == (48, 30)
    assert bands(matrix, found) == []
    assert why_no_bands(matrix, found).startswith(
        "no bands: 48 bonds constrain all of the 30 vibrational"
    )


def test_bonds_of_a_brick_wall_of_rods_are_redundant():
    # Flat on both sides of two neighbours each: 16 bonds of 4 rods, which can move up and down against
    # each other (3) and turn (4).
    length, height = 3.01, 1 - 1e-9
    position = [[i * length + j * length / 2, j * height] for j in range(2) for i in range(2)]
    packing = make(position, 0.0, half_length=1.0, edges=(2 * length, 2 * height))
    matrix = dynamical_matrix(Landscape(packing), State.of(packing))
    assert matrix.n_bonds == 16
    found = spectrum(matrix)
    assert found.rank() == 7
    assert count(matrix, found).n_self_stress == 9
    (ring,) = redundancies(matrix)
    assert ring.n_states == 8
    assert len(ring.bonds) == 16
    np.testing.assert_array_equal(ring.particles, range(4))
    assert ring.largest_singular_value < 1e-12


@pytest.mark.parametrize("name", SMALL)
def test_small_packings_have_nothing_redundant(name):
    assert redundancies(matrix_of(name)) == []
