"""States at rest on corners of the energy, where no side has forces that are zero but a mixture of them is."""

from pathlib import Path

import numpy as np
import pytest
import scipy.optimize
from chosen_seeds import chosen_by_seed
from every_shape import Case, squeezed
from mixtures import bidisperse

import jamshape as js
from jamshape.files.h5md import read_attributes, read_packing
from jamshape.landscape import Landscape, State
from jamshape.minima import Outcome, Stop, minimise, residual_of
from jamshape.minima.descent import Descent
from jamshape.minima.nonsmooth import relax
from jamshape.protocols.random_start import random_packing

TOLERANCE = 1e-8
N = 32
SEEDS = (
    23,
    *range(1, 60),
)  # nearly round rods, of which one packing comes to rest on a corner: the first, on most machines


@pytest.fixture(scope="module")
def cornered(tmp_path_factory):
    """The file of a packing that ended on a corner."""
    file = Path(tmp_path_factory.mktemp("corner")) / "packing.h5"
    rods = js.Spherocylinders(alpha=0.001)
    how = {"n": N, "u0": 1e-15, "file": file, "again": True, "progress": False}
    made = (js.make_packing(rods, seed=seed, **how) for seed in SEEDS)
    next(packing for packing in made if packing.results["outcome"] == "kink")
    return file


@pytest.fixture
def landscape(cornered):
    return Landscape(read_packing(cornered))


@pytest.fixture
def state(cornered):
    return State.of(read_packing(cornered))


def test_such_a_packing_says_so_and_is_in_equilibrium(cornered):
    told = read_attributes(cornered)
    assert told["outcome"] == "kink"
    assert max(told["residual_force"], told["residual_torque"]) <= TOLERANCE
    assert abs(told["u"] / 1e-15 - 1) < 1e-7


def test_its_own_side_is_not_at_rest(landscape, state):
    assert residual_of(landscape, landscape.evaluate(state)).largest > 1e3 * TOLERANCE


def test_the_energy_rises_from_it_in_every_direction(landscape, state):
    rng, here = np.random.default_rng(1), landscape.evaluate(state)
    overlap = here.bond_force * landscape.length**2
    downhill = -here.gradient / np.abs(here.gradient).max()
    ways = [downhill, -downhill, *rng.normal(size=(20, landscape.size))]
    for way in ways:
        step = way / np.abs(way).max()
        for distance in overlap * np.array([1e-6, 1e-4, 1e-2]):
            there = landscape.evaluate(landscape.displaced(state, distance * step))
            assert there.energy >= here.energy * (1 - 1e-15)


def test_forces_turn_round_within_a_hair(landscape, state):
    """The slope along the forces changes its sign over a distance in which smooth forces hardly change."""
    here = landscape.evaluate(state)
    downhill = -here.gradient / np.abs(here.gradient).max()
    near = 1e-6 * here.bond_force * landscape.length**2
    there = landscape.evaluate(landscape.displaced(state, near * downhill))
    assert here.gradient @ downhill < 0 < there.gradient @ downhill
    jump = np.abs(there.gradient - here.gradient).max() / here.bond_force
    assert jump > 1e3 * near / (here.bond_force * landscape.length**2)


@chosen_by_seed
@pytest.mark.parametrize("seed", range(4))
def test_what_is_pushed_away_comes_back(landscape, state, seed):
    rng = np.random.default_rng(seed)
    overlap = landscape.evaluate(state).bond_force * landscape.length**2
    pushed = landscape.displaced(state, 0.03 * overlap * rng.normal(size=landscape.size))
    found = minimise(landscape, pushed, "auto", Stop(TOLERANCE))
    assert found.outcome is Outcome.KINK
    assert found.is_at_rest
    assert found.residual.largest <= TOLERANCE


def test_a_smooth_minimum_has_one_side(tmp_path):
    discs = js.Spherocylinders(alpha=0)
    js.make_packing(discs, n=16, seed=1, u0=1e-10, file=tmp_path / "discs.h5", progress=False)
    packing = read_packing(tmp_path / "discs.h5")
    landscape, state = Landscape(packing), State.of(packing)
    overlap = landscape.evaluate(state).bond_force * landscape.length**2
    rng = np.random.default_rng(3)
    near = landscape.displaced(state, 1e-4 * overlap * rng.normal(size=landscape.size))
    descent = Descent(landscape, near, Stop(TOLERANCE))
    assert relax(descent) is Outcome.CONVERGED
    assert residual_of(landscape, landscape.evaluate(descent.state)).largest <= TOLERANCE


def test_where_nothing_touches_there_is_no_corner():
    apart = random_packing(4, 0.1, 1, bidisperse(1.0))
    descent = Descent(Landscape(apart), State.of(apart), Stop(TOLERANCE))
    assert relax(descent) is Outcome.UNJAMMED


def combined(landscape, state, distance):
    """The least residual of a convex combination of the forces on all sides of a state, found by trying many."""
    rng, here = np.random.default_rng(0), landscape.evaluate(state)
    ways = rng.normal(size=(100, landscape.size))
    ways *= distance / np.abs(ways).max(axis=1)[:, None]
    sides = [
        landscape.evaluate(landscape.displaced(state, way)).gradient for way in (*ways, *-ways)
    ]
    forces = np.array(sides) / here.bond_force
    sum_is_one = 1e3  # a weight in the least squares
    rows = np.vstack([forces.T, np.full(len(forces), sum_is_one)])
    weights, _ = scipy.optimize.nnls(rows, np.append(np.zeros(landscape.size), sum_is_one))
    mixture = weights @ forces / weights.sum() * here.bond_force
    return residual_of(landscape, here._replace(gradient=mixture)).largest


@pytest.mark.parametrize(
    ("alpha", "n", "seed", "u0"),
    [(4, 32, 7, 1e-9), (4, 64, 16, 1e-9), (4, 64, 8, 1e-7), (0.01, 64, 16, 1e-9)],
)
def test_rods_that_slide_along_kinks_come_to_rest(alpha, n, seed, u0):
    """Most of these packings are on a kink; which ones depends on the processor, but not that all are at rest."""
    rods = js.Spherocylinders(alpha=alpha)
    packing = js.make_packing(rods, n=n, seed=seed, u0=u0, progress=False)
    assert packing.results["outcome"] in ("converged", "kink")
    landscape, state = Landscape(packing), State.of(packing)
    here = landscape.evaluate(state)
    if packing.results["outcome"] == "converged":
        assert residual_of(landscape, here).largest <= TOLERANCE
        return
    overlap = here.bond_force * landscape.length**2
    least = min(combined(landscape, state, overlap * near) for near in (1e-6, 1e-7, 1e-8))
    assert least < 0.05 * residual_of(landscape, here).largest


@pytest.mark.parametrize("alpha", [0.01, 4])
def test_rods_are_at_rest_after_each_step_of_a_shear(alpha):
    """On a kink in some of its rows if they are nearly round."""
    rods = js.Spherocylinders(alpha=alpha)
    start = js.make_packing(rods, n=64, seed=1, u0=1e-7, progress=False)
    run = js.quasistatic_shear(start=start, step=1e-3, strain=0.02, progress=False)
    assert run.at_rest.all()


def test_squares_come_to_rest_on_a_kink():
    """Where the far end of a flat contact passes from one corner to another."""
    packing = squeezed(Case("spheropolygon", 2), seed=1)
    landscape = Landscape(packing.with_(law=packing.law.but(power=3.5)))
    found = minimise(landscape, State.of(packing), "auto", Stop(TOLERANCE))
    assert found.outcome is Outcome.KINK
    assert found.residual.largest <= TOLERANCE
    here = landscape.evaluate(found.state)
    overlap = landscape.law.overlap_over_harmonic(here.bond_force) * here.bond_force
    least = min(combined(landscape, found.state, overlap * near) for near in (1e-5, 1e-6, 1e-7))
    assert least < 0.05 * residual_of(landscape, here).largest
