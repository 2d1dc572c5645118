"""Packings in LAMMPS: in this process, or in one of its own where it is expected to stop.

Debian's LAMMPS ends its process with an error.
"""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.files.lammps_text import write_data
from jamshape.lammps.plugin import load_script_path, plugin_path
from jamshape.lammps.session import Session
from jamshape.packing import Packing
from jamshape.shapes.shape import Interaction

SKIN = 0.3

_MPIRUN = ("mpirun", "--oversubscribe", "-np")
_MPI_AS_ROOT = ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM")

# What `compute packing` gives, from 0.
_MEASURES = {"energy": 1, "pressure": 2, "deepest": 11}


# --- input ---------------------------------------------------------------------------------------


class Setting(NamedTuple):
    """How a packing is set up in LAMMPS."""

    sides: int = 1
    """Bonds of a side-to-side contact, of shapes that have two laws."""
    k_e: float = 1.0
    skin: float = SKIN


USUAL = Setting()


def set_up(packing: Packing, setting: Setting = USUAL) -> str:
    """Input after the data file: pair style and neighbour list."""
    law = Interaction(setting.k_e, setting.sides)
    return f"{packing.shape.style(packing, law).commands}\n{neighbours(setting.skin)}"


def neighbours(skin: float = SKIN) -> str:
    """Input of the neighbour list."""
    return f"""
        neighbor {skin!r} {"bin" if skin < 30 else "nsq"}
        neigh_modify every 1 delay 0 check yes one 10000 page 1000000"""


def fix(kappa: float = 0.0, dt: float = 0.1, drag: float = 1.0, options: str = "") -> str:
    """Input of the driven dynamics."""
    told = f"drag {drag!r} compress {kappa!r} {options}"
    return f"\nfix flow all overdamped/affine {told}\ntimestep {dt!r}\n"


# --- in this process -----------------------------------------------------------------------------


OUTPUT = """
    compute packing all packing
    thermo_style custom step c_packing[1]
    thermo_modify norm no lost error"""


@contextmanager
def loaded(packing: Packing, text: str, newton: str = "on") -> Iterator[Session]:
    """LAMMPS in this process, with a packing and a compute of all it measures."""
    with Session() as session:
        session.commands(f"newton {newton}")
        session.load(packing)
        session.commands(f"{text}\ncompute contacts all contact/local itag bond{OUTPUT}")
        yield session


class Frame(NamedTuple):
    """A state in LAMMPS, sorted by ID; quaternions and positions to the last bit."""

    packing: Packing
    quaternion: FloatArray
    force: FloatArray
    torque: FloatArray
    strain: float

    @property
    def is_finite(self) -> bool:
        """Whether all forces and torques are."""
        return bool(np.isfinite(self.force).all() and np.isfinite(self.torque).all())


def frame(session: Session, like: Packing) -> Frame:
    """Read the present state of a packing that was loaded."""
    D, has_fix = like.dimension, session.lmp.has_id("fix", "flow")

    def rows(name: str, width: int) -> FloatArray:
        return np.array(session.lmp.gather(name, 1, width)).reshape(like.n, width)

    torque = rows("torque", 3)
    return Frame(
        packing=session.packing(),
        quaternion=rows("c_orient", 4),
        force=rows("f", 3)[:, :D],
        torque=torque if D == 3 else torque[:, 2:],
        strain=float(session.lmp.extract_fix("flow", 0, 1, 1)) if has_fix else 0.0,
    )


def measured(session: Session, name: str) -> float:
    """Give what `compute packing` measured last."""
    return float(session.lmp.extract_compute("packing", 0, 1)[_MEASURES[name]])


def bonds_in(session: Session) -> int:
    """Bonds that `compute contact/local` lists."""
    array = session.lmp.numpy.extract_compute("contacts", 2, 2)
    return len(np.reshape(array, (-1, 2)))


# --- in processes of their own -------------------------------------------------------------------


def run_alone(packing: Packing, text: str, folder: Path, ranks: int = 1) -> str:
    """Run a deck on a packing in a process of its own; what it said.

    Raises
    ------
    RuntimeError
        With its sentence, if it stops with one.
    """
    data, deck = folder / "start.data", folder / "case.in"
    types = packing.shape.style(packing, Interaction()).types
    write_data(data, packing.with_(species=types))
    lines = f"""
        include "{load_script_path()}"
        units lj
        dimension {packing.dimension}
        atom_style ellipsoid
        atom_modify map array
        read_data {data}
        {text}"""
    deck.write_text("\n".join(line.strip() for line in lines.strip().splitlines()) + "\n")
    command = ["lmp", "-nocite", "-log", "none", "-in", str(deck)]
    own = {"JAMSHAPE_PLUGIN": str(plugin_path()), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [*_MPIRUN, str(ranks), *command] if ranks > 1 else command,
        env=os.environ | dict.fromkeys(_MPI_AS_ROOT, "1") | own,
        cwd=folder,
        text=True,
        capture_output=True,
        timeout=120,
        check=False,
    )
    said = done.stdout + done.stderr
    if done.returncode == 0:
        return said
    found = re.findall(r"^ERROR(?: on proc \d+)?: (.*)$", said, re.MULTILINE)
    if len(found) != 1:
        msg = f"exit code {done.returncode}, {len(found)} sentences: {said[-300:]}"
        raise RuntimeError(msg)
    raise RuntimeError(re.sub(r" \(\S+:\d+\)$", "", found[0]))


def sentence(packing: Packing, text: str) -> str:
    """Run in a process of its own: the error it stops with, or that it stops with none."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            run_alone(packing, text, Path(folder))
        except subprocess.TimeoutExpired:
            return "no sentence in two minutes"
        except RuntimeError as error:
            return f"{error}"
    return "it ran, without a sentence"
