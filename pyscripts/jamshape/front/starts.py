"""Packings that runs begin with."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from jamshape.front.packing import MeasuredPacking
from jamshape.packing import Packing


def start_of(start: Packing | str | Path) -> MeasuredPacking:
    """Take the packing to begin with, of a path its last frame."""
    if isinstance(start, str | Path):
        return MeasuredPacking.read(Path(start))
    return start if isinstance(start, MeasuredPacking) else MeasuredPacking.of(start)


def told_of(start: MeasuredPacking) -> dict[str, Any]:
    """Pick what is said of the particles of a start, and where it is from."""
    own = [parameter.name for parameter in start.shape.parameters]
    names, results = (*own, "size_ratio", "kinds", "seed"), start.results
    found = {name: results[name] for name in names if name in results}
    # As UTF-8, whatever the locale: names may hold bytes that it cannot read.
    name = os.fsencode(start.file).decode(errors="replace") if start.file else ""
    return found | {"n": start.n, "start": name}
