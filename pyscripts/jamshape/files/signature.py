"""Detection of file formats by their first bytes, never by name."""

from __future__ import annotations

from pathlib import Path

from jamshape.files.disk import PathLike

HDF5, DUMP, RESTART, GSD, DATA = "HDF5", "dump", "restart", "GSD", "data"
GZIP, ZSTD, EMPTY = "gzip", "Zstandard", "empty"

SIGNATURES = {
    HDF5: b"\x89HDF\r\n\x1a\n",
    DUMP: b"ITEM: ",
    RESTART: b"LammpS RestartT\0",
    GSD: b"\xdf\x65" * 4,
    GZIP: b"\x1f\x8b",
    ZSTD: b"\x28\xb5\x2f\xfd",
}
"""First bytes of files by format; data files of LAMMPS begin with any line."""

REFUSED = {
    RESTART: (
        "is a restart file of LAMMPS, expected a format that other programs read; read it in a deck"
        " (read_restart) and write a data file (write_data)"
    ),
    GZIP: "is compressed, expected the file itself; unpack it with gunzip",
    ZSTD: "is compressed, expected the file itself; unpack it with unzstd",
    EMPTY: "is empty, expected a packing, a run or modes in HDF5, a LAMMPS dump or data file, or a GSD file",
}
"""Messages for known formats that cannot be read as a state."""

_HEAD = 4096  # bytes within which a LAMMPS data file states its box


def format_of(path: PathLike) -> str:
    """Detect the format of a file: HDF5, GSD, a dump, restart or data file of LAMMPS, compressed; "" for others.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    with Path(path).open("rb") as file:
        head = file.read(_HEAD)
    if not head:
        return EMPTY
    for name, signature in SIGNATURES.items():
        if head.startswith(signature):
            return name
    return DATA if b" atoms" in head and b"xlo xhi" in head else ""
