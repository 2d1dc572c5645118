r"""Packings and runs as H5MD 1.1 files; a packing is a run with one frame.

::

    /h5md               +version [1, 1]   author/+name   creator/+name, version
    /particles/all      +shape_style
        box             +dimension D   +boundary D times "periodic"
            edges, lo   {step, time, value (T, D)}, lo is the lower corner (not in H5MD)
        position        {step, time, value (T, N, D)}
        orientation     {step, time, value (T, N) angles in 2D, (T, N, 4) quaternions w i j k in 3D}
        image           {step, time, value (T, N, D)}
        position_rest, orientation_rest, box/edges_rest    what the doubles of these leave out, as more
                        doubles, in files of states that are known to more digits (not in H5MD)
        species, id     (N,)
        diameters       (N, 3), the shape columns of LAMMPS (not in H5MD)
        exponent        (N,), of superellipsoids (not in H5MD)
    /observables/NAME   {step, time, value (T', ...)}, each sampled when its caller likes
    /parameters         +every attribute that the caller gives, results too
    /report             step, wall_seconds, error (T'',): the convergence history

`step` and `time` of all elements under /particles/all are hard links to those of `position`, as
H5MD asks. `step` is written last and counts the rows: what an interrupted append has left beyond
it is neither read nor kept.

MDAnalysis reads such files in 3D (``H5MDReader(path, convert_units=False)``); it refuses any box
that is not three-dimensional, so 2D files, which hold honest (T, N, 2) positions, are for h5py and
the other H5MD tools. It pairs row i of each observable with frame i, whatever their steps, and
fails on an observable with fewer rows than there are frames.

The specification: https://nongnu.org/h5md/h5md.html
"""

from __future__ import annotations

import importlib.metadata
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.packing import Box, Packing

if TYPE_CHECKING:
    import h5py

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"

PathLike = str | os.PathLike[str]

# Large enough for a long series to be a few chunks, small enough to keep a packing's file small.
_CHUNK_BYTES = 1024
_ATTRIBUTE_BYTES = 60_000  # HDF5 refuses attributes of 64 kB and more
# Fields of a packing and their elements under /particles/all.
_RESTS = {
    "position_rest": "position_rest",
    "orientation_rest": "orientation_rest",
    "edges_rest": "box/edges_rest",
}
_REPORT = {"step": np.int64, "wall_seconds": np.float64, "error": np.float64}


class FileFormatError(ValueError):
    """A file's content is not what it should be; the sentence names the file."""


class Series(NamedTuple):
    """One observable against time."""

    step: IntArray
    """(T,)"""
    time: FloatArray
    """(T,)"""
    value: NDArray[Any]
    """(T, ...)"""


class Report(NamedTuple):
    """Convergence history."""

    step: IntArray
    """(T,)"""
    wall_seconds: FloatArray
    """(T,)"""
    error: FloatArray
    """(T,) relative errors, in the meaning of whoever wrote them."""


@contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """Give a temporary path in the folder of `path`, which takes its place if the body succeeds.

    If the body raises, the temporary file is removed and what stood at `path` still stands.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_packing(
    path: PathLike,
    packing: Packing,
    attributes: Mapping[str, Any] | None = None,
    observables: Mapping[str, ArrayLike] | None = None,
) -> None:
    """Write a packing, replacing the file at `path` only when all is written.

    Parameters
    ----------
    path : path-like
    packing : Packing
    attributes : mapping of str to bool, int, float, str or small array, optional
    observables : mapping of str to array_like of numbers, optional
        Each is stored as one row at the packing's step and time: scalars as float64, arrays in
        their own type. NaN may stand for what is not defined.

    Raises
    ------
    ValueError
        If an attribute or an observable cannot be stored.
    OSError
        If the file cannot be written.
    """
    with replacing(path) as temporary, _h5py().File(temporary, "w") as file:
        _write_metadata(file)
        _create_particles(file.create_group("particles/all"), packing)
        _append_frame(file["particles/all"], packing)
        group = file.create_group("observables")
        _append_observables(group, packing.step, packing.time, observables or {})
        _set_attributes(file.create_group("parameters"), attributes or {})
        for name, dtype in _REPORT.items():
            _create_rows(file.require_group("report"), name, np.zeros((), dtype))


def read_packing(path: PathLike, frame: int = -1) -> Packing:
    """Read one frame of a packing or a run.

    Parameters
    ----------
    path : path-like
    frame : int
        From 0; negative ones count from the end.

    Raises
    ------
    FileFormatError
        If the file is not a complete H5MD file of this module, or a value is not finite.
    ValueError
        If there is no such frame.
    OSError
        If the file cannot be opened.
    """
    with _opened(path) as file:
        n_frames = _count(file, "particles/all/position")
        if not -n_frames <= frame < n_frames:
            msg = f"{path}: has {n_frames} frames, expected frame {frame} to be one of them"
            raise ValueError(msg)
        return _packing(file, frame % n_frames)


def count_frames(path: PathLike) -> int:
    """Count the frames of a packing (one) or a run; errors as `read_packing`."""
    with _opened(path) as file:
        return _count(file, "particles/all/position")


def read_attributes(path: PathLike) -> dict[str, Any]:
    """Read the attributes, as bool, int, float, str or array; errors as `read_packing`."""
    with _opened(path) as file:
        attributes = _item(file, "parameters").attrs
        return {name: _plain(value) for name, value in attributes.items()}


def require_attributes(out: Path, expected: Mapping[str, Any], what: str = "a packing") -> None:
    """Refuse a file with other attributes than expected.

    Raises
    ------
    ValueError
    """
    stored = read_attributes(out)
    for name, value in expected.items():
        if not np.array_equal(stored.get(name, np.nan), value):
            msg = (
                f"{out} holds {what} with {name} = {stored.get(name)}, expected {value};"
                " write to another file, or make it again"
            )
            raise ValueError(msg)


def read_observables(path: PathLike) -> dict[str, NDArray[Any]]:
    """Read all observables as arrays (T, ...), T = 1 in a packing; errors as `read_packing`."""
    with _opened(path) as file:
        return {name: _series(file, name).value for name in _item(file, "observables")}


def read_series(path: PathLike, name: str) -> Series:
    """Read one observable with its steps and times; errors as `read_packing`."""
    with _opened(path) as file:
        return _series(file, name)


def read_report(path: PathLike) -> Report:
    """Read the convergence history; errors as `read_packing`."""
    with _opened(path) as file:
        n = _count(file, "report")
        return Report(*(_rows(file, "report", name)[:n] for name in _REPORT))


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
        self._first = read_packing(path, 0)

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
        """Return a writer that appends to an existing file."""
        return cls(path)

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
            _check_after("position", frames["position"], step)
            _append_observables(file["observables"], step, time, observables or {})
            _append_frame(frames, packing)

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
            _append_observables(file["observables"], step, time, observables)

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
            _append_observables(group, int(steps[0]), float(times[0]), first)
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
        if step < self._first.step:
            msg = f"{self.path}: starts at step {self._first.step}, expected to keep step {step}"
            raise ValueError(msg)
        with self._file() as file:
            frames = file["particles/all"]
            names = _frame_values(self._first, rests="position_rest" in frames)
            values = [frames[name]["value"] for name in names]
            _truncate(step, frames["position"], values)
            for element in (*file["observables"].values(), file["report"]):
                _truncate(step, element)

    def set_attributes(self, attributes: Mapping[str, Any]) -> None:
        """Set attributes, replacing those of the same name; errors as `write_packing`."""
        with self._file() as file:
            _set_attributes(file["parameters"], attributes)

    def _file(self) -> h5py.File:
        return _h5py().File(self.path, "r+")

    def _check_same_particles(self, packing: Packing) -> None:
        for name in ("dimension", "shape_style", "id", "species", "diameters", "exponent"):
            if not np.array_equal(getattr(packing, name), getattr(self._first, name)):
                msg = (
                    f"{self.path}: {name} differs from the first frame,"
                    " expected the same particles in the same order (Packing.sorted_by_id)"
                )
                raise ValueError(msg)


def _h5py() -> Any:
    # Imported here so that text files and the rest of the library need no HDF5.
    import h5py  # noqa: PLC0415

    return h5py


@contextmanager
def _opened(path: PathLike) -> Iterator[h5py.File]:
    """Open for reading; what HDF5 says of damaged content becomes a FileFormatError."""
    with Path(path).open("rb") as raw:
        if raw.read(len(HDF5_SIGNATURE)) != HDF5_SIGNATURE:
            msg = f"{path}: is not an HDF5 file, expected one written by jamshape"
            raise FileFormatError(msg)
    try:
        with _h5py().File(path, "r") as file:
            _check_h5md(file)
            yield file
    except (OSError, RuntimeError, KeyError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # the system's own, such as a lock, and not a matter of content
        msg = f"{path}: is truncated or damaged, expected a complete HDF5 file; write it again"
        raise FileFormatError(msg) from error


def _check_h5md(file: h5py.File) -> None:
    version = np.ravel(_item(file, "h5md").attrs.get("version", ())).tolist()
    if version[:1] != [1]:
        msg = f"{file.filename}: has H5MD version {version}, expected [1, 1]"
        raise FileFormatError(msg)


def _item(file: h5py.File, name: str) -> Any:
    item = file.get(name)
    if item is None:
        msg = f"{file.filename}: has no /{name}, expected an H5MD file written by jamshape"
        raise FileFormatError(msg)
    return item


def _dataset(file: h5py.File, name: str) -> Any:
    dataset = _item(file, name)
    if not hasattr(dataset, "shape"):
        msg = f"{file.filename}: /{name} is a group, expected a dataset"
        raise FileFormatError(msg)
    return dataset


def _count(file: h5py.File, element: str) -> int:
    shape: tuple[int, ...] = _dataset(file, f"{element}/step").shape
    if len(shape) != 1:
        msg = f"{file.filename}: /{element}/step has shape {shape}, expected one step a row"
        raise FileFormatError(msg)
    return shape[0]


def _rows(file: h5py.File, element: str, name: str) -> Any:
    dataset, n = _dataset(file, f"{element}/{name}"), _count(file, element)
    if dataset.shape[:1] < (n,):
        msg = f"{file.filename}: /{element}/{name} has shape {dataset.shape}, expected {n} rows"
        raise FileFormatError(msg)
    return dataset


def _series(file: h5py.File, name: str) -> Series:
    element = f"observables/{name}"
    n = _count(file, element)
    return Series(*(_rows(file, element, field)[:n] for field in Series._fields))


def _packing(file: h5py.File, frame: int) -> Packing:
    def row(name: str) -> Any:
        element, dataset = f"particles/all/{name}".rsplit("/", 1)
        return _rows(file, element, dataset)[frame]

    def fixed(name: str) -> Any:
        return _dataset(file, f"particles/all/{name}")[()]

    fields = {name: fixed(name) for name in ("diameters", "species", "id")}
    if "particles/all/exponent" in file:
        fields["exponent"] = fixed("exponent")
    fields |= {name: row(f"{name}/value") for name in ("position", "orientation", "image")}
    for name, element in _RESTS.items():
        if f"particles/all/{element}" in file:
            fields[name] = row(f"{element}/value")
    fields["shape_style"] = _item(file, "particles/all").attrs.get("shape_style")
    fields["step"], fields["time"] = int(row("position/step")), float(row("position/time"))
    lo, edges = row("box/lo/value"), row("box/edges/value")
    try:
        return Packing(box=Box(lo=lo, edges=edges), **fields)
    except ValueError as error:
        msg = f"{file.filename}: {error}; write it again"
        raise FileFormatError(msg) from error


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _write_metadata(file: h5py.File) -> None:
    try:
        version = importlib.metadata.version("jamshape")
    except importlib.metadata.PackageNotFoundError:
        version = "not installed"
    h5md = file.create_group("h5md")
    h5md.attrs["version"] = [1, 1]
    h5md.create_group("author").attrs["name"] = np.bytes_("unknown")
    creator = h5md.create_group("creator")
    creator.attrs["name"] = np.bytes_("jamshape")
    creator.attrs["version"] = np.bytes_(version)


def _frame_values(packing: Packing, *, rests: bool) -> dict[str, NDArray[Any]]:
    values = {
        "position": packing.position,
        "orientation": packing.orientation,
        "image": packing.image,
        "box/edges": packing.box.edges,
        "box/lo": packing.box.lo,
    }
    if rests:
        values |= {element: getattr(packing, name) for name, element in _RESTS.items()}
    return values


def _create_particles(group: h5py.Group, packing: Packing) -> None:
    group.attrs["shape_style"] = packing.shape_style
    for name in ("species", "id", "diameters"):
        group[name] = getattr(packing, name)
    if packing.shape_style == "superellipsoid":
        group["exponent"] = packing.exponent
    for name, value in _frame_values(packing, rests=_has_rests(packing)).items():
        element = group.create_group(name)
        _create_rows(element, "value", value)
        if name == "position":
            _create_clock(element)
        else:
            element["step"], element["time"] = group["position/step"], group["position/time"]
    group["box"].attrs["dimension"] = packing.dimension
    group["box"].attrs["boundary"] = np.array([b"periodic"] * packing.dimension)


def _has_rests(packing: Packing) -> bool:
    return any(getattr(packing, name).any() for name in _RESTS)


def _create_rests(group: h5py.Group, packing: Packing, n: int) -> None:
    """Create the elements of rests, zero in the n frames that are there."""
    for name, path in _RESTS.items():
        element = group.create_group(path)
        _create_rows(element, "value", getattr(packing, name))
        element["value"].resize(n, axis=0)
        element["step"], element["time"] = group["position/step"], group["position/time"]


def _create_clock(group: h5py.Group) -> None:
    _create_rows(group, "step", np.zeros((), np.int64))
    _create_rows(group, "time", np.zeros((), np.float64))


def _create_rows(group: h5py.Group, name: str, row: NDArray[Any]) -> None:
    """Create an extensible dataset, still without rows, for rows like `row`."""
    per_chunk = max(1, _CHUNK_BYTES // max(1, row.nbytes))
    group.create_dataset(
        name,
        shape=(0, *row.shape),
        dtype=row.dtype,
        # HDF5 wants chunks of at least 1 within the maximum: an empty extent gets no maximum.
        maxshape=(None, *(extent or None for extent in row.shape)),
        chunks=(per_chunk, *(extent or 1 for extent in row.shape)),
    )


def _append_frame(group: h5py.Group, packing: Packing) -> None:
    position = group["position"]
    n = len(position["step"])
    if _has_rests(packing) and "position_rest" not in group:
        _create_rests(group, packing, n)
    for name, value in _frame_values(packing, rests="position_rest" in group).items():
        _put(group[name]["value"], n, value)
    _put(position["time"], n, packing.time)
    _put(position["step"], n, packing.step)


def _append_observables(
    group: h5py.Group, step: int, time: float, observables: Mapping[str, ArrayLike]
) -> None:
    rows = {name: _observable(value) for name, value in observables.items()}
    for name, row in rows.items():
        _check_observable(group, name, row)
        if name in group:
            _check_after(name, group[name], step)
    for name, row in rows.items():
        if name not in group:
            _create_rows(group.create_group(name), "value", row)
            _create_clock(group[name])
        element = group[name]
        n = len(element["step"])
        _put(element["value"], n, row)
        _put(element["time"], n, time)
        _put(element["step"], n, step)


def _observable(value: ArrayLike) -> NDArray[Any]:
    array = np.asarray(value)
    # A first value that happens to be an integer must not make a series of integers.
    return array.astype(np.float64) if array.ndim == 0 and array.dtype.kind in "biuf" else array


def _put(dataset: h5py.Dataset, index: int, row: ArrayLike) -> None:
    dataset.resize(index + 1, axis=0)
    dataset[index] = row


def _truncate(step: int, clock: h5py.Group, others: Iterable[h5py.Dataset] = ()) -> None:
    n = int(np.searchsorted(clock["step"][:], step, side="right"))
    for dataset in (*clock.values(), *others):
        dataset.resize(n, axis=0)


def _check_after(name: str, element: h5py.Group, step: int) -> None:
    stored = element["step"]
    if len(stored) and step <= stored[-1]:
        msg = f"{name} is stored up to step {stored[-1]}, expected a step after it, found {step}"
        raise ValueError(msg)


def _check_observable(group: h5py.Group, name: str, row: NDArray[Any]) -> None:
    if not name or "/" in name or name == ".":
        msg = f"observable is named {name!r}, expected a name without '/'"
        raise ValueError(msg)
    if row.dtype.kind not in "biuf":
        msg = f"observable {name!r} has dtype {row.dtype}, expected numbers"
        raise ValueError(msg)
    if name not in group:
        return
    stored = group[name]["value"]
    if (row.dtype, row.shape) != (stored.dtype, stored.shape[1:]):
        expected = f"{stored.dtype} {stored.shape[1:]}"
        msg = f"observable {name!r} is {row.dtype} {row.shape}, expected {expected} as before"
        raise ValueError(msg)


def _set_attributes(group: h5py.Group, attributes: Mapping[str, Any]) -> None:
    for name, value in attributes.items():
        array = np.asarray(value)
        if array.dtype.kind not in "biuf" and not isinstance(value, str):
            msg = f"attribute {name!r} is {type(value).__name__}, expected numbers or a str"
            raise ValueError(msg)
        if array.ndim and array.nbytes > _ATTRIBUTE_BYTES:
            found = f"attribute {name!r} has {array.nbytes} bytes"
            msg = f"{found}, expected at most {_ATTRIBUTE_BYTES}; store it as an observable"
            raise ValueError(msg)
    group.attrs.update(attributes)
