"""Crowds of particles of any shape: in LAMMPS, and as the compiled classes see them.

Nothing here knows more of a shape than its pair style, its class and the sizes to draw.
"""

from __future__ import annotations

import functools
import itertools
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from lammps_scenes import SHOW, after_restart, before_box

from jamshape import _contact
from jamshape.lammps.session import Session

K_E = 1.7


@dataclass(frozen=True)
class Kind:
    """A shape: its class, the pair style and how sizes of particles are drawn."""

    compiled: type
    style: str
    draw: object

    @property
    def command(self):
        return f"pair_style {self.style}"


def long_along_x(rng, n):
    """A / R up to 1.5; every fifth is round."""
    R = rng.uniform(0.35, 0.45, n)
    A = R * rng.uniform(0.2, 1.5, n) * (np.arange(n) % 5 > 0)
    return 2 * np.column_stack([A + R, R, R]), np.ones(n)


def of_two_exponents(rng, n):
    exponent = np.where(np.arange(n) % 2, 2.0, 1.0)
    return rng.uniform(0.7, 1.3, (n, 3)), exponent


KINDS = {
    "spherocylinder": Kind(
        _contact.Spherocylinders, "spherocylinder/harmonic sides two", long_along_x
    ),
    "superellipsoid": Kind(_contact.Superellipsoids, "superellipsoid/harmonic", of_two_exponents),
    "dimer": Kind(_contact.Dimers, "dimer/harmonic", long_along_x),
}


@dataclass(frozen=True)
class Crowd:
    """N particles in a periodic box about the origin; rows in the order of the IDs, from 1."""

    shape: str
    position: np.ndarray  # (N, D)
    orientation: np.ndarray  # (N, 1) angles or (N, 4) quaternions
    diameters: np.ndarray
    exponent: np.ndarray
    edges: np.ndarray

    @property
    def n(self):
        return len(self.position)

    @property
    def dimension(self):
        return len(self.edges)

    @property
    def compiled(self):
        kind = KINDS[self.shape].compiled
        return kind(self.diameters, self.exponent, self.dimension, K_E, 2)

    @property
    def poses(self):
        """Without rests, as the classes take them."""
        arrays = (self.position, self.orientation, np.diag(self.edges))
        return tuple(np.stack([x, np.zeros_like(x)]) for x in arrays)

    def pairs(self, margin=0.0):
        """All pairs and images that may be closer than a margin, each once: (M, 2) and (M, D)."""
        D = self.dimension
        i, j = np.tril_indices(self.n)
        found = []
        for shift in itertools.product((-1, 0, 1), repeat=D):
            rows = (i != j) | (shift > (0,) * D)
            found.append((np.stack([i, j], 1)[rows], np.tile(shift, (rows.sum(), 1))))
        pairs, shift = (np.concatenate(x) for x in zip(*found, strict=True))
        near = self.compiled.near(*self.poses, pairs, shift, margin)
        return pairs[near], shift[near]

    def sums(self):
        return self.compiled.sums(*self.poses, *self.pairs(), False)

    def contacts(self):
        pairs, shift = self.pairs()
        found = self.compiled.contacts(*self.poses, pairs, shift)
        return found | {"particles": pairs[found["pair"]]}

    @property
    def types(self):
        """Exponents are of types."""
        return 1 + np.unique(self.exponent, return_inverse=True)[1]

    @property
    def quaternions(self):
        if self.dimension == 3:
            return self.orientation
        half, zero = self.orientation[:, 0] / 2, np.zeros(self.n)
        return np.column_stack([np.cos(half), zero, zero, np.sin(half)])


def split_data(crowd):
    """Text of a data file of LAMMPS, with all digits."""
    n, D = crowd.n, crowd.dimension
    edges = crowd.edges if D == 3 else np.append(crowd.edges, 1.0)
    position = crowd.position if D == 3 else np.column_stack([crowd.position, np.zeros(n)])
    lines = ["crowd", "", f"{n} atoms", f"{n} ellipsoids", f"{crowd.types.max()} atom types", ""]
    lines += [f"{-e / 2:.17g} {e / 2:.17g} {x}lo {x}hi" for x, e in zip("xyz", edges, strict=True)]
    lines += ["", "Atoms # ellipsoid", ""]
    for k in range(n):
        lines.append(f"{k + 1} {crowd.types[k]} 1 1.0 {numbers(position[k])}")
    lines += ["", "Ellipsoids", ""]
    for k in range(n):
        lines.append(f"{k + 1} {numbers(crowd.diameters[k])} {numbers(crowd.quaternions[k])}")
    return "\n".join(lines) + "\n"


def numbers(values):
    return " ".join(f"{x:.17g}" for x in values)


def scene(crowd, data, *, newton="on", general=""):
    """Input from the start to the pair style, for a data file that is written here."""
    Path(data).write_text(split_data(crowd))
    coefficients = [f"pair_coeff * * {K_E}"]
    if np.any(crowd.exponent != 1.0):
        for k, p in enumerate(np.unique(crowd.exponent), 1):
            coefficients.append(f"pair_coeff {k} {k} {K_E} {p:.17g}")
    return "\n".join([
        before_box(crowd.dimension, newton), f"read_data {data}",
        f"{KINDS[crowd.shape].command} {general}", *coefficients, after_restart(),
    ])  # fmt: skip


@contextmanager
def loaded(crowd, folder, **keywords):
    """A LAMMPS instance in this process that holds a crowd and its pair style."""
    with Session(screen=SHOW) as session:
        session.commands(scene(crowd, Path(folder) / "scene.data", **keywords))
        yield session


@dataclass(frozen=True)
class Found:
    """What LAMMPS holds of a crowd: the same particles where they are now, forces and torques."""

    crowd: Crowd
    force: np.ndarray
    torque: np.ndarray


def found_in(table, edges, crowd):
    """From a table of compute property/atom with the columns of `lammps_scenes`."""
    table = table[np.argsort(table[:, 0])]
    D = crowd.dimension
    quaternion = table[:, 8:12]
    orientation = quaternion
    if D == 2:
        assert not np.any(table[:, [4, 9, 10, 17, 18, 19]]), "what leaves the plane is zero"
        orientation = 2 * np.arctan2(quaternion[:, 3:], quaternion[:, :1])
    now = replace(
        crowd,
        position=np.ascontiguousarray(table[:, 2 : 2 + D]),
        orientation=np.ascontiguousarray(orientation),
        edges=np.array(edges[:D]),
    )
    return Found(now, table[:, 15 : 15 + D], table[:, 20:] if D == 2 else table[:, 18:])


def found_by(session, crowd):
    per_atom, array = 1, 2
    table = session.lmp.numpy.extract_compute("state", per_atom, array).copy()
    lo, hi = session.lmp.extract_box()[:2]
    return found_in(table, np.subtract(hi, lo), crowd)


def frames_of(path, crowd):
    """Of the frames that `lammps_scenes.dump` made LAMMPS write."""
    found = []
    for text in Path(path).read_text().split("ITEM: TIMESTEP\n")[1:]:
        lines = text.splitlines()
        bounds = np.array([line.split() for line in lines[4:7]], dtype=float)
        table = np.array([line.split() for line in lines[8 : 8 + crowd.n]], dtype=float)
        found.append(found_in(table, bounds[:, 1] - bounds[:, 0], crowd))
    return found


def difference_from_class(found):
    """Largest difference of forces and of torques, relative to the largest or what K_E / 1000 gives.

    Sizes are about 1; forces that have nearly vanished are differences of coordinates.
    """
    expected = found.crowd.sums()
    assert expected["crossing"] == expected["unconverged"] == -1
    return max(
        np.abs(there - here).max() / max(np.abs(here).max(), 1e-3 * K_E)
        for there, here in ((found.force, expected["force"]), (found.torque, expected["torque"]))
    )


@functools.cache
def crowd_of(shape, dimension, n=36, spacing=0.95, seed=1):
    """On a jittered lattice, turned at random, with deep and shallow overlaps but none too deep.

    Positions and box are multiples of 2^-30, so that periodic images are exact.
    """
    rng = np.random.default_rng(seed)
    side = int(np.ceil(n ** (1 / dimension)))
    sites = rng.permutation(side**dimension)[:n]
    cells = np.stack(np.unravel_index(sites, (side,) * dimension), axis=1)
    jitter = rng.uniform(-0.1, 0.1, cells.shape)
    position = on_grid(spacing * (cells + 0.5 - side / 2 + jitter))
    turn = rng.normal(size=(n, 4)) if dimension == 3 else rng.uniform(-3, 3, (n, 1))
    if dimension == 3:
        turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    diameters, exponent = KINDS[shape].draw(rng, n)
    edges = on_grid(np.full(dimension, side * spacing))
    crowd = Crowd(shape, position, turn, diameters, exponent, edges)
    return untangled(crowd, rng)


def on_grid(x):
    return 2.0**-30 * np.round(2.0**30 * x)


def untangled(crowd, rng):
    """Particles that cross others turned and made smaller until none do."""
    for _ in range(200):
        pairs, shift = crowd.pairs()
        status = crowd.compiled.contacts(*crowd.poses, pairs, shift)
        crossing = np.unique(pairs[status["pair"][status["status"] != 1]])
        if len(crossing) == 0:
            return crowd
        diameters, turn = crowd.diameters.copy(), crowd.orientation.copy()
        diameters[crossing] *= 0.95
        new = rng.normal(size=turn[crossing].shape)
        turn[crossing] = (
            new / np.linalg.norm(new, axis=1, keepdims=True) if turn.shape[1] == 4 else new
        )
        crowd = replace(crowd, diameters=diameters, orientation=turn)
    raise AssertionError
