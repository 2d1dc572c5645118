"""How packings and runs lie in HDF5: groups, datasets, rows. See `jamshape.files.h5md` for the layout."""

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
from jamshape.files.vocabulary import FORMAT_VERSION, RENAMED, former
from jamshape.packing import Box, Packing

if TYPE_CHECKING:
    import h5py

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"

PathLike = str | os.PathLike[str]

# Large enough for a long series to be a few chunks, small enough to keep a packing's file small.
_CHUNK_BYTES = 1024
_ATTRIBUTE_BYTES = 60_000  # HDF5 refuses attributes of 64 kB and more
# Fields of a packing and their elements under /particles/all.
RESTS = {
    "position_rest": "position_rest",
    "orientation_rest": "orientation_rest",
    "edges_rest": "box/edges_rest",
}
REPORT = {"step": np.int64, "wall_seconds": np.float64, "error": np.float64}


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


def hdf5() -> Any:
    """Import h5py here, so that text files and the rest of the library need no HDF5."""
    import h5py  # noqa: PLC0415

    return h5py


@contextmanager
def opened(path: PathLike) -> Iterator[h5py.File]:
    """Open for reading; what HDF5 says of damaged content becomes a FileFormatError."""
    with Path(path).open("rb") as raw:
        if raw.read(len(HDF5_SIGNATURE)) != HDF5_SIGNATURE:
            msg = f"{path}: is not an HDF5 file, expected one written by jamshape"
            raise FileFormatError(msg)
    try:
        with hdf5().File(path, "r") as file:
            check_h5md(file)
            yield file
    except (OSError, RuntimeError, KeyError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # the system's own, such as a lock, and not a matter of content
        msg = f"{path}: is truncated or damaged, expected a complete HDF5 file; write it again"
        raise FileFormatError(msg) from error


def check_h5md(file: h5py.File) -> None:
    """Refuse a file of another version of H5MD."""
    version = np.ravel(require_item(file, "h5md").attrs.get("version", ())).tolist()
    if version[:1] != [1]:
        msg = f"{file.filename}: has H5MD version {version}, expected [1, 1]"
        raise FileFormatError(msg)


def require_item(file: h5py.File, name: str) -> Any:
    """Look a group or dataset up, or refuse the file."""
    item = file.get(name)
    if item is None:
        msg = f"{file.filename}: has no /{name}, expected an H5MD file written by jamshape"
        raise FileFormatError(msg)
    return item


def require_dataset(file: h5py.File, name: str) -> Any:
    """Look a dataset up, or refuse the file."""
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
    """Give the observables of a file of an earlier version their names of today."""
    for new, old in ((new, stored_name(file, new)) for new in RENAMED):
        if old != new and old in require_item(file, "observables"):
            file.move(f"observables/{old}", f"observables/{new}")
    require_item(file, "h5md/creator").attrs["format_version"] = FORMAT_VERSION


def read_rows(file: h5py.File, name: str) -> Series:
    """Read an observable with its steps and times."""
    element = f"observables/{name}"
    n = count(file, element)
    return Series(*(require_rows(file, element, field)[:n] for field in Series._fields))


def plain(value: Any) -> Any:
    """Turn a number of NumPy into one of Python."""
    return value.item() if isinstance(value, np.generic) else value


def write_metadata(file: h5py.File) -> None:
    """Write what H5MD asks for."""
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


def frame_values(packing: Packing, *, rests: bool) -> dict[str, NDArray[Any]]:
    """Give what a frame holds, by element."""
    values = {
        "position": packing.position,
        "orientation": packing.orientation,
        "image": packing.image,
        "box/edges": packing.box.edges,
        "box/lo": packing.box.lo,
    }
    if rests:
        values |= {element: getattr(packing, name) for name, element in RESTS.items()}
    return values


def create_particles(group: h5py.Group, packing: Packing) -> None:
    """Create the elements of particles, still without frames."""
    group.attrs["shape_style"] = packing.shape_style
    for name in ("species", "id", "diameters"):
        group[name] = getattr(packing, name)
    if packing.shape.has_exponent:
        group["exponent"] = packing.exponent
    for name, value in frame_values(packing, rests=packing.has_rests).items():
        element = group.create_group(name)
        create_rows(element, "value", value)
        if name == "position":
            create_clock(element)
        else:
            element["step"], element["time"] = group["position/step"], group["position/time"]
    group["box"].attrs["dimension"] = packing.dimension
    group["box"].attrs["boundary"] = np.array([b"periodic"] * packing.dimension)


def create_rests(group: h5py.Group, packing: Packing, n: int) -> None:
    """Create the elements of rests, zero in the n frames that are there."""
    for name, path in RESTS.items():
        element = group.create_group(path)
        create_rows(element, "value", getattr(packing, name))
        element["value"].resize(n, axis=0)
        element["step"], element["time"] = group["position/step"], group["position/time"]


def create_clock(group: h5py.Group) -> None:
    """Create steps and times, still without rows."""
    create_rows(group, "step", np.zeros((), np.int64))
    create_rows(group, "time", np.zeros((), np.float64))


def create_rows(group: h5py.Group, name: str, row: NDArray[Any]) -> None:
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


def append_frame(group: h5py.Group, packing: Packing) -> None:
    """Write a frame after the last one."""
    position = group["position"]
    n = len(position["step"])
    if packing.has_rests and "position_rest" not in group:
        create_rests(group, packing, n)
    for name, value in frame_values(packing, rests="position_rest" in group).items():
        put(group[name]["value"], n, value)
    put(position["time"], n, packing.time)
    put(position["step"], n, packing.step)


def append_observables(
    group: h5py.Group, step: int, time: float, observables: Mapping[str, ArrayLike]
) -> None:
    """Write a row of each observable after the last one."""
    rows = {name: as_row(value) for name, value in observables.items()}
    for name, row in rows.items():
        check_observable(group, name, row)
        if name in group:
            check_after(name, group[name], step)
    for name, row in rows.items():
        if name not in group:
            create_rows(group.create_group(name), "value", row)
            create_clock(group[name])
        element = group[name]
        n = len(element["step"])
        put(element["value"], n, row)
        put(element["time"], n, time)
        put(element["step"], n, step)


def as_row(value: ArrayLike) -> NDArray[Any]:
    """Turn a value into what a row holds."""
    array = np.asarray(value)
    # A first value that happens to be an integer must not make a series of integers.
    return array.astype(np.float64) if array.ndim == 0 and array.dtype.kind in "biuf" else array


def put(dataset: h5py.Dataset, index: int, row: ArrayLike) -> None:
    """Write a row at the end."""
    dataset.resize(index + 1, axis=0)
    dataset[index] = row


def truncate(step: int, clock: h5py.Group, others: Iterable[h5py.Dataset] = ()) -> None:
    """Drop the rows after a step."""
    n = int(np.searchsorted(clock["step"][:], step, side="right"))
    for dataset in (*clock.values(), *others):
        dataset.resize(n, axis=0)


def check_after(name: str, element: h5py.Group, step: int) -> None:
    """Refuse a step that is not after the last one."""
    stored = element["step"]
    if len(stored) and step <= stored[-1]:
        msg = f"{name} is stored up to step {stored[-1]}, expected a step after it, found {step}"
        raise ValueError(msg)


def check_observable(group: h5py.Group, name: str, row: NDArray[Any]) -> None:
    """Refuse an observable of a bad name, or of another type than before."""
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


def set_attributes(group: h5py.Group, attributes: Mapping[str, Any]) -> None:
    """Set attributes, of types that HDF5 can hold."""
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
            fields[name] = row(f"{element}/value")
    fields["shape_style"] = require_item(file, "particles/all").attrs.get("shape_style")
    fields["step"], fields["time"] = int(row("position/step")), float(row("position/time"))
    lo, edges = row("box/lo/value"), row("box/edges/value")
    try:
        return Packing(box=Box(lo=lo, edges=edges), **fields)
    except ValueError as error:
        msg = f"{file.filename}: {error}; write it again"
        raise FileFormatError(msg) from error
