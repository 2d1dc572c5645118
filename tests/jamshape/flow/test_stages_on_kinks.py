"""Implicit steps of contacts that stay on a kink of the energy, where a mixture of both slopes balances the drag."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jamshape as js
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.flow.implicit import Flow, ImplicitFlow, Protocol, drag_coefficients
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape, State
from jamshape.landscape.local_energy_model import LocalEnergyModel, Stage, Units

EDGE, ALONG, APART, TIME, KAPPA = 60.0, 0.5, 0.99, 16.0, 1e-13


def side_by_side(half_lengths=(1.0, 1.6)):
    """Two parallel rods, the second displaced along the first, with one bond."""
    packing = js.Packing(
        position=[[30.0, 30.0 + APART], [30.0 + ALONG, 30.0]],
        orientation=[0.0, 0.0],
        diameters=[[2 * A + 1, 1.0, 1.0] for A in half_lengths],
        species=[1, 2], id=[1, 2], box=js.Box(lo=[0, 0], edges=[EDGE, EDGE]),
    )  # fmt: skip
    return packing.with_(law=packing.law.but(sides=1))


def drags(landscape):
    bodies = landscape.bodies
    return bodies.measure, bodies.measure * bodies.moment[:, 2]


def held_parallel(landscape, time):
    """Distances along and across, and angle, of rods that stay parallel: they touch where both turn equally."""
    moved, turned = drags(landscape)

    def rates(_, values):
        along, across, _ = values
        force = 1 - across
        turn = force * along / turned.sum()
        return [-turn * across, force * (1 / moved).sum() + turn * along, turn]

    begun = [ALONG, APART, 0.0]
    return solve_ivp(rates, (0, time), begun, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]


def begun(packing):
    """A flow with the velocity of the mixture; its box does not move."""
    landscape, flow = Landscape(packing), Flow(State.of(packing))
    moved, turned = drags(landscape)
    force = 1 - APART
    turn = force * ALONG / turned.sum() * landscape.rotation_length
    velocity = np.column_stack([[0, 0], force / moved * [1, -1], turn])
    flow.velocity = landscape.coordinates(velocity)
    flow.acceleration = np.zeros_like(flow.velocity)
    return ImplicitFlow(landscape, flow, Protocol(KAPPA, 0.9, tolerance=1e-5)), flow


def flown(packing, n_steps, time=TIME):
    """Implicit steps of one size: the result as `held_parallel` gives it, the tilt, and the weights on kinks."""
    run, flow = begun(packing)
    for _ in range(n_steps):
        _step(run, time / n_steps)
    position, angle = (np.asarray(x, float) for x in (flow.state.position, flow.state.orientation))
    apart, middle = position[1] - position[0], float(angle.ravel()[0])
    along = np.array([np.cos(middle), np.sin(middle)])
    across = np.array([along[1], -along[0]])
    return (
        np.array([apart @ along, apart @ across, middle]),
        np.ptp(angle),
        flow._kinks.weights,
    )


def _step(run, dt):
    """An implicit step of this size, whatever its error."""
    run.local_model.hold()
    run.orientation = run.flow.state.orientation.astype(float)
    run.host, _ = run.protocol.leg(run.flow, run.phi)
    attempt = run._tried(dt, False, run._present())
    assert attempt is not None
    run._accept(attempt, dt)


def test_parallel_rods_stay_parallel_and_turn_together_to_second_order(measured):
    packing = side_by_side()
    expected = held_parallel(Landscape(packing), TIME)
    assert expected[2] > 1e-3
    errors = []
    for n_steps in (8, 16, 32, 64):
        found, tilt, weights = flown(packing, n_steps)
        errors.append(np.abs(found - expected).max())
        assert tilt < 1e-8
        assert len(weights) == 1
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    measured(coarsest=errors[0], finest=errors[-1], order=orders[-1])
    assert (orders > 1.8).all()


def test_the_weight_on_a_kink_is_that_of_the_point_where_both_rods_turn_equally():
    packing = side_by_side()
    _, turned = drags(Landscape(packing))
    _, _, (weight,) = flown(packing, 64, 1.0)
    # The other rod faces all of the first one but its end.
    contact = ALONG * turned[0] / turned.sum()
    part = (contact + 1.0) / 2.0
    assert min(abs(weight - part), abs(1 - weight - part)) < 0.02


def stage_of(packing, h):
    landscape = Landscape(packing)
    state = State.of(packing)
    found = landscape.evaluate(state)
    overlap = found.bond_force
    units = Units(overlap, found.n_bonds * overlap**2, np.sqrt(overlap), packing.n)
    model = LocalEnergyModel(landscape, state)
    return model, drag_coefficients(landscape) / h, units


@pytest.mark.parametrize("h", [3.0, 10.0])
def test_a_stage_ends_where_a_mixture_of_both_slopes_balances_the_drag(h):
    packing = side_by_side()
    tilted = packing.with_(orientation=[1e-4, 0.0])
    model, drag, units = stage_of(tilted, h)
    start = np.zeros(len(drag))
    end = model.solve(Stage(drag, start, (start, start)), None, units, 1e-9)
    assert end.solved
    (weight,) = end.kinks.weights
    assert 0 < weight < 1
    step = np.zeros(len(drag))
    step[2] = 1e-7
    sides = [model.evaluate(end.x + sign * step, 0.0, extended=False).gradient for sign in (-1, 1)]
    jump = sides[1] - sides[0]
    assert np.abs(jump).max() > 0.1 * units.force
    part = -(sides[0] + drag * end.x) @ jump / (jump @ jump)
    assert min(abs(part - weight), abs(1 - part - weight)) < 1e-4
    rest = sides[0] + part * jump + drag * end.x
    assert np.abs(rest).max() < 1e-5 * units.force


def test_a_kink_that_the_drag_leads_off_is_released():
    """Rods that face each other at their ends only turn apart: no mixture holds them."""
    far = side_by_side().with_(position=[[30.0, 30.0 + APART], [32.2, 30.0]])
    model, drag, units = stage_of(far, 1.0)
    start = np.zeros(len(drag))
    end = model.solve(Stage(drag, start, (start, start)), None, units, 1e-9)
    assert end.solved
    assert not len(end.kinks)
    gradient = model.evaluate(end.x, 0.0, extended=False).gradient + drag * end.x
    assert np.abs(gradient).max() < 1e-6 * units.force


def test_a_particle_that_hits_another_while_others_are_on_a_kink_stops_there_at_once():
    """The drag, a thousandth as stiff as a bond, draws a free rod 0.08 up to another one and 0.02 into it."""
    pair = side_by_side()
    position = np.vstack([np.asarray(pair.position, float), [[10.0, 10.0], [10.0, 11.48]]])
    packing = js.Packing(
        position=position, orientation=[1e-4, 0.0, 0.0, np.pi / 2],
        diameters=[[3.0, 1.0, 1.0], [4.2, 1.0, 1.0], [2.0, 1.0, 1.0], [1.8, 1.0, 1.0]],
        species=[1, 2, 3, 4], id=[1, 2, 3, 4], box=pair.box,
    )  # fmt: skip
    packing = packing.with_(law=packing.law.but(sides=1))
    model, drag, units = stage_of(packing, 1000.0)
    still = np.zeros(len(drag))
    held = model.solve(Stage(drag, still, (still, still)), None, units, 1e-9)
    assert held.solved
    assert len(held.kinks) == 1
    centre = held.x.copy()
    centre[Landscape(packing).column[2, 1]] += 0.1
    end = model.solve(Stage(drag, centre, (held.x, still)), held.kinks, units, 1e-9)
    assert end.solved
    assert end.directions <= 5
    assert len(end.kinks) == 1


@pytest.mark.lammps
@pytest.mark.parametrize("sides", [1, 2])
def test_both_integrators_compress_nearly_round_rods_alike(sides, tmp_path, measured):
    """The pressure of a jammed packing, from the same start; where it flows, paths part like samples."""
    common = {"kappa": 1e-5, "progress": False}
    before = js.slow_compress(
        js.Spherocylinders(alpha=0.01), n=24, phi=(0.8, 0.86), file=tmp_path / "a.h5", **common
    )
    start = list(before)[-1]
    start = start.with_(law=start.law.but(sides=sides))
    slow = js.slow_compress(start=start, phi=(None, 0.87), sides=sides, integration_tolerance=1e-4,
                            file=tmp_path / "b.h5", **common)  # fmt: skip
    phi, pressure = heun(start, Compression(kappa=1e-5, phi_end=0.87, sides=sides, dt=0.02), 20)
    far = np.abs(np.interp(phi, slow.phi, slow["pressure"]) / pressure - 1)
    measured(median=np.median(far), largest=far.max())
    assert np.median(far) < 1e-3


def heun(start, settings, rows):
    """Packing fractions and pressures of explicit steps of one size."""
    with Session() as session:
        run = CompressionRun(session, settings, start)
        found = []
        for row in range(rows):
            run.advance((row + 1) * run.last_step // rows)
            found.append(run.measure())
    return np.array([[row[name] for row in found] for name in ("phi", "pressure")])
