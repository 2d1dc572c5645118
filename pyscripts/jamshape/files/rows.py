"""Rows for the file of a run: checked against stored ones, and arranged as tables of the journal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jamshape.files.disk import PathLike
from jamshape.files.frames import Form
from jamshape.files.journal import Record, Table
from jamshape.packing import Packing

if TYPE_CHECKING:
    import h5py

Columns = Mapping[str, NDArray[Any]]
"""Arrays (T, ...) by name."""


class Kind(NamedTuple):
    """Type and shape of a row of an observable."""

    dtype: np.dtype[Any]
    shape: tuple[int, ...]


class Scalars(NamedTuple):
    """Scalar observables stored last in one row."""

    names: tuple[str, ...]
    dtype: np.dtype[Any]
    """Type of the row."""


@dataclass
class Stored:
    """State of a run's file that determines which rows may follow."""

    frame: int | None = None
    """Step of the last frame."""
    report: int | None = None
    observables: dict[str, Kind] = field(default_factory=dict)
    last: dict[str, int] = field(default_factory=dict)
    """Step of the last row of each observable."""
    form: Form = field(default_factory=Form)
    """Form of the frames."""
    scalars: Scalars | None = None

    @classmethod
    def of(cls, file: h5py.File) -> Stored:
        """Read the state of a file."""

        def last(group: h5py.Group) -> int | None:
            steps = group["step"]
            return int(steps[-1]) if len(steps) else None

        def kind(group: h5py.Group) -> Kind:
            value = group["value"]
            return Kind(value.dtype, value.shape[1:])

        groups = dict(file["observables"])
        steps = {name: last(group) for name, group in groups.items()}
        return cls(
            last(file["particles/all/position"]),
            last(file["report"]),
            {name: kind(group) for name, group in groups.items()},
            {name: step for name, step in steps.items() if step is not None},
            Form.found(file),
        )

    def check_observables(self, step: int, columns: Columns) -> None:
        """Raise unless rows can follow at a step.

        Raises
        ------
        ValueError
        """
        for name, column in columns.items():
            self._check_kind(name, column)
            check_after(name, self.last.get(name), step)

    def add_observables(self, step: int, columns: Columns) -> None:
        """Note that observables are stored up to a step."""
        for name, column in columns.items():
            self.observables[name] = Kind(column.dtype, column.shape[1:])
        self.note(step, columns)
        scalar = Kind(np.dtype(np.float64), ())
        self.scalars = None
        if all(self.observables[name] == scalar for name in columns):
            empty = np.empty(0)
            self.scalars = Scalars(
                tuple(columns), table([], [], dict.fromkeys(columns, empty)).dtype
            )

    def note(self, step: int, names: Iterable[str]) -> None:
        """Note the last step of known observables."""
        self.last.update(dict.fromkeys(names, step))

    def next_row(
        self, step: int, time: float, observables: Mapping[str, ArrayLike]
    ) -> Table | None:
        """Return a row like the last one, at a later step; None if it differs.

        The rows of a compression are all of this kind, and checking each anew would take longer than a
        small run may.
        """
        known, values = self.scalars, observables.values()
        if known is None or tuple(observables) != known.names or {*map(type, values)} != {float}:
            return None
        if step <= max(self.last[name] for name in known.names):
            return None
        return np.array([(step, time, *values)], known.dtype)

    def _check_kind(self, name: str, column: NDArray[Any]) -> None:
        if not name or "/" in name or name == ".":
            msg = f"observable is named {name!r}, expected a name without '/'"
            raise ValueError(msg)
        if column.dtype.kind not in "biuf":
            msg = f"observable {name!r} has dtype {column.dtype}, expected numbers"
            raise ValueError(msg)
        stored = self.observables.get(name)
        if stored and (column.dtype, column.shape[1:]) != stored:
            expected = f"{stored.dtype} {stored.shape}"
            found = f"{column.dtype} {column.shape[1:]}"
            msg = f"observable {name!r} is {found}, expected {expected} as before"
            raise ValueError(msg)


def check_after(name: str, last: int | None, step: int) -> None:
    """Refuse a step that is not after the last one."""
    if last is not None and step <= last:
        msg = f"{name} is stored up to step {last}, expected a step after it, found {step}"
        raise ValueError(msg)


def check_same_particles(path: PathLike, first: Packing, packing: Packing) -> None:
    """Refuse a frame of other particles than those of the first one."""
    for name in ("dimension", "shape_style", "id", "species", "diameters", "exponent", "law"):
        if not np.array_equal(getattr(packing, name), getattr(first, name)):
            msg = (
                f"{path}: {name} differs from the first frame,"
                " expected the same particles in the same order (Packing.sorted_by_id)"
            )
            raise ValueError(msg)


def as_column(value: ArrayLike) -> NDArray[Any]:
    """Convert the value of an observable to a column of one row."""
    array = np.asarray(value)
    # A first value that happens to be an integer must not make an integer series.
    if array.ndim == 0 and array.dtype.kind in "biuf":
        array = array.astype(np.float64)
    return array[None]


def table(steps: ArrayLike, times: ArrayLike, columns: Columns) -> Table:
    """Join columns into a table, after their steps and times."""
    return beside({"step": np.asarray(steps, np.int64), "time": np.asarray(times), **columns})


def beside(columns: Columns, types: Mapping[str, Any] | None = None) -> Table:
    """Join columns, with their own types or others."""
    dtype = np.dtype(
        [(name, (types or {}).get(name, c.dtype), c.shape[1:]) for name, c in columns.items()]
    )
    rows = np.empty(len(next(iter(columns.values()))), dtype)
    for name, column in columns.items():
        rows[name] = column
    return rows


class Gathered(NamedTuple):
    """All rows of a journal, in tables as long as possible."""

    tables: list[tuple[str, Table]]
    attributes: dict[str, Any]


ATTRIBUTES = "attributes"
"""Table of numeric attributes, with one row."""


def gathered(records: Iterable[Record]) -> Gathered:
    """Join the rows of records, in order for each table; later attributes replace earlier ones."""
    runs: dict[str, list[list[Table]]] = {}
    attributes: dict[str, Any] = {}
    for record in records:
        attributes |= record.texts
        for name, rows in record.tables.items():
            if name == ATTRIBUTES:
                attributes |= {key: rows[key][0] for key in rows.dtype.names or ()}
                continue
            known = runs.setdefault(name, [])
            if known and known[-1][0].dtype == rows.dtype:
                known[-1].append(rows)
            else:
                known.append([rows])
    tables = [(name, np.concatenate(run)) for name, known in runs.items() for run in known]
    return Gathered(tables, attributes)
