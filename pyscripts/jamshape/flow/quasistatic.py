"""Athermal quasistatic shear: small steps of the strain, each followed by a minimisation.

The limit of shear at vanishing rate: between two rearrangements a packing stays in one minimum that
moves with the box, and where that minimum vanishes the packing falls to another one. Maloney & Lemaitre, Phys. Rev. E
74, 016118 (2006). At constant volume, or at constant pressure or normal stress, where the box also yields; by steps of
the strain, or of the shear stress.
Independent of shape and dimension; needs no LAMMPS.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray, LongArray
from jamshape.checks import RANGES, ArgumentError, require_in, require_one_of, require_positive
from jamshape.contacts import Contacts
from jamshape.flow.cyclic_shear import QUARTERS
from jamshape.flow.host import Host
from jamshape.flow.shear import FLOWS
from jamshape.landscape import Landscape, State
from jamshape.measures.order import OrientationalOrder, planar_order
from jamshape.measures.stress import ShearStress
from jamshape.minima import Minimum, Stop, minimise
from jamshape.minima.boxes import ISOTROPIC, SHEAR, FlowError, Settling, Yielding
from jamshape.minima.boxes import advance as settle
from jamshape.packing import Packing

_ACCURACY = 1e-6  # of stresses, over the pressure
_PART_OF_STEP = 1e-3  # largest error of a shear stress over its steps


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
    box
        How the box yields to it: ``isotropic``, or the components of normal stresses to hold, such as ``yy``.
    stress_step
        Increase of the shear stress in each step, instead of the strain's; up to the strain, where the packing flows.
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
    box: str = ISOTROPIC
    stress_step: float = 0.0

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
        self._require_box()
        if self.stress_step:
            require_positive(stress_step=self.stress_step, strain_end=self.strain_end)
            if self.cycles or self.flow != "simple":
                said = "{stress_step} raises the stress of simple shear, expected no {cycles:name} and no other {flow:name}"
                raise ArgumentError(
                    said, {"stress_step": self.stress_step, "cycles": None, "flow": None}
                )
        elif self.strain_step > largest:
            what = "amplitude" if self.cycles else "final strain"
            msg = f"the step is {self.strain_step:g}, expected at most the {what}, {largest:g}"
            raise ValueError(msg)

    def _require_box(self) -> None:
        """Refuse a box that has no effect, or yields where it is sheared."""
        if self.box == ISOTROPIC:
            return
        if not self.hold_pressure:
            said = "{box} has no effect without {pressure:name}, expected both or neither"
            raise ArgumentError(said, {"box": self.box, "pressure": None})
        free = ("yy", "xx", "zz") if self.flow == "simple" else ("zz",)
        if not set(self.box.split()) <= set(free):
            said = f"{{box}} yields where the shear holds it, expected isotropic or of {' '.join(free)}"
            raise ArgumentError(said, {"box": self.box})

    @classmethod
    def of(cls, stored: Mapping[str, Any]) -> QuasistaticShear:
        """Read settings from the attributes of a file."""
        names = [field.name for field in fields(cls) if field.name in stored]
        return cls(**{name: stored[name] for name in names})

    @property
    def settings(self) -> dict[str, Any]:
        """Settings as attributes, those of one strain or of cycles."""
        without = {"strain_end"} if self.cycles else {"amplitude", "cycles"}
        without |= {"box"} if self.box == ISOTROPIC else set()
        without |= {"strain_step"} if self.stress_step else {"stress_step"}
        return {name: value for name, value in asdict(self).items() if name not in without}

    @property
    def steps(self) -> int:
        """Number of steps to the end."""
        if self.cycles:
            return QUARTERS * self.quarter * self.cycles
        return math.ceil(abs(self.strain_end) / self.strain_step - 1e-9)

    def is_over(self, run: Sheared) -> bool:
        """Whether the end of the strain is reached."""
        if self.stress_step:
            return run.flows or run.strain >= self.strain_end
        return run.steps >= self.steps

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

    def goal(self) -> Yielding | None:
        """Return the normal stress to hold; None if none is held."""
        if not self.hold_pressure:
            return None
        return Yielding(self.box, self.hold_pressure, accuracy=_ACCURACY, tolerance=self.tolerance)

    def next_stress(self, run: Sheared) -> Yielding:
        """Return the stresses to reach in the next step."""
        box = f"{self._normal(run.state.dimension)} {SHEAR}".strip()
        part = _PART_OF_STEP * self.stress_step / max(run.pressure, self.stress_step)
        left = max(self.strain_end - run.strain, self.strain_step)
        return Yielding(
            box, self.hold_pressure or None, accuracy=min(_ACCURACY, part), tolerance=self.tolerance,
            shear=(run.steps + 1) * self.stress_step, most_strain=left,
        )  # fmt: skip

    def _normal(self, dimension: int) -> str:
        """Return the components whose normal stresses are held by themselves."""
        if not self.hold_pressure:
            return ""
        return "xx yy zz"[: 3 * dimension - 1] if self.box == ISOTROPIC else self.box

    def work(self, before: _Normal, after: _Normal) -> float:
        """Return the work of normal stresses that are held in components."""
        if not self.stress_step and self.box == ISOTROPIC:
            return 0.5 * (before.pressure + after.pressure) * (before.volume - after.volume)
        axes = ["xyz".index(word[0]) for word in self._normal(len(after.edges)).split()]
        mean = 0.5 * (
            before.volume * np.diagonal(before.tensor) + after.volume * np.diagonal(after.tensor)
        )
        return float(-(mean * np.log(after.edges / before.edges))[axes].sum())

    @property
    def _host(self) -> Host:
        """Host with shear strain 1 in the time 1."""
        return Host.shearing(1.0, self.flow)


class _Normal(NamedTuple):
    """Quantities on which the work of normal stresses depends."""

    pressure: float
    volume: float
    tensor: FloatArray
    edges: FloatArray

    @classmethod
    def of(cls, landscape: Landscape, state: State, pressure: float) -> _Normal:
        return cls(
            pressure, state.volume, landscape.stress(state), np.asarray(state.edges, np.float64)
        )


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
    """Derivative of the energy by strain over the volume, -p_xy in simple shear."""
    lost: float
    """Energy dissipated by the step, over the volume (work of stress and pressure minus the change of energy)."""
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
    strain
        Shear strain since the start.
    flows
        Whether the packing did not resist the last shear stress.
    """

    state: State
    steps: int = -1
    u: float = 0.0
    stress: float = 0.0
    pressure: float = 0.0
    volume: float = 0.0
    strain: float = 0.0
    flows: bool = False
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
    TargetError
        If no packing has the stress to hold.
    CrossingError
        If spines cross in a step, which is then too long.
    """
    while not how.is_over(run):
        yield advance(landscape, run, how)


def advance(landscape: Landscape, run: Sheared, how: QuasistaticShear) -> Row:
    """Minimise the start, or shear by one step and minimise; parameters and errors as `shear`."""
    began, evaluations = time.perf_counter(), landscape.evaluations
    done, state = run.steps, run.state
    holds = bool(how.hold_pressure) and done >= 0
    before = _Normal.of(landscape, state, run.pressure) if holds else None
    if how.stress_step:
        found, strain = _stressed(landscape, run, how)
        run.strain += strain
    else:
        strain = 0.0 if done < 0 else how.strain_at(done + 1) - how.strain_at(done)
        found = sheared(landscape, state, how, strain)
        run.strain = how.strain_at(max(0, done + 1))
    run.state = found.state
    run.steps += 1
    row = _row(landscape, found, run, how, _Step(strain, before))
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
    goal = how.goal()
    if goal is None:
        return minimise(landscape, deformed, "auto", Stop(how.tolerance))
    return goal.find(landscape, deformed)


def _stressed(landscape: Landscape, run: Sheared, how: QuasistaticShear) -> tuple[Minimum, float]:
    """Raise the shear stress, and return the minimum, or the state that flows, with the strain to it."""
    goal = how.next_stress(run)
    landscape.forget_pairs()
    at = Settling(run.state)
    try:
        while not at.done:
            settle(landscape, at, goal)
    except FlowError as error:
        if run.steps < 0:
            msg = f"before the first step of the stress {error}; take a larger strain or another start"
            raise FlowError(msg) from error
        run.flows = True
        return minimise(landscape, at.state, "auto", Stop(how.tolerance)), at.sheared
    assert at.present is not None
    return at.present, at.sheared


def pressure_of(found: Minimum) -> float:
    """Return the pressure of a minimum, [energy / length^D]."""
    D = found.state.dimension
    return -found.evaluation.strain_gradient / (D * found.state.volume)


class _Step(NamedTuple):
    """The last step: its strain, and normal stresses before it, if they are held."""

    strain: float
    before: _Normal | None


def _row(
    landscape: Landscape, found: Minimum, run: Sheared, how: QuasistaticShear, step: _Step
) -> Row:
    """Measure a minimum."""
    packing = found.state.packing(landscape.particles)
    tensor = landscape.stress(found.state)
    u, stress = found.energy_density, how.resisted(tensor)
    order, counts = _order(packing), Contacts.of(packing, landscape.k_e, landscape.sides).counts
    pressure, volume = pressure_of(found), found.state.volume
    given = 0.5 * (run.stress * run.volume + stress * volume) * step.strain
    if step.before:
        given += how.work(step.before, _Normal.of(landscape, found.state, pressure))
    lost = (run.u * run.volume + given) / volume - u
    return Row(
        step=run.steps, strain=run.strain, phi=packing.phi, u=u, pressure=pressure,
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
