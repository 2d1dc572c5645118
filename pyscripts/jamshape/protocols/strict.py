"""Strict minima: packings led on from where rods slide until no mode has a negative eigenvalue.

Minimisers leave packings of long rods at saddles: what slides along flat sides lowers the energy by so little that no
force tells (Marschall & Teitel 2018, Appendix B). Here all that slides goes downhill in long steps, limited by new contacts
(`vibration.sliding`); after each step what is stiff is relaxed. A rod that slides off another one unjams the packing, which is
then led to its energy again. Of any shape and dimension.

When nothing slides any more, `protocols.strict_proof` tells whether the state is a minimum.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.contacts import CrossingError
from jamshape.landscape import Landscape
from jamshape.minima import Minimum, Outcome, Stop, minimise
from jamshape.minima.target import Target, find
from jamshape.packing import State
from jamshape.protocols.strict_proof import ModesOffKinks, Proof
from jamshape.vibration.sliding import Sliding, Step

# No particle moves by more in one step, over the smallest radius; after a minimum that is none, by less.
_LONGEST, _CAREFUL = 0.1, 1e-4

# A corner is met where nothing moves by more than this; a step that fails is a quarter as long, down to this.
_STILL = 1e-8

# Residual that leaves only what slides, and how long to look for it.
_RELAXED, _EVALUATIONS = 1e-6, 400

# Residual at which what slides has met its walls.
_SETTLED = 1e-10

# What so few modes have left may lean on walls with less than digits tell. Nudges of so many smallest radii close them;
# forces then balance to this.
_FEW_NEGATIVE = 3
_NUDGES = (1e-10, 1e-9, 1e-8, 1e-7)
_TOUCHING = 1e-9

# The energy falls by a larger part only where particles rearrange, which is believed of steps that are so short, and
# of shorter ones also where the packing unjams.
_SLIDE = 0.05
_SHORT, _SHORTER = 0.02, 2e-3

# A particle that turns back goes less far, and further if it goes on; by the cosine of two steps.
_TURNED = 0.3
_LESS = 4.0

# A search ends after so many steps for each particle, and more, or when so many states were taken for a minimum.
_STEPS, _MORE_STEPS = 4, 400
_MOST_CLOSED = 30


@dataclass(eq=False)
class StrictSearch:
    """A search between two steps: all that is needed to go on from here.

    Parameters
    ----------
    minimum
        Where it is: stiff modes are relaxed there.
    farthest : (N,) array of float64, [length]
        How far particles may move in the next step.
    most_steps
        After so many it ends.
    n_steps, n_fallen, n_closed
        Steps so far; how often the energy fell to nothing, so that the packing was led to it again; and how often
        it was taken for a minimum.
    proof
        Of the minimum, where the search has ended or takes it for one.
    done
        Whether it has ended.
    keeping
        Whether weak contacts are to stay in the next step, as they do after a state that was taken for a minimum.
    last : (N, D + T) array of float64, optional
        The last step, as `sliding.Step.moved`.
    n_free, n_met
        Of the last step: motions that slide, and how many of them are stopped by new contacts.
    """

    minimum: Minimum
    farthest: FloatArray
    most_steps: int
    n_steps: int = 0
    n_fallen: int = 0
    n_closed: int = 0
    proof: Proof | None = None
    done: bool = False
    last: FloatArray | None = None
    keeping: bool = False
    n_free: int = 0
    n_met: int = 0

    def counts(self) -> dict[str, int]:
        """Return what a file says of its course."""
        return {"strict_steps": self.n_steps, "strict_fallen": self.n_fallen}


def start(landscape: Landscape, state: State) -> StrictSearch:
    """Begin at a packing of about the energy that is asked for."""
    minimum = _relaxed(landscape, state)
    most = _MORE_STEPS + _STEPS * landscape.particles.n
    return StrictSearch(minimum, _everywhere(landscape, _LONGEST), most)


def descend(landscape: Landscape, search: StrictSearch, target: Target) -> Iterator[StrictSearch]:
    """Follow negative curvature until none is left.

    Ends where no eigenvalue is below zero by more than its bound and forces balance, and otherwise after a number of
    steps that grows with the packing, or where steps become too short; `StrictSearch.proof` tells which.

    Parameters
    ----------
    landscape : Landscape
    search : StrictSearch
        Where to begin, or to go on.
    target : Target
        The energy, and how well forces are to balance.

    Yields
    ------
    StrictSearch
        The same object after each step.

    Raises
    ------
    TargetError
        As `target.direct`, where the packing unjams on the way and is led to the energy again.
    """
    radius = 0.5 * landscape.length
    while not search.done:
        search.proof = None
        ends = search.n_steps >= search.most_steps or search.n_closed >= _MOST_CLOSED
        if ends or search.farthest.max() < _STILL * radius:
            _close(landscape, search, target)
            search.done |= ends
            yield search
            continue
        reach = float(search.farthest.max())
        sliding = Sliding.at(landscape, search.minimum.state, reach, keeping=search.keeping)
        step = sliding.step(search.farthest, landscape.turning_radius)
        search.n_steps += 1
        search.n_free, search.n_met = sliding.n_free, step.n_met
        size = float(np.abs(step.moved).max(initial=0.0))
        if size > _STILL * radius:
            _take(landscape, search, target, (sliding, step))
        elif reach > 2 * _CAREFUL * radius:
            search.farthest, search.last = _everywhere(landscape, _CAREFUL), None
        elif search.keeping:
            search.keeping = False
        else:
            _close(landscape, search, target)
        yield search


def _take(
    landscape: Landscape, search: StrictSearch, target: Target, way: tuple[Sliding, Step]
) -> None:
    """Take a step if the energy falls, and judge how far the next one may go."""
    sliding, step = way
    radius, reach = 0.5 * landscape.length, float(search.farthest.max())
    shift, turn = sliding.matrix.coordinates.motion(step.vector)
    try:
        there = _relaxed(landscape, search.minimum.state.displaced(shift, turn))
    except CrossingError:
        search.farthest, search.last = np.minimum(search.farthest, reach) / _LESS, None
        return
    energy = search.minimum.evaluation.energy
    change = (there.evaluation.energy - energy) / energy
    settled = there.is_at_rest
    fell = change < -_SLIDE or there.outcome is Outcome.UNJAMMED
    if settled and -_SLIDE < change < 0:
        search.farthest = _next_farthest(search, step.moved, _LONGEST * radius)
        search.minimum, search.last = there, step.moved
    elif fell and reach < (_SHORT if settled else _SHORTER) * radius:
        rough = replace(target, tolerance=_RELAXED, accuracy=1e-3)
        search.minimum = find(landscape, there.state, rough)
        search.farthest, search.last = _everywhere(landscape, _LONGEST), None
        search.n_fallen += 1
    else:
        search.farthest, search.last = search.farthest / _LESS, None


def _next_farthest(search: StrictSearch, moved: FloatArray, longest: float) -> FloatArray:
    """Let particles go further that go on in their direction, and less far where they turn back."""
    if search.last is None:
        return search.farthest
    size, before = (np.linalg.norm(part, axis=1) for part in (moved, search.last))
    cosine = (moved * search.last).sum(axis=1) / np.maximum(size * before, 1e-300)
    goes_on = (cosine > _TURNED) & (size > 0.5 * search.farthest)
    further = np.where(goes_on, np.minimum(2 * search.farthest, longest), search.farthest)
    return np.where(cosine < -_TURNED, search.farthest / _LESS, further)


def _close(landscape: Landscape, search: StrictSearch, target: Target) -> None:
    """Lead what has met its walls to the energy, and look whether it is a minimum."""
    minimum = find(landscape, search.minimum.state, target)
    settled = _settled(landscape, minimum.state)
    is_better = settled.residual.largest < minimum.residual.largest
    if is_better and target.is_met(settled.energy_density):  # it has not fallen apart
        minimum = replace(settled, outcome=minimum.outcome)
    search.n_closed += 1
    minimum, search.proof = _against_walls(landscape, minimum, target)
    balanced = minimum.residual.largest <= target.tolerance
    if search.proof.n_negative == 0 and balanced:
        search.minimum = replace(minimum, outcome=Outcome.CONVERGED)
        search.done = True
        return
    left = Outcome.SLIDING if minimum.outcome is Outcome.CONVERGED else minimum.outcome
    search.minimum = replace(minimum, outcome=left)
    search.farthest, search.last = _everywhere(landscape, _CAREFUL), None
    search.keeping = search.proof.n_negative > 0


def _against_walls(landscape: Landscape, minimum: Minimum, target: Target) -> tuple[Minimum, Proof]:
    """Bring what leans on a wall with less than digits tell into contact with it.

    Whether such a wall is open or closed is decided by rounding; with forces balanced as well, the state in which it is closed
    is the minimum. Nudges along the mode that it stops, both ways, find that state where there is one. On a kink, which
    keeps forces from balancing better, they are to balance as well as is asked for.
    """
    modes = ModesOffKinks.of(landscape, minimum.state)
    proof = modes.proof()
    if not 0 < proof.n_negative <= _FEW_NEGATIVE:
        return minimum, proof
    most = target.tolerance if proof.n_kinked else max(minimum.residual.largest, _TOUCHING)
    radius = 0.5 * landscape.length
    shift, turn = (radius * part for part in modes.lowest_motion())
    for size in (sign * nudge for nudge in _NUDGES for sign in (1, -1)):
        there = _settled(landscape, minimum.state.displaced(size * shift, size * turn))
        if there.residual.largest > most or not target.is_met(there.energy_density):
            continue
        closed = Proof.of(landscape, there.state)
        if closed.n_negative < proof.n_negative:
            return replace(there, outcome=minimum.outcome), closed
    return minimum, proof


def _settled(landscape: Landscape, state: State) -> Minimum:
    """Let forces balance at a fixed box as well as digits allow.

    What slides is pushed against its wall by so little that forces balance to any usual tolerance before it is there:
    the wall is still open, and the mode that it would stop has a negative eigenvalue.
    """
    return minimise(landscape, state, "newton", Stop(_SETTLED, evaluations=_EVALUATIONS))


def _relaxed(landscape: Landscape, state: State) -> Minimum:
    """Relax all that is stiffer than what slides."""
    return minimise(landscape, state, "newton", Stop(_RELAXED, evaluations=_EVALUATIONS))


def _everywhere(landscape: Landscape, part: float) -> FloatArray:
    return np.full(landscape.particles.n, part * 0.5 * landscape.length)
