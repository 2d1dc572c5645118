"""Packings in LAMMPS, in this process, and their forces beside another evaluation."""

import tempfile
from contextlib import contextmanager
from typing import NamedTuple

import lammps_runs
import numpy as np
from lammps_runs import SIDES, fix_vector, global_vector, state_of

from jamshape.contacts import find_contacts, sum_forces
from jamshape.packing import Packing

SKIN = 0.3

WORDS = {number: word for word, number in SIDES.items()}

# Elements of `compute packing`, from 0.
MEASURES = {"energy": 1, "pressure": 2, "deepest": 11}

OUTPUT = """
    compute contacts all contact/local itag bond
    compute packing all packing
    thermo_style custom step c_packing[1]
    thermo_modify norm no lost error"""


def fix(kappa=0.0, dt=0.1, drag=1.0, options=""):
    drive = f"drag {drag!r} compress {kappa!r} {options}"
    return f"\nfix flow all overdamped/affine {drive}\ntimestep {dt!r}\n"


@contextmanager
def loaded(packing, text="", sides=1, skin=SKIN, **options):
    """A LAMMPS instance with a packing, its pair style and more input."""
    options |= {"sides": WORDS[sides], "skin": repr(skin)}
    with (
        tempfile.TemporaryDirectory() as folder,
        lammps_runs.loaded(packing, folder, **options) as session,
    ):
        if skin > 30:  # bins of a plane, which is one unit thick, may not be so wide
            session.commands(f"neighbor {skin!r} nsq")
        session.commands(f"{OUTPUT}\n{text}")
        yield session


class Frame(NamedTuple):
    """A state in LAMMPS in the order of the IDs; positions and quaternions to the last bit."""

    packing: Packing
    quaternion: np.ndarray
    force: np.ndarray
    torque: np.ndarray
    strain: float
    n_bonds: int


def frame(session, packing):
    state, has_fix = state_of(session, packing), session.lmp.has_id("fix", "flow")
    local, rows = 2, 4
    return Frame(
        state.packing,
        state.quaternion,
        state.force,
        state.torque.reshape(packing.n, -1),
        strain=fix_vector(session, "flow", 2) if has_fix else 0.0,
        n_bonds=session.lmp.extract_compute("contacts", local, rows),
    )


def after(packing, commands, text="", **options):
    """State of a packing after some commands."""
    with loaded(packing, text, **options) as session:
        session.commands(commands)
        return frame(session, packing)


def measured(session, name):
    return float(global_vector(session, "packing")[MEASURES[name]])


# --- beside another evaluation -------------------------------------------------------------------


def expected_of(at, shape, law, k_e=1.0):
    """Force, torque and number of bonds, from the oracle where it knows the law, else from the bindings."""
    if law.is_of_oracle:
        return shape.oracle(at.packing, k_e, at.quaternion)[:3]
    network = find_contacts(at.packing, k_e, law.sides)
    found = sum_forces(at.packing, network)
    return found.force, found.torque.reshape(at.packing.n, -1), int(network.n_bonds.sum())


def difference(at, shape, expected, k_e=1.0):
    """Largest difference of forces and of torques, in units of the shape; infinite where a bond is lost."""
    force, torque, n_bonds = expected
    if at.n_bonds != n_bonds or not (np.isfinite(at.force).all() and np.isfinite(at.torque).all()):
        return np.inf
    by_force = shape.units.force(at.packing, force.astype(float), k_e)
    by_torque = shape.units.torque(at.packing, torque.astype(float), by_force)
    return max(
        np.abs(at.force - force).max() / by_force, np.abs((at.torque - torque) / by_torque).max()
    )


def from_bindings(at, shape, law):
    return difference(at, shape, expected_of(at, shape, law._replace(is_of_oracle=False)))
