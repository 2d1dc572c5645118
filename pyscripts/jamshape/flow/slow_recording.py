"""Slow flows in files: a run of `jamshape.flow.implicit` recorded in H5MD, resumed after a kill."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.files.h5md import read_attributes, read_observables, read_packing, require_attributes
from jamshape.files.run_writer import RunWriter
from jamshape.flow.implicit import Flow, Protocol, Step, compress, follow
from jamshape.flow.slow_shear import SlowShear
from jamshape.landscape import Landscape, State
from jamshape.measures.runs import onset_report
from jamshape.packing import Packing

# Steps between two frames, from which a run resumes.
STEPS_PER_FRAME = 100

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

_COUNTS = ("dt", "time", "strain", "turned", "steps", "rejected", "explicit", "evaluations", "factorisations",
           "wall_seconds", "explicit_left", "held", "extrapolates")  # fmt: skip


def begin(
    path: Path,
    start: Packing,
    protocol: Protocol | SlowShear,
    attributes: Mapping[str, Any] | None = None,
) -> None:
    """Write the file of a run with its first frame, which has two bonds side to side from then on."""
    start = start.with_(law=start.law.but(sides=2))
    stored = _as_attributes(protocol) | start.law._asdict()
    flow = Flow(State.of(start))
    stored |= dict(attributes or {}) | {"phi_start": start.phi, "finished": False}
    first = start.with_(step=0, time=0.0)
    RunWriter.create(path, _as_frame(flow, first), stored | _counts(flow)).close()


def require_same(
    path: Path, protocol: Protocol | SlowShear, attributes: Mapping[str, Any] | None = None
) -> None:
    """Refuse the file of a run with another protocol.

    Raises
    ------
    ValueError
    """
    what = "a shear" if isinstance(protocol, SlowShear) else "a compression"
    require_attributes(path, _as_attributes(protocol) | dict(attributes or {}), what)


def summary_of(path: Path) -> dict[str, object]:
    """Summarise a run: its end, its cost, phi_J(kappa) where p rises, and where frames stay jammed."""
    observables, stored = read_observables(path), read_attributes(path)
    found: dict[str, object] = {"out": str(path)}
    found |= {name: float(observables[name][-1]) for name in ("phi", "pressure", "u")}
    cost = ("steps", "rejected", "explicit", "evaluations", "factorisations", "wall_seconds")
    found |= {name: float(stored[f"flow_{name}"]) for name in cost}
    return found | onset_report(path)


def record(path: Path) -> Iterator[Step]:
    """Resume from the last frame to the end, writing rows and frames.

    Yields
    ------
    Step
        After each accepted step; rows are in the file with the next frame.
    """
    stored = read_attributes(path)
    course, landscape = course_of(stored), Landscape(read_packing(path, 0))
    rows: list[_Row] = []
    with RunWriter.open(path) as writer:
        writer.truncate(int(stored["flow_steps"]))
        flow = _flow(path, stored)
        for step in _steps(landscape, flow, course):
            rows.append(_Row(step, course.measured(landscape, flow)))
            if step.step % STEPS_PER_FRAME == 0:
                _keep(writer, rows, flow, landscape.particles)
            yield step
        if rows:
            _keep(writer, rows, flow, landscape.particles)
        writer.set_attributes({"finished": True})


class _Row(NamedTuple):
    step: Step
    more: dict[str, float]


def _steps(landscape: Landscape, flow: Flow, course: Protocol | SlowShear) -> Iterator[Step]:
    if isinstance(course, Protocol):
        return compress(landscape, flow, course)  # may also end at a pressure
    return follow(landscape, flow, course)


def _keep(writer: RunWriter, rows: list[_Row], flow: Flow, like: Packing) -> None:
    """Write a frame, and the rows up to it; the continuation depends on the frame alone."""
    flow.forget()
    steps, times = [row.step.step for row in rows], [row.step.time for row in rows]
    series = {name: [getattr(row.step, name) for row in rows] for name in _ROW}
    series |= {name: [row.more[name] for row in rows] for name in rows[0].more}
    writer.append_series(steps, times, series)
    seconds, errors = [row.step.wall_seconds for row in rows], [row.step.error for row in rows]
    writer.append_report(steps, seconds, errors)
    motion = {"velocity": flow.velocity, "acceleration": flow.acceleration}
    writer.append(_as_frame(flow, like), motion)
    writer.set_attributes(_counts(flow))
    rows.clear()


def _as_frame(flow: Flow, like: Packing) -> Packing:
    return dataclasses.replace(flow.state.packing(like), step=flow.steps, time=flow.time)


def _as_attributes(protocol: Protocol | SlowShear) -> dict[str, Any]:
    found = dataclasses.asdict(protocol)
    return found | ({"kappa": np.array(protocol.kappa)} if isinstance(protocol, Protocol) else {})


def _counts(flow: Flow) -> dict[str, float]:
    return {f"flow_{name}": getattr(flow, name) for name in _COUNTS}


def _flow(path: Path, stored: Mapping[str, Any]) -> Flow:
    # Files of earlier versions lack some.
    counts = {name: stored[f"flow_{name}"] for name in _COUNTS if f"flow_{name}" in stored}
    flow = Flow(State.of(read_packing(path)), **counts)
    if flow.steps:
        found = read_observables(path)
        flow.velocity, flow.acceleration = found["velocity"][-1], found["acceleration"][-1]
    return flow


def course_of(stored: Mapping[str, Any]) -> Protocol | SlowShear:
    """Read the driving of a run from the attributes of its file."""
    kind = SlowShear if "gdot" in stored else Protocol
    values = {field.name: stored[field.name] for field in dataclasses.fields(kind)}
    if kind is SlowShear:
        return SlowShear(**values)
    rates = np.asarray(values.pop("kappa"))
    kappa = tuple((float(a), float(b)) for a, b in rates) if rates.ndim else float(rates)
    return Protocol(kappa=kappa, **values)
