"""What is special to superellipsoid/harmonic: exponents, the law for spheres, its equations of motion."""

from __future__ import annotations

import numpy as np
import pytest
from body_rows import superellipsoid_rows
from lammps_runs import (
    SHOW,
    difference_from_library,
    fix_vector,
    global_vector,
    loaded,
    local_rows,
    scene,
    state_of,
)
from lammps_scenes import angle_between, quaternion_product
from pair_scenes import packing_of
from scipy.integrate import solve_ivp
from superellipsoid_scenes import crowd, particles

from jamshape import _contact
from jamshape.contacts import find_contacts, find_rattlers, forces
from jamshape.lammps.session import Session
from jamshape.measures.order3d import cubatic_order, nematic_order
from jamshape.packing import body_axes

pytestmark = pytest.mark.lammps

EPSILON = 1.7
KAPPA, DT, K_D = 2e-3, 0.02, 1.3


def fix(kappa=KAPPA, dt=DT, k_d=K_D):
    return f"fix drive all overdamped/affine drag {k_d} compress {kappa}\ntimestep {dt}"


def held(packing, folder, **named):
    return loaded(packing, folder, k_e=EPSILON, **named)


# --- forces --------------------------------------------------------------------------------------


def test_spheres_have_no_torque_and_the_law_of_yuan(tmp_path):
    """U = eps/2 ((r/d)^2 - 1)^2."""
    packing = particles([[0, 0, 0], [0.7, 0.3, 0.1]], [1.0, 0, 0, 0], [[0.5] * 3, [0.4] * 3], 1.0,
                        [9.0] * 3)  # fmt: skip
    with held(packing, tmp_path) as session:
        session.commands("run 0")
        energy, state = session.lmp.get_thermo("pe"), state_of(session, packing)
    x = 0.59 / 0.9**2
    np.testing.assert_allclose(energy, 0.5 * EPSILON * (1 - x) ** 2, rtol=1e-14)
    force = 2 * EPSILON * (1 - x) / 0.9**2 * np.array([-0.7, -0.3, -0.1])
    np.testing.assert_allclose(state.force[0], force, rtol=1e-14)
    assert not state.torque.any()


@pytest.mark.parametrize("name", ["bodies", "plane"])
def test_pressure_is_the_sum_over_scales(name, tmp_path):
    packing = packing_of(name)
    with held(packing, tmp_path) as session:
        session.commands("compute bonds all contact/local dist sumrad\nrun 0")
        distance, reach = local_rows(session, "bonds", 2).T
        pressure, x = session.lmp.get_thermo("press"), distance / reach
    expected = 2 / packing.dimension * EPSILON * (x * (1 - x)).sum()
    np.testing.assert_allclose(pressure * packing.box.volume, expected, rtol=1e-13)


def test_unlike_types_mix_their_epsilon_unless_told(tmp_path):
    packing = particles([[0, 0, 0], [0.9, 0.2, 0.1]], [[1.0, 0, 0, 0], [1.0, 0.2, 0.3, 0.1]],
                        [0.5, 0.6, 0.7], [1.0, 1.5], [9.0] * 3)  # fmt: skip
    energy = []
    with held(packing, tmp_path) as session:
        for lines in ("pair_coeff * * 1.0",
                      "pair_coeff 1 1 2.0\npair_coeff 2 2 8.0\npair_coeff 1 2 4.0"):  # fmt: skip
            session.commands(f"{lines}\nrun 0")
            energy.append(session.lmp.get_thermo("pe"))
    assert energy[0] > 0
    np.testing.assert_allclose(energy[1], 4 * energy[0], rtol=1e-15)
    np.testing.assert_allclose(energy[0], forces(packing).energy, rtol=1e-13)


def director_axis(diameters):
    """The longest axis where a c > b^2, else the shortest (Yuan et al. 2019, Sec. 2.4)."""
    a, b, c = np.sort(diameters, axis=1).T
    is_long = a * c > (1 + 1e-9) * b**2
    return np.where(is_long, diameters.argmax(axis=1), diameters.argmin(axis=1))


def orders_of(packing):
    """S_2 and C_4."""
    axes = body_axes(packing.orientation)
    nematic = nematic_order(axes[np.arange(packing.n), director_axis(packing.diameters)])
    return nematic.magnitude, cubatic_order(axes).magnitude


@pytest.mark.parametrize("kinds", [(0,), (1,), (2,), (3,)])
@pytest.mark.parametrize("is_aligned", [True, False])
def test_order_is_that_of_the_library(kinds, is_aligned, tmp_path):
    packing = crowd(kinds=kinds, spread=0.0)
    if is_aligned:
        noise = 0.1 * np.random.default_rng(1).normal(size=(packing.n, 4))
        turn = np.array([1.0, 0.3, -0.2, 0.5]) + noise
        packing = packing.with_(orientation=turn / np.linalg.norm(turn, axis=1, keepdims=True))
    with held(packing, tmp_path) as session:
        session.commands(
            "compute packing all packing\nthermo_style custom step c_packing[1]\nrun 0"
        )
        values = global_vector(session, "packing")
    np.testing.assert_allclose((values[4], values[13]), orders_of(packing), rtol=1e-12)
    assert values[10] == find_contacts(packing).n_bonds.sum()


@pytest.mark.parametrize(("p", "n_rattlers"), [(5.0, 0), (1.0, 2), (0.75, 2)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_column_of_cubes_is_held_between_faces(dimension, p, n_rattlers, tmp_path):
    """Two particles on top of each other, and of their images: only faces hold them."""
    position = np.zeros((2, dimension))
    position[1, -1] = 1.97
    turn = 0.0 if dimension == 2 else [1.0, 0.0, 0.0, 0.0]
    packing = particles(position, turn, [1.0] * 3, p, [6.0] * (dimension - 1) + [3.94])
    with held(packing, tmp_path) as session:
        session.commands("compute packing all packing\nthermo_style custom c_packing[10]\nrun 0")
        vector = global_vector(session, "packing")
    assert vector[9] == n_rattlers == find_rattlers(packing, find_contacts(packing)).sum()
    assert vector[3] == (2.0 if n_rattlers == 0 else 0.0)


# --- exponents -----------------------------------------------------------------------------------


def two_types():
    return particles(
        [[0.0, 0, 0], [0.9, 0.3, 0.2]],
        [1.0, 0.2, 0.1, -0.3],
        [0.5, 0.6, 0.8],
        [1.0, 1.5],
        [9.0] * 3,
    )


@pytest.mark.parametrize(
    ("lines", "exponents"),
    [
        (["* * 1.0 2.0"], [2.0, 2.0]),
        (["1*2 1*2 1.0 0.75"], [0.75, 0.75]),
        (["* * 1.0 2.0", "2 2 1.0 0.9"], [2.0, 0.9]),
        (["1 1 1.0 3.0", "* * 1.0"], [3.0, 1.5]),
        (["1 1 1.0 3.0", "1 2 1.0", "2 2 1.0 1"], [3.0, 1.0]),
    ],
)
def test_lines_give_exponents_to_the_types_they_name(lines, exponents, tmp_path):
    """A line without p leaves the exponents as they were."""
    packing = two_types()
    with held(packing, tmp_path) as session:
        session.commands("\n".join(f"pair_coeff {line}" for line in lines) + "\nrun 0")
        energy = session.lmp.get_thermo("pe")
    expected = forces(packing.with_(exponent=np.array(exponents))).energy
    np.testing.assert_allclose(energy, expected, rtol=1e-12)


def test_exponent_is_1_unless_told(tmp_path):
    packing = two_types()
    before, _ = scene(packing, tmp_path / "s.data").split("pair_style")
    with Session(screen=SHOW) as session:
        session.commands(f"""{before}
            pair_style superellipsoid/harmonic
            pair_coeff * * 1.0
            thermo_modify norm no
            run 0""")
        energy = session.lmp.get_thermo("pe")
    expected = forces(packing.with_(exponent=np.ones(2))).energy
    np.testing.assert_allclose(energy, expected, rtol=1e-12)


# --- the equations of motion ---------------------------------------------------------------------


def touching(dimension):
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
    packing, steps, dt = touching(dimension), 300, 2e-3
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
    with held(packing, tmp_path) as session:
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


def test_time_step_beyond_the_stability_limit_is_known(tmp_path):
    packing = crowd(n=24, phi=0.85)
    with held(packing, tmp_path) as session:
        session.commands(f"{fix()}\nrun 1")
        limit = fix_vector(session, "drive", 4)
    assert 0.01 < limit < 1


@pytest.mark.parametrize("check", [0, 1000])
def test_spheres_in_space_move_without_orientations(check, tmp_path):
    packing = particles(crowd().position, [1.0, 0, 0, 0], 0.6, 1.0, crowd().box.edges)
    with held(packing, tmp_path) as session:
        session.commands(f"{fix()} \nunfix drive\n{fix().splitlines()[0]} check {check}\nrun 10")
        state = state_of(session, packing)
    assert difference_from_library(state, k_e=EPSILON) < 1e-12
    assert np.array_equal(state.quaternion, np.tile([1.0, 0, 0, 0], (packing.n, 1)))


@pytest.mark.parametrize("dimension", [2, 3])
def test_contacts_found_from_the_last_normal_are_those_found_from_nothing(
    dimension, tmp_path, measured
):
    """`run 0` makes the list, and with it the normals, anew."""
    packing = crowd(dimension)
    with held(packing, tmp_path, skin=1.0) as session:
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
