"""Crash-safe appending to the file of a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from jamshape.files import layout
from jamshape.files.disk import PathLike, named, real
from jamshape.files.frames import Form
from jamshape.files.h5md import read_packing
from jamshape.files.journal import Journal, Table, journal_of, new_token
from jamshape.files.rows import (
    ATTRIBUTES,
    Columns,
    Stored,
    as_column,
    beside,
    check_after,
    check_same_particles,
    table,
)
from jamshape.packing import Packing

if TYPE_CHECKING:
    import h5py

_PART = 0.25  # of the HDF5 file, at which rows are folded into it: a few times its final size is written in all
_PAUSE = 200  # time between foldings, over the time of the last one
_SECONDS = 0.05  # typical time of one, used until measured
_REPORT = np.dtype(list(layout.REPORT.items()))


def fold(path: PathLike) -> None:
    """Fold rows left in the journal by a killed process into the file of a finished run.

    Raises
    ------
    FileFormatError, OSError
        As in `RunWriter`.
    """
    if journal_of(path).exists():
        RunWriter.open(path).close()


class RunWriter:
    """Appends to the file of a run: rows to its journal, which are folded into the file now and then.

    The file is complete at any time, and reading with `jamshape.files.h5md` returns all rows; other
    programs see those that were folded, all of them once the writer is closed. Nobody else can write the
    run until then. It is a context manager, which closes it.

    Parameters
    ----------
    path : path-like
        A file made by `write_packing` or `RunWriter.create`.

    Raises
    ------
    FileFormatError
        As `read_packing`.
    OSError
        If the file is not there, is written by another process, or cannot be written.
    """

    def __init__(self, path: PathLike) -> None:
        self.path = Path(path).absolute()
        self.first = read_packing(path, 0)
        self._journal = Journal(path)
        try:
            if not self._goes_on():
                self._fold()
        except BaseException:
            self._journal.close(and_remove=False)
            raise

    @classmethod
    def create(
        cls,
        path: PathLike,
        first: Packing,
        attributes: Mapping[str, Any] | None = None,
        observables: Mapping[str, ArrayLike] | None = None,
    ) -> Self:
        """Write the file with its first frame, as `write_packing`, and return its writer."""
        journal, writer = Journal(path), cls.__new__(cls)
        writer.path, writer.first, writer._journal = Path(path).absolute(), first, journal
        try:
            with writer._replacing(layout.written(path)) as file:
                layout.create_file(file, first, attributes or {}, observables or {})
        except BaseException:
            journal.close(and_remove=not real(path).exists())
            raise
        return writer

    @classmethod
    def open(cls, path: PathLike) -> Self:
        """Return a writer that appends to an existing file, under current names."""
        return cls(path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None:
            self.close()
            return
        with suppress(OSError):  # rows are safe in the journal; report the first error
            self.close()

    def close(self) -> None:
        """Fold all rows into the file and let others write it.

        Raises
        ------
        OSError
            If the file cannot be written; the rows stay in the journal.
        """
        if self._journal.is_closed:
            return
        try:
            if not self._journal.is_empty:
                self._fold(is_last=True)
        except BaseException:
            self._journal.close(and_remove=False)
            raise
        self._journal.close(and_remove=True)

    def append(self, packing: Packing, observables: Mapping[str, ArrayLike] | None = None) -> None:
        """Append a frame, and observables at its step and time.

        Raises
        ------
        ValueError
            If the particles are not those of the first frame in the same order, or the step is
            not after the last one.
        """
        check_same_particles(named(self.path), self.first, packing)
        step, stored = packing.step, self._stored
        check_after("position", stored.frame, step)
        columns = {name: as_column(value) for name, value in (observables or {}).items()}
        stored.check_observables(step, columns)
        form = stored.form.joined(Form.of(packing))
        tables = {layout.FRAMES: layout.frames_table(packing, form)}
        if columns:
            tables[layout.OBSERVABLES] = table([step], [packing.time], columns)
        self._append(tables)
        stored.frame, stored.form = step, form
        stored.add_observables(step, columns)

    def append_observables(
        self,
        step: int,
        time: float,
        observables: Mapping[str, ArrayLike],
        report: tuple[float, float] | None = None,
    ) -> None:
        """Append observables between frames, and wall seconds and error to the report.

        Raises
        ------
        ValueError
            If the step is not after the last one of the same observable, or its type or shape
            has changed.
        """
        row, tables = self._stored.next_row(step, time, observables), {}
        if report and (row is None or step < (self._stored.report or 0)):
            tables = self._reported(step, *report)
        elif report:
            tables = {layout.REPORT_TABLE: np.array([(step, *report)], _REPORT)}
        if row is None:
            columns = {name: as_column(value) for name, value in observables.items()}
            self._append_columns([step], [time], columns, tables)
        else:
            self._append({layout.OBSERVABLES: row, **tables})
            self._stored.note(step, observables)

    def append_series(
        self, steps: ArrayLike, times: ArrayLike, observables: Mapping[str, ArrayLike]
    ) -> None:
        """Append (T,) rows of scalar observables at once.

        Raises
        ------
        ValueError
            If lengths differ, or steps do not ascend from the last one of the same observable.
        """
        steps, times = np.asarray(steps, np.int64), np.asarray(times, np.float64)
        columns = {name: np.asarray(value, np.float64) for name, value in observables.items()}
        if any(column.shape != steps.shape for column in (times, *columns.values())):
            msg = f"{named(self.path)}: rows of a series differ in length, expected {steps.shape}"
            raise ValueError(msg)
        if (np.diff(steps) <= 0).any():
            msg = (
                f"{named(self.path)}: the steps of a series do not ascend, expected ascending ones"
            )
            raise ValueError(msg)
        self._append_columns(steps, times, columns, {})

    def append_report(self, step: ArrayLike, wall_seconds: ArrayLike, error: ArrayLike) -> None:
        """Append one row, or (T,) rows at once, to the convergence history.

        Raises
        ------
        ValueError
            If the lengths differ, or the steps, with those stored, ever decrease.
        """
        self._append(self._reported(step, wall_seconds, error))

    def truncate(self, step: int) -> None:
        """Drop all frames, observables and report rows after `step`, to resume from there.

        Raises
        ------
        ValueError
            If no frame would be left.
        """
        if step < self.first.step:
            msg = f"{named(self.path)}: starts at step {self.first.step}, expected to keep step {step}"
            raise ValueError(msg)
        self._fold(up_to=step)

    def set_attributes(self, attributes: Mapping[str, Any]) -> None:
        """Set attributes, replacing those of the same name; errors as `write_packing`."""
        layout.check_attributes(attributes)
        texts = {name: value for name, value in attributes.items() if isinstance(value, str)}
        numbers = {k: np.asarray(v)[None] for k, v in attributes.items() if k not in texts}
        self._append({ATTRIBUTES: beside(numbers)} if numbers else {}, texts)

    def _append_columns(
        self, steps: ArrayLike, times: ArrayLike, columns: Columns, more: Mapping[str, Table]
    ) -> None:
        steps = np.asarray(steps, np.int64)
        if len(steps) and columns:
            self._stored.check_observables(int(steps[0]), columns)
            self._append({layout.OBSERVABLES: table(steps, times, columns), **more})
            self._stored.add_observables(int(steps[-1]), columns)

    def _reported(
        self, step: ArrayLike, wall_seconds: ArrayLike, error: ArrayLike
    ) -> dict[str, Table]:
        """Check rows of the report."""
        given = np.broadcast_arrays(*map(np.atleast_1d, (step, wall_seconds, error)))
        columns = dict(zip(layout.REPORT, given, strict=True))
        steps, last = columns["step"], self._stored.report
        if (np.diff(steps, prepend=steps[:1] if last is None else last) < 0).any():
            msg = f"{named(self.path)}: the report's steps decrease, expected ascending steps"
            raise ValueError(msg)
        return {layout.REPORT_TABLE: beside(columns, layout.REPORT)} if len(steps) else {}

    def _append(self, tables: Mapping[str, Table], texts: Mapping[str, str] | None = None) -> None:
        if not tables and not texts:
            return
        self._journal.append(tables, texts or {})
        if layout.REPORT_TABLE in tables:
            self._stored.report = int(tables[layout.REPORT_TABLE]["step"][-1])
        if self._journal.length > _PART * self._bytes and perf_counter() > self._fold_after:
            self._fold()

    def _fold(self, *, up_to: int | None = None, is_last: bool = False) -> None:
        """Put the rows of the journal into the file, and drop those after a step."""
        with self._replacing(layout.rewritten(self.path), is_last=is_last) as file:
            self._add_pending(file)
            layout.rename_observables(file)
            if up_to is not None:
                layout.truncate_all(file, up_to)

    def _goes_on(self) -> bool:
        """Begin an empty journal from the file as it is, if a writer left it ready for that."""
        if self._journal.read():
            return False
        with layout.opened(self.path) as file:
            token = layout.token_of(file)
            if not token or not layout.has_todays_names(file):
                return False
            self._stored = Stored.of(file)
        self._begin(token, _SECONDS)
        return True

    def _begin(self, token: str, seconds: float) -> None:
        """Begin an empty journal, after writing the file in some seconds."""
        self._journal.begin(token)
        self._bytes = self.path.stat().st_size
        self._fold_after = perf_counter() + _PAUSE * seconds

    def _add_pending(self, file: h5py.File) -> None:
        pending = self._journal.read()
        is_own = layout.fold(file, pending)
        if self._journal.length and not is_own:
            msg = (
                f"{named(self.path)}: another program has replaced this file, expected to be the only one"
                " that writes it; write to another file"
            )
            raise layout.FileFormatError(msg)

    @contextmanager
    def _replacing(self, change: Any, *, is_last: bool = False) -> Iterator[h5py.File]:
        """Replace the file by a changed one, continued by an empty journal."""
        began, token = perf_counter(), None if is_last else new_token()
        with change as file:
            yield file
            layout.set_token(file, token)
            self._stored = Stored.of(file)
        if token:
            self._begin(token, perf_counter() - began)
