"""Whether files of LAMMPS have their end, and dumps cut to the frames that are whole."""

from __future__ import annotations

import mmap
import os
import re
from pathlib import Path

_MAGIC = b"LammpS RestartT\0"
_EVER = 10**18


def is_whole_restart(path: Path) -> bool:
    """Whether a restart file has its end."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - len(_MAGIC)))
        return size > 2 * len(_MAGIC) and file.read() == _MAGIC


def is_whole_data(path: Path) -> bool:
    """Whether a data file has all lines of its last section."""
    if not path.stat().st_size:
        return False
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
        counted = re.search(rb"^ *([0-9]+) ellipsoids$", text[:4096], re.MULTILINE)
        last = text.rfind(b"Ellipsoids")
        return counted is not None and last > 0 and text[last:].count(b"\n") == int(counted[1]) + 2


def cut_dump(path: Path, step: int = _EVER) -> bool:
    """Cut a dump, if there is one, to the frames before a step that are whole, and say whether any of it went."""
    if not path.is_file() or not path.stat().st_size:
        return False
    with path.open("r+b") as file:
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
            size, kept = len(text), _kept(text, step)
        file.truncate(kept)
    return kept < size


def _kept(text: mmap.mmap, step: int) -> int:
    """Count the bytes of whole frames before a step."""
    start, last = text.find(b"ITEM: TIMESTEP"), None
    while start >= 0:
        number = text[start : start + 64].split(b"\n")[1:]
        if len(number) < 2 or not number[0].isdigit() or int(number[0]) >= step:
            break
        start, last = text.find(b"ITEM: TIMESTEP", start + 1), start
    if last is None:
        return 0
    end = _frame_end(text, last)
    return last if end is None else end


def _frame_end(text: mmap.mmap, start: int) -> int | None:
    """Find where the frame of a dump ends that starts here; None if it was cut short."""
    counted = text.find(b"ITEM: NUMBER OF", start)
    number = text[counted : counted + 64].split(b"\n")[1:2] if counted >= 0 else []
    heads = [text.find(b"\nITEM: " + kind, counted) for kind in (b"ATOMS", b"ENTRIES")]
    at = max(heads) + 1
    if not number or not number[0].isdigit() or not at:
        return None
    for _ in range(int(number[0]) + 1):
        at = text.find(b"\n", at) + 1
        if not at:
            return None
    return at
