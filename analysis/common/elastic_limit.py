"""Strain amplitude up to which cycles of a packing are elastic, by bisection with quasistatic cycles."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jamshape.flow.quasistatic import QuasistaticShear, Sheared, shear
from jamshape.landscape import Landscape, State
from jamshape.measures.cycles import distance
from jamshape.packing import Packing

TOLERANCE = 1e-10  # of minimisations

# Energy that an elastic cycle loses at most, over amplitude times range of the stress: rounding is below 1e-6, tiny
# jumps of nearly parallel rods near 3e-4, rearrangements from 1e-3 up.
LOST = 1e-3

FIRST, FACTOR = 1e-3, 4.0
LEAST, MOST = 1e-7, 1.0
"""Range of amplitudes."""


class ElasticLimit(NamedTuple):
    """Largest amplitude at which a cycle was elastic, and smallest at which it was not."""

    low: float
    """0 if there was none."""
    high: float
    """Infinite if there was none."""
    cycles: int
    """Number of cycles that it took."""

    @property
    def value(self) -> float:
        """Middle of both."""
        return (self.low + self.high) / 2

    @property
    def error(self) -> float:
        """Half their distance."""
        return (self.high - self.low) / 2


def is_elastic(packing: Packing, amplitude: float, steps: int = 20, flow: str = "simple") -> bool:
    """Whether a cycle loses no energy and ends with the contacts with which it began.

    Places are not compared: a rod that no force holds along its neighbours need not return, at no loss of energy.

    Parameters
    ----------
    packing : Packing
    amplitude : float
    steps : int
        Number of steps of a quarter of the cycle.
    flow : {"simple", "pure"}
    """
    how = QuasistaticShear(
        strain_step=amplitude / steps, flow=flow, tolerance=TOLERANCE, amplitude=amplitude, cycles=1
    )
    run = Sheared(State.of(packing))
    rows = shear(Landscape(packing), run, how)
    first = next(rows)
    begun = run.state.packing(packing)
    found = [first, *rows]
    range_ = float(np.ptp([row.stress for row in found]))
    if sum(row.lost for row in found) > LOST * amplitude * range_:
        return False
    return distance(begun, run.state.packing(packing), rattlers=False).changed == 0


def elastic_limit(
    packing: Packing, accuracy: float = 0.05, steps: int = 20, flow: str = "simple"
) -> ElasticLimit:
    """Find the amplitude at which a cycle of a packing is no longer elastic.

    A cycle of a smaller amplitude is part of the path of an elastic one, and so elastic too: the limit is unique. A
    rearrangement that is undone on the way back within less than a step is not seen, and the limit is then too large.

    Parameters
    ----------
    packing : Packing
        With two bonds side to side, as in `js.quasistatic_shear`.
    accuracy : float
        Largest relative distance of the two amplitudes that enclose the limit.
    steps, flow
        As in `is_elastic`.

    Returns
    -------
    ElasticLimit
    """
    low, high, cycles, amplitude = 0.0, math.inf, 0, FIRST
    while LEAST <= amplitude <= MOST and high > (1 + accuracy) * low:
        if is_elastic(packing, amplitude, steps, flow):
            low = amplitude
        else:
            high = amplitude
        cycles += 1
        amplitude = _next(low, high)
    return ElasticLimit(low, high, cycles)


def _next(low: float, high: float) -> float:
    if low == 0:
        return high / FACTOR
    return FACTOR * low if math.isinf(high) else math.sqrt(low * high)
