"""States at rest on corners of the energy, where no side has forces that are zero but a mixture of them is."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from chosen_seeds import chosen_by_seed
from mixtures import bidisperse

import jamshape as js
from jamshape.files.h5md import read_attributes, read_packing
from jamshape.landscape import Evaluation, Landscape, State
from jamshape.minima import Outcome, Stop, minimise, residual_of
from jamshape.minima.nonsmooth import at_rest, weights_of
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
    found = at_rest(landscape, near, TOLERANCE)
    assert found.n_sides == 1
    assert residual_of(landscape, landscape.evaluate(found.state)).largest <= TOLERANCE


class Folded:
    """A quadratic form with kinks across planes through 0, where it is least; the curvature jumps at each."""

    length, stiffness, bond_force = 1.0, 1.0, 1e-3

    def __init__(self, kinks, seed, size=60):
        rng = np.random.default_rng(seed)
        half = rng.normal(size=(size, size))
        self.smooth = half @ half.T / size + 0.1 * np.eye(size)
        self.normals = rng.normal(size=(kinks, size))
        self.normals /= np.linalg.norm(self.normals, axis=1)[:, None]
        self.jumps = self.bond_force * 10 ** rng.uniform(-2, -1, kinks)
        self.pull = (self.jumps * rng.uniform(-0.8, 0.8, kinks)) @ self.normals
        self.bend = rng.uniform(0, 0.5, kinks)
        self.size, self.law = size, SimpleNamespace(overlap_over_harmonic=lambda _: 1.0)

    def displaced(self, x, step):
        return x + step

    def evaluate(self, x):
        across, Hx = self.normals @ x, self.smooth @ x
        over = np.maximum(across, 0)
        energy = x @ Hx / 2 - self.pull @ x + self.jumps @ np.abs(across) + self.bend @ over**2 / 2
        force = (self.jumps * np.where(across > 0, 1, -1) + self.bend * over) @ self.normals
        return Evaluation(energy + 1e-7, Hx - self.pull + force, None, self.bond_force, 1, None)

    def curvature(self, x):
        bent = self.bend * (self.normals @ x > 0)
        return SimpleNamespace(hessian=self.smooth + (self.normals.T * bent) @ self.normals)

    def newton_at(self, x):
        inverse = np.linalg.inv(self.curvature(x).hessian)
        return SimpleNamespace(
            shift=0.0, prepare=lambda: None, solve=lambda gradients, _: gradients @ inverse
        )


@pytest.mark.parametrize("kinks", range(1, 6))
def test_kinks_that_meet_are_found_together(kinks, monkeypatch):
    """Their minimum is at 0 by construction; every side of it pulls there."""
    part, folded = "jamshape.minima.nonsmooth.", Folded(kinks, seed=0)
    monkeypatch.setattr(
        part + "LocalEnergyModel",
        lambda _, x: SimpleNamespace(
            newton=lambda _: folded.newton_at(x),
            evaluate=lambda step, *_, **__: folded.evaluate(x + step),
        ),
    )
    monkeypatch.setattr(part + "least_shift", lambda *_: 0.0)
    monkeypatch.setattr(
        part + "residual_of",
        lambda _, at: SimpleNamespace(largest=np.abs(at.gradient).max() / at.bond_force),
    )
    start = 1e-5 * np.random.default_rng(9).normal(size=folded.size)
    found = at_rest(folded, start, TOLERANCE)
    assert found.n_sides > kinks
    assert np.abs(found.state).max() < 1e-9 * folded.bond_force
    assert np.abs(folded.evaluate(found.state).gradient).max() > 1e-3 * folded.bond_force


def test_where_nothing_touches_there_is_no_corner():
    apart = random_packing(4, 0.1, 1, bidisperse(1.0))
    assert at_rest(Landscape(apart), State.of(apart), TOLERANCE) is None


@pytest.mark.parametrize("seed", range(5))
def test_weights_are_those_of_a_search_over_all(seed):
    rng = np.random.default_rng(seed)
    k = 3
    half = rng.normal(size=(k, k))
    products, below = half @ half.T, rng.uniform(0, 0.3, k)
    found = weights_of(products, below)
    assert found.min() >= 0
    assert found.sum() == pytest.approx(1)
    grid = np.linspace(0, 1, 201)
    a, b = (part.ravel() for part in np.meshgrid(grid, grid))
    inside = a + b <= 1
    tried = np.column_stack([a, b, 1 - a - b])[inside]
    values = np.einsum("ti,ij,tj->t", tried, products, tried) / 2 + tried @ below
    assert found @ products @ found / 2 + found @ below <= values.min() + 1e-12
