"""Content of the file of a packing or a run, in memory: frames, observables, attributes, and a checkpoint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jamshape.files import layout
from jamshape.files.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from jamshape.files.disk import PathLike
from jamshape.files.hdf5 import (
    attributes,
    has_item,
    put,
    require_item,
    set_attributes,
    written,
)
from jamshape.files.layout import Report, Series
from jamshape.packing import Packing

if TYPE_CHECKING:
    import h5py

_CHECKPOINT = "checkpoint"  # group of a file that is not finished

_OF_PARTICLES = ("dimension", "shape_style", "id", "species", "diameters", "form", "law")


@dataclass
class Column:
    """Rows of one observable."""

    steps: list[int] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    values: list[NDArray[Any]] = field(default_factory=list)

    def checked(self, name: str, step: int, value: ArrayLike) -> NDArray[Any]:
        """Return a row as it is stored; raises ValueError unless it can follow the rows before."""
        # Numbers are doubles: a first one that happens to be an integer must not make an integer series.
        row = np.asarray(value)
        row = row.astype(np.float64) if row.ndim == 0 and row.dtype.kind in "biuf" else row
        if not self.steps:
            _require_storable(name, row)
            return row
        last = self.values[-1]
        if (row.dtype, row.shape) != (last.dtype, last.shape):
            msg = f"observable {name!r} is {row.dtype} {row.shape}, expected {last.dtype} {last.shape} as before"
            raise ValueError(msg)
        _require_after(name, self.steps[-1], step)
        return row

    def has_clock_of(self, other: Column) -> bool:
        """Whether another observable has rows at the same steps and times."""
        return self.steps == other.steps and self.times == other.times


@dataclass
class Content:
    """Content of a file.

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
        From which an unfinished run is resumed; None for a finished one, and for a checkpoint of another version.
    """

    path: Path
    frames: list[Packing]
    attributes: dict[str, Any]
    columns: dict[str, Column] = field(default_factory=dict)
    report: list[tuple[int, float, float]] = field(default_factory=list)
    checkpoint: Checkpoint | None = None

    @classmethod
    def read(cls, path: Path) -> Content:
        """Read a file; errors as `jamshape.files.h5md.read_packing`."""
        with layout.opened(path) as file:
            found = cls.of(path, file)
            if has_item(file, _CHECKPOINT):
                found.checkpoint = read_checkpoint(require_item(file, _CHECKPOINT))
        return found

    @classmethod
    def of(cls, path: Path, file: h5py.File) -> Content:
        """Read an open file of any format version, without a checkpoint."""
        reader = layout.FrameReader(file)
        frames = [reader.read(k) for k in range(reader.n_frames)]
        found = cls(path, frames, attributes(file, "parameters"))
        for name in require_item(file, "observables"):
            steps, times, values = layout.read_rows(file, name)
            found.columns[name] = Column(steps.tolist(), times.tolist(), list(values))
        rows = (column.tolist() for column in layout.read_report(file))
        found.report = list(zip(*rows, strict=True))
        return found

    def add_frame(self, frame: Packing) -> None:
        """Add a frame; raises ValueError if its step is not after those before, or its particles are others."""
        for name in _OF_PARTICLES:
            own, first = getattr(frame, name), getattr(self.frames[0], name)
            if own != first if name == "law" else not np.array_equal(own, first):
                msg = (
                    f"{self.path}: {name} differs from the first frame,"
                    " expected the same particles in the same order (Packing.sorted_by_id)"
                )
                raise ValueError(msg)
        _require_after("position", self.frames[-1].step, frame.step)
        self.frames.append(frame)

    def add_row(self, step: int, time: float, observables: Mapping[str, ArrayLike]) -> None:
        """Add a row of some observables, or none of it; raises ValueError as `Column.checked`."""
        columns = {name: self.columns.get(name) or Column() for name in observables}
        rows = {name: columns[name].checked(name, step, observables[name]) for name in observables}
        self.columns |= columns
        for name, column in columns.items():
            column.steps.append(step)
            column.times.append(time)
            column.values.append(rows[name])

    def write(self) -> None:
        """Replace the file; errors as `jamshape.files.h5md.write_packing`."""
        with written(self.path) as file:
            self.fill(file)

    def fill(self, file: h5py.File) -> None:
        """Write into an empty file."""
        layout.write_metadata(file)
        layout.write_particles(file.create_group("particles/all"), self.frames)
        group = file.create_group("observables")
        written_clocks: list[tuple[Column, Any]] = []
        for name, column in self.columns.items():
            values, element = np.array(column.values), group.create_group(name)
            known = (of for other, of in written_clocks if other.has_clock_of(column))
            if clock := next(known, None):  # most observables are in every row
                element["step"], element["time"] = clock["step"], clock["time"]
                put(element, "value", values)
                continue
            series = Series(np.array(column.steps), np.array(column.times), values)
            layout.write_rows(element, series)
            written_clocks.append((column, element))
        steps, seconds, errors = zip(*self.report, strict=True) if self.report else ((), (), ())
        report = Report(
            np.array(steps, np.int64), np.array(seconds, float), np.array(errors, float)
        )
        layout.write_rows(file.create_group("report"), report)
        set_attributes(file.create_group("parameters"), self.attributes)
        if self.checkpoint is not None:
            write_checkpoint(file.create_group(_CHECKPOINT), self.checkpoint)


def _require_storable(name: str, row: NDArray[Any]) -> None:
    if not name or "/" in name or name == ".":
        msg = f"observable is named {name!r}, expected a name without '/'"
        raise ValueError(msg)
    if row.dtype.kind not in "biuf":
        msg = f"observable {name!r} has dtype {row.dtype}, expected numbers"
        raise ValueError(msg)


def _require_after(name: str, last: int, step: int) -> None:
    if step <= last:
        msg = f"{name} is stored up to step {last}, expected a step after it, found {step}"
        raise ValueError(msg)


def add_attributes(path: PathLike, found: Mapping[str, Any]) -> None:
    """Add results to a file without other writers; errors as `jamshape.files.h5md.write_packing`."""
    with layout.changed(path, path) as file:
        set_attributes(file["parameters"], found)
