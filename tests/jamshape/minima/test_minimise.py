from functools import cache, partial

import numpy as np
import pytest
from mixtures import bidisperse
from pressed import PRESSED, pressed_named
from scenes import make, pressed
from squeezed import quickly_squeezed, squeezed_at_once
from superellipsoid_packings import ellipsoids, octahedra_and_boxes, superellipses

from jamshape import _contact
from jamshape.landscape import CrossingError, Landscape, State
from jamshape.landscape.local_energy_model import DescentEnd, LocalEnergyModel
from jamshape.minima import (
    METHODS,
    Outcome,
    Stop,
    minimise,
    residual_of,
    rounding_floor,
)
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles
from methods.lammps_cg import lammps_cg
from methods.lbfgs import lbfgs


def shaken(n, alpha, phi, seed=1):
    """A squeezed packing, away from its minimum but in its neighbourhood."""
    packing, state = quickly_squeezed(n, alpha, phi, seed)
    landscape = Landscape(packing)
    step = np.random.default_rng(0).normal(size=landscape.size)
    return landscape, landscape.displaced(state, 0.02 * step)


JAMMED = {
    "24 discs": (24, 0, 0.9),
    "48 discs": (48, 0, 0.95),
    "24 rods of alpha 1": (24, 1, 0.95),
    "32 rods of alpha 4": (32, 4, 0.98),
}


@pytest.mark.parametrize("dimension", [2, 3])
def test_after_a_stall_only_in_the_plane_newtons_method_alone_goes_on(dimension, monkeypatch):
    packing = pressed(n=16, dimension=dimension)
    landscape, state = Landscape(packing), State.of(packing)
    stalled = DescentEnd(Outcome.STALLED.value, landscape.evaluate(state), rows=[])
    monkeypatch.setattr(LocalEnergyModel, "descend", lambda *_: stalled)
    handovers = []
    monkeypatch.setattr(
        "jamshape.minima.newton.DescentStop", lambda **stop: handovers.append(stop["newton_below"])
    )
    found = minimise(landscape, state, "auto", Stop(kinks=False))
    assert found.outcome is Outcome.STALLED
    first, second = handovers
    assert first < 1
    assert second == (np.inf if dimension == 2 else first)


@pytest.mark.parametrize(("dimension", "least"), [(2, 1e-2), (3, 1e-4)])
def test_iterations_take_over_later_than_complete_factors(dimension, least, monkeypatch):
    round_ones = Particles.of("spherocylinder", alpha=0)
    landscape, start = squeezed_at_once(216, round_ones, dimension)
    products, descend = [], _contact.LocalEnergyModel.descend

    def counted(*of):
        end = descend(*of)
        products.append(end.products)
        return end

    monkeypatch.setattr(_contact.LocalEnergyModel, "descend", counted)
    for tolerance in (1.1 * least, 1e-8):
        assert minimise(landscape, start, "auto", Stop(tolerance)).outcome is Outcome.CONVERGED
    assert products[0] == 0
    assert products[1] > 0


@pytest.fixture(params=JAMMED)
def jammed(request):
    return shaken(*JAMMED[request.param])


def assert_is_a_minimum(landscape, found):
    """No direction goes down: not among the eigenvectors, nor among 20 random ones."""
    values = np.linalg.eigvalsh(landscape.curvature(found.state).hessian.toarray())
    assert values.min() > -1e-12 * values.max()
    assert (np.abs(values) < 1e-12 * values.max()).sum() >= landscape.particles.dimension
    rng, radius = np.random.default_rng(1), landscape.particles.radius.min()
    for size in np.repeat([1e-5, 1e-4], 10) * radius:
        near = landscape.displaced(found.state, size * rng.normal(size=landscape.size))
        assert landscape.evaluate(near).energy > found.evaluation.energy


def assert_sits_on_a_kink(landscape, found):
    """The forces turn round within a step far below what any smooth energy could do in."""
    gradient = landscape.evaluate(found.state).gradient
    scale = np.linalg.norm(gradient)
    beyond = landscape.displaced(found.state, -1e-10 * gradient / scale)
    assert np.linalg.norm(landscape.evaluate(beyond).gradient - gradient) > 0.5 * scale


@pytest.mark.parametrize("method", ["newton", "auto"])
def test_newton_and_auto_find_minima(jammed, method):
    landscape, start = jammed
    before = landscape.evaluate(start)
    assert residual_of(landscape, before).largest > 0.1
    found = minimise(landscape, start, method)
    if found.outcome is Outcome.STALLED:
        # Where rods overlap by less than the length over which the second bond fades in, some
        # minima of long rods are kinks (spherocylinder.hpp). Which minimum the squeezing leads to
        # is for the rounding of the machine to say.
        assert (landscape.particles.half_length > 2 * landscape.particles.radius).any()
        assert_sits_on_a_kink(landscape, found)
        return
    assert found.outcome is Outcome.CONVERGED
    assert found.residual.largest <= 1e-8
    assert found.evaluation.energy < before.energy
    assert found.energy_density > 1e-6  # it is jammed
    assert_is_a_minimum(landscape, found)
    # What it says of its state is so, for one who comes to it fresh.
    again = Landscape(landscape.particles).evaluate(found.state)
    assert again.energy == pytest.approx(found.evaluation.energy, rel=1e-12)
    assert residual_of(landscape, again).largest <= 1.1e-8
    np.testing.assert_array_equal(found.state.edges, start.edges)


def test_residual_is_that_of_single_particles(jammed):
    landscape, start = jammed
    evaluation = landscape.evaluate(start)
    components = landscape.components(evaluation.gradient)
    found = residual_of(landscape, evaluation)
    force = max(np.hypot(*row) for row in components[:, :2]) / evaluation.bond_force
    torque = np.abs(components[:, 2]).max() / evaluation.bond_force
    assert found == pytest.approx((force, torque), rel=1e-12)
    assert found.largest == max(found)


@pytest.mark.parametrize("method", [lbfgs, "cg_marschall"])
def test_first_order_methods_come_close_to_minima_of_discs(method):
    for name in ("24 discs", "48 discs"):
        landscape, start = shaken(*JAMMED[name])
        before = landscape.evaluate(start)
        found = minimise(landscape, start, method, Stop(evaluations=5000))
        assert found.evaluation.energy < 0.99 * before.energy
        assert found.residual.largest < 1e-5
        assert found.outcome in {Outcome.STALLED, Outcome.CONVERGED}  # doubles bring no more
        again = landscape.evaluate(found.state)
        assert again.energy == pytest.approx(found.evaluation.energy, rel=1e-12)


@pytest.mark.parametrize("method", ["newton", "auto", lbfgs, "cg_marschall"])
def test_no_method_raises_the_energy_of_rods(method):
    for name in ("24 rods of alpha 1", "32 rods of alpha 4"):
        landscape, start = shaken(*JAMMED[name])
        before = landscape.evaluate(start).energy
        found = minimise(landscape, start, method, Stop(evaluations=300))
        assert found.evaluation.energy < before


@pytest.mark.parametrize("name", ["24 discs", "48 discs"])
def test_methods_agree_where_they_begin_close_to_a_minimum_of_discs(name):
    landscape, start = shaken(*JAMMED[name])
    expected = minimise(landscape, start, "newton")
    # The same basin for all: a step off the minimum that is small against the overlaps.
    step = np.random.default_rng(2).normal(size=landscape.size)
    close = landscape.displaced(expected.state, 1e-3 * step)
    for method in ("newton", "auto", lbfgs, "cg_marschall"):
        found = minimise(landscape, close, method, Stop(evaluations=5000))
        assert found.energy_density == pytest.approx(expected.energy_density, rel=1e-9), method
        moved = (found.state.position - expected.state.position).astype(float)
        moved -= moved.mean(axis=0)
        held = ~landscape.rattlers(expected.state)
        assert np.abs(moved[held] - moved[held].mean(axis=0)).max() < 1e-5, method


IN_SPACE = ("rods in space", "spheres and rods in space", "ellipsoids", "octahedra and boxes")


def jammed_named(name):
    """Squeeze a packing by small strains until its minimum is well above jamming."""
    landscape = Landscape(pressed_named(name))
    found = minimise(landscape, State.of(landscape.particles), "newton")
    while found.outcome is not Outcome.CONVERGED or found.energy_density < 1e-4:
        found = minimise(landscape, found.state.strained(-0.01), "newton")
    return landscape, found


@pytest.mark.parametrize("name", ["superellipses", *IN_SPACE])
def test_methods_agree_where_they_begin_close_to_a_minimum_of_any_shape(name):
    landscape, expected = jammed_named(name)
    step = np.random.default_rng(2).normal(size=landscape.size)
    close = landscape.displaced(expected.state, 1e-3 * landscape.length * step)
    away = landscape.evaluate(close).energy / expected.state.volume
    assert away > 1.001 * expected.energy_density
    for method in ("newton", "auto", lbfgs):
        found = minimise(landscape, close, method, Stop(evaluations=5000))
        assert found.energy_density == pytest.approx(expected.energy_density, rel=1e-9), method
        assert found.residual.largest < 1e-5, method


@cache
def many_in_space():
    """More rods than are left to factors, and a gentle squeeze."""
    return pressed(n=160, dimension=3, phi=0.1)


OF_ANY_AGE = {name: partial(pressed_named, name) for name in PRESSED} | {"many": many_in_space}


@pytest.mark.parametrize("method", ["newton", "auto"])
@pytest.mark.parametrize("name", OF_ANY_AGE)
def test_a_minimum_is_the_same_to_the_bit_whatever_the_age_of_the_pairs(name, method):
    """A resumed run finds all pairs anew, at another state than an uninterrupted one."""
    packing = OF_ANY_AGE[name]()
    state, rng = State.of(packing), np.random.default_rng(7)
    stop = Stop(tolerance=1e-7, evaluations=150)
    expected = minimise(Landscape(packing), state, method, stop)
    for far in (0.003, 0.01):
        landscape = Landscape(packing)
        move = far * landscape.skin * rng.normal(size=landscape.size)
        pairs = landscape.pairs_at(landscape.displaced(state, move))
        assert landscape.pairs_at(state) is pairs
        found = minimise(landscape, state, method, stop)
        for part in ("position", "orientation", "edges"):
            np.testing.assert_array_equal(getattr(found.state, part), getattr(expected.state, part))
        assert found.evaluation.energy == expected.evaluation.energy
        assert found.history.residual == expected.history.residual


@pytest.mark.lammps
def test_lammps_agrees_with_newton_and_lowers_the_energy():
    landscape, start = shaken(*JAMMED["24 discs"])
    expected = minimise(landscape, start, "newton")
    found = minimise(landscape, start, lammps_cg, Stop(evaluations=5000))
    assert found.evaluation.energy < landscape.evaluate(start).energy
    assert found.energy_density == pytest.approx(expected.energy_density, rel=1e-9)
    assert found.residual.largest < 1e-5


@pytest.mark.lammps
@pytest.mark.parametrize("packing_of", [ellipsoids, octahedra_and_boxes, superellipses])
def test_lammps_minimises_superellipsoids(packing_of):
    """Particles have several exponents, which are types in LAMMPS; from a start beside a minimum."""
    landscape = Landscape(packing_of())
    start = State.of(landscape.particles)
    expected = minimise(landscape, start, "newton")
    step = np.random.default_rng(2).normal(size=landscape.size)
    close = landscape.displaced(expected.state, 1e-3 * landscape.length * step)
    found = minimise(landscape, close, lammps_cg, Stop(evaluations=3000))
    assert found.evaluation.energy < landscape.evaluate(close).energy
    assert found.energy_density == pytest.approx(expected.energy_density, rel=1e-9)
    assert found.residual.largest < 1e-4


@pytest.mark.parametrize("method", ["newton", "auto", lbfgs, "cg_marschall"])
@pytest.mark.parametrize("alpha", [0, 1])
def test_packings_below_jamming_are_called_unjammed(method, alpha):
    packing = random_packing(24, 0.5, 2, bidisperse(alpha))
    landscape, start = Landscape(packing), State.of(packing).strained(-0.02)
    assert landscape.evaluate(start).energy > 1e-4  # it overlaps to begin with
    found = minimise(landscape, start, method, Stop(lowest=1e-20, evaluations=20_000))
    assert found.outcome is Outcome.UNJAMMED
    assert found.energy_density <= 1e-20


@pytest.mark.parametrize("method", [*METHODS, lbfgs])
def test_without_contacts_nothing_is_done(method):
    packing = random_packing(10, 0.2, 1)
    landscape, start = Landscape(packing), State.of(packing)
    found = minimise(landscape, start, method)
    assert found.outcome is Outcome.UNJAMMED
    assert found.evaluation.energy == 0
    assert found.residual == (0, 0)
    assert len(found.history.residual) == landscape.evaluations == 1
    np.testing.assert_array_equal(found.state.position, start.position)


def test_unknown_method_is_refused_in_a_sentence():
    packing = random_packing(4, 0.2, 1)
    sentence = "the method is 'fire', expected one of auto, near, newton, cg_marschall"
    with pytest.raises(ValueError, match=f"^{sentence}$"):
        minimise(Landscape(packing), State.of(packing), "fire")


@pytest.mark.parametrize("method", [*METHODS, lbfgs, lammps_cg])
def test_crossing_spines_are_refused(method):
    crossing = make([[5, 5], [5.1, 5.1], [9, 9]], [0, np.pi / 2, 0])
    with pytest.raises(CrossingError, match=r"spines of particles [12] and [12] cross"):
        minimise(Landscape(crossing), State.of(crossing), method)


@pytest.mark.parametrize("method", ["newton", "auto", lbfgs, "cg_marschall"])
def test_so_many_evaluations_exhaust_it(method):
    landscape, start = shaken(*JAMMED["48 discs"])
    landscape.evaluate(start)  # those before do not count
    before = landscape.evaluations
    found = minimise(landscape, start, method, Stop(evaluations=6))
    assert found.outcome is Outcome.EXHAUSTED
    # A line search is brought to its end.
    assert 6 <= landscape.evaluations - before < (60 if method == "cg_marschall" else 20)
    assert found.residual.largest > 1e-8


@pytest.mark.parametrize("method", ["newton", "auto", lbfgs, "cg_marschall"])
def test_so_much_time_exhausts_it(method):
    landscape, start = shaken(*JAMMED["48 discs"])
    found = minimise(landscape, start, method, Stop(seconds=1e-9))
    assert found.outcome is Outcome.EXHAUSTED
    assert found.history.wall_seconds[-1] < 1


@pytest.mark.parametrize("method", ["newton", "auto", lbfgs, "cg_marschall"])
def test_history_is_complete_and_ascending(jammed, method):
    landscape, start = jammed
    found = minimise(landscape, start, method, Stop(evaluations=300))
    history = found.history
    columns = (history.wall_seconds, history.evaluations, history.residual, history.energy_density)
    assert len({len(column) for column in columns}) == 1
    assert len(history.residual) > 3
    assert np.all(np.diff(history.evaluations) >= 0)
    assert np.all(np.diff(history.wall_seconds) >= 0)
    assert history.evaluations[-1] <= landscape.evaluations
    assert history.residual[-1] == found.residual.largest
    assert history.energy_density[-1] == found.energy_density
    assert history.residual[0] == residual_of(landscape, landscape.evaluate(start)).largest


@pytest.mark.parametrize("method", ["newton", "auto", lbfgs, "cg_marschall"])
def test_history_goes_on_where_it_is_given(method):
    landscape, start = shaken(*JAMMED["24 discs"])
    first = minimise(landscape, start, method, Stop(evaluations=3))
    rows = len(first.history.residual)
    second = minimise(landscape, first.state, method, Stop(evaluations=300), first.history)
    assert second.history is first.history
    assert len(second.history.residual) > rows
    assert np.all(np.diff(second.history.evaluations) >= 0)
    assert np.all(np.diff(second.history.wall_seconds) >= 0)


@pytest.mark.parametrize("method", ["newton", "auto", lbfgs, "cg_marschall"])
def test_a_repetition_gives_the_same_bits(jammed, method):
    landscape, start = jammed
    one, other = (
        minimise(Landscape(landscape.particles), start, method, Stop(evaluations=400))
        for _ in range(2)
    )
    np.testing.assert_array_equal(one.state.position, other.state.position)
    np.testing.assert_array_equal(one.state.orientation, other.state.orientation)
    assert one.evaluation.energy == other.evaluation.energy
    assert one.history.residual == other.history.residual
    assert one.history.evaluations == other.history.evaluations


def test_rounding_floor_is_higher_in_doubles_and_for_smaller_overlaps():
    landscape, start = shaken(*JAMMED["24 discs"])
    evaluation = landscape.evaluate(start)
    extended, double = (rounding_floor(evaluation, landscape, extended=on) for on in (True, False))
    assert double > 1000 * extended
    softer = evaluation._replace(bond_force=evaluation.bond_force / 100)
    assert rounding_floor(softer, landscape) == pytest.approx(100 * extended)
