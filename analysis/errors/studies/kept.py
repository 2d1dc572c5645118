"""Results of finished parts of a study, kept in its folder and reused the next time."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from jamshape.command import plain
from jamshape.files.disk import store
from jamshape.files.h5md import read_packing, write_packing
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session
from jamshape.packing import Packing


def kept(path: Path, make: Callable[..., dict[str, Any]], *arguments: Any) -> dict[str, Any]:
    """Return what was found before, or find it."""
    if not path.exists():
        store(path, json.dumps(plain(make(*arguments))).encode())
    found: dict[str, Any] = json.loads(path.read_text())
    return found


def kept_packing(path: Path, make: Callable[[], Packing]) -> Packing:
    """Return the packing of before, or make it."""
    if not path.exists():
        write_packing(path, make())
    return read_packing(path)


def compressed(start: Packing, settings: Compression) -> Packing:
    """Compress in LAMMPS to the end."""
    with Session() as session:
        run = CompressionRun(session, settings, start)
        run.advance(run.last_step)
        return run.packing()
