"""Strict minima: packings moved along sliding modes until no mode has a negative eigenvalue.

Minimisers leave packings of long rods at saddles: sliding along flat sides lowers the energy by less than
forces resolve (Marschall & Teitel 2018, Appendix B). Here all sliding modes go downhill in long steps, limited by new
contacts (`vibration.sliding`); stiff modes are relaxed after each step. A rod that slides off another one unjams the
packing, which is then relaxed at its energy again. Independent of shape and dimension.

When nothing slides any more, `protocols.strict_proof` decides whether the state is a minimum.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.contacts import CrossingError
from jamshape.landscape import Landscape
from jamshape.minima import Minimum, Outcome, Stop, minimise
from jamshape.minima.target import Goal
from jamshape.packing import State
from jamshape.protocols.strict_proof import ModesOffKinks, Proof
from jamshape.vibration.sliding import Sliding, Step

_LONGEST = 0.1  # largest displacement of a particle in one step, over the smallest radius
_CAREFUL = 1e-4  # the same after a state that was not a minimum

# A step has ended at a wall if nothing moves by more than this; a step that fails is shortened down to this.
_STILL = 1e-8

_RELAXED = 1e-6  # residual with only sliding left
_EVALUATIONS = 400  # to reach it

# Residual at which sliding modes have met their walls.
_SETTLED = 1e-10

_FEW_NEGATIVE = 3  # such modes may touch walls closer than digits resolve
_NUDGES = (1e-10, 1e-9, 1e-8, 1e-7)  # in smallest radii, that close such walls
_TOUCHING = 1e-9  # residual of force balance there

_SLIDE = 0.05  # relative fall of the energy above which particles rearrange, accepted only in short steps
_SHORT, _SHORTER = 0.02, 2e-3  # length of these, and of those in which the packing may unjam

_TURNED = 0.3  # cosine between steps, of either sign, that counts as continuing or turning back
_LESS = 4.0  # reduction of the limits after failed steps and of particles that turn back

_STEPS, _MORE_STEPS = 4, 400  # largest number of steps, for each particle and in addition
_MOST_CLOSED = 30  # largest number of candidate minima


@dataclass(eq=False)
class StrictSearch:
    """A search between two steps, with all that is needed to resume it.

    Parameters
    ----------
    minimum
        Current state, with relaxed stiff modes.
    farthest : (N,) array of float64, [length]
        Largest displacements of particles in the next step.
    most_steps
        Largest number of steps.
    n_steps, n_fallen, n_closed
        Steps so far; times that the packing unjammed and was relaxed again; and
        candidate minima.
    proof
        Proof for the last candidate minimum.
    done
        Whether the search has ended.
    keeping
        Whether weak contacts are kept in the next step, as after a candidate minimum.
    last : (N, D + T) array of float64, optional
        The last step, see `sliding.Step.moved`.
    n_free, n_met
        Sliding modes in the last step, and the number stopped by new contacts.
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

    def __str__(self) -> str:
        left = "" if self.proof is None else f", {self.proof.n_negative} negative eigenvalues of 0"
        if self.proof is not None and self.proof.n_kinked:
            left += (
                f", {self.proof.n_kinked} more at kinks, to both sides of which the energy rises"
            )
        return (
            f"step {self.n_steps} of at most {self.most_steps}, {self.n_free} motions slide, {self.n_met} of"
            f" them up to new contacts, longest step {self.farthest.max():.1e}{left}"
        )

    def counts(self) -> dict[str, int]:
        """Return its counts as attributes."""
        return {"strict_steps": self.n_steps, "strict_fallen": self.n_fallen}


def start(landscape: Landscape, state: State) -> StrictSearch:
    """Begin at a packing of about the target energy."""
    minimum = _relaxed(landscape, state)
    most = _MORE_STEPS + _STEPS * landscape.particles.n
    return StrictSearch(minimum, _everywhere(landscape, _LONGEST), most)


def descend(landscape: Landscape, search: StrictSearch, target: Goal) -> Iterator[StrictSearch]:
    """Follow negative curvature until none is left.

    Ends where no eigenvalue is below minus its bound and forces balance, and otherwise after a number of
    steps that grows with the packing, or when steps become too short; see `StrictSearch.proof`.

    Parameters
    ----------
    landscape : Landscape
    search : StrictSearch
        Initial or resumed state.
    target : Target or FixedBox
        Energy or fixed box, and tolerance of force balance.

    Yields
    ------
    StrictSearch
        The same object after each step.

    Raises
    ------
    TargetError
        As `target.extrapolation`, if the packing unjams on the way and is relaxed again.
    """
    while not search.done:
        advance(landscape, search, target)
        yield search


def advance(landscape: Landscape, search: StrictSearch, target: Goal) -> None:
    """Take a step, or check a candidate; parameters and errors as `descend`."""
    radius = 0.5 * landscape.length
    search.proof = None
    if search.minimum.outcome is Outcome.UNJAMMED:  # at a fixed box
        search.done = True
        return
    ends = search.n_steps >= search.most_steps or search.n_closed >= _MOST_CLOSED
    if ends or search.farthest.max() < _STILL * radius:
        _close(landscape, search, target)
        search.done |= ends
        return
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


def _take(
    landscape: Landscape, search: StrictSearch, target: Goal, way: tuple[Sliding, Step]
) -> None:
    """Take a step if the energy falls, and adapt the next one."""
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
        search.minimum = target.loosened(_RELAXED, 1e-3).find(landscape, there.state)
        search.farthest, search.last = _everywhere(landscape, _LONGEST), None
        search.n_fallen += 1
    else:
        search.farthest, search.last = search.farthest / _LESS, None


def _next_farthest(search: StrictSearch, moved: FloatArray, longest: float) -> FloatArray:
    """Extend the limits of particles that continue in their direction, and reduce those that turn back."""
    if search.last is None:
        return search.farthest
    size, before = (np.linalg.norm(part, axis=1) for part in (moved, search.last))
    cosine = (moved * search.last).sum(axis=1) / np.maximum(size * before, 1e-300)
    goes_on = (cosine > _TURNED) & (size > 0.5 * search.farthest)
    further = np.where(goes_on, np.minimum(2 * search.farthest, longest), search.farthest)
    return np.where(cosine < -_TURNED, search.farthest / _LESS, further)


def _close(landscape: Landscape, search: StrictSearch, target: Goal) -> None:
    """Relax a state that has met its walls at the energy, and check whether it is a minimum."""
    minimum = target.find(landscape, search.minimum.state)
    settled = _settled(landscape, minimum.state)
    is_better = settled.residual.largest < minimum.residual.largest
    if is_better and target.is_met(settled.energy_density):  # still jammed
        minimum = replace(settled, outcome=minimum.outcome)
    search.n_closed += 1
    if minimum.outcome is Outcome.UNJAMMED:
        search.minimum = minimum
        return
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


def _against_walls(landscape: Landscape, minimum: Minimum, target: Goal) -> tuple[Minimum, Proof]:
    """Close walls that are nearer than digits resolve.

    Rounding decides whether such a wall is open or closed; if forces balance equally well, the state with the wall
    closed is the minimum. Nudges along the stopped mode, both ways, find that state if it exists. On a kink, which
    limits the force balance, the requested tolerance suffices.
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
    """Balance forces at a fixed box as well as digits allow.

    Sliding modes are pushed against their walls so weakly that forces balance to any usual tolerance before contact:
    the wall is still open, and its mode has a negative eigenvalue.
    """
    return minimise(landscape, state, "newton", Stop(_SETTLED, evaluations=_EVALUATIONS))


def _relaxed(landscape: Landscape, state: State) -> Minimum:
    """Relax all modes stiffer than sliding ones."""
    return minimise(landscape, state, "newton", Stop(_RELAXED, evaluations=_EVALUATIONS))


def _everywhere(landscape: Landscape, part: float) -> FloatArray:
    return np.full(landscape.particles.n, part * 0.5 * landscape.length)
