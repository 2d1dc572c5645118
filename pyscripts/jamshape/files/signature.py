"""Detection of file formats by their first bytes, never by name."""

from __future__ import annotations

from pathlib import Path

from jamshape.files.disk import PathLike
from jamshape.files.unpacked import GZIP, PACKED, ZSTD, head_of

HDF5, DUMP, RESTART, GSD, DATA = "HDF5", "dump", "restart", "GSD", "data"
EMPTY = "empty"

SIGNATURES = {
    HDF5: b"\x89HDF\r\n\x1a\n",
    DUMP: b"ITEM: ",
    RESTART: b"LammpS RestartT\0",
    GSD: b"\xdf\x65" * 4,
    **PACKED,
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
_LONGEST = max(map(len, SIGNATURES.values()))


def format_of(path: PathLike) -> str:
    """Detect the format of a file: HDF5, GSD, a dump, restart or data file of LAMMPS; "" for others.

    That of a compressed file is the format of its content for dumps and data files, and else its compression.

    Raises
    ------
    FileFormatError
        If it is compressed, and damaged or compressed by a program that is missing.
    OSError
        If it cannot be read.
    """
    if Path(path).is_dir():
        msg = f"{path} is a folder, expected a file; give the name of a file in it"
        raise IsADirectoryError(msg)
    with Path(path).open("rb") as file:
        head = file.read(_LONGEST)
    found = "" if head else EMPTY
    found = next((name for name, mark in SIGNATURES.items() if head.startswith(mark)), found)
    if found and found not in PACKED:
        return found
    head = head_of(path)
    if head.startswith(SIGNATURES[DUMP]):
        return DUMP
    return DATA if b" atoms" in head and b"xlo xhi" in head else found
