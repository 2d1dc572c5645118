"""One packing taken through values of a control parameter, such as the energy: each state begins from the one before.

Steps in sqrt(u) are small enough for the particles to follow (`target.extrapolation`). Independent of shape and
dimension; needs no LAMMPS.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from jamshape.contacts import Contacts
from jamshape.files.checkpoint import Checkpoint
from jamshape.landscape import Landscape, State
from jamshape.minima import Minimum, Outcome, Stop, minimise, residual_of
from jamshape.minima.boxes import ISOTROPIC, Yielding
from jamshape.minima.target import Search, Target, TargetError, extrapolation, fraction_of_energy
from jamshape.packing import Packing
from jamshape.protocols.recipe import Aim
from jamshape.recording.driver import Plan, Row, Told

_FALLEN = 1e-2  # fraction of u0 below which the box was opened too far
_EVALUATIONS = 2000  # limit of a minimisation after opening

PARAMETERS = ("u0", "pressure")
"""Control parameters of a ladder."""


def bring(landscape: Landscape, state: State, goal: Aim) -> Minimum:
    """Bring a packing to another energy density or pressure, at equal particles.

    Parameters
    ----------
    landscape : Landscape
    state : State
        A minimum, or a state near one.
    goal : Target or Yielding

    Returns
    -------
    Minimum
        At rest, or as near to it as the search comes.

    Raises
    ------
    TargetError
        If no such minimum was found.
    ValueError
        If the goal is out of reach.
    """
    if isinstance(goal, Yielding):
        return goal.find(landscape, state)
    search = Search(_opened(landscape, state, goal), goal.step)
    for _ in extrapolation(landscape, search, goal):
        pass
    assert search.minimum is not None
    return search.minimum


def _opened(landscape: Landscape, state: State, goal: Target) -> State:
    """Open the box until u is about u0; sliding rods would make small steps slow.

    As in `measures.packing_summary.energy_onset`, a root of u is linear in phi.
    """
    evaluation, volume, D = landscape.evaluate(state), state.volume, state.dimension
    u, p = evaluation.energy / volume, -evaluation.strain_gradient / (D * volume)
    if u <= goal.u0:
        return state
    strain = landscape.law.power * u / (p + u) * (1 - landscape.law.root(goal.u0 / u)) / D
    lowest = fraction_of_energy(landscape, _FALLEN) * goal.u0
    stop = Stop(goal.tolerance, lowest=lowest, evaluations=_EVALUATIONS)
    found = minimise(landscape, state.strained(strain), "newton", stop)
    return state if found.outcome is Outcome.UNJAMMED else found.state


@dataclass(frozen=True)
class Ladder:
    """Settings of a ladder.

    Parameters
    ----------
    parameter
        One of `PARAMETERS`.
    values
        Its values, in the order in which to reach them.
    accuracy
        Largest relative difference to them.
    tolerance
        Largest net force and torque of a particle over the mean bond force.
    box
        How the box yields, see `Yielding`.
    """

    parameter: str
    values: tuple[float, ...]
    accuracy: float
    tolerance: float
    box: str = ISOTROPIC

    @classmethod
    def of(cls, stored: Mapping[str, Any]) -> Ladder:
        """Read settings from the attributes of a file."""
        values = tuple(np.ravel(stored["ladder_values"]).tolist())
        numbers = stored["accuracy"], stored["tolerance"], stored.get("box_yields", ISOTROPIC)
        return cls(stored["ladder_parameter"], values, *numbers)

    @property
    def settings(self) -> dict[str, Any]:
        """Settings as attributes."""
        own = {"ladder_parameter": self.parameter, "ladder_values": np.array(self.values)}
        box = {} if self.box == ISOTROPIC else {"box_yields": self.box}
        return own | {"accuracy": self.accuracy, "tolerance": self.tolerance} | box

    def to(self, value: float) -> Aim:
        """Return the goal at a value."""
        if self.parameter == "u0" and self.box == ISOTROPIC:
            return Target(value, self.accuracy, self.tolerance)
        numbers = {self.parameter: value, "accuracy": self.accuracy, "tolerance": self.tolerance}
        return Yielding(self.box, **numbers)

    def require_reachable(self, landscape: Landscape) -> None:
        """Refuse values out of reach, before any is tried.

        Raises
        ------
        ValueError
        """
        for value in self.values:
            self.to(value).require(landscape)


def plan(start: Callable[[], Packing], how: Ladder, made_from: Mapping[str, Any]) -> Plan:
    """Plan a ladder; the start has two bonds side to side."""

    def begin() -> LadderDriver:
        packing = start()
        none = np.zeros_like(packing.image)  # images are of no use where nothing is followed
        return LadderDriver(packing.with_(step=0, time=0.0, image=none), how)

    def restore(first: Packing, checkpoint: Checkpoint) -> LadderDriver:
        return LadderDriver(first, how, checkpoint)

    arguments = {"ladder_values": how.parameter, "ladder_parameter": how.parameter}
    return Plan("ladder", "a ladder", how.settings | dict(made_from), begin, restore, arguments)


class LadderDriver:
    """A packing on its way through the values of a ladder: row and frame 0 are the start, others have one value each.

    Every step is a mark, since it depends on the state alone. If a value is not reached, its row and its frame are
    those of the state before, with `reached` 0, and the next one begins from there.

    Parameters
    ----------
    first : Packing
    how : Ladder
    checkpoint : Checkpoint, optional
    """

    at_mark = True

    def __init__(self, first: Packing, how: Ladder, checkpoint: Checkpoint | None = None) -> None:
        told: dict[str, Any] = dict(
            checkpoint or {"state": State.of(first), "n_done": 0, "evaluations": 0}
        )
        self._first, self._how, self._landscape = first, how, Landscape(first)
        self._state: State = told["state"]
        self._n_done: int = told["n_done"]
        self._evaluations = told["evaluations"]

    @property
    def done(self) -> bool:
        """Whether all values were tried."""
        return self._n_done >= len(self._how.values)

    def first(self) -> Row:
        """Return the numbers of the start, which has no goal."""
        return self._row(math.nan, "start", 0.0, reached=True)

    def advance(self) -> Row:
        """Bring the packing to the next value."""
        began, before = time.perf_counter(), self._landscape.evaluations
        value = self._how.values[self._n_done]
        # The continuation depends on the state alone, also after reading it from a file.
        self._landscape.forget_pairs()
        try:
            found = bring(self._landscape, self._state, self._how.to(value))
        except TargetError:
            found = None
        if found is not None:
            self._state = found.state
        self._n_done += 1
        self._evaluations += self._landscape.evaluations - before
        text = f"{self._how.parameter} {value:g}" + ", not reached" * (found is None)
        seconds = time.perf_counter() - began
        return self._row(value, text, seconds, reached=found is not None)

    def frame(self) -> Packing:
        """Return the present state; its time counts values."""
        packing = self._state.packing(self._first)
        return packing.with_(step=self._n_done, time=float(self._n_done))

    def checkpoint(self) -> Checkpoint:
        """Return the state and all counts."""
        counts = {"n_done": self._n_done, "evaluations": self._evaluations}
        return {"state": self._state} | counts

    def results(self) -> dict[str, Any]:
        """Return the law, and counts so far."""
        counts = {"ladder_done": self._n_done, "evaluations": self._evaluations}
        return self._first.law.stated() | counts

    def close(self) -> None:
        """Nothing is held outside of Python."""

    def _row(self, value: float, text: str, seconds: float, *, reached: bool) -> Row:
        landscape, state = self._landscape, self._state
        evaluation, packing = landscape.evaluate(state), state.packing(self._first)
        counts = Contacts.of(packing, landscape.k_e, landscape.sides).counts
        residual = residual_of(landscape, evaluation).largest
        pressure = -evaluation.strain_gradient / (state.dimension * state.volume)
        observables = {
            "goal": value, "phi": packing.phi, "u": evaluation.energy / state.volume, "pressure": pressure,
            "z": counts.z, "z_single": counts.z_single, "rattlers": counts.n_rattlers,
            "contacts": counts.n_contacts, "bonds": counts.n_bonds, "residual": residual, "reached": reached,
        }  # fmt: skip
        part = self._n_done / len(self._how.values)
        told = Told("ladder", f"{text}, phi {packing.phi:.8g}, z {counts.z:.4f}", part)
        step = self._n_done
        return Row(told, step, float(step), observables, seconds, residual, has_frame=True)
