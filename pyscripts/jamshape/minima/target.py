"""Packings at a target energy density: box and coordinates of a minimum with u = u0."""

from __future__ import annotations

import collections
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from jamshape.checks import require_one_of, require_positive
from jamshape.landscape import Landscape
from jamshape.landscape.local_energy_model import LocalEnergyModel
from jamshape.landscape.newton import least_shift
from jamshape.minima.descent import History, Minimum, Outcome, Stop, residual_of
from jamshape.minima.minimise import METHODS, minimise
from jamshape.packing import State

# A minimum with this residual is jammed.
_GOOD = 1e-2

# Largest residual of minima on the way to u0: particles that rotate along soft modes, as rods that slide along flat sides,
# have come to rest. In 2D Newton's method reaches it in a few steps; for spheres, which have no such modes, a jammed
# minimum is good enough.
_GOOD_TO_MOVE = 1e-4

# Residual left by sliding is smaller than this.
_SLIDING = 1e-5

_MOST_MINIMA = 60  # on the way to u0
_MOST_STALLS = 6  # in a row at u0 without a smaller residual
_GAIN = 1.5  # relaxation of the tolerance after a stall that leaves only sliding
_NEAR = 0.1  # relative distance of the root of u to its target below which minima have the full tolerance
_TRIES = 2  # fractions of a strain to try where the whole one unjams the packing
_SOFT = 1e-6  # stiffness, over that of a bond, below which modes count as sliding
_CLOSE = 1e-3  # relative distance of u to u0 below which losses by minimising are compensated
_CYCLES = 3  # approaches to u0 after stalls
_HIGHER = 2.0  # energy over u0 from which they start again
_STIFF_STEPS = 4  # Newton steps that relax stiff modes
_ACCURACY = 1e-9  # of the solutions of Newton's equations

# Largest factor in the root of u that is linear in phi - phi_J, sqrt(u) of harmonic contacts, between two steps.
_LARGEST_FACTOR = 4.0

# A minimisation whose energy falls below this fraction of its target is unjamming: the box was opened too far. All
# fractions of energies are those of harmonic contacts; of other ones those of the same change of overlaps.
_FALLEN = 1e-2

# Likewise for this fraction of the energy that a compression step adds to a jammed packing.
_UNJAMMED = 1e-3

# A packing slides whose energy falls below this fraction of the expected one, or which, far from rest, takes more evaluations
# than this and than these for each particle or, of round particles, whose energy has no kinks, stalls below the energy at
# which the step began. It is compressed, at most this many times: at a fixed box the forces that drive the slide would fade, and
# with them its speed. Each time the root of u that is linear in the strain grows by this factor, up to that times the one at
# which the step began: compressed further, it has far to go back, on which it may slide again.
_SLID, _MOST_PARTS, _DRIVEN = 0.7, 100, 2.0
_LONG, _LONG_FOR_EACH = 10_000, 2

# Relative accuracy of the predicted displacements as the box is strained.
_PREDICTION = 1e-3

_GROW_AFTER = (
    4  # unjammed states in a row; steps finer than the strain from jamming to u0 grow at once
)
_SMALLEST_STEP = 1e-3  # over that strain; a search with finer steps has failed

_LEAST_OVERLAP = 1e-13  # long doubles balance it to a residual of 1e-5
_LARGEST_OVERLAP = 0.05  # of soft particles


class TargetError(RuntimeError):
    """No minimum of the target energy was found; the message says what was."""


@dataclass(frozen=True)
class Target:
    """Goal of a search.

    Parameters
    ----------
    u0
        Energy density U / L^D, [energy / length^D].
    accuracy
        Largest |u - u0| / u0.
    tolerance
        Largest residual of the minimum.
    step
        Initial strain of the box by which unjammed states are compressed.
    method
        Minimiser of bisection.

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

    @property
    def settings(self) -> dict[str, Any]:
        """Settings as attributes."""
        return dict(vars(self))

    def require(self, landscape: Landscape) -> None:
        """Refuse a goal out of reach; raises ValueError."""
        require_reachable(landscape, self)

    def is_met(self, u: float) -> bool:
        """Whether an energy density equals u0 to the accuracy."""
        return abs(u - self.u0) <= self.accuracy * self.u0

    def loosened(self, tolerance: float, accuracy: float) -> Target:
        """Return the goal of a rough search."""
        return replace(self, tolerance=tolerance, accuracy=accuracy)

    def find(self, landscape: Landscape, start: State) -> Minimum:
        """Find the minimum of the energy u0 that begins at a state; errors as `extrapolation`."""
        return find(landscape, start, self)

    def strain_above_jamming(self, landscape: Landscape) -> float:
        """Estimate the strain of the box between jamming and u0."""
        return strain_at(landscape, self.u0)


@dataclass(frozen=True)
class FixedBox:
    """Goal of a minimisation at a fixed box; parameters as of `Target`."""

    tolerance: float = 1e-8
    method: str = "auto"

    def __post_init__(self) -> None:
        require_positive(tolerance=self.tolerance)
        require_one_of("minimiser", self.method, METHODS)

    @property
    def settings(self) -> dict[str, Any]:
        """Settings as attributes."""
        return dict(vars(self))

    def require(self, landscape: Landscape) -> None:
        """Refuse nothing."""

    def is_met(self, u: float) -> bool:
        """Accept every energy."""
        del u
        return True

    def loosened(self, tolerance: float, accuracy: float) -> FixedBox:
        """Return the goal of a rough minimisation."""
        del accuracy
        return replace(self, tolerance=tolerance)

    def find(self, landscape: Landscape, start: State) -> Minimum:
        """Minimise a state."""
        return minimise(landscape, start, self.method, Stop(self.tolerance))


Goal = Target | FixedBox
"""Goal to which a search for a strict minimum returns."""


def strain_at(landscape: Landscape, u: float) -> float:
    """Estimate the strain of the box between jamming and an energy density."""
    return landscape.law.overlap_of(u / _stiffness(landscape))


def fraction_of_energy(landscape: Landscape, of_harmonic: float) -> float:
    """Return the fraction to which an energy falls where that of harmonic contacts would fall to another one."""
    fraction: float = of_harmonic ** (landscape.law.power / 2)
    return fraction


def _stiffness(landscape: Landscape) -> float:
    """Estimate the energy density of a jammed packing over the squared strain from jamming."""
    return (
        landscape.stiffness / float(landscape.inner_radius.max()) ** landscape.particles.dimension
    )


@dataclass(eq=False)
class Search:
    """A search between two minimisations, with all that is needed to resume it.

    Parameters
    ----------
    state
        State to minimise next.
    step
        Strain of the next compression or opening of the box.
    loose, loose_in_a_row
        Densest state known to be unjammed, if any; number of unjammed states in a row.
    opening
        Whether the last step opened the box.
    leading
        Way from a jammed state to u0, while the search is on it.
    minimum
        Result, once it is found.
    """

    state: State
    step: float
    loose: State | None = None
    loose_in_a_row: int = 0
    opening: bool | None = None
    leading: Leading | None = None
    minimum: Minimum | None = None
    history: History = field(default_factory=History)

    def lowest(self, landscape: Landscape, target: Target) -> float | None:
        """Return the energy density below which the state, once minimised, is unjammed.

        The energy of a compressed jammed state is far above; a start may have any energy.
        """
        if self.opening is None:
            return None
        least = fraction_of_energy(landscape, _FALLEN) * target.u0
        added = _UNJAMMED * _stiffness(landscape) * self.step**2
        added *= landscape.law.over_harmonic(_UNJAMMED * self.step**2)
        return least if self.opening else max(least, added)

    def close_further(self, unjammed: State, fine: float, target: Target) -> None:
        """Continue from an unjammed state, in finer steps if the last one opened the box too far."""
        self.loose, self.loose_in_a_row = unjammed, self.loose_in_a_row + 1
        if self.opening:
            self.step /= 4
        elif self.step < fine or self.loose_in_a_row % _GROW_AFTER == 0:
            self.step = min(2 * self.step, target.step)
        self.opening = False
        self.state = unjammed.strained(-self.step)

    def leave(self, jammed: State) -> None:
        """Continue from a jammed state too far above: in a smaller step to it, or by opening the box."""
        if self.loose is not None:
            self.step /= 4
            self.state = self.loose.strained(-self.step)
            return
        if self.opening:
            self.step *= 2
        self.opening = True
        self.state = jammed.strained(self.step)


def extrapolation(landscape: Landscape, search: Search, target: Target) -> Iterator[Search]:
    """Find the packing by straining the box to where the energy is u0, and minimising.

    Unjammed states are compressed by small strains and minimised, until one stays jammed. From
    there the root of u that is linear in the strain, sqrt(u) of harmonic contacts, is extrapolated to that of u0 minimum by
    minimum. A box opened
    too far is closed in finer steps.

    Parameters
    ----------
    landscape : Landscape
    search : Search
        Initial or resumed state of the search.
    target : Target

    Yields
    ------
    Search
        The same object between minimisations; the last one has a minimum.

    Raises
    ------
    TargetError
        If steps become too small.
    ValueError
        If u0 is out of reach: overlaps below the rounding of coordinates, or no longer small.
    """
    require_reachable(landscape, target)
    while search.minimum is None:
        extrapolate(landscape, search, target)
        yield search


def extrapolate(landscape: Landscape, search: Search, target: Target) -> None:
    """Advance a search by one minimisation; parameters and errors as `extrapolation`."""
    if search.leading is None:
        stop = Stop(tolerance=_GOOD, lowest=search.lowest(landscape, target))
        found = minimise(landscape, search.state, "auto", stop, search.history)
        if found.is_at_rest:
            search.leading = Leading(found, found)
            return
    else:
        led = search.leading.advance(landscape, target)
        if led is None:
            return
        found, jammed, search.leading = led, search.leading.start, None
        if found.outcome is not Outcome.UNJAMMED and target.is_met(found.energy_density):
            search.minimum, search.state = found, found.state
            return
        lost = found.outcome is not Outcome.UNJAMMED or found.state.volume > jammed.state.volume
        if lost and search.loose is not None:
            search.step, search.loose_in_a_row = search.step / 4, 0
    _go_on(landscape, search, target, found)


def _go_on(landscape: Landscape, search: Search, target: Target, found: Minimum) -> None:
    """Close or open the box for the next minimisation."""
    fine = target.strain_above_jamming(landscape)
    if found.outcome is Outcome.UNJAMMED:
        search.close_further(found.state, fine, target)
    else:
        search.leave(found.state)
    if search.step < _SMALLEST_STEP * fine:
        u = found.energy_density
        msg = (
            f"the search ended between an unjammed state and one with u = {u:.3g} and a"
            f" residual of {found.residual.largest:.2g}, expected a minimum with u = {target.u0:.3g};"
            " take another u0 or another start"
        )
        raise TargetError(msg)


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


@dataclass(eq=False)
class Leading:
    """A minimum on its way to u0, between two minimisations, with all that is needed to resume it.

    The box is strained to where the root of u that is linear in the strain reaches that of u0. Where that opens the
    packing, fractions of the strain are tried. One that slides is compressed, to higher energies, until it is at rest. A
    minimum that stalls at u0, where a contact is about to open or close, is approached again from a higher energy.

    Parameters
    ----------
    start
        Jammed state from which the way begins.
    jammed
        Present state: to be relaxed at first, and then a minimum.
    best
        Minimum with the smallest residual of earlier approaches.
    cycle
        Number of the approach.
    is_new
        Whether the present state is still to be relaxed.
    part, tries
        Fraction of the strain to u0 to take, and how many fractions were tried.
    tolerance, aim
        Residual and energy density to reach.
    unfinished, root, parts
        State of a packing that slides, if it does; the root of u expected, and how often it was minimised on this step.
    n_minima
        Minimisations of this approach.
    least, stalls
        Smallest residual of this approach at u0, and how many stalled since.
    """

    start: Minimum
    jammed: Minimum
    best: Minimum | None = None
    cycle: int = 0
    is_new: bool = True
    part: float = 1.0
    tries: int = 1
    tolerance: float = 0.0
    aim: float = 0.0
    unfinished: Minimum | None = None
    root: float = 0.0
    parts: int = 0
    n_minima: int = 0
    least: float | None = None
    stalls: int = 0

    def advance(self, landscape: Landscape, target: Target) -> Minimum | None:
        """Minimise once; return the minimum at u0, or an unjammed one if the energy vanishes on the way."""
        begun, method = self._begun(landscape, target)
        u = self.root**landscape.law.power
        found = _relaxed(landscape, begun, replace(target, tolerance=self.tolerance), u, method)
        self.parts += 1
        if found.outcome is Outcome.UNJAMMED or self._slides(landscape, found):
            return self._compressed_or_lost(landscape, found, u)
        self.unfinished, self.jammed = None, found
        if self.is_new:
            self.is_new, self.part, self.tries, self.n_minima = False, 1.0, 1, 0
            self.least, self.stalls = None, 0
            self.aim = target.u0
        else:
            self.n_minima += 1
            self.part = min(2 * self.part, 1.0)
        return self._end(landscape, target) if self._is_there(target) else None

    def _slides(self, landscape: Landscape, found: Minimum) -> bool:
        """Whether a jammed packing far from rest takes long or stalls, on no kink, and may be compressed."""
        if self.parts == _MOST_PARTS or found.residual.largest <= _GOOD:
            return False
        if found.outcome is not Outcome.STALLED:
            return found.outcome is Outcome.EXHAUSTED
        has_kinks = not landscape.particles.is_round.all()
        is_below = self.root < landscape.law.root(self.jammed.energy_density)
        return is_below and not has_kinks

    def _driven(self, landscape: Landscape, at: Minimum, target: Target) -> float:
        """Return the root of u to which a packing that slides is compressed next, by no more than a step below jamming."""
        now: float = landscape.law.root(at.energy_density)
        most: float = _DRIVEN * landscape.law.root(self.jammed.energy_density)
        root = max(now, min(_DRIVEN * self.root, most))
        strain = -_strain_to(landscape, at, root)
        return root if strain <= target.step else now + target.step / strain * (root - now)

    def _begun(self, landscape: Landscape, target: Target) -> tuple[Minimum, str]:
        """Return the state to minimise next, and the method."""
        if self.unfinished is not None:
            self.root = self._driven(landscape, self.unfinished, target)
            strain = _strain_to(landscape, self.unfinished, self.root)
            return replace(self.unfinished, state=self.unfinished.state.strained(strain)), "auto"
        self.parts = 0
        if self.is_new:
            self.tolerance = target.tolerance
            self.root = landscape.law.root(self.jammed.energy_density)
            return self.jammed, "near"
        self.root = _towards(landscape, self.jammed, self.aim, self.part)
        strain = _strain_to(landscape, self.jammed, self.root)
        return replace(self.jammed, state=followed(landscape, self.jammed, strain)), "near"

    def _compressed_or_lost(self, landscape: Landscape, found: Minimum, u: float) -> Minimum | None:
        """Continue with a packing that slides; return one that fell apart, once fractions of the strain were tried."""
        fallen = fraction_of_energy(landscape, _FALLEN) * u
        slides = found.energy_density > fallen and self.parts < _MOST_PARTS
        self.unfinished = found if slides else None
        if slides:
            return None
        if self.is_new or self.tries == _TRIES:
            return self.best or found
        self.tries, self.part = self.tries + 1, self.part / 4
        return None

    def _is_there(self, target: Target) -> bool:
        """Whether the approach has ended; if not, adapt the next step."""
        left, u = self.jammed.residual.largest, self.jammed.energy_density
        if self.least is None or left < self.least or not target.is_met(u):
            self.least, self.stalls = left, 0
        elif self.jammed.outcome is not Outcome.CONVERGED:
            self.stalls += 1
        if self.n_minima == _MOST_MINIMA or self.stalls == _MOST_STALLS:
            return True
        if self.jammed.outcome is Outcome.STALLED and left < _SLIDING:
            self.tolerance = max(self.tolerance, _GAIN * left)  # the next ones need not be better
        if left <= self.tolerance and target.is_met(u):
            return True
        if abs(u / target.u0 - 1) < _CLOSE:
            self.aim *= target.u0 / u  # compensates what minimisation removes, as rods slide
        return False

    def _end(self, landscape: Landscape, target: Target) -> Minimum | None:
        """Judge the end of an approach, and begin the next one if it stalled."""
        found = _judged(landscape, self.jammed, target)
        if self.best is None or found.residual.largest < self.best.residual.largest:
            self.best = found
        if found.outcome is not Outcome.STALLED:
            return found
        self.cycle += 1
        if self.cycle == _CYCLES:
            return self.best
        u = fraction_of_energy(landscape, _HIGHER) * target.u0
        strain = _strain_to(landscape, found, _towards(landscape, found, u))
        higher = found.state.strained(strain)
        self.jammed, self.is_new = replace(found, state=higher), True
        return None


def _relaxed(landscape: Landscape, at: Minimum, target: Target, u: float, method: str) -> Minimum:
    """Minimise, to full tolerance only if u, the expected energy density, is nearly u0.

    Before, a stalled state suffices: a search for a kink that fails takes longer than a step. There it is unjammed once
    it slides.
    """
    near = abs(landscape.law.root(u / target.u0) - 1) < _NEAR
    tolerance = target.tolerance if near else max(target.tolerance, _good_to_move(landscape))
    lowest = fraction_of_energy(landscape, _FALLEN if near else _SLID) * u
    most = max(_LONG, _LONG_FOR_EACH * landscape.particles.n)
    stop = Stop(tolerance, lowest=lowest, evaluations=most, kinks=near)
    return minimise(landscape, at.state, method, stop, at.history)


def _good_to_move(landscape: Landscape) -> float:
    """Return the largest residual of a minimum on the way to u0."""
    particles = landscape.particles
    return _GOOD if particles.dimension == 3 and particles.is_round.all() else _GOOD_TO_MOVE


def nearer(landscape: Landscape, at: Minimum, u0: float) -> State:
    """Move a jammed minimum to u0 by linear response, or a bounded factor towards it.

    The box is strained, and particles follow the linear response that balances forces.

    Parameters
    ----------
    landscape : Landscape
    at : Minimum
    u0 : float
        [energy / length^D]

    Returns
    -------
    State
        To be minimised.
    """
    return followed(landscape, at, _strain_to(landscape, at, _towards(landscape, at, u0)))


def followed(landscape: Landscape, at: Minimum, strain: float) -> State:
    """Strain the box of a minimum, and move particles by linear response, at fixed contacts.

    Parameters
    ----------
    landscape : Landscape
    at : Minimum
    strain : float
        See `State.strained`.

    Returns
    -------
    State
        To be minimised.
    """
    local_model = LocalEnergyModel(landscape, at.state)
    newton = local_model.newton(least_shift(landscape, at.evaluation))
    newton.prepare()
    [x] = newton.solve(-strain * newton.coupling[None], _PREDICTION)
    local_model.move(local_model.part_within(x) * x, strain)
    return local_model.base


def _towards(landscape: Landscape, at: Minimum, u0: float, part: float = 1.0) -> float:
    """Return the root of u after a fraction of the way to u0, limited to a bounded factor."""
    now, aim = landscape.law.root(at.energy_density), landscape.law.root(u0)
    aim = min(max(aim, now / _LARGEST_FACTOR), now * _LARGEST_FACTOR)
    return now + part * (aim - now)


def _strain_to(landscape: Landscape, at: Minimum, root: float) -> float:
    """Return the strain at which the root of u has this value.

    The energy of a minimum changes with strain as if the particles did not move, to first order.
    """
    energy, volume = at.evaluation.energy, at.state.volume
    power, now = landscape.law.power, landscape.law.root(energy / volume)
    slope = at.evaluation.strain_gradient - at.state.dimension * energy
    strain: float = (root - now) * power * now ** (power - 1) * volume / slope
    return strain


def _judged(landscape: Landscape, at: Minimum, target: Target) -> Minimum:
    """Decide whether the remaining forces of an imperfect minimum are all due to sliding.

    They are if, once all stiffer modes are relaxed, nothing remains beside forces along modes softer than a
    small shift.
    """
    if at.residual.largest <= target.tolerance:
        return at
    if at.residual.largest > _SLIDING:
        return replace(at, outcome=Outcome.STALLED)  # sufficient only for a step on the way
    local_model = LocalEnergyModel(landscape, at.state)
    evaluation = at.evaluation
    stiffness = landscape.stiffness_at(evaluation.bond_force)
    newton = local_model.newton(_SOFT * stiffness / landscape.length**2)
    for _ in range(_STIFF_STEPS):
        newton.prepare()
        [relax] = newton.solve(-evaluation.gradient[None], _ACCURACY)
        stiff = evaluation._replace(gradient=evaluation.gradient + newton.shift * relax)
        slides = residual_of(landscape, stiff).largest <= target.tolerance
        if slides or not target.is_met(evaluation.energy / local_model.base.volume):
            break
        local_model.move(relax, 0.0)
        evaluation = local_model.evaluate(0 * relax, 0.0, extended=True)
    if not slides:
        return replace(at, outcome=Outcome.STALLED)
    left = residual_of(landscape, evaluation)
    outcome = Outcome.CONVERGED if left.largest <= target.tolerance else Outcome.SLIDING
    return replace(
        at, state=local_model.base, evaluation=evaluation, outcome=outcome, residual=left
    )


def bisection(
    landscape: Landscape, search: Search, target: Target, shortest: float = 1e-16
) -> Iterator[Search]:
    """Find the packing by bisection of Marschall & Teitel 2018, Sec. III C, as written.

    L and r are scaled by 1 -+ lambda and minimised until U crosses U0; then lambda is halved and
    the direction reversed. `Search.step` is lambda, initially 1e-6 in the paper.

    Arguments and results as in `extrapolation`.

    Raises
    ------
    TargetError
        If lambda falls below `shortest` before u reaches u0.
    """
    while search.minimum is None:
        bisect(landscape, search, target, shortest)
        yield search


def bisect(landscape: Landscape, search: Search, target: Target, shortest: float = 1e-16) -> None:
    """Advance a search by one minimisation; parameters and errors as `bisection`."""
    stop = Stop(tolerance=target.tolerance)
    found = minimise(landscape, search.state, target.method, stop, search.history)
    u = found.energy_density
    if target.is_met(u):
        search.minimum, search.state = found, found.state
        return
    opens = u > target.u0
    if search.opening is not None and search.opening != opens:
        search.step /= 2
    if search.step < shortest:
        msg = (
            f"lambda fell below {shortest:g} at u = {u:.9g}, expected u = {target.u0:.9g};"
            " use extrapolation"
        )
        raise TargetError(msg)
    search.opening = opens
    search.state = found.state.strained(search.step if opens else -search.step)


def find(landscape: Landscape, start: State, target: Target) -> Minimum:
    """Run `extrapolation` to its end, with its errors."""
    search = Search(start, target.step)
    collections.deque(extrapolation(landscape, search, target), maxlen=0)
    assert search.minimum is not None
    return search.minimum
