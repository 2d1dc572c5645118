"""Packings at a chosen energy density: the box and the coordinates of a minimum with u = u0."""

from __future__ import annotations

import collections
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.checks import require_positive
from jamshape.contacts import CrossingError
from jamshape.landscape import Landscape
from jamshape.landscape.newton import Regularised
from jamshape.minima.descent import Descent, History, Minimum, Outcome, Stop, residual_of
from jamshape.minima.line_search import limited, search_along
from jamshape.minima.minimise import minimise
from jamshape.packing import State

# A minimum this good is jammed.
_GOOD = 1e-2

# One this good can follow a change of the box: rods that slide along flat sides, the faster the
# higher the energy, have found where they stop. A move is not made if it leaves a residual above.
_GOOD_TO_MOVE = 1e-4
_FAR = 0.3
_PARTS = (1.0, 0.3, 0.1, 0.01, 1e-3, 1e-4)

# At u0, minima this good are kept while a better one, by that factor, is looked for in so many steps.
_SLIDING = 1e-5
_GAIN = 0.7
_SLIDING_STEPS = 100

# At most this factor in sqrt(u), which is linear in phi - phi_J, from one step to the next.
_LARGEST_FACTOR = 4.0

# Below this fraction of u0 the energy is falling to nothing: the box was opened too far.
_FALLEN = 1e-4

# Steps grow again after so many that left the state unjammed, and at once while they are finer than
# the strain from jamming to u0; a search whose steps fall below this fraction of that strain has failed.
_GROW_AFTER = 4
_SMALLEST_STEP = 1e-3

# Overlaps that can be balanced in long doubles to a residual of 1e-5, and those of soft particles
# that still are particles.
_LEAST_OVERLAP = 1e-13
_LARGEST_OVERLAP = 0.05

_PATIENCE = 1500


class TargetError(RuntimeError):
    """No minimum of the asked energy was found; the sentence says what was."""


@dataclass(frozen=True)
class Target:
    """What to look for.

    Parameters
    ----------
    u0
        Energy density U / L^D, [energy / length^D].
    accuracy
        Of |u - u0| / u0.
    tolerance
        Of the residual of the minimum.
    step
        Strain of the box by which unjammed states are compressed, at first.
    method
        Minimiser of the halving search.

    Raises
    ------
    ValueError
        If a number is not positive.
    """

    u0: float = 1e-15
    accuracy: float = 1e-7
    tolerance: float = 1e-8
    step: float = 5e-4
    method: str = "auto"

    def __post_init__(self) -> None:
        numbers = ("u0", "accuracy", "tolerance", "step")
        require_positive(**{name: getattr(self, name) for name in numbers})

    def is_met(self, u: float) -> bool:
        """Whether an energy density is u0."""
        return abs(u - self.u0) <= self.accuracy * self.u0

    def strain_above_jamming(self, landscape: Landscape) -> float:
        """Estimate the strain of the box between jamming and u0."""
        size = float(landscape.inner_radius.max()) ** landscape.particles.dimension
        return math.sqrt(self.u0 * size / landscape.k_e)


@dataclass(eq=False)
class Search:
    """A search between two minimisations: all that is needed to go on from here.

    Parameters
    ----------
    state
        To be minimised next.
    step
        Strain by which to compress or open the box next.
    loose, loose_in_a_row
        The densest state known to be unjammed, if any; how many were found one after another.
    opening
        Whether the last step opened the box.
    minimum
        The result, once it is found.
    """

    state: State
    step: float
    loose: State | None = None
    loose_in_a_row: int = 0
    opening: bool | None = None
    minimum: Minimum | None = None
    history: History = field(default_factory=History)

    def close_further(self, unjammed: State, fine: float, target: Target) -> None:
        """Go on from an unjammed state, in finer steps if the last one opened the box too far."""
        self.loose, self.loose_in_a_row = unjammed, self.loose_in_a_row + 1
        if self.opening:
            self.step /= 4
        elif self.step < fine or self.loose_in_a_row % _GROW_AFTER == 0:
            self.step = min(2 * self.step, target.step)
        self.opening = False
        self.state = unjammed.strained(-self.step)

    def leave(self, jammed: State) -> None:
        """Go on from a jammed state too far above: in a smaller step to it, or by opening the box."""
        if self.loose is not None:
            self.step /= 4
            self.state = self.loose.strained(-self.step)
            return
        if self.opening:
            self.step *= 2
        self.opening = True
        self.state = jammed.strained(self.step)


def direct(landscape: Landscape, search: Search, target: Target) -> Iterator[Search]:
    """Find the packing by Newton's method on coordinates and box at once.

    Unjammed states are compressed by small strains and minimised, until one stays jammed. From
    there sqrt(u), which is linear in the strain, is led to sqrt(u0) by steps that move the box and
    let the particles follow it to second order. A box opened too far is closed in finer steps.

    Parameters
    ----------
    landscape : Landscape
    search : Search
        Where to begin, or to go on.
    target : Target

    Yields
    ------
    Search
        The same object after each minimisation. The last one has a minimum.

    Raises
    ------
    TargetError
        If steps become too small.
    ValueError
        If u0 is out of reach: overlaps below the rounding of coordinates, or no longer small.
    """
    fine = target.strain_above_jamming(landscape)
    require_reachable(landscape, target)
    while search.minimum is None:
        landscape.forget_pairs()  # what follows depends on `search` alone
        stop = Stop(tolerance=_GOOD, lowest=_FALLEN * target.u0)
        found = minimise(landscape, search.state, "auto", stop, search.history)
        if found.outcome is Outcome.CONVERGED:
            jammed, found = found, _lead_to(landscape, found, target)
            if found.outcome is not Outcome.UNJAMMED and target.is_met(found.energy_density):
                search.minimum, search.state = found, found.state
                yield search
                return
            lost = found.outcome is not Outcome.UNJAMMED or found.state.volume > jammed.state.volume
            if lost and search.loose is not None:
                search.step, search.loose_in_a_row = search.step / 4, 0
        if found.outcome is Outcome.UNJAMMED:
            search.close_further(found.state, fine, target)
        else:
            search.leave(found.state)
        if search.step < _SMALLEST_STEP * fine:
            u = found.energy_density
            msg = (
                f"the search ended between an unjammed state and one of u = {u:.3g} that has a"
                f" residual of {found.residual.largest:.2g}, expected a minimum with u = {target.u0:.3g};"
                " take another u0 or another start"
            )
            raise TargetError(msg)
        yield search


def require_reachable(landscape: Landscape, target: Target) -> None:
    """Refuse a u0 whose overlaps drown in rounding, or are as large as particles.

    Raises
    ------
    ValueError
    """
    overlap = target.strain_above_jamming(landscape)  # of the same size
    if not _LEAST_OVERLAP <= overlap <= _LARGEST_OVERLAP:
        msg = (
            f"u0 is {target.u0:g}, whose overlaps are about {overlap:.1g} of a particle, expected from"
            f" {_LEAST_OVERLAP:g} (rounding) to {_LARGEST_OVERLAP:g}; take another u0"
        )
        raise ValueError(msg)


def _lead_to(landscape: Landscape, start: Minimum, target: Target) -> Minimum:
    """Lead a minimum to u0; unjammed if the energy falls to nothing, stalled if stuck."""
    stop = Stop(tolerance=target.tolerance, lowest=_FALLEN * target.u0)
    descent = Descent(landscape, start.state, stop, start.history)
    descent.be_patient(_PATIENCE)
    regularised, best = Regularised.of(landscape), _Best()
    while True:
        met = target.is_met(descent.evaluation.energy / descent.state.volume)
        outcome = descent.outcome()
        if outcome is Outcome.CONVERGED and met:
            return descent.minimum(outcome)
        if outcome not in {None, Outcome.CONVERGED}:
            return best.minimum or descent.minimum(outcome)
        directions = _Directions.at(descent, regularised)
        best.offer(descent, directions, met)
        if best.minimum and best.age > _SLIDING_STEPS:
            return best.minimum
        _joint_step(descent, directions, regularised, target)


@dataclass
class _Best:
    """The best minimum at u0 so far, when it takes long to find a better one."""

    minimum: Minimum | None = None
    age: int = 0

    def offer(self, descent: Descent, directions: _Directions, met: bool) -> None:
        self.age += 1
        if not met or descent.residual > _SLIDING:
            return
        sliding = directions.stiff <= descent.stop.tolerance
        outcome = Outcome.SLIDING if sliding else Outcome.STALLED
        known = self.minimum.residual.largest if self.minimum else math.inf
        if descent.residual < _GAIN * known:
            self.minimum, self.age = descent.minimum(outcome), 0
        elif sliding and self.stalled and descent.residual < known / _GAIN:
            self.minimum = descent.minimum(outcome)

    @property
    def stalled(self) -> bool:
        """Whether the best one has more left than what slides."""
        return self.minimum is not None and self.minimum.outcome is Outcome.STALLED


@dataclass(frozen=True, eq=False)
class _Directions:
    """Where Newton's method leads: `relax` at fixed box, and `follow` for each unit of its strain.

    `energy` and `slope` are those of the minimum nearby at the present box, the slope along minima.
    `stiff` is the residual without what lies along modes softer than the shift.
    """

    relax: FloatArray
    follow: FloatArray
    energy: float
    slope: float
    stiff: float

    @classmethod
    def at(cls, descent: Descent, regularised: Regularised) -> _Directions:
        evaluation = descent.evaluation
        curvature = descent.landscape.curvature(descent.state)
        factors = regularised.factorise(curvature.hessian)
        right = np.column_stack([evaluation.gradient, curvature.coupling])
        relax, follow = -factors.solve(right).T
        stiff_part = evaluation._replace(gradient=evaluation.gradient + regularised.shift * relax)
        return cls(
            relax=relax,
            follow=follow,
            energy=evaluation.energy + 0.5 * float(evaluation.gradient @ relax),
            slope=evaluation.strain_gradient + float(curvature.coupling @ relax),
            stiff=residual_of(descent.landscape, stiff_part).largest,
        )


def _joint_step(
    descent: Descent, directions: _Directions, regularised: Regularised, target: Target
) -> None:
    """Take a step of Newton's method for the coordinates and, at a minimum, the box."""
    landscape, relax = descent.landscape, directions.relax
    if descent.residual <= _GOOD_TO_MOVE:
        strain = _strain_to(descent, target, directions)
        for part in _PARTS:
            step = relax + part * strain * directions.follow
            small = np.array_equal(limited(landscape, step), step)
            if small and _move(descent, part * strain, step):
                regularised.learn(1)
                return
    along = search_along(descent, limited(landscape, relax))
    regularised.learn(along.tries)
    descent.move_to(along.state, along.evaluation)


def _move(descent: Descent, strain: float, step: FloatArray) -> bool:
    """Move box and coordinates, unless that leads far from equilibrium; say whether it did."""
    landscape = descent.landscape
    trial = landscape.displaced(descent.state.strained(strain), step)
    try:
        found = landscape.evaluate(trial, extended=descent.extended)
    except CrossingError:
        return False
    if found.bond_force == 0.0 or residual_of(landscape, found).largest > _FAR:
        return False
    descent.move_to(trial, found)
    return True


def _strain_to(descent: Descent, target: Target, directions: _Directions) -> float:
    """Strain after which sqrt(u) is that of the target, or nearer to it by a bounded factor."""
    volume, energy = descent.state.volume, directions.energy
    if energy <= 0.0:
        return 0.0
    now, aim = math.sqrt(energy / volume), math.sqrt(target.u0)
    aim = min(max(aim, now / _LARGEST_FACTOR), now * _LARGEST_FACTOR)
    per_strain = (directions.slope - descent.state.dimension * energy) / (2 * now * volume)
    return (aim - now) / per_strain if per_strain < 0 else 0.0


def halving(
    landscape: Landscape, search: Search, target: Target, shortest: float = 1e-16
) -> Iterator[Search]:
    """Find the packing by the halving search of Marschall & Teitel 2018, Sec. III C, as written.

    L and r are scaled by 1 -+ lambda and minimised until U crosses U0; then lambda is halved and
    the direction reversed. `Search.step` is lambda, 1e-6 to begin with in the paper.

    Arguments and results as of `direct`.

    Raises
    ------
    TargetError
        If lambda falls below `shortest` before u is u0.
    """
    while search.minimum is None:
        landscape.forget_pairs()
        stop = Stop(tolerance=target.tolerance)
        found = minimise(landscape, search.state, target.method, stop, search.history)
        u = found.energy_density
        if target.is_met(u):
            search.minimum, search.state = found, found.state
            yield search
            return
        opens = u > target.u0
        if search.opening is not None and search.opening != opens:
            search.step /= 2
        if search.step < shortest:
            msg = (
                f"lambda fell below {shortest:g} at u = {u:.9g}, expected u = {target.u0:.9g};"
                " use the direct search"
            )
            raise TargetError(msg)
        search.opening = opens
        search.state = found.state.strained(search.step if opens else -search.step)
        yield search


def find(landscape: Landscape, start: State, target: Target) -> Minimum:
    """Run the direct search from a state to its end; errors as `direct`."""
    search = Search(start, target.step)
    collections.deque(direct(landscape, search, target), maxlen=0)
    assert search.minimum is not None
    return search.minimum
