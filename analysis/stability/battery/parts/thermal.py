"""Cases of the stability battery: Monte Carlo of hard particles."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from battery.case import Case
from battery.images import contacts_of
from battery.pairs import TOUCHING
from battery.parts.implicit import UNITS
from battery.scenes.making import Scene, every_image, scaled
from battery.scenes.superellipsoids import hard
from battery.shapes.table import SHAPES
from jamshape.protocols.thermal import Thermal, equilibrate

PART = "hard Monte Carlo"


def overlaps_after(packing: Scene, size: float, sweeps: int = 40) -> float:
    """Pairs that overlap after some sweeps, over all images; infinite if nothing was accepted."""
    thermal, accepted = Thermal(packing(), size=size), 0.0
    for _ in equilibrate(thermal, sweeps, seed=1):
        accepted += thermal.acceptance
    found = contacts_of(thermal.packing, *every_image(thermal.packing))
    # Between blocks positions are rounded: contacts closer than that may be called overlaps.
    wrong = (found["status"] != TOUCHING) | (np.sqrt(2 * found["energy"]) > 2e-13)
    return float(wrong.sum()) if accepted > 0 else np.inf


def acceptance_error(size: float) -> float:
    """Distance of the acceptance from 0.35 after steps of any size were led there."""
    thermal, found = Thermal(hard(2, 1.0, 2.0), size=size), []
    for _ in equilibrate(thermal, 1200, seed=1):
        found.append(thermal.acceptance)  # noqa: PERF401 - the object is the same
    return abs(float(np.mean(found[-40:])) - 0.35)


def thermal_in_units(length: float) -> float:
    """Change of scaled positions by a unit that is a power of two."""
    start, ends = hard(2, 1.0, 2.0, 0.1), []
    for unit in (1.0, length):
        thermal = Thermal(scaled(start, unit))
        for _ in equilibrate(thermal, 50, seed=1):
            pass
        ends.append(thermal.packing.position / unit)
    return float(np.abs(ends[1] - ends[0]).max())


def _refused(change: str) -> str:
    packing = hard(2, 1.0, 2.0, 0.1)
    thermal = Thermal(packing)
    if change == "overlapping start":
        thermal.packing = packing.with_(position=0.5 * packing.position)
    elif change == "coincident centres":
        x = packing.position.copy()
        x[1] = x[0]
        thermal.packing = packing.with_(position=x)
    else:
        thermal.size = float(change.removeprefix("size "))
    next(equilibrate(thermal, 10, 1))
    return f"no sentence, size {thermal.size:g}"


def cases() -> list[Case]:
    """All of them."""
    found, what = [], "pairs that overlap after 40 sweeps"
    run: Any
    for shape in SHAPES:
        own = shape.compressed
        for name, scene in own.hard.items():
            run = partial(overlaps_after, scene, 0.1)
            found.append(Case(PART, name, what, 0.0, run, name in own.heavy_sweeps))
    for size in (1e-12, 1e-6, 1e6):
        run = partial(overlaps_after, partial(hard, 2, 10.0, 1.0), size)
        found.append(Case(PART, f"touching, moves of {size:g}", what, 0.0, run))
        run = partial(acceptance_error, size)
        # Of 480 sweeps of 12 moves, by binomial noise and the size's own steps.
        found.append(Case(PART, f"moves of {size:g} are led", "acceptance less 0.35", 0.05, run))
    for length, _ in UNITS[:2]:
        label, run = f"length {length:.3g}", partial(thermal_in_units, length)
        found.append(Case(PART, label, "change of scaled positions", 0.0, run))
    overlap, no_size = (
        "particles overlap, expected a start without overlaps",
        "size is .*, expected",
    )
    sentences = {
        "overlapping start": overlap, "coincident centres": overlap,
        "size 0": no_size, "size -1": no_size, "size nan": no_size,
    }  # fmt: skip
    for name, words in sentences.items():
        found.append(Case(PART, name, "sentence", words, partial(_refused, name)))
    return found
