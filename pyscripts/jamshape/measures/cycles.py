"""Cycles of a shear to and fro: energy, storage and loss modulus, and whether the packing returns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jamshape.arrays import BoolArray, FloatArray
from jamshape.contacts import find_contacts, find_rattlers
from jamshape.measures.contact_changes import At
from jamshape.measures.nonaffine import relative_motion, turned_tips
from jamshape.packing import Packing


class Moduli(NamedTuple):
    """Moduli of the first harmonic of a cycle, [energy / length^D]."""

    storage: float
    loss: float


class Distance(NamedTuple):
    """Distance between two states of the same particles."""

    rms: float
    """Root mean square over particles, over the smallest inner radius."""
    largest: float
    changed: int
    """Number of contacts that are in one of the states alone."""


class Cycle(NamedTuple):
    """A whole cycle, from strain 0 to strain 0."""

    number: int
    """From 1."""
    work: float
    """Work of the shear stress, and of the normal pressure where the volume changes, on the box over the volume at the
    start of the cycle, by the trapezoidal rule over the rows, [energy / length^D]."""
    lost: float
    """Energy dissipated over the volume, by drag at a rate or by minimisations, [energy / length^D]."""
    storage: float
    """Storage modulus G', [energy / length^D]."""
    loss: float
    """Loss modulus G'', [energy / length^D]."""
    rms: float
    """Root mean square distance of particles from where the cycle began, over the smallest inner radius."""
    largest: float
    """Largest of these distances."""
    changed: int | None
    """Number of contacts that are at only one end of the cycle; None if a state was not kept."""
    is_reversible: bool | None
    """Whether `largest` is at most the tolerance; None if a state was not kept."""


class Yielding(NamedTuple):
    """Rows of a box that yields to a normal pressure."""

    pressure: FloatArray
    """(T,) normal pressures on the edges that move, [energy / length^D]."""
    volume: FloatArray
    """(T,) volumes, in any unit."""


class Rows(NamedTuple):
    """Rows of cycles."""

    strain: FloatArray
    """(T,) strains of a triangle wave, a row at 0."""
    stress: FloatArray
    """(T,) stresses that do work on the strain."""
    lost: FloatArray
    """(C,) dissipated energy over the volume of each cycle."""
    per_cycle: int
    """Number of rows of a cycle, without its first."""
    yielding: Yielding | None = None
    """None where the volume is held."""

    def of(self, number: int) -> tuple[FloatArray, FloatArray]:
        """Return strain and stress of a cycle, counted from 1, with both its ends."""
        part = self._part(number)
        return self.strain[part], self.stress[part]

    def work(self, number: int) -> float:
        """Return the work of a cycle over the volume at its start, [energy / length^D]: integral of V stress d(strain) - p dV."""
        strain, stress = self.of(number)
        if self.yielding is None:
            return work_of(strain, stress)
        pressure, volume = (each[self._part(number)] for each in self.yielding)
        return (work_of(strain, stress * volume) - work_of(volume, pressure)) / float(volume[0])

    def _part(self, number: int) -> slice:
        return slice((number - 1) * self.per_cycle, number * self.per_cycle + 1)


def work_of(strain: FloatArray, stress: FloatArray) -> float:
    """Integrate the stress over the strain by the trapezoidal rule."""
    return float((0.5 * (stress[1:] + stress[:-1]) * np.diff(strain)).sum())


def moduli_of(strain: FloatArray, stress: FloatArray) -> Moduli:
    """Return storage and loss modulus, the ratio of the first harmonics of stress and strain over a cycle.

    G' + i G'' = sum_k stress_k exp(-2 pi i k / n) / sum_k strain_k exp(-2 pi i k / n), where the first and the last row
    of the cycle, the same phase, count one half each. Other harmonics of a triangle wave do not enter. The loss of
    energy by this harmonic alone is pi G'' s^2 per cycle, where s = 8 / pi^2 times the amplitude.

    Parameters
    ----------
    strain : (n + 1,) array
        At equal distances in time, or of the phase.
    stress : (n + 1,) array
        At the same times.

    Examples
    --------
    An elastic spring, and a dashpot of viscosity 2 in a period of 2 pi, in which G'' = viscosity 2 pi / period:

    >>> import numpy as np
    >>> phase = np.linspace(0, 1, 401)
    >>> strain = 0.01 * np.abs((4 * phase + 1) % 4 - 2) - 0.01
    >>> [round(abs(one), 6) for one in moduli_of(strain, 3 * strain)]
    [3.0, 0.0]
    >>> rate = 2 * np.gradient(strain, 2 * np.pi * phase)
    >>> [round(abs(one), 3) for one in moduli_of(strain, rate)]
    [0.0, 2.0]
    """
    phase = np.exp(-2j * np.pi * np.arange(len(strain)) / (len(strain) - 1))
    phase[[0, -1]] = 0.5
    ratio = complex((stress * phase).sum() / (strain * phase).sum())
    return Moduli(ratio.real, ratio.imag)


def distance(first: Packing, second: Packing, *, rattlers: bool) -> Distance:
    """Return how far particles are from where they were, beside a translation and the affine map of the box.

    The distance of a particle is sqrt(d^2 + t^2), of its displacement d to the nearest image and that of its tips by
    rotation, t (`turned_tips`).

    Parameters
    ----------
    first : Packing
        Reference state.
    second : Packing
        Another state of the same particles.
    rattlers : bool
        Whether rattlers count; if not, particles that are rattlers in either state do not, unless all are.
    """
    a, b = At(0.0, first), At(0.0, second)
    held = np.ones(first.n, bool) if rattlers else _held(first, second)
    moved = relative_motion(first, second, held)
    squared = (moved**2).sum(axis=1) + turned_tips(first, second, held) ** 2
    size = float(first.inner_radius.min())
    rms, largest = math.sqrt(squared.mean()) / size, math.sqrt(squared.max()) / size
    return Distance(rms, largest, len(a.bonds ^ b.bonds))


def _held(first: Packing, second: Packing) -> BoolArray:
    """(N,) whether each particle of the first state is a rattler in neither; all are, if none is."""
    loose = np.concatenate([one.id[find_rattlers(one, find_contacts(one))] for one in (first, second)])  # fmt: skip
    held = ~np.isin(first.id, loose)
    return held if held.any() else ~held


class Ends(NamedTuple):
    """States at strain 0."""

    kept: Mapping[int, int]
    """Frames of the states after a number of cycles, of those that were kept."""
    frames: Sequence[Packing]
    rattlers: bool
    """Whether rattlers count, as in `distance`."""

    def distance(self, number: int) -> Distance | None:
        """Return the distance between both ends of a cycle, or None if one was not kept."""
        if number not in self.kept or number - 1 not in self.kept:
            return None
        first, second = (self.frames[self.kept[k]] for k in (number - 1, number))
        return distance(first, second, rattlers=self.rattlers)


def cycles_of(rows: Rows, ends: Ends, tolerance: float, first: int = 1) -> list[Cycle]:
    """Describe the whole cycles of a run.

    Parameters
    ----------
    rows : Rows
    ends : Ends
    tolerance : float
        Largest distance of a particle of a reversible cycle, over the smallest inner radius.
    first : int
        Number of the first cycle to describe, counted from 1 or, if negative, from the end.
    """
    found, done = [], len(rows.lost)
    for number in range(max(1, first if first > 0 else done + 1 + first), done + 1):
        strain, stress = rows.of(number)
        far = ends.distance(number)
        rms, largest, changed = far or (math.nan, math.nan, None)
        returns = None if far is None else far.largest <= tolerance
        energies = rows.work(number), float(rows.lost[number - 1])
        found.append(Cycle(number, *energies, *moduli_of(strain, stress), rms, largest, changed, returns))  # fmt: skip
    return found
