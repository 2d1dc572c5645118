"""Newton's equations at a point of a landscape: what their shift is, and that their solutions solve them."""

from functools import cache

import numpy as np
import pytest
from pressed import PRESSED, pressed_named
from scenes import pressed
from squeezed import quickly_squeezed

import jamshape as js
from jamshape import _contact
from jamshape.landscape import Landscape, State
from jamshape.landscape.local_energy_model import LocalEnergyModel
from jamshape.landscape.newton import least_shift
from jamshape.protocols.random_start import random_packing

# In space, so many particles or fewer are left to factors; more, to iterations.
MANY = "many rods in space"


@cache
def packing_named(name):
    return pressed(n=160, dimension=3, phi=0.1) if name == MANY else pressed_named(name)


def equations(packing, shift):
    """Newton's equations of a packing, the Hessian, and whether factors are of all of it."""
    landscape, state = Landscape(packing), State.of(packing)
    newton = LocalEnergyModel(landscape, state).newton(shift)
    newton.prepare()
    return newton, landscape.curvature(state)


def right_sides(n, k=2):
    return np.random.default_rng(4).normal(size=(k, n))


def remainders(newton, hessian, right, found):
    """Residuals of solutions over the right-hand sides."""
    left = right - (hessian @ found.T).T - newton.shift * found
    return np.linalg.norm(left, axis=1) / np.linalg.norm(right, axis=1)


@pytest.mark.parametrize("name", PRESSED)
def test_indefinite_hessians_become_positive_definite_by_no_more_than_tenfold(name):
    newton, curvature = equations(pressed_named(name), 1e-9)
    values = np.linalg.eigvalsh(curvature.hessian.toarray())
    least = values[0]
    assert least < -1e-3 * values[-1]
    assert -least < newton.shift < -10 * least
    right = right_sides(len(values))
    found = newton.solve(right, 1.0)
    assert (np.einsum("ki,ki->k", right, found) > 0).all()
    assert remainders(newton, curvature.hessian, right, found).max() < 1e-10


def test_solutions_are_as_good_as_asked_for_where_factors_would_fill():
    newton, curvature = equations(packing_named(MANY), 1e-9)
    right, spread = right_sides(len(curvature.coupling)), []
    for accuracy in (1e-1, 1e-4, 1e-10):
        found = newton.solve(right, accuracy)
        left = remainders(newton, curvature.hessian, right, found)
        assert (left <= accuracy * (1 + 1e-6)).all()
        assert (np.einsum("ki,ki->k", right, found) > 0).all()
        spread.append(left.max())
    assert spread[0] > 1e-6  # it does no more than it is asked for


def test_near_isostaticity_factors_take_over_from_iterations():
    spheres = js.Superellipsoids(p=1, w1=1, w2=1)
    packing = js.make_packing(spheres, n=160, seed=1, u0=1e-10, progress=False)
    newton, curvature = equations(packing, 1e-9)
    right = curvature.coupling[None]
    found = newton.solve(right, 1e-3)
    # Iterations would stop at the accuracy asked for.
    assert remainders(newton, curvature.hessian, right, found).max() < 1e-8


@cache
def made_in_space(w1, n):
    shape = js.Superellipsoids(p=1, w1=w1, w2=1)
    return js.make_packing(shape, n=n, seed=1, u0=1e-5, progress=False)


@pytest.mark.parametrize("instructions", _contact.instruction_sets())
@pytest.mark.parametrize(
    ("w1", "n"), [pytest.param(1, 600, id="spheres"), pytest.param(0.6, 170, id="spheroids")]
)
def test_complete_factors_in_space_solve_the_equations(w1, n, instructions, monkeypatch):
    """Their supernodes have many widths and heights, up to the widest."""
    monkeypatch.setenv("JAMSHAPE_SIMD", instructions)
    newton, curvature = equations(made_in_space(w1, n), 1e-3)
    right = right_sides(len(curvature.coupling))
    found = newton.solve(right, 1e-300)  # which iterations do not reach
    assert remainders(newton, curvature.hessian, right, found).max() < 1e-11


def test_near_solutions_are_those_of_the_last_factors_in_single_precision():
    packing = made_in_space(1, 120)  # few enough for complete factors
    landscape, state = Landscape(packing), State.of(packing)
    model = LocalEnergyModel(landscape, state)
    still, right = np.zeros(landscape.size), right_sides(landscape.size)
    for stiff in (1.0, 0.1):  # the memory of factors that nothing holds is used again
        factors = model.factorise(still, 0.0, np.full(landscape.size, stiff)).compiled
        exact, near = factors.solve(right), factors.solve(right, nearly=True)
        error = np.linalg.norm(near - exact) / np.linalg.norm(exact)
        assert 1e-10 < error < 1e-5
        del factors


@pytest.mark.parametrize("name", [*PRESSED, MANY])
def test_coupling_is_that_of_the_landscape(name):
    newton, curvature = equations(packing_named(name), 1e-9)
    scale = np.abs(curvature.coupling).max()
    assert newton.coupling == pytest.approx(curvature.coupling, rel=0, abs=1e-12 * scale)


@pytest.mark.parametrize("dimension", [2, 3])
def test_particles_without_contacts_are_shifted_by_the_least(dimension):
    packing = random_packing(5, 0.05, 1, dimension=dimension)
    newton, curvature = equations(packing, 1e-300)
    assert curvature.hessian.count_nonzero() == 0
    assert newton.shift == _contact.LEAST_SHIFT
    right = right_sides(len(curvature.coupling))
    assert newton.solve(right, 1e-8) == pytest.approx(right / newton.shift)


def test_hessians_of_minima_keep_their_shift():
    packing, state = quickly_squeezed(24, 0, 0.9)
    landscape = Landscape(packing)
    values = np.linalg.eigvalsh(landscape.curvature(state).hessian.toarray())
    shift = 1e-6
    assert values[0] > -0.5 * shift
    newton = LocalEnergyModel(landscape, state).newton(shift)
    newton.prepare()
    assert newton.shift == shift


def test_shift_falls_after_good_steps_and_rises_after_bad_ones():
    newton, _ = equations(pressed_named("discs"), 1e-3)
    first = newton.shift
    newton.learn(1.0, has_closed=False)
    lower = newton.shift
    assert lower < first
    newton.learn(0.3, has_closed=False)
    assert newton.shift == lower
    newton.learn(1e-3, has_closed=False)
    assert newton.shift > first


def test_steps_that_a_closing_contact_stops_raise_no_shift_of_complete_factors():
    newton, _ = equations(pressed_named("discs"), 1e-3)
    good, _ = equations(pressed_named("discs"), 1e-3)
    newton.learn(1e-3, has_closed=True)
    good.learn(1.0, has_closed=False)
    assert newton.shift == good.shift


def test_steps_that_a_closing_contact_stops_raise_the_shift_of_iterations():
    newton, _ = equations(packing_named(MANY), 1e-3)
    other, _ = equations(packing_named(MANY), 1e-3)
    newton.learn(1e-3, has_closed=True)
    other.learn(1e-3, has_closed=False)
    assert newton.shift == other.shift > 1e-3


def test_first_shift_falls_with_the_forces():
    packing = pressed_named("discs")
    landscape = Landscape(packing)
    here = landscape.evaluate(State.of(packing))
    shifts = [
        least_shift(landscape, here._replace(gradient=f * here.gradient)) for f in (1, 1e-9, 0)
    ]
    assert shifts[0] > shifts[1] > shifts[2] > 0
    forces = 1e-9 * np.abs(here.gradient).max()
    assert shifts[1] == pytest.approx(forces / landscape.length)


def test_equations_are_refused_before_they_are_prepared_and_of_another_size():
    packing = pressed_named("discs")
    landscape = Landscape(packing)
    newton = LocalEnergyModel(landscape, State.of(packing)).newton(1e-3)
    right = np.ones((1, landscape.size))
    with pytest.raises(ValueError, match="not prepared, expected prepare before"):
        newton.solve(right, 1e-3)
    with pytest.raises(ValueError, match="not prepared, expected prepare before"):
        _ = newton.coupling
    newton.prepare()
    with pytest.raises(ValueError, match="right does not have"):
        newton.solve(right[:, 1:], 1e-3)
    right[0, 2] = np.nan
    with pytest.raises(ValueError, match="number 2 of right is"):
        newton.solve(right, 1e-3)
    for shift in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="the shift is not a positive number"):
            LocalEnergyModel(landscape, State.of(packing)).newton(shift)
