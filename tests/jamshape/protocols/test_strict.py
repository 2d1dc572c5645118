"""Strict minima: what slides is followed to where it stops, and no negative eigenvalue is left."""

import mpmath
import numpy as np
import pytest
from chosen_seeds import chosen_by_seed, chosen_with_avx512
from making import stages_of, write_every_mark
from mixtures import bidisperse

from jamshape.files.h5md import read_attributes, read_packing
from jamshape.landscape import Landscape, State
from jamshape.minima import Outcome, Stop, minimise
from jamshape.minima.target import Target
from jamshape.packing import Box, Packing
from jamshape.protocols.defaults import recipe_for
from jamshape.protocols.make import make
from jamshape.protocols.strict import descend, start
from jamshape.protocols.strict_proof import Proof
from jamshape.shapes.particles import Particles
from jamshape.vibration.hessian import DynamicalMatrixOptions, dynamical_matrix
from jamshape.vibration.kinks import held_at
from jamshape.vibration.sliding import Sliding
from jamshape.vibration.spectrum import spectrum

OVERLAP = 1e-7


def between_flat_sides():
    """A short rod in the middle between two long ones, all parallel, which is pressed on by both.

    In the middle it presses on the ends of its neighbour evenly, which is where they are stiffest: a saddle.
    """
    half_length = np.array([4.0, 2.0, 0.8])
    height = 3 * (1 - OVERLAP)
    packing = Packing(
        position=np.column_stack([np.full(3, 5.0), 0.5 + height / 3 * np.arange(3)]),
        orientation=np.zeros(3),
        diameters=np.column_stack([2 * half_length + 1, np.ones(3), np.ones(3)]),
        species=np.arange(1, 4),
        id=np.arange(1, 4),
        box=Box(lo=np.zeros(2), edges=np.array([10.0, height])),
    )
    landscape = Landscape(packing)
    return landscape, minimise(landscape, State.of(packing), "newton", Stop(1e-8))


@chosen_with_avx512
def test_what_slides_between_flat_sides_is_at_a_saddle():
    landscape, minimum = between_flat_sides()
    assert minimum.outcome is Outcome.CONVERGED
    proof = Proof.of(landscape, minimum.state)
    assert proof.n_negative == 1
    assert proof.lowest + proof.bound < 0


def test_strict_search_leaves_a_saddle():
    landscape, minimum = between_flat_sides()
    target = Target(minimum.energy_density)
    search = start(landscape, minimum.state)
    for _ in descend(landscape, search, target):
        pass
    found = search.minimum
    assert search.n_steps < search.most_steps
    assert found.outcome is Outcome.CONVERGED
    assert found.residual.largest <= target.tolerance
    assert target.is_met(found.energy_density)
    assert search.proof.n_negative == 0
    moved = found.state.position - minimum.state.position
    along = np.diff(moved[:, 0].astype(float))
    assert np.abs(along).max() > 0.1
    assert found.state.volume < minimum.state.volume  # denser at the same energy


def test_steps_end_at_walls():
    landscape, minimum = between_flat_sides()
    moved = minimum.state.displaced(np.array([[0, 0], [0, 0], [0.3, 0]]), np.zeros((3, 1)))
    free = Sliding.at(landscape, moved, 0.05)
    assert free.n_free == 2
    step = free.step(np.full(3, 0.05), landscape.turning_radius)
    assert step.gain < 0
    assert np.abs(step.moved).max() == pytest.approx(0.05)
    along = step.moved[2, 0] - step.moved[1, 0]
    assert along > 0  # on, away from the middle


@pytest.fixture(scope="module")
def strict(tmp_path_factory):
    out = tmp_path_factory.mktemp("strict") / "packing.h5"
    recipe = recipe_for(bidisperse(4.0), n=16, seed=17, strict=True)
    make(recipe, out)
    return out, recipe


def exact_eigenvalues(landscape, state):
    """All of M = C^T C - S, each entry as it is stored, in sixty digits."""
    matrix = dynamical_matrix(landscape, state, DynamicalMatrixOptions(force=True))
    with mpmath.workdps(60):
        C = mpmath.matrix(matrix.compatibility.toarray().tolist())
        S = mpmath.matrix(matrix.prestress.toarray().tolist())
        return [float(x) for x in mpmath.eigsy(C.T * C - S, eigvals_only=True)]


def test_strict_packing_has_no_negative_eigenvalue(strict):
    out, _ = strict
    stored, packing = read_attributes(out), read_packing(out)
    assert stored["outcome"] == "converged"
    assert max(stored["residual_force"], stored["residual_torque"]) <= stored["tolerance"]
    assert stored["n_negative"] == 0
    assert abs(stored["u"] / stored["u0"] - 1) <= stored["accuracy"]
    values = np.sort(exact_eigenvalues(Landscape(packing), State.of(packing)))
    translations = np.sort(np.abs(values))[:2]
    assert translations.max() < 1e-20
    assert values[0] > -1e-20
    assert np.sort(np.abs(values))[2] == pytest.approx(stored["lowest_eigenvalue"], rel=1e-6)


@chosen_by_seed
@pytest.mark.parametrize(
    ("n", "seed"),
    [
        (32, 1),
        (32, 3),
        pytest.param(128, 1, marks=[pytest.mark.validate, chosen_with_avx512]),
    ],
)
def test_what_is_pushed_by_next_to_nothing_meets_its_wall(n, seed, tmp_path):
    """A rod in a channel is pushed by 1e-9 of the mean force, of N = 128 by less than digits tell."""
    out = tmp_path / "packing.h5"
    make(recipe_for(bidisperse(4.0), n=n, seed=seed, strict=True), out)
    stored = read_attributes(out)
    assert (stored["outcome"], stored["n_negative"]) == ("converged", 0)
    assert max(stored["residual_force"], stored["residual_torque"]) <= stored["tolerance"]
    assert stored["strict_steps"] < 100


def energies_beside(landscape, minimum, size):
    """Energies to both sides along the mode of the lowest eigenvalue, what is stiff relaxed, over that of a state."""
    matrix = dynamical_matrix(landscape, minimum, DynamicalMatrixOptions(force=True))
    found = spectrum(matrix)
    own = np.flatnonzero(~found.is_translation)
    assert found.sign[own[0]] < 0
    shift, turn = matrix.coordinates.motion(found.vectors[:, own[0]])
    beside = [minimum.displaced(sign * size * shift, sign * size * turn) for sign in (1, -1)]
    stop = Stop(1e-6, evaluations=400)
    energies = [minimise(landscape, at, "newton", stop).evaluation.energy for at in beside]
    return np.array(energies) / landscape.evaluate(minimum).energy


# 124 and 288 end on a kink, too, one side of which rises in second order only.
@chosen_by_seed
@pytest.mark.parametrize("seed", [430, pytest.param(568, marks=pytest.mark.validate)])
def test_minimum_on_a_kink_is_proven_by_its_two_sides(seed, tmp_path):
    """The tips of two rods are level: a bond passes from one to the other."""
    out = tmp_path / "packing.h5"
    make(recipe_for(bidisperse(4.0), n=32, seed=seed, strict=True), out)
    stored, packing = read_attributes(out), read_packing(out)
    assert (stored["outcome"], stored["n_negative"], stored["n_kinked"]) == ("converged", 0, 1)
    assert max(stored["residual_force"], stored["residual_torque"]) <= stored["tolerance"]
    assert stored["strict_steps"] < 100
    landscape, state = Landscape(packing), State.of(packing)
    for size in (1e-5, 1e-4, 1e-3):
        assert (energies_beside(landscape, state, size) > 1 + 1e-5 * size).all()
    assert stored["lowest_eigenvalue"] > -stored["lowest_eigenvalue_bound"]


def test_a_saddle_is_no_kink():
    landscape, minimum = between_flat_sides()
    assert Proof.of(landscape, minimum.state).n_kinked == 0
    assert energies_beside(landscape, minimum.state, 1e-2).min() < 1


def test_a_kink_takes_the_eigenvalue_of_what_crosses_it_and_no_other():
    landscape, minimum = between_flat_sides()
    matrix = dynamical_matrix(landscape, minimum.state, DynamicalMatrixOptions(force=True))
    found = spectrum(matrix)
    falling, stiffest = found.vectors[:, [0]], found.vectors[:, [-1]]
    assert spectrum(held_at(matrix, falling)).eigenvalues[0] > 1e-8 * found.eigenvalues[0]
    beside = spectrum(held_at(matrix, stiffest))
    assert beside.eigenvalues[0] == pytest.approx(found.eigenvalues[0], rel=1e-6)
    assert (found.sign[0], beside.sign[0]) == (-1, -1)


def test_strict_search_goes_on_from_its_file(strict, tmp_path, monkeypatch):
    out, recipe = strict
    again, whole = tmp_path / "packing.h5", tmp_path / "whole.h5"
    first = stages_of(recipe, whole).index("strict")
    write_every_mark(monkeypatch)
    assert set(stages_of(recipe, again, first + 4)[first:]) == {"strict"}
    file = tmp_path / "packing.h5.making.h5"
    assert read_attributes(file)["stage"] == "strengthening"
    monkeypatch.undo()
    make(recipe, again)
    stored, expected = read_attributes(again), read_attributes(out)
    for name in ("strict_steps", "n_negative", "outcome", "phi_J", "u", "evaluations"):
        assert stored[name] == expected[name], name
    for one, other in zip(read_packing(again).poses(), read_packing(out).poses(), strict=True):
        np.testing.assert_array_equal(one, other)
    assert not file.exists()


@pytest.mark.parametrize(
    ("particles", "n"),
    [
        (Particles.of("spherocylinder", alpha=0.0), 16),
        (Particles.of("superellipsoid", p=1.0, w1=0.6, w2=1.0), 16),
    ],
    ids=["discs", "spheroids"],
)
def test_minima_where_nothing_slides_are_strict(particles, n, tmp_path):
    out = tmp_path / "packing.h5"
    make(recipe_for(particles, n=n, strict=True), out)
    stored = read_attributes(out)
    assert stored["outcome"] == "converged"
    assert stored["n_negative"] == 0
    assert stored["lowest_eigenvalue"] > stored["lowest_eigenvalue_bound"]


def test_strict_packing_needs_an_energy():
    with pytest.raises(ValueError, match="does not work with a strict minimum"):
        recipe_for(bidisperse(4.0), n=32, u0=0.0, strict=True)
