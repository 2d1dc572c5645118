"""Packings of superellipsoids, and LAMMPS instances that hold them."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path

import lammps_scenes
import numpy as np
from lammps_scenes import after_restart, before_box

from jamshape.lammps_files import write_data
from jamshape.landscape import State
from jamshape.packing import Box, Packing
from jamshape.session import Session
from jamshape.shapes import PairArrays, shape_of

# By type, from 1.
EXPONENTS = np.array([0.75, 1.0, 1.5, 2.0])
AXES = np.array([[0.5, 0.6, 0.8], [0.35, 0.7, 0.7], [0.6, 0.6, 0.6], [0.5, 0.5, 0.9]])
EPSILON = 1.7


def particles(position, orientation, semi_axes, exponent, edges, **fields):
    """Packing from arrays; one shape may stand for all. Each exponent is a type of its own."""
    position = np.asarray(position, float)
    n, D = position.shape
    edges = np.asarray(edges, float)
    turn = np.broadcast_to(orientation, (n,) if D == 2 else (n, 4))
    if D == 3:
        turn = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    exponent = np.broadcast_to(np.asarray(exponent, float), n)
    arrays = {
        "position": position,
        "orientation": turn,
        "diameters": 2 * np.broadcast_to(semi_axes, (n, 3)),
        "exponent": exponent,
        "species": 1 + np.unique(exponent, return_inverse=True)[1],
        "id": np.arange(1, n + 1),
        "box": Box(lo=-0.5 * edges, edges=edges),
        "shape_style": "superellipsoid",
    }
    return Packing(**(arrays | fields))


def exponents_of(packing):
    """By type."""
    table = np.ones(packing.species.max())
    table[packing.species - 1] = packing.exponent
    return table


def crowd(dimension=3, kinds=(0, 1, 2, 3), n=48, phi=0.8, seed=1, spread=0.15, *,
          shapes=(AXES, EXPONENTS)):  # fmt: skip
    """On a jittered lattice, turned at random, with deep and shallow overlaps."""
    rng = np.random.default_rng(seed)
    kind = np.array(kinds)[np.arange(n) % len(kinds)]
    side = int(np.ceil(n ** (1 / dimension)))
    sites = rng.permutation(side**dimension)[:n]
    cells = np.stack(np.unravel_index(sites, (side,) * dimension), axis=1)
    cells = cells + 0.5 + rng.uniform(-0.15, 0.15, cells.shape)
    scale = 1 + spread * rng.uniform(-1, 1, (n, 1))
    turn = rng.normal(size=(n, 4)) if dimension == 3 else rng.uniform(-4, 4, n)
    axes, exponents = map(np.asarray, shapes)
    unit = particles(cells - side / 2, turn, scale * axes[kind], exponents[kind],
                     [side] * dimension)  # fmt: skip
    edge = side * (unit.phi / phi) ** (1 / dimension)
    edge = 2.0**-20 * np.round(2.0**20 * edge)  # periodic images are then exact
    position = np.round(2.0**30 * unit.position * edge / side) / 2.0**30
    box = Box(lo=[-edge / 2] * dimension, edges=[edge] * dimension)
    return unit.with_(position=position, box=box)


def tiny_box(dimension=3, exponents=(1.5, 0.75)):
    """Two that touch their own images and several images of each other."""
    if dimension == 2:
        return particles([[0.0, 0.0], [0.25, 1.0]], [0.0, 0.3], [[1.5, 0.6, 1], [1.2, 0.5, 1]],
                         exponents, [2.5, 1.75])  # fmt: skip
    quaternion = [[1.0, 0.0, 0.02, 0.0], [1.0, 0.3, 0.0, 0.1]]
    return particles([[0, 0, 0], [0.25, 1.0, 0.1]], quaternion, [[1.5, 0.6, 0.5], [1.2, 0.5, 0.5]],
                     exponents, [2.5, 1.75, 1.0625])  # fmt: skip


def far_apart(pairs, side=8.0):
    """Pairs of bodies, rows as of `superellipsoid_bodies`, with the first body of each on a grid."""
    first, second = (np.array(rows, float) for rows in zip(*pairs, strict=True))
    at = np.zeros((len(pairs), 3))
    at[:, 0] = side * (np.arange(len(pairs)) - 0.5 * (len(pairs) - 1))
    position = np.stack([at, at + second[:, :3] - first[:, :3]], axis=1).reshape(-1, 3)
    rows = np.stack([first, second], axis=1).reshape(-1, first.shape[1])
    edges = [side * len(pairs), side, side]
    return particles(position, rows[:, 3:7], rows[:, 7:10], rows[:, 10], edges)


# --- input ---------------------------------------------------------------------------------------


def pair_commands(packing, epsilon=EPSILON):
    lines = [f"pair_coeff * * {epsilon}"]
    lines += [
        f"pair_coeff {k} {k} {epsilon} {p:.17g}" for k, p in enumerate(exponents_of(packing), 1)
    ]
    return "pair_style superellipsoid/harmonic\n" + "\n".join(lines)


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
    shape = shape_of(packing, epsilon, 2)
    near = shape.near(packing, 0.0)
    pairs = np.column_stack([near.first, near.second])
    arrays = PairArrays(*State.of(packing).split, pairs, near.shift)
    return shape.sums(arrays, extended=False)


def difference_from_bindings(state, epsilon=EPSILON):
    """Largest difference of forces and of torques, relative to the largest."""
    expected = sums(state.packing, epsilon)
    force, torque = expected["force"], expected["torque"].reshape(state.torque.shape)
    largest = np.abs(force).max() or 1.0
    return max(
        np.abs(state.force - force).max() / largest,
        # Those of spheres are rounding.
        np.abs(state.torque - torque).max() / max(np.abs(torque).max(), 1e-3 * largest),
    )
