"""Loading and saving, whatever a file holds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from jamshape.arguments import checked
from jamshape.files.h5md import read_attributes
from jamshape.files.lammps_text import read_any, write_data
from jamshape.files.signature import GSD, HDF5, format_of
from jamshape.front.modes import Modes
from jamshape.front.packing import MeasuredPacking
from jamshape.front.run import Recorded, run_file
from jamshape.packing import Packing
from jamshape.vibration.table import holds_modes


@checked
def load(path: str | Path, frame: int | None = None) -> MeasuredPacking | Recorded | Modes:
    """Load what is in a file.

    Parameters
    ----------
    path : path
        H5MD of a packing or a run, HDF5 of modes, a LAMMPS dump or data file, or a GSD file.
    frame : int, optional
        Which frame of a run, a dump or a GSD file to take as a packing, from 0 or, if negative, from
        the end; a whole run, or the last frame of the others, when left out.

    Returns
    -------
    MeasuredPacking, RunFile, ShearFile or Modes

    Raises
    ------
    FileFormatError
        If the file is none of these.
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
    path = Path(path)
    found = format_of(path)
    if found == GSD:
        from jamshape.exchange.gsd import read_gsd  # noqa: PLC0415 - gsd may be missing

        return MeasuredPacking.of(read_gsd(path, -1 if frame is None else frame), file=path)
    if found != HDF5:
        packing = read_any(path, -1 if frame is None else frame)
        return MeasuredPacking.of(packing, file=path)
    if holds_modes(path):
        return Modes.read(path)
    if frame is None and "finished" in read_attributes(path):
        return run_file(path)
    return MeasuredPacking.read(path, -1 if frame is None else frame)


@checked
def save(path: str | Path, packing: Packing) -> None:
    """Write a packing, replacing the file that is there only when all is written.

    Parameters
    ----------
    path : path
        Its end says how: ``.h5`` (H5MD, to all digits and with the results), ``.data`` (a LAMMPS data
        file), ``.gsd`` (HOOMD-blue, OVITO).
    packing : Packing

    Raises
    ------
    ValueError
        If the end of the name is none of these.
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
    writer = _WRITERS.get(path.suffix)
    if writer is None:
        msg = f"{path} ends in {path.suffix!r}, expected one of {', '.join(_WRITERS)}"
        raise ValueError(msg)
    writer(path, packing)


def _save_h5(path: Path, packing: Packing) -> None:
    measured = packing if isinstance(packing, MeasuredPacking) else MeasuredPacking.of(packing)
    measured.save(path)


def _save_gsd(path: Path, packing: Packing) -> None:
    from jamshape.exchange.gsd import write_gsd  # noqa: PLC0415 - gsd may be missing

    write_gsd(path, packing)


_WRITERS: dict[str, Callable[[Path, Packing], None]] = {
    ".h5": _save_h5,
    ".data": write_data,
    ".gsd": _save_gsd,
}
