"""A second attempt at unbalanced packings: sliding rods are moved on until new contacts stop them.

Minimisers crawl along flat sides, where no force indicates the distance to the next contact, and stall there. Long
steps along sliding modes, those of strict minima (`vibration.sliding`), reach that contact; forces then balance in
some ten Newton steps, mostly after one or two long ones. Independent of shape and dimension.

The attempt is limited by counted work, not by time: a seed gives the same packing on any machine, and after a kill.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from jamshape.contacts import CrossingError
from jamshape.landscape import Landscape
from jamshape.minima import Minimum, Outcome, Stop, minimise
from jamshape.minima.target import Search, Target, TargetError, extrapolation, fraction_of_energy
from jamshape.packing import State
from jamshape.vibration.sliding import Sliding

# Price of a step along sliding modes, in evaluations (`analysis/outcomes.py price`), up to this number of particles, and the power
# of it with which the price grows beyond: all sliding modes are found together.
_PRICE, _UP_TO, _POWER = 500, 256, 1.5

# Evaluations in which forces balance if they can; otherwise they would use up any number.
_EVALUATIONS = 100

_RELAXED, _ALMOST = (
    1e-6,
    1e-5,
)  # residuals with only sliding left: requested, and accepted if the energy falls
_RELAXING = 400  # evaluations to reach them

_LONGEST = 0.05  # largest displacement of a particle in one step, over the smallest radius
_SHORTEST = 1e-6  # smallest one, at which all sliding has been stopped
_LESS = 4.0  # reduction after steps that fail

_SLIDE = 0.05  # relative fall of the energy above which particles rearrange, accepted only in short steps
_SHORT = 0.02  # length of these

# Fraction of u0 below which a packing has fallen apart.
_FALLEN = 1e-2


@dataclass(eq=False)
class Retry:
    """A second attempt between two steps, with all that is needed to resume it.

    Parameters
    ----------
    state
        Current state.
    budget
        Work limit, [evaluations].
    longest
        Largest displacement of a particle in the next step, over the smallest radius.
    n_steps
        Steps so far; -1 before the initial force balance.
    evaluations
        Evaluations of all forces so far.
    minimum
        The packing, at u0 in force balance, once it is found.
    """

    state: State
    budget: int
    longest: float = _LONGEST
    n_steps: int = -1
    evaluations: int = 0
    minimum: Minimum | None = None

    @property
    def work(self) -> int:
        """Work done, [evaluations]."""
        n = len(self.state.position)
        price = int(_PRICE * max(1.0, n / _UP_TO) ** _POWER)
        return self.evaluations + price * max(self.n_steps, 0)

    @property
    def is_over(self) -> bool:
        """Whether the packing is found, or the work used up."""
        return self.minimum is not None or self.work >= self.budget

    def counts(self) -> dict[str, int]:
        """Return its counts as attributes."""
        return {"retry_steps": max(self.n_steps, 0), "retry_evaluations": self.evaluations}


def go_on(landscape: Landscape, retry: Retry, target: Target) -> Iterator[Retry]:
    """Continue, step by step, until forces balance at u0 or the work is used up.

    Parameters
    ----------
    landscape : Landscape
    retry : Retry
        Initial or resumed state; updated.
    target : Target

    Yields
    ------
    Retry
        The same object after each step. The continuation depends on its numbers alone, to the last bit.
    """
    while not retry.is_over:
        advance(landscape, retry, target)
        yield retry


def advance(landscape: Landscape, retry: Retry, target: Target) -> None:
    """Take a step; parameters as `go_on`."""
    before = landscape.evaluations
    landscape.forget_pairs()  # as after reading from a file
    if retry.n_steps < 0:
        _balance(landscape, retry, target)
    else:
        _slide(landscape, retry, target)
    retry.n_steps += 1
    retry.evaluations += landscape.evaluations - before


def _slide(landscape: Landscape, retry: Retry, target: Target) -> None:
    """Take a step along sliding modes, if the energy falls, and check whether forces balance."""
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
    """Balance forces at a fixed box, and if they do, return the packing to u0."""
    lowest = fraction_of_energy(landscape, _FALLEN) * target.u0
    stop = Stop(target.tolerance, lowest=lowest, evaluations=_EVALUATIONS)
    found = minimise(landscape, retry.state, "newton", stop)
    if found.is_at_rest:
        _lead(landscape, retry, found.state, target)


def _lead(landscape: Landscape, retry: Retry, start: State, target: Target) -> None:
    """Relax a state at u0, as far as the work allows, and continue with long steps."""
    most = landscape.evaluations + retry.budget - retry.work
    search = Search(start, target.step)
    with suppress(TargetError):
        for _ in extrapolation(landscape, search, target):
            if landscape.evaluations > most:
                break
    found = search.minimum
    if found is not None and found.is_at_rest:
        retry.minimum = found
    retry.state = _relaxed(landscape, start if found is None else found.state).state
    retry.longest = _LONGEST


def _relaxed(landscape: Landscape, state: State) -> Minimum:
    """Relax all modes stiffer than sliding ones."""
    return minimise(landscape, state, "newton", Stop(_RELAXED, evaluations=_RELAXING))
