"""Packings of superellipsoids, and LAMMPS instances that hold them."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path

import extreme_superellipsoids
import lammps_scenes
import numpy as np
from extreme_shapes import CROWDS as SCENES
from extreme_shapes import Relative
from extreme_superellipsoids import KINDS, far_apart, particles, tiny_box
from lammps_scenes import after_restart, before_box

from jamshape.contacts import find_contacts, sum_forces
from jamshape.files.lammps_text import write_data
from jamshape.lammps.session import Session
from jamshape.shapes.shape import Interaction

__all__ = ["SCENES", "crowd", "exponents_of", "far_apart", "particles", "tiny_box"]

EPSILON = 1.7


# --- input ---------------------------------------------------------------------------------------


def crowd(dimension=3, kinds=(0, 1, 2, 3), **named):
    return extreme_superellipsoids.crowd(dimension, [KINDS[k] for k in kinds], **named)


def exponents_of(packing):
    """Give them by type."""
    table = np.ones(packing.species.max())
    table[packing.species - 1] = packing.exponent
    return table


def pair_commands(packing, epsilon=EPSILON):
    return packing.shape.style(packing, Interaction(epsilon)).commands


def scene(packing, data, *, newton="on", skin=0.3, extra=""):
    write_data(data, packing)
    return f"""{before_box(packing.dimension, newton, extra)}
        read_data {data}
        {pair_commands(packing)}
        {after_restart(skin)}"""


@contextmanager
def loaded(packing, folder, **keywords):
    """A LAMMPS instance in this process that holds a packing and its pair style."""
    with Session(screen=lammps_scenes.SHOW) as session:
        session.commands(scene(packing, Path(folder) / "scene.data", **keywords))
        yield session


def state_of(session, packing):
    """State and forces of the last run, of these particles."""
    return lammps_scenes.state_of(session, exponents_of(packing))


# --- what is expected ----------------------------------------------------------------------------


def sums(packing, epsilon=EPSILON):
    """Energy, forces, torques, virial and the number of bonds from the bindings, rows as the packing's."""
    network = find_contacts(packing, epsilon)
    found = sum_forces(packing, network)
    torque = found.torque.reshape(packing.n, -1)
    both = {"force": found.force, "torque": torque, "energy": found.energy}
    return both | {"virial": found.virial, "n_bonds": int(network.n_bonds.sum())}


def difference_from_bindings(state, epsilon=EPSILON):
    """Largest difference of forces and of torques, relative to the largest."""
    packing, expected = state.packing, sums(state.packing, epsilon)
    force = Relative.force(packing, expected["force"], epsilon)
    torque = Relative.torque(packing, expected["torque"], force)
    by_force = np.abs(state.force - expected["force"]).max() / force
    wrong = state.torque.reshape(packing.n, -1) - expected["torque"]
    return max(by_force, np.abs(wrong).max() / torque)
