"""Packings of superellipsoids, and LAMMPS instances that hold them."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from pathlib import Path

import lammps_scenes
from lammps_scenes import after_restart, before_box

sys.path.insert(0, str(Path(__file__).parents[2] / "analysis"))

import stability_shapes
from stability_shapes import SCENES, crowd, exponents_of, far_apart, particles, tiny_box

from jamshape.files.lammps_text import write_data
from jamshape.lammps.session import Session

__all__ = ["SCENES", "crowd", "exponents_of", "far_apart", "particles", "tiny_box"]

EPSILON = 1.7


# --- input ---------------------------------------------------------------------------------------


def pair_commands(packing, epsilon=EPSILON):
    return stability_shapes.pair_commands(packing, epsilon)


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
    """Energy, forces and torques from the bindings, rows as the packing's."""
    return stability_shapes.sums(packing, epsilon)


def difference_from_bindings(state, epsilon=EPSILON):
    """Largest difference of forces and of torques, relative to the largest."""
    return stability_shapes.difference(state.packing, state.force, state.torque, epsilon)
