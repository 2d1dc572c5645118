import numpy as np
import pytest
import scipy.sparse
from test_minimise import squeezed

from jamshape.landscape import Landscape
from jamshape.minimise import minimise
from jamshape.newton import Factorisation, add_to_diagonal
from jamshape.stiff_compression import drag_coefficients
from jamshape.stiff_stage import Stage, Units, solve
from jamshape.vicinity import Vicinity

STRAIN, ACCURACY = -3e-4, 1e-5


@pytest.fixture(scope="module")
def jammed():
    packing, state = squeezed(24, 4.0, 0.95)
    landscape = Landscape(packing)
    return landscape, minimise(landscape, state).state


def stage_of(jammed, h):
    landscape, state = jammed
    drag = drag_coefficients(landscape) / h
    return Stage(Vicinity(landscape, state), STRAIN, drag, np.zeros(landscape.size), extended=False)


def units_of(landscape, state):
    found = landscape.evaluate(state)
    overlap = found.bond_force
    return Units(found.bond_force, found.n_bonds * overlap**2, np.sqrt(overlap))


@pytest.mark.parametrize("h", [1.0, 1e3, 1e6])
def test_stages_are_solved_in_few_evaluations_while_bonds_open_and_close(jammed, h):
    landscape, state = jammed
    stage, units = stage_of(jammed, h), units_of(landscape, state)
    start = np.zeros(landscape.size)
    bonds = stage.evaluate(start)[0].n_bonds
    before = landscape.evaluations
    found = solve(stage, (start, start), None, units, ACCURACY)
    assert found.solved
    assert landscape.evaluations - before <= 9
    evaluation, gradient = stage.evaluate(found.x)
    assert np.abs(gradient).max() < 1e-3 * units.force
    if h == 1e6:
        assert evaluation.n_bonds != bonds


def test_a_guess_in_a_collision_gives_way_to_the_other(jammed):
    landscape, state = jammed
    stage, units = stage_of(jammed, 1e3), units_of(landscape, state)
    still = np.zeros(landscape.size)
    wild = np.random.default_rng(1).normal(size=landscape.size)
    expected = solve(stage, (still, still), None, units, ACCURACY)
    assert expected.solved
    assert solve(stage, (wild, still), None, units, ACCURACY).x == pytest.approx(expected.x, abs=0)


def test_factors_of_an_earlier_stage_that_are_good_enough_are_kept(jammed):
    landscape, state = jammed
    stage, units = stage_of(jammed, 1.0), units_of(landscape, state)
    still = np.zeros(landscape.size)
    first = solve(stage, (still, still), None, units, ACCURACY)
    again = solve(stage, (first.x, still), first.factors, units, ACCURACY)
    assert first.factorisations > 0
    assert again.factorisations == 0
    assert again.factors is first.factors


class Folded(Stage):
    """x.K x / 2 - b.x + sum of h |n.x| in the place of the energy: kinks across some vectors n."""

    def put(self, matrix, b, across, height):
        object.__setattr__(self, "parts", (matrix, b, across, height))
        return self

    def evaluate(self, x):
        matrix, b, across, height = self.parts
        found = self.landscape.evaluate(self.vicinity.base)
        return found, matrix @ x - b + across.T @ (height * np.sign(across @ x))

    def factorise(self, x):  # noqa: ARG002 - the same everywhere
        return Factorisation.of(self.parts[0], 0.0)


@pytest.mark.parametrize("accuracy", [1e-2, 1e-4, 1e-6])
def test_a_solution_on_a_kink_near_by_is_found(jammed, accuracy):
    landscape, _ = jammed
    n, rng = landscape.size, np.random.default_rng(2)
    root = rng.normal(size=(n, n)) / np.sqrt(n)
    matrix = add_to_diagonal(scipy.sparse.csc_matrix(root @ root.T), 1.0)
    b = 1e-3 * rng.normal(size=n)
    across = rng.normal(size=(1, n)) / np.sqrt(n)
    height = 10 * np.abs(np.linalg.solve(matrix.toarray(), b) @ across[0])
    # On it by Lagrange's multiplier, which the kink holds.
    solved = np.linalg.solve(matrix.toarray(), np.column_stack([b, across[0]]))
    multiplier = across[0] @ solved[:, 0] / (across[0] @ solved[:, 1])
    assert abs(multiplier) < height
    exact = solved[:, 0] - multiplier * solved[:, 1]

    units = Units(1.0, float(exact @ (matrix @ exact)), 1.0)
    plain = stage_of(jammed, 1.0)
    stage = Folded(plain.vicinity, 0.0, np.zeros(n), plain.centre, extended=False)
    stage.put(matrix, b, across, height)
    away = rng.normal(size=n)
    start = exact + 20 * accuracy * np.sqrt(units.energy / (away @ (matrix @ away))) * away
    found = solve(stage, (start, start), None, units, accuracy)
    off = found.x - exact
    assert found.solved
    # Solutions on kinks may be ten times the accuracy away; the kink alone is found to the accuracy.
    assert np.sqrt(off @ (matrix @ off) / units.energy) < 10 * accuracy
    assert abs(across[0] @ off) < 10 * accuracy * np.sqrt(units.energy)
