"""Scenes of every shape of the table, in the plane and in space; nothing here names one of them."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from jamshape.contacts import find_contacts
from jamshape.landscape import Landscape
from jamshape.minima import Outcome, Stop, minimise
from jamshape.packing import Box, State
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Kind, Particles
from jamshape.shapes.table import SHAPES

EPS = float(np.finfo(float).eps)

# Of the largest force and torque of a contact: a few hundred roundings.
ROUNDING = 1e-13

# Particles of a scene.
NUMBER = {2: 12, 3: 8}

# Minimised enough for the next step.
ROUGH = Stop(tolerance=0.03, evaluations=200)

# The phi of random starts, and the overlap 1 - r/d of the deepest bond of a pressed scene.
_PHI, _DEEPEST = {2: 0.25, 3: 0.12}, 0.1

# More than any difference along a pose or a strain, in smallest lengths.
_LITTLE = 5e-4

# Of the starts: where no bond of any scene is on the verge of another one.
_SEED = 7

# Contacts in rows for the landscape have both bonds of a flat one.
SIDES = 2


class Case(NamedTuple):
    """A shape in two or three dimensions, and which particles of it."""

    shape: str
    dimension: int
    which: int | None = 0
    """One of the shape's examples; None for a mixture of all."""

    def __str__(self) -> str:
        which = "mixture" if self.which is None else self.which
        return f"{self.shape}-{self.dimension}D-{which}"


def examples(name):
    """Parameters to try a shape with, the most typical ones first."""
    return SHAPES[name].examples


PLACES = [(name, dimension) for name in SHAPES for dimension in SHAPES[name].dimensions]
TYPICAL = [Case(*place) for place in PLACES]
MIXTURES = [Case(*place, None) for place in PLACES]
PURE = [Case(*place, k) for place in PLACES for k in range(len(examples(place[0])))]
ALL = sorted([*PURE, *MIXTURES], key=lambda case: (*case[:2], str(case)))


def particles_of(case, size_ratio=1.4):
    """Small and big ones, 1:1; of a mixture all examples in sizes of their own."""
    if case.which is not None:
        return Particles.of(case.shape, size_ratio, **examples(case.shape)[case.which])
    sizes = size_ratio ** (np.arange(len(examples(case.shape))) % 3 / 2)
    kinds = [
        Kind(parameters, size=size, spread=0.05)
        for parameters, size in zip(examples(case.shape), sizes, strict=True)
    ]
    return Particles.mixture(case.shape, kinds)


def scattered(case, n=None, phi=None, seed=1):
    """At random places without overlaps; the box begins somewhere."""
    n, phi = n or NUMBER[case.dimension], phi or _PHI[case.dimension]
    packing = random_packing(n, phi, seed, particles_of(case), case.dimension)
    lo = np.linspace(-1.3, 0.4, case.dimension)
    return packing.with_(position=packing.position + lo, box=Box(lo, packing.box.edges))


def deepest(packing):
    """Largest overlap of a bond."""
    bonds = find_contacts(packing, sides=SIDES).bonds
    return float((1 - bonds.distance / bonds.reach).max(initial=0.0))


def keeps_its_bonds(packing):
    """Whether no difference along a pose or a strain opens or closes one."""
    n_bonds = find_contacts(packing, sides=SIDES).n_bonds
    others = (find_contacts(kicked(packing, _LITTLE, seed), sides=SIDES) for seed in range(8))
    return all(np.array_equal(n_bonds, other.n_bonds) for other in others)


@cache
def squeezed(case, n=None, overlap=_DEEPEST, seed=_SEED):
    """Squeezed in steps, each followed by a rough minimisation, to an overlap of the deepest bond."""
    return _squeezed(scattered(case, n, seed=seed), overlap)


def _squeezed(packing, overlap):
    landscape, state = Landscape(packing, sides=SIDES), State.of(packing)
    for _ in range(300):
        found = minimise(landscape, state, "auto", ROUGH)
        if deepest(found.state.packing(packing)) > overlap:
            return in_doubles(found.state.packing(packing))
        step = 0.03 if found.outcome is Outcome.UNJAMMED else 0.01
        state = found.state.strained(-step)
    raise AssertionError


@cache
def pressed(case):
    """Squeezed, and kicked off the minimum, so that forces do not cancel."""
    tries = (kicked(squeezed(case), 0.031, seed) for seed in range(2, 20))
    return next(packing for packing in tries if keeps_its_bonds(packing))


@cache
def tilted(case):
    """Sheared in steps to tilts of half an edge and less, of either sign, then pressed like the others."""
    packing = scattered(case, seed=_SEED)
    landscape, state = Landscape(packing, sides=SIDES), State.of(packing)
    D, steps = case.dimension, 20
    shear = np.zeros((D, D))
    shear[np.triu_indices(D, 1)] = [0.5, -0.4, 0.3][: D * (D - 1) // 2]
    there = np.eye(D)
    for step in range(steps):
        before, there = there, np.eye(D) + (step + 1) / steps * shear
        state = sheared(state, there @ np.linalg.inv(before))
        state = minimise(landscape, state, "auto", ROUGH).state
    return kicked(_squeezed(in_doubles(state.packing(packing)), _DEEPEST), 0.031)


def sheared(state, change):
    """Particles and box moved by a linear map, an upper triangular matrix."""
    return State(state.position @ change.T, state.orientation, change @ state.cell)


def kicked(packing, size, seed=2):
    """Moved at random by so many smallest lengths, and turned by so many radians."""
    rng, landscape = np.random.default_rng(seed), Landscape(packing)
    shape = (packing.n, 1 if packing.dimension == 2 else 3)
    shift = size * landscape.inner_radius[:, None] * rng.uniform(-1, 1, packing.position.shape)
    turn = size * rng.uniform(-1, 1, shape)
    return in_doubles(State.of(packing).displaced(shift, turn).packing(packing))


@cache
def in_a_small_box(case):
    """Two particles in a box that is shorter than they are, one of which touches an image of itself."""
    packing = scattered(case, 2, seed=17)
    landscape, state = Landscape(packing, sides=SIDES), State.of(packing)
    for _ in range(300):
        state = minimise(landscape, state, "auto", ROUGH).state
        found = in_doubles(state.packing(packing))
        i, j = find_contacts(found, sides=SIDES).pairs.T
        if (
            (i == j).any()
            and (i != j).any()
            and found.box.edges.min() < 2 * found.outer_radius.max()
        ):
            there = kicked(found, 0.01)
            if keeps_its_bonds(there):
                return there
        state = state.strained(-0.01)
    raise AssertionError


def in_doubles(packing):
    """The same poses, rounded."""
    return packing.with_(
        position=packing.position, orientation=packing.orientation, box=packing.box
    )


def taken(packing, rows, **others):
    """Some of the particles, or all of them in another order; other fields are replaced too."""
    names = ("position", "orientation", "diameters", "form", "species", "id", "image")
    return packing.with_(**({name: getattr(packing, name)[rows] for name in names} | others))


def apart(packing, factor=20.0):
    """The same places in so large a box that no image is near: an open cluster."""
    return packing.with_(box=Box.of(packing.box.lo, factor * packing.box.matrix))


def laws(packing):
    """The numbers of bonds of a flat contact that the shape knows."""
    return (1, 2) if packing.compiled().has_sides else (SIDES,)


def stiffnesses(packing):
    """A k_e of its own for each pair of species."""
    own = 1.0 + np.arange(packing.species.max())
    return np.add.outer(own, own) + 0.5 * np.multiply.outer(own, own)


def turned_as_a_whole(packing, seed=4):
    """An open cluster turned about its origin, and the rotation as a matrix."""
    rng, D = np.random.default_rng(seed), packing.dimension
    quaternion = rng.normal(size=4) if D == 3 else np.array([np.cos(0.7), 0, 0, np.sin(0.7)])
    quaternion /= np.linalg.norm(quaternion)
    angle = 2 * np.arccos(quaternion[0])
    axis = quaternion[1:] / np.sin(angle / 2)
    turn = (angle * axis)[2:] if D == 2 else angle * axis
    still = np.zeros_like(packing.position)
    state = State.of(packing).displaced(still, np.tile(turn, (packing.n, 1)))
    cross = np.cross(np.eye(3), axis)
    matrix = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    matrix = matrix[:D, :D]
    centre = packing.position.mean(axis=0)
    position = centre + (packing.position - centre) @ matrix.T
    return in_doubles(state.packing(packing)).with_(position=position), matrix


def replicated(packing, times):
    """So many boxes side by side in each direction, as one."""
    shifts = np.array(list(np.ndindex(*[times] * packing.dimension)))
    copies = len(shifts)
    rows = np.tile(np.arange(packing.n), copies)
    moved = packing.position[rows] + packing.box.vectors(np.repeat(shifts, packing.n, axis=0))
    box = Box.of(packing.box.lo, times * packing.box.matrix)
    return taken(packing, rows, id=1 + np.arange(len(rows)), position=moved, box=box)


def close_to(value, rel):
    """Of a number, however small."""
    return pytest.approx(value, rel=rel, abs=0)


def size_of(network):
    """Largest force and torque of a contact."""
    torques = np.abs([network.torque_i, network.torque_j]).max()
    return np.abs(network.force).max(), torques


def as_vectors(torque):
    """(N, 1) or (N, 3)"""
    return torque.reshape(len(torque), -1)
