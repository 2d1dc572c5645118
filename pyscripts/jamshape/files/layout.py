"""HDF5 layout of packings and runs: groups, datasets, rows. See `jamshape.files.h5md`."""

from __future__ import annotations

import functools
import importlib.metadata
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.files.disk import PathLike
from jamshape.files.frames import (
    COLUMNS,
    EDGES,
    EDGES_REST,
    RESTS,
    Form,
    as_rest,
    column_of,
    column_values,
    frame_values,
    lengths_of,
)
from jamshape.files.hdf5 import (
    FileFormatError,
    Image,
    attribute,
    has_item,
    put,
    readable,
    reading,
    require_dataset,
    require_item,
    set_attributes,
)
from jamshape.files.origin import origin
from jamshape.files.vocabulary import FORMAT_VERSION, require_format
from jamshape.packing import Box, Packing
from jamshape.packing.columns import MOST
from jamshape.shapes.shape import MOST_NUMBERS, Interaction

if TYPE_CHECKING:
    import h5py


CREATOR = "jamshape"
"""Name of the program in the files that it writes."""

_SAME_SIZE = 1e-12  # relative rounding difference between two copies of a size


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
    """Open for reading; errors as `reading`."""
    with reading(path) as file:
        check_h5md(file)
        yield file


def check_h5md(file: h5py.File) -> None:
    """Refuse a file of another version of H5MD, or of jamshape's format."""
    check_version_of_h5md(file)
    creator = require_item(file, "h5md/creator")
    if str(attribute(creator, "name", "")) == CREATOR:
        require_format(file.filename, version_of(file), str(attribute(creator, "version", "?")))


def check_version_of_h5md(file: h5py.File) -> None:
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


def version_of(file: h5py.File) -> int:
    """Read the version of the format of a file."""
    return int(attribute(require_item(file, "h5md/creator"), "format_version", 1))


def read_rows(file: h5py.File, name: str) -> Series:
    """Read an observable with its steps and times."""
    element = f"observables/{name}"
    n = count(file, element)
    return Series(*(require_rows(file, element, field, n)[:n] for field in Series._fields))


def read_report(file: h5py.File) -> Report:
    """Read the convergence history."""
    n = count(file, "report")
    return Report(*(require_rows(file, "report", name, n)[:n] for name in Report._fields))


def version() -> str:
    """Return the version of jamshape."""
    try:
        return importlib.metadata.version(CREATOR)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def write_metadata(file: h5py.File) -> None:
    """Write the metadata that H5MD requires."""
    h5md = file.create_group("h5md")
    h5md.attrs["version"] = [1, 1]
    h5md.create_group("author").attrs["name"] = np.bytes_("unknown")
    creator = h5md.create_group("creator")
    creator.attrs["name"] = np.bytes_(CREATOR)
    creator.attrs["version"] = np.bytes_(version())
    creator.attrs["format_version"] = FORMAT_VERSION
    creator.attrs["origin"] = np.bytes_(origin())


def write_particles(group: h5py.Group, frames: Sequence[Packing]) -> None:
    """Write frames of the same particles into an empty group."""
    first = frames[0]
    set_attributes(group, {"shape_style": first.shape_style, **first.law.stated()})
    # Half lengths and radii reproduce overlaps without the rounding of 2(A + R).
    more = first.shape.stored_of(first.form)
    for name in ("species", "id", "diameters", *more):
        put(group, name, getattr(first, name))
    form = functools.reduce(Form.joined, map(Form.of, frames))
    rows = [frame_values(frame, form) for frame in frames]
    clock = group.create_group("position")
    put(clock, "step", np.array([frame.step for frame in frames]))
    put(clock, "time", np.array([frame.time for frame in frames]))
    elements = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
    for name, values in (elements | column_values(frames)).items():
        element = group.require_group(name)
        put(element, "value", values)
        if name != "position":
            element["step"], element["time"] = clock["step"], clock["time"]
    group["box"].attrs["dimension"] = first.dimension
    group["box"].attrs["boundary"] = np.array([b"periodic"] * first.dimension)


def write_rows(group: h5py.Group, columns: Series | Report) -> None:
    """Write the rows of an observable or the report into an empty group."""
    for name, column in columns._asdict().items():
        put(group, name, column)


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
    """Read the law of the particles."""
    group = require_item(file, "particles/all")
    known = {k: attribute(group, k) for k in Interaction._fields if k in group.attrs}
    if "k_e" in group:  # a large table
        known["k_e"] = require_dataset(group, "k_e")[()]
    try:
        return Interaction.told(known)
    except (TypeError, ValueError) as error:
        msg = f"{file.filename}: k_e, sides and power are not those of contacts ({error}), expected numbers"
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

    def fixed(name: str, most: int = _MOST_COLUMNS) -> Any:
        values = require_dataset(file, f"particles/all/{name}")
        _require_most(values, values.shape, n, most)
        return values[()]

    fields = {name: fixed(name) for name in ("diameters", "species", "id")}
    for name, most in (("exponent", 1), ("form", MOST_NUMBERS)):
        if has_item(file, f"particles/all/{name}"):
            fields[name] = fixed(name, most)
    fields |= {name: row(f"{name}/value") for name in ("position", "orientation", "image")}
    for name, element in RESTS.items():
        if has_item(file, f"particles/all/{element}"):
            whole = fields[name.removesuffix("_rest")]
            fields[name] = as_rest(row(f"{element}/value", sparse=True), whole)
    fields["columns"] = _read_columns(file, frame, n)
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


def _read_columns(file: h5py.File, frame: int, n: int) -> dict[str, NDArray[Any]]:
    """Read the other columns of the particles."""
    group, found = f"particles/all/{COLUMNS}", {}
    for name in require_item(file, group) if has_item(file, group) else ():
        values = require_dataset(file, f"{group}/{name}/value", kinds="biufS")
        if values.shape[1:2] != (n,) or frame >= len(values) or math.prod(values.shape[2:]) > MOST:
            msg = f"{file.filename}: /{group}/{name} has shape {values.shape}, expected rows of {n} particles"
            raise FileFormatError(msg)
        found[name] = column_of(values[frame])
    return found


_MOST_COLUMNS = 4  # numbers of a particle in one array, or of a row of a box


def _require_most(dataset: Any, shape: tuple[int, ...], n: int, most: int = _MOST_COLUMNS) -> None:
    """Refuse an array larger than n particles need, before it is read."""
    if math.prod(shape) > max(n, _MOST_COLUMNS) * most:
        msg = (
            f"{dataset.file.filename}: {dataset.name} has shape {shape}, expected numbers of {n} particles;"
            " write it again"
        )
        raise FileFormatError(msg)
