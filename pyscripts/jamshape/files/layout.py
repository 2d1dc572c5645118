"""HDF5 layout of packings and runs: groups, datasets, rows. See `jamshape.files.h5md`."""

from __future__ import annotations

import errno
import importlib.metadata
import io
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.files.disk import PathLike, store
from jamshape.files.frames import EDGES, EDGES_REST, RESTS, Form, as_rest, frame_values, lengths_of
from jamshape.files.journal import Pending, Table, read_journal
from jamshape.files.origin import origin
from jamshape.files.rows import Columns, Stored, as_column, gathered, table
from jamshape.files.signature import HDF5, format_of
from jamshape.files.vocabulary import FORMAT_VERSION, RENAMED, former
from jamshape.packing import Box, Packing
from jamshape.shapes.shape import Interaction

if TYPE_CHECKING:
    import h5py


_CHUNK_BYTES = 1024  # a long series has few chunks, yet the file of a packing stays small
_ATTRIBUTE_BYTES = 60_000  # HDF5 refuses attributes of 64 kB and more
REPORT = {"step": np.int64, "wall_seconds": np.float64, "error": np.float64}
_SAME_SIZE = 1e-12  # relative rounding difference between two copies of a size
# Tables of a journal.
FRAMES, OBSERVABLES, REPORT_TABLE = "frames", "observables", "report"
_TOKEN = "journal"  # attribute of a file with a journal


class FileFormatError(ValueError):
    """A file has unexpected content; the message names the file."""


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


def hdf5() -> Any:
    """Import h5py lazily, so that text files and the rest of the library need no HDF5."""
    import h5py  # noqa: PLC0415

    return h5py


class Image(io.BytesIO):
    """An HDF5 file in memory, so that writing by HDF5 cannot fail.

    HDF5 crashes on closing a file on a full disk, so it never writes to one.
    """

    def __init__(self, path: PathLike, data: bytes = b"") -> None:
        super().__init__(data)
        self._path = path

    def __repr__(self) -> str:
        """Return the path, which h5py takes as the name of the file."""
        return str(self._path)

    def store(self) -> None:
        """Write the image to its path; errors as `replacing`.

        An error that holds a view of the buffer would be reported again when that is freed.
        """
        with self.getbuffer() as whole:
            store(self._path, whole)


@contextmanager
def written(path: PathLike) -> Iterator[h5py.File]:
    """Yield an empty HDF5 file, which replaces the one at `path` if the body succeeds.

    Raises
    ------
    OSError
        If it cannot be written; the message is one sentence.
    """
    image = Image(path)
    with hdf5().File(image, "w") as file:
        yield file
    image.store()


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
        with hdf5().File(image, "r+") as file:
            check_h5md(file)
            yield file
    image.store()


@contextmanager
def opened(path: PathLike) -> Iterator[h5py.File]:
    """Open for reading, including rows that are still in the journal.

    HDF5 errors on damaged content become a FileFormatError, those on locks one sentence.
    """
    with readable(path), _with_journal(path) as file:
        check_h5md(file)
        yield file


@contextmanager
def readable(path: PathLike) -> Iterator[None]:
    """Refuse files other than HDF5, and turn HDF5 errors on damaged ones into a FileFormatError."""
    if format_of(path) != HDF5:
        msg = f"{path}: is not an HDF5 file, expected one written by jamshape"
        raise FileFormatError(msg)
    try:
        yield
    except BlockingIOError as error:
        msg = (
            f"{path}: another program has it open for writing, expected read access; close it there"
        )
        raise OSError(errno.EAGAIN, msg) from error
    except (OSError, RuntimeError, KeyError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # from the system, not about content
        msg = f"{path}: is truncated or damaged, expected a complete HDF5 file; write it again"
        raise FileFormatError(msg) from error


def _with_journal(path: PathLike) -> h5py.File:
    """Open a file, in memory if there are rows to add."""
    pending = read_journal(path)
    while pending:
        file = hdf5().File(Image(path, Path(path).read_bytes()), "r+")
        if fold(file, pending):
            return file
        file.close()
        # Its rows have been folded already, unless a writer has begun another journal meanwhile.
        before, pending = pending.token, read_journal(path)
        if pending and pending.token == before:
            break
    return hdf5().File(path, "r")


def check_h5md(file: h5py.File) -> None:
    """Refuse a file of another version of H5MD."""
    version = np.ravel(require_item(file, "h5md").attrs.get("version", ())).tolist()
    if version[:1] != [1]:
        msg = f"{file.filename}: has H5MD version {version}, expected [1, 1]"
        raise FileFormatError(msg)


def require_item(file: h5py.File, name: str) -> Any:
    """Return a group or dataset, or refuse the file."""
    item = file.get(name)
    if item is None:
        msg = f"{file.filename}: has no /{name}, expected an H5MD file written by jamshape"
        raise FileFormatError(msg)
    return item


def require_dataset(file: h5py.File, name: str) -> Any:
    """Return a dataset, or refuse the file."""
    dataset = require_item(file, name)
    if not hasattr(dataset, "shape"):
        msg = f"{file.filename}: /{name} is a group, expected a dataset"
        raise FileFormatError(msg)
    return dataset


def count(file: h5py.File, element: str) -> int:
    """Count the rows of an element: `step` is written last."""
    shape: tuple[int, ...] = require_dataset(file, f"{element}/step").shape
    if len(shape) != 1:
        msg = f"{file.filename}: /{element}/step has shape {shape}, expected one step a row"
        raise FileFormatError(msg)
    return shape[0]


def require_rows(file: h5py.File, element: str, name: str) -> Any:
    """Look up a dataset with as many rows as its element has steps."""
    dataset, n = require_dataset(file, f"{element}/{name}"), count(file, element)
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


def has_todays_names(file: h5py.File) -> bool:
    """Whether a file uses the current names."""
    version = require_item(file, "h5md/creator").attrs.get("format_version", 1)
    return bool(version >= FORMAT_VERSION)


def read_rows(file: h5py.File, name: str) -> Series:
    """Read an observable with its steps and times."""
    element = f"observables/{name}"
    n = count(file, element)
    return Series(*(require_rows(file, element, field)[:n] for field in Series._fields))


def plain(value: Any) -> Any:
    """Convert NumPy scalars to Python."""
    return value.item() if isinstance(value, np.generic) else value


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


def put(group: h5py.Group, name: str, array: NDArray[Any]) -> h5py.Dataset:
    """Write an array."""
    group[name] = array
    return group[name]


def create_file(
    file: h5py.File,
    packing: Packing,
    attributes: Mapping[str, Any],
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
    set_attributes(file.create_group("parameters"), attributes)


def create_particles(group: h5py.Group, packing: Packing) -> None:
    """Create the elements of particles, without frames."""
    group.attrs["shape_style"] = packing.shape_style
    group.attrs.update(packing.law._asdict())
    for name in ("species", "id", "diameters"):
        group[name] = getattr(packing, name)
    if packing.shape.has_exponent:
        group["exponent"] = packing.exponent
    else:  # reproduces overlaps without the rounding of 2(A + R)
        group["half_length"], group["radius"] = packing.half_length, packing.radius
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
    create_rows(element, "value", row)
    element["value"].resize(n, axis=0)
    element["step"], element["time"] = group["position/step"], group["position/time"]


def create_clock(group: h5py.Group) -> None:
    """Create steps and times, without rows."""
    create_rows(group, "step", np.zeros((), np.int64))
    create_rows(group, "time", np.zeros((), np.float64))


def create_rows(group: h5py.Group, name: str, row: NDArray[Any]) -> None:
    """Create an extensible dataset for rows like `row`, without rows."""
    per_chunk = max(1, _CHUNK_BYTES // max(1, row.nbytes))
    group.create_dataset(
        name,
        shape=(0, *row.shape),
        dtype=row.dtype,
        # HDF5 requires chunks of at least 1 within the maximum: an empty extent gets no maximum.
        maxshape=(None, *(extent or None for extent in row.shape)),
        chunks=(per_chunk, *(extent or 1 for extent in row.shape)),
    )


def fold(file: h5py.File, pending: Pending | None) -> bool:
    """Append the rows of a journal, if it continues this file."""
    if not pending or token_of(file) != pending.token:
        return False
    tables, attributes = gathered(pending.records)
    for name, rows in tables:
        append_table(file, name, rows)
    file["parameters"].attrs.update(attributes)
    return True


def token_of(file: h5py.File) -> str | None:
    """Return the token of a file's state, or None."""
    token: str | None = file.attrs.get(_TOKEN)
    return token


def set_token(file: h5py.File, token: str | None) -> None:
    """Set the token of the file's state that a journal continues; None without a journal."""
    if token:
        file.attrs[_TOKEN] = token
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


def check_attributes(attributes: Mapping[str, Any]) -> None:
    """Refuse values that HDF5 cannot hold as attributes."""
    for name, value in attributes.items():
        array = np.asarray(value)
        if array.dtype.kind not in "biuf" and not isinstance(value, str):
            msg = f"attribute {name!r} is {type(value).__name__}, expected numbers or a str"
            raise ValueError(msg)
        if array.ndim and array.nbytes > _ATTRIBUTE_BYTES:
            found = f"attribute {name!r} has {array.nbytes} bytes"
            msg = f"{found}, expected at most {_ATTRIBUTE_BYTES}; store it as an observable"
            raise ValueError(msg)


def set_attributes(group: h5py.Group, attributes: Mapping[str, Any]) -> None:
    """Set attributes, of types that HDF5 can hold."""
    check_attributes(attributes)
    group.attrs.update(attributes)


def _require_one_size(file: h5py.File, packing: Packing) -> None:
    """Refuse a file in which another program has changed one of two copies of sizes."""
    for name in ("half_length", "radius"):
        element, own = f"particles/all/{name}", getattr(packing, name)
        stored = np.asarray(require_dataset(file, element)[()] if element in file else own)
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
    known = dict(file["parameters"].attrs) if "parameters" in file else {}
    known |= dict(require_item(file, "particles/all").attrs)
    try:
        return Interaction.told(known)
    except (TypeError, ValueError) as error:
        msg = f"{file.filename}: k_e and sides are not numbers ({error}), expected those of the contacts"
        raise FileFormatError(msg) from error


def read_frame(file: h5py.File, frame: int) -> Packing:
    """Read a frame as a packing."""

    def row(name: str) -> Any:
        element, dataset = f"particles/all/{name}".rsplit("/", 1)
        return require_rows(file, element, dataset)[frame]

    def fixed(name: str) -> Any:
        return require_dataset(file, f"particles/all/{name}")[()]

    fields = {name: fixed(name) for name in ("diameters", "species", "id")}
    if "particles/all/exponent" in file:
        fields["exponent"] = fixed("exponent")
    fields |= {name: row(f"{name}/value") for name in ("position", "orientation", "image")}
    for name, element in RESTS.items():
        if f"particles/all/{element}" in file:
            whole = fields[name.removesuffix("_rest")]
            fields[name] = as_rest(row(f"{element}/value"), whole)
    fields["shape_style"] = require_item(file, "particles/all").attrs.get("shape_style")
    fields["law"] = _read_law(file)
    fields["step"], fields["time"] = int(row("position/step")), float(row("position/time"))
    lo, edges = row("box/lo/value"), row(f"{EDGES}/value")
    try:
        if f"particles/all/{EDGES_REST}" in file:
            rest = lengths_of(as_rest(row(f"{EDGES_REST}/value"), edges))
            fields |= {"edges_rest": rest.edges, "tilt_rest": rest.tilt}
        packing = Packing(box=Box(lo, *lengths_of(edges)), **fields)
    except ValueError as error:
        msg = f"{file.filename}: {error}; write it again"
        raise FileFormatError(msg) from error
    _require_one_size(file, packing)
    return packing
