"""Minimisers of the energy of a packing: one interface, four methods and an automatic one.

All work on the coordinates of a `Landscape` (positions and, as lengths, rotations), start from a `State`
and return a `Minimum` that says how it ended and how the residual fell with run time.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np
import scipy.optimize

from jamshape.arrays import FloatArray
from jamshape.landscape import CrossingError, Evaluation, Landscape, State
from jamshape.landscape.newton import Regularised

# A Newton step moves no particle by more than this fraction of the smallest radius, and turns none
# by more than this angle.
LONGEST_STEP = 0.1
WIDEST_TURN = 0.2

# `auto` changes from L-BFGS to Newton below this residual, or where L-BFGS no longer gains.
_NEWTON_BELOW = 1e-2

# A method no longer gains if residual times energy did not fall by this factor in so many evaluations;
# what L-BFGS needs to unjam a packing grows with it.
_GAIN = 0.7
_PATIENCE = {"lbfgs": 1000, "newton": 2000}
_PATIENCE_PER_PARTICLE = 4

# L-BFGS begins anew when it gives up; not more often than this within so few evaluations.
_STUCK, _SOON = 3, 30

# In units of k_e and `Landscape.length`.
_LOWEST = 1e-24

# Newton and L-BFGS take turns so many times before `auto` calls it a stall.
_ROUNDS = 3


class Outcome(Enum):
    """How a minimisation ended.

    SLIDING: what is left of the forces lies along modes softer than the prestress, rods that slide
    along flat sides, and does not fall any more; all the rest is below the tolerance.
    STALLED: no progress, such as a cycle about a kink of the energy.
    """

    CONVERGED = "converged"
    UNJAMMED = "unjammed"
    SLIDING = "sliding"
    STALLED = "stalled"
    EXHAUSTED = "exhausted"


class Residual(NamedTuple):
    """Largest net force and torque of a particle, over the mean force of a bond.

    Torques are divided by the length that counts for a radian, the half length A of a spherocylinder.
    """

    force: float
    torque: float

    @property
    def largest(self) -> float:
        """The larger of the two."""
        return max(self.force, self.torque)


@dataclass(frozen=True)
class Stop:
    """When a minimisation ends.

    Parameters
    ----------
    tolerance
        Converged when the residual is below.
    lowest
        Unjammed when the energy density is below, [energy / length^D]; when left out 1e-24 in units of
        k_e and `Landscape.length`.
    evaluations
        Exhausted after so many evaluations of all forces.
    seconds
        Exhausted after so much time.
    """

    tolerance: float = 1e-8
    lowest: float | None = None
    evaluations: int = 200_000
    seconds: float = np.inf


@dataclass
class History:
    """Convergence: one row for each evaluation that was accepted or tried."""

    began: float = field(default_factory=time.perf_counter)
    wall_seconds: list[float] = field(default_factory=list)
    evaluations: list[int] = field(default_factory=list)
    residual: list[float] = field(default_factory=list)
    energy_density: list[float] = field(default_factory=list)

    def add(self, evaluations: int, residual: float, energy_density: float) -> None:
        """Append a row, now."""
        self.wall_seconds.append(time.perf_counter() - self.began)
        self.evaluations.append(evaluations)
        self.residual.append(residual)
        self.energy_density.append(energy_density)


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where a minimisation ended."""

    state: State
    evaluation: Evaluation
    outcome: Outcome
    residual: Residual
    history: History

    @property
    def energy_density(self) -> float:
        """U / L^D."""
        return self.evaluation.energy / self.state.volume


def residual_of(landscape: Landscape, evaluation: Evaluation) -> Residual:
    """Measure how far from mechanical equilibrium a state is (Marschall & Teitel 2018, App. A)."""
    if evaluation.bond_force == 0.0:
        return Residual(0.0, 0.0)
    components = landscape.components(evaluation.gradient) / evaluation.bond_force
    D = landscape.particles.dimension
    force, torque = (np.sqrt((part**2).sum(axis=1)).max() for part in np.split(components, [D], 1))
    return Residual(float(force), float(torque))


def rounding_floor(evaluation: Evaluation, landscape: Landscape, *, extended: bool = True) -> float:
    """Residual that rounding of the coordinates alone leaves: about eps / overlap."""
    eps = float(np.finfo(np.longdouble if extended else np.float64).eps)
    size = float(landscape.inner_radius.max())
    return 8 * eps * landscape.k_e / (size * max(evaluation.bond_force, 1e-300))


class Descent:
    """What the methods share: counts, history, the best state so far, and when to stop."""

    def __init__(
        self, landscape: Landscape, start: State, stop: Stop, history: History | None = None
    ) -> None:
        self.landscape, self.stop = landscape, stop
        unit = landscape.k_e / landscape.length**start.dimension
        self._lowest = _LOWEST * unit if stop.lowest is None else stop.lowest
        self.history = history or History()
        self.state = start
        self._first_evaluation, self._began = landscape.evaluations, time.perf_counter()
        self._patience = 0
        self._last_gain = 0
        self._gained = np.inf
        self.evaluation = landscape.evaluate(start)
        self.record(self.evaluation)

    @property
    def evaluations(self) -> int:
        """Evaluations of all forces so far."""
        return self.landscape.evaluations - self._first_evaluation

    @property
    def residual(self) -> float:
        """Residual of the present state."""
        return residual_of(self.landscape, self.evaluation).largest

    @property
    def extended(self) -> bool:
        """Whether doubles are too short for the tolerance."""
        floor = rounding_floor(self.evaluation, self.landscape, extended=False)
        return floor > 0.1 * self.stop.tolerance

    def be_patient(self, evaluations: int) -> None:
        """From now on call it a stall if so many evaluations in a row gain nothing."""
        self._patience, self._last_gain, self._gained = evaluations, self.evaluations, np.inf

    def move_to(self, state: State, evaluation: Evaluation) -> None:
        """Accept a state."""
        self.state, self.evaluation = state, evaluation
        self.record(evaluation)

    def record(self, evaluation: Evaluation) -> None:
        """Add a row to the history."""
        residual = residual_of(self.landscape, evaluation).largest
        density = evaluation.energy / self.state.volume
        self.history.add(self.landscape.evaluations, residual, density)
        # Either of the two may fall for long while the other does not.
        gain = residual * density
        if gain < _GAIN * self._gained:
            self._gained, self._last_gain = gain, self.evaluations

    def outcome(self) -> Outcome | None:
        """Say whether it ends here, and how."""
        if self.evaluation.energy <= self._lowest * self.state.volume:
            return Outcome.UNJAMMED
        if self.residual <= self.stop.tolerance:
            return Outcome.CONVERGED
        used_up = self.evaluations >= self.stop.evaluations
        if used_up or time.perf_counter() - self._began >= self.stop.seconds:
            return Outcome.EXHAUSTED
        if self._patience and self.evaluations - self._last_gain > self._patience:
            return Outcome.STALLED
        return None

    def minimum(self, outcome: Outcome) -> Minimum:
        """Return the present state."""
        residual = residual_of(self.landscape, self.evaluation)
        return Minimum(self.state, self.evaluation, outcome, residual, self.history)


def minimise(
    landscape: Landscape,
    start: State,
    method: str = "auto",
    stop: Stop | None = None,
    history: History | None = None,
) -> Minimum:
    """Minimise the energy at fixed box.

    Parameters
    ----------
    landscape : Landscape
    start : State
    method : str
        One of `METHODS`: ``auto``, ``newton``, ``lbfgs``, ``paper``, ``lammps``.
    stop : Stop, optional
    history : History, optional
        One to append to.

    Returns
    -------
    Minimum
        Look at its outcome.

    Raises
    ------
    ValueError
        If there is no such method.
    CrossingError
        If spines cross at the start.
    """
    if method not in METHODS:
        msg = f"the method is {method!r}, expected one of {', '.join(METHODS)}"
        raise ValueError(msg)
    descent = Descent(landscape, start, stop or Stop(), history)
    return descent.minimum(METHODS[method](descent))


def _auto(descent: Descent) -> Outcome:
    outcome = Outcome.STALLED
    for _ in range(_ROUNDS):
        best = descent.residual
        if best > _NEWTON_BELOW:
            outcome = _lbfgs(descent, _NEWTON_BELOW)
            if outcome in {Outcome.UNJAMMED, Outcome.EXHAUSTED}:
                return outcome
        outcome = _newton(descent)
        if outcome is not Outcome.STALLED:
            return outcome
    return outcome


def _newton(descent: Descent) -> Outcome:
    descent.be_patient(_PATIENCE["newton"])
    regularised = Regularised.of(descent.landscape)
    while not (outcome := descent.outcome()):
        curvature = descent.landscape.curvature(descent.state)
        step = -regularised.factorise(curvature.hessian).solve(descent.evaluation.gradient)
        found = search_along(descent, limited(descent.landscape, step))
        regularised.learn(found.tries)
        descent.move_to(found.state, found.evaluation)
    return outcome


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


# A slope that rises by more than the inverse of this does so at a corner, wherever that is.
_CORNER = 0.1


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


class _LeaveError(Exception):
    """Ends SciPy's minimiser from within."""


def _lbfgs(descent: Descent, below: float = 0.0) -> Outcome:
    """SciPy's L-BFGS, in doubles, on displacements from the present state."""
    particles = descent.landscape.particles
    descent.be_patient(max(_PATIENCE["lbfgs"], _PATIENCE_PER_PARTICLE * particles.n))
    # Its first step is of unit length in its own coordinates.
    unit = 0.01 * float(descent.landscape.inner_radius.min()) * math.sqrt(particles.n)
    stuck = 0
    while not (outcome := descent.outcome()) and descent.residual > below and stuck < _STUCK:
        evaluations = descent.evaluations
        with contextlib.suppress(_LeaveError):
            scipy.optimize.minimize(
                _Objective(descent, unit, below),
                np.zeros(descent.landscape.size),
                jac=True,
                method="L-BFGS-B",
                options={"maxiter": 10**8, "maxfun": 10**8, "maxcor": 20, "ftol": 0.0, "gtol": 0.0},
            )
        # It gives up where its line search does, at kinks or in rounding: begin again from there.
        stuck = stuck + 1 if descent.evaluations - evaluations < _SOON else 0
        unit *= 0.1 if stuck else 1.0
    return outcome or Outcome.STALLED


class _Objective:
    """The energy as SciPy sees it: of displacements in units, over the energy at the start."""

    def __init__(self, descent: Descent, unit: float, below: float) -> None:
        self.descent, self.unit, self.below = descent, unit, below
        self.base, self.scale = descent.state, descent.evaluation.energy

    def __call__(self, x: FloatArray) -> tuple[float, FloatArray]:
        descent = self.descent
        state = descent.landscape.displaced(self.base, self.unit * x)
        try:
            found = descent.landscape.evaluate(state, extended=False)
        except CrossingError:
            raise _LeaveError from None
        if found.energy <= descent.evaluation.energy:
            descent.move_to(state, found)
            if descent.outcome() or descent.residual <= self.below:
                raise _LeaveError
        elif descent.evaluations >= descent.stop.evaluations:
            raise _LeaveError
        return found.energy / self.scale, self.unit / self.scale * found.gradient


def _paper(descent: Descent) -> Outcome:
    """Polak-Ribiere with the line search of Marschall & Teitel 2018, Appendix A, as printed."""
    restarted, epsilon = False, 1e-4
    direction = -descent.evaluation.gradient
    while not (outcome := descent.outcome()):
        gradient = descent.evaluation.gradient
        if restarted:
            direction = -gradient
        moved = _line_search_of_paper(descent, direction / np.linalg.norm(direction), epsilon)
        if moved < 1e-16:
            if restarted:
                return Outcome.STALLED
            restarted, epsilon = True, 1e-4
            continue
        epsilon, restarted = moved, False
        new = descent.evaluation.gradient
        beta = float(new @ (new - gradient) / (gradient @ gradient))
        direction = -new + beta * direction
    return outcome


def _line_search_of_paper(descent: Descent, direction: FloatArray, epsilon: float) -> float:
    """Bracket a minimum by three energies, fit a parabola, go there; return the last epsilon."""
    landscape, start = descent.landscape, descent.state

    def at(distance: float) -> tuple[State, Evaluation]:
        state = landscape.displaced(start, distance * direction)
        return state, landscape.evaluate(state, extended=False)

    here = landscape.evaluate(start, extended=False).energy
    while epsilon >= 1e-16:
        near, far = at(epsilon), at(2 * epsilon)
        once, twice = near[1].energy, far[1].energy
        if here <= once:
            epsilon /= 2
        elif once > twice:
            epsilon *= 2
        else:
            bend = here - 2 * once + twice
            vertex = at(epsilon * (1 + 0.5 * (here - twice) / bend)) if bend > 0 else near
            descent.move_to(*(vertex if vertex[1].energy < once else near))
            return epsilon
        if descent.evaluations >= descent.stop.evaluations:
            break
    return min(epsilon, 1e-17)


def _lammps(descent: Descent) -> Outcome:
    """LAMMPS's conjugate gradients; LAMMPS is started only here."""
    from jamshape.minima.lammps_cg import descend  # noqa: PLC0415

    return descend(descent) or Outcome.STALLED


METHODS: dict[str, Callable[[Descent], Outcome]] = {
    "auto": _auto,
    "newton": _newton,
    "lbfgs": _lbfgs,
    "paper": _paper,
    "lammps": _lammps,
}
