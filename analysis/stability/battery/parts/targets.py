"""Cases of the stability battery: packings led to an energy."""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import numpy as np

from battery.case import Case
from battery.parts.landscape import UNITS
from battery.scenes.making import scaled
from battery.shapes.table import SHAPES
from jamshape.landscape import Landscape, State
from jamshape.minima import Minimum, Outcome
from jamshape.minima.target import Target, find

PART = "energy target"

ENDED = (Outcome.CONVERGED, Outcome.SLIDING, Outcome.CORNER, Outcome.UNJAMMED)
STARTS = {name: scene for shape in SHAPES for name, scene in shape.solvers.jammed.items()}


@cache
def led(name: str, u0: float, length: float = 1.0, k_e: float = 1.0) -> tuple[Landscape, Minimum]:
    """Lead a small packing to an energy density of u0 in units of the length 1 and k_e 1."""
    packing = scaled(STARTS[name](), length)
    landscape = Landscape(packing, k_e)
    target = Target(u0 * k_e / length**packing.dimension, tolerance=1e-8)
    return landscape, find(landscape, State.of(packing), target)


def target_error(name: str, u0: float, length: float = 1.0, k_e: float = 1.0) -> float:
    """|u - u0| / u0 where forces balance; infinite where they do not."""
    landscape, found = led(name, u0, length, k_e)
    if found.outcome not in ENDED[:2]:
        return np.inf
    wanted = u0 * k_e / length**landscape.particles.dimension
    return abs(found.energy_density / wanted - 1)


def out_of_reach(u0: float) -> str:
    """Ask for an energy that cannot be."""
    led("discs", u0)
    return "no sentence"


def cases() -> list[Case]:
    """All of them."""
    found, what = [], "error of u where forces balance"
    for shape in SHAPES:
        for name in shape.solvers.jammed:
            for u0 in (1e-4, 1e-8, 1e-15, 1e-18):
                quick = name == "discs" or (u0 == 1e-15 and name in shape.solvers.quick)
                run: Any = partial(target_error, name, u0)
                found.append(Case(PART, f"{name}, u0 {u0:g}", what, 1e-7, run, not quick))
        for name in shape.solvers.in_units:
            for length, k_e in UNITS:
                run = partial(target_error, name, 1e-10, length, k_e)
                heavy = name != "discs" and length != 1e6
                label = f"{name}, length {length:g}, k_e {k_e:g}"
                found.append(Case(PART, label, what, 1e-7, run, heavy))
    for u0 in (1e-30, 1.0):
        words, run = (
            r"u0 is .*, whose overlaps are about .* take another u0",
            partial(out_of_reach, u0),
        )
        found.append(Case(PART, f"u0 {u0:g}", "sentence", words, run))
    return found
