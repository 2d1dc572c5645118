"""Wrong input stops with one sentence that names what was found, what is expected and the cure."""

from __future__ import annotations

import re
import subprocess
import sys

import numpy as np
import pytest
from lammps_runs import (
    after_restart,
    before_box,
    environment,
    error_of,
    load_plugin,
    refusal_of,
    refusals,
    run_lmp,
    run_lmp_well,
    scene,
    start_lmp,
)
from lammps_scenes import rods, rods_3d
from superellipsoid_scenes import particles

from jamshape.files.lammps_text import write_data
from jamshape.lammps.plugin import built_for

pytestmark = pytest.mark.lammps

FIX = "fix drive all overdamped/affine drag 1.0 compress 1e-3"


def two_rods(**changes):
    """Side by side, not touching."""
    fields = {"position": [[0.0, 0.0], [0.5, 2.0]], "angle": [0.0, 0.3], "half_length": 1.0,
              "radius": 0.5, "edges": [12.0, 12.0]}  # fmt: skip
    return rods(**(fields | changes))


def two_bodies(**changes):
    """Superellipsoids of two types, in contact."""
    fields = {"position": [[0.0, 0, 0], [0.9, 0.3, 0.2]], "orientation": [1.0, 0.2, 0.1, -0.3],
              "semi_axes": [0.5, 0.6, 0.8], "exponent": [1.0, 1.5], "edges": [9.0] * 3}  # fmt: skip
    return particles(**(fields | changes))


@pytest.fixture
def sentence_of(tmp_path):
    """The error of an input that follows the set-up of two rods, or of other particles."""

    def run(commands, packing=None, ranks=1):
        text = f"{scene(packing or two_rods(), tmp_path / 's.data')}\n{commands}"
        if ranks == 1:
            return refusal_of(text)
        return error_of(run_lmp(f"{load_plugin()}\n{text}", tmp_path, ranks))

    return run


# --- commands ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "packing", "name"),
    [(value, two_rods(), "k_e") for value in ("0.0", "-1.0", "-0.0")]
    + [(value, two_bodies(), "epsilon") for value in ("0.0", "-1.0", "1e400")],
)
def test_stiffness_must_be_positive(value, packing, name, sentence_of):
    expected = (
        f"pair_coeff of {packing.shape.name}/harmonic found {name} = {value}, expected a positive "
        "energy: give the contacts a stiffness such as 1.0."
    )
    assert sentence_of(f"pair_coeff 1 1 {value}", packing) in refusals(value, expected)


@pytest.mark.parametrize(
    "command",
    [
        "pair_coeff 1 1 {}",
        "pair_coeff 1 1 1.0 {}",
        FIX.replace("1.0", "{}"),
        FIX.replace("1e-3", "{}"),
    ],
)
@pytest.mark.parametrize("word", ["strong", "nan", "inf", "1,5"])
def test_what_is_not_a_number_is_named(command, word, sentence_of):
    """LAMMPS's own sentence."""
    packing = two_bodies() if "1.0 {}" in command else None
    assert sentence_of(command.format(word), packing) == (
        f"Expected floating point parameter instead of '{word}' in input script or data file"
    )


@pytest.mark.parametrize("value", ["0.0", "-2.0", "1e400"])
def test_drag_must_be_positive(value, sentence_of):
    expected = f"fix overdamped/affine found drag {value}, expected a positive number."
    assert sentence_of(FIX.replace("1.0", value)) in refusals(value, expected)


def test_rate_must_be_finite(sentence_of):
    expected = "fix overdamped/affine found compress -1e400, expected a finite rate."
    assert sentence_of(FIX.replace("1e-3", "-1e400")) in refusals("-1e400", expected)


@pytest.mark.parametrize("words", ["sides three", "sides", "", "side one", "sides one two"])
def test_sides_are_one_or_two(words, sentence_of):
    found = sentence_of(f"pair_style spherocylinder/harmonic {words}")
    assert found == (
        f"pair_style spherocylinder/harmonic found '{words}', expected 'sides one' (the dynamics' "
        "single bond) or 'sides two' (two bonds for side-to-side contacts)."
    )


@pytest.mark.parametrize(
    "words", ["disable_shortcuts", "general turns", "disable_shortcuts pairs contacts"]
)
def test_general_names_what_is_turned_back_on(words, sentence_of):
    assert sentence_of(f"pair_style spherocylinder/harmonic sides one {words}") == (
        f"pair_style spherocylinder/harmonic found '{words}', expected 'disable_shortcuts' and any of "
        "rotation, pairs, contact: use it only for tests and timings."
    )


def test_a_box_may_not_shrink_past_contacts_in_a_step(sentence_of):
    found = sentence_of(FIX.replace("1e-3", "10") + "\ntimestep 0.1\nrun 1")
    assert re.fullmatch(
        "fix overdamped/affine found a strain of 1 in one step, which pushes a particle .* radii into "
        "its neighbour, expected at most half its radius: use a smaller timestep.",
        found,
    )


def test_pair_coeff_has_three_arguments(sentence_of):
    assert sentence_of("pair_coeff 1 1 1.0 0.5") == (
        "pair_coeff of spherocylinder/harmonic found 4 arguments, expected 'I J k_e'."
    )


SYNTAX = (
    "'drag k_d [compress kappa] [shear gdot] [pure edot] [gradient ...] [pressure iso START STOP] [stress ab P] [tbox T] [volume free|constant] [flip F] [integrator NAME] "
    "[tolerance T] [stages MAX] "
    "[reference center|corner] [check N]'."
)


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        (f"{FIX} integrator leapfrog", r"integrator leapfrog, expected one of: heun, .*"),
        (f"{FIX} reference middle", f"'reference middle', expected {re.escape(SYNTAX)}"),
        (f"{FIX} speed 3", f"'speed 3', expected {re.escape(SYNTAX)}"),
        (f"{FIX} integrator", f"'integrator', expected {re.escape(SYNTAX)}"),
        ("fix drive all overdamped/affine", f"wrong arguments, expected {re.escape(SYNTAX)}"),
        (
            "fix drive all overdamped/affine compress 1.0 drag 1.0",
            f"wrong arguments, expected {re.escape(SYNTAX)}",
        ),
        (
            f"{FIX} tolerance 1e-3",
            "tolerance with integrator heun, expected heun/adaptive or rkc2: leave it out or use these.",
        ),
        (f"{FIX} integrator rkc2 tolerance 0.5", r"tolerance 0\.50*, expected a number .* 0\.1\."),
        (f"{FIX} integrator rkc2 tolerance -1e-3", "tolerance -0.001.*, expected a number .*"),
        (f"{FIX} integrator rkc2 stages 1", r"stages 1, expected from 2 to 1000\."),
        (
            f"{FIX} integrator heun/adaptive stages 9",
            r"stages without integrator rkc2: leave it out or use rkc2\.",
        ),
        (f"{FIX} check -1", "check -1, expected a number of steps, or 0 for never."),
        (
            f"group one id 1\n{FIX.replace('all', 'one')}",
            "a group other than all, expected 'all', since the whole box moves: hold particles at rest in the host by 'fix setforce 0 0 0' or 'fix freeze' on their group.",
        ),
    ],
)
def test_wrong_fix_commands(command, sentence, sentence_of):
    assert re.fullmatch(f"fix overdamped/affine found {sentence}", sentence_of(command))


@pytest.mark.parametrize("integrator", ["heun", "heun/adaptive", "rkc2"])
@pytest.mark.parametrize("dt", ["0", "-0.5"])
def test_time_passes_forwards(dt, integrator, sentence_of):
    assert sentence_of(f"{FIX} integrator {integrator}\ntimestep {dt}\nrun 1") == (
        f"fix overdamped/affine found timestep {dt}, expected a positive one: to open the box, give "
        "'compress' a negative rate."
    )


def test_steps_that_cannot_be_divided(sentence_of):
    assert sentence_of(f"{FIX} integrator rkc2\ntimestep 2000\nrun 1") == (
        "fix overdamped/affine found timestep 2000, a strain of 2, expected a strain of at most 1 "
        "per step: the integrator divides the step."
    )


def test_fix_needs_a_pair_style_of_ours(sentence_of):
    assert sentence_of(f"pair_style zero 1.0\npair_coeff * *\n{FIX}\nrun 1") == (
        "fix overdamped/affine found pair_style zero, expected one of jamshape's: use "
        "'pair_style SHAPE/harmonic'."
    )
    assert sentence_of(f"pair_style none\n{FIX}\nrun 1") == (
        "fix overdamped/affine found pair_style none, expected one of jamshape's: use "
        "'pair_style SHAPE/harmonic'."
    )


def test_unset_coefficients_are_noticed(tmp_path):
    packing = two_rods(species=np.array([1, 2]))
    text = scene(packing, tmp_path / "s.data").replace("pair_coeff * *", "pair_coeff 1 1")
    # Newer LAMMPS lists them below.
    assert re.fullmatch(r"All pair coeffs are not set(\. Status:)?", refusal_of(f"{text}\nrun 0"))


# --- exponents of superellipsoids ------------------------------------------------------------------

OF_BODIES = "pair_coeff of superellipsoid/harmonic found "


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        (
            "pair_style superellipsoid/harmonic p 1.5",
            ("pair_style superellipsoid/harmonic found 'p 1.5', expected 'law LAW' or no arguments: give exponents "
            "with 'pair_coeff I I epsilon p'."),
        ),
        *((f"pair_coeff {words}",
           f"{OF_BODIES}{number} arguments, expected 'I J epsilon' or 'I I epsilon p'.")
          for words, number in (("1 1", 2),)),
        *((f"pair_coeff 1 1 1.0 {value}",
           (f"{OF_BODIES}p = {value}, expected a finite number above 0.5, or two numbers n1 n2 above 1, those of "
           "LAMMPS, where n1 = n2 = 2p is the same body: particles of other exponents are not convex."))
          for value in ("0.5", "0.0", "-2", "1e400", "1.5 1", "2 2 2")),
        *((f"pair_coeff {types} 1.0 1.5",
           (f"{OF_BODIES}p = 1.5 for types {' and '.join(types.split())}, expected p only for "
           "equal types: it belongs to a type; give it with 'pair_coeff I I epsilon p'."))
          for types in ("1 2", "1 *", "* 2", "1*2 2")),
    ],
)  # fmt: skip
def test_exponents_are_convex_and_belong_to_types(command, sentence, sentence_of):
    assert sentence_of(command, two_bodies()) in refusals(command.split()[-1], sentence)


@pytest.mark.parametrize("words", ["p 1.5", "general", "disable_shortcuts turns"])
def test_words_that_no_dimer_style_knows(words, sentence_of):
    found = sentence_of(f"pair_style dimer/harmonic {words}")
    assert found.startswith(f"pair_style dimer/harmonic found '{words}', expected ")


# --- particles that are nowhere --------------------------------------------------------------------


NO_NUMBER = "variable no atom 1e308*1e308-1e308*1e308"


@pytest.mark.parametrize(
    ("change", "run", "found"),
    [
        ("x v_no", "run 1 pre no", r"at -?nan 2 0 with quaternion \S+ 0 0 \S+"),
        ("y v_no", "run 1 pre no", r"at 0\.5 -?nan 0 with quaternion \S+ 0 0 \S+"),
        ("quat 0 0 1 v_no", "run 1 pre no", r"at 0\.5 2 0 with quaternion -?nan .*"),
        ("quat 0 0 1 v_no", "run 0", r"at 0\.5 2 0 with quaternion -?nan .*"),
    ],
)
def test_a_particle_that_is_nowhere_stops_the_run(change, run, found, sentence_of):
    commands = f"pair_coeff * * 1.0\nrun 0\n{NO_NUMBER}\nset atom 2 {change}\n{run}"
    assert re.fullmatch(
        f"pair_style spherocylinder/harmonic found atom 2 {found}, expected finite numbers: use a "
        "smaller timestep, or correct its start.",
        sentence_of(commands),
    )


# --- particles -----------------------------------------------------------------------------------


def test_atom_style_must_be_ellipsoid():
    sentence = refusal_of(f"""
        {before_box(2).replace("atom_style ellipsoid", "atom_style sphere")}
        region box block -5 5 -5 5 -0.5 0.5
        create_box 1 box
        create_atoms 1 single 0 0 0
        pair_style spherocylinder/harmonic sides one
        pair_coeff * * 1.0
        run 0""")
    assert sentence == (
        "pair_style spherocylinder/harmonic found atom_style sphere, expected ellipsoid: use "
        "'atom_style ellipsoid', behind 'suffix off' if an accelerator adds one, and give every atom a shape."
    )


def test_every_atom_needs_a_shape(sentence_of):
    assert sentence_of("create_atoms 1 single 0 4 0\nrun 0") == (
        "pair_style spherocylinder/harmonic found atom 3 without a shape, expected an ellipsoid: "
        "list it in the data file's Ellipsoids section or use 'set atom ... shape'."
    )


@pytest.mark.parametrize(
    "diameters",
    [(3.0, 1.0, 1.1), (1.0, 3.0, 1.0), (1.0, 1.0, 3.0), (1.0, 2.0, 2.0)],
    ids=["unequal short axes", "long y", "long z", "oblate"],
)
def test_shapes_must_be_spherocylinders(diameters, sentence_of):
    shape = " ".join(map(str, diameters))
    listed = " ".join(f"{d:g}" for d in diameters)
    assert sentence_of(f"set atom 2 shape {shape}\nrun 0") == (
        f"spherocylinder/harmonic found atom 2 with diameters {listed}, expected that a "
        "spherocylinder has diameters (2(A+R), 2R, 2R), its long axis the body's x: correct its "
        "shape."
    )


def plane_of_tilted(tmp_path, tilt):
    """Input for two rods of which one is rotated out of the plane, by twice this."""
    packing = rods_3d([[0, 0, 0], [0, 2, 0]], [[1, 0, 0, 0], [1, 0, tilt, 0]], 1.0, 0.5, [12] * 3)
    packing = packing.with_(box=type(packing.box)(lo=[-6, -6, -0.5], edges=[12, 12, 1]))
    write_data(tmp_path / "s.data", packing)
    return f"""{before_box(2)}
        read_data {tmp_path / "s.data"}
        pair_style spherocylinder/harmonic sides one
        pair_coeff * * 1.0
        {after_restart()}
        run 0"""


@pytest.mark.parametrize("tilt", [0.1, 1e-6])
def test_plane_needs_quaternions_about_z(tilt, tmp_path):
    assert refusal_of(plane_of_tilted(tmp_path, tilt)) == (
        "pair_style spherocylinder/harmonic found atom 2 rotated out of the plane, expected a "
        "quaternion (w, 0, 0, k) in dimension 2: rotate it about z only."
    )


@pytest.mark.parametrize("tilt", [6e-17, 1e-9])
def test_quaternions_that_rounding_leaves_out_of_the_plane_are_taken(tilt, tmp_path):
    """As those of `fix rigid`; a tilt of 2e-9 changes lengths by 2e-18."""
    run_lmp_well(f"{load_plugin()}\n{plane_of_tilted(tmp_path, tilt)}", tmp_path)


CROSSING = (
    "pair_style spherocylinder/harmonic found atoms {} and {} with crossing spines or coinciding "
    "centres, where no contact force exists: start from a state without overlap, or use a smaller "
    "timestep."
)


COINCIDING = {
    "crossing": two_rods(position=[[0.0, 0.0], [0.1, 0.2]], angle=[0.0, 1.5]),
    "same rod": two_rods(position=[[1.0, 1.0], [1.0, 1.0]], angle=0.3),
    "collinear": two_rods(position=[[1.0, 1.0], [1.5, 1.0]], angle=0.0),
    "same disc": two_rods(position=[[1.0, 1.0], [1.0, 1.0]], half_length=0.0),
    "periodic": two_rods(position=[[5.9, 0.0], [-5.9, 0.2]], angle=[0.0, 1.5]),
    "3d": rods_3d([[0, 0, 0], [0, 0, 0]], [[1, 0, 0, 0], [1, 0, 0, 1]], 1.0, 0.5, [12] * 3),
    "same sphere": rods_3d([[0, 0, 0], [0, 0, 0]], [1, 0, 0, 0], 0.0, 0.5, [12] * 3),
}


@pytest.mark.parametrize(
    ("name", "ranks"),
    [
        *((name, 1) for name in COINCIDING),
        # On two ranks one that both find, and one whose particles are on different ones.
        *(pytest.param(name, 2, marks=() if name in {"3d", "periodic"} else pytest.mark.validate)
          for name in COINCIDING),
    ],
)  # fmt: skip
def test_crossing_spines_and_coinciding_centres(name, ranks, sentence_of):
    packing = COINCIDING[name]
    found = sentence_of("run 0", packing, ranks)
    assert found in {CROSSING.format(1, 2), CROSSING.format(2, 1)}


# --- box and communication -----------------------------------------------------------------------


@pytest.mark.parametrize("boundary", ["f p p", "p s p", "p m p"])
def test_fix_needs_a_periodic_box(boundary, sentence_of):
    assert sentence_of(f"change_box all boundary {boundary}\n{FIX}\nrun 1") == (
        "fix overdamped/affine found a box that is not periodic, expected 'boundary p p p': the "
        "whole box moves."
    )


def test_pair_style_alone_needs_no_periodic_box(tmp_path):
    text = scene(two_rods(), tmp_path / "s.data")
    run_lmp_well(f"{load_plugin()}\n{text}\nchange_box all boundary f p p\nrun 0", tmp_path)


@pytest.mark.parametrize(
    ("packing", "shape"), [(two_rods(), "9.0 1.0 1.0"), (two_bodies(), "1.61 1.2 1.0")]
)
def test_shapes_that_grow_behind_our_back_are_noticed(packing, shape, sentence_of):
    """`run ... pre no` leaves out the set-up that measures shapes, by their corners, and cutoffs."""
    found = sentence_of(
        f"""neigh_modify every 1 delay 0 check no
        run 0
        set atom 2 shape {shape}
        run 1 pre no""",
        packing,
    )
    assert found == (
        f"pair_style {packing.shape.name}/harmonic found atom 2 larger than at the start of the run, "
        "so the ghost cutoff is too short: do not use 'pre no' in the run after changing shapes."
    )


def test_late_list_rebuilds_are_set_right(tmp_path):
    text = scene(two_rods(), tmp_path / "s.data")
    done = run_lmp(
        f"{load_plugin()}\n{text}\nneigh_modify every 10 delay 20\n{FIX}\nrun 1", tmp_path
    )
    assert done.returncode == 0
    warning = "fix overdamped/affine uses 'neigh_modify every 1 delay 0 check yes'"
    assert done.stdout.count(warning) == 1


# --- versions ------------------------------------------------------------------------------------


ANOTHER_BUILD = """
import ctypes
from jamshape.lammps.module import start_lammps
from jamshape.lammps.plugin import plugin_path
from jamshape.lammps.session import Session
Session().close()
plugin = ctypes.CDLL(str(plugin_path()))
{pretend}
{start}
"""
OTHER_VERSION = 'ctypes.c_int.in_dll(plugin, "jamshape_built_for").value = 20200101'
OTHER_MPI = """
built_with = ctypes.c_char_p.in_dll(plugin, "jamshape_built_with")
built_with.value = b"no MPI"
"""
BY_SESSION = "Session()"
BY_DECK = """
plugin.jamshape_register.argtypes = [ctypes.c_void_p]
lmp = start_lammps(["-log", "none"])
plugin.jamshape_register(lmp.lmp)
"""


@pytest.mark.parametrize("start", [BY_SESSION, BY_DECK], ids=["session", "deck"])
@pytest.mark.parametrize(
    ("pretend", "sentence"),
    [
        (OTHER_VERSION, r"LAMMPS version \d{8}, expected 20200101 for which"),
        (OTHER_MPI, r"the MPI library [^,]+, expected no MPI with which"),
    ],
    ids=["version", "mpi"],
)
def test_a_plugin_that_was_built_for_another_lammps_is_refused(start, pretend, sentence):
    done = subprocess.run(
        [sys.executable, "-c", ANOTHER_BUILD.format(pretend=pretend, start=start)], env=environment(),
        text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60, check=False,
    )  # fmt: skip
    again = r"this plugin was built: build jamshape again with this LAMMPS\."
    assert done.returncode != 0
    assert re.search(f"jamshape found {sentence} {again}", done.stdout), done.stdout


NEWER = """
ctypes.c_int.in_dll(plugin, "jamshape_newest_tested").value = 20200101
plugin.jamshape_register.argtypes = [ctypes.c_void_p]
lmp = start_lammps(["-log", "none"])
plugin.jamshape_register(lmp.lmp)
lmp.command("pair_style spherocylinder/harmonic sides one")
print("goes on")
"""


def test_a_lammps_newer_than_the_tests_is_told_in_one_line(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", ANOTHER_BUILD.format(pretend="", start=NEWER)], env=environment(),
        text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    told = f"jamshape was built for LAMMPS {built_for()}, newer than 20200101, the newest of its tests: its checks at "
    # Wheels load the plugin whenever LAMMPS starts.
    assert set(re.findall("^jamshape .*$", done.stdout, re.MULTILINE)) == {f"{told}loading passed."}
    assert "goes on" in done.stdout
    silent = run_lmp_well(f"{load_plugin()}\nprint 'goes on'", tmp_path)
    assert "jamshape was built" not in silent


@pytest.mark.parametrize(
    ("answer", "sentence"),
    [
        (
            "lammps_extract_setting(void *handle, const char *name) { return name[0] == 't' ? 8 : -1; }",
            (
                r"jamshape read 4 as 'tagint' of LAMMPS \d{8}, expected 8: its headers are not those with which this "
                r"plugin was built; build jamshape again with this LAMMPS\."
            ),
        ),
        (
            "lammps_has_style(void *handle, const char *kind, const char *name) { return kind[0] != 'f'; }",
            (
                r"jamshape added the fix style overdamped/affine to LAMMPS, which does not list it, expected a LAMMPS "
                r"that does: use version \d{8} or an older one\."
            ),
        ),
    ],
    ids=["layout", "styles"],
)
def test_a_lammps_laid_out_otherwise_is_refused(answer, sentence, tmp_path):
    """Functions of LAMMPS's library that answer as those of such a version would."""
    (tmp_path / "answer.c").write_text(f"int {answer}")
    made = ["cc", "-shared", "-fPIC", "-w", "answer.c", "-o", "answer.so"]
    subprocess.run(made, cwd=tmp_path, check=True)
    (tmp_path / "own.in").write_text(f"{load_plugin()}\nprint 'goes on'\n")
    done = start_lmp(
        "-in",
        "own.in",
        cwd=tmp_path,
        env=environment() | {"LD_PRELOAD": str(tmp_path / "answer.so")},
    )
    assert error_of(done)
    assert re.search(sentence, done.stdout), done.stdout  # in a wheel a warning where LAMMPS starts
    assert "goes on" not in done.stdout.splitlines()
