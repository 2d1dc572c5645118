"""Common parts of all minimisers: outcome, stopping criteria, history and current state."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jamshape.landscape import Evaluation, Landscape
from jamshape.landscape.local_energy_model import DescentEnd
from jamshape.packing import State

# A method stalls if residual times energy did not fall by this factor in a number of evaluations.
_GAIN = 0.7

# In units of k_e and `Landscape.length`.
_LOWEST = 1e-24

_ROWS = ("wall_seconds", "evaluations", "residual", "energy_density")


class Outcome(Enum):
    """Outcome of a minimisation.

    SLIDING: the remaining forces lie along modes softer than the prestress, rods sliding along flat sides,
    and do not fall any more; all others are below the tolerance.
    KINK: at rest on a kink of the energy; a convex combination of the forces around is below the tolerance.
    STALLED: no progress.
    """

    CONVERGED = "converged"
    UNJAMMED = "unjammed"
    SLIDING = "sliding"
    KINK = "kink"
    STALLED = "stalled"
    EXHAUSTED = "exhausted"


class Residual(NamedTuple):
    """Largest net force and torque of a particle, over the mean force of a bond.

    Torques are divided by the length that scales radians, the half length A of a spherocylinder.
    """

    force: float
    torque: float

    @property
    def largest(self) -> float:
        """The larger of the two."""
        return max(self.force, self.torque)


@dataclass(frozen=True)
class Stop:
    """Stopping criteria of a minimisation.

    Parameters
    ----------
    tolerance
        Converged when the residual is smaller.
    lowest
        Unjammed when the energy density is smaller, [energy / length^D]; by default 1e-24 in units of
        k_e and `Landscape.length`, for harmonic contacts; for others that of the same overlap.
    evaluations
        Exhausted after this number of evaluations of all forces.
    seconds
        Exhausted after this time.
    kinks
        Whether to look for a kink of the energy where the minimisation has stalled.
    """

    tolerance: float = 1e-8
    lowest: float | None = None
    evaluations: int = 200_000
    seconds: float = np.inf
    kinks: bool = True


@dataclass
class History:
    """Convergence history: one row for each accepted or trial evaluation."""

    began: float = field(default_factory=time.perf_counter)
    wall_seconds: list[float] = field(default_factory=list)
    evaluations: list[int] = field(default_factory=list)
    residual: list[float] = field(default_factory=list)
    energy_density: list[float] = field(default_factory=list)

    def told(self) -> dict[str, NDArray[Any]]:
        """Return its rows as arrays, for a checkpoint."""
        return {name: np.array(getattr(self, name)) for name in _ROWS}

    @classmethod
    def of(cls, told: Mapping[str, NDArray[Any]]) -> History:
        """Continue from rows of `told`, and from their time."""
        rows = {name: told[name].tolist() for name in _ROWS}
        passed = rows["wall_seconds"][-1] if rows["wall_seconds"] else 0.0
        return cls(time.perf_counter() - passed, **rows)

    def add(self, evaluations: int, residual: float, energy_density: float) -> None:
        """Append a row with the present time."""
        self.put(time.perf_counter() - self.began, evaluations, residual, energy_density)

    def put(self, seconds: float, evaluations: int, residual: float, energy_density: float) -> None:
        """Append a row."""
        self.wall_seconds.append(seconds)
        self.evaluations.append(evaluations)
        self.residual.append(residual)
        self.energy_density.append(energy_density)


@dataclass(frozen=True, eq=False)
class Minimum:
    """Result of a minimisation."""

    state: State
    evaluation: Evaluation
    """Evaluation there; on a kink its gradient is the balanced combination of those around."""
    outcome: Outcome
    residual: Residual
    history: History

    @property
    def energy_density(self) -> float:
        """U / L^D."""
        return self.evaluation.energy / self.state.volume

    @property
    def is_at_rest(self) -> bool:
        """Whether forces balance, possibly on a kink of the energy."""
        return self.outcome in (Outcome.CONVERGED, Outcome.KINK)


def residual_of(landscape: Landscape, evaluation: Evaluation) -> Residual:
    """Measure the distance of a state from mechanical equilibrium (Marschall & Teitel 2018, App. A)."""
    if evaluation.bond_force == 0.0:
        return Residual(0.0, 0.0)
    components = landscape.components(evaluation.gradient) / evaluation.bond_force
    D = landscape.particles.dimension
    force, torque = (np.sqrt((part**2).sum(axis=1)).max() for part in np.split(components, [D], 1))
    return Residual(float(force), float(torque))


def rounding_floor(evaluation: Evaluation, landscape: Landscape, *, extended: bool = True) -> float:
    """Residual due to rounding of the coordinates alone: about eps / overlap."""
    softer = landscape.stiffness_at(evaluation.bond_force) / landscape.stiffness
    rounding = softer * rounding_of_a_bond(landscape, extended=extended)
    return rounding / max(evaluation.bond_force, 1e-300)


def rounding_of_a_bond(landscape: Landscape, *, extended: bool = True) -> float:
    """Force error due to rounding of the coordinates, [energy / length]; an upper bound unless contacts are harmonic."""
    eps = float(np.finfo(np.longdouble if extended else np.float64).eps)
    return 8 * eps * landscape.stiffness / float(landscape.inner_radius.max())


class Descent:
    """State of a minimisation, whatever the method: counts, history, current state, stopping criteria."""

    def __init__(
        self, landscape: Landscape, start: State, stop: Stop, history: History | None = None
    ) -> None:
        self.landscape, self.stop = landscape, stop
        unit = landscape.stiffness / landscape.length**start.dimension
        lowest = _LOWEST * unit * landscape.law.over_harmonic(_LOWEST)
        self.lowest = lowest if stop.lowest is None else stop.lowest
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
    def seconds(self) -> float:
        """Seconds so far."""
        return time.perf_counter() - self._began

    @property
    def residual(self) -> float:
        """Residual of the present state."""
        return residual_of(self.landscape, self.evaluation).largest

    def be_patient(self, evaluations: int) -> None:
        """Stall only after this number of evaluations in a row without gain."""
        self._patience, self._last_gain, self._gained = evaluations, self.evaluations, np.inf

    def move_to(self, state: State, evaluation: Evaluation) -> None:
        """Accept a state."""
        self.state, self.evaluation = state, evaluation
        self.record(evaluation)

    def take(self, state: State, end: DescentEnd) -> None:
        """Accept the end of a compiled minimisation, with its history."""
        self.state, self.evaluation = state, end.evaluation
        if len(end.rows) < 2:  # the first row is present already
            return
        begin = time.perf_counter() - self.history.began - end.rows[-1][0]
        before = self.landscape.evaluations - end.rows[-1][1]
        for seconds, evaluations, residual, density in end.rows[1:-1]:
            self.history.put(begin + seconds, before + evaluations, residual, density)
        self.record(self.evaluation)

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
        """Return the outcome if the minimisation ends here."""
        if self.evaluation.energy <= self.lowest * self.state.volume:
            return Outcome.UNJAMMED
        if self.residual <= self.stop.tolerance:
            return Outcome.CONVERGED
        used_up = self.evaluations >= self.stop.evaluations
        if used_up or self.seconds >= self.stop.seconds:
            return Outcome.EXHAUSTED
        if self._patience and self.evaluations - self._last_gain > self._patience:
            return Outcome.STALLED
        return None

    def minimum(self, outcome: Outcome) -> Minimum:
        """Return the present state."""
        residual = residual_of(self.landscape, self.evaluation)
        return Minimum(self.state, self.evaluation, outcome, residual, self.history)
