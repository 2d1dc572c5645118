"""The pair style of every shape in runs of LAMMPS: motion, minimisation, restarts, files and refusals."""

from __future__ import annotations

import math
import re
import warnings

import numpy as np
import pytest
from chosen_seeds import chosen_with_avx512
from dumps import read_dump
from every_shape import (
    EPS,
    MIXTURES,
    ROUNDING,
    SIDES,
    TYPICAL,
    close_to,
    pressed,
    scattered,
    squeezed,
)
from lammps_runs import (
    POSE,
    after_restart,
    difference_from_library,
    dump,
    error_of,
    fix_vector,
    load_plugin,
    loaded,
    refusal_of,
    restarted,
    run_lmp,
    run_lmp_well,
    scene,
    state_of,
    states_from_dump,
)
from lammps_scenes import angle_between, dense, kicked, pose_differences, with_odd_ids
from pair_scenes import packing_of
from superellipsoid_scenes import crowd

from jamshape.contacts import forces
from jamshape.files.disk import FileFormatError
from jamshape.files.lammps_text import read_data, write_data
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session
from jamshape.shapes.shape import ElongatedShape
from jamshape.shapes.table import SHAPES

pytestmark = pytest.mark.lammps

K_E = 1.7
OF_EVERY_SHAPE = {"sides": "two", "k_e": K_E}
EVERY = pytest.mark.parametrize("case", [*TYPICAL, *MIXTURES], ids=str)
PURE = pytest.mark.parametrize("case", TYPICAL, ids=str)
# In space, where it lives there.
ONE_OF_EACH = {case.shape: case for case in sorted(TYPICAL)}.values()


def drive(kappa, dt, options="", drag=1.0):
    return f"""
        fix drive all overdamped/affine drag {drag} compress {kappa!r} {options}
        timestep {dt!r}"""


def energy_of(packing):
    return forces(packing, K_E, SIDES).energy


# --- motion --------------------------------------------------------------------------------------

ALL_OF_IT = "rotation pairs contact"


@pytest.mark.parametrize(
    ("name", "what"),
    [
        *((name, what) for name in ("discs", "rods", "p 1", "spheres of sizes")
          for what in ("rotation", "pairs", "contact", ALL_OF_IT)),
        *((str(case), ALL_OF_IT) for case in TYPICAL),
    ],
)  # fmt: skip
def test_what_is_left_out_changes_nothing(name, what, tmp_path):
    """Forces at the start, and where the dynamics lead in fifty steps."""
    packing, ends = packing_of(name), []
    for general in ("", f"disable_shortcuts {what}"):
        with loaded(packing, tmp_path, sides="one", general=general) as session:
            session.commands(f"{drive(1e-4, 0.005)}\nrun 0")
            start = state_of(session, packing)
            session.commands("run 50")
            ends.append((start, state_of(session, packing)))
    (start, end), (start_there, end_there) = ends
    largest = np.abs(start.force).max()
    assert np.abs(start.force - start_there.force).max() < 1e-13 * largest
    torque = np.abs(start.torque).max()
    if torque < 1e-3 * largest:  # the rounding of spheres
        torque = largest
    assert np.abs(start.torque - start_there.torque).max() < 1e-13 * torque
    assert pose_differences(start, end)[0] > 1e-5
    assert difference_from_library(end) < 1e-12
    assert max(pose_differences(end, end_there)) < 1e-12


@PURE
@pytest.mark.parametrize("integrator", ["heun", "heun/adaptive", "rkc2"])
def test_the_flow_relaxes_and_compresses(case, integrator, tmp_path):
    """Without losing contacts; its estimates of rates go through the second derivatives."""
    packing = pressed(case)
    start, before = energy_of(squeezed(case)), energy_of(packing)
    dt, steps = (0.002, 5000) if integrator == "heun" else (1.25, 8)
    with loaded(packing, tmp_path, **OF_EVERY_SHAPE) as session:
        session.commands(f"{drive(1e-5, dt, f'integrator {integrator}')}\nrun {steps}")
        found, after = state_of(session, packing), session.lmp.get_thermo("pe")
        strain, rate = (fix_vector(session, "drive", k) for k in (2, 3))
    assert difference_from_library(found, **OF_EVERY_SHAPE) < 1e-12
    # Half of what the kick off the minimum cost is taken back.
    assert after - start < 0.5 * (before - start)
    np.testing.assert_allclose(strain, 1e-5 * dt * steps, rtol=1e-12)
    assert rate > 0


@EVERY
def test_no_contact_is_missed_while_a_dilute_packing_becomes_dense(case, tmp_path, measured):
    packing, worst = scattered(case), 0.0
    strain = math.log(0.8 / packing.phi) / packing.dimension
    skin = 0.3 * packing.diameters.min()
    with loaded(packing, tmp_path, skin=skin, **OF_EVERY_SHAPE) as session:
        session.commands(f"{drive(strain / 20, 1.0, 'integrator rkc2')}\nrun 0")
        for _ in range(10):
            session.commands("run 2 pre no post no")
            now = state_of(session, packing)
            if now.force.any():
                worst = max(worst, difference_from_library(now, **OF_EVERY_SHAPE))
        rebuilds = fix_vector(session, "drive", 7)
    measured(off=worst, rebuilds=rebuilds, phi=now.packing.phi)
    assert now.packing.phi > 0.79
    assert (now.force != 0).any(axis=1).sum() > packing.n / 2
    assert rebuilds > 0
    # Angles of the plane are taken from quaternions, to a rounding of their own.
    assert worst < {2: 100, 3: 10}[case.dimension] * ROUNDING


@pytest.mark.parametrize("name", ["rods", "mixture", "rods 3d", "bodies", "plane"])
def test_neither_skin_nor_start_of_the_contact_solver_matter(name, tmp_path, measured):
    """Violent relaxation: particles turn fast; with a thin skin lists, and contacts, are found anew."""
    is_rods = name not in ("bodies", "plane")
    packing = kicked(packing_of(name), 0.2, 4) if is_rods else packing_of(name)
    thin, thick = (0.05, 4.0) if is_rods else (0.02, 1.0)
    flow = drive(-0.05, 0.005, drag=0.1) if is_rods else drive(-0.01, 0.02, drag=1.3)
    found, rebuilds = {}, {}
    for skin in (thin, thick):
        with loaded(packing, tmp_path, sides="two", skin=skin) as session:
            session.commands(f"{flow}\nrun {400 if is_rods else 300}")
            found[skin] = state_of(session, packing)
            rebuilds[skin] = fix_vector(session, "drive", 7)
    turned_by = angle_between(found[thin].quaternion, packing.sorted_by_id().quaternions).max()
    distance, angle = pose_differences(found[thin], found[thick])
    off = max(difference_from_library(state, "two") for state in found.values())
    measured(distance=distance, angle=angle, forces=off, rebuilds=rebuilds[thin], turned=turned_by)
    assert turned_by > 0.1
    assert rebuilds[thin] > (10 if is_rods else 20) * max(rebuilds[thick], 0.5)
    assert distance < 1e-12
    assert angle < (1e-12 if is_rods else 1e-11)
    # Positions are off the grid now: periodic images are rounded.
    assert off < (1e-13 if is_rods else 1e-12)


@pytest.mark.parametrize("name", ["plane, all shapes", "own images", "plane, own images"])
def test_forces_of_extreme_bodies_stay_right_in_motion(name, tmp_path, measured):
    """Found from the last normals, with lists made anew and kept."""
    packing = packing_of(f"extreme, {name}")
    with loaded(packing, tmp_path, k_e=K_E) as session:
        session.commands(f"{drive(1e-4, 0.01, 'integrator heun/adaptive tolerance 1e-3')}\nrun 20")
        state, energy = state_of(session, packing), session.lmp.get_thermo("pe")
    difference = difference_from_library(state, k_e=K_E)
    measured(difference=difference, energy=energy / energy_of(packing))
    assert difference < 1e-12
    assert 0 < energy < energy_of(packing)


@EVERY
@pytest.mark.parametrize("style", ["cg", "sd"])
def test_minimisers_relax_positions_and_orientations(case, style, tmp_path, measured, request):
    if (style, str(case)) == ("cg", "spherocylinder-2D-mixture"):
        request.applymarker(chosen_with_avx512)
    packing = pressed(case)
    start, before = energy_of(squeezed(case)), energy_of(packing)
    with loaded(packing, tmp_path, **OF_EVERY_SHAPE) as session:
        session.commands(f"""
            min_style {style}
            min_modify dmax 0.05
            minimize 0.0 0.0 300 6000
            run 0""")
        after, end = session.lmp.get_thermo("pe"), state_of(session, packing).packing
    turned = np.abs(end.axes - packing.sorted_by_id().axes).max()
    measured(left=(after - start) / (before - start), turned=turned)
    # What the kick off the minimum cost is taken back.
    assert before > 1.02 * start
    assert after - start < {"cg": 0.1, "sd": 0.5}[style] * (before - start)
    assert turned > 1e-3
    assert after == close_to(energy_of(end), 1e-11)


# --- restarts ------------------------------------------------------------------------------------

STEPS = 60
TO_RESTART = {
    "rods": lambda: dense(n=32, phi=0.9),
    "rods 3d": lambda: dense(3, alpha=2.0, n=32, phi=0.7),
    "discs": lambda: dense(alpha=0.0, n=32, phi=0.9),
    "bodies": lambda: crowd(3, n=32, phi=0.8),
    "plane": lambda: crowd(2, n=32, phi=0.8),
    **{str(case): lambda case=case: packing_of(str(case)) for case in TYPICAL},
}
PRINT_STRAIN = """
    variable strain equal f_drive[2]
    print 'strain $(v_strain:%.17g)'"""


@pytest.mark.parametrize(
    ("name", "sides", "ranks_before", "ranks_after", "options"),
    [
        ("rods", "two", 1, 1, ""),
        ("rods", "two", 2, 2, "reference corner"),
        ("rods", "two", 1, 2, ""),
        pytest.param("rods", "two", 2, 1, "", marks=pytest.mark.validate),  # as the discs below
        ("rods", "one", 1, 1, ""),
        ("rods 3d", "two", 1, 2, ""),
        ("discs", "one", 2, 1, ""),
        pytest.param("bodies", "two", 1, 2, "", marks=pytest.mark.validate),  # as each shape below
        ("bodies", "two", 2, 1, ""),
        ("plane", "two", 1, 1, ""),
        # What a restart file holds does not depend on the dimension.
        *(pytest.param(str(case), "two", 1, 2, "", marks=() if case in ONE_OF_EACH else pytest.mark.validate)
          for case in TYPICAL),
    ],
)  # fmt: skip
def test_restart_goes_on_as_if_never_stopped(
    name, sides, ranks_before, ranks_after, options, tmp_path, measured
):
    """In a new process; the pair style, its coefficients and its exponents come from the file."""
    packing = TO_RESTART[name]()
    is_rods = name.startswith(("rods", "discs"))
    n_types = packing.shape.style(packing, packing.law).types.max()
    dt = 0.07 if is_rods else 0.02 if name in ("bodies", "plane") else 0.004
    flow = drive(1.3e-3, dt, options, drag=1.3)
    restart = tmp_path / "half.restart"
    out = run_lmp_well(
        f"""{load_plugin()}
        {scene(packing, tmp_path / "start.data", sides=sides)}
        pair_coeff {n_types} {n_types} 1.7
        {f"pair_coeff 1 {n_types} 1.25" if n_types > 1 else ""}
        {drive(1.3e-3, dt / 2, options, drag=1.3)}
        run 40
        timestep {dt}
        {dump(tmp_path / "whole.dump", every=STEPS)}
        restart {STEPS} {restart} {tmp_path / "end.restart"}
        run {2 * STEPS} upto
        {PRINT_STRAIN}""",
        tmp_path,
        ranks_before,
    )
    out_again = run_lmp_well(
        f"""{load_plugin()}
        read_restart {restart}
        {after_restart()}
        {flow}
        {dump(tmp_path / "half.dump", every=STEPS)}
        run {STEPS}
        {PRINT_STRAIN}""",
        tmp_path,
        ranks_after,
    )
    middle, expected = states_from_dump(tmp_path / "whole.dump", packing)
    again, found = states_from_dump(tmp_path / "half.dump", packing)
    assert out_again.split("strain ")[-1].split()[0] == out.split("strain ")[-1].split()[0]
    for other, whole in ((again, middle), (found, expected)):
        assert other.packing.step == whole.packing.step
        np.testing.assert_array_equal(other.packing.box.edges, whole.packing.box.edges)
        np.testing.assert_array_equal(other.packing.box.lo, whole.packing.box.lo)
    np.testing.assert_array_equal(again.quaternion, middle.quaternion)
    assert pose_differences(again, middle)[0] < 1e-15
    assert np.abs(unwrapped(expected) - unwrapped(middle)).max() > 1e-4
    distance = np.abs(unwrapped(found) - unwrapped(expected)).max() / found.packing.box.edges[0]
    angle = angle_between(found.quaternion, expected.quaternion).max()
    measured(distance=distance, angle=angle)
    assert distance < 1e-13
    assert angle < (1e-13 if is_rods else 1e-12)
    with restarted(restart, after_restart()) as session:
        session.commands("pair_coeff * * 1.7\nrun 0")  # exponents stay
        assert difference_from_library(state_of(session, packing), sides, 1.7) < 1e-12


def unwrapped(state):
    packing = state.packing
    return packing.position + packing.image * packing.box.edges


@EVERY
def test_a_restart_goes_on_to_the_last_bit(case):
    packing = squeezed(case, overlap=0.002)
    settings = Compression(kappa=1e-3, phi_end=1.02 * packing.phi, dt=0.1, sides=SIDES,
                           integrator="rkc2")  # fmt: skip
    ends = []
    with Session() as session:
        run = CompressionRun(session, settings, packing)
        half = run.last_step // 2
        run.advance(half)
        checkpoint = run.mark()
        middle = run.packing()
        run.advance(run.last_step)
        ends.append((run.packing(), run.measure()))
    with Session() as session:
        run = CompressionRun(session, settings, packing, checkpoint)
        assert session.step == half > 3
        assert_same_bits(run.packing(), middle)
        run.advance(run.last_step)
        ends.append((run.packing(), run.measure()))
    (one, measured_one), (other, measured_other) = ends
    assert_same_bits(one, other)
    for name in ("phi", "u", "pressure", "z", "fmax", "strain"):
        assert measured_one[name] == measured_other[name], name
    assert np.abs(one.position - middle.position).max() > 1e-6


def assert_same_bits(one, other):
    for name in ("position", "orientation", "diameters", "form", "species", "id", "step"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    for name in ("lo", "edges"):
        np.testing.assert_array_equal(getattr(one.box, name), getattr(other.box, name))


# --- files ---------------------------------------------------------------------------------------


@EVERY
def test_data_files_and_dumps_come_back(case, tmp_path):
    packing = with_odd_ids(pressed(case), 3)
    ours, theirs, path = (tmp_path / name for name in ("ours", "theirs", "dump"))
    write_data(ours, packing)
    with loaded(packing, tmp_path, **OF_EVERY_SHAPE) as session:
        session.commands(f"""
            compute poses all property/atom {POSE}
            dump poses all custom 1 {path} c_poses[*]
            dump_modify poses format float %.17g
            run 0
            write_data {theirs}""")
    columns = " ".join(f"c_poses[{k}]" for k in range(1, 16))
    text = path.read_text()
    assert columns in text
    path.write_text(text.replace(columns, POSE))
    in_lammps = packing.with_(species=packing.shape.style(packing, packing.law).types)
    assert_same_packing(read_data(ours), packing)
    name, dimension = packing.shape_style, packing.dimension
    with warnings.catch_warnings(action="ignore"):  # exponents, which LAMMPS does not write
        assert_same_packing(read_data(theirs, dimension, name), in_lammps)
        if packing.shape.has_form:  # LAMMPS's own columns do not hold it
            with pytest.raises(FileFormatError, match=f"has no forms, which a {name} needs"):
                read_dump(path, dimension, name)[-1]
        else:
            assert_same_packing(read_dump(path, dimension, name)[-1], in_lammps)


def assert_same_packing(found, written):
    """Poses and sizes to rounding, and the same energy with the exponents, which LAMMPS does not write."""
    expected = written.sorted_by_id()
    np.testing.assert_array_equal(found.id, expected.id)
    np.testing.assert_array_equal(found.species, expected.species)
    place, there = (x.position + x.image * x.box.edges for x in (found, expected))
    np.testing.assert_allclose(place, there, rtol=0, atol=8 * EPS * np.abs(there).max())
    np.testing.assert_allclose(found.axes, expected.axes, rtol=0, atol=8 * EPS)
    np.testing.assert_allclose(found.diameters, expected.diameters, rtol=8 * EPS)
    np.testing.assert_allclose(found.box.edges, expected.box.edges, rtol=8 * EPS)
    assert found.shape_style == written.shape_style
    if written.shape.has_form:
        np.testing.assert_array_equal(found.form, expected.form)
    told = found.with_(form=expected.form)
    assert energy_of(told) == close_to(energy_of(expected), 1e-12)


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("case", "ranks"),
    [pytest.param(case, ranks, marks=() if (ranks == 2) == (case in ONE_OF_EACH) else pytest.mark.validate)
     for case in TYPICAL for ranks in (1, 2)],
    ids=str,
)  # fmt: skip
def test_coinciding_particles_stop_the_run(case, ranks, tmp_path):
    packing = packing_of(str(case))
    rows = np.arange(packing.n)
    rows[1] = 0
    names = ("position", "orientation", "diameters", "form", "species", "image")
    doubled = packing.with_(**{name: getattr(packing, name)[rows] for name in names})
    text = f"{load_plugin()}\n{scene(doubled, tmp_path / 's.data')}\nrun 0"
    sentence = error_of(run_lmp(text, tmp_path, ranks))
    i, j = packing.id[:2]
    assert any(
        re.fullmatch(
            rf"pair_style {case.shape}/harmonic found atoms {a} and {b} with ((crossing spines or )?coinciding centres|"
            "coinciding discs(, or more than 16 pairs of discs that touch)?|overlapping cores), where no contact force exists: start from a state without overlap, "
            r"or use a smaller timestep\.",
            sentence,
        )
        for a, b in ((i, j), (j, i))
    ), sentence


@pytest.mark.parametrize(
    "shape", [name for name, shape in SHAPES.items() if isinstance(shape, ElongatedShape)]
)
def test_other_shapes_are_refused(shape, tmp_path):
    text = scene(packing_of(f"{shape}-2D-0"), tmp_path / "s.data")
    sentence = refusal_of(f"{text}\nset atom * shape 1.0 2.0 3.0\nrun 0")
    assert f"with diameters 1 2 3, expected that a {shape} has diameters" in sentence
