import numpy as np
import pytest
from test_minimise import squeezed

from jamshape.landscape import Landscape
from jamshape.minimise import minimise
from jamshape.stiff_compression import drag_coefficients
from jamshape.vicinity import Stage, Units, Vicinity

STRAIN, ACCURACY = -3e-4, 1e-5


class Posed:
    """A stage of h in time about a state, and what is minimised."""

    def __init__(self, landscape, state, h, extended=False):
        self.vicinity, self.n = Vicinity(landscape, state), landscape.size
        self.drag, self.extended = drag_coefficients(landscape) / h, extended
        found = landscape.evaluate(state)
        overlap = found.bond_force
        self.units = Units(
            overlap, found.n_bonds * overlap**2, np.sqrt(overlap), landscape.particles.n
        )

    def solve(self, *guesses, factors=None, accuracy=ACCURACY):
        stage = Stage(STRAIN, self.drag, np.zeros(self.n), guesses, self.extended)
        return self.vicinity.solve(stage, factors, self.units, accuracy)

    def evaluate(self, x):
        found = self.vicinity.evaluate(x, STRAIN, extended=self.extended)
        return found, self.vicinity.stretch(STRAIN) * found.gradient + self.drag * x

    def size(self, x, force):
        return self.units.size(x, force, self.drag)


@pytest.fixture(scope="module")
def jammed():
    packing, state = squeezed(24, 4.0, 0.95)
    landscape = Landscape(packing)
    return landscape, minimise(landscape, state).state


@pytest.mark.parametrize("h", [1.0, 1e3, 1e6])
def test_stages_are_solved_in_few_evaluations_while_bonds_open_and_close(jammed, h):
    posed = Posed(*jammed, h)
    start = np.zeros(posed.n)
    bonds = posed.evaluate(start)[0].n_bonds
    before = posed.vicinity.landscape.evaluations
    found = posed.solve(start, start)
    assert found.solved
    assert posed.vicinity.landscape.evaluations - before <= 9
    evaluation, gradient = posed.evaluate(found.x)
    assert np.abs(gradient).max() < 1e-3 * posed.units.force
    if h == 1e6:
        assert evaluation.n_bonds != bonds


def test_a_guess_in_a_collision_gives_way_to_the_other(jammed):
    posed = Posed(*jammed, 1e3)
    still = np.zeros(posed.n)
    wild = np.random.default_rng(1).normal(size=posed.n)
    expected = posed.solve(still, still)
    assert expected.solved
    assert posed.solve(wild, still).x == pytest.approx(expected.x, abs=0)


def test_factors_of_an_earlier_stage_that_are_good_enough_are_kept(jammed):
    posed = Posed(*jammed, 1.0)
    still = np.zeros(posed.n)
    first = posed.solve(still, still)
    again = posed.solve(first.x, still, factors=first.factors)
    assert first.factorisations > 0
    assert again.factorisations == 0
    assert again.factors.compiled is first.factors.compiled
    assert np.abs(again.x - first.x).max() < 1e-6 * np.abs(first.x).max()


def test_solutions_near_kinks_are_found_by_bisection():
    packing, state = squeezed(24, 1.0, 0.9)
    landscape = Landscape(packing)
    minimum = minimise(landscape, state).state
    bisected = 0
    for seed in range(10):
        posed = Posed(landscape, minimum, 1e5)
        guess = 3e-3 * np.random.default_rng(seed).normal(size=posed.n)
        before = landscape.evaluations
        found = posed.solve(guess, np.zeros(posed.n))
        if not found.solved:
            continue
        bisected += landscape.evaluations - before > found.directions + 1
        again = posed.solve(found.x, found.x, accuracy=1e-3 * ACCURACY)
        off = again.x - found.x
        assert again.solved
        assert posed.size(off, posed.drag * off) < 3 * ACCURACY
        assert np.abs(posed.evaluate(found.x)[1]).max() < 1e-3 * posed.units.force
    assert bisected >= 1


def test_factors_of_what_is_not_finite_are_refused(jammed):
    posed = Posed(*jammed, 1.0)
    with pytest.raises(ValueError, match="not a number"):
        posed.vicinity.factorise(np.zeros(posed.n), 0.0, np.full(posed.n, np.nan))
    assert not posed.solve(np.full(posed.n, np.nan), np.full(posed.n, np.nan)).solved
