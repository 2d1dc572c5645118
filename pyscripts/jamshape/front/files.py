"""Load and save packings, runs and modes in any supported format."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from jamshape.arguments import checked
from jamshape.files.h5md import (
    copy_run,
    read_attributes,
    read_particles,
    write_packing,
    write_run,
)
from jamshape.files.lammps_text import write_data, write_dump
from jamshape.files.meaning import Wanted, require_told
from jamshape.files.signature import HDF5, format_of
from jamshape.files.vocabulary import KIND
from jamshape.front.frames import Frames
from jamshape.front.modes import Modes
from jamshape.front.packing import Packing
from jamshape.front.reading import packing_of
from jamshape.front.recorded import KINDS, run_file
from jamshape.front.run import Recorded
from jamshape.lammps.living import Living
from jamshape.packing import Packing as PackingLike
from jamshape.vibration.table import holds_modes


@checked
def load(
    path: str | Path | Living,
    frame: int | None = None,
    *,
    dimension: int | None = None,
    shape: str | None = None,
) -> Packing | Recorded | Modes:
    """Load a packing, a run or modes from a file.

    Parameters
    ----------
    path : path
        H5MD of a packing or a run, HDF5 of modes, a LAMMPS dump or data file, also compressed (``.gz``, ``.zst``), or
        a GSD file; or a LAMMPS instance of this process, ``lammps.lammps`` or `jamshape.lammps.session.Session`.
    frame : int, optional
        Frame of a run, a dump or a GSD file to return as a packing, counted from 0 or, if negative, from
        the end. By default a whole run, or the last frame of other files.
    dimension : {2, 3}, optional
        Dimension, for a dump or data file that does not state it; guessed by default, with a warning.
    shape : str, optional
        Likewise the shape: ``"spherocylinder"``, ``"superellipsoid"`` or ``"dimer"``. The default law is assumed
        for such a file; use ``packing.with_(law=js.Interaction(k_e, sides, power))`` for another one.

    Returns
    -------
    Packing, RunFile, ShearFile or Modes

    Raises
    ------
    FileFormatError
        If the file is none of these.
    ValueError
        If the file says another dimension or shape.
    OSError
        If it cannot be opened.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> packing = js.make_packing(rods, n=16, u0=1e-8, file="packing.h5", progress=False)
    >>> js.load("packing.h5")
    <Packing of 16 spherocylinders in 2D: phi = 0.8..., pressure = ...e-05, u = 1e-08, z = 5..., rattlers = 0, in packing.h5>
    """
    if isinstance(path, Living):
        if frame is not None:
            msg = f"frame is {frame}, expected none for a LAMMPS instance, which has one state; leave it out"
            raise ValueError(msg)
    else:
        path = Path(path)
        if format_of(path) == HDF5:
            if holds_modes(path):
                return Modes.read(path)
            if frame is None and str(read_attributes(path).get(KIND)) in KINDS:
                run = run_file(path)
                require_told(path, read_particles(path), Wanted(dimension, shape))
                return run
    return packing_of(path, -1 if frame is None else frame, dimension=dimension, shape=shape)


@checked
def save(path: str | Path, thing: PackingLike | Recorded | Frames | Modes) -> None:
    """Write a packing, a run, frames or modes; an existing file is replaced only when writing is complete.

    Parameters
    ----------
    path : path
        The suffix selects the format: ``.h5`` (HDF5, full precision, with results), ``.data`` (LAMMPS data
        file of one packing, in doubles), ``.dump`` or ``.lammpstrj`` (LAMMPS dump, in doubles), ``.gsd``
        (HOOMD-blue, OVITO); these two take all frames of a run.
    thing : Packing, RunFile, ShearFile, QuasistaticShearFile, Frames or Modes
        A run in ``.h5`` is copied whole; the copy of an unfinished run cannot be resumed.

    Raises
    ------
    ValueError
        If the suffix is none of these, or the format cannot hold such an object.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> packing = js.make_packing(rods, n=16, u0=1e-8, file="packing.h5", progress=False)
    >>> js.save("packing.data", packing)
    """
    path = Path(path)
    if path.suffix not in _WRITERS:
        msg = f"{path} ends in {path.suffix!r}, expected one of {', '.join(_WRITERS)}"
        raise ValueError(msg)
    for kind, write in _WRITERS[path.suffix].items():
        if isinstance(thing, kind):
            write(path, thing)
            return
    held = sorted({_NAMES[kind] for kind in _WRITERS[path.suffix]})
    msg = f"{path}: a {type(thing).__name__} was given, expected {' or '.join(held)} in a file {path.suffix}"
    raise ValueError(msg)


def _save_data(path: Path, packing: PackingLike) -> None:
    if packing.columns:
        said = f"{path} is a data file, which holds no other columns: {', '.join(packing.columns)} are left out"
        warnings.warn(said, stacklevel=4)
    write_data(path, packing)


def _save_h5(path: Path, packing: PackingLike) -> None:
    write_packing(path, packing, packing.to_store)


def _save_run(path: Path, run: Recorded) -> None:
    copy_run(run.file, path)


def _save_modes(path: Path, modes: Modes) -> None:
    modes.save(path)


def _save_gsd(path: Path, packings: PackingLike | Recorded) -> None:
    from jamshape.exchange.gsd import write_gsd  # noqa: PLC0415 - gsd may be missing

    write_gsd(path, packings)


_NAMES = {PackingLike: "a packing", Recorded: "a run", Modes: "modes", Frames: "frames"}
_WRITERS: dict[str, dict[type, Callable[[Path, Any], None]]] = {
    ".h5": {PackingLike: _save_h5, Recorded: _save_run, Modes: _save_modes, Frames: write_run},
    ".data": {PackingLike: _save_data},
    ".gsd": {PackingLike: _save_gsd, Recorded: _save_gsd, Frames: _save_gsd},
    ".dump": {PackingLike: write_dump, Recorded: write_dump, Frames: write_dump},
    ".lammpstrj": {PackingLike: write_dump, Recorded: write_dump, Frames: write_dump},
}
"""Content and writer, by suffix."""
