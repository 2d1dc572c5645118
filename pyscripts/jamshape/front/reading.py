"""Packings from anything that holds particles."""

from __future__ import annotations

from pathlib import Path

from jamshape.files.hdf5 import FileFormatError
from jamshape.files.lammps_text import read_any
from jamshape.files.meaning import Wanted, require_told
from jamshape.files.signature import GSD, HDF5, format_of
from jamshape.front.packing import Packing, public
from jamshape.front.run import Recorded
from jamshape.lammps.living import Living, read_living
from jamshape.packing import Packing as PackingLike
from jamshape.vibration.table import holds_modes

Held = PackingLike | str | Path | Recorded | Living
"""A packing, a file of one or of a run, a run, or a LAMMPS instance."""


def packing_of(
    held: Held, frame: int = -1, *, dimension: int | None = None, shape: str | None = None
) -> Packing:
    """Return a packing: a given one, a frame of a file or of a run, or the present state of LAMMPS; arguments and errors as of `load`."""
    wanted = Wanted(dimension, shape)
    if isinstance(held, PackingLike):
        return public(held)
    if isinstance(held, Living):
        return public(read_living(held, wanted))
    path = held.file if isinstance(held, Recorded) else Path(held)
    found = format_of(path)
    if found == GSD:
        from jamshape.exchange.gsd import read_gsd  # noqa: PLC0415 - gsd may be missing

        packing = public(read_gsd(path, frame), file=path)
    elif found == HDF5:
        if holds_modes(path):
            msg = f"{path} holds modes, expected particles; give the file of their packing"
            raise FileFormatError(msg)
        packing = Packing.read(path, frame)
    else:
        return public(read_any(path, frame, *wanted), file=path)
    require_told(path, packing, wanted)
    return packing
