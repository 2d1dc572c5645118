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

_MOST_COLUMNS = 4  # numbers of a particle in one array, or of a row of a box


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


class FrameReader:
    """Reader of the frames of an open file as packings; what they share is looked up and checked once.

    Open datasets also keep their chunks in memory, which rows share.
    """

    def __init__(self, file: h5py.File) -> None:
        self.file = file
        self.n_frames = count(file, "particles/all/position")
        self.n = math.prod(require_dataset(file, "particles/all/species").shape[:1])
        self._rows: dict[str, Any] = {}
        self._shared = self._read_shared()
        self._columns = self._find_columns()
        self._is_size_known = False

    def read(self, frame: int) -> Packing:
        """Read a frame, counted from 0."""
        fields, file = dict(self._shared), self.file
        for name in ("position", "orientation", "image"):
            fields[name] = self._row(f"{name}/value", frame)
        for name, element in RESTS.items():
            if self._has(element):
                whole = fields[name.removesuffix("_rest")]
                fields[name] = as_rest(self._row(f"{element}/value", frame, sparse=True), whole)
        fields["columns"] = {k: column_of(rows[frame]) for k, rows in self._columns.items()}
        fields["step"] = int(self._row("position/step", frame))
        fields["time"] = float(self._row("position/time", frame))
        lo, edges = self._row("box/lo/value", frame), self._row(f"{EDGES}/value", frame)
        try:
            if self._has(EDGES_REST):
                rest = lengths_of(
                    as_rest(self._row(f"{EDGES_REST}/value", frame, sparse=True), edges)
                )
                fields |= {"edges_rest": rest.edges, "tilt_rest": rest.tilt}
            packing = Packing(box=Box(lo, *lengths_of(edges)), **fields)
        except ValueError as error:
            msg = f"{file.filename}: {error}; write it again"
            raise FileFormatError(msg) from error
        if not self._is_size_known:
            _require_one_size(file, packing)
            self._is_size_known = True
        return packing

    def _has(self, element: str) -> bool:
        name = f"{element}/value"
        return name in self._rows or has_item(self.file, f"particles/all/{element}")

    def _row(self, name: str, frame: int, *, sparse: bool = False) -> Any:
        if name not in self._rows:
            element, dataset = f"particles/all/{name}".rsplit("/", 1)
            rows = require_rows(self.file, element, dataset, self.n_frames, sparse=sparse)
            _require_most(rows, rows.shape[1:], self.n)
            self._rows[name] = rows
        return self._rows[name][frame]

    def _read_shared(self) -> dict[str, Any]:
        """Read what all frames share."""
        found = {name: self._fixed(name) for name in ("diameters", "species", "id")}
        for name, most in (("exponent", 1), ("form", MOST_NUMBERS)):
            if has_item(self.file, f"particles/all/{name}"):
                found[name] = self._fixed(name, most)
        style = attribute(require_item(self.file, "particles/all"), "shape_style")
        return found | {"shape_style": style, "law": _read_law(self.file)}

    def _fixed(self, name: str, most: int = _MOST_COLUMNS) -> Any:
        values = require_dataset(self.file, f"particles/all/{name}")
        _require_most(values, values.shape, self.n, most)
        return values[()]

    def _find_columns(self) -> dict[str, Any]:
        """Look up the other columns of the particles."""
        group, found = f"particles/all/{COLUMNS}", {}
        for name in require_item(self.file, group) if has_item(self.file, group) else ():
            rows = require_dataset(self.file, f"{group}/{name}/value", kinds="biufS")
            shape, needed = rows.shape, (self.n_frames, self.n)
            if shape[:1] < needed[:1] or shape[1:2] != needed[1:] or math.prod(shape[2:]) > MOST:
                msg = f"{self.file.filename}: /{group}/{name} has shape {shape}, expected rows of {self.n} particles"
                raise FileFormatError(msg)
            found[name] = rows
        return found


def _require_most(dataset: Any, shape: tuple[int, ...], n: int, most: int = _MOST_COLUMNS) -> None:
    """Refuse an array larger than n particles need, before it is read."""
    if math.prod(shape) > max(n, _MOST_COLUMNS) * most:
        msg = (
            f"{dataset.file.filename}: {dataset.name} has shape {shape}, expected numbers of {n} particles;"
            " write it again"
        )
        raise FileFormatError(msg)
