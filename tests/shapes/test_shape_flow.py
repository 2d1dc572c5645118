"""Overdamped motion of every shape, by LAMMPS and by the implicit integrator."""

import math
from itertools import islice

import numpy as np
import pytest
from every_shape import (
    EPS,
    MIXTURES,
    SIDES,
    TYPICAL,
    close_to,
    particles_of,
    pressed,
    scattered,
    squeezed,
)
from lammps_runs import fix_vector, loaded, state_of
from slopes import slope_at_0
from thinned import quick

import jamshape as js
from jamshape.contacts import find_contacts
from jamshape.flow import implicit
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.flow.implicit import Flow, Protocol
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape
from jamshape.packing import State
from jamshape.protocols.approach import compressed_start
from jamshape.protocols.random_start import random_packing

pytestmark = pytest.mark.lammps

CASES = [*TYPICAL, *MIXTURES]
EVERY = pytest.mark.parametrize("case", CASES, ids=str)
PLANE = pytest.mark.parametrize("case", [c for c in CASES if c.dimension == 2], ids=str)
TYPICAL_IN_PLANE = pytest.mark.parametrize(
    "case", [c for c in TYPICAL if c.dimension == 2], ids=str
)

KAPPA = 1e-3


# --- without contacts ----------------------------------------------------------------------------


def lone(case):
    """A few particles that touch nothing, not even while the box becomes a fifth shorter."""
    packing = scattered(case, 3, phi=0.01)
    closer = packing.with_(diameters=1.3 * packing.diameters)
    assert not len(find_contacts(closer).pairs)
    return packing


def assert_followed_the_box(start, end, strain):
    """The affine motion alone: angles stay to the last bit of what is written."""
    assert np.abs(start.axes - end.axes).max() <= 2 * EPS
    np.testing.assert_allclose(end.box.edges, math.exp(-strain) * start.box.edges, rtol=1e-13)

    def inside(packing):
        place = packing.position + packing.image * packing.box.edges
        return (place - packing.box.lo) / packing.box.edges

    np.testing.assert_allclose(inside(end), inside(start), rtol=0, atol=1e-13)


@EVERY
@pytest.mark.parametrize("integrator", ["heun", "heun/adaptive", "rkc2"])
def test_lone_particles_follow_the_box_and_keep_their_angles(case, integrator):
    start = lone(case)
    phi_end = start.phi * math.exp(case.dimension * 0.1)
    settings = Compression(kappa=0.01, phi_end=phi_end, dt=0.1, sides=SIDES, integrator=integrator)
    with Session() as session:
        run = CompressionRun(session, settings, start)
        run.advance(run.last_step)
        end = run.packing()
        assert run.measure()["u"] == 0
    # LAMMPS moves the box about its centre.
    assert_followed_the_box(start, end, 0.1)


@PLANE
def test_lone_particles_follow_the_box_implicitly(case):
    start = lone(case)
    # States keep angles within half a turn.
    start = start.with_(orientation=np.remainder(start.orientation + np.pi, 2 * np.pi) - np.pi)
    flow = Flow(State.of(start))
    protocol = Protocol(0.01, start.phi * math.exp(0.2))
    steps = list(implicit.compress(Landscape(start, sides=SIDES), flow, protocol))
    np.testing.assert_array_equal(np.float64(flow.state.orientation[:, 0]), start.orientation)
    scale = flow.state.edges / start.box.edges
    np.testing.assert_allclose(np.float64(scale), math.exp(-0.1), rtol=1e-13)
    np.testing.assert_allclose(np.float64(scale), math.exp(-flow.strain), rtol=1e-15)
    np.testing.assert_allclose(np.float64(flow.state.position / scale), start.position, rtol=1e-14)
    assert steps[-1].pressure == 0
    assert steps[-1].phi == close_to(start.phi * math.exp(0.2), 1e-12)
    assert flow.evaluations < 20 * len(steps)
    assert flow.time == close_to(10.0, 1e-12)


# --- slow motion ---------------------------------------------------------------------------------


@TYPICAL_IN_PLANE
def test_slow_motion_below_jamming_takes_few_steps(case):
    """Corners touch over a length far below the size of a square, with as short a time to relax."""
    start = compressed_start(random_packing(8, 0.4, 0, particles_of(case)), 0.6)
    flow, protocol = Flow(State.of(start)), Protocol(1e-7, 0.605)
    steps = implicit.compress(Landscape(start, sides=SIDES), flow, protocol)
    *_, last = islice(steps, 1000)
    assert last.phi == close_to(0.605, 1e-12)


@TYPICAL_IN_PLANE
def test_unit_of_overlaps_is_that_of_the_contacts(case):
    start = squeezed(case, overlap=1e-4)
    landscape = Landscape(start, sides=SIDES)
    run = implicit.ImplicitFlow(landscape, Flow(State.of(start)), Protocol(1e-7, 0.9))
    run.advance()
    reach = find_contacts(start, sides=SIDES).bonds.reach
    assert 0.99 * reach.min() <= run.reach <= 1.5 * reach.max()


# --- the same motion by all methods --------------------------------------------------------------


def by_lammps(start, phi_end, integrator, tolerance):
    """Pressure at the end; the time step of `heun` is chosen by its tolerance."""
    chooses = integrator != "heun"
    settings = Compression(
        KAPPA, phi_end, sides=SIDES, integrator=integrator, tolerance=tolerance if chooses else 1e-4
    )
    dt = math.log(phi_end / start.phi) / start.dimension / KAPPA * (0.1 if chooses else tolerance)
    settings = Compression(**(vars(settings) | {"dt": dt}))
    with Session() as session:
        run = CompressionRun(session, settings, start)
        run.advance(run.last_step)
        found = run.measure()
    assert found["phi"] == close_to(phi_end, 1e-10)
    return found["pressure"]


def by_implicit_steps(start, phi_end, tolerance):
    landscape, flow = Landscape(start, sides=SIDES), Flow(State.of(start))
    for _ in implicit.compress(landscape, flow, Protocol(KAPPA, phi_end, tolerance=tolerance)):
        pass
    found = landscape.evaluate(flow.state)
    return -found.strain_gradient / (start.dimension * flow.state.volume)


def with_error(pressure_at, coarse, fine):
    """Pressure with the finer tolerance, and its error.

    What the coarser one changes, and the local error that is allowed, relative to the overlap.
    """
    one, two = pressure_at(coarse), pressure_at(fine)
    return two, abs(two - one) + (fine * two if fine < 1e-3 else 0.0)


def ways(case, start, phi_end):
    found = {
        "rkc2": with_error(lambda t: by_lammps(start, phi_end, "rkc2", t), 1e-4, 1e-5),
        "heun/adaptive": with_error(
            lambda t: by_lammps(start, phi_end, "heun/adaptive", t), 1e-4, 1e-5
        ),
    }
    if case.dimension == 2:
        found["implicit"] = with_error(lambda t: by_implicit_steps(start, phi_end, t), 1e-3, 1e-4)
    if case.which is not None:  # the stiffest particles of mixtures need too short steps
        found["heun"] = with_error(lambda t: by_lammps(start, phi_end, "heun", t), 1 / 200, 1 / 800)
    return found


@EVERY
def test_all_integrators_agree_on_the_pressure(case, measured):
    start = squeezed(case, overlap=0.02)
    found = ways(case, start, 1.01 * start.phi)
    best, least = min(found.values(), key=lambda pair: pair[1])
    off = {name: abs(p - best) / best for name, (p, _) in found.items()}
    measured(pressure=best, **{f"{name}_off": value for name, value in off.items()},
             **{f"{name}_error": error / best for name, (_, error) in found.items()})  # fmt: skip
    before = Landscape(start, sides=SIDES).evaluate(State.of(start))
    p_before = -before.strain_gradient / (case.dimension * start.box.volume)
    assert abs(best / p_before - 1) > 0.05
    for name, (p, error) in found.items():
        assert error < 0.01 * best, name
        assert abs(p - best) <= 2 * (error + least), name


# Each shape, and a mixture in each dimension.
YIELDING = quick(CASES, {*TYPICAL, *{case.dimension: case for case in MIXTURES}.values()})


@pytest.mark.parametrize("case", YIELDING, ids=str)
def test_a_box_yields_to_a_normal_pressure_by_explicit_and_implicit_steps(case, tmp_path, measured):
    start = squeezed(case, overlap=0.02)
    held = 0.8 * float(Landscape(start, sides=SIDES).stress(State.of(start))[1, 1])
    asked = {"start": start, "gdot": 1e-3, "strain": 1e-3, "pressure": held, "t_box": 2.0, "rows": 2, "progress": False}  # fmt: skip
    explicit, implicit_ = (
        js.shear(integrator=name, integration_tolerance=error, file=tmp_path / f"{name}.h5", **asked)
        for name, error in (("rkc2", 1e-6), ("tr-bdf2", 3e-5))
    )  # fmt: skip
    assert abs(explicit["phi"][-1] / start.phi - 1) > 1e-4
    off = {
        name: abs(implicit_[name][-1] / explicit[name][-1] - 1) for name in ("phi", "p_yy", "p_xy")
    }
    measured(**off)
    assert off["phi"] < 1e-5
    assert off["p_yy"] < 1e-3


# --- power ---------------------------------------------------------------------------------------


@EVERY
def test_power_balances(case, tmp_path, measured):
    """dU/dt = D kappa p V - what the drag dissipates."""
    packing, dt = pressed(case), 1e-5
    with loaded(packing, tmp_path, sides="two", k_e=1.7) as session:
        session.commands(f"""
            fix flow all overdamped/affine drag 1.3 compress {KAPPA}
            timestep {dt!r}
            run 0""")
        energies = [session.lmp.get_thermo("pe")]
        for step in range(1, 5):
            session.commands("run 1 pre no post no")
            energies.append(session.lmp.get_thermo("pe"))
            if step == 2:
                volume = state_of(session, packing).packing.box.volume
                work = case.dimension * KAPPA * session.lmp.get_thermo("press") * volume
                lost = fix_vector(session, "flow", 5)
    rate, error = slope_at_0(lambda s: energies[2 + round(s / dt)], dt)
    rounding = 100 * EPS * energies[2] / dt
    measured(off=abs(rate - work + lost) / lost, error=(error + rounding) / lost)
    assert lost > 0.1 * work
    assert error + rounding < 1e-4 * lost
    assert abs(rate - work + lost) <= error + rounding
