"""Quasistatic shears in files: a run of `jamshape.flow.quasistatic` recorded in H5MD, resumed after a kill."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.files.h5md import read_attributes, read_packing, require_attributes
from jamshape.files.run_writer import RunWriter
from jamshape.flow.quasistatic import QuasistaticShear, Row, Sheared, shear
from jamshape.landscape import Landscape, State
from jamshape.packing import Packing

# Largest number of steps between frames, from which a run resumes.
MOST_STEPS_PER_FRAME = 50

_ROW = tuple(name for name in Row._fields if name not in {"step", "wall_seconds", "residual"})
_COUNTS = ("steps", "u", "stress", "pressure", "volume", "evaluations", "wall_seconds")


def begin(
    path: Path, start: Packing, how: QuasistaticShear, attributes: Mapping[str, Any] | None = None
) -> None:
    """Write the file of a run with its start as the first frame, which has two bonds side to side from then on."""
    start = start.with_(law=start.law.but(sides=2))
    stored = dataclasses.asdict(how) | start.law._asdict() | dict(attributes or {})
    stored |= {"phi_start": start.phi, "finished": False} | _counts(Sheared(State.of(start)))
    # Images would count cell vectors that no longer exist.
    first = start.with_(step=0, time=0.0, image=np.zeros_like(start.image))
    RunWriter.create(path, State.of(start).packing(first), stored).close()


def require_same(path: Path, how: QuasistaticShear, attributes: Mapping[str, Any]) -> None:
    """Refuse the file of another run.

    Raises
    ------
    ValueError
    """
    require_attributes(path, dataclasses.asdict(how) | dict(attributes), "a quasistatic shear")


def record(path: Path) -> Iterator[Row]:
    """Go on from the last frame to the end, writing rows and frames.

    Yields
    ------
    Row
        After each step; rows are in the file with the next frame.
    """
    stored, like = read_attributes(path), read_packing(path, 0)
    names = [f.name for f in dataclasses.fields(QuasistaticShear)]
    how = QuasistaticShear(**{name: stored[name] for name in names})
    landscape = Landscape(like)
    per_frame = max(1, min(MOST_STEPS_PER_FRAME, how.steps // int(stored.get("frames", 20))))
    rows: list[Row] = []
    with RunWriter.open(path) as writer:
        # The first frame is the start, and the second its minimum: steps count from there.
        writer.truncate(int(stored["shear_steps"]) + 1)
        run = Sheared(
            State.of(read_packing(path)), **{name: stored[f"shear_{name}"] for name in _COUNTS}
        )
        for row in shear(landscape, run, how):
            rows.append(row)
            if row.step % per_frame == 0 or row.step == how.steps:
                _keep(writer, rows, run, like)
            yield row
        writer.set_attributes({"finished": True})


def _keep(writer: RunWriter, rows: list[Row], run: Sheared, like: Packing) -> None:
    """Write a frame, and the rows up to it."""
    steps, strains = [row.step + 1 for row in rows], [row.strain for row in rows]
    writer.append_series(steps, strains, {k: [getattr(row, k) for row in rows] for k in _ROW})
    seconds, errors = [row.wall_seconds for row in rows], [row.residual for row in rows]
    writer.append_report(steps, seconds, errors)
    frame = dataclasses.replace(run.state.packing(like), step=steps[-1], time=strains[-1])
    writer.append(frame)
    writer.set_attributes(_counts(run))
    rows.clear()


def _counts(run: Sheared) -> dict[str, float]:
    return {f"shear_{name}": getattr(run, name) for name in _COUNTS}
