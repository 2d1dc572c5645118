"""Flows by implicit steps as a driver: compression and shear at any rate, however slow."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from jamshape.files.checkpoint import Checkpoint
from jamshape.flow.implicit import Flow, ImplicitFlow, Protocol, Step
from jamshape.flow.slow_shear import SlowShear
from jamshape.landscape import Landscape, State
from jamshape.packing import Packing
from jamshape.recording.driver import Plan, Row, Told

STEPS_PER_MARK = 100
"""Steps between two marks, where caches and factors are dropped, and a frame is recorded."""

_ROW = (
    "phi",
    "pressure",
    "u",
    "strain",
    "dt",
    "error",
    "evaluations",
    "factorisations",
    "rejected",
    "explicit",
)

# A continuation depends on these, beside the state.
_COUNTS = ("dt", "time", "strain", "turned", "steps", "rejected", "explicit", "evaluations", "factorisations",
           "wall_seconds", "explicit_left", "held", "extrapolates", "velocity", "acceleration")  # fmt: skip

_COST = ("steps", "rejected", "explicit", "evaluations", "factorisations", "wall_seconds")


_ARGUMENTS = {"strain_end": "strain", "phi_sheared": "phi", "tolerance": "integration_tolerance",
              "hold_pressure": "pressure"}  # fmt: skip


def plan(
    start: Callable[[], Packing],
    course: Protocol | SlowShear,
    made_from: Mapping[str, Any],
    sides: int = 2,
) -> Plan:
    """Plan a compression or a shear; the start has this many bonds side to side from then on."""

    def begin() -> ImplicitDriver:
        first = start()
        first = first.with_(law=first.law.but(sides=sides), step=0, time=0.0)
        return ImplicitDriver(first, course, Flow(State.of(first)))

    def restore(first: Packing, checkpoint: Checkpoint) -> ImplicitDriver:
        if not checkpoint:
            return ImplicitDriver(first, course, Flow(State.of(first)))
        counts = {name: checkpoint[name] for name in _COUNTS}
        return ImplicitDriver(first, course, Flow(checkpoint["state"], **counts))

    is_shear = isinstance(course, SlowShear)
    name = "shear" if is_shear else "compression"
    arguments = _ARGUMENTS | ({"method": "integrator"} if is_shear else {})
    told = _as_attributes(course) | dict(made_from) | ({"sides": sides} if sides != 2 else {})
    told["largest_strain"] = told.pop("largest_strain")  # may follow from the others
    return Plan(f"slow {name}", f"a {name}", told, begin, restore, arguments)


class ImplicitDriver:
    """A flow by implicit steps.

    Parameters
    ----------
    first : Packing
        The first frame.
    course : Protocol or SlowShear
    flow : Flow
        Initial or resumed state.
    """

    def __init__(self, first: Packing, course: Protocol | SlowShear, flow: Flow) -> None:
        self._first, self._course, self._flow = first, course, flow
        self._run = ImplicitFlow(Landscape(first), flow, course)
        self._pressure = -math.inf

    @property
    def done(self) -> bool:
        """Whether the final strain, packing fraction or pressure is reached."""
        p_end = getattr(self._course, "p_end", math.inf)
        return self._pressure >= p_end or self._course.is_over(self._flow, self._run.phi)

    @property
    def at_mark(self) -> bool:
        """Whether `checkpoint` may be called now."""
        return self._flow.steps % STEPS_PER_MARK == 0

    def first(self) -> Row:
        """Return the progress at the start."""
        return Row(self._told(self._run.phi, ""))

    def advance(self) -> Row:
        """Take a step."""
        step = self._run.advance()
        self._pressure = step.pressure
        if self.at_mark:
            self._flow.forget()
        observables = {name: float(getattr(step, name)) for name in _ROW}
        observables |= self._course.measured(self._run.landscape, self._flow)
        told = self._told(step.phi, _where(step))
        has_frame = self.at_mark or self.done
        return Row(
            told, step.step, step.time, observables, step.wall_seconds, step.error, has_frame
        )

    def frame(self) -> Packing:
        """Return the present state."""
        flow = self._flow
        packing = flow.state.packing(self._first)
        return packing.with_(step=flow.steps, time=flow.time)

    def checkpoint(self) -> Checkpoint:
        """Return the state, its velocity and all counts."""
        return {"state": self._flow.state} | {name: getattr(self._flow, name) for name in _COUNTS}

    def results(self) -> dict[str, Any]:
        """Return the law, times of a box that yields, and the cost so far."""
        found = self._first.law.stated() | (self._run.box.times if self._run.box else {})
        return found | {f"flow_{name}": getattr(self._flow, name) for name in _COST}

    def close(self) -> None:
        """Nothing is held outside of Python."""

    def _told(self, phi: float, where: str) -> Told:
        course, flow = self._course, self._flow
        if isinstance(course, SlowShear):
            text = f"strain {flow.strain:.5f} of {course.strain_end:g}{where}"
            return Told("slow shear", text, min(1.0, flow.strain / course.strain_end))
        until = f" or {course.p_end:.3g}" if where and math.isfinite(course.p_end) else ""
        part = (phi - self._first.phi) / (course.phi_end - self._first.phi)
        text = f"phi {phi:.6f} of {course.phi_end:g}{where}{until}"
        return Told("slow compression", text, min(1.0, part))


def _where(step: Step) -> str:
    return f", step {step.dt:.1e}, pressure {step.pressure:.3e}"


def _as_attributes(course: Protocol | SlowShear) -> dict[str, Any]:
    found = {name: value for name, value in dataclasses.asdict(course).items() if value is not None}
    return found | ({"kappa": np.array(course.kappa)} if isinstance(course, Protocol) else {})


def course_of(stored: Mapping[str, Any]) -> Protocol | SlowShear:
    """Read the driving of a run from the attributes of its file."""
    kind = SlowShear if "gdot" in stored else Protocol
    names = {field.name for field in dataclasses.fields(kind)} & stored.keys()
    values = {name: stored[name] for name in names}
    if kind is SlowShear:
        return SlowShear(**values)
    rates = np.asarray(values.pop("kappa"))
    kappa = tuple((float(a), float(b)) for a, b in rates) if rates.ndim else float(rates)
    return Protocol(kappa=kappa, **values)
