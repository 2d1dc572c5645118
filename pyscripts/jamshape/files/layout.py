"""HDF5 layout of packings and runs: groups, datasets, rows. See `jamshape.files.h5md`."""

from __future__ import annotations

import importlib.metadata
import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.files.disk import PathLike
from jamshape.files.frames import EDGES, EDGES_REST, RESTS, Form, as_rest, frame_values, lengths_of
from jamshape.files.hdf5 import (
    FileFormatError,
    Image,
    attribute,
    attributes,
    check_attributes,
    has_item,
    open_file,
    plain,
    put,
    readable,
    reading,
    require_dataset,
    require_item,
    set_attributes,
    written,
)
from jamshape.files.journal import Pending, Table, read_journal
from jamshape.files.origin import origin
from jamshape.files.rows import Columns, Stored, as_column, gathered, table
from jamshape.files.vocabulary import FORMAT_VERSION, RENAMED, former
from jamshape.packing import Box, Packing
from jamshape.shapes.shape import Interaction

if TYPE_CHECKING:
    import h5py

__all__ = [
    "FileFormatError",
    "attribute",
    "attributes",
    "check_attributes",
    "has_item",
    "plain",
    "put",
    "readable",
    "reading",
    "require_item",
    "set_attributes",
    "written",
]

REPORT = {"step": np.int64, "wall_seconds": np.float64, "error": np.float64}
_SAME_SIZE = 1e-12  # relative rounding difference between two copies of a size
# Tables of a journal.
FRAMES, OBSERVABLES, REPORT_TABLE = "frames", "observables", "report"
_TOKEN = "journal"  # attribute of a file with a journal


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
    """(T,) relative errors, as defined by the writer."""


@contextmanager
def rewritten(path: PathLike) -> Iterator[h5py.File]:
    """Yield a copy of an HDF5 file to change, which replaces it if the body succeeds; errors as `opened`."""
    with changed(path, path) as file:
        yield file


@contextmanager
def changed(path: PathLike, out: PathLike) -> Iterator[h5py.File]:
    """Yield a copy of an HDF5 file to change, which is written to `out` if the body succeeds; errors as `opened`."""
    with readable(path):
        image = Image(out, Path(path).read_bytes())
        file = image.open("r+")
        check_h5md(file)
    with file:
        yield file
    image.store()


@contextmanager
def opened(path: PathLike) -> Iterator[h5py.File]:
    """Open for reading, including rows that are still in the journal.

    Errors as `reading`.
    """
    with readable(path), _with_journal(path) as file:
        check_h5md(file)
        yield file


def _with_journal(path: PathLike) -> h5py.File:
    """Open a file, in memory if there are rows to add."""
    pending = read_journal(path)
    while pending:
        file = Image(path, Path(path).read_bytes()).open("r+")
        if fold(file, pending):
            return file
        file.close()
        # Its rows have been folded already, unless a writer has begun another journal meanwhile.
        before, pending = pending.token, read_journal(path)
        if pending and pending.token == before:
            break
    return open_file(path)


def check_h5md(file: h5py.File) -> None:
    """Refuse a file of another version of H5MD."""
    version = np.ravel(attribute(require_item(file, "h5md"), "version", ())).tolist()
    if version[:1] != [1]:
        msg = f"{file.filename}: has H5MD version {version}, expected [1, 1]"
        raise FileFormatError(msg)


def count(file: h5py.File, element: str) -> int:
    """Count the rows of an element: `step` is written last."""
    shape: tuple[int, ...] = require_dataset(file, f"{element}/step", kinds="iu").shape
    if len(shape) != 1:
        msg = f"{file.filename}: /{element}/step has shape {shape}, expected one step a row"
        raise FileFormatError(msg)
    return shape[0]


def require_rows(
    file: h5py.File, element: str, name: str, n: int | None = None, *, sparse: bool = False
) -> Any:
    """Look up a dataset with a row for each of the n steps of its element, counted by default."""
    n = count(file, element) if n is None else n
    kinds = "iu" if name == "step" else "biuf"
    dataset = require_dataset(file, f"{element}/{name}", n, kinds=kinds, sparse=sparse)
    if dataset.shape[:1] < (n,):
        msg = f"{file.filename}: /{element}/{name} has shape {dataset.shape}, expected {n} rows"
        raise FileFormatError(msg)
    return dataset


def stored_name(file: h5py.File, name: str) -> str:
    """Name under which a file holds an observable."""
    return former(name, require_item(file, "observables"))


def rename_observables(file: h5py.File) -> None:
    """Give the observables of an older file their current names."""
    for new, old in ((new, stored_name(file, new)) for new in RENAMED):
        if old != new and old in require_item(file, "observables"):
            file.move(f"observables/{old}", f"observables/{new}")
    require_item(file, "h5md/creator").attrs["format_version"] = FORMAT_VERSION


def version_of(file: h5py.File) -> int:
    """Read the version of the names in a file."""
    return int(attribute(require_item(file, "h5md/creator"), "format_version", 1))


def has_todays_names(file: h5py.File) -> bool:
    """Whether a file uses the current names."""
    return version_of(file) >= FORMAT_VERSION


def read_rows(file: h5py.File, name: str) -> Series:
    """Read an observable with its steps and times."""
    element = f"observables/{name}"
    n = count(file, element)
    return Series(*(require_rows(file, element, field, n)[:n] for field in Series._fields))


def write_metadata(file: h5py.File) -> None:
    """Write the metadata that H5MD requires."""
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
    creator.attrs["format_version"] = FORMAT_VERSION
    creator.attrs["origin"] = np.bytes_(origin())


def create_file(
    file: h5py.File,
    packing: Packing,
    parameters: Mapping[str, Any],
    observables: Mapping[str, ArrayLike],
) -> None:
    """Write a packing, or the first frame of a run, into an empty file."""
    write_metadata(file)
    create_particles(file.create_group("particles/all"), packing)
    file.create_group("observables")
    for name, dtype in REPORT.items():
        create_rows(file.require_group("report"), name, np.zeros((), dtype))
    append_table(file, FRAMES, frames_table(packing, Form.of(packing)))
    columns = {name: as_column(value) for name, value in observables.items()}
    Stored().check_observables(packing.step, columns)
    append_table(file, OBSERVABLES, table([packing.step], [packing.time], columns))
    set_attributes(file.create_group("parameters"), parameters)


def create_particles(group: h5py.Group, packing: Packing) -> None:
    """Create the elements of particles, without frames."""
    set_attributes(group, {"shape_style": packing.shape_style, **packing.law._asdict()})
    # Half lengths and radii reproduce overlaps without the rounding of 2(A + R).
    more = ("exponent",) if packing.shape.has_exponent else ("half_length", "radius")
    for name in ("species", "id", "diameters", *more):
        put(group, name, getattr(packing, name))
    for name, value in frame_values(packing, Form.of(packing)).items():
        element = group.create_group(name)
        create_rows(element, "value", value)
        if name == "position":
            create_clock(element)
        else:
            element["step"], element["time"] = group["position/step"], group["position/time"]
    group["box"].attrs["dimension"] = packing.dimension
    group["box"].attrs["boundary"] = np.array([b"periodic"] * packing.dimension)


def create_rest(group: h5py.Group, path: str, row: NDArray[Any], n: int) -> None:
    """Create an element of low parts, zero in the n existing frames."""
    element = group.create_group(path)
    put(element, "value", np.zeros((n, *row.shape)), grows=True)
    element["step"], element["time"] = group["position/step"], group["position/time"]


def create_clock(group: h5py.Group) -> None:
    """Create steps and times, without rows."""
    create_rows(group, "step", np.zeros((), np.int64))
    create_rows(group, "time", np.zeros((), np.float64))


def create_rows(group: h5py.Group, name: str, row: NDArray[Any]) -> None:
    """Create an extensible dataset for rows like `row`, without rows."""
    put(group, name, np.empty((0, *row.shape), row.dtype), grows=True)


def fold(file: h5py.File, pending: Pending | None) -> bool:
    """Append the rows of a journal, if it continues this file."""
    if not pending or token_of(file) != pending.token:
        return False
    tables, changed_attributes = gathered(pending.records)
    for name, rows in tables:
        append_table(file, name, rows)
    set_attributes(file["parameters"], changed_attributes)
    return True


def token_of(file: h5py.File) -> str | None:
    """Return the token of a file's state, or None."""
    token: str | None = attribute(file, _TOKEN)
    return token


def set_token(file: h5py.File, token: str | None) -> None:
    """Set the token of the file's state that a journal continues; None without a journal."""
    if token:
        set_attributes(file, {_TOKEN: token})
    elif _TOKEN in file.attrs:
        del file.attrs[_TOKEN]


def append_table(file: h5py.File, name: str, rows: Table) -> None:
    """Append rows to the frames, the observables or the report."""
    columns = {key: rows[key] for key in rows.dtype.names or ()}
    if name == REPORT_TABLE:
        extend(file["report"], columns)
        return
    clock = {key: columns.pop(key) for key in ("time", "step")}
    if name == FRAMES:
        _append_frames(file["particles/all"], clock, columns)
        return
    for key, column in columns.items():
        group = file["observables"]
        if key not in group:
            create_rows(group.create_group(key), "value", column[0])
            create_clock(group[key])
        extend(group[key], {"value": column, **clock})


def _append_frames(group: h5py.Group, clock: Columns, columns: Columns) -> None:
    n = len(group["position/step"])
    for key, column in columns.items():
        if key not in group:
            create_rest(group, key, column[0], n)
        if column.ndim > group[key]["value"].ndim:
            _make_matrices(group[key])
        extend_dataset(group[key]["value"], n, column)
    extend(group["position"], clock)


def _make_matrices(element: h5py.Group) -> None:
    """Convert edges (T, D) of boxes without tilt to matrices (T, D, D)."""
    edges = element["value"][()]
    matrices = edges[:, :, None] * np.eye(edges.shape[1])
    del element["value"]
    create_rows(element, "value", np.eye(edges.shape[1]))
    extend_dataset(element["value"], 0, matrices)


def frames_table(packing: Packing, form: Form) -> Table:
    """Convert a frame to a table of one row."""
    columns = {name: value[None] for name, value in frame_values(packing, form).items()}
    return table([packing.step], [packing.time], columns)


def extend(group: h5py.Group, columns: Columns) -> None:
    """Append rows, overwriting remains of an interrupted writer of earlier versions."""
    n = len(group["step"])
    for name, column in columns.items():
        extend_dataset(group[name], n, column)


def extend_dataset(dataset: h5py.Dataset, n: int, rows: NDArray[Any]) -> None:
    """Write rows after the first n."""
    dataset.resize(n + len(rows), axis=0)
    dataset[n:] = rows


def truncate_all(file: h5py.File, step: int) -> None:
    """Drop all frames, observables and rows of the report after a step."""
    frames = file["particles/all"]
    names = ("position", "orientation", "image", EDGES, "box/lo", *RESTS.values(), EDGES_REST)
    values = [frames[name]["value"] for name in names if name in frames]
    truncate(step, frames["position"], values)
    for element in (*file["observables"].values(), file["report"]):
        truncate(step, element)


def truncate(step: int, clock: h5py.Group, others: Iterable[h5py.Dataset] = ()) -> None:
    """Drop the rows after a step."""
    n = int(np.searchsorted(clock["step"][:], step, side="right"))
    for dataset in (*clock.values(), *others):
        dataset.resize(n, axis=0)


def _require_one_size(file: h5py.File, packing: Packing) -> None:
    """Refuse a file in which another program has changed one of two copies of sizes."""
    for name in ("half_length", "radius"):
        element, own = f"particles/all/{name}", getattr(packing, name)
        if not has_item(file, element):
            continue
        stored = require_dataset(file, element)
        _require_most(stored, stored.shape, packing.n)
        stored = np.asarray(stored[()])
        bound = _SAME_SIZE * packing.diameters[:, 0]
        is_size = stored.shape == own.shape and stored.dtype.kind in "fiu"
        if not is_size or not (np.abs(stored - own) <= bound).all():
            msg = (
                f"{file.filename}: {name} differs from that of diameters, which are (2(A+R), 2R, 2R), expected both to"
                " agree; change both"
            )
            raise FileFormatError(msg)


def _read_law(file: h5py.File) -> Interaction:
    """Read the law of the particles; files of 0.1.0 store it only among the attributes of runs."""
    known: dict[str, Any] = {}
    for place in filter(lambda name: has_item(file, name), ("parameters", "particles/all")):
        group = require_item(file, place)
        known |= {k: attribute(group, k) for k in Interaction._fields if k in group.attrs}
    try:
        return Interaction.told(known)
    except (TypeError, ValueError) as error:
        msg = f"{file.filename}: k_e and sides are not numbers ({error}), expected those of the contacts"
        raise FileFormatError(msg) from error


def read_frame(file: h5py.File, frame: int) -> Packing:
    """Read a frame as a packing."""
    n_frames = count(file, "particles/all/position")
    n = math.prod(require_dataset(file, "particles/all/species").shape[:1])

    def row(name: str, *, sparse: bool = False) -> Any:
        element, dataset = f"particles/all/{name}".rsplit("/", 1)
        rows = require_rows(file, element, dataset, n_frames, sparse=sparse)
        _require_most(rows, rows.shape[1:], n)
        return rows[frame]

    def fixed(name: str) -> Any:
        values = require_dataset(file, f"particles/all/{name}")
        _require_most(values, values.shape, n)
        return values[()]

    fields = {name: fixed(name) for name in ("diameters", "species", "id")}
    if has_item(file, "particles/all/exponent"):
        fields["exponent"] = fixed("exponent")
    fields |= {name: row(f"{name}/value") for name in ("position", "orientation", "image")}
    for name, element in RESTS.items():
        if has_item(file, f"particles/all/{element}"):
            whole = fields[name.removesuffix("_rest")]
            fields[name] = as_rest(row(f"{element}/value", sparse=True), whole)
    fields["shape_style"] = attribute(require_item(file, "particles/all"), "shape_style")
    fields["law"] = _read_law(file)
    fields["step"], fields["time"] = int(row("position/step")), float(row("position/time"))
    lo, edges = row("box/lo/value"), row(f"{EDGES}/value")
    try:
        if has_item(file, f"particles/all/{EDGES_REST}"):
            rest = lengths_of(as_rest(row(f"{EDGES_REST}/value", sparse=True), edges))
            fields |= {"edges_rest": rest.edges, "tilt_rest": rest.tilt}
        packing = Packing(box=Box(lo, *lengths_of(edges)), **fields)
    except ValueError as error:
        msg = f"{file.filename}: {error}; write it again"
        raise FileFormatError(msg) from error
    _require_one_size(file, packing)
    return packing


_MOST_COLUMNS = 4  # numbers of a particle in one array, or of a row of a box


def _require_most(dataset: Any, shape: tuple[int, ...], n: int) -> None:
    """Refuse an array larger than n particles need, before it is read."""
    if math.prod(shape) > max(n, _MOST_COLUMNS) * _MOST_COLUMNS:
        msg = (
            f"{dataset.file.filename}: {dataset.name} has shape {shape}, expected numbers of {n} particles;"
            " write it again"
        )
        raise FileFormatError(msg)
