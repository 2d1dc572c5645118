"""Implicit steps in space: order, LAMMPS, balance of power, and the quasistatic limit."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from thinned import in_turn

import jamshape as js
from jamshape.flow import implicit
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.flow.host import Host
from jamshape.flow.implicit import METHODS, Flow, Protocol, compress, follow
from jamshape.flow.slow_shear import SlowShear
from jamshape.flow.turning import TurningInSpace
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape, State
from jamshape.minima import minimise
from jamshape.packing import body_axes, rate_of_vector, spin_of_vector, turned
from jamshape.packing.rotation import product
from jamshape.protocols.quasistatic import compressed_to
from jamshape.protocols.random_start import random_packing

SHAPES = {
    "spheres": (js.Superellipsoids(), 0.66),
    "ellipsoids": (js.Superellipsoids(w1=0.6, w2=1.4), 0.72),
    "superballs": (js.Superellipsoids(p=1.5), 0.7),
    "rods": (js.Spherocylinders(alpha=2), 0.7),
    "dimers": (js.Dimers(alpha=0.5), 0.7),
}

IN_TURN = [
    pytest.param(name, marks=[pytest.mark.validate] if name == "superballs" else [])
    for name in SHAPES
]


def dense(name, n=12):
    particles, phi = SHAPES[name]
    start = random_packing(n, 0.1, 1, particles, 3)
    return compressed_to(Landscape(start), State.of(start), phi, 1e-2).packing(start)


def flowed(start, course, **fields):
    landscape, flow = Landscape(start), Flow(State.of(start), **fields)
    steps = list(follow(landscape, flow, course))
    return flow, steps, course.measured(landscape, flow)


# --- one body ------------------------------------------------------------------------------------

END = 0.08
GRADIENTS = {"none": 1e-6, "simple": 2.0, "pure": 1.0}


def alone():
    """An ellipsoid that its own images turn, by a quarter radian in this time; its drags differ up to 2.6 times."""
    q = np.random.default_rng(1).normal(size=4)
    return js.Packing.of("superellipsoid", [[0.1, 0.2, 0.3]], [q / np.linalg.norm(q)], box=[0.85, 1.0, 0.9],
                         diameters=[[1.6, 1.0, 0.6]], exponent=1.0)  # fmt: skip


def course_of(kind, n, method):
    rate = GRADIENTS[kind]
    settings = {"tolerance": 1e9, "largest_strain": rate * END / n, "method": method}
    if kind == "none":  # a compression that hardly moves
        return Protocol(rate, alone().phi * np.exp(3 * rate * END), **settings)
    return SlowShear(rate, rate * END, kind, **settings)


def orientation_in_the_end(kind):
    """Integrate the equation of motion of the quaternion by a method of high order."""
    start = alone()
    landscape = Landscape(start)
    length, measure, moment = (
        np.ravel(x)[:3]
        for x in (landscape.rotation_length, landscape.bodies.measure, landscape.bodies.moment)
    )
    gradient = Host.shearing(GRADIENTS[kind], kind, 3).gradient if kind != "none" else np.zeros((3, 3))  # fmt: skip

    def rate(t, values):
        q = (values / np.linalg.norm(values))[None]
        deformed = State.of(start).deformed(expm(gradient * t).astype(np.longdouble))
        state = State(deformed.position, q.astype(np.longdouble), deformed.cell)
        torque = -landscape.components(landscape.evaluate(state).gradient)[0, 3:] * length
        axes = body_axes(q)[0]
        spin = axes.T @ (axes @ torque / (measure * moment))
        # Half the vorticity, and the strain about each axis, from the mean squared extents along the axes.
        extent = 0.5 * moment.sum() - moment
        strain = axes @ (gradient + gradient.T) @ axes.T / 2
        own = [strain[(k + 1) % 3, (k + 2) % 3] * (extent[(k + 1) % 3] - extent[(k + 2) % 3]) / moment[k]
               for k in range(3)]  # fmt: skip
        spin += [0, 0, -gradient[0, 1] / 2] + axes.T @ own
        return 0.5 * product([[0, *spin]], q)[0]

    found = solve_ivp(
        rate, (0, END), start.orientation[0], "DOP853", rtol=1e-11, atol=1e-12, max_step=2e-3
    )
    return found.y[:, -1] / np.linalg.norm(found.y[:, -1])


def orders(kind, method):
    exact, errors = orientation_in_the_end(kind), []
    for n in (16, 32, 64):
        flow = Flow(State.of(alone()), dt=END / n)
        steps = list(follow(Landscape(alone()), flow, course_of(kind, n, method)))
        assert len(steps) == n
        q = flow.state.orientation[0].astype(float)
        errors.append(np.linalg.norm(q * np.sign(q @ exact) - exact))
    return np.log2(np.array(errors[:-1]) / errors[1:])


@pytest.mark.parametrize(("kind", "method"), in_turn(list(GRADIENTS), list(METHODS)))
def test_a_body_with_different_drags_turns_to_second_order(kind, method, monkeypatch, measured):
    monkeypatch.setattr(implicit, "_EXPLICIT_BELOW", 0.0)
    found = orders(kind, method)
    measured(order=found[-1])
    assert found == pytest.approx([2.0, 2.0], abs=0.15)


def test_without_the_kinematics_of_rotation_vectors_it_would_be_first_order(monkeypatch, measured):
    monkeypatch.setattr(implicit, "_EXPLICIT_BELOW", 0.0)
    monkeypatch.setattr(TurningInSpace, "excess", lambda *of: np.zeros_like(of[1]))
    monkeypatch.setattr(TurningInSpace, "settled", lambda *of: of[2])
    found = orders("none", "tr-bdf2")
    measured(order=found[-1])
    assert found == pytest.approx([1.0, 1.0], abs=0.15)


def test_rates_of_rotation_vectors_are_those_of_rotations():
    rng = np.random.default_rng(1)
    vector = rng.normal(size=(40, 3)) * np.geomspace(1e-9, 1.5, 40)[:, None]
    rate, unit, h = rng.normal(size=(40, 3)), np.tile([1.0, 0, 0, 0], (40, 1)), 1e-6
    after, before = turned(unit, vector + h * rate), turned(unit, vector - h * rate)
    spin = product(after, before * [1, -1, -1, -1])[:, 1:] / h
    np.testing.assert_allclose(spin_of_vector(vector, rate), spin, atol=1e-8)
    np.testing.assert_allclose(rate_of_vector(vector, spin_of_vector(vector, rate)), rate, atol=1e-12)  # fmt: skip


@pytest.mark.parametrize("kind", ["simple", "pure"])
def test_a_host_in_space_deforms_by_the_exponential_of_its_gradient(kind):
    host = Host.shearing(0.3, kind, 3)
    np.testing.assert_allclose(
        host.deformation(2.0).astype(float), expm(2.0 * host.gradient), rtol=1e-15
    )
    assert host.turns_particles
    assert not Host.compressing(0.3, 3).turns_particles


# --- packings ------------------------------------------------------------------------------------


@pytest.mark.lammps
@pytest.mark.parametrize("name", IN_TURN)
def test_compression_is_the_motion_that_lammps_integrates(name, measured):
    start, kappa = dense(name), 1e-4
    end = start.phi * 1.005
    with Session() as session:
        settings = Compression(
            kappa=kappa, phi_end=end, sides=2, integrator="rkc2", tolerance=1e-8
        ).in_steps(start.phi, 10, 3)
        run = CompressionRun(session, settings, start)
        run.advance(run.last_step)
        exact, last = run.measure(), run.packing()
    flow, steps, _ = flowed(start, Protocol(kappa, end, tolerance=1e-6))
    measured(pressure=steps[-1].pressure / exact["pressure"] - 1)
    assert steps[-1].pressure == pytest.approx(exact["pressure"], rel=3e-6)
    if not start.is_round.all():
        found = flow.state.packing(start).orientation
        np.testing.assert_allclose(np.abs((found * last.orientation).sum(axis=1)), 1, atol=1e-11)


@pytest.mark.lammps
@pytest.mark.parametrize(
    ("name", "kind"),
    [pytest.param("superballs", "simple", marks=pytest.mark.validate), ("spheres", "simple"), ("dimers", "simple"),
     ("ellipsoids", "simple"), ("ellipsoids", "pure"), ("rods", "pure")],
)  # fmt: skip
def test_shear_is_the_motion_that_lammps_integrates(name, kind, tmp_path, measured):
    start = dense(name)
    exact = js.shear(start=start, gdot=1e-4, strain=5e-3, flow=kind, integrator="rkc2", integration_tolerance=1e-8,
                     rows=10, file=tmp_path / "a.h5", progress=False)  # fmt: skip
    _, steps, more = flowed(start, SlowShear(1e-4, 5e-3, kind, 1e-6))
    measured(pressure=steps[-1].pressure / exact.pressure[-1] - 1)
    assert steps[-1].pressure == pytest.approx(exact.pressure[-1], rel=5e-5)
    for observable in ("p_xy", "sigma", "S_2", "director", "turned", "z"):
        scale = steps[-1].pressure if observable in {"p_xy", "sigma"} else 1.0
        assert more[observable] == pytest.approx(exact[observable][-1], abs=2e-5 * scale)


def test_power_balances():
    # dU/dt = -V P:G - sum tau.w_host - sum F^2/(k_d V) - sum tau_b^2/(k_d V I_b), integrated by trapezoids.
    start, gdot, k_d = dense("ellipsoids", 12), 1e-3, 2.0
    landscape, flow = Landscape(start), Flow(State.of(start))
    course = SlowShear(gdot, 0.02, tolerance=1e-4, k_d=k_d, largest_strain=2e-4)
    host, bodies = Host.shearing(gdot, "simple", 3), landscape.bodies
    energy, power, times = [], [], []
    for step in follow(landscape, flow, course):
        found = landscape.evaluate(flow.state)
        components = -landscape.components(found.gradient)
        force, torque = components[:, :3], components[:, 3:] * landscape.rotation_length[:, None]
        q = flow.state.orientation.astype(float)
        about = np.einsum("nbk,nk->nb", body_axes(q), torque)
        drag = k_d * bodies.measure[:, None]
        lost = (force**2 / drag).sum() + (about**2 / (drag * bodies.moment)).sum()
        work = -gdot * landscape.stress(flow.state)[0, 1] * flow.state.volume
        work -= (torque * host.spin(bodies, q)).sum()
        energy.append(found.energy)
        power.append(work - lost)
        times.append(step.time)
    gained = np.trapezoid(power, times)
    assert abs(energy[-1] - energy[0]) > 0.1 * energy[0]
    assert gained == pytest.approx(energy[-1] - energy[0], rel=5e-3)


def test_huge_steps_land_on_the_quasistatic_minimum():
    start = dense("ellipsoids", 12)
    landscape = Landscape(start)
    start = minimise(landscape, State.of(start)).state.packing(start)
    flow = Flow(State.of(start), dt=1e12)
    course = Protocol(1e-14, start.phi * (1 + 1e-8), tolerance=1e-6)
    steps = list(compress(Landscape(start), flow, course))
    assert len(steps) <= 3
    exact = minimise(Landscape(start), flow.state)
    assert steps[-1].u == pytest.approx(exact.energy_density, rel=1e-10)


def test_volume_stays_and_the_box_takes_other_cell_vectors():
    start = dense("spheres", 12)
    flow, steps, _ = flowed(start, SlowShear(1e-3, 0.7, tolerance=1e-2))
    np.testing.assert_allclose([step.phi for step in steps], start.phi, rtol=1e-13)
    cells = (0.7 * flow.state.cell[1, 1] - flow.state.cell[0, 1]) / flow.state.cell[0, 0]
    assert float(cells) == pytest.approx(round(float(cells)), abs=1e-12)
    assert round(float(cells)) == 1


def test_going_on_from_between_two_steps_gives_the_same_to_the_bit():
    start, course = dense("ellipsoids", 8), SlowShear(1e-4, 0.05, tolerance=1e-2)
    landscape, flow = Landscape(start), Flow(State.of(start))
    for step in follow(landscape, flow, course):
        if step.step == 20:
            flow.forget()
            fresh = Flow(**{k: v for k, v in vars(flow).items() if not k.startswith("_")})
    assert step.step > 30
    list(follow(Landscape(start), fresh, course))
    for name in ("position", "orientation", "cell"):
        np.testing.assert_array_equal(getattr(fresh.state, name), getattr(flow.state, name))
    assert fresh.evaluations == flow.evaluations


def test_slow_compression_in_space_by_its_name(tmp_path):
    run = js.slow_compress(js.Superellipsoids(w1=0.6), n=6, dimension=3, phi=(0.5, 0.68), kappa=1e-3,
                           file=tmp_path / "a.h5", progress=False)  # fmt: skip
    assert run.packing(-1).dimension == 3
    # As dense as random insertion alone: nothing to compress before.
    loose = js.slow_compress(js.Spherocylinders(alpha=20), n=4, dimension=3, phi=(0.05, 0.051), kappa=1e-2,
                             file=tmp_path / "b.h5", progress=False)  # fmt: skip
    assert loose.packing(0).phi == pytest.approx(0.05, rel=1e-9)
    assert run.about["dimension"] == 3
    assert run.pressure[-1] > 0
    with pytest.raises(ValueError, match="dimension"):
        js.slow_compress(js.Superellipsoids(w1=0.6), n=6, dimension=2, phi=(0.5, 0.68), kappa=1e-3,
                         file=tmp_path / "a.h5", progress=False)  # fmt: skip
