"""Initial packings of runs."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import Any

from jamshape.files.disk import named
from jamshape.front.packing import MeasuredPacking
from jamshape.packing import Packing
from jamshape.shapes.shape import Interaction


def start_of(start: Packing | str | Path, sides: int = 2) -> MeasuredPacking:
    """Return the initial packing, or the last frame of a file, under the law of the run.

    Warns if the default number of side-to-side bonds differs from that of the start.
    """
    if isinstance(start, str | Path):
        start = MeasuredPacking.read(Path(start))
    known = start if isinstance(start, MeasuredPacking) else MeasuredPacking.of(start)
    if known.law.sides == sides:
        return known
    # `sides` was given explicitly.
    is_asked = sides != Interaction().sides
    if not is_asked and known.compiled().has_sides and not known.is_round.all():
        said = (
            f"the start has sides={known.law.sides} (bonds of a side-to-side contact) and the run"
            f" sides={sides}: energy and forces of the start change"
        )
        warnings.warn(said, stacklevel=4)
    law = known.law.but(sides=sides)
    return known.with_(law=law, results=known.results, file=known.file)


def told_of(start: MeasuredPacking) -> dict[str, Any]:
    """Return metadata on the particles of a start and on its source."""
    own = [parameter.name for parameter in start.shape.parameters]
    names, results = (*own, "size_ratio", "kinds", "seed"), start.results
    found = {name: results[name] for name in names if name in results}
    # As UTF-8, whatever the locale: names may hold bytes that it cannot decode.
    name = os.fsencode(named(start.file)).decode(errors="replace") if start.file else ""
    return found | {"n": start.n, "start": name}
