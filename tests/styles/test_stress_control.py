"""fix overdamped/affine in a box that yields to controlled components of the stress."""

from __future__ import annotations

import numpy as np
import pytest
from lammps_runs import (
    after_restart,
    dump,
    fix_vector,
    global_vector,
    load_plugin,
    loaded,
    refusal_of,
    restarted,
    run_lmp_well,
    scene,
    state_of,
    states_from_dump,
)
from lammps_scenes import dense, pose_differences, rods
from scipy.integrate import simpson, solve_ivp
from superellipsoid_scenes import crowd

import jamshape as js

pytestmark = pytest.mark.lammps

TILT = "change_box all triclinic"
STRESSES = "compute stress all packing\nthermo_style custom step c_stress[1]"


def fix(control, dt, options="integrator heun"):
    return f"""
        fix drive all overdamped/affine drag 1.0 {control} {options}
        timestep {dt}"""


def lattice(spacing, n=3):
    """Discs of diameter 1 on a square lattice: no force moves one, however the box changes."""
    position = spacing * (
        np.stack(np.unravel_index(np.arange(n * n), (n, n)), axis=1) - n / 2 + 0.5
    )
    return rods(position, 0.0, 0.0, 0.5, [n * spacing, n * spacing])


def spacing_at(time, start, p, t_box):
    """Solution of V P / N = l f, f = 1 - l, and so of dl/dt = l (l f - p l^2) / t_box."""
    rate = lambda _, l: l * l * (1 - l - p * l) / t_box
    return solve_ivp(rate, (0, time), [start], rtol=1e-12, atol=1e-14).y[0, -1]


def spacing_after(control, steps, dt, options, tmp_path, start=0.99):
    with loaded(lattice(start), tmp_path) as session:
        session.commands(f"{fix(control, dt, options)}\nrun {steps}")
        return state_of(session).packing.box.edges / 3


# --- closed forms --------------------------------------------------------------------------------


@pytest.mark.parametrize("control", ["pressure iso 0.05 0.05", "stress xx 0.05 stress yy 0.05"])
@pytest.mark.parametrize("options", ["integrator heun", "integrator heun/adaptive tolerance 1e-7",
                                     "integrator rkc2 tolerance 1e-7"])  # fmt: skip
def test_a_lattice_relaxes_at_the_rate_of_the_closed_form(control, options, tmp_path, measured):
    t_box, time = 20.0, 30.0
    found = spacing_after(f"{control} tbox {t_box}", 300, time / 300, options, tmp_path)
    error = np.abs(found - spacing_at(time, 0.99, 0.05, t_box)).max()
    measured(error=error)
    assert error < (2e-8 if "heun " not in options + " " else 2e-7)


def test_the_error_falls_with_the_square_of_the_step(tmp_path, measured):
    t_box, time, exact = 20.0, 24.0, spacing_at(24.0, 0.99, 0.1, 20.0)
    errors = []
    for steps in (60, 120, 240):
        found = spacing_after(f"pressure iso 0.1 0.1 tbox {t_box}", steps, time / steps, "integrator heun", tmp_path)  # fmt: skip
        errors.append(np.abs(found - exact).max())
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    measured(order=order.min())
    assert (np.abs(order - 2) < 0.15).all()


def test_the_last_approach_is_exponential_with_the_time_tbox(tmp_path):
    """At l* = 1 / (1 + p) the rate is 1 / (t_box (1 + p)); a small p makes it 1 / t_box."""
    p, t_box = 1e-3, 10.0
    far = [spacing_after(f"pressure iso {p} {p} tbox {t_box}", steps, 0.1, "", tmp_path, 0.9989)[0]
           - 1 / (1 + p) for steps in (100, 200)]  # fmt: skip
    assert np.log(far[0] / far[1]) == pytest.approx(10.0 / (t_box * (1 + p)), rel=1e-3)


# --- what must hold of every flow ----------------------------------------------------------------


PACKINGS = {
    "discs": lambda: dense(alpha=0.0, n=32, phi=0.9),
    "rods": lambda: dense(n=24, phi=0.95),
    "spheres": lambda: dense(3, alpha=0.0, n=32, phi=0.7),
    "ellipsoids": lambda: crowd(3, kinds=(1,), n=24),
    "superellipsoids": lambda: crowd(3),
    "few superellipsoids": lambda: crowd(3, n=24),
}


@pytest.fixture(scope="module")
def start():
    made = {}
    return lambda name: made.setdefault(name, PACKINGS[name]())


def all_stresses(dimension, p):
    names = ["xx", "yy", "xy"] if dimension == 2 else ["xx", "yy", "zz", "xy", "xz", "yz"]
    return " ".join(f"stress {name} {p if name[0] == name[1] else 0.0}" for name in names)


def tensor(session):
    """Pressure tensor of `compute packing`."""
    v, dimension = global_vector(session, "stress"), session.lmp.extract_setting("dimension")
    n_1, n_2 = v[14], v[20]
    yy = v[2] - n_1 / 2 if dimension == 2 else v[2] + (n_2 - n_1) / 3
    found = np.diag([yy + n_1, yy, yy - n_2])
    found[0, 1], found[0, 2], found[1, 2] = v[15], v[18], v[19]
    return found[:dimension, :dimension]


@pytest.mark.parametrize(
    ("name", "goal"),
    [("discs", 1e-6), ("rods", 1e-6), ("spheres", 1e-6), ("few superellipsoids", 0.1),
     pytest.param("superellipsoids", 1e-6, marks=pytest.mark.validate)],
)  # fmt: skip
def test_at_rest_the_stress_is_the_target(name, goal, start, tmp_path, measured):
    packing, p = start(name), 0.02
    with loaded(packing, tmp_path, sides="two") as session:
        control = f"{all_stresses(packing.dimension, p)} tbox 20"
        session.commands(
            f"{TILT}\n{fix(control, 20.0, 'integrator rkc2 tolerance 1e-3')}\n{STRESSES}"
        )
        for _ in range(400):
            session.commands("run 10 post no")
            error = np.abs(tensor(session) - p * np.eye(packing.dimension)).max() / p
            if error < goal:
                break
    measured(stress=error)
    assert error < goal


@pytest.mark.parametrize("integrator", ["heun", "heun/adaptive", "rkc2"])
@pytest.mark.parametrize("name", ["rods", "spheres"])
def test_a_restart_changes_no_bit(name, integrator, start, tmp_path):
    packing, time = start(name), "tbox 20" if name == "rods" else ""
    control = fix(f"shear 2e-2 stress yy 0.02 {time}", 0.05, f"integrator {integrator} flip 0.5")
    path = tmp_path / "half.restart"
    with loaded(packing, tmp_path, sides="two") as session:
        session.commands(f"{TILT}\n{control}\nrun 120\nwrite_restart {path}\nrun 120")
        straight = state_of(session, packing)
        told = [fix_vector(session, "drive", k) for k in (1, 2, 17, 20)]
    with restarted(path, after_restart() + control) as session:
        session.commands("run 120")
        again = state_of(session, packing)
        assert [fix_vector(session, "drive", k) for k in (1, 2, 17, 20)] == told
    np.testing.assert_array_equal(again.packing.box.edges, straight.packing.box.edges)
    np.testing.assert_array_equal(again.packing.box.tilt, straight.packing.box.tilt)
    np.testing.assert_array_equal(again.packing.position, straight.packing.position)


def test_two_ranks_agree_to_rounding(start, tmp_path, measured):
    packing, found = start("rods"), []
    for ranks in (1, 2):
        folder = tmp_path / str(ranks)
        folder.mkdir()
        run_lmp_well(
            f"""{load_plugin()}
            processors {ranks} 1 1
            {scene(packing, folder / "scene.data", sides="two")}
            {fix("pressure iso 0.02 0.03", 0.05)}
            {dump(folder / "end.dump", every=200)}
            run 200""",
            folder, ranks,
        )  # fmt: skip
        found.append(states_from_dump(folder / "end.dump")[-1])
    one, two = found
    box = np.abs(one.packing.box.edges / two.packing.box.edges - 1).max()
    measured(box=box, pose=max(pose_differences(one, two)))
    assert box < 1e-12
    assert max(pose_differences(one, two)) < 1e-11


@pytest.mark.parametrize("integrator", ["heun", "rkc2 tolerance 1e-4"])
def test_normal_pressure_is_held_in_a_long_shear_across_flips(
    integrator, start, tmp_path, measured
):
    packing, p = start("discs"), 0.02
    with loaded(packing, tmp_path, sides="two") as session:
        control = f"shear 1e-2 stress yy {p} tbox 5"
        session.commands(f"{TILT}\n{fix(control, 0.1, f'integrator {integrator}')}\n{STRESSES}")
        normal = []
        for _ in range(100):
            session.commands("run 25 post no")
            normal.append(tensor(session)[1, 1])
        strain, box = fix_vector(session, "drive", 17), state_of(session).packing.box
    mean = float(np.mean(normal[40:]) / p)
    measured(mean=abs(mean - 1))
    assert strain == pytest.approx(2.5, rel=1e-12)
    assert abs(box.tilt[0]) <= 0.51 * box.edges[0]
    assert box.edges[0] == packing.box.edges[0]
    assert mean == pytest.approx(1, abs=0.1)


def balance_of_power(packing, dt, folder, before=""):
    """Energy from the power less that of the state, over the work of the stress, from time 1 to 3.

    dU/dt = -V P:G - sum torque.w_host - what the drag takes; V, P and G change all the time. Rows are of every step, since contacts
    open and close between rows that are farther apart, and both times are those of every dt, since the start is a fast transient.
    """
    p, t_box, g, steps = 0.05, 30.0, 2e-3, round(2 / dt)
    rows = []
    with loaded(packing, folder, sides="two") as session:
        session.commands(
            f"{TILT}\n{before}\n{fix(f'shear {g} stress yy {p} tbox {t_box}', dt)}\n{STRESSES}"
        )
        session.commands(f"thermo_style custom step pe vol c_stress[1]\nthermo_modify norm no\nrun {steps // 2}\nrun 0")  # fmt: skip
        for _ in range(steps + 1):
            P, volume = tensor(session), session.lmp.get_thermo("vol")
            yy = (P[1, 1] - p) * volume / (t_box * packing.n)
            work = -volume * (P[0, 1] * g + P[1, 1] * yy)
            lost = fix_vector(session, "drive", 5) + fix_vector(session, "drive", 20)
            rows.append((session.lmp.get_thermo("pe"), work, lost))
            session.commands("run 1 post no")
    energy, work, lost = np.array(rows).T
    integral, scale = (simpson(each, dx=dt) for each in (work - lost, np.abs(work)))
    return (energy[-1] - energy[0] - integral) / scale


@pytest.mark.parametrize(
    ("name", "dt", "goal"),
    [("rods", 0.01, 1e-6), ("ellipsoids", 0.01, 2e-4), pytest.param("superellipsoids", 0.0025, 1e-5, marks=pytest.mark.validate)],
)  # fmt: skip
def test_power_balances_in_a_box_that_yields(name, dt, goal, start, tmp_path, measured):
    coarse, fine = (balance_of_power(start(name), step, tmp_path) for step in (dt, dt / 2))
    order = np.log2(coarse / fine)
    measured(balance=abs(fine), order=order)
    assert abs(fine) < goal
    assert order == pytest.approx(2, abs=0.25)


# --- particles that are held ----------------------------------------------------------------------


HELD = "group held id 1:5\nfix hold held "


def from_center(packing):
    box = packing.box
    return packing.position + packing.image @ box.matrix.T - box.center


@pytest.mark.parametrize("how", ["setforce 0 0 0", "freeze"])
def test_held_particles_move_with_the_box_and_their_contacts_count(how, start, tmp_path, measured):
    packing, p = start("rods"), 0.02
    with loaded(packing, tmp_path, sides="two") as session:
        control = fix(f"{all_stresses(2, p)} tbox 20", 20.0, "integrator rkc2 tolerance 1e-3")
        session.commands(f"{TILT}\n{HELD}{how}\n{control}\n{STRESSES}\nrun 1000")
        error = np.abs(tensor(session) - p * np.eye(2)).max() / p
        end = state_of(session, packing).packing
    measured(stress=error)
    assert error < 1e-6
    deformation = end.box.matrix @ np.linalg.inv(packing.box.matrix)
    moved = from_center(end) - from_center(packing) @ deformation.T
    assert np.abs(moved[:5]).max() < 1e-13
    assert np.abs(moved[5:]).max() > 1e-2


def test_power_balances_with_held_particles(start, tmp_path, measured):
    found = balance_of_power(start("rods"), 0.005, tmp_path, f"{HELD}setforce 0 0 0")
    measured(balance=abs(found))
    assert abs(found) < 1e-6


def test_a_group_left_out_of_the_fix_is_refused(start, tmp_path):
    text = f"{scene(start('discs'), tmp_path / 'scene.data')}\ngroup few id 2:9\n"
    text += "fix drive few overdamped/affine drag 1.0 pressure iso 1e-2 1e-2"
    assert refusal_of(text) == (
        "fix overdamped/affine found a group other than all, expected 'all', since the whole box moves: hold particles at rest"
        " in the host by 'fix setforce 0 0 0' or 'fix freeze' on their group."
    )


# --- targets -------------------------------------------------------------------------------------


def test_targets_may_be_variables_and_ramps(tmp_path):
    with loaded(lattice(0.99), tmp_path) as session:
        session.commands(
            f"variable p equal 0.05\n{fix('pressure iso v_p v_p tbox 20', 0.1)}\nrun 300"
        )
        found = state_of(session).packing.box.edges / 3
    np.testing.assert_array_equal(
        found, spacing_after("pressure iso 0.05 0.05 tbox 20", 300, 0.1, "", tmp_path)
    )
    ramp = spacing_after("pressure iso 0.0 0.1 tbox 20", 300, 0.1, "", tmp_path)
    rate = lambda t, l: l * l * (1 - l - 0.1 * t / 30 * l) / 20
    exact = solve_ivp(rate, (0, 30), [0.99], rtol=1e-12, atol=1e-14).y[0, -1]
    np.testing.assert_allclose(ramp, exact, atol=2e-7)


def diameter(packing):
    """That of a disc or sphere of the mean size."""
    mean, D = packing.measures.mean(), packing.dimension
    return (2 * D * mean / np.pi) ** (1 / D)


@pytest.mark.parametrize("name", ["discs", "rods", "superellipsoids"])
def test_without_tbox_the_box_strains_under_p_as_fast_as_a_packing_relaxes(name, start, tmp_path):
    """By p alone at the rate p / zeta = p / (k_d d^2), where the packing fraction is 1."""
    packing, k_d, k_e, p = start(name), 3.0, 2.0, 0.02

    def moved(tbox):
        with loaded(packing, tmp_path, sides="two", k_e=k_e) as session:
            session.commands(f"fix drive all overdamped/affine drag {k_d} pressure iso {p} {p} {tbox}\ntimestep 0.01\nrun 20")  # fmt: skip
            told = [fix_vector(session, "drive", k) for k in (21, 22)]
            return told, state_of(session, packing).packing.box.edges

    told, edges = moved("")
    time, viscosity = told
    assert viscosity == pytest.approx(k_d * diameter(packing) ** 2, rel=1e-6)
    zeta = time * k_e / packing.measures.mean()
    assert zeta == pytest.approx(viscosity, rel=1e-6)
    again, same = moved(f"tbox {time!r}")
    assert again == told
    np.testing.assert_array_equal(same, edges)


def test_there_is_no_time_of_a_box_that_does_not_yield(start, tmp_path):
    with loaded(start("discs"), tmp_path) as session:
        session.commands("fix drive all overdamped/affine drag 1.0\ntimestep 0.01\nrun 0")
        assert [fix_vector(session, "drive", k) for k in (21, 22)] == [0, 0]


@pytest.mark.parametrize("p", [1e-8, 1e-4, 1e-1])
def test_pressures_of_all_sizes(p, tmp_path, measured):
    """From a packing at twice the pressure.

    On the way from far above jamming too many contacts open, and the packing closes again in about k_d d^2 / p, 1e8 at the
    smallest pressure.
    """
    packing = js.make_packing(js.Spherocylinders(alpha=0), n=32, pressure=2 * p, progress=False)
    with loaded(packing, tmp_path, sides="two") as session:
        control = f"pressure iso {p} {p} tbox 20"
        session.commands(f"{fix(control, 100, 'integrator rkc2 tolerance 1e-3')}\n{STRESSES}")
        session.commands("run 100")
        error = abs(global_vector(session, "stress")[2] / p - 1)
    measured(error=error)
    assert error < 1e-6


@pytest.mark.parametrize(
    ("control", "sentence"),
    [
        ("pressure iso -1e-3 1e-3 tbox 10", "the pressure -0.001, expected 0 or more: contacts push and never pull"),
        ("stress yy -1e-3 tbox 10", "the pressure -0.001, expected 0 or more"),
        ("tbox 10", "tbox without a controlled stress"),
        ("stress yy 1e-3 tbox 0", "tbox 0, expected a positive time"),
        ("stress zz 1e-3 tbox 1", "stress zz, expected a component xx, yy or xy"),
        ("stress xy 1e-3 tbox 1", "a box without tilt"),
        ("pressure 1e-3 tbox 1", "pressure without 'iso START STOP'"),
        ("compress 1e-3 pressure iso 1 1 tbox 1", "'pressure iso' and a flow that changes the volume"),
        ("pure 1e-3 stress yy 1 tbox 1", "'stress yy' and a rate of the same component"),
        ("pressure iso 1 1 stress yy 1 tbox 1", "'pressure iso' and a normal component of 'stress'"),
        ("pressure iso 1 1 tbox 1 volume constant", "volume constant and a box that yields"),
        ("pressure iso v_none v_none tbox 1", "no equal-style variable none"),
    ],
)  # fmt: skip
def test_targets_that_cannot_be_are_refused(control, sentence, tmp_path):
    text = f"{scene(lattice(0.99), tmp_path / 'scene.data')}\n{fix(control, 0.01)}\nrun 1"
    assert sentence in refusal_of(text)


@pytest.mark.parametrize("integrator", ["heun", "heun/adaptive", "rkc2"])
def test_a_pressure_that_no_contact_bears_ends_in_a_sentence(integrator, start, tmp_path):
    text = scene(start("discs"), tmp_path / "scene.data", sides="two")
    text += fix("pressure iso 1e3 1e3 tbox 1", 0.01, f"integrator {integrator}")
    found = refusal_of(f"{text}\nrun 100000")
    assert "expected" in found
    assert "nan" not in found.lower()


def test_a_step_too_long_for_tbox_is_refused_or_divided(tmp_path):
    text = scene(lattice(0.99), tmp_path / "scene.data")
    control = "pressure iso 0.05 0.05 tbox 0.01"
    assert "above the stability limit" in refusal_of(f"{text}\n{fix(control, 0.1)}\nrun 1")
    found = spacing_after(control, 10, 1.0, "integrator rkc2", tmp_path)
    np.testing.assert_allclose(found, 1 / 1.05, rtol=1e-6)
