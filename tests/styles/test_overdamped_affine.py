"""fix overdamped/affine: the equations of motion (Marschall & Teitel 2018, Eqs. 6-14)."""

from __future__ import annotations

import itertools
import re
from functools import cache

import numpy as np
import pytest
from lammps_runs import (
    SIDES,
    dump,
    error_of,
    fix_vector,
    load_plugin,
    loaded,
    run_lmp,
    run_lmp_well,
    scene,
    state_of,
    states_from_dump,
)
from lammps_scenes import (
    angle_between,
    dense,
    dense_mixture,
    kicked,
    moved,
    nearest_image,
    pose_differences,
    relaxed,
    rods,
    rods_3d,
    squeezed,
    turned,
    wrapped,
)
from superellipsoid_scenes import crowd
from thinned import in_turn

from jamshape import contacts

pytestmark = pytest.mark.lammps


def drag_of(packing, k_d=1.0):
    """Drag coefficients of translation (N,) and of rotation about the long axis and across (N, 3)."""
    measure, moment = packing.compiled().measure, packing.compiled().moment
    return k_d * measure, k_d * measure[:, None] * moment


def run_fix(packing, folder, *commands, kappa=0.0, k_d=1.0, dt=0.01, options="", **forces):
    """State after each of the commands, and the instance's fix vector after the last."""
    states = []
    with loaded(packing, folder, **forces) as session:
        session.commands(f"""
            fix move all overdamped/affine drag {k_d} compress {kappa} {options}
            timestep {dt}""")
        for command in commands:
            session.commands(command)
            states.append(state_of(session, packing))
    return states


# --- no contact: Eq. 6 exactly -------------------------------------------------------------------


def lonely_particles(dimension, edge):
    """Rods, discs and all between on a jittered grid, with image counts."""
    rng = np.random.default_rng(dimension)
    side = 4
    n = side**dimension
    cells = np.stack(np.unravel_index(np.arange(n), (side,) * dimension), axis=1)
    position = edge * ((cells + 0.5 + rng.uniform(-0.1, 0.1, cells.shape)) / side - 0.5)
    radius, ratio = rng.uniform(0.1, 0.3, n), rng.choice([0, 1e-6, 1, 5], n)
    image = rng.integers(-3, 4, (n, dimension))
    if dimension == 2:
        return rods(
            position, rng.uniform(-4, 4, n), ratio * radius, radius, [edge] * 2, image=image
        )
    return rods_3d(position, rng.normal(size=(n, 4)), ratio * radius, radius, [edge] * 3,
                   image=image)  # fmt: skip


FAST, SLOW = (np.log(10) / 20, 2000), (2e-10, 50_000)  # rates and numbers of steps
LONELY = [("rods", FAST), ("rods", SLOW), ("superellipsoids", SLOW), ("superellipsoids", FAST)]


@pytest.mark.parametrize(
    ("lonely", "reference", "dimension"), in_turn(LONELY, ["center", "corner"], [2, 3])
)
def test_without_contact_particles_follow_the_box(lonely, reference, dimension, tmp_path, measured):
    (shape, (kappa, steps)), dt = lonely, 0.01
    if shape == "rods":
        packing = wrapped(lonely_particles(dimension, 200.0 if kappa > 1e-3 else 30.0))
    else:
        packing = wrapped(crowd(dimension, n=16, phi=2e-5 if kappa > 1e-3 else 0.02))
    options = f"reference {reference}"
    start, end = run_fix(packing, tmp_path, "run 0", f"run {steps}", kappa=kappa, dt=dt,
                         options=options)  # fmt: skip
    assert not end.force.any()
    assert not len(contacts.find_contacts(end.packing, sides=1).pairs)
    scale = np.exp(-kappa * dt * steps)
    fixed = {"center": np.zeros(dimension), "corner": packing.box.lo}[reference]

    def unwrapped(state):
        p = state.packing
        return p.position + p.image * p.box.edges

    edge_error = np.abs(end.packing.box.edges / (scale * packing.box.edges) - 1).max()
    lo_error = np.abs(end.packing.box.lo - fixed - scale * (packing.box.lo - fixed)).max()
    path = unwrapped(end) - fixed - scale * (unwrapped(start) - fixed)
    position_error = np.abs(path / end.packing.box.edges).max()
    measured(edge=edge_error, lo=lo_error, position=position_error)
    # To the change itself where it is small: 1e-7 of the box in the slow case.
    assert edge_error < 1e-14
    assert lo_error < 1e-14 * packing.box.edges.max()
    assert position_error < 1e-14
    np.testing.assert_array_equal(end.packing.image, start.packing.image)
    assert end.quaternion.tobytes() == start.quaternion.tobytes()


# --- one contact ---------------------------------------------------------------------------------


def touching_discs():
    return rods([[-0.4, 0.1], [0.2, 0.3]], 0.3, 0.0, [0.5, 0.3], [10.0, 10.0])


def touching_rods():
    u = np.array([np.cos(0.3), np.sin(0.3)])
    A, R = np.array([2.0, 1.0]), np.array([0.5, 0.3])
    return rods([[0, 0], (A.sum() + 0.75) * u], 0.3, A, R, [15.0, 15.0])


def touching_rods_3d():
    q = np.array([0.9, 0.1, 0.3, -0.2]) / np.linalg.norm([0.9, 0.1, 0.3, -0.2])
    A, R = np.array([2.0, 1.0]), np.array([0.5, 0.3])
    u = rods_3d([[0, 0, 0]], q, 1.0, 1.0, [9.0] * 3).axes[0]
    return rods_3d([[0, 0, 0], (A.sum() + 0.75) * u], q, A, R, [15.0] * 3)


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("build", [touching_discs, touching_rods, touching_rods_3d])
def test_one_contact_opens_exponentially(build, sides, tmp_path, measured):
    """Discs, and rods tip to tip: the overlap decays with k_e/d^2 times the two mobilities."""
    packing, k_e, k_d, steps = build(), 1.7, 2.5, 150
    mobility = 1.0 / drag_of(packing, k_d)[0]
    d = packing.radius.sum()
    rate = k_e / d**2 * mobility.sum()
    dt = 0.02 / rate

    def overlap(state):
        separation = np.diff(state.packing.position, axis=0)[0]
        tips = state.packing.half_length.sum()
        return d - (np.linalg.norm(separation) - tips)

    start, end = run_fix(packing, tmp_path, "run 0", f"run {steps}", k_d=k_d, dt=dt, sides=sides,
                         k_e=k_e)  # fmt: skip
    remaining = overlap(end) / overlap(start)
    heun = (1 - rate * dt + (rate * dt) ** 2 / 2) ** steps
    measured(remaining=remaining, of_heun=remaining / heun - 1,
             of_exponential=np.log(remaining) / (-rate * dt * steps) - 1)  # fmt: skip
    assert overlap(start) > 0.01
    np.testing.assert_allclose(remaining, heun, rtol=1e-12)
    np.testing.assert_allclose(np.log(remaining), -rate * dt * steps, rtol=(rate * dt) ** 2 / 3)
    # Each moves by its own mobility, both along the line between them.
    moved_by = end.packing.position - start.packing.position
    np.testing.assert_allclose(moved_by[0] * mobility[1], -moved_by[1] * mobility[0], atol=1e-12)
    assert angle_between(end.quaternion, start.quaternion).max() < 1e-13


def tip_on_side(dimension):
    """A tip on a side, both turning, in the same class all the while."""
    if dimension == 2:
        return rods([[0, 0], [0.8, 1.55]], [0.0, 1.2], [2.0, 1.0], [0.5, 0.3], [12.0, 12.0])
    q = [[1.0, 0.05, 0.02, 0.0], np.array([np.cos(0.6), 0.1, 0.2, np.sin(0.6)])]
    return rods_3d([[0, 0, 0], [0.8, 1.3, 0.1]], q, [2.0, 1.0], [0.5, 0.3], [12.0] * 3)


@pytest.mark.parametrize("kappa", [0.0, 0.01])
@pytest.mark.parametrize("dimension", [2, 3])
def test_heun_is_of_second_order(dimension, kappa, tmp_path, measured):
    packing, time = tip_on_side(dimension), 1.6

    def end_of(steps):
        before, after = run_fix(packing, tmp_path, "run 0", f"run {steps}", dt=time / steps,
                                kappa=kappa)  # fmt: skip
        for state in (before, after):
            assert contacts.find_contacts(state.packing, sides=1).kind.tolist() == [1]
        return before, after

    start, exact = end_of(12800)
    turned_by = angle_between(exact.quaternion, start.quaternion)
    assert (turned_by > 0.004).all()
    number = np.array([80, 160, 320, 640])
    errors = np.array([pose_differences(end_of(steps)[1], exact) for steps in number])
    slopes = -np.polyfit(np.log(number), np.log(errors), 1)[0]
    measured(position_slope=slopes[0], angle_slope=slopes[1], coarsest=errors.max())
    assert errors.min() > 1e-11
    np.testing.assert_allclose(slopes, 2.0, atol=0.1)


# --- many contacts: Eqs. 11-14 integrated once more, with the bindings' forces ------------------------


def rates(packing, sides, k_d):
    """Velocities relative to the substrate and angular velocities (rotation vectors in space)."""
    found = contacts.forces(packing, sides=SIDES[sides])
    shift, turn = drag_of(packing, k_d)
    velocity = found.force / shift[:, None]
    if packing.dimension == 2:
        return velocity, found.torque / turn[:, 2]
    axes = packing.axes
    along = (axes * found.torque).sum(axis=1, keepdims=True) * axes
    # Nothing can turn a rod about its axis, but rounding; a sphere has no axis.
    return velocity, along / turn[:, :1] + (found.torque - along) / turn[:, 1:2]


def heun_step(packing, sides, kappa, k_d, dt):
    """One step from a box around the origin."""
    shrunk = squeezed(packing, np.exp(-kappa * dt))
    velocity, spin = rates(packing, sides, k_d)

    def after(change, rotation):
        position = packing.position + change
        moved_on = packing.with_(position=position)
        return turned(squeezed(moved_on, np.exp(-kappa * dt)), rotation)

    predicted = after(dt * velocity, dt * spin)
    velocity_1, spin_1 = rates(predicted, sides, k_d)
    # Velocities in units of the box of the start.
    mean = 0.5 * (velocity + np.exp(kappa * dt) * velocity_1)
    corrected = after(dt * mean, 0.5 * dt * (spin + spin_1))
    assert corrected.box.volume == shrunk.box.volume
    return corrected


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("name", ["rods", "mixture", "discs", "rods 3d", "mixture 3d"])
def test_steps_are_those_of_heun(name, sides, tmp_path, measured):
    build = {
        "rods": lambda: dense(n=24, phi=0.9),
        "mixture": lambda: dense_mixture(n=24, phi=0.9),
        "discs": lambda: dense(alpha=0.0, n=24, phi=0.9),
        "rods 3d": lambda: dense(3, alpha=2.0, n=24, phi=0.7),
        "mixture 3d": lambda: dense_mixture(3, n=24, phi=0.7),
    }
    kappa, k_d, dt, steps = 0.01, 1.3, 0.05, 20
    packing = build[name]().sorted_by_id()
    (found,) = run_fix(packing, tmp_path, f"run {steps}", kappa=kappa, k_d=k_d, dt=dt, sides=sides)
    expected = packing
    for _ in range(steps):
        expected = heun_step(expected, sides, kappa, k_d, dt)
    apart = nearest_image(found.packing.position - expected.position, expected.box)
    moved_by = nearest_image(expected.position - squeezed(packing, 0.99).position, expected.box)
    angle = angle_between(found.quaternion, expected.quaternions).max()
    measured(position=np.abs(apart).max(), angle=angle, moved=np.abs(moved_by).max())
    assert np.abs(moved_by).max() > 0.01
    assert np.abs(apart).max() < 1e-12
    assert angle < 1e-12


# --- many contacts: what a trajectory must not depend on -----------------------------------------


def trajectory_end(packing, folder, *, reference="center", steps=400, kappa=2e-3):
    """Through the boundaries: a violent start, then compression."""
    states = run_fix(packing, folder, f"run {steps}", kappa=kappa, dt=0.05, sides="two",
                     options=f"reference {reference}", skin=0.1)  # fmt: skip
    return states[-1]


def relative_to_first(state):
    """Positions relative to particle 1, as fractions of the box, and quaternions."""
    return (state.packing.position - state.packing.position[0]) / state.packing.box.edges


@pytest.mark.parametrize("name", ["rods", "discs", "rods 3d"])
def test_neither_reference_nor_origin_matter(name, tmp_path, measured):
    build = {
        "rods": lambda: dense(n=32, phi=0.9),
        "discs": lambda: dense(alpha=0.0, n=32, phi=0.9),
        "rods 3d": lambda: dense(3, alpha=2.0, n=32, phi=0.7),
    }
    packing = wrapped(kicked(build[name](), 0.15, 7)).sorted_by_id()
    packing = packing.with_(image=np.zeros_like(packing.image))
    expected = trajectory_end(packing, tmp_path)
    # The origin that puts the middle of the longest path on all boundaries.
    begin, end = (
        (p.position - p.box.lo) / p.box.edges + p.image for p in (packing, expected.packing)
    )
    farthest = np.abs(end - begin).min(axis=1).argmax()
    others = {
        "corner": trajectory_end(packing, tmp_path, reference="corner"),
        "shifted": trajectory_end(moved(packing, -(begin + end)[farthest] / 2), tmp_path),
    }
    assert others["shifted"].packing.image.any(), "particles wrap through the boundaries"
    for label, other in others.items():
        apart = relative_to_first(other) - relative_to_first(expected)
        apart -= np.round(apart)
        angle = angle_between(other.quaternion, expected.quaternion).max()
        measured(**{f"{label}_position": np.abs(apart).max(), f"{label}_angle": angle})
        assert np.abs(apart).max() < 1e-13
        assert angle < 1e-12
        np.testing.assert_allclose(other.packing.box.edges, expected.packing.box.edges, rtol=1e-15)


def test_positions_stay_in_the_box_and_paths_stay_whole(tmp_path):
    """Every particle, followed from dump to dump, never jumps by more than it can move."""
    packing = kicked(dense(n=32, phi=0.9), 0.15, 7)
    states = run_fix(packing, tmp_path, *["run 10"] * 60, kappa=1e-3, dt=0.05, sides="two")
    previous = None
    for state in states:
        p = state.packing
        inside = (p.position - p.box.lo) / p.box.edges
        # LAMMPS wraps on rebuilds, so a particle may be outside by up to half the skin.
        assert (inside > -0.01).all()
        assert (inside < 1.01).all()
        path = p.position + p.image * p.box.edges
        if previous is not None:
            assert np.abs(path - previous).max() < 0.05
        previous = path


# --- pressure, energy and power ------------------------------------------------------------------


def points_of_contact(state):
    """Points of contact relative to the first particle, under their pair."""
    network = contacts.find_contacts(state.packing, sides=1)
    arms = network.bonds.point - state.packing.position[network.pairs[:, 0]]
    return {(*pair, *shift): arm
            for pair, shift, arm in zip(network.pairs, network.shift, arms, strict=True)}  # fmt: skip


def has_jump(before, after):
    """Whether a contact opened, closed, or jumped along a side, from tip to tip or to the middle."""
    if before.keys() != after.keys():
        return True
    return any(np.linalg.norm(after[pair] - arm) > 0.005 for pair, arm in before.items())


def is_at_kink(state, dt, k_d):
    """Whether a stage of the step may swap the nearer of the two ends of a side-to-side contact."""
    packing = state.packing
    shift, turn = drag_of(packing, k_d)
    torque = np.linalg.norm(state.torque.reshape(packing.n, -1), axis=1)
    tip_speed = (
        np.linalg.norm(state.force, axis=1) / shift
        + torque / turn[:, 2] * packing.diameters[:, 0] / 2
    )
    network = contacts.find_contacts(packing, sides=2)
    double = np.flatnonzero(network.n_bonds == 2)
    row = np.searchsorted(network.bonds.contact, double)
    distance = network.bonds.distance
    room = 2 * dt * tip_speed[network.pairs[double]].sum(axis=1)
    return (np.abs(distance[row + 1] - distance[row]) < room).any()


def power_sample(session, packing, kappa, k_d, dt, *, kinks):
    """Relative error of the balance over two steps, and whether they straddle a kink, if there are any.

    dU/dt is a central difference, compared with the terms in the middle.
    """
    session.commands(f"timestep {dt}\nrun 0 post no")
    states, energy = [state_of(session, packing)], session.lmp.get_thermo("pe")
    session.commands("run 1 post no")
    states.append(state_of(session, packing))
    box = states[1].packing.box
    work = box.dimension * kappa * session.lmp.get_thermo("press") * box.volume
    dissipation = fix_vector(session, "drive", 5)
    session.commands("run 1 post no")
    states.append(state_of(session, packing))
    rate = (session.lmp.get_thermo("pe") - energy) / (2 * dt)
    error = abs(rate - work + dissipation) / max(abs(rate), work, dissipation)
    if not kinks:
        return error, False
    points = [points_of_contact(state) for state in states]
    jumps = any(itertools.starmap(has_jump, itertools.combinations(points, 2)))
    return error, jumps or any(is_at_kink(state, dt, k_d) for state in states)


@pytest.mark.parametrize(
    ("shape", "sides", "kappa", "between", "dimension"),
    [
        ("rods", "one", 1e-2, 20, 2),
        ("rods", "one", 1e-4, 200, 3),
        ("rods", "two", 1e-2, 20, 3),
        ("rods", "two", 1e-4, 200, 2),
        ("superellipsoids", "two", 2e-3, 20, 2),
        ("superellipsoids", "two", 2e-3, 20, 3),
        # Each number of bonds, each rate and each dimension are met above.
        *(
            pytest.param("rods", *case, marks=pytest.mark.validate)
            for case in (
                ("one", 1e-2, 20, 3),
                ("one", 1e-4, 200, 2),
                ("two", 1e-2, 20, 2),
                ("two", 1e-4, 200, 3),
            )
        ),
    ],
)
def test_power_balance_along_a_driven_run(
    shape, sides, kappa, between, dimension, tmp_path, measured
):
    """dU/dt = d kappa p V - sum F^2/(k_d A) - sum tau^2/(k_d A I)."""
    # Short enough that few samples straddle a kink, of which `sides one` has one in every jammed
    # side-to-side contact; long enough for 1e-7 of the rounding of U.
    dt, k_d = 1e-4, 1.3
    packing = crowd(dimension, n=24, phi=0.85)
    if shape == "rods":
        packing = dense(dimension, alpha=3.0, phi={2: 0.85, 3: 0.7}[dimension], kick=0.02)
    samples, step = [], 0.05 if shape == "rods" else 0.02
    with loaded(packing, tmp_path, sides=sides) as session:
        session.commands(f"fix drive all overdamped/affine drag {k_d} compress {kappa}")
        # Only where kinks are there to be left out more than are compared.
        for _ in range(30 if sides == "one" else 15):
            session.commands(f"timestep {step}\nrun {between} post no")
            samples.append(power_sample(session, packing, kappa, k_d, dt, kinks=sides == "one"))
    errors, is_kink = np.array(samples).T
    smooth = errors if sides == "two" else errors[is_kink == 0]
    measured(median=np.median(smooth), largest=smooth.max(), smooth=len(smooth),
             above=(errors > 1e-6).sum())  # fmt: skip
    assert len(smooth) >= 15
    assert smooth.max() < 1e-6


# --- stability -----------------------------------------------------------------------------------


def forces_of(packing, sides):
    found = contacts.forces(packing, 1.0, sides)
    return np.column_stack([found.force, found.torque]).ravel()


def hessian_by_differences(packing, step=1e-7, sides=1):
    """Second derivatives of the energy by positions and rotations, from the bindings' forces."""
    D, n = packing.dimension, packing.n
    rotations = 1 if D == 2 else 3
    columns = []
    for row, k in np.ndindex(n, D + rotations):
        change = []
        for sign in (1, -1):
            if k < D:
                position = packing.position.copy()
                position[row, k] += sign * step
                changed = packing.with_(position=position)
            else:
                vectors = np.zeros((n, rotations))
                vectors[row, k - D] = sign * step
                changed = turned(packing, vectors[:, 0] if D == 2 else vectors)
            change.append(forces_of(changed, sides))
        columns.append((change[1] - change[0]) / (2 * step))
    hessian = np.array(columns)
    return (hessian + hessian.T) / 2


def hessian_of_bonds(packing):
    """The same without the prestress: one row a bond, squared."""
    network = contacts.find_contacts(packing, sides=1)
    bonds, (i, j) = network.bonds, network.pairs.T
    D, n = packing.dimension, packing.n
    arms_i = bonds.point - packing.position[i]
    arms_j = bonds.point - packing.position[j] - network.shift * packing.box.edges
    rows = np.zeros((len(i), n, D + (1 if D == 2 else 3)))
    for k in range(len(i)):
        rows[k, i[k]] += np.append(bonds.normal[k], lever(arms_i[k], bonds.normal[k]))
        rows[k, j[k]] -= np.append(bonds.normal[k], lever(arms_j[k], bonds.normal[k]))
    rows = rows.reshape(len(i), -1) / bonds.reach[:, None]
    return rows.T @ rows


def lever(arm, normal):
    if len(arm) == 2:
        return [arm[0] * normal[1] - arm[1] * normal[0]]
    return np.cross(arm, normal)


def largest_relaxation_rate(hessian, packing, k_d):
    """Largest eigenvalue of the mobility times this matrix."""
    D, shape = packing.dimension, hessian.shape
    width = len(hessian) // packing.n
    shift, turn = drag_of(packing, k_d)
    root = np.zeros((packing.n, width, packing.n, width))  # of the mobility
    axes = body_axes(packing)
    for i in range(packing.n):
        root[i, :D, i, :D] = np.eye(D) / np.sqrt(shift[i])
        if D == 2:
            root[i, D, i, D] = turn[i, 2] ** -0.5
        else:
            root[i, D:, i, D:] = axes[i].T @ np.diag(1 / np.sqrt(turn[i])) @ axes[i]
    root = root.reshape(shape)
    return np.linalg.eigvalsh(root @ hessian @ root)[-1]


def body_axes(packing):
    """(N, 3, 3): a row an axis of the body, of which the first is long."""
    if packing.dimension == 2:
        return None
    along = packing.axes
    helper = np.where(np.abs(along[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]])
    across = np.cross(along, helper)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.stack([along, across, np.cross(along, across)], axis=1)


@cache
def stability_scene(dimension, alpha, seed=2):
    """Overlaps of 1 %, so that the prestress, which the estimate leaves out, is of that size."""
    phi = {2: 0.86, 3: 0.64}[dimension]
    start = dense(dimension, alpha=alpha, n=20, phi=phi, kick=0.0, seed=seed)
    return kicked(relaxed(start, 2000), 0.003, 5)


def estimated_rate(packing, k_d, folder, sides="one", integrator="heun"):
    """The fix's estimate, and its limit of the time step."""
    with loaded(packing, folder, sides=sides) as session:
        session.commands(to_estimate(k_d, integrator))
        return fix_vector(session, "move", 3), fix_vector(session, "move", 4)


def to_estimate(k_d, integrator):
    return f"""
        fix move all overdamped/affine drag {k_d} compress 0.0 integrator {integrator}
        timestep 1e-4
        run 0"""


def rates_on_two_ranks(packings, k_d, folder, sides="one", integrator="heun"):
    """The fix's estimates, of one scene after another in one process."""
    text = ""
    for k, packing in enumerate(packings):
        start = scene(packing, folder / f"{k}.data", sides=sides)
        text += f"clear\n{load_plugin()}\n{start}\n{to_estimate(k_d, integrator)}\n"
        text += "variable rate equal f_move[3]\nprint 'rate $(v_rate:%.17g)'\n"
    out = run_lmp_well(text, folder, ranks=2)
    return [float(rate) for rate in re.findall(r"^rate (\S+)$", out, re.MULTILINE)]


@pytest.mark.parametrize(("alpha", "dimension"), in_turn([4.0, 0.5, 0.0], [3, 2]))
def test_estimated_rate_is_the_largest_eigenvalue(dimension, alpha, tmp_path, measured):
    k_d, of_bonds, of_differences = 1.3, [], []
    packings = [stability_scene(dimension, alpha, seed) for seed in (1, 2, 3)]
    on_two_ranks = rates_on_two_ranks(packings, k_d, tmp_path)
    for packing, rate_there in zip(packings, on_two_ranks, strict=True):
        rate, limit = estimated_rate(packing, k_d, tmp_path)
        of_bonds.append(rate / largest_relaxation_rate(hessian_of_bonds(packing), packing, k_d))
        hessian = hessian_by_differences(packing)
        of_differences.append(rate / largest_relaxation_rate(hessian, packing, k_d))
        np.testing.assert_allclose(rate_there, rate, rtol=1e-12)
        np.testing.assert_allclose(limit * rate, 2.0, rtol=1e-14)
    measured(bonds=min(of_bonds) - 1, bonds_max=max(of_bonds) - 1,
             differences=min(of_differences) - 1, differences_max=max(of_differences) - 1)  # fmt: skip
    assert min(of_bonds) > 1 - 1e-10
    assert max(of_bonds) < 1 + 1e-10
    # With the prestress, and with kinks, next to which nearly parallel rods have rates without
    # bound; in space, where these are smoothed, they are all over long rods.
    assert max(of_differences) < 1.02
    if dimension == 2 or alpha < 1:
        assert sorted(of_differences)[1] > 0.97


def rates_of_rkc2(packings, folder):
    """Of each, over the largest eigenvalue with the prestress, and over the estimate of the bonds."""
    found = []
    on_two_ranks = rates_on_two_ranks(packings, 1.3, folder, "two", "rkc2")
    for packing, rate_there in zip(packings, on_two_ranks, strict=True):
        rate = estimated_rate(packing, 1.3, folder, "two", "rkc2")[0]
        np.testing.assert_allclose(rate_there, rate, rtol=1e-9)
        hessian = hessian_by_differences(packing, sides=2)
        of_bonds = estimated_rate(packing, 1.3, folder, "two")[0]
        found.append((rate / largest_relaxation_rate(hessian, packing, 1.3), rate / of_bonds))
    return found


# Lanczos' method ends early, from below; the margin of the step control is 1.15.
LOWEST_RATE = 1 / 1.15
STIFFEST_COUPLING = 4.0  # in rates, over the bonds' own stiffness


@pytest.mark.parametrize("dimension", [2, 3])
def test_integrators_that_choose_their_steps_see_the_prestress(dimension, tmp_path, measured):
    packings = [stability_scene(dimension, 4.0, seed) for seed in (1, 2, 3)]
    found = [of_whole for of_whole, _ in rates_of_rkc2(packings, tmp_path)]
    measured(low=min(found) - 1, high=max(found) - 1)
    assert min(found) > LOWEST_RATE
    assert max(found) < 1 + 1e-4


def test_rates_of_nearly_round_rods_are_near_those_of_their_bonds(tmp_path, measured):
    """On flat sides that the dynamics have brought together, where the bonds are coupled."""
    starts = {seed: dense(2, alpha=0.01, n=20, phi=0.88, kick=0.0, seed=seed) for seed in (1, 2)}
    found = rates_of_rkc2([relaxed(start, 20000) for start in starts.values()], tmp_path)
    for seed, (of_whole, of_bonds) in zip(starts, found, strict=True):
        measured(**{f"whole_{seed}": of_whole - 1, f"bonds_{seed}": of_bonds})
        assert LOWEST_RATE < of_whole < 1 + 1e-3
        assert LOWEST_RATE < of_bonds < STIFFEST_COUPLING


@pytest.mark.parametrize("sides", SIDES)
def test_time_steps_near_the_limit_warn_and_past_it_stop(sides, tmp_path):
    packing = stability_scene(2, 4.0)
    with loaded(packing, tmp_path, sides=sides) as session:
        session.commands("fix move all overdamped/affine drag 1.0 compress 0.0\nrun 0")
        limit = fix_vector(session, "move", 4)

    def run_at(fraction):
        """The limit is looked at once, at the start: it changes as contacts come and go."""
        return run_lmp(
            f"""{load_plugin()}
            {scene(packing, tmp_path / "s.data", sides=sides)}
            fix move all overdamped/affine drag 1.0 compress 0.0
            timestep {fraction * limit:.17g}
            run 30""",
            tmp_path,
        )

    warning = f"found timestep {0.95 * limit:g} close to the stability limit {limit:g}"
    calm, near, past = (run_at(fraction) for fraction in (0.85, 0.95, 1.05))
    assert calm.returncode == 0
    assert "WARNING: fix overdamped/affine" not in calm.stdout
    assert near.returncode == 0
    assert near.stdout.count(warning) == 1
    assert re.fullmatch(
        rf"fix overdamped/affine found timestep {1.05 * limit:g} above the stability limit "
        rf"{limit:g} \(2 over the largest relaxation rate {2 / limit:g}\): use a timestep below "
        rf"{0.9 * limit:g}\.",
        error_of(past),
    )


@pytest.mark.parametrize("check", [0, 1000])
@pytest.mark.parametrize("dt", [3.0, 1e3, 1e300])
def test_absurd_time_steps_stop_before_anything_is_lost(dt, check, tmp_path):
    """Without the check of the limit too: no step moves a particle by more than half its radius."""
    packing = stability_scene(2, 4.0)
    done = run_lmp(
        f"""{load_plugin()}
        {scene(packing, tmp_path / "s.data")}
        fix move all overdamped/affine drag 1.0 compress 1e-3 check {check}
        timestep {dt}
        {dump("s.dump")}
        run 200""",
        tmp_path,
    )
    assert re.search(
        "expected at most half its radius: use a smaller timestep|above the stability limit"
        "|crossing spines",
        error_of(done),
    )
    for state in states_from_dump(tmp_path / "s.dump"):  # refuses NaN
        assert np.isfinite(state.force).all()
