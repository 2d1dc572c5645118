"""Appending to the file of a run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from jamshape.files import layout
from jamshape.files.h5md import read_packing, write_packing
from jamshape.files.layout import PathLike
from jamshape.packing import Packing

if TYPE_CHECKING:
    import h5py


class RunWriter:
    """Appends to the file of a run, which is opened, flushed and closed at each call.

    So the file is closed and readable however the process ends between two calls.

    Parameters
    ----------
    path : path-like
        A file that `write_packing` or `RunWriter.create` made.

    Raises
    ------
    FileFormatError, OSError
        As `read_packing`.
    """

    def __init__(self, path: PathLike) -> None:
        self.path = Path(path)
        self.first = read_packing(path, 0)

    @classmethod
    def create(
        cls,
        path: PathLike,
        first: Packing,
        attributes: Mapping[str, Any] | None = None,
        observables: Mapping[str, ArrayLike] | None = None,
    ) -> RunWriter:
        """Write the file with its first frame, as `write_packing`, and return its writer."""
        write_packing(path, first, attributes, observables)
        return cls(path)

    @classmethod
    def open(cls, path: PathLike) -> RunWriter:
        """Return a writer that appends to an existing file, under today's names."""
        writer = cls(path)
        with writer._file() as file:
            layout.rename_observables(file)
        return writer

    def append(self, packing: Packing, observables: Mapping[str, ArrayLike] | None = None) -> None:
        """Append a frame, and observables at its step and time.

        Raises
        ------
        ValueError
            If the particles are not those of the first frame in the same order, or the step is
            not after the last one.
        """
        self._check_same_particles(packing)
        with self._file() as file:
            frames, step, time = file["particles/all"], packing.step, packing.time
            layout.check_after("position", frames["position"], step)
            layout.append_observables(file["observables"], step, time, observables or {})
            layout.append_frame(frames, packing)

    def append_observables(
        self, step: int, time: float, observables: Mapping[str, ArrayLike]
    ) -> None:
        """Append observables between frames.

        Raises
        ------
        ValueError
            If the step is not after the last one of the same observable, or its type or shape
            has changed.
        """
        with self._file() as file:
            layout.append_observables(file["observables"], step, time, observables)

    def append_series(
        self, steps: ArrayLike, times: ArrayLike, observables: Mapping[str, ArrayLike]
    ) -> None:
        """Append (T,) rows of scalar observables at once, which costs little more than one.

        Raises
        ------
        ValueError
            If lengths differ, or steps do not ascend from the last one of the same observable.
        """
        steps, times = np.asarray(steps, np.int64), np.asarray(times, np.float64)
        columns = {name: np.asarray(value, np.float64) for name, value in observables.items()}
        if any(column.shape != steps.shape for column in (times, *columns.values())):
            msg = f"{self.path}: rows of a series differ in length, expected {steps.shape}"
            raise ValueError(msg)
        if not len(steps):
            return
        if (np.diff(steps) <= 0).any():
            msg = f"{self.path}: the steps of a series do not ascend, expected ascending ones"
            raise ValueError(msg)
        with self._file() as file:
            group = file["observables"]
            first = {name: column[0] for name, column in columns.items()}
            layout.append_observables(group, int(steps[0]), float(times[0]), first)
            for name, column in columns.items():
                rows = {"value": column, "time": times, "step": steps}
                for part, row in rows.items():
                    dataset = group[name][part]
                    n = len(dataset)
                    dataset.resize(n + len(row) - 1, axis=0)
                    dataset[n:] = row[1:]

    def append_report(self, step: ArrayLike, wall_seconds: ArrayLike, error: ArrayLike) -> None:
        """Append one row, or (T,) rows at once, to the convergence history.

        Raises
        ------
        ValueError
            If the lengths differ, or the steps, with those stored, ever decrease.
        """
        steps, seconds, errors = np.broadcast_arrays(
            *map(np.atleast_1d, (step, wall_seconds, error))
        )
        with self._file() as file:
            report = file["report"]
            n = len(report["step"])
            if (np.diff([*report["step"][max(n - 1, 0) : n], *steps]) < 0).any():
                msg = f"{self.path}: the report's steps decrease, expected ascending steps"
                raise ValueError(msg)
            rows = {"error": errors, "wall_seconds": seconds, "step": steps}
            for name, row in rows.items():
                report[name].resize(n + len(row), axis=0)
                report[name][n:] = row

    def truncate(self, step: int) -> None:
        """Drop all frames, observables and report rows after `step`, to resume from there.

        Raises
        ------
        ValueError
            If no frame would be left.
        """
        if step < self.first.step:
            msg = f"{self.path}: starts at step {self.first.step}, expected to keep step {step}"
            raise ValueError(msg)
        with self._file() as file:
            frames = file["particles/all"]
            names = layout.frame_values(self.first, rests="position_rest" in frames)
            values = [frames[name]["value"] for name in names]
            layout.truncate(step, frames["position"], values)
            for element in (*file["observables"].values(), file["report"]):
                layout.truncate(step, element)

    def set_attributes(self, attributes: Mapping[str, Any]) -> None:
        """Set attributes, replacing those of the same name; errors as `write_packing`."""
        with self._file() as file:
            layout.set_attributes(file["parameters"], attributes)

    def _file(self) -> h5py.File:
        return layout.hdf5().File(self.path, "r+")

    def _check_same_particles(self, packing: Packing) -> None:
        for name in ("dimension", "shape_style", "id", "species", "diameters", "exponent"):
            if not np.array_equal(getattr(packing, name), getattr(self.first, name)):
                msg = (
                    f"{self.path}: {name} differs from the first frame,"
                    " expected the same particles in the same order (Packing.sorted_by_id)"
                )
                raise ValueError(msg)
