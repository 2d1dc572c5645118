"""Shear by implicit steps: against closed forms and LAMMPS, what stays, and files."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import jamshape as js
from jamshape.flow import implicit, implicit_driver
from jamshape.flow.host import Host
from jamshape.flow.implicit import METHODS, Flow, follow
from jamshape.flow.slow_shear import SlowShear
from jamshape.landscape import Landscape, State
from jamshape.protocols.quasistatic import compressed_to
from jamshape.protocols.random_start import random_packing

RODS = js.Spherocylinders(alpha=4)


def dense(particles=RODS, n=16, phi=0.9):
    start = random_packing(n, 0.3, 1, particles)
    landscape = Landscape(start)
    return compressed_to(landscape, State.of(start), phi, 5e-3).packing(start)


def flowed(start, **how):
    landscape, flow = Landscape(start), Flow(State.of(start))
    course = SlowShear(**how)
    rows = [(step, course.measured(landscape, flow)) for step in follow(landscape, flow, course)]
    return flow, rows


@pytest.mark.parametrize("gradient", [[[0, 3], [0, 0]], [[2, 0], [0, -2]], [[-1, 0.5], [0, 0.3]]])
def test_a_host_deforms_by_the_exponential_of_its_gradient(gradient):
    host = Host(np.array(gradient, float))
    for time in (1e-6, 0.7, 3.0):
        found = host.deformation(time).astype(float)
        np.testing.assert_allclose(found, expm(host.gradient * time), rtol=1e-13, atol=1e-15)


def test_a_host_whose_rates_nearly_agree_loses_no_digits():
    """There the exponential has (exp(a) - exp(d)) / (a - d), of two numbers that agree."""
    found = Host(np.array([[1, 2], [0, 1 + 1e-9]])).deformation(3.0)
    assert float(found[0, 1]) == pytest.approx(6 * np.exp(3 + 1.5e-9), rel=1e-15)


@pytest.mark.parametrize(
    ("alpha", "flow"), [(1.0, "simple"), (4.0, "simple"), (4.0, "pure"), (0.01, "simple")]
)
def test_a_lonely_rod_follows_its_orbit(alpha, flow, measured):
    """PHYSICS C: tan theta' = sqrt((1-c)/(1+c)) tan(...) of simple shear, tan theta exp(-2 e c t) of pure shear."""
    start = random_packing(1, 1e-3, 3, js.Spherocylinders(alpha=alpha))
    m = Landscape(start).bodies.moment[0]
    c = (m[1] - m[0]) / m[2]
    theta = float(start.orientation[0])
    gamma = 0.2
    flow_end, _ = flowed(start, gdot=1e-3, strain_end=gamma, flow=flow)
    found = float(flow_end.state.orientation[0, 0])
    if flow == "pure":
        expected = np.arctan(np.tan(theta) * np.exp(-2 * c * gamma))
    else:
        ratio = np.sqrt((1 - c) / (1 + c))
        phase = np.arctan(np.tan(theta) / ratio) - 0.5 * gamma * np.sqrt(1 - c**2)
        expected = np.arctan(ratio * np.tan(phase))
    off = (found - expected + np.pi / 2) % np.pi - np.pi / 2
    measured(off=off)
    assert abs(off) < 1e-10
    # Angles leave whole turns out.
    beyond = (flow_end.turned - (found - theta) + np.pi) % (2 * np.pi) - np.pi
    assert abs(beyond) < 1e-9


def test_area_and_shape_of_the_box_are_exact():
    flow, rows = flowed(dense(n=8), gdot=1e-3, strain_end=0.7, tolerance=1e-2)
    np.testing.assert_allclose([step.phi for step, _ in rows], 0.9, rtol=1e-14)
    cells = (0.7 * flow.state.cell[1, 1] - flow.state.cell[0, 1]) / flow.state.cell[0, 0]
    assert abs(flow.state.cell[0, 1]) <= 0.61 * flow.state.cell[0, 0]
    assert float(cells) == pytest.approx(1, abs=1e-12)


@pytest.mark.lammps
@pytest.mark.parametrize(
    "particles",
    [RODS, js.Spherocylinders(alpha=0), js.Spherocylinders(alpha=[0, 2]), js.Dimers(alpha=1)],
    ids=str,
)
def test_it_is_the_motion_that_lammps_integrates(particles, tmp_path, measured):
    """At the rate where both are fast; before the first rearrangement both are within their errors."""
    start = dense(particles)
    strain = 5e-3
    exact = js.shear(start=start, gdot=1e-4, strain=strain, integrator="rkc2", integration_tolerance=1e-8, rows=10,
                     file=tmp_path / "a.h5", progress=False)  # fmt: skip
    _, rows = flowed(start, gdot=1e-4, strain_end=strain, tolerance=1e-5)
    step, more = rows[-1]
    measured(pressure=step.pressure / exact.pressure[-1] - 1)
    assert step.pressure == pytest.approx(exact.pressure[-1], rel=1e-5)
    for name in ("p_xy", "sigma", "S_2", "director", "turned"):
        scale = step.pressure if name in {"p_xy", "sigma"} else 1.0
        assert more[name] == pytest.approx(exact[name][-1], abs=2e-5 * scale), name


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("kind", "gdot"), [("simple", 2.0), ("pure", 1.0)])
def test_a_body_that_its_own_images_turn_follows_to_second_order(
    kind, gdot, method, monkeypatch, measured
):
    """The host turns it at a rate that depends on its angle: what forces have turned counts once."""
    monkeypatch.setattr(implicit, "_EXPLICIT_BELOW", 0.0)
    start = js.Packing.of("superellipsoid", [[0.1, 0.2]], [0.6], box=[0.95, 1.3],
                          diameters=[[1.6, 1.0, 1.0]], exponent=1.0)  # fmt: skip
    landscape, host, end = Landscape(start), Host.shearing(gdot, kind), 0.08
    length, bodies = landscape.rotation_length[0], landscape.bodies
    c = (bodies.moment[0, 1] - bodies.moment[0, 0]) / bodies.moment[0, 2]

    def rate(t, angle):
        moved = State.of(start).deformed(host.deformation(t))
        state = State(moved.position, angle[None].astype(np.longdouble), moved.cell)
        torque = -landscape.evaluate(state).gradient[2:] * length
        own = -0.5 * gdot * (1 - c * np.cos(2 * angle)) if kind == "simple" else -gdot * c * np.sin(2 * angle)  # fmt: skip
        return torque / (bodies.measure * bodies.moment[0, 2]) + own

    exact = solve_ivp(rate, (0, end), [0.6], "DOP853", rtol=1e-12, atol=1e-13, max_step=2e-3).y[0, -1]  # fmt: skip
    errors = []
    for n in (16, 32, 64):
        flow = Flow(State.of(start), dt=end / n)
        course = SlowShear(gdot, gdot * end, kind, 1e9, largest_strain=gdot * end / n, method=method)  # fmt: skip
        assert len(list(follow(Landscape(start), flow, course))) == n
        errors.append(abs(float(flow.state.orientation[0, 0]) - exact))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    measured(order=orders[-1], error=errors[-1])
    assert (orders > 1.8).all()


def test_errors_fall_with_the_tolerance(measured):
    start = dense()
    ends = {}
    for tolerance in (1e-3, 1e-5, 1e-7):
        flow, _ = flowed(start, gdot=1e-4, strain_end=5e-3, tolerance=tolerance)
        ends[tolerance] = flow.state.position.astype(float)
    off = {t: np.abs(ends[t] - ends[1e-7]).max() for t in (1e-3, 1e-5)}
    measured(**{f"off_{t:g}": x for t, x in off.items()})
    assert off[1e-3] < 1e-4
    assert off[1e-5] < 0.6 * off[1e-3]


def test_the_cost_hardly_grows_as_the_rate_falls():
    start = dense()
    steps = [len(flowed(start, gdot=gdot, strain_end=2e-3)[1]) for gdot in (1e-6, 1e-9)]
    assert steps[1] < 3 * steps[0]


def test_frames_show_a_box_that_takes_other_cell_vectors(tmp_path, monkeypatch):
    monkeypatch.setattr(implicit_driver, "STEPS_PER_MARK", 10)
    first = dense(js.Spherocylinders(alpha=0.01), n=12, phi=0.86)
    start = State.of(first).deformed(Host.shearing(0.5, "simple").deformation(1.1)).packing(first)
    run = js.shear(start=start, gdot=1e-3, strain=0.15, integrator="tr-bdf2", integration_tolerance=1e-2,
                   rows=100, file=tmp_path / "a.h5", progress=False)  # fmt: skip
    assert isinstance(js.resume(tmp_path / "a.h5", progress=False), js.ShearFile)
    assert run.strain[-1] == pytest.approx(0.15, rel=1e-12)
    tilts = [float(frame.box.tilt[0]) for frame in run]
    assert min(tilts) < 0 < max(tilts)
    assert run.steady(0.05)["pressure"].value > 0


def test_slow_rates_take_implicit_steps_by_themselves(tmp_path):
    start = dense()
    asked = {"start": start, "gdot": 1e-7, "strain": 1e-3, "rows": 100, "progress": False}
    run = js.shear(file=tmp_path / "a.h5", **asked)
    assert run.about["method"] == "tr-bdf2"
    assert run.steady(0.0)["mu"].value > 0
    again = js.shear(file=tmp_path / "a.h5", **asked)
    assert len(again) == len(run)
    one = js.shear(integrator="tr-bdf2", sides=1, file=tmp_path / "b.h5", **asked)
    assert one.about["sides"] == 1
    assert list(one)[-1].law.sides == 1
    with pytest.raises(ValueError, match="sides=1, expected 2"):
        js.slow_compress(RODS, n=8, dimension=3, sides=1, file=tmp_path / "c.h5")


def test_other_particles_in_the_file_of_a_slow_shear_are_refused(tmp_path):
    asked = {
        "n": 8,
        "gdot": 1e-4,
        "strain": 1e-3,
        "integrator": "tr-bdf2",
        "rows": 4,
        "progress": False,
    }
    js.shear(RODS, phi=0.3, file=tmp_path / "a.h5", **asked)
    for other in ({"phi": 0.31}, {"seed": 2, "phi": 0.3}):
        with pytest.raises(ValueError, match="holds a shear with"):
            js.shear(RODS, file=tmp_path / "a.h5", **asked | other)
