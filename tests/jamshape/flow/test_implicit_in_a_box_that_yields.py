"""Implicit steps in a box that yields to a stress: closed forms, order, LAMMPS, balance of power, and the limits of its time."""

from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from thinned import in_turn

import jamshape as js
from jamshape.flow import implicit
from jamshape.flow.box_control import BoxControl, YieldingBox
from jamshape.flow.host import Host
from jamshape.flow.implicit import METHODS, Flow, ImplicitFlow, Leg, follow
from jamshape.flow.slow_shear import SlowShear
from jamshape.landscape import CrossingError, Landscape, State
from jamshape.landscape.local_energy_model import LocalEnergyModel
from jamshape.minima.boxes import Yielding, strains_of
from jamshape.protocols.quasistatic import compressed_to
from jamshape.protocols.random_start import random_packing

SHAPES = {
    "discs": (js.Spherocylinders(alpha=0), 0.9, 2),
    "rods": (js.Spherocylinders(alpha=2), 0.92, 2),
    "ellipses": (js.Superellipsoids(w1=0.7), 0.92, 2),
    "spheroids": (js.Superellipsoids(w1=0.6), 0.75, 3),
    "rods in space": (js.Spherocylinders(alpha=1), 0.75, 3),
}


@cache
def dense(name, n=16, seed=1):
    particles, phi, dimension = SHAPES[name]
    start = random_packing(n, 0.3 if dimension == 2 else 0.1, seed, particles, dimension)
    return compressed_to(Landscape(start), State.of(start), phi, 1e-2).packing(start)


def bonds_of(packing):
    """Pairs of contacts, and which bonds end on a side."""
    found = js.energy(packing).contacts
    pairs = found.network.pairs[found.bonds.contact]
    return sorted(zip(pairs.tolist(), found.bonds.on_side.tolist(), strict=True))


def flowed(start, course, **fields):
    landscape, flow = Landscape(start), Flow(State.of(start), **fields)
    steps = list(follow(landscape, flow, course))
    return landscape, flow, steps


@dataclass(frozen=True)
class Relaxing:
    """A host at rest in a box that yields, for a time."""

    control: BoxControl
    time: float
    tolerance: float = 1e-3
    method: str = "tr-bdf2"
    k_d: ClassVar[float] = 1.0
    largest_strain: ClassVar[float] = 1e-3
    largest_drop: ClassVar[float] = np.inf

    def leg(self, flow, phi):
        del phi
        return Leg(Host(np.zeros((flow.state.dimension,) * 2)), self.time - flow.time)

    def is_over(self, flow, phi):
        del phi
        return flow.time >= self.time * (1 - 1e-12)

    def measured(self, landscape, flow):
        del landscape, flow
        return {}

    def where(self, phi):
        return f"at phi = {phi:g}"


# --- a crystal -----------------------------------------------------------------------------------


def crystal(spacing, columns=4, rows=4):
    """Discs of diameter 1 on a hexagonal lattice, which no force moves as the box shrinks."""
    k, row = np.divmod(np.arange(columns * rows), rows)
    position = spacing * np.column_stack([k + 0.5 * (row % 2) + 0.25, (row + 0.5) * np.sqrt(0.75)])
    edges = spacing * np.array([columns, rows * np.sqrt(0.75)])
    return js.Packing.of("spherocylinder", position, np.zeros(len(k)), box=edges, diameters=np.ones((len(k), 3)))  # fmt: skip


def spacing_after(time, start, p, t_box):
    """dl/dt = l (3 l (1 - l) / 2 - p l^2 sqrt(3) / 2) / t_box, from three bonds of force 1 - l a disc."""
    rate = lambda _, l: l * (1.5 * l * (1 - l) - p * l * l * np.sqrt(0.75)) / t_box
    return solve_ivp(rate, (0, time), [start], rtol=1e-12, atol=1e-14).y[0, -1]


@pytest.mark.parametrize("method", METHODS)
def test_a_crystal_relaxes_as_in_closed_form_to_second_order(method, fixed_steps, measured):
    p, t_box, time = 0.1, 20.0, 24.0
    exact, errors = spacing_after(time, 0.96, p, t_box), []
    for n in (40, 80, 160):
        course = Relaxing(BoxControl(p, t_box, "isotropic"), time, 1e-6, method)
        flow = fixed_steps(crystal(0.96), course, time / n)
        errors.append(abs(float(flow.state.edges[0]) / 4 - exact))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    measured(order=orders[-1], error=errors[-1])
    assert orders == pytest.approx([2.0, 2.0], abs=0.1)
    assert errors[-1] < 2e-6


@pytest.mark.parametrize("t_box", [1e-9, 1.0, 1e12])
def test_a_crystal_comes_to_rest_however_long_the_time_of_its_box(t_box):
    p = 0.05
    course = Relaxing(BoxControl(p, t_box, "isotropic"), max(1e6, 40 * t_box))
    _, flow, steps = flowed(crystal(0.985), course)
    assert float(flow.state.edges[0]) / 4 == pytest.approx(1 / (1 + p / np.sqrt(3)), rel=1e-8)
    assert steps[-1].pressure == pytest.approx(p, rel=1e-5)
    assert len(steps) < 100


# --- packings ------------------------------------------------------------------------------------


@pytest.fixture
def fixed_steps(monkeypatch):
    """Flow by equal implicit steps, whatever their error."""
    monkeypatch.setattr(implicit, "_EXPLICIT_BELOW", 0.0)
    monkeypatch.setattr(ImplicitFlow, "_is_good", lambda *_: True)
    monkeypatch.setattr(ImplicitFlow, "_plan", lambda *_: None)

    def run(start, course, dt):
        _, flow, steps = flowed(start, course, dt=dt)
        assert {round(step.dt / dt, 9) for step in steps} == {1.0}
        return flow

    return run


@cache
def sheared_in_lammps(name, gdot, strain):
    """Start and run in which no contact opens, closes or passes from a side to a tip."""
    held = {"pressure": 1e-2, "t_box": 20.0}
    n = 8 if name == "rods in space" else 16  # of more than those contacts soon change
    for seed in range(1, 9):
        start = dense(name, n, seed)
        exact = js.shear(start=start, gdot=gdot, strain=strain, integrator="rkc2", integration_tolerance=1e-11, rows=4,
                         progress=False, **held)  # fmt: skip
        if bonds_of(start) == bonds_of(exact.packing(-1)):
            break
    return start, exact


@pytest.mark.lammps
@pytest.mark.parametrize(("name", "method"), in_turn(list(SHAPES), list(METHODS)))
def test_with_lasting_contacts_it_is_the_motion_of_lammps_to_second_order(
    name, method, fixed_steps, measured
):
    gdot, strain = 1e-4, 4e-4
    start, exact = sheared_in_lammps(name, gdot, strain)
    assert bonds_of(start) == bonds_of(exact.packing(-1))
    assert abs(exact["p_yy"][-1] / exact["p_yy"][0] - 1) > 1e-3
    errors = []
    for n in (16, 32, 64):  # in fewer, steps are shortened where the box yields fast
        course = SlowShear(gdot, strain, tolerance=1e-5, largest_strain=1.0, method=method,
                           hold_pressure=1e-2, t_box=20.0)  # fmt: skip
        flow = fixed_steps(start, course, strain / gdot / n)
        more = course.measured(Landscape(start), flow)
        errors.append(max(abs(more[name] / exact[name][-1] - 1) for name in ("p_yy", "p_xy")))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    measured(order=orders[-1], error=errors[-1])
    assert errors[-1] < 1e-5
    assert (orders > 1.8).all()
    phi = start.measures.sum() / flow.state.volume
    assert phi == pytest.approx(exact["phi"][-1], rel=1e-7)
    assert abs(phi / start.phi - 1) > 1e-5


@pytest.mark.lammps
@pytest.mark.parametrize("name", ["discs", "rods", "spheroids"])
def test_contacts_that_open_and_close_are_followed_within_the_tolerance(name, tmp_path, measured):
    start = dense(name)
    asked = {"start": start, "gdot": 1e-4, "strain": 1e-2, "pressure": 5e-3, "t_box": 20.0, "rows": 10,
             "progress": False}  # fmt: skip
    exact, found = (
        js.shear(file=tmp_path / f"{name}{k}.h5", integrator=integrator, integration_tolerance=error, **asked)
        for k, (integrator, error) in enumerate([("rkc2", 1e-8), ("tr-bdf2", 1e-4)])
    )  # fmt: skip
    off = {key: found[key][-1] / exact[key][-1] - 1 for key in ("phi", "p_yy", "pressure")}
    measured(**{f"off_{key}": abs(value) for key, value in off.items()})
    assert abs(off["phi"]) < 1e-5
    assert abs(off["p_yy"]) < 5e-4
    assert found.about["hold_pressure"] == 5e-3
    assert found.about["t_box"] == 20.0


@pytest.mark.parametrize("name", ["rods", "spheroids"])
def test_power_balances(name, measured):
    # dU/dt = -V P:G - sum tau.w_host - sum F^2/(k_d V) - sum tau_b^2/(k_d V I_b), G_yy = (P_yy - p) V / (t_box k_e N).
    start, gdot, p, t_box = dense(name, 12), 1e-3, 1e-2, 30.0
    landscape, flow = Landscape(start), Flow(State.of(start))
    course = SlowShear(gdot, 0.02, tolerance=1e-4, largest_strain=2e-4, hold_pressure=p, t_box=t_box)  # fmt: skip
    rows, drag = [], implicit.drag_coefficients(landscape)
    for step in follow(landscape, flow, course):
        found, tensor, volume = landscape.evaluate(flow.state), landscape.stress(flow.state), flow.state.volume  # fmt: skip
        gradient = np.zeros_like(tensor)
        gradient[0, 1], gradient[1, 1] = gdot, (tensor[1, 1] - p) * volume / (t_box * start.n)
        turning = -landscape.components(found.gradient)[:, start.dimension :] * landscape.rotation_length[:, None]  # fmt: skip
        spin = Host(gradient).spin(landscape.bodies, flow.state.orientation.astype(float))
        lost = lost_by_drag(landscape, flow.state, found.gradient, drag)
        power = -volume * (tensor * gradient).sum() - (turning * spin).sum() - lost
        box = -volume * tensor[1, 1] * gradient[1, 1]
        rows.append((step.time, found.energy, power, box))
    time, energy, power, box = np.array(rows).T
    measured(of_the_box=np.trapezoid(np.abs(box), time) / np.ptp(energy))
    assert np.ptp(energy) > 0.1 * energy[0]
    assert np.trapezoid(np.abs(box), time) > 0.1 * np.ptp(energy)
    assert np.trapezoid(power, time) == pytest.approx(energy[-1] - energy[0], rel=1e-3)


def lost_by_drag(landscape, state, gradient, drag):
    """Power that the drag takes; in space torques count about body axes."""
    components = landscape.components(gradient)
    if state.dimension == 3:
        axes = js.packing.body_axes(state.orientation.astype(float))
        components[:, 3:] = np.einsum("nbk,nk->nb", axes, components[:, 3:])
    return float((landscape.coordinates(components) ** 2 / drag).sum())


@pytest.mark.parametrize(("name", "box"), [("rods", "yy"), ("discs", "isotropic"), ("spheroids", "yy")])  # fmt: skip
def test_huge_steps_land_on_the_minimum_of_the_enthalpy(name, box):
    start, p = dense(name), 2e-2
    goal = Yielding("isotropic" if box == "isotropic" else box, p)
    rest = goal.find(Landscape(start), State.of(start)).state.packing(start)
    course = Relaxing(BoxControl(p * (1 + 1e-6), 10.0, box), 1e9, 1e-5)
    landscape, flow, steps = flowed(rest, course, dt=1e9)
    exact = Yielding(goal.box, p * (1 + 1e-6)).find(Landscape(start), flow.state)
    assert len(steps) <= 12
    assert steps[-1].dt > 1e7 * course.control.t_box
    yielded = flow.state.volume / rest.box.volume - 1
    assert abs(yielded) > 1e-8
    assert yielded == pytest.approx(exact.state.volume / rest.box.volume - 1, rel=0.03)
    assert steps[-1].u == pytest.approx(exact.energy_density, rel=1e-7)
    axes = YieldingBox(course.control, landscape, course.k_d).axes
    stress = np.diagonal(landscape.stress(flow.state))
    assert (axes * stress).sum() == pytest.approx(axes.sum() * course.control.pressure, rel=3e-8)


@pytest.mark.parametrize("name", SHAPES)
def test_strain_derivatives_are_those_along_the_axes(name):
    start = dense(name)
    landscape, state = Landscape(start), State.of(start)
    model = LocalEnergyModel(landscape, state)
    still = np.zeros(landscape.size)
    for box in ("isotropic", "yy", "xx yy"):
        strain = strains_of(box, start.dimension)[:1]
        model.strain_along(np.diagonal(strain[0]).copy())
        found = model.evaluate(still, 0.0, extended=True)
        model.factorise(still, 0.0, np.full(landscape.size, 1e3))
        coupling, curvature = model.strain_derivatives
        by_box, own = landscape.strained(state, strain)
        scale = np.abs(by_box).max()
        np.testing.assert_allclose(coupling, by_box[0], atol=1e-11 * scale)
        assert curvature == pytest.approx(own[0, 0], rel=1e-11)
        np.testing.assert_allclose(found.virial.T / state.volume, landscape.stress(state), rtol=1e-12, atol=1e-15)  # fmt: skip
        assert np.trace(found.virial) == pytest.approx(-found.strain_gradient, rel=1e-14)


@pytest.mark.parametrize("name", ["rods", "spheroids"])
def test_going_on_from_between_two_steps_gives_the_same_to_the_bit(name):
    start = dense(name)
    course = SlowShear(1e-4, 0.02, tolerance=1e-2, hold_pressure=1e-2, t_box=20.0)
    landscape, flow = Landscape(start), Flow(State.of(start))
    for step in follow(landscape, flow, course):
        if step.step == 10:
            flow.forget()
            fresh = Flow(**{k: v for k, v in vars(flow).items() if not k.startswith("_")})
    assert step.step > 15
    list(follow(Landscape(start), fresh, course))
    for part in ("position", "orientation", "cell"):
        np.testing.assert_array_equal(getattr(fresh.state, part), getattr(flow.state, part))
    np.testing.assert_array_equal(fresh.velocity, flow.velocity)
    assert fresh.evaluations == flow.evaluations


# --- limits --------------------------------------------------------------------------------------


def test_the_number_of_steps_hardly_depends_on_the_time_of_the_box(measured):
    start = dense("rods")
    counts = {}
    for t_box in (1e-9, 1e-3, 1.0, 1e1, 1e3):
        course = SlowShear(1e-6, 2e-3, hold_pressure=1e-2, t_box=t_box)
        counts[t_box] = len(flowed(start, course)[2])
    measured(**{f"steps_{t_box:g}": n for t_box, n in counts.items()})
    assert max(counts.values()) < 4 * min(counts.values()) < 200


@pytest.mark.parametrize("name", ["discs", "rods", "spheroids"])
def test_a_small_pressure_is_held(name):
    start, p = dense(name), 1e-8
    rest = Yielding("yy", p).find(Landscape(start), State.of(start)).state.packing(start)
    course = SlowShear(1e-10, 0.1 * p, hold_pressure=p, t_box=10.0)
    landscape, flow, _ = flowed(rest, course)
    assert course.measured(landscape, flow)["p_yy"] == pytest.approx(p, rel=1e-2)
    assert flow.strain == pytest.approx(0.1 * p, rel=1e-12)


@pytest.mark.parametrize(("name", "p"), [("discs", 0.1), ("rods", 0.1), ("spheroids", 0.02)])
def test_a_large_pressure_is_reached_and_held(name, p):
    course = SlowShear(1e-6, 2e-3, hold_pressure=p, t_box=1.0)
    landscape, flow, _ = flowed(dense(name), course)
    assert course.measured(landscape, flow)["p_yy"] == pytest.approx(p, rel=1e-3)


def test_a_pressure_that_contacts_do_not_bear_ends_in_a_sentence():
    start = dense("discs")  # squeezed, since the box shrinks by no more than a small part in a step
    start = State.of(start).strained(-0.4).packing(start)
    sentence = r"packing fraction of 4\.?\d*, expected at most 4: contacts do not bear pressure=30"
    with pytest.raises(ValueError, match=sentence):
        flowed(start, SlowShear(1e-3, 5.0, tolerance=1e-1, largest_strain=0.1, hold_pressure=30.0, t_box=1.0))  # fmt: skip


def test_a_pressure_that_crosses_particles_ends_in_a_sentence():
    sentence = r"the spines of particles \d+ and \d+ cross at phi = .* and the pressure 1, .* use a smaller pressure"
    with pytest.raises(CrossingError, match=sentence):
        flowed(
            dense("rods", seed=2),
            SlowShear(1e-3, 5.0, tolerance=1e-1, hold_pressure=1.0, t_box=1.0),
        )


def test_slow_rates_take_implicit_steps_at_a_pressure_by_themselves(tmp_path):
    start = dense("discs")
    run = js.shear(start=start, gdot=1e-7, strain=1e-3, pressure=1e-2, t_box=1e3, rows=150, file=tmp_path / "a.h5", progress=False)  # fmt: skip
    assert run.about["method"] == "tr-bdf2"
    steady = run.steady(0.0)
    assert steady["p_yy"].value == pytest.approx(run["p_yy"].mean(), rel=0.2)
    assert np.isfinite(steady["friction"].value)
    assert run["phi"].std() > 0
    frame = run.packing(-1)
    assert run["phi"][-1] == pytest.approx(frame.phi, rel=1e-12)
    assert run["p_yy"][-1] == pytest.approx(js.energy(frame).pressure_tensor[1, 1], rel=1e-6)


def test_both_kinds_of_steps_yield_by_default_in_the_same_time(tmp_path):
    how = {"start": dense("rods"), "gdot": 1e-3, "strain": 1e-3, "pressure": 1e-2, "rows": 2, "progress": False}  # fmt: skip
    a, b = (
        js.shear(integrator=name, file=tmp_path / f"{name}.h5", **how).about
        for name in ("tr-bdf2", "rkc2")
    )
    for name in ("box_time", "relaxation_time"):
        assert a[name] == pytest.approx(b[name], rel=1e-6)


@pytest.mark.parametrize(
    ("numbers", "sentence"),
    [
        ({"t_box": 1.0}, "t_box 1.0 without a pressure, expected both or no time"),
        ({"hold_pressure": 0.0, "t_box": 1.0}, "hold_pressure is 0.0, expected a positive number"),
        ({"hold_pressure": 1e-3, "t_box": -1.0}, "t_box is -1.0, expected a positive number"),
        ({"hold_pressure": 1e-3, "t_box": 1.0, "flow": "pure"}, "flow pure drives the height"),
    ],
)
def test_senseless_controls_are_refused(numbers, sentence):
    with pytest.raises(ValueError, match=sentence):
        SlowShear(**numbers)
