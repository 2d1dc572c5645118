"""Cases of the stability battery: random starts."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from battery.case import Case
from jamshape.landscape import Landscape, State
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles

PART = "random start"

_N = 12


def start_error(alpha: float, size_ratio: float, phi: float, dimension: int) -> float:
    """Energy of a random start, which must be 0, and the error of its packing fraction."""
    packing = random_packing(_N, phi, 1, _mixed(alpha, size_ratio), dimension)
    energy = Landscape(packing).evaluate(State.of(packing)).energy
    return max(energy, abs(packing.phi / phi - 1))


def _mixed(alpha: float, size_ratio: float) -> Particles:
    """Take as many small as big ones, one by one: their sizes may differ by more than those of options."""
    size = np.repeat([1.0, size_ratio], _N // 2)
    diameters = np.column_stack([(1 + alpha) * size, size, size])
    return Particles.given("spherocylinder", diameters, species=np.repeat([1, 2], _N // 2))


def too_dense(alpha: float, phi: float) -> str:
    """Ask for what random insertion cannot reach."""
    random_packing(_N, phi, 1, Particles.of("spherocylinder", alpha=alpha))
    return "no sentence"


def cases() -> list[Case]:
    """All of them."""
    found = []
    for alpha, ratio, phi, dimension in (
        (1e-6, 1.4, 0.4, 2), (1e-6, 10.0, 0.4, 2), (100.0, 1.4, 0.05, 2), (1.0, 10.0, 0.3, 3),
        (10.0, 1.4, 0.05, 3), (4.0, 1e6, 0.2, 2),
    ):  # fmt: skip
        run: Any = partial(start_error, alpha, ratio, phi, dimension)
        label = f"{dimension}D, alpha {alpha:g}, size ratio {ratio:g}"
        found.append(Case(PART, label, "energy; error of phi", 1e-14, run))
    for alpha, phi in ((0.0, 0.99), (4.0, 0.9), (100.0, 0.5)):
        words, run = (
            r"(stalled at phi|no direction found).*start at phi",
            partial(too_dense, alpha, phi),
        )
        found.append(Case(PART, f"alpha {alpha:g} at phi {phi:g}", "sentence", words, run))
    return found
