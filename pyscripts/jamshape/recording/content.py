"""Rows, frames and attributes of a run in memory, and as a whole in its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jamshape.files import layout
from jamshape.files.frames import Form
from jamshape.files.rows import as_column, check_after, check_same_particles, table
from jamshape.packing import Packing
from jamshape.recording.checkpoint import read_checkpoint, write_checkpoint
from jamshape.recording.driver import Checkpoint, Row

_CHECKPOINT = "checkpoint"  # group of a file that is not finished


@dataclass
class Column:
    """Rows of one observable."""

    steps: list[int] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    values: list[ArrayLike] = field(default_factory=list)

    def add(self, name: str, row: Row, value: ArrayLike) -> None:
        """Add a row; raises ValueError unless its step is after the last one."""
        check_after(name, self.steps[-1] if self.steps else None, row.step)
        self.steps.append(row.step)
        self.times.append(row.time)
        self.values.append(value)

    def table(self, name: str) -> NDArray[Any]:
        """Return the rows as a table of a file."""
        values = np.concatenate([as_column(value) for value in self.values])
        return table(self.steps, self.times, {name: values})


@dataclass
class Content:
    """What the file of a run holds.

    Parameters
    ----------
    path
    frames
        All frames, of the same particles.
    attributes
        Settings and results.
    columns
        Observables by name.
    report
        Convergence history: step, wall seconds, error.
    checkpoint
        From which an unfinished run goes on.
    """

    path: Path
    frames: list[Packing]
    attributes: dict[str, Any]
    columns: dict[str, Column] = field(default_factory=dict)
    report: list[tuple[int, float, float]] = field(default_factory=list)
    checkpoint: Checkpoint | None = None

    def __post_init__(self) -> None:
        """Add the dimension, which older files lack."""
        self.attributes.setdefault("dimension", self.frames[0].dimension)

    @classmethod
    def read(cls, path: Path) -> Content:
        """Read a file; errors as `jamshape.files.h5md.read_packing`."""
        with layout.opened(path) as file:
            n_frames = layout.count(file, "particles/all/position")
            frames = [layout.read_frame(file, k) for k in range(n_frames)]
            attributes = layout.require_item(file, "parameters").attrs.items()
            found = cls(path, frames, {name: layout.plain(value) for name, value in attributes})
            for name in layout.require_item(file, "observables"):
                series = layout.read_rows(file, name)
                lists = (series.step.tolist(), series.time.tolist(), list(series.value))
                found.columns[name] = Column(*lists)
            n = layout.count(file, "report")
            rows = [
                layout.require_rows(file, "report", name)[:n].tolist() for name in layout.REPORT
            ]
            found.report = list(zip(*rows, strict=True))
            if _CHECKPOINT in file:
                found.checkpoint = read_checkpoint(layout.require_item(file, _CHECKPOINT))
        return found

    def add(self, row: Row, frame: Packing | None) -> None:
        """Add a row, and a frame if there is one.

        Raises
        ------
        ValueError
            If the step is not after those before, or the particles are others.
        """
        for name, value in (row.observables or {}).items():
            self.columns.setdefault(name, Column()).add(name, row, value)
        if row.error is not None:
            self.report.append((row.step, row.wall_seconds, row.error))
        if frame is not None:
            check_same_particles(self.path, self.frames[0], frame)
            check_after("position", self.frames[-1].step, frame.step)
            self.frames.append(frame)

    def write(self, attributes: Mapping[str, Any], checkpoint: Checkpoint | None) -> None:
        """Replace the file by the present content, with results so far; errors as `write_packing`."""
        self.attributes |= dict(attributes) | {"finished": checkpoint is None}
        first, *others = self.frames
        with layout.written(self.path) as file:
            layout.create_file(file, first, self.attributes, {})
            if others:
                form = Form.of(first)
                for frame in others:
                    form = form.joined(Form.of(frame))
                rows = np.concatenate([layout.frames_table(frame, form) for frame in others])
                layout.append_table(file, layout.FRAMES, rows)
            for name, column in self.columns.items():
                layout.append_table(file, layout.OBSERVABLES, column.table(name))
            if self.report:
                types = list(layout.REPORT.items())
                rows = np.array(self.report, types)
                layout.append_table(file, layout.REPORT_TABLE, rows)
            if checkpoint is not None:
                write_checkpoint(file.create_group(_CHECKPOINT), checkpoint)


def set_attributes(path: Path, attributes: Mapping[str, Any]) -> None:
    """Add results to the file of a finished run; errors as `write_packing`."""
    with layout.rewritten(path) as file:
        layout.set_attributes(file["parameters"], attributes)


__all__ = ["Column", "Content", "set_attributes"]
