"""Packings of any shape in LAMMPS, in this process or in one of several ranks."""

from __future__ import annotations

import os
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from lammps_scenes import load_plugin, run_lmp_well

from jamshape.files.lammps_text import write_data
from jamshape.lammps.session import Session
from jamshape.shapes.shape import Interaction

# An error of LAMMPS ends this process: LAMMPS_SCREEN=1 with `pytest -s` shows its sentence.
SHOW = "LAMMPS_SCREEN" in os.environ

THERMO = """
    compute packing all packing
    thermo_style custom step pe press pxx pyy pxy c_packing[1]
    thermo_modify norm no lost error format float %.17g"""

_FORCES = "id fx fy fz tqx tqy tqz"
OUTPUT = f"compute forces all property/atom {_FORCES}\n{THERMO}"


@contextmanager
def holding(packing, law, newton="on"):
    """A LAMMPS instance that holds a packing and its pair style."""
    with Session(screen=SHOW) as session:
        session.commands(f"newton {newton}")
        session.load(packing)
        session.interact(law)
        session.commands(neighbours_of(packing))
        session.commands(OUTPUT)
        yield session


def neighbours_of(packing):
    """As `Session.neighbours`, for any IDs."""
    return f"""neighbor {0.3 * float(packing.diameters.min())!r} bin
        neigh_modify every 1 delay 0 check yes one 10000 page 1000000"""


def forces_of(session):
    """Force and torque of each particle at the last step, in the order of the IDs."""
    per_atom, array = 1, 2
    table = session.lmp.numpy.extract_compute("forces", per_atom, array)
    return split(table.copy(), int(session.lmp.extract_setting("dimension")))


def split(table, dimension):
    """Force and torque from a table with the columns of `_FORCES`."""
    table = table[np.argsort(table[:, 0])]
    force, torque = table[:, 1:4], table[:, 4:]
    if dimension == 2:
        assert not force[:, 2].any()
        assert not torque[:, :2].any()
        return force[:, :2], torque[:, 2]
    return force, torque


def vector_of(session, compute):
    style_global, vector = 0, 1
    return session.lmp.numpy.extract_compute(compute, style_global, vector).copy()


def fix_value(session, fix, element):
    """Element of a fix's vector, counted from 1."""
    style_global, vector = 0, 1
    return session.lmp.extract_fix(fix, style_global, vector, element - 1, 0)


def scene(packing, data, law, newton="on"):
    """Input for a process of its own, to the first forces."""
    style = packing.shape.style(packing, law)
    write_data(data, packing.with_(species=style.types))
    return f"""
        clear
        {load_plugin()}
        newton {newton}
        units lj
        dimension {packing.dimension}
        atom_style ellipsoid
        atom_modify map array
        read_data {data}
        {style.commands}
        {neighbours_of(packing)}
        {THERMO}
        dump forces all custom 1 {data}.forces {_FORCES}
        dump_modify forces format float %.17g
        run 0"""


def on_ranks(inputs, folder, ranks=2):
    """Run scenes, by name, one after another in one process of so many ranks.

    Returns energy, pressure, forces and torques of each, by name.
    """
    text, data = "", {name: Path(folder) / f"{k}.data" for k, name in enumerate(inputs)}
    for name, (packing, law, newton) in inputs.items():
        text += scene(packing, data[name], law, newton)
        text += f'\nprint "$(pe:%.17g) $(press:%.17g)" append {folder}/thermo'
    run_lmp_well(text, folder, ranks)
    thermo = np.loadtxt(Path(folder) / "thermo", ndmin=2)
    found = {}
    for (name, (packing, _, _)), row in zip(inputs.items(), thermo, strict=True):
        table = np.loadtxt(f"{data[name]}.forces", skiprows=9, ndmin=2)
        found[name] = *row, *split(table, packing.dimension)
    return found


def law_of(sides, k_e=1.7):
    return Interaction(k_e, sides)
