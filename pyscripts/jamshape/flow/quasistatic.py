"""Athermal quasistatic shear: small steps of the strain, each followed by a minimisation.

The limit of shear at vanishing rate: between two rearrangements a packing stays in one minimum that
moves with the box, and where that minimum vanishes the packing falls to another one. Maloney & Lemaitre, Phys. Rev. E
74, 016118 (2006). At constant volume, or at constant pressure, where the box is also strained isotropically.
Independent of shape and dimension; needs no LAMMPS.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray, LongArray
from jamshape.checks import RANGES, require_in, require_one_of, require_positive
from jamshape.contacts import Contacts
from jamshape.flow.cyclic_shear import QUARTERS
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
        Final strain, of either sign; has no effect on cycles.
    flow
        One of `jamshape.flow.shear.FLOWS`; pure shear by gamma stretches x by exp(gamma).
    hold_pressure
        Pressure to hold, [energy / length^D]; the volume is held by default or if it is 0.
    tolerance
        Largest net force and torque of a particle over the mean bond force.
    amplitude, cycles
        Largest strain and number of cycles of a triangle wave, 0 -> amplitude -> -amplitude -> 0, in equal steps of at
        most `strain_step`; no cycles by default.

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
    amplitude: float = 0.0
    cycles: int = 0

    def __post_init__(self) -> None:
        largest = self.amplitude if self.cycles else abs(self.strain_end)
        name = "amplitude" if self.cycles else "strain_end"
        require_positive(
            **{"strain_step": self.strain_step, name: largest, "tolerance": self.tolerance}
        )
        if self.hold_pressure != 0:
            require_positive(hold_pressure=self.hold_pressure)
        require_one_of("flow", self.flow, FLOWS)
        if self.flow == "pure":
            require_in("amplitude" if self.cycles else "strain", largest, RANGES["pure_strain"])
        if self.strain_step > largest:
            what = "amplitude" if self.cycles else "final strain"
            msg = f"the step is {self.strain_step:g}, expected at most the {what}, {largest:g}"
            raise ValueError(msg)

    @classmethod
    def of(cls, stored: Mapping[str, Any]) -> QuasistaticShear:
        """Read settings from the attributes of a file."""
        names = [field.name for field in fields(cls) if field.name in stored]
        return cls(**{name: stored[name] for name in names})

    @property
    def settings(self) -> dict[str, Any]:
        """Settings as attributes: those of one strain, or of cycles."""
        without = {"strain_end"} if self.cycles else {"amplitude", "cycles"}
        return {name: value for name, value in asdict(self).items() if name not in without}

    @property
    def steps(self) -> int:
        """Number of steps to the end."""
        if self.cycles:
            return QUARTERS * self.quarter * self.cycles
        return math.ceil(abs(self.strain_end) / self.strain_step - 1e-9)

    @property
    def quarter(self) -> int:
        """Number of steps from strain 0 to the amplitude."""
        return math.ceil(self.amplitude / self.strain_step - 1e-9)

    def strain_at(self, steps: int) -> float:
        """Return the strain after a number of steps; the last one of a strain without cycles may be shorter."""
        if not self.cycles:
            size = min(abs(self.strain_end), steps * self.strain_step)
            return math.copysign(size, self.strain_end)
        place, quarter = steps % (QUARTERS * self.quarter), self.quarter
        if place > quarter:  # falls from the amplitude, and rises to 0 again
            place = max(2 * quarter - place, place - QUARTERS * quarter)
        return self.amplitude * (place / quarter)

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
    done = run.steps
    strain = 0.0 if done < 0 else how.strain_at(done + 1) - how.strain_at(done)
    found = sheared(landscape, run.state, how, strain)
    run.state = found.state
    run.steps += 1
    row = _row(landscape, found, run, how)
    run.evaluations += landscape.evaluations - evaluations
    run.wall_seconds += time.perf_counter() - began
    run.u, run.stress, run.pressure = row.u, row.stress, row.pressure
    run.volume = found.state.volume
    return row._replace(evaluations=run.evaluations, wall_seconds=run.wall_seconds)


def sheared(landscape: Landscape, state: State, how: QuasistaticShear, strain: float) -> Minimum:
    """Strain a state affinely and minimise; errors as `shear`."""
    deformed = state.deformed(how.gradient(state.dimension, strain)).with_least_tilt()
    # The continuation depends on the state alone, also after reading it from a file.
    landscape.forget_pairs()
    stop = Stop(how.tolerance)
    found = minimise(landscape, deformed, "auto", stop)
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
    strain = how.strain_at(run.steps)
    done = strain - how.strain_at(max(run.steps - 1, 0))
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
