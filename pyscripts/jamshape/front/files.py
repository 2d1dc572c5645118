"""Load and save packings, runs and modes in any supported format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from jamshape.arguments import checked
from jamshape.files.h5md import copy_run, read_attributes, write_packing
from jamshape.files.lammps_text import read_any, write_data
from jamshape.files.meaning import Wanted, require_told
from jamshape.files.signature import GSD, HDF5, format_of
from jamshape.front.modes import Modes
from jamshape.front.packing import MeasuredPacking
from jamshape.front.recorded import KINDS, run_file
from jamshape.front.run import Recorded
from jamshape.packing import Packing
from jamshape.recording.driver import KIND
from jamshape.vibration.table import holds_modes


@checked
def load(
    path: str | Path,
    frame: int | None = None,
    *,
    dimension: int | None = None,
    shape: str | None = None,
) -> MeasuredPacking | Recorded | Modes:
    """Load a packing, a run or modes from a file.

    Parameters
    ----------
    path : path
        H5MD of a packing or a run, HDF5 of modes, a LAMMPS dump or data file, or a GSD file.
    frame : int, optional
        Frame of a run, a dump or a GSD file to return as a packing, counted from 0 or, if negative, from
        the end. By default a whole run, or the last frame of other files.
    dimension : {2, 3}, optional
        Dimension, for a dump or data file that does not state it; guessed by default, with a warning.
    shape : str, optional
        Likewise the shape: ``"spherocylinder"``, ``"superellipsoid"`` or ``"dimer"``. The default law is assumed
        for such a file; use ``packing.with_(law=js.Interaction(k_e, sides))`` for another one.

    Returns
    -------
    MeasuredPacking, RunFile, ShearFile or Modes

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
    path, wanted = Path(path), Wanted(dimension, shape)
    found = format_of(path)
    last = -1 if frame is None else frame
    if found == GSD:
        from jamshape.exchange.gsd import read_gsd  # noqa: PLC0415 - gsd may be missing

        packing = read_gsd(path, last)
        require_told(path, packing, wanted)
        return MeasuredPacking.of(packing, file=path)
    if found != HDF5:
        return MeasuredPacking.of(read_any(path, last, *wanted), file=path)
    if holds_modes(path):
        return Modes.read(path)
    if frame is None and str(read_attributes(path).get(KIND)) in KINDS:
        run = run_file(path)
        require_told(path, run.packing(0), wanted)
        return run
    measured = MeasuredPacking.read(path, last)
    require_told(path, measured, wanted)
    return measured


@checked
def save(path: str | Path, thing: Packing | Recorded | Modes) -> None:
    """Write a packing, a run or modes; an existing file is replaced only when writing is complete.

    Parameters
    ----------
    path : path
        The suffix selects the format: ``.h5`` (HDF5, full precision, with results), ``.data`` (LAMMPS data
        file of one packing, in doubles), ``.gsd`` (HOOMD-blue, OVITO; all frames of a run).
    thing : Packing, RunFile, ShearFile, QuasistaticShearFile or Modes
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


def _save_h5(path: Path, packing: Packing) -> None:
    measured = packing if isinstance(packing, MeasuredPacking) else MeasuredPacking.of(packing)
    write_packing(path, measured, measured.to_store)


def _save_run(path: Path, run: Recorded) -> None:
    copy_run(run.file, path)


def _save_modes(path: Path, modes: Modes) -> None:
    modes.save(path)


def _save_gsd(path: Path, packings: Packing | Recorded) -> None:
    from jamshape.exchange.gsd import write_gsd  # noqa: PLC0415 - gsd may be missing

    write_gsd(path, packings)


_NAMES = {Packing: "a packing", Recorded: "a run", Modes: "modes"}
_WRITERS: dict[str, dict[type, Callable[[Path, Any], None]]] = {
    ".h5": {Packing: _save_h5, Recorded: _save_run, Modes: _save_modes},
    ".data": {Packing: write_data},
    ".gsd": {Packing: _save_gsd, Recorded: _save_gsd},
}
"""Content and writer, by suffix."""
