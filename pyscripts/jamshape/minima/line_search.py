"""How far to go along a direction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.contacts import CrossingError
from jamshape.landscape import Evaluation, Landscape
from jamshape.landscape.newton import LONGEST_STEP, WIDEST_TURN
from jamshape.minima.descent import Descent
from jamshape.packing import State

# A slope that rises by more than the inverse of this does so at a corner, wherever that is.
_CORNER = 0.1


def limited(landscape: Landscape, step: FloatArray) -> FloatArray:
    """Shorten a step that moves or turns a particle too far."""
    longest = LONGEST_STEP * 0.5 * landscape.length
    shift, turn = landscape.motion(step)
    excess = max(
        np.sqrt((shift**2).sum(axis=1)).max() / longest, np.abs(turn).max() / WIDEST_TURN, 1.0
    )
    return np.asarray(step / excess)


class LineSearch(NamedTuple):
    """Where a line search ended, and after how many evaluations."""

    state: State
    evaluation: Evaluation
    factor: float
    tries: int


def search_along(descent: Descent, step: FloatArray, tries: int = 25) -> LineSearch:
    """Find a point along a descent direction where the projected force has fallen to half.

    On forces, not energies, whose differences drown in rounding long before forces vanish. The
    projected force is close to piecewise linear, with a corner where a contact closes that may be
    ten orders of magnitude stiffer than what came before: two points beyond the corner give it.
    """
    landscape = descent.landscape
    slope = float(descent.evaluation.gradient @ step)
    bracket = Bracket(slope)
    factor = 1.0
    for n in range(1, 2 * tries):
        state = landscape.displaced(descent.state, factor * step)
        try:
            evaluation = landscape.evaluate(state, extended=descent.extended)
        except CrossingError:
            factor = bracket.next(factor, np.inf)
            continue
        here = float(evaluation.gradient @ step)
        if abs(here) <= 0.5 * abs(slope) or (here < 0 and factor == 1.0) or n >= tries:
            break
        factor = bracket.next(factor, here)
    return LineSearch(state, evaluation, factor, n)


class Bracket:
    """Bracket of the zero of the slope along a line, from 0 where it is negative."""

    def __init__(self, slope: float) -> None:
        self.low, self.low_slope = 0.0, slope
        self.high, self.high_slope = np.inf, np.inf

    def next(self, at: float, slope: float) -> float:
        """Take in a point and propose the next one."""
        corner = np.nan
        if slope > 0:
            if np.isfinite(self.high_slope) and self.high_slope > slope:
                corner = at - slope * (self.high - at) / (self.high_slope - slope)
            self.high, self.high_slope = at, slope
        else:
            self.low, self.low_slope = at, slope
        width = self.high - self.low
        if self.low < corner < self.high:  # a little beyond, so that the contact is closed
            return corner + 1e-3 * (self.high - corner)
        part = -self.low_slope / (self.high_slope - self.low_slope)
        return float(self.low + width * (part if part > _CORNER else 0.5))
