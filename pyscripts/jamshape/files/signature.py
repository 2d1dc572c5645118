"""What a file is, by its first bytes and never by its name."""

from __future__ import annotations

from pathlib import Path

from jamshape.files.disk import PathLike

HDF5, DUMP, RESTART, GSD, DATA = "HDF5", "dump", "restart", "GSD", "data"

SIGNATURES = {
    HDF5: b"\x89HDF\r\n\x1a\n",
    DUMP: b"ITEM: ",
    RESTART: b"LammpS RestartT\0",
    GSD: b"\xdf\x65" * 4,
}
"""The first bytes of files by their format; data files of LAMMPS begin with any line."""

_HEAD = 4096  # bytes within which a data file of LAMMPS has named its box


def format_of(path: PathLike) -> str:
    """Tell the format of a file: HDF5, GSD, or a dump, restart or data file of LAMMPS; "" for others.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    with Path(path).open("rb") as file:
        head = file.read(_HEAD)
    for name, signature in SIGNATURES.items():
        if head.startswith(signature):
            return name
    return DATA if b" atoms" in head and b"xlo xhi" in head else ""
