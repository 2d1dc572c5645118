"""Athermal quasistatic shear: small steps of the strain, each followed by a minimisation.

The limit of shear at vanishing rate: between two rearrangements a packing stays in one minimum that
moves with the box, and where that minimum vanishes the packing falls to another one. Maloney & Lemaitre, Phys. Rev. E
74, 016118 (2006). At constant volume, or at constant pressure, where the box is also strained isotropically.
Independent of shape and dimension; needs no LAMMPS.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from jamshape.arrays import FloatArray, LongArray
from jamshape.checks import RANGES, require_in, require_one_of, require_positive
from jamshape.contacts import Contacts
from jamshape.flow.host import Host
from jamshape.flow.shear import FLOWS
from jamshape.landscape import Landscape, State
from jamshape.measures.order import OrientationalOrder, planar_order
from jamshape.measures.stress import ShearStress
from jamshape.minima import Minimum, Stop, minimise
from jamshape.minima.target import followed
from jamshape.packing import Packing

_ACCURACY = 1e-6  # relative, of the pressure
_MOST_MINIMA = 60  # to reach it

_LARGEST_STRAIN = 2e-3  # of the box, isotropic
_FIRST_STRAIN = 1e-5  # without pressure; doubled each time

# Fraction of the target pressure below which a packing is unjammed.
_UNJAMMED = 0.01

# Strain to measure the stiffness.
_TRIED = 1e-8


class PressureError(RuntimeError):
    """The pressure could not be held; the message gives its value."""


@dataclass(frozen=True)
class QuasistaticShear:
    """Settings of a quasistatic shear.

    Parameters
    ----------
    strain_step
        Strain of each step.
    strain_end
        Final strain.
    flow
        One of `jamshape.flow.shear.FLOWS`; pure shear by gamma stretches x by exp(gamma).
    hold_pressure
        Pressure to hold, [energy / length^D]; the volume is held by default or if it is 0.
    tolerance
        Largest net force and torque of a particle over the mean bond force.

    Raises
    ------
    ValueError
        If a number is not positive, the step is longer than the strain, pure shear goes beyond 3, or the flow is
        unknown.
    """

    strain_step: float = 1e-3
    strain_end: float = 0.5
    flow: str = "simple"
    hold_pressure: float = 0.0
    tolerance: float = 1e-8

    def __post_init__(self) -> None:
        require_positive(
            strain_step=self.strain_step, strain_end=self.strain_end, tolerance=self.tolerance
        )
        if self.hold_pressure != 0:
            require_positive(hold_pressure=self.hold_pressure)
        require_one_of("flow", self.flow, FLOWS)
        if self.flow == "pure":
            require_in("strain", self.strain_end, RANGES["pure_strain"])
        if self.strain_step > self.strain_end:
            msg = f"the step is {self.strain_step:g}, expected at most the final strain, {self.strain_end:g}"
            raise ValueError(msg)

    @property
    def steps(self) -> int:
        """Number of steps to the end."""
        return math.ceil(self.strain_end / self.strain_step - 1e-9)

    def gradient(self, dimension: int, strain: float) -> LongArray:
        """Return the (D, D) matrix of a shear strain."""
        found: LongArray = np.eye(dimension, dtype=np.longdouble)
        found[:2, :2] = self._host.deformation(strain)
        return found

    def resisted(self, pressure: FloatArray) -> float:
        """Return the derivative of the energy by strain over the volume, from a pressure tensor (D, D)."""
        return -float((pressure[:2, :2] * self._host.gradient).sum())

    @property
    def _host(self) -> Host:
        """Host with shear strain 1 in the time 1."""
        return Host.shearing(1.0, self.flow)


class Row(NamedTuple):
    """A minimum of the run."""

    step: int
    strain: float
    phi: float
    u: float
    pressure: float
    p_xy: float
    normal_difference: float
    sigma: float
    mu: float
    z: float
    z_single: float
    rattlers: int
    S_2: float
    director: float
    stress: float
    """Derivative of the energy by strain over the volume: -p_xy of simple shear."""
    lost: float
    """Energy over the volume dissipated by the step: work of stress and pressure minus the change of energy."""
    residual: float
    evaluations: int
    wall_seconds: float


@dataclass(eq=False)
class Sheared:
    """State of a sheared packing, with all that is needed to resume.

    Parameters
    ----------
    state : State
        A minimum, after the first step.
    steps
        Steps so far; -1 before the first minimisation.
    u, stress, pressure
        Energy, resisting stress and pressure, [energy / length^D].
    volume
        Volume of the box.
    """

    state: State
    steps: int = -1
    u: float = 0.0
    stress: float = 0.0
    pressure: float = 0.0
    volume: float = 0.0
    evaluations: int = 0
    wall_seconds: float = 0.0


def shear(landscape: Landscape, run: Sheared, how: QuasistaticShear) -> Iterator[Row]:
    """Minimise, then shear step by step to the end.

    Parameters
    ----------
    landscape : Landscape
    run : Sheared
        Initial or resumed state; updated.
    how : QuasistaticShear

    Yields
    ------
    Row
        Row of the first minimum, and after each step.

    Raises
    ------
    PressureError
        If no packing has the pressure to hold.
    CrossingError
        If spines cross in a step, which is then too long.
    """
    while run.steps < how.steps:
        yield advance(landscape, run, how)


def advance(landscape: Landscape, run: Sheared, how: QuasistaticShear) -> Row:
    """Minimise the start, or shear by one step and minimise; parameters and errors as `shear`."""
    began, evaluations = time.perf_counter(), landscape.evaluations
    strain = 0.0 if run.steps < 0 else _strain_of(how, run.steps)
    state = run.state.deformed(how.gradient(run.state.dimension, strain))
    # The continuation depends on the state alone, also after reading it from a file.
    landscape.forget_pairs()
    found = _minimum(landscape, state.with_least_tilt(), how)
    run.state = found.state
    run.steps += 1
    row = _row(landscape, found, run, how)
    run.evaluations += landscape.evaluations - evaluations
    run.wall_seconds += time.perf_counter() - began
    run.u, run.stress, run.pressure = row.u, row.stress, row.pressure
    run.volume = found.state.volume
    return row._replace(evaluations=run.evaluations, wall_seconds=run.wall_seconds)


def _strain_of(how: QuasistaticShear, done: int) -> float:
    """Return the strain of the step after `done`; the last one may be shorter."""
    return min(how.strain_end, (done + 1) * how.strain_step) - done * how.strain_step


def _minimum(landscape: Landscape, state: State, how: QuasistaticShear) -> Minimum:
    stop = Stop(how.tolerance)
    found = minimise(landscape, state, "auto", stop)
    return _at_pressure(landscape, found, stop, how.hold_pressure) if how.hold_pressure else found


def pressure_of(found: Minimum) -> float:
    """Return the pressure of a minimum, [energy / length^D]."""
    D = found.state.dimension
    return -found.evaluation.strain_gradient / (D * found.state.volume)


def _at_pressure(landscape: Landscape, found: Minimum, stop: Stop, asked: float) -> Minimum:
    """Strain the box isotropically until a minimum has the target pressure."""
    tried = _FIRST_STRAIN
    for _ in range(_MOST_MINIMA):
        pressure = pressure_of(found)
        if abs(pressure / asked - 1) <= _ACCURACY:
            return found
        if pressure < _UNJAMMED * asked:
            state, tried = found.state.strained(-tried), min(2 * tried, _LARGEST_STRAIN)
        else:
            state = followed(landscape, found, _strain_to(landscape, found, asked))
        found = minimise(landscape, state, "auto", stop)
    msg = (
        f"the pressure was {pressure_of(found):.6g} after {_MOST_MINIMA} minimisations, expected {asked:g};"
        " hold a larger pressure"
    )
    raise PressureError(msg)


def _strain_to(landscape: Landscape, found: Minimum, asked: float) -> float:
    """Return the strain that reaches the target pressure, as long as contacts stay."""
    pressure = pressure_of(found)
    there = followed(landscape, found, -_TRIED)
    evaluation = landscape.evaluate(there)
    stiffness = (
        pressure_of(replace(found, state=there, evaluation=evaluation)) - pressure
    ) / _TRIED
    if stiffness <= 0:  # sliding
        return math.copysign(_TRIED, pressure - asked)
    return float(np.clip((pressure - asked) / stiffness, -_LARGEST_STRAIN, _LARGEST_STRAIN))


def _row(landscape: Landscape, found: Minimum, run: Sheared, how: QuasistaticShear) -> Row:
    """Measure a minimum."""
    packing = found.state.packing(landscape.particles)
    tensor = landscape.stress(found.state)
    u, stress = found.energy_density, how.resisted(tensor)
    order, counts = _order(packing), Contacts.of(packing, landscape.k_e, landscape.sides).counts
    pressure, volume = pressure_of(found), found.state.volume
    strain = min(how.strain_end, run.steps * how.strain_step)
    done = strain - min(how.strain_end, max(run.steps - 1, 0) * how.strain_step)
    given = 0.5 * (run.stress * run.volume + stress * volume) * done
    given += 0.5 * (run.pressure + pressure) * (run.volume - volume)
    lost = (run.u * run.volume + given) / volume - u
    return Row(
        step=run.steps, strain=strain, phi=packing.phi, u=u, pressure=pressure,
        **ShearStress.of(tensor)._asdict(), z=counts.z, z_single=counts.z_single, rattlers=counts.n_rattlers,
        S_2=order.S_n, director=order.theta_n, stress=stress,
        lost=lost if run.steps > 0 else 0.0, residual=found.residual.largest,
        evaluations=0, wall_seconds=0.0,
    )  # fmt: skip


def _order(packing: Packing) -> OrientationalOrder:
    """Nematic order in the plane; that of bodies in space follows from frames."""
    if packing.dimension == 2:
        return planar_order(packing)
    return OrientationalOrder(math.nan, math.nan)
