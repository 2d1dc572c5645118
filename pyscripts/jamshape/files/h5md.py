r"""Packings and runs as H5MD 1.1 files; a packing is a run with one frame.

::

    /h5md               +version [1, 1]   author/+name   creator/+name, version, format_version, origin (platform that determines the last bits: `jamshape.files.origin`)
    /particles/all      +shape_style   +k_e, sides, power: the law of the contacts (1, 2 and 2 if missing)
        box             +dimension D   +boundary D times "periodic"
            edges       {step, time, value (T, D), or (T, D, D) with the edge vectors as rows: for all
                        frames of a file that has a tilted box, the transposes of `Box.matrix`}
            lo          {step, time, value (T, D)}, the lower corner (not in H5MD)
        position        {step, time, value (T, N, D)}
        orientation     {step, time, value (T, N) angles in 2D, (T, N, 4) quaternions w i j k in 3D}
        image           {step, time, value (T, N, D)}
        position_rest, orientation_rest, box/edges_rest    low parts of these, as more
        doubles of their shapes, in files of states with extended precision (not
        in H5MD)
        columns/NAME    {step, time, value (T, N) or (T, N, k)}: other columns of the particles, such as
                        those of a dump, texts as characters (not in H5MD)
        species, id     (N,)
        diameters       (N, 3), the shape columns of LAMMPS (not in H5MD)
        exponent        (N,), for shapes that have one (not in H5MD)
        form            (N, K), for shapes given by further numbers (not in H5MD)
        half_length, radius (N,), A and R of the others, as used for contacts (not in H5MD)
    /observables/NAME   {step, time, value (T', ...)}, each sampled at its own steps; those with the same steps
                        and times share them by hard links
    /parameters         +every attribute given by the caller, including results; texts and arrays above 1 kB
                        are datasets, texts as characters
    /report             step, wall_seconds, error (T'',): the convergence history

Files are of HDF5's format of version 1.10, with checksums everywhere (`jamshape.files.hdf5`).

`step` and `time` of all elements under /particles/all are hard links to those of `position`, as
H5MD requires. `step` is written last and counts the rows: rows beyond it, from an interrupted append,
are ignored and overwritten.

MDAnalysis refuses any box that is not three-dimensional, pairs row i of each observable with frame
i, whatever their steps, and fails on an observable with fewer rows than there are frames;
`jamshape.exchange.mdanalysis` writes what it opens.

Files of another format version are refused; `jamshape convert` rewrites those of jamshape 0.1.0.

The specification: https://nongnu.org/h5md/h5md.html
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.checks import require_other_file
from jamshape.files import layout
from jamshape.files.content import Content
from jamshape.files.disk import PathLike, named, replacing, store
from jamshape.files.frames import row_of
from jamshape.files.hdf5 import FileFormatError, attribute, attributes, require_item
from jamshape.files.layout import Report, Series
from jamshape.files.vocabulary import ENSEMBLE, KIND
from jamshape.packing import Packing
from jamshape.shapes.table import DEFAULT

if TYPE_CHECKING:
    import h5py

__all__ = [
    "FileFormatError",
    "PathLike",
    "Report",
    "Series",
    "copy_run",
    "count_frames",
    "read_attributes",
    "read_clock",
    "read_creator",
    "read_format_version",
    "read_observables",
    "read_origin",
    "read_packing",
    "read_packings",
    "read_particles",
    "read_report",
    "read_series",
    "read_style",
    "replacing",
    "require_attributes",
    "write_frames",
    "write_packing",
    "write_run",
]


def write_packing(
    path: PathLike,
    packing: Packing,
    attributes: Mapping[str, Any] | None = None,
    observables: Mapping[str, ArrayLike] | None = None,
    report: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
) -> None:
    """Write a packing; an existing file is replaced only when writing is complete.

    Parameters
    ----------
    path : path-like
    packing : Packing
    attributes : mapping of str to bool, int, float, str or small array, optional
    observables : mapping of str to array_like of numbers, optional
        Each is stored as one row at the packing's step and time: scalars as float64, arrays with
        their own type. NaN marks undefined values.
    report : three array_like of (T,) numbers, optional
        Convergence history: step, wall seconds, error.

    Raises
    ------
    ValueError
        If an attribute or an observable cannot be stored.
    OSError
        If the file cannot be written.
    """
    content = Content(Path(path), [packing], dict(attributes or {}))
    content.add_row(packing.step, packing.time, observables or {})
    if report is not None:
        content.report = list(zip(*(np.asarray(column).tolist() for column in report), strict=True))
    content.write()


def write_frames(
    path: PathLike, frames: Sequence[Packing], attributes: Mapping[str, Any] | None = None
) -> None:
    """Write packings of the same particles as the frames of a run, with the steps 0, 1, 2, ...

    For errors see `write_run`.
    """
    write_run(path, [frame.with_(step=step) for step, frame in enumerate(frames)], attributes)


def write_run(
    path: PathLike, frames: Sequence[Packing], attributes: Mapping[str, Any] | None = None
) -> None:
    """Write packings as the frames of a run; an existing file is replaced only when writing is complete.

    Parameters
    ----------
    path : path-like
    frames : sequence of Packing
        Frames with the same particles, at ascending steps.
    attributes : mapping of str to bool, int, float, str or small array, optional

    Raises
    ------
    ValueError
        If the particles are not those of the first frame in the same order, or steps do not ascend.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from jamshape.files.h5md import count_frames, write_run
    >>> from jamshape.protocols.random_start import random_packing
    >>> packing = random_packing(n=8, phi=0.3, seed=1)
    >>> write_run("two.h5", [packing, packing.with_(step=5)])
    >>> count_frames("two.h5")
    2
    """
    content = Content(Path(path), [frames[0]], dict(attributes or {}))
    for frame in frames[1:]:
        content.add_frame(frame)
    content.write()


def copy_run(path: PathLike, out: PathLike) -> None:
    """Copy a packing or a run to another file.

    Raises
    ------
    FileFormatError
        As in `read_packing`.
    ValueError
        If both are the same file.
    OSError
        If one cannot be read or the other written.
    """
    require_other_file(Path(out), [Path(path)])
    with layout.opened(path):  # refuses other files
        store(out, Path(path).read_bytes())


def read_packing(path: PathLike, frame: int = -1) -> Packing:
    """Read one frame of a packing or a run.

    Parameters
    ----------
    path : path-like
    frame : int
        Counted from 0 or, if negative, from the end.

    Raises
    ------
    FileFormatError
        If the file is not a complete H5MD file of this module, or a value is not finite.
    ValueError
        If the frame does not exist.
    OSError
        If the file cannot be opened.
    """
    with layout.opened(path) as file:
        _require_frames(path, file)
        reader = layout.FrameReader(file)
        return reader.read(row_of(frame, reader.n_frames, path))


def read_particles(path: PathLike) -> Packing:
    """Read the first frame for its particles alone, also of a table; errors as `read_packing`."""
    with layout.opened(path) as file:
        return layout.FrameReader(file).read(0)


def read_packings(path: PathLike, frames: Sequence[int]) -> list[Packing]:
    """Read some frames, counted from 0; errors as `read_packing`."""
    with layout.opened(path) as file:
        _require_frames(path, file)
        reader = layout.FrameReader(file)
        return [reader.read(row_of(frame, reader.n_frames, path)) for frame in frames]


def read_clock(path: PathLike) -> tuple[IntArray, FloatArray]:
    """Read steps (T,) and times (T,) of the frames; errors as `read_packing`."""
    with layout.opened(path) as file:
        _require_frames(path, file)
        element = "particles/all/position"
        n_frames = layout.count(file, element)
        step, time = (
            layout.require_rows(file, element, name, n_frames)[:n_frames]
            for name in ("step", "time")
        )
        return step, time


def _require_frames(path: PathLike, file: h5py.File) -> None:
    """Refuse the table of an ensemble, whose only frame is a random start that stands for its particles."""
    if attribute(require_item(file, "parameters"), KIND, "") != ENSEMBLE:
        return
    known = attributes(file, "parameters")  # also those that are datasets
    samples, folder = np.size(known.get("ensemble_seeds", ())), known.get("folder")
    advice = f"its packings are in {folder}" if folder else "make it with folder= to keep packings"
    msg = f"{named(Path(path))} holds a table of {samples} samples, expected a packing or a run; {advice}"
    raise FileFormatError(msg)


def count_frames(path: PathLike) -> int:
    """Count the frames of a packing (one) or a run; errors as `read_packing`."""
    with layout.opened(path) as file:
        return layout.count(file, "particles/all/position")


def read_attributes(path: PathLike) -> dict[str, Any]:
    """Read the attributes, as bool, int, float, str or array; errors as `read_packing`."""
    with layout.opened(path) as file:
        return attributes(file, "parameters")


def require_attributes(out: Path, expected: Mapping[str, Any], what: str = "a packing") -> None:
    """Raise if a file has other attributes than expected.

    Raises
    ------
    ValueError
    """
    stored = read_attributes(out)
    for name, value in expected.items():
        if value is None and name not in stored:
            continue
        if not np.array_equal(stored.get(name, np.nan), value):
            msg = (
                f"{out} holds {what} with {name} = {stored.get(name)}, expected {value};"
                " write to another file, or use again to replace it"
            )
            raise ValueError(msg)


def read_style(path: PathLike) -> tuple[str, int]:
    """Read the name of the shape and the dimension, without the arrays; errors as `read_packing`."""
    with layout.opened(path) as file:
        style = attribute(require_item(file, "particles/all"), "shape_style", DEFAULT)
        dimension = attribute(require_item(file, "particles/all/box"), "dimension")
        if not isinstance(style, str) or dimension not in {2, 3}:
            msg = (
                f"{path}: has the shape {style!r} in {dimension!r} dimensions, expected a name and 2 or 3;"
                " write it again"
            )
            raise FileFormatError(msg)
    return style, int(dimension)


def read_format_version(path: PathLike) -> int:
    """Read the version of the names in a file; errors as `read_packing`."""
    with layout.opened(path) as file:
        return layout.version_of(file)


def read_creator(path: PathLike) -> str:
    """Read the version of jamshape that wrote a file; errors as `read_packing`."""
    return _of_creator(path, "version", "unknown")


def read_origin(path: PathLike) -> str:
    """Read the `jamshape.files.origin.origin` stored in a file, "" if missing; errors as `read_packing`."""
    return _of_creator(path, "origin", "")


def _of_creator(path: PathLike, name: str, otherwise: str) -> str:
    with layout.opened(path) as file:
        return str(attribute(require_item(file, "h5md/creator"), name, otherwise))


def read_observables(path: PathLike) -> dict[str, NDArray[Any]]:
    """Read all observables as arrays (T, ...), T = 1 in a packing; errors as `read_packing`."""
    with layout.opened(path) as file:
        return {
            name: layout.read_rows(file, name).value for name in require_item(file, "observables")
        }


def read_series(path: PathLike, name: str) -> Series:
    """Read one observable with its steps and times; errors as `read_packing`."""
    with layout.opened(path) as file:
        return layout.read_rows(file, name)


def read_report(path: PathLike) -> Report:
    """Read the convergence history; errors as `read_packing`."""
    with layout.opened(path) as file:
        return layout.read_report(file)
