import numpy as np
import pytest
from rods_at import rods
from squeezed import quickly_squeezed

from jamshape.flow.implicit import drag_coefficients
from jamshape.landscape import Landscape, State
from jamshape.landscape.local_energy_model import LocalEnergyModel, Stage, Units
from jamshape.minima import minimise
from jamshape.protocols.quasistatic import compressed_to
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles

STRAIN, ACCURACY = -1e-3, 1e-5


class Posed:
    """A stage of h in time about a state, and what is minimised."""

    def __init__(self, landscape, state, h, extended=False, strain=STRAIN):
        self.local_model, self.n = (
            LocalEnergyModel(landscape, state.strained(strain)),
            landscape.size,
        )
        self.drag, self.extended = drag_coefficients(landscape) / h, extended
        found = landscape.evaluate(state)
        overlap = found.bond_force
        self.units = Units(
            overlap, found.n_bonds * overlap**2, np.sqrt(overlap), landscape.particles.n
        )

    def solve(self, *guesses, factors=None, accuracy=ACCURACY):
        stage = Stage(self.drag, np.zeros(self.n), guesses, self.extended)
        return self.local_model.solve(stage, factors, self.units, accuracy)

    def evaluate(self, x):
        found = self.local_model.evaluate(x, 0.0, extended=self.extended)
        return found, found.gradient + self.drag * x

    def size(self, x, force):
        return self.units.size(x, force, self.drag)


@pytest.fixture(scope="module")
def packings():
    """Jammed ones; which bonds open and close in a stage depends on the last bits of a processor's sums."""

    def one(seed):
        packing = random_packing(24, 0.4, seed, Particles.of("spherocylinder", alpha=4.0))
        landscape = Landscape(packing)
        state = compressed_to(landscape, State.of(packing), 0.93, 1e-2)
        return landscape, minimise(landscape, state).state

    return [one(seed) for seed in range(6, 18)]


@pytest.fixture(scope="module")
def jammed(packings):
    return packings[0]


# The others are left to shorter steps.
@pytest.mark.parametrize(("h", "least"), [(1.0, 12), (1e3, 8), (1e6, 6)])
def test_stages_are_solved_in_few_evaluations_while_bonds_open_and_close(packings, h, least):
    solved, changed = 0, 0
    for one in packings:
        posed = Posed(*one, h, strain=4 * STRAIN)
        start = np.zeros(posed.n)
        bonds = posed.evaluate(start)[0].n_bonds
        before = posed.local_model.landscape.evaluations
        found = posed.solve(start, start)
        quick = found.solved and posed.local_model.landscape.evaluations - before <= 9
        evaluation, gradient = posed.evaluate(found.x)
        assert not found.solved or np.abs(gradient).max() < 1e-3 * posed.units.force
        solved += quick
        changed += quick and evaluation.n_bonds != bonds
    assert solved >= least
    assert h < 1e6 or changed


@pytest.mark.parametrize(("n", "strain", "h"), [(12, -3e-3, 1e6), (32, -1e-3, 1e4)])
def test_steps_end_where_bonds_that_turn_them_close(n, strain, h):
    """Whole steps go to and fro here: ten directions do not lead to the solution."""
    packing, state = quickly_squeezed(n, 4.0, 0.9)
    landscape = Landscape(packing)
    posed = Posed(landscape, minimise(landscape, state).state, h, strain=strain)
    start = np.zeros(posed.n)
    before = landscape.evaluations
    found = posed.solve(start, start)
    assert found.solved
    assert landscape.evaluations - before <= 9
    again = posed.solve(found.x, start, accuracy=1e-3 * ACCURACY)
    assert again.solved
    assert posed.size(again.x - found.x, posed.drag * (again.x - found.x)) < ACCURACY


def test_a_guess_in_a_collision_gives_way_to_the_other(jammed):
    posed = Posed(*jammed, 1e3)
    still = np.zeros(posed.n)
    wild = np.random.default_rng(1).normal(size=posed.n)
    expected = posed.solve(still, still)
    assert expected.solved
    # Pairs that were chosen at the other guess are summed in another order.
    assert posed.solve(wild, still).x == pytest.approx(expected.x, rel=1e-9)


def test_factors_of_an_earlier_stage_that_are_good_enough_are_kept(jammed):
    posed = Posed(*jammed, 1.0)
    still = np.zeros(posed.n)
    first = posed.solve(still, still)
    again = posed.solve(first.x, still, factors=first.factors)
    assert first.factorisations > 0
    assert again.factorisations == 0
    assert again.factors.factors.compiled is first.factors.factors.compiled
    assert np.abs(again.x - first.x).max() < 1e-6 * np.abs(first.x).max()


def test_factors_lead_to_a_nearby_solution_with_the_same_bonds(jammed):
    posed, nearby = Posed(*jammed, 1e3), Posed(*jammed, 1e3, strain=1.01 * STRAIN)
    still = np.zeros(posed.n)
    first = posed.solve(still, still)
    found = nearby.solve(first.x, still, factors=first.factors)
    assert found.solved
    assert found.factorisations == 0
    assert found.evaluation.n_bonds == first.factors.n_bonds
    fresh = nearby.solve(first.x, still)
    assert fresh.factorisations > 0
    shift = found.x - fresh.x
    assert nearby.size(shift, nearby.drag * shift) < ACCURACY


@pytest.mark.parametrize("overlap_of_spines", [0.03, 0.06])
def test_solutions_on_kinks_are_found_by_bisection(overlap_of_spines):
    """Rods that touch at one end become parallel, where the other one does: the energy has a kink."""
    tilt = 1e-7  # ten times what counts as parallel
    packing = rods([[5.0, 5.0], [9.0 - overlap_of_spines, 5.999]], [tilt, 0.0], half_length=2.0)
    landscape = Landscape(packing, sides=1)
    posed = Posed(landscape, State.of(packing), h=1.0)
    still = np.zeros(posed.n)
    found = posed.solve(still, still)
    assert found.solved
    assert landscape.evaluations > found.directions + 1
    angle = posed.local_model.at(found.x, STRAIN).orientation[:, 0]
    assert abs(angle[0] - angle[1]) < 0.1 * tilt
    # No place beside it is lower.
    turn = still.copy()
    turn[landscape.coordinates(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])) > 0] = 1.0
    slopes = [posed.evaluate(found.x + way * tilt * turn)[1] @ turn for way in (-1.0, 1.0)]
    assert slopes[0] < -1e-4 * posed.units.force
    assert slopes[1] > 1e-4 * posed.units.force


def test_factors_of_what_is_not_finite_are_refused(jammed):
    posed = Posed(*jammed, 1.0)
    with pytest.raises(ValueError, match="not finite"):
        posed.local_model.factorise(np.zeros(posed.n), 0.0, np.full(posed.n, np.nan))
    for guesses in ((np.nan, 0.0), (0.0, np.nan)):
        with pytest.raises(ValueError, match="a vector of a stage is nan"):
            posed.solve(*(np.full(posed.n, guess) for guess in guesses))
