"""Packings of every shape at a chosen energy, from random starts to files; their modes and ladders."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from every_shape import (
    EPS,
    MIXTURES,
    SIDES,
    TYPICAL,
    Case,
    close_to,
    in_doubles,
    particles_of,
    taken,
)
from making import made as made_of
from making import stage_of, stages_of, write_every_mark
from written import FINISHED, write_columns

from common.energy_along import AlongModes
from common.ladder import climb
from jamshape.contacts import coordination, find_contacts, find_rattlers
from jamshape.files.h5md import (
    read_attributes,
    read_observables,
    read_packing,
    read_report,
    write_packing,
)
from jamshape.landscape import Landscape
from jamshape.measures.packing_summary import measure
from jamshape.minima import METHODS, Outcome, Stop, minimise
from jamshape.minima.target import Target, find
from jamshape.packing import State
from jamshape.protocols import approach
from jamshape.protocols.approach import Approach
from jamshape.protocols.make import Dynamics, Recipe, Steps, Thermalisation, is_done, make
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.vibration.elasticity import moduli
from jamshape.vibration.hessian import dynamical_matrix
from jamshape.vibration.spectrum import spectrum, state_error
from jamshape.vibration.statistics import components, count, participation
from methods.lammps_cg import lammps_cg
from methods.lbfgs import lbfgs

# What is asked for: the energy density, how well it is met, and what may be left of the forces.
U0, ACCURACY, RESIDUAL = 1e-10, 1e-7, 1e-8
TARGET, AT_JAMMING = Target(U0), Target(1e-16)

# Coarse, since the energy is led to its target from wherever this ends.
QUASISTATIC = Quasistatic(step=0.03, energy=1e-6, closeness=2.0, tolerance=1e-3)
FAST = Approach(kappa=5e-3, kappa_start=2e-2, p_flow=1e-2, p_end=5e-2, p_open=4e-2, strain=2e-3)
RESTS = ("position", "position_rest", "orientation", "orientation_rest")
CASES = [*TYPICAL, *MIXTURES]
EVERY = pytest.mark.parametrize("case", CASES, ids=str)
TYPICAL_ONES = pytest.mark.parametrize("case", TYPICAL, ids=str)
PLANE = pytest.mark.parametrize("case", [c for c in TYPICAL if c.dimension == 2], ids=str)


def recipe_of(case, seed=1, **others):
    n, phi_start = {2: (12, 0.25), 3: (8, 0.12)}[case.dimension]
    fields = {"phi_start": phi_start, "way": Steps(QUASISTATIC), "target": TARGET, "n": n}
    return Recipe(particles_of(case), dimension=case.dimension, seed=seed, **(fields | others))


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("packings")


@pytest.fixture(scope="session")
def made(folder):
    """Make a packing once: its file."""

    @cache
    def of(case: Case) -> Path:
        out = folder / f"{case}.h5"
        stages = stages_of(recipe_of(case), out)
        assert {"compression", "search"} <= set(stages)
        return out

    return of


@pytest.fixture(scope="session")
def modes(made):
    @cache
    def of(case: Case):
        packing = read_packing(made(case))
        landscape, state = Landscape(packing, sides=SIDES), State.of(packing)
        matrix = dynamical_matrix(landscape, state)
        return landscape, state, matrix, spectrum(matrix)

    return of


def cut_off(monkeypatch, recipe, out, after):
    """Make a packing up to a row of progress; only here each mark is written, which takes longer than the rows."""
    with monkeypatch.context() as patch:
        write_every_mark(patch)
        return stages_of(recipe, out, after)


def assert_at_the_energy(out, u0=U0):
    stored = read_attributes(out)
    assert is_done(out)
    assert stored["outcome"] in {"converged", "sliding"}
    assert abs(stored["u"] / u0 - 1) <= ACCURACY
    if stored["outcome"] == "converged":
        assert stored["residual"] <= RESIDUAL
    # The file itself holds it: to rounding of overlaps, which long doubles know to 1e-13.
    packing = read_packing(out)
    found = Landscape(packing, sides=SIDES).evaluate(State.of(packing))
    assert found.energy / packing.box.volume == close_to(stored["u"], 1e-10)
    return stored, packing


# --- packings ------------------------------------------------------------------------------------


@EVERY
def test_steps_lead_to_the_energy(case, made, measured):
    stored, packing = assert_at_the_energy(made(case))
    measured(phi=stored["phi"], z=stored["z"], residual=stored["residual"])
    network = find_contacts(packing, sides=SIDES)
    assert {key: stored[key] for key in coordination(packing, network)._fields} == (
        coordination(packing, network)._asdict()
    )
    rattlers = packing.id[find_rattlers(packing, network)]
    np.testing.assert_array_equal(read_observables(made(case))["rattler_ids"][0], rattlers)
    assert stored["phi"] == close_to(packing.phi, 4 * EPS)
    assert stored["phi_J"] < stored["phi"]
    assert stored["z"] > case.dimension + 1
    assert 0 < stored["pressure"] < 1e-3
    assert read_report(made(case)).error[-1] == stored["residual"]


def by_dynamics_of(case):
    return recipe_of(case, n=10, phi_start=0.45, way=Dynamics(FAST))


@pytest.mark.lammps
@PLANE
def test_dynamics_lead_to_the_energy_also_when_cut_off(case, tmp_path, monkeypatch, measured):
    monkeypatch.setattr(approach, "ROWS_PER_MARK", 10)
    whole, cut, recipe = tmp_path / "whole.h5", tmp_path / "cut.h5", by_dynamics_of(case)
    assert set(stages_of(recipe, whole)) == {"compression", "search"}
    stored, _ = assert_at_the_energy(whole)
    measured(phi=stored["phi"], z=stored["z"])
    assert set(cut_off(monkeypatch, recipe, cut, 37)) == {"compression"}
    make(recipe, cut)
    assert_same_packing(cut, whole)


@PLANE
def test_hard_particles_on_the_way(case, tmp_path):
    way = Steps(QUASISTATIC, Thermalisation(0.2, 20))
    recipe = recipe_of(case, n=16, phi_start=0.12, way=way)
    stages = set(stages_of(recipe, tmp_path / "a.h5"))
    assert {"compression", "Monte Carlo", "search"} == stages
    stored, _ = assert_at_the_energy(tmp_path / "a.h5")
    assert 0.05 < stored["acceptance"] <= 1


@TYPICAL_ONES
def test_packings_without_a_target_are_the_first_that_are_jammed(case, tmp_path):
    recipe = recipe_of(case, target=None)
    make(recipe, tmp_path / "a.h5")
    stored = read_attributes(tmp_path / "a.h5")
    assert 1e-6 < stored["energy_per_particle"] <= 2e-6
    assert stored["residual"] <= 1e-3


def assert_same_packing(one, other):
    for a, b in zip(read_packing(one).poses(), read_packing(other).poses(), strict=True):
        np.testing.assert_array_equal(a, b)
    names = ("u", "pressure", "phi", "z", "n_rattlers", "outcome", "residual")
    mine, theirs = read_attributes(one), read_attributes(other)
    assert {name: mine[name] for name in names} == {name: theirs[name] for name in names}


@TYPICAL_ONES
def test_what_was_cut_off_goes_on_to_the_same_bits(case, made, tmp_path, monkeypatch):
    out, recipe = tmp_path / "a.h5", recipe_of(case)
    assert set(cut_off(monkeypatch, recipe, out, 5)) == {"compression"}
    assert {path.name for path in tmp_path.iterdir()} == {"a.h5.making.h5"}
    stages = stages_of(recipe, out)
    assert len(stages) > 5
    assert_same_packing(out, made(case))
    assert {path.name for path in tmp_path.iterdir()} == {"a.h5"}


def compressed(recipe, out, packing):
    """What a compression by dynamics leaves, ended at some packing."""
    phi = np.linspace(0.9, 1.0, 20) * packing.phi
    rows = {"phi": phi, "pressure": 0.0 * phi, "kappa": np.ones(20)}
    write_columns(
        out.with_name(out.name + ".run.h5"), packing, recipe.attributes() | FINISHED, rows
    )


@TYPICAL_ONES
def test_a_search_from_below_jamming_goes_on_to_the_same_bits(case, made, tmp_path, monkeypatch):
    packing = read_packing(made(case))
    loose = in_doubles(State.of(packing).strained(2e-3).packing(packing))
    recipe = recipe_of(case, way=Dynamics(FAST))
    whole, cut = tmp_path / "whole.h5", tmp_path / "cut.h5"
    for out in (whole, cut):
        compressed(recipe, out, loose)
    stages = stages_of(recipe, whole)
    assert set(stages) == {"search"}
    assert len(stages) > 3
    assert_at_the_energy(whole)
    cut_off(monkeypatch, recipe, cut, 2)
    assert (tmp_path / "cut.h5.making.h5").exists()
    assert len(stages_of(recipe, cut)) == len(stages) - 2
    assert_same_packing(cut, whole)
    assert not (tmp_path / "cut.h5.making.h5").exists()


@TYPICAL_ONES
def test_files_of_other_recipes_are_refused(case, tmp_path, monkeypatch):
    recipe = recipe_of(case)
    cut_off(monkeypatch, recipe, tmp_path / "a.h5", 2)
    other = replace(recipe, seed=3)
    assert not np.array_equal(other.start().position, recipe.start().position)
    with pytest.raises(ValueError, match="seed=1, expected 3"):
        make(other, tmp_path / "a.h5")
    [told] = made_of(other, tmp_path / "a.h5", 1, again=True)
    assert stage_of(told) == "compression"


# --- files ---------------------------------------------------------------------------------------


@EVERY
def test_files_hold_packings_to_the_last_bit(case, made, tmp_path):
    packing = read_packing(made(case))
    assert packing.has_rests
    write_packing(tmp_path / "copy.h5", packing, {"note": "a copy"})
    again = read_packing(tmp_path / "copy.h5")
    for one, other in zip(packing.poses(), again.poses(), strict=True):
        np.testing.assert_array_equal(one, other)
    for name in ("diameters", "form", "species", "id", "image"):
        np.testing.assert_array_equal(getattr(again, name), getattr(packing, name))
    assert again.shape_style == packing.shape_style == case.shape
    assert read_attributes(tmp_path / "copy.h5") == {"note": "a copy"}
    energies = [Landscape(p).evaluate(State.of(p)).energy for p in (packing, again)]
    assert energies[0] == energies[1]


# --- minima --------------------------------------------------------------------------------------


@pytest.mark.lammps
@TYPICAL_ONES
@pytest.mark.parametrize("method", [*METHODS, lbfgs, lammps_cg])
def test_every_minimiser_finds_a_minimum(case, method, made, measured):
    packing = read_packing(made(case))
    landscape = Landscape(packing, sides=SIDES)
    state = State.of(packing).strained(-5e-3)
    start = landscape.evaluate(state)
    found = minimise(landscape, state, method, Stop(tolerance=1e-4, evaluations=3000))
    measured(residual=found.residual.largest, evaluations=landscape.evaluations)
    assert found.evaluation.energy < start.energy
    # First-order methods may stall; conjugate gradients of LAMMPS also creep on.
    stalls = {Outcome.STALLED} if method in {"cg_marschall", lammps_cg, lbfgs} else set()
    unfinished = stalls | ({Outcome.EXHAUSTED} if method is lammps_cg else set())
    assert found.outcome in {Outcome.CONVERGED, Outcome.SLIDING} | unfinished
    again = Landscape(packing, sides=SIDES).evaluate(found.state)
    assert again.energy == close_to(found.evaluation.energy, 1e-9)
    assert found.outcome in unfinished or found.residual.largest <= 1e-4


@EVERY
def test_a_minimum_is_lower_than_its_neighbours(case, made):
    packing = read_packing(made(case))
    landscape, state = Landscape(packing, sides=SIDES), State.of(packing)
    here, rng = landscape.evaluate(state), np.random.default_rng(8)
    for size in (1e-6, 1e-4, 1e-2):
        for _ in range(5):
            step = size * landscape.length * rng.uniform(-1, 1, landscape.size)
            assert landscape.evaluate(landscape.displaced(state, step)).energy > here.energy


# --- modes ---------------------------------------------------------------------------------------


@EVERY
def test_modes_are_as_many_as_the_freedoms_of_the_backbone(case, modes, measured):
    landscape, state, matrix, found = modes(case)
    packing = state.packing(landscape.particles)
    held = ~landscape.rattlers(state)
    counts = count(matrix, found)
    measured(bonds=counts.n_bonds, rank=counts.rank, floppy=counts.n_floppy)
    assert matrix.size == packing.freedoms[held].sum() == len(found.eigenvalues)
    assert matrix.n_particles == held.sum() > 0.5 * packing.n
    assert counts.n_translations == case.dimension
    assert counts.n_modes == counts.n_translations + counts.n_floppy + counts.rank


@EVERY
def test_all_bonds_but_one_are_constraints(case, modes, measured):
    """But for those that a contact has twice: of a particle with its own image, or of two that are one.

    Where it jams: contacts that close above are constraints too many.
    """
    landscape, state, *_ = modes(case)
    matrix = dynamical_matrix(landscape, find(landscape, state, AT_JAMMING).state)
    found = spectrum(matrix)
    bonds, C, twice = matrix.bonds, matrix.compatibility.toarray(), 0
    for contact in np.unique(bonds.contact):
        rows = C[bonds.contact == contact]
        twice += len(rows) - np.linalg.matrix_rank(rows, rtol=1e-9)
    merged = int((bonds.slot >= matrix.contacts["n_bonds"][bonds.contact]).sum())
    rank = count(matrix, found).rank
    measured(bonds=matrix.n_bonds, rank=rank, twice=twice, merged=merged)
    assert rank == np.linalg.matrix_rank(C, rtol=1e-9)
    assert matrix.n_bonds - 1 - twice - merged <= rank <= matrix.n_bonds - 1 - twice


@EVERY
def test_no_mode_of_a_minimum_is_unstable(case, modes, measured):
    landscape, state, matrix, found = modes(case)
    real = ~found.is_translation
    # What is left of the forces bends modes that cost nothing by as much as they cost.
    bound = found.bound + state_error(landscape, state, matrix, found)
    measured(lowest=found.eigenvalues[real].min())
    assert (found.eigenvalues[real] >= -bound[real]).all()
    assert (found.eigenvalues[real] > bound[real]).mean() > 0.9
    assert (np.abs(found.eigenvalues[~real]) <= bound[~real]).all()


@EVERY
def test_eigenvalues_are_those_of_the_hessian_of_the_landscape(case, modes):
    landscape, state, matrix, found = modes(case)
    held = matrix.coordinates.backbone
    rests = {name: getattr(state.packing(landscape.particles), name)[held] for name in RESTS}
    backbone = taken(state.packing(landscape.particles), held, **rests)
    alone = Landscape(backbone, sides=SIDES)
    hessian = alone.curvature(State.of(backbone), extended=True).hessian
    length = np.where(alone.rotation_length > 0, alone.rotation_length, 1.0)[:, None]
    columns = []
    for one in np.eye(matrix.size):
        shift, turn = (part[held] for part in matrix.coordinates.motion(one))
        columns.append(alone.coordinates(np.column_stack([shift, turn * length])))
    embedding = np.array(columns).T
    np.testing.assert_allclose(embedding.T @ embedding, np.eye(matrix.size), atol=1e-12)
    expected = np.linalg.eigvalsh(embedding.T @ hessian @ embedding)
    rounding = 10 * matrix.size * EPS * expected[-1]
    assert (np.abs(found.eigenvalues - expected) <= rounding + found.bound).all()


@EVERY
def test_vectors_are_modes(case, modes):
    """Where it jams: above, the prestress of two bonds that become one is as large as stiffness."""
    landscape, state, *_ = modes(case)
    state = find(landscape, state, AT_JAMMING).state
    matrix = dynamical_matrix(landscape, state)
    found = spectrum(matrix)
    # The prestress mixes floppy with stiff modes: taken into account to third order.
    stiff = np.arange(matrix.size) >= matrix.size - count(matrix, found).rank
    V, values = found.vectors, found.eigenvalues
    mixed = V[:, ~stiff].T @ (matrix.prestress @ V[:, stiff]) / values[stiff]
    tolerance = 1e-12 + matrix.size * np.abs(mixed).max() ** 4
    assert tolerance < 1e-3
    assert np.abs(V.T @ V - np.eye(matrix.size)).max() <= tolerance
    assert np.abs(matrix.matrix @ V - V * values).max() <= tolerance * values[-1]
    N = matrix.n_particles
    spread = participation(matrix.coordinates, found.vectors)
    assert (spread >= (1 - 1e-12) / N).all()
    assert (spread <= matrix.size / N * (1 + 1e-12)).all()
    parts = components(matrix.coordinates, state.packing(landscape.particles), found.vectors)
    np.testing.assert_allclose(np.sum(parts, axis=0), 1, rtol=1e-10)
    assert moduli(matrix).bulk.relaxed > 0


@EVERY
def test_the_energy_along_modes_is_that_of_their_eigenvalues(case, modes, measured):
    landscape, state, matrix, found = modes(case)
    along = AlongModes(state.packing(landscape.particles), matrix.coordinates)
    real = np.flatnonzero(~found.is_translation)
    worst = 0.0
    for k in (real[len(real) // 2], real[-1]):
        # Far below the overlaps of 1e-5, so that bonds neither open nor close.
        at = along.energy(found.vectors[:, k], [1e-12, 1e-11])
        assert np.isnan(at.first_change)
        stiff = at.mean_slope / at.delta
        worst = max(worst, np.abs(stiff / found.eigenvalues[k] - 1).max())
    measured(off=worst)
    assert worst < 1e-3


# --- ladders -------------------------------------------------------------------------------------


@EVERY
def test_a_packing_is_led_to_other_energies(case, made, tmp_path, measured):
    rungs = list(climb(made(case), [1e-8], tmp_path))
    assert [rung.failure for rung in rungs] == [""]
    stored, packing = assert_at_the_energy(rungs[0].path, 1e-8)
    measured(shared=stored["contacts_shared"])
    assert stored["phi"] > read_attributes(made(case))["phi"]
    assert 0 <= stored["contacts_shared"] <= 1
    assert packing.shape_style == case.shape


@EVERY
def test_what_is_measured_does_not_depend_on_the_order_of_particles(case, made):
    packing, stored = read_packing(made(case)), read_attributes(made(case))
    rows = np.random.default_rng(1).permutation(packing.n)
    mixed = taken(packing, rows, **{name: getattr(packing, name)[rows] for name in RESTS})
    minimum = minimise(Landscape(mixed, sides=SIDES), State.of(mixed), stop=Stop(tolerance=1e-6))
    found = measure(Landscape(mixed, sides=SIDES), minimum)
    np.testing.assert_array_equal(
        np.sort(found.observables["rattler_ids"]),
        np.sort(read_observables(made(case))["rattler_ids"][0]),
    )
    for name in ("z", "z_single", "n_rattlers", "n_bonds", "phi", "S2", "u", "pressure"):
        expected = pytest.approx(stored[name], rel=1e-9, abs=0, nan_ok=True)
        assert found.attributes[name] == expected, name
