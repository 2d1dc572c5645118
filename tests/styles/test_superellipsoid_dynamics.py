"""superellipsoid/harmonic in motion: the fix, restarts, minimisation, and the warm start."""

from __future__ import annotations

import numpy as np
import pytest
from body_rows import superellipsoid_rows
from lammps_scenes import (
    angle_between,
    dump,
    fix_vector,
    global_vector,
    load_plugin,
    pose_differences,
    quaternion_product,
    restarted,
    run_lmp_well,
    states_from_dump,
    wrapped,
)
from scipy.integrate import solve_ivp
from superellipsoid_scenes import (
    EPSILON,
    after_restart,
    crowd,
    difference_from_bindings,
    exponents_of,
    loaded,
    particles,
    scene,
    state_of,
    sums,
)

from jamshape import _contact
from jamshape.packing import body_axes

pytestmark = pytest.mark.lammps

KAPPA, DT, K_D = 2e-3, 0.02, 1.3


def fix(kappa=KAPPA, dt=DT, k_d=K_D):
    return f"fix drive all overdamped/affine drag {k_d} compress {kappa}\ntimestep {dt}"


# --- the equations of motion ---------------------------------------------------------------------


@pytest.mark.parametrize("dimension", [2, 3])
def test_without_contact_particles_follow_the_box(dimension, tmp_path, measured):
    packing = wrapped(crowd(dimension, n=16, phi=0.02))
    steps, kappa = 500, 1e-2
    with loaded(packing, tmp_path) as session:
        session.commands(f"{fix(kappa)}\nrun 0")
        start = state_of(session, packing)
        session.commands(f"run {steps}")
        end = state_of(session, packing)
    assert not end.force.any()
    scale = np.exp(-kappa * DT * steps)
    np.testing.assert_allclose(end.packing.box.edges, scale * packing.box.edges, rtol=1e-14)
    paths = [s.packing.position + s.packing.image * s.packing.box.edges for s in (start, end)]
    difference = np.abs(paths[1] - scale * paths[0]).max() / packing.box.edges[0]
    measured(difference=difference)
    assert difference < 1e-14
    assert end.quaternion.tobytes() == start.quaternion.tobytes()


def two(dimension):
    """In contact off their axes, both turning."""
    if dimension == 2:
        return particles([[0, 0], [0.9, 0.75]], [0.1, 1.4], [[1, 0.5, 1], [0.8, 0.6, 1]], [1.5, 0.75],
                         [12.0] * 2)  # fmt: skip
    return particles([[0, 0, 0], [0.6, 0.6, 0.55]], [[1.0, 0.2, 0.1, 0.3], [1.0, -0.3, 0.6, 0.1]],
                     [[1, 0.5, 0.7], [0.8, 0.6, 0.4]], [1.5, 0.75], [12.0] * 3)  # fmt: skip


def rates_of(packing):
    """Velocities and angular velocities in space, from the bindings."""
    D = packing.dimension
    measure, moment = (packing.compiled().measure, packing.compiled().moment)
    rows = superellipsoid_rows(packing)
    contact = _contact.superellipsoid_contacts(rows[:1], rows[1:], EPSILON)
    force = np.concatenate([contact["force"], -contact["force"]])
    torque = np.concatenate([contact["torque_i"], contact["torque_j"]])
    shift, turn = K_D * measure[:, None], K_D * measure[:, None] * moment
    if D == 2:
        return force / shift, torque / turn[:, 2:]
    axes = body_axes(packing.orientation)
    in_body = np.einsum("nki,ni->nk", axes, torque) / turn
    return force / shift, np.einsum("nki,nk->ni", axes, in_body)


@pytest.mark.parametrize("dimension", [2, 3])
def test_one_contact_relaxes_as_its_equations_say(dimension, tmp_path, measured):
    packing, steps, dt = two(dimension), 300, 2e-3
    D = dimension

    def at(y):
        turn = y[2 * D :] if D == 2 else y[2 * D :].reshape(2, 4)
        if D == 3:
            turn = turn / np.linalg.norm(turn, axis=1, keepdims=True)
        return packing.with_(position=y[: 2 * D].reshape(2, D), orientation=turn)

    def slope(_, y):
        now = at(y)
        velocity, spin = rates_of(now)
        if D == 2:
            return np.concatenate([velocity.ravel(), spin.ravel()])
        spin = np.column_stack([np.zeros(2), spin])
        turning = 0.5 * quaternion_product(spin, y[2 * D :].reshape(2, 4))
        return np.concatenate([velocity.ravel(), turning.ravel()])

    start = np.concatenate([packing.position.ravel(), packing.orientation.ravel()])
    exact = solve_ivp(slope, (0, steps * dt), start, rtol=1e-11, atol=1e-13, method="DOP853")
    expected = at(exact.y[:, -1])
    with loaded(packing, tmp_path) as session:
        session.commands(f"{fix(0.0, dt)}\nrun {steps}")
        found = state_of(session, packing)
    moved = np.abs(expected.position - packing.position).max()
    turned = angle_between(expected.quaternions, packing.quaternions).min()
    distance = np.abs(found.packing.position - expected.position).max() / moved
    angle = angle_between(found.quaternion, expected.quaternions).max() / turned
    measured(distance=distance, angle=angle, moved=moved, turned=turned)
    assert moved > 0.02
    assert turned > 0.005
    assert distance < 1e-4  # of Heun's method, whose error is that of dt^2
    assert angle < 1e-4


@pytest.mark.parametrize("dimension", [2, 3])
def test_power_balance_along_a_driven_run(dimension, tmp_path, measured):
    """dU/dt = d kappa p V - sum F^2/(k_d V) - sum tau^2/(k_d V I)."""
    packing, dt = crowd(dimension, n=24, phi=0.85), 1e-4
    errors = []
    with loaded(packing, tmp_path) as session:
        session.commands(fix())
        for _ in range(10):
            session.commands(f"timestep {DT}\nrun 20 post no\ntimestep {dt}\nrun 0 post no")
            energy = session.lmp.get_thermo("pe")
            session.commands("run 1 post no")
            box = state_of(session, packing).packing.box
            work = dimension * KAPPA * session.lmp.get_thermo("press") * box.volume
            dissipation = fix_vector(session, "drive", 5)
            session.commands("run 1 post no")
            rate = (session.lmp.get_thermo("pe") - energy) / (2 * dt)
            errors.append(abs(rate - work + dissipation) / max(abs(rate), work, dissipation))
    measured(median=np.median(errors), largest=max(errors))
    assert max(errors) < 1e-6


def test_time_step_beyond_the_stability_limit_is_known(tmp_path):
    packing = crowd(n=24, phi=0.85)
    with loaded(packing, tmp_path) as session:
        session.commands(f"{fix()}\nrun 1")
        limit = fix_vector(session, "drive", 4)
    assert 0.01 < limit < 1


@pytest.mark.parametrize("check", [0, 1000])
def test_spheres_in_space_move_without_orientations(check, tmp_path):
    packing = particles(crowd().position, [1.0, 0, 0, 0], 0.6, 1.0, crowd().box.edges)
    with loaded(packing, tmp_path) as session:
        session.commands(f"{fix()} \nunfix drive\n{fix().splitlines()[0]} check {check}\nrun 10")
        state = state_of(session, packing)
    assert difference_from_bindings(state) < 1e-12
    assert np.array_equal(state.quaternion, np.tile([1.0, 0, 0, 0], (packing.n, 1)))


# --- pruning of pairs and the warm start ---------------------------------------------------------


@pytest.mark.parametrize("dimension", [2, 3])
def test_neither_skin_nor_start_of_the_contact_solver_matter(dimension, tmp_path, measured):
    """With a thin skin lists are made anew in most steps, and contacts are found from nothing."""
    packing = crowd(dimension)
    found, rebuilds = {}, {}
    for skin in (0.02, 1.0):
        with loaded(packing, tmp_path, skin=skin) as session:
            session.commands(f"{fix(-0.01, 0.02)}\nrun 300")
            found[skin] = state_of(session, packing)
            rebuilds[skin] = fix_vector(session, "drive", 7)
    distance, angle = pose_differences(found[0.02], found[1.0])
    forces = max(difference_from_bindings(state) for state in found.values())
    turned = angle_between(found[1.0].quaternion, packing.sorted_by_id().quaternions)
    measured(distance=distance, angle=angle, forces=forces, rebuilds=rebuilds[0.02],
             turned=turned.max())  # fmt: skip
    assert rebuilds[0.02] > 20 * max(rebuilds[1.0], 0.5)
    assert turned.max() > 0.1
    assert distance < 1e-12
    assert angle < 1e-11
    assert forces < 1e-12


@pytest.mark.parametrize("dimension", [2, 3])
def test_contacts_found_from_the_last_normal_are_those_found_from_nothing(
    dimension, tmp_path, measured
):
    """`run 0` makes the list, and with it the normals, anew."""
    packing = crowd(dimension)
    with loaded(packing, tmp_path, skin=1.0) as session:
        session.commands(f"{fix(1e-3, 1e-3)}\nrun 20")
        warm = state_of(session, packing)
        rebuilds = fix_vector(session, "drive", 7)
        session.commands("run 0")
        cold = state_of(session, packing)
    differences = [
        np.abs(found - wanted).max() / np.abs(wanted).max()
        for found, wanted in ((warm.force, cold.force), (warm.torque, cold.torque))
    ]
    measured(force=differences[0], torque=differences[1], rebuilds=rebuilds)
    assert rebuilds == 0, "the first forces were found from normals of the steps before"
    assert not np.array_equal(warm.force, cold.force), "both were found from nothing"
    assert max(differences) < 1e-13


def test_no_contact_is_missed_while_a_dilute_state_becomes_dense(tmp_path, measured):
    packing = crowd(n=32, phi=0.3)
    largest = 0.0
    with loaded(packing, tmp_path, skin=1.0) as session:
        session.commands(f"{fix(0.05, 0.02)}\nrun 0")
        for _ in range(15):
            session.commands("run 25 pre no post no")
            largest = max(largest, difference_from_bindings(state_of(session, packing)))
        phi = state_of(session, packing).packing.phi
    measured(difference=largest, phi=phi)
    assert phi > 0.8
    assert largest < 1e-12


# --- minimisation --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("dimension", "kinds", "phi"),
    [(2, (0, 1, 2, 3), 0.95), (3, (0, 1, 2, 3), 0.78), (3, (1,), 0.78), (3, (2,), 0.8)],
)
def test_cg_relaxes_positions_and_orientations(dimension, kinds, phi, tmp_path, measured):
    packing = crowd(dimension, kinds, n=24, phi=phi, spread=0.3)
    with loaded(packing, tmp_path) as session:
        session.commands("""
            compute packing all packing
            thermo_style custom step pe press c_packing[1]
            thermo_modify norm no
            run 0""")
        before = session.lmp.get_thermo("pe")
        session.commands("""
            min_style cg
            min_modify dmax 0.05
            minimize 0.0 0.0 2000 20000
            run 0""")
        energy, values = session.lmp.get_thermo("pe"), global_vector(session, "packing")
        end = state_of(session, packing)
    turned = angle_between(end.quaternion, packing.sorted_by_id().quaternions).max()
    measured(energy=energy / before, force=values[6], torque=values[12], turned=turned, z=values[3])
    assert energy < 0.6 * before
    assert turned > 0.05
    assert max(values[6], values[12]) < 1e-3
    np.testing.assert_allclose(energy, sums(end.packing)["energy"], rtol=1e-11)


# --- restarts ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("dimension", "ranks_before", "ranks_after"), [(3, 1, 2), (3, 2, 1), (2, 1, 1)]
)
def test_restart_goes_on_as_if_never_stopped(
    dimension, ranks_before, ranks_after, tmp_path, measured
):
    """The pair style, its coefficients and its exponents come from the file."""
    packing, steps = crowd(dimension, n=32, phi=0.8), 100
    run_lmp_well(
        f"""{load_plugin()}
        {scene(packing, tmp_path / "start.data")}
        pair_coeff 1 2 1.25
        {fix()}
        {dump(tmp_path / "whole.dump", every=2 * steps)}
        restart {steps} {tmp_path / "half.restart"} {tmp_path / "end.restart"}
        run {2 * steps}""",
        tmp_path, ranks_before,
    )  # fmt: skip
    run_lmp_well(
        f"""{load_plugin()}
        read_restart {tmp_path / "half.restart"}
        {after_restart()}
        {fix()}
        {dump(tmp_path / "half.dump", every=2 * steps)}
        run {2 * steps} upto""",
        tmp_path, ranks_after,
    )  # fmt: skip
    expected = states_from_dump(tmp_path / "whole.dump", exponents_of(packing))[-1]
    found = states_from_dump(tmp_path / "half.dump", exponents_of(packing))[-1]
    assert found.packing.step == expected.packing.step == 2 * steps
    np.testing.assert_array_equal(found.packing.box.edges, expected.packing.box.edges)
    distance, angle = pose_differences(found, expected)
    measured(distance=distance, angle=angle)
    assert distance < 1e-13
    assert angle < 1e-12
    with restarted(tmp_path / "half.restart", after_restart()) as session:
        session.commands("pair_coeff * * 1.7\nrun 0")  # exponents stay
        assert difference_from_bindings(state_of(session, packing)) < 1e-12
