"""Integrators of fix overdamped/affine that choose their own steps."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from lammps_runs import (
    SIDES,
    after_restart,
    difference_from_library,
    fix_vector,
    load_plugin,
    loaded,
    restarted,
    run_lmp_well,
    scene,
    state_of,
)
from lammps_scenes import angle_between, dense, nearest_image, pose_differences, rods, rods_3d
from scipy.integrate import solve_ivp
from test_extremes import SCENES

pytestmark = pytest.mark.lammps

METHODS = ["heun/adaptive", "rkc2"]
SUBSTEPS, REJECTED, FORCED, ERROR = 9, 10, 11, 14
EVALUATIONS = 6


def fix(method, tolerance=1e-4, kappa=0.0, dt=1.0):
    text = f"fix drive all overdamped/affine drag 1.0 compress {kappa:.17g}"
    if method != "heun":
        text += f" integrator {method} tolerance {tolerance}"
    return f"{text}\ntimestep {dt:.17g}"


def end_of(packing, folder, command, run="run 1", **forces):
    """State after a run, and the fix's vector as LAMMPS counts it, from 1."""
    with loaded(packing, folder, **forces) as session:
        session.commands(f"{command}\n{run}")
        vector = [np.nan] + [fix_vector(session, "drive", k) for k in range(1, 17)]
        return state_of(session), vector


@functools.cache
def rods_at(phi, n=32):
    return dense(n=n, phi=phi, kick=0.0).sorted_by_id()


# --- accuracy ------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_one_contact_opens_exponentially(method, tmp_path, measured):
    packing = rods([[-0.45, 0.0], [0.45, 0.0]], 0.0, 0.0, 0.5, [10.0, 10.0])
    rate, time = 2 / (np.pi / 4), 3.0
    errors, substeps = [], []
    for tolerance in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        end, vector = end_of(packing, tmp_path, fix(method, tolerance, dt=time))
        overlap = 1.0 - np.diff(end.packing.position[:, 0])[0]
        errors.append(abs(overlap / (0.1 * np.exp(-rate * time)) - 1))
        substeps.append(vector[SUBSTEPS])
        assert vector[ERROR] <= tolerance
        assert vector[FORCED] == 0
    # Both are of second order; the step goes with the error's order, two or three.
    slope = -np.polyfit(np.log(substeps), np.log(errors), 1)[0]
    measured(slope=slope, coarsest=errors[0], finest=errors[-1])
    assert slope == pytest.approx(2.0, abs=0.25)
    assert errors[-1] < {"heun/adaptive": 1e-6, "rkc2": 3e-4}[method]
    assert errors[0] < 0.1


@pytest.mark.parametrize("kappa", [0.0, 0.01])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("method", METHODS)
def test_turning_rods_to_second_order(method, dimension, kappa, tmp_path, measured):
    if dimension == 2:
        packing = rods([[0, 0], [0.8, 1.55]], [0.0, 1.2], [2.0, 1.0], [0.5, 0.3], [12.0] * 2)
    else:
        q = [[1.0, 0.05, 0.02, 0.0], np.array([np.cos(0.6), 0.1, 0.2, np.sin(0.6)])]
        packing = rods_3d([[0, 0, 0], [0.8, 1.3, 0.1]], q, [2.0, 1.0], [0.5, 0.3], [12.0] * 3)
    time, steps = 1.6, 12800
    exact, _ = end_of(packing, tmp_path, fix("heun", kappa=kappa, dt=time / steps), f"run {steps}")
    errors, substeps = [], []
    finest = {"heun/adaptive": 1e-5, "rkc2": 1e-7}[method]  # the reference bounds it
    for tolerance in finest * np.array([1e3, 1e2, 1e1, 1e0]):
        end, vector = end_of(packing, tmp_path, fix(method, tolerance, kappa, time))
        errors.append(pose_differences(end, exact))
        substeps.append(vector[SUBSTEPS])
    slopes = -np.polyfit(np.log(substeps), np.log(errors), 1)[0]
    measured(position=slopes[0], angle=slopes[1], finest=np.max(errors[-1]))
    assert (slopes > 1.7).all()
    assert (slopes < 2.6).all(), "the coarsest are not in the limit yet"


@pytest.mark.parametrize("kappa", [1e-3, -1e-3])
@pytest.mark.parametrize("method", METHODS)
def test_contacts_that_close_and_open_within_a_step(method, kappa, tmp_path, measured):
    """One step of LAMMPS, of which two discs spend a part in contact."""
    start, time, tolerance = {1e-3: 1.2, -1e-3: 0.9}[kappa], 400.0, 1e-5
    packing = rods([[-start / 2, 0], [start / 2, 0]], 0.0, 0.0, 0.5, [10.0, 10.0])
    end, vector = end_of(packing, tmp_path, fix(method, tolerance, kappa, time))
    found = np.diff(end.packing.position[:, 0])[0]
    rate = 2 / (np.pi / 4)
    exact = solve_ivp(
        lambda _, r: -kappa * r + rate * np.maximum(1.0 - r, 0.0), (0, time), [start],
        method="Radau", rtol=1e-11, atol=1e-13, max_step=1.0,
    ).y[0, -1]  # fmt: skip
    overlap = kappa / rate if kappa > 0 else 0.1
    measured(error=abs(found - exact) / overlap, evaluations=vector[EVALUATIONS])
    assert abs(found - exact) < 100 * tolerance * overlap
    assert (found < 1) == (kappa > 0)
    if kappa > 0:
        assert vector[REJECTED] > 0, "the contact closes in the middle of a long substep"
    assert vector[EVALUATIONS] < time / 0.01


@pytest.mark.parametrize("method", METHODS)
def test_errors_fall_with_the_tolerance(method, tmp_path, measured):
    packing, kappa, dt = rods_at(0.9), 1e-4, 20.0
    exact, _ = end_of(packing, tmp_path, fix("heun/adaptive", 1e-8, kappa, dt), sides="two")
    errors = []
    for tolerance in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        end, vector = end_of(packing, tmp_path, fix(method, tolerance, kappa, dt), sides="two")
        apart = nearest_image(end.packing.position - exact.packing.position, exact.packing.box)
        errors.append(np.sqrt((apart**2).sum(axis=1).mean()) / vector[16])
        assert vector[ERROR] <= tolerance
        assert vector[FORCED] == 0
    measured(**{f"error_{k}": error for k, error in enumerate(errors)})
    # Never far above what was asked; substeps that must be stable are finer than that.
    assert errors[2] < 1e-3
    assert errors[-1] < 0.2 * errors[2]
    assert errors[-1] < 0.02 * errors[0]
    assert errors[-1] < {"heun/adaptive": 1e-6, "rkc2": 1e-5}[method]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_without_contact_particles_follow_the_box(method, dimension, tmp_path):
    rng = np.random.default_rng(3)
    side, kappa, dt, steps = 3, 0.02, 5.0, 4
    cells = np.stack(np.unravel_index(np.arange(side**dimension), (side,) * dimension), axis=1)
    position = 40.0 * ((cells + 0.5 + rng.uniform(-0.1, 0.1, cells.shape)) / side - 0.5)
    n = len(position)
    if dimension == 2:
        packing = rods(position, rng.uniform(-4, 4, n), 1.0, 0.3, [40.0] * 2)
    else:
        packing = rods_3d(position, rng.normal(size=(n, 4)), 1.0, 0.3, [40.0] * 3)
    end, vector = end_of(packing, tmp_path, fix(method, 1e-4, kappa, dt), f"run {steps}")
    scale = np.exp(-kappa * dt * steps)
    np.testing.assert_allclose(end.packing.box.edges, scale * packing.box.edges, rtol=1e-15)
    np.testing.assert_allclose(end.packing.position, scale * packing.position, atol=1e-13)
    assert angle_between(end.quaternion, packing.quaternions).max() < 1e-15
    assert vector[REJECTED] == 0


# --- cost ----------------------------------------------------------------------------------------


def test_a_slow_compression_takes_far_fewer_forces_than_heun(tmp_path, measured):
    packing, kappa, strain = rods_at(0.88, 64), 1e-6, 2e-3
    counts = {}
    for method in METHODS:
        _, vector = end_of(packing, tmp_path, fix(method, 1e-4, kappa, strain / kappa / 4),
                           "run 4", sides="two")  # fmt: skip
        counts[method] = vector[EVALUATIONS]
    heun = 2 * strain / kappa / 0.01
    measured(heun=heun, adaptive=counts["heun/adaptive"], rkc2=counts["rkc2"])
    assert counts["heun/adaptive"] < heun / 25
    assert counts["rkc2"] < heun / 60


@pytest.mark.parametrize("method", METHODS)
def test_rattlers_do_not_throttle(method, tmp_path):
    """A far smaller particle, alone in a corner, changes nothing but the estimate of the rate."""
    pair = np.array([[-0.45, 0.0], [0.45, 0.0]])
    counts = []
    for extra in ([], [[4.0, 4.0]]):
        position = np.vstack([pair, np.reshape(extra, (-1, 2))])
        radius = np.r_[0.5, 0.5, [0.01] * len(extra)]
        packing = rods(position, 0.0, 0.0, radius, [10.0, 10.0])
        counts.append(end_of(packing, tmp_path, fix(method, 1e-5, 1e-4, 50.0))[1][SUBSTEPS])
    assert counts[1] == pytest.approx(counts[0], rel=0.02)


# --- what a trajectory must not depend on --------------------------------------------------------


def counted(out):
    return [float(word) for word in out.split("counted ")[-1].split()[:3]]


PRINT = "\n".join(f"variable v{k} equal f_drive[{k}]" for k in (SUBSTEPS, EVALUATIONS, 2))
PRINT += f"\nprint 'counted $(v_v{SUBSTEPS}) $(v_v{EVALUATIONS}) $(v_v2:%.17g)'"


@pytest.mark.parametrize("method", METHODS)
def test_ranks_agree(method, tmp_path, measured):
    packing = rods_at(0.9)
    ends = []
    for ranks in (1, 2):
        out = run_lmp_well(
            f"""{load_plugin()}
            {scene(packing, tmp_path / "s.data", sides="two", skin=0.1)}
            {fix(method, 1e-4, 1e-3, 4.0)}
            run 5
            {PRINT}
            write_restart {tmp_path / f"{ranks}.restart"}""",
            tmp_path,
            ranks,
        )
        with restarted(tmp_path / f"{ranks}.restart", after_restart()) as session:
            session.commands("run 0")
            ends.append((state_of(session), counted(out)))
    (one, of_one), (two, of_two) = ends
    distance, angle = pose_differences(one, two)
    measured(distance=distance, angle=angle, substeps=of_one[0])
    assert of_one == of_two
    assert distance < 1e-12
    assert angle < 1e-10


@pytest.mark.parametrize("method", METHODS)
def test_restart_goes_on_as_if_never_stopped(method, tmp_path, measured):
    packing, command = rods_at(0.9), fix(method, 1e-4, 1e-3, 4.0)
    path = tmp_path / "half.restart"
    whole, expected = end_of(
        packing, tmp_path, command, f"restart 5 {path} {tmp_path / 'end'}\nrun 10", sides="two"
    )
    with restarted(path, after_restart() + "\n" + command) as session:
        session.commands("run 5")
        found = [np.nan] + [fix_vector(session, "drive", k) for k in range(1, 17)]
        again = state_of(session)
    distance, angle = pose_differences(again, whole)
    measured(distance=distance, angle=angle)
    assert found[2] == expected[2]
    assert found[SUBSTEPS : FORCED + 1] == expected[SUBSTEPS : FORCED + 1]
    assert found[12] == pytest.approx(expected[12], rel=1e-9)
    assert distance < 1e-13
    assert angle < 1e-11


@pytest.mark.parametrize("method", METHODS)
def test_the_rate_jumps_between_runs(method, tmp_path, measured):
    """The long substeps of the slow run fail in the fast one, and are tried again."""
    packing, path = rods_at(0.9), tmp_path / "slow.restart"
    with loaded(packing, tmp_path, sides="two") as session:
        session.commands(f"{fix(method, 1e-4, 1e-8, 500.0)}\nrun 4\nwrite_restart {path}")
        before = fix_vector(session, "drive", 12)
    with restarted(path, after_restart() + "\n" + fix(method, 1e-4, 1e-2, 0.5)) as session:
        session.commands("run 4")
        after, error = (fix_vector(session, "drive", k) for k in (12, ERROR))
        strain, state = fix_vector(session, "drive", 2), state_of(session)
        assert fix_vector(session, "drive", FORCED) == 0
    measured(before=before, after=after)
    assert error <= 1e-4
    assert after < before
    assert strain == pytest.approx(2e-5 + 0.02, rel=1e-13)
    assert difference_from_library(state, "two") < 1e-12


def test_fix_halt_ends_a_run_at_a_density(tmp_path):
    packing, kappa, dt = rods_at(0.9), 1e-3, 1.0
    with loaded(packing, tmp_path, sides="two") as session:
        session.commands(f"""
            compute packing all packing
            variable phi equal c_packing[1]
            fix stop all halt 1 v_phi > 0.91 error continue
            {fix("rkc2", 1e-3, kappa, dt)}
            run 1000""")
        expected = np.ceil(np.log(0.91 / packing.phi) / (2 * kappa * dt))
        assert session.step == expected
        assert 0.91 < state_of(session).packing.phi < 0.91 * np.exp(2 * kappa * dt)


# --- the stiff and the extreme -------------------------------------------------------------------


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["alpha 1e-6", "alpha 1e-6, 3d", "long rods in a small box",
                                  "sizes 1 to 10", "stack to 1e-09", "stack to 0e+00, 3d"])  # fmt: skip
def test_extreme_scenes(name, method, sides, tmp_path, measured):
    packing = SCENES[name]()
    state, vector = end_of(packing, tmp_path, fix(method, 1e-3, 1e-3, 1.0), "run 3", sides=sides)
    difference = difference_from_library(state, sides)  # refuses NaN
    measured(difference=difference, substeps=vector[SUBSTEPS], forced=vector[FORCED])
    assert difference < 1e-11
    assert np.isfinite(vector[1:]).all()
    assert vector[2] == pytest.approx(3e-3, rel=1e-14)
    assert vector[SUBSTEPS] < 20_000
    if vector[FORCED] == 0:
        assert vector[ERROR] <= 1e-3


@pytest.mark.parametrize("method", METHODS)
def test_deep_overlaps_relax(method, tmp_path):
    """Discs, nearly, pressed to a third of their radius into each other."""
    rng = np.random.default_rng(5)
    position = 3.0 * (np.stack(np.unravel_index(np.arange(16), (4, 4)), axis=1) - 1.5) * 0.45
    packing = rods(position, 0.1 * rng.uniform(-1, 1, 16), 0.2, 0.9, [5.4, 5.4])
    state, vector = end_of(packing, tmp_path, fix(method, 1e-3, 0.0, 5.0), "run 3", sides="two")
    assert difference_from_library(state, "two") < 1e-12
    assert vector[ERROR] <= 1e-3 or vector[FORCED] > 0
