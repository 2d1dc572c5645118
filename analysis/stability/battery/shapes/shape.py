"""What a row of the table of shapes holds: packings by what they are tried for, and how their forces are judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from battery.oracle import Found
from battery.scenes.making import Scene
from jamshape.arrays import FloatArray
from jamshape.packing import Packing

Scenes = dict[str, Scene]
"""Under the names that labels of cases have."""


Oracle = Callable[[Packing, float, FloatArray | None], Found]
"""A second evaluation of one-bond contacts, from a packing, k_e and quaternions as LAMMPS holds them."""


class Law(NamedTuple):
    """One law of contact of a shape."""

    words: str
    """What labels say of it."""
    sides: int
    is_of_oracle: bool
    """Whether the oracle judges it; else the bindings do."""


class Units(NamedTuple):
    """What forces and torques are compared with."""

    words: str
    of_contacts: Callable[[FloatArray, float], FloatArray]
    """(M,) of contacts, from their (M, D) forces and k_e."""
    force: Callable[[Packing, FloatArray, float], float]
    """Of the forces on all particles of a packing, and k_e."""
    torque: Callable[[Packing, FloatArray, float], FloatArray | float]
    """Of their torques, from these and the unit of force."""


def _overlap_of_contacts(force: FloatArray, k_e: float) -> FloatArray:
    return np.full(len(force), k_e)


def _overlap(packing: Packing, _: FloatArray, k_e: float) -> float:
    return k_e / float(packing.diameters[:, 1].min())


def _lever(packing: Packing, _: FloatArray, force: float) -> FloatArray:
    return np.asarray(force * np.maximum(packing.half_length, packing.radius)[:, None])


IN_OVERLAPS = Units("in overlaps", _overlap_of_contacts, _overlap, _lever)
"""Of rods of about 2R = 1: force times 2R / k_e, torques over the half length or the radius."""


def _own_size(force: FloatArray, _: float) -> FloatArray:
    return np.asarray(np.abs(force).max(axis=1, initial=0.0))


def _largest(_: Packing, force: FloatArray, __: float) -> float:
    return float(np.abs(force).max() or 1.0)


def _largest_torque(packing: Packing, torque: FloatArray, force: float) -> float:
    # Torques of spheres are rounding.
    return float(max(np.abs(torque).max(), 1e-3 * packing.diameters.min() * force))


RELATIVE = Units("relative", _own_size, _largest, _largest_torque)
"""Of shapes whose overlaps and sizes are of any order."""


@dataclass(frozen=True)
class OnLandscape:
    """Packings whose sums are judged."""

    scenes: Scenes
    rounding: float
    """Doubles against long doubles, in overlaps."""
    bent: tuple[str, ...]
    """Scenes whose Hessians are judged."""
    bend: float
    """Length of the differences of forces, for these."""
    same_place: tuple[str, Scene]
    """Whose first two particles are put at one place."""
    counted: tuple[str, ...] = ()
    """Scenes whose contacts are counted without an oracle."""
    kinked: Scenes = field(default_factory=dict)
    """So close to kinks that only an oracle judges their forces."""


class Limits(NamedTuple):
    """Largest errors of forces from the pair style."""

    force: float
    mixed: float
    """With k_e of 1e-6 to 1e6 in one box."""
    units: float
    """In other units."""


@dataclass(frozen=True)
class InPairStyle:
    """Packings whose forces LAMMPS finds."""

    scenes: Scenes
    without_newton: tuple[str, ...]
    """Scenes that are tried with `newton off`, too."""
    in_units: Scenes
    """Packings that are given in other units of length and energy."""
    mixed: Scene
    """Of two types that touch."""
    limits: Limits
    stops: Scenes
    sentence: str
    """With which these stop."""


class Drive(NamedTuple):
    """A packing, and how it is driven."""

    scene: Scene
    kappa: float
    dt: float
    steps: int = 0


class Touch(NamedTuple):
    """Two particles of diameter 1 along x, whose overlap s relaxes as ds/dt = -rate s."""

    scene: Callable[[float], Packing]
    overlap: float
    rate: float
    """In units of k_e / (k_d d^(D + 2))."""
    length: float
    """Distance of their centres when they touch."""
    second: float
    """Largest part of s that the next order of the law changes while it relaxes, over s."""


@dataclass(frozen=True)
class InFlow:
    """Packings that the fix drives."""

    invariant: Mapping[str, Drive]
    """In units of length, energy and time of 1; judged in others."""
    changed: Mapping[str, Drive]
    """Driven at changing rates."""
    restarted: Mapping[str, Drive]
    touch: Touch
    lone: Scene
    """Touches nothing."""
    extreme: Scenes
    extreme_drive: str
    """The fix that drives these."""
    extreme_steps: int
    limit: float
    """Of forces after a run."""
    few_stops: bool = False
    """Whether one time step beyond the limit is enough in a quick run."""
    must_relax: bool = False
    """Whether the energy of these must fall."""
    heavy: tuple[str, ...] = ()
    """Those of them that take many seconds."""


@dataclass(frozen=True)
class InSolvers:
    """Packings that minimisers, energy targets and spectra take."""

    minimised: Scenes
    to_the_end: tuple[str, ...]
    """Those of them that are minimised to the end, and whose modes there are judged."""
    jammed: Scenes
    """Starts of energy targets."""
    quick: tuple[str, ...]
    """Those of them that are led to u0 = 1e-15 in a few seconds."""
    in_units: tuple[str, ...]
    """Those of them that are given in other units."""
    modes_in_units: tuple[str, ...]
    """Those of them whose modes are compared with those in other units."""
    spectra: tuple[str, ...]
    """Those of them whose bounds of eigenvalues are counted."""


@dataclass(frozen=True)
class Compressed:
    """Packings that are compressed without LAMMPS."""

    implicit: Scenes
    quasistatic: Scenes
    """Loose ones."""
    quick: tuple[str, ...]
    """Those of them that jam in a few seconds."""
    hard: Scenes
    """Without overlaps, in boxes twice as wide as they are long."""
    heavy_sweeps: tuple[str, ...] = ()


@dataclass(frozen=True)
class Shape:
    """One shape as the battery tries it."""

    name: str
    """Of many particles."""
    style_name: str
    """Of its pair style, before the slash."""
    units: Units
    laws: tuple[Law, ...]
    landscape: OnLandscape
    style: InPairStyle
    flow: InFlow
    solvers: InSolvers
    compressed: Compressed
    minimized: Scenes
    """By LAMMPS."""
    two_ranks: Mapping[str, Drive]
    """Still ones have no steps."""
    oracle: Oracle | None = None


def is_long(name: str) -> bool:
    """Whether a scene holds rods as long as its box: the rounding of their axes moves tips further."""
    return "100" in name or "longer" in name
