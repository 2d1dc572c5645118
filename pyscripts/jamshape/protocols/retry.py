"""A second try where forces do not balance: rods that slide are moved on to where something stops them.

Minimisers crawl along flat sides, where no force tells how far it is to the next contact, and give up there. Long steps along
what slides, those of strict minima (`vibration.sliding`), lead to that contact; forces then balance in some ten steps of
Newton's method, mostly after one or two long ones. Of any shape and dimension.

The second try is limited by work that is counted, not by time: a seed leads to the same packing on any machine, and after a kill.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from jamshape.contacts import CrossingError
from jamshape.landscape import Landscape
from jamshape.minima import Minimum, Outcome, Stop, minimise
from jamshape.minima.target import Search, Target, TargetError, direct
from jamshape.packing import State
from jamshape.vibration.sliding import Sliding

# A step along what slides takes the time of so many evaluations (`analysis/outcomes.py price`).
_PRICE = 500

# Forces that can balance do so in so many evaluations; those that cannot would take all that one gives.
_EVALUATIONS = 100

# Residuals that leave only what slides: as it is asked for, and what is accepted where the energy falls.
_RELAXED, _ALMOST, _RELAXING = 1e-6, 1e-5, 400

# No particle moves by more than the first in one step, over the smallest radius. Steps that fail are a quarter as long, down to
# the second, where all that slides has been stopped.
_LONGEST, _SHORTEST = 0.05, 1e-6
_LESS = 4.0

# The energy falls by a larger part only where particles rearrange, which is believed of shorter steps.
_SLIDE, _SHORT = 0.05, 0.02

# Below this part of u0 a packing has fallen apart.
_FALLEN = 1e-2


@dataclass(eq=False)
class Retry:
    """A second try between two steps: all that is needed to go on from here.

    Parameters
    ----------
    state
        Where it is.
    budget
        Work after which it ends, [evaluations].
    longest
        No particle moves by more in the next step, over the smallest radius.
    n_steps
        Steps so far; -1 before forces were first balanced without one.
    evaluations
        Of all forces so far.
    minimum
        The packing, at u0 and with forces that balance, once it is found.
    """

    state: State
    budget: int
    longest: float = _LONGEST
    n_steps: int = -1
    evaluations: int = 0
    minimum: Minimum | None = None

    @property
    def work(self) -> int:
        """Work that is done, [evaluations]."""
        return self.evaluations + _PRICE * max(self.n_steps, 0)

    @property
    def is_over(self) -> bool:
        """Whether the packing is found, or the work used up."""
        return self.minimum is not None or self.work >= self.budget

    def counts(self) -> dict[str, int]:
        """Return what a file says of its course."""
        return {"retry_steps": max(self.n_steps, 0), "retry_evaluations": self.evaluations}


def go_on(landscape: Landscape, retry: Retry, target: Target) -> Iterator[Retry]:
    """Try again, step by step, until forces balance at u0 or the work is used up.

    Parameters
    ----------
    landscape : Landscape
    retry : Retry
        Where to begin, or to go on; moved along.
    target : Target

    Yields
    ------
    Retry
        The same object after each step. What follows depends on its numbers alone, to the last bit.
    """
    while not retry.is_over:
        before = landscape.evaluations
        landscape.forget_pairs()  # as where it is read from a file
        if retry.n_steps < 0:
            _balance(landscape, retry, target)
        else:
            _slide(landscape, retry, target)
        retry.n_steps += 1
        retry.evaluations += landscape.evaluations - before
        yield retry


def _slide(landscape: Landscape, retry: Retry, target: Target) -> None:
    """Take a step along what slides, if the energy falls, and see whether forces balance there."""
    radius = 0.5 * landscape.length
    reach = retry.longest * radius
    sliding = Sliding.at(landscape, retry.state, reach)
    farthest = np.full(landscape.particles.n, reach)
    step = sliding.step(farthest, landscape.turning_radius)
    if retry.longest < _SHORTEST or np.abs(step.moved).max(initial=0.0) < _SHORTEST * reach:
        _lead(landscape, retry, retry.state, target)
        return
    energy = landscape.evaluate(retry.state).energy
    shift, turn = sliding.matrix.coordinates.motion(step.vector)
    try:
        there = _relaxed(landscape, retry.state.displaced(shift, turn))
    except CrossingError:
        retry.longest /= _LESS
        return
    change = there.evaluation.energy / energy - 1
    is_relaxed = there.residual.largest <= _ALMOST and there.outcome is not Outcome.UNJAMMED
    if is_relaxed and -_SLIDE < change < 0:
        retry.state = there.state
        _balance(landscape, retry, target)
    elif change < -_SLIDE and retry.longest < _SHORT:
        _lead(landscape, retry, there.state, target)
    else:
        retry.longest /= _LESS


def _balance(landscape: Landscape, retry: Retry, target: Target) -> None:
    """Let forces balance at a fixed box, and where they do so lead the packing back to u0."""
    stop = Stop(target.tolerance, lowest=_FALLEN * target.u0, evaluations=_EVALUATIONS)
    found = minimise(landscape, retry.state, "newton", stop)
    if found.is_at_rest:
        _lead(landscape, retry, found.state, target)


def _lead(landscape: Landscape, retry: Retry, start: State, target: Target) -> None:
    """Lead a state to u0, as far as the work allows, and go on from there with long steps."""
    most = landscape.evaluations + retry.budget - retry.work
    search = Search(start, target.step)
    with suppress(TargetError):
        for _ in direct(landscape, search, target):
            if landscape.evaluations > most:
                break
    found = search.minimum
    if found is not None and found.is_at_rest:
        retry.minimum = found
    retry.state = _relaxed(landscape, start if found is None else found.state).state
    retry.longest = _LONGEST


def _relaxed(landscape: Landscape, state: State) -> Minimum:
    """Relax all that is stiffer than what slides."""
    return minimise(landscape, state, "newton", Stop(_RELAXED, evaluations=_RELAXING))
