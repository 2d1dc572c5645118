"""LAMMPS for the tests: `lmp` in processes of its own, instances in this one, and the states that they reach."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jamshape.contacts import find_contacts, forces, sum_forces
from jamshape.files.lammps_text import write_data
from jamshape.lammps.module import LammpsError
from jamshape.lammps.plugin import built_for, plugin_path
from jamshape.lammps.session import Session
from jamshape.packing import Box, Packing, angle_from_quaternion
from jamshape.shapes.shape import Interaction

REPOSITORY = Path(__file__).parents[1]
# LAMMPS_SCREEN=1 with `pytest -s` shows what instances in this process say.
SHOW = "LAMMPS_SCREEN" in os.environ

SIDES = {"one": 1, "two": 2}

POSE = "id type x y z ix iy iz quatw quati quatj quatk shapex shapey shapez"
FORCE = "fx fy fz tqx tqy tqz"

# Open MPI of Debian wants to be told that ranks may be more than cores; MPICH of the wheel does not know the word. Where
# they are more, ranks that wait yield by themselves; made to yield elsewhere, too, they got a core back so late on new
# kernels that a message took 0.1 s beside other tests. mpirun needs the folder that ./run test denies single processes.
IS_MPICH = Path(shutil.which("mpirun") or "mpirun").with_name("mpichversion").is_file()
MPIRUN = [
    *("env", "--unset", "OMPI_MCA_orte_create_session_dirs", "mpirun"),
    *([] if IS_MPICH else ["--oversubscribe"]),
]
OF_DEBIAN_12 = 20210929
QUIET = ("-nocite", "-log", "none")
ENVIRONMENT = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMP_NUM_THREADS": "1",
}


# --- input ---------------------------------------------------------------------------------------

# Columns of compute contact/local: those of every bond, then the lever arm from the particle itag.
BONDS = [
    "itag", "jtag", "kind", "bond", "dist", "sumrad", "overlap", "fx", "fy", "fz", "nx", "ny", "nz",
    "cx", "cy", "cz", "energy", "sidei", "sidej", "stiffness", "rx", "ry", "rz",
]  # fmt: skip


def before_box(dimension, newton="on", extra=""):
    return f"""
        units lj
        dimension {dimension}
        boundary p p p
        newton {newton}
        atom_style ellipsoid
        atom_modify map array
        {extra}"""


def after_restart(skin=0.3):
    """Input for all that a restart file does not hold."""
    return f"""
        neighbor {skin} bin
        neigh_modify every 1 delay 0 check yes one 10000 page 1000000
        thermo_modify norm no
        compute state all property/atom {POSE} {FORCE}"""


def load_plugin():
    return f'include "{REPOSITORY}/inputs/load_plugin.lmp"'


def scene(packing, data, *, newton="on", extra="", sides="one", k_e=1.0, general="", skin=0.3):
    """Input from the start to the pair style, for a data file that is written here."""
    style = packing.shape.style(packing, Interaction(k_e, SIDES[sides]))
    write_data(data, packing.with_(species=style.types))
    command, *coefficients = style.commands.splitlines()
    return "\n".join([
        before_box(packing.dimension, newton, extra), "box tilt large" if packing.box.is_tilted else "", f"read_data {data}",
        f"{command} {general}".strip(), *coefficients, after_restart(skin),
    ])  # fmt: skip


def dump(path, every=1):
    """Input that dumps states with all digits."""
    return f"""
        dump dumped all custom {every} {path} c_state[*]
        dump_modify dumped format float %.17g"""


# --- runs ----------------------------------------------------------------------------------------


def environment():
    return {**os.environ, **ENVIRONMENT, "JAMSHAPE_PLUGIN": str(plugin_path())}


def bare_environment(**more):
    """Without anything that leads to the jamshape of the tests."""
    hints = ("JAMSHAPE_PLUGIN", "VIRTUAL_ENV", "CONDA_PREFIX", "PYTHONPATH")
    kept = {k: v for k, v in os.environ.items() if k not in hints}
    here = str(Path(sys.executable).parent)  # LAMMPS's Python looks for its packages along PATH
    path = os.pathsep.join(x for x in kept["PATH"].split(os.pathsep) if x != here)
    return kept | {"PATH": path} | ENVIRONMENT | more


def run_program(line, cwd, env=None, **named):
    """A process of its own, its standard error with standard output."""
    return subprocess.run(
        list(map(str, line)), cwd=cwd, env=env or environment(), text=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, timeout=300, check=False, **named,
    )  # fmt: skip


def start_lmp(*words, cwd, ranks=1, lmp="lmp", mpirun=MPIRUN, **named):
    """`lmp` with these arguments on several ranks."""
    several = [*mpirun, "-np", ranks] if ranks > 1 else []
    return run_program([*several, lmp, *words], cwd, **named)


def run_lmp(text, folder, ranks=1):
    """`lmp` with this input."""
    with tempfile.NamedTemporaryFile("w", dir=folder, suffix=".in", delete=False) as file:
        file.write("\n".join(line.strip() for line in text.strip().splitlines()) + "\n")
    return start_lmp(*QUIET, "-in", file.name, cwd=folder, ranks=ranks)


def run_lmp_well(text, folder, ranks=1):
    done = run_lmp(text, folder, ranks)
    assert done.returncode == 0, done.stdout[-3000:]
    return done.stdout


def complaints_of(done):
    """The lines in which LAMMPS or Python tells of an error."""
    found = re.findall("^.*(?:ERROR|Error|Traceback).*$", done.stdout, re.MULTILINE)
    # Open MPI 5 may tell, too, that it could not reach a rank that has ended.
    return [line for line in found if not re.match(r"\[\S+:\d+\] PMIX ERROR: ", line)]


def error_of(done):
    """The sentence with which LAMMPS stopped: one, on one line, without the place in its source."""
    assert done.returncode != 0, done.stdout[-3000:]
    lines = [re.match(r"ERROR(?: on proc \d+)?: (.*)", line) for line in done.stdout.splitlines()]
    (found,) = [line for line in lines if line]
    return re.sub(r" \(\S+:\d+\)$", "", found[1])


def refusal_of(text):
    """The sentence with which LAMMPS refuses this input, in an instance in this process."""
    with Session(screen=SHOW) as session:
        try:
            session.commands(text)
        except LammpsError as error:
            return str(error)
    raise AssertionError


def refusals(value, sentence):
    """What may be said of a number: newer LAMMPS refuses those beyond all doubles before we see them."""
    too_large = f"Floating point number {value} in input script or data file is out of range"
    return {sentence, too_large} if np.isinf(float(value)) else {sentence}


@contextmanager
def loaded(packing, folder, **keywords):
    """A LAMMPS instance in this process that holds a packing and its pair style."""
    with Session(screen=SHOW) as session:
        session.commands(scene(packing, Path(folder) / "scene.data", **keywords))
        yield session


@contextmanager
def restarted(path, text):
    """A LAMMPS instance in this process that goes on from a restart file."""
    # After 29Sep2021 LAMMPS puts positions back into the box, in a tilted one with an error of rounding.
    exactly = "noremap" if built_for() > OF_DEBIAN_12 else ""
    with Session(screen=SHOW) as session:
        session.commands(f"read_restart {path} {exactly}\n{text}")
        yield session


# --- what came out -------------------------------------------------------------------------------


@dataclass(frozen=True)
class State:
    """Rows in the order of the IDs; quaternions as LAMMPS holds them."""

    packing: Packing
    quaternion: np.ndarray
    force: np.ndarray
    torque: np.ndarray


def state_from(table, lo, hi, step=0, like=None, tilt=(0.0, 0.0, 0.0)):
    """State of a table with the columns POSE and FORCE, of rods or of particles like these.

    The tilt is xy, xz, yz, as in files of LAMMPS.
    """
    table = table[np.argsort(table[:, 0])]
    D = 2 if (lo[2], hi[2]) == (-0.5, 0.5) else 3
    lo, hi = np.array(lo[:D]), np.array(hi[:D])
    quaternion, force, torque = table[:, 8:12], table[:, 15:18], table[:, 18:21]
    if D == 2:
        for zero in (table[:, 4], quaternion[:, 1:3], force[:, 2], torque[:, :2]):
            assert not zero.any(), "2D: z and rotations out of the plane are exactly zero"
        torque = torque[:, 2]
    known = {}
    if like is not None:
        known = {"shape_style": like.shape_style, "form": like.sorted_by_id().form}
    packing = Packing(
        position=table[:, 2 : 2 + D],
        orientation=angle_from_quaternion(quaternion) if D == 2 else quaternion,
        diameters=table[:, 12:15],
        species=table[:, 1].astype(int),
        id=table[:, 0].astype(int),
        image=table[:, 5 : 5 + D].astype(int),
        box=Box(lo=lo, edges=hi - lo, tilt=tilt[: 1 if D == 2 else 3]),
        step=step,
        **known,
    )
    return State(packing, quaternion, force[:, :D], torque)


def state_of(session, like=None):
    """State and forces of the last run."""
    per_atom, array = 1, 2
    table = session.lmp.numpy.extract_compute("state", per_atom, array)
    lo, hi, xy, yz, xz = session.lmp.extract_box()[:5]
    return state_from(table.copy(), lo, hi, session.step, like, (xy, xz, yz))


def states_from_dump(path, like=None):
    """States of the frames that `dump` made LAMMPS write."""
    states = []
    for text in Path(path).read_text().split("ITEM: TIMESTEP\n")[1:]:
        lines = text.splitlines()
        step, n = int(lines[0]), int(lines[2])
        bounds = np.array([line.split() for line in lines[4:7]], dtype=float)
        table = np.array([line.split() for line in lines[8 : 8 + n]], dtype=float)
        lo, hi = map(tuple, bounds.T)
        states.append(state_from(table, lo, hi, step, like))
    return states


def global_vector(session, compute):
    style_global, vector = 0, 1
    return session.lmp.numpy.extract_compute(compute, style_global, vector).copy()


def local_rows(session, compute, width):
    style_local, array = 2, 2
    found = session.lmp.numpy.extract_compute(compute, style_local, array)
    return found.copy().reshape(-1, width)


def fix_vector(session, fix, element):
    """Element of a fix's global vector, counted from 1 as in input files."""
    style_global, vector = 0, 1
    return session.lmp.extract_fix(fix, style_global, vector, element - 1, 0)


def library_forces(state, sides="one", k_e=1.0):
    return forces(state.packing, k_e, SIDES[sides])


def difference_from_library(state, sides="one", k_e=1.0):
    """Largest difference of forces and of torques, relative to the largest of a contact."""
    return difference_from(find_contacts(state.packing, k_e, SIDES[sides]), state)


def difference_from(network, state, least_torque=1e-3):
    """As `difference_from_library`, of these contacts; torques at least relative to forces at this arm.

    The arm is in smallest diameters: torques of nearly round particles are rounding.
    """
    expected = sum_forces(state.packing, network)
    force = np.abs(network.force).max(initial=0.0) or 1.0
    torque = np.abs([network.torque_i, network.torque_j]).max(initial=0.0)
    torque = max(torque, least_torque * state.packing.diameters.min() * force)
    return max(
        np.abs(state.force - expected.force).max() / force,
        np.abs(state.torque - expected.torque).max() / torque,
    )
