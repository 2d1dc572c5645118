"""Athermal quasistatic compression: protocol 1 of Yuan et al., Soft Matter (2019), Sec. 2.2.

The packing fraction grows by small steps, each followed by a minimisation, until the energy per particle exceeds
a small tolerance. The jammed packing is then opened until it is as close to the tolerance as requested. If it falls
apart on the way, or its forces do not balance, the step from the last unjammed state is halved repeatedly
instead. Independent of the shape; needs no LAMMPS.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from jamshape.checks import require_positive
from jamshape.contacts import CrossingError
from jamshape.landscape import Landscape
from jamshape.minima import History, Minimum, Outcome, Stop, minimise
from jamshape.minima.target import fraction_of_energy, nearer
from jamshape.packing import State

# Smallest step: the energy jumps there, by a rearrangement.
_SMALLEST_STEP = 1e-9

# Most openings of a jammed packing, each by at most a factor of 4 in sqrt(U).
_MOST_OPENINGS = 30

_PART = 5000  # evaluations after which a long minimisation is reported and stored
_MOST_PARTS = 40  # of them before it is given up
_BRIEF = 2000  # evaluations of a first part after which the next step may be taken

# Before a search for an energy the box is compressed further after a brief part, once in a row, if U/N is below a multiple
# of the energy tolerance, about what a step adds to a jammed packing: the search opens it again, while the evaluations
# to the end of such a minimisation grow with N. A multiple of energies of harmonic contacts.
_LITTLE = 50.0

_FEW, _MANY = 40, 150  # evaluations of minimisations after which steps grow and shrink
_GROWTH = 1.5


@dataclass(frozen=True)
class Quasistatic:
    """Settings of a quasistatic compression.

    Parameters
    ----------
    step
        Change of the packing fraction, Delta phi.
    energy
        U/N above which a packing is jammed, [energy].
    closeness
        Bound of U/N in the jammed packing, over `energy`.
    tolerance
        Largest net force and torque of a particle over the mean bond force; the paper has the mean
        net force below 1e-4, which this implies.
    method
        Minimiser.
    coarse
        Largest step, used where minimisations take few evaluations, as far below jamming; by default
        all steps are equal.

    Raises
    ------
    ValueError
        If a number is out of its range.
    """

    step: float = 1e-3
    energy: float = 1e-10
    closeness: float = 2.0
    tolerance: float = 1e-4
    method: str = "auto"
    coarse: float | None = None

    def __post_init__(self) -> None:
        require_positive(step=self.step, energy=self.energy, tolerance=self.tolerance)
        if self.coarse is not None and not self.coarse >= self.step:
            msg = f"the coarse step is {self.coarse}, expected at least the step, {self.step}"
            raise ValueError(msg)
        if not self.closeness > 1:
            msg = f"closeness is {self.closeness}, expected a factor above 1"
            raise ValueError(msg)


@dataclass(eq=False)
class QuasistaticRun:
    """A compression between two minimisations, with all that is needed to resume it.

    Parameters
    ----------
    state
        State to minimise next.
    phi
        Its packing fraction.
    step
        Next increment of phi.
    loose, loose_phi
        Densest unjammed state, or not known to be jammed, if any.
    jammed_phi
        Packing fraction of the least dense jammed state, if any.
    openings
        Number of openings of the jammed packing that led to the state.
    halves
        Whether steps are halved instead: an opened packing fell apart, was not balanced, or did not
        come close.
    minimum
        Jammed packing, once found.
    parts
        Completed parts of the present long minimisation.
    left
        Whether the last minimisation, that of `loose`, was left unfinished.
    """

    state: State
    phi: float
    step: float
    loose: State | None = None
    loose_phi: float = math.nan
    jammed_phi: float = math.nan
    openings: int = 0
    halves: bool = False
    minimum: Minimum | None = None
    parts: int = 0
    left: bool = False
    history: History = field(default_factory=History)

    @classmethod
    def of(cls, landscape: Landscape, state: State, protocol: Quasistatic) -> QuasistaticRun:
        """Begin at a state."""
        return cls(state, _phi(landscape, state), protocol.coarse or protocol.step)

    def begin(self, step: float) -> None:
        """Compress the densest unjammed state by a step of the packing fraction."""
        assert self.loose is not None
        self.step, self.phi, self.openings = step, self.loose_phi + step, 0
        strain = (self.loose_phi / self.phi) ** (1 / self.loose.dimension) - 1
        self.state = self.loose.strained(strain)

    def halve(self) -> None:
        """Continue midway between the densest unjammed state and the least dense jammed one."""
        self.begin((self.jammed_phi - self.loose_phi) / 2)

    def open(self, state: State, phi: float) -> None:
        """Continue with an opened jammed state."""
        self.state, self.phi, self.openings = state, phi, self.openings + 1


def compress(
    landscape: Landscape, compression: QuasistaticRun, protocol: Quasistatic
) -> Iterator[QuasistaticRun]:
    """Compress to the first jammed packing.

    Parameters
    ----------
    landscape : Landscape
    compression : QuasistaticRun
        Initial or resumed state.
    protocol : Quasistatic

    Yields
    ------
    QuasistaticRun
        The same object after each minimisation, or part of a long one. The last one has a minimum.

    Raises
    ------
    ValueError
        If the start is jammed.
    """
    while compression.minimum is None:
        advance(landscape, compression, protocol)
        yield compression


def advance(landscape: Landscape, compression: QuasistaticRun, protocol: Quasistatic) -> None:
    """Minimise once, or for one part of a long minimisation; parameters and errors as `compress`."""
    before = landscape.evaluations
    try:
        found = _minimised(landscape, compression, protocol)
    except CrossingError:
        if compression.loose is None:
            raise
        if compression.openings == 0:  # the step was too long
            compression.jammed_phi = compression.phi
        compression.halves = True
        compression.halve()
        return
    compression.parts += 1
    per_particle = found.evaluation.energy / landscape.particles.n
    is_unfinished = found.outcome is Outcome.EXHAUSTED
    little = fraction_of_energy(landscape, _LITTLE)
    if is_unfinished and _may_be_left(compression, per_particle / little, protocol):
        compression.parts, compression.left = 0, True
        compression.loose, compression.loose_phi = found.state, compression.phi
        compression.begin(_next_step(compression.step, _PART, protocol))
        return
    if is_unfinished and compression.parts < _MOST_PARTS:
        compression.state = found.state
        return
    evaluations = landscape.evaluations - before + (compression.parts - 1) * _PART
    compression.parts, compression.left = 0, False
    if per_particle <= protocol.energy:
        _go_on_from_unjammed(compression, found, evaluations, protocol)
    elif compression.loose is None:
        msg = (
            f"the start at phi = {compression.phi:.4g} is jammed with U/N = {per_particle:.3g},"
            f" expected at most {protocol.energy:g}; start at a smaller phi"
        )
        raise ValueError(msg)
    elif compression.openings > 0 and not found.is_at_rest:
        compression.jammed_phi, compression.halves = compression.phi, True
        compression.halve()
    elif per_particle <= protocol.closeness * protocol.energy or _is_narrow(compression):
        compression.minimum, compression.state = found, found.state
    else:
        _go_on_from_jammed(landscape, compression, found, protocol)


def _is_rough(protocol: Quasistatic) -> bool:
    """Whether any state beyond jamming will do, from which a search for an energy follows."""
    return protocol.coarse is not None and math.isinf(protocol.closeness)


def _may_be_left(compression: QuasistaticRun, per_particle: float, protocol: Quasistatic) -> bool:
    """Whether a long minimisation close to jamming need not be finished before the next step."""
    if not _is_rough(protocol) or compression.left or compression.loose is None:
        return False
    return math.isnan(compression.jammed_phi) and per_particle <= protocol.energy


def _is_narrow(compression: QuasistaticRun) -> bool:
    """Whether the interval between the jammed and the unjammed state is exhausted."""
    left = compression.phi - compression.loose_phi
    return left < _SMALLEST_STEP and compression.halves


def _go_on_from_unjammed(
    compression: QuasistaticRun, found: Minimum, evaluations: int, protocol: Quasistatic
) -> None:
    compression.halves |= compression.openings > 0
    compression.loose, compression.loose_phi = found.state, compression.phi
    if compression.jammed_phi - compression.loose_phi > _SMALLEST_STEP:
        compression.halve()
        return
    if not math.isnan(compression.jammed_phi):  # it was not jammed, or jams at another phi now
        compression.jammed_phi, compression.halves = math.nan, False
        compression.step = protocol.step
    compression.begin(_next_step(compression.step, evaluations, protocol))


def _go_on_from_jammed(
    landscape: Landscape, compression: QuasistaticRun, found: Minimum, protocol: Quasistatic
) -> None:
    compression.jammed_phi = compression.phi
    compression.halves |= compression.openings >= _MOST_OPENINGS
    if compression.halves:
        compression.halve()
        return
    aim = math.sqrt(protocol.closeness) * protocol.energy * landscape.particles.n
    opened = nearer(landscape, found, aim / found.state.volume)
    compression.open(opened, _phi(landscape, opened))


def _next_step(step: float, evaluations: int, protocol: Quasistatic) -> float:
    """Adapt the step to the cost of the last minimisation."""
    if protocol.coarse is None:
        return step
    if evaluations < _FEW:
        return min(_GROWTH * step, protocol.coarse)
    return max(step / 2, protocol.step) if evaluations > _MANY else step


def _minimised(landscape: Landscape, compression: QuasistaticRun, protocol: Quasistatic) -> Minimum:
    """Minimise until forces balance, or until the state is unjammed."""
    state = compression.state
    lowest = protocol.energy * landscape.particles.n / state.volume
    may_be_left = _is_rough(protocol) and not compression.left and compression.parts == 0
    most = _BRIEF if may_be_left else _PART
    stop = Stop(tolerance=protocol.tolerance, lowest=lowest, evaluations=most)
    is_near = compression.openings > 0 and protocol.method == "auto"
    method = "near" if is_near else protocol.method
    found = minimise(landscape, state, method, stop, compression.history)
    if found.outcome is Outcome.STALLED and protocol.method != "newton":
        return minimise(landscape, found.state, "newton", stop, compression.history)
    return found


def _phi(landscape: Landscape, state: State) -> float:
    return float(landscape.particles.measures.sum()) / state.volume


def compressed_to(landscape: Landscape, start: State, phi: float, step: float = 2e-3) -> State:
    """Compress a state to a packing fraction by equal steps, each followed by a minimisation.

    Parameters
    ----------
    landscape : Landscape
    start : State
        State below phi.
    phi : float
    step : float
        Largest step of the packing fraction.

    Returns
    -------
    State
        A minimum, jammed or not.

    Raises
    ------
    CrossingError
        If spines cross in a step, which is then too long.
    """
    state, begun = start, _phi(landscape, start)
    n_steps = max(1, math.ceil((phi - begun) / step))
    for k in range(n_steps):
        aim = begun + (phi - begun) * (k + 1) / n_steps
        strain = (_phi(landscape, state) / aim) ** (1 / state.dimension) - 1
        state = minimise(landscape, state.strained(strain), "auto", Stop(1e-4)).state
    return state
