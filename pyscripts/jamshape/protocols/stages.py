"""Stages of making a packing: each advances by a bounded piece of work, at whose end it can be interrupted.

The continuation of a stage depends on the numbers of its checkpoint alone, to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from jamshape.files.checkpoint import Checkpoint
from jamshape.landscape import Landscape
from jamshape.minima import History, Minimum, Outcome, Stop, boxes, minimise
from jamshape.minima.checkpoints import minimum_of, search_of, told_minimum, told_search
from jamshape.minima.target import (
    FixedBox,
    Search,
    Target,
    TargetError,
    bisect,
    extrapolate,
)
from jamshape.packing import State
from jamshape.protocols import quasistatic, strict, thermal
from jamshape.protocols.quasistatic import QuasistaticRun
from jamshape.protocols.recipe import Aim, Given, Recipe, Steps
from jamshape.protocols.strict import StrictSearch
from jamshape.protocols.thermal import Thermal, without_overlaps
from jamshape.recording.driver import Told
from jamshape.shapes.shape import Interaction
from jamshape.vibration.stability import stability_of

MOST_MINIMISATIONS = 20_000
"""Limit of a search: with the steps of 1e-6 of bisection they change phi by 0.04."""

EVALUATIONS = 5000
"""Evaluations of a minimisation between two marks."""

_MOST_TRIES = 20  # packings at the target before one is taken that is not stable to shear
_OFF_SADDLE = 0.3  # step off a saddle, over the mean overlap

_ADVANCES = {"extrapolation": extrapolate, "bisection": bisect}


@dataclass(eq=False)
class Making:
    """A packing in the making, as one stage hands it to the next.

    Parameters
    ----------
    recipe
    landscape
        Landscape of the particles; it counts evaluations.
    state
        State to continue from.
    minimum
        The packing so far, once there is one.
    attributes
        Results for the file of the packing.
    frame
        Frame of the compression in LAMMPS, if any, whose particles these are.
    """

    recipe: Recipe
    landscape: Landscape
    state: State
    minimum: Minimum | None = None
    frame: int = -1
    attributes: dict[str, Any] = field(default_factory=dict)

    @property
    def target(self) -> Target:
        """Target energy."""
        assert isinstance(self.recipe.goal, Target)
        return self.recipe.goal

    @property
    def goal(self) -> FixedBox | Aim:
        """Target, or fixed box."""
        goal = self.recipe.goal
        assert goal is not None
        return goal

    def told(self, phase: str, text: str, state: State, part: float | None = None) -> Told:
        """Return progress at a state."""
        phi = float(self.landscape.particles.measures.sum()) / state.volume
        return Told(phase, f"phi {phi:.6f}, {text}", part)


class Stage(Protocol):
    """A part of making a packing."""

    @property
    def done(self) -> bool:
        """Whether it has ended."""

    def advance(self) -> Told:
        """Do a bounded piece of work."""

    def checkpoint(self) -> Checkpoint:
        """Return all that is needed to resume."""

    def end(self) -> None:
        """Hand the results on."""


Begin = Callable[[Making, Checkpoint | None], Stage | None]
"""Makes a stage at its beginning, or from a checkpoint; None if it is not needed."""


class Compressing:
    """Quasistatic compression to jamming, or to a packing fraction where Monte Carlo begins."""

    def __init__(
        self, making: Making, checkpoint: Checkpoint | None, phi: float = math.inf
    ) -> None:
        way = making.recipe.way
        assert isinstance(way, Steps)
        self._making, self._phi = making, phi
        self._protocol = way.compression(making.recipe.target)
        if checkpoint is None:
            if making.recipe.target:
                making.recipe.target.require(making.landscape)
            self._run = QuasistaticRun.of(making.landscape, making.state, self._protocol)
        else:
            history = History.of(checkpoint.pop("history"))
            self._run = QuasistaticRun(**checkpoint, history=history)

    @property
    def done(self) -> bool:
        """Whether the packing is jammed, or as dense as asked for."""
        return self._run.minimum is not None or self._run.phi >= self._phi

    def advance(self) -> Told:
        """Minimise once, or for a part of a long minimisation."""
        run, making = self._run, self._making
        quasistatic.advance(making.landscape, run, self._protocol)
        energy = run.history.energy_density[-1] * run.state.volume / making.recipe.n
        text = f"U/N {energy:.1e} of {self._protocol.energy:.0e}, next step {run.step:.1e}"
        aim = f"to phi = {self._phi:g}" if math.isfinite(self._phi) else "to jamming"
        return making.told(f"compression {aim}", text, run.state)

    def checkpoint(self) -> Checkpoint:
        """Return the run; before its end it has no minimum."""
        return vars(self._run) | {"minimum": None, "history": self._run.history.told()}

    def end(self) -> None:
        """Hand on the jammed packing, or one without overlaps."""
        run, making = self._run, self._making
        making.minimum = run.minimum
        if run.minimum is not None:
            making.state = run.minimum.state
            return
        assert run.loose is not None
        making.state = State.of(without_overlaps(run.loose.packing(making.landscape.particles)))


class Sweeping:
    """Monte Carlo of hard particles."""

    def __init__(self, making: Making, checkpoint: Checkpoint | None) -> None:
        way = making.recipe.way
        assert isinstance(way, Steps)
        assert way.thermal
        self._making, self._n_sweeps = making, way.thermal.n_sweeps
        told = dict(checkpoint or {"state": making.state})
        packing = told.pop("state").packing(making.landscape.particles)
        self._thermal = Thermal(packing, **told)
        thermal.require(self._thermal)

    @property
    def done(self) -> bool:
        """Whether all sweeps are done."""
        return self._thermal.n_done >= self._n_sweeps

    def advance(self) -> Told:
        """Run a block of sweeps."""
        at, making = self._thermal, self._making
        thermal.sweep(at, self._n_sweeps, making.recipe.seed)
        text = f"sweep {at.n_done} of {self._n_sweeps}, acceptance {at.acceptance:.2f}"
        part = at.n_done / self._n_sweeps
        return making.told("Monte Carlo", text, State.of(at.packing), part)

    def checkpoint(self) -> Checkpoint:
        """Return the state, the sweeps done, and the size of moves."""
        at = self._thermal
        numbers = {"n_done": at.n_done, "size": at.size, "acceptance": at.acceptance}
        return {"state": State.of(at.packing)} | numbers

    def end(self) -> None:
        """Hand on the state."""
        self._making.state = State.of(self._thermal.packing)
        self._making.attributes["acceptance"] = self._thermal.acceptance


class Searching:
    """Search for the target energy."""

    def __init__(self, making: Making, checkpoint: Checkpoint | None) -> None:
        self._making, self._n = making, 0
        self._before, self._u = making.landscape.evaluations, math.nan
        self._advance = _ADVANCES[making.recipe.way.search]
        if checkpoint is None:
            making.target.require(making.landscape)
            self._search = Search(making.state, making.target.step)
        else:
            self._n, self._before = checkpoint["n"], checkpoint["before"]
            self._search = search_of(checkpoint["search"], History.of(checkpoint["history"]))

    @property
    def done(self) -> bool:
        """Whether the packing is found."""
        return self._search.minimum is not None

    def advance(self) -> Told:
        """Minimise once."""
        search, making = self._search, self._making
        self._advance(making.landscape, search, making.target)
        self._n += 1
        u, last = search.history.energy_density[-1], self._u
        self._u = u
        if not self.done and self._n >= MOST_MINIMISATIONS:
            msg = (
                f"after {self._n} minimisations the search is at u = {u:.3g}, expected u ="
                f" {making.target.u0:.3g}; use a start nearer to jamming, or extrapolation"
            )
            raise TargetError(msg)
        text = f"{progress_of(search, making.target, last, making.landscape.law)}, minimisation {self._n}"
        return making.told(f"search for u0 = {making.target.u0:g}", text, search.state)

    def checkpoint(self) -> Checkpoint:
        """Return the search."""
        search = {"search": told_search(self._search), "history": self._search.history.told()}
        return search | {"n": self._n, "before": self._before}

    def end(self) -> None:
        """Hand on the packing."""
        making = self._making
        making.minimum = self._search.minimum
        making.attributes |= {
            "search": making.recipe.way.search,
            "search_minimisations": self._n,
            "search_evaluations": making.landscape.evaluations - self._before,
        }


def progress_of(search: Search, target: Target, last: float, law: Interaction) -> str:
    """Describe where a search is; `last` is u before its last step."""
    u, residual = search.history.energy_density[-1], search.history.residual[-1]
    ratio = f"u/u0 {u / target.u0:.3g}" if u > 0 else "unjammed"
    text = f"u {u:.2e}, {ratio}, residual {residual:.1e} of {target.tolerance:.0e}, step {search.step:.1e}"
    # Equal steps down to u0, estimated from the root of u that is linear in the strain.
    now, before, aim = map(law.root, (max(u, 0.0), last, target.u0))
    steps = (now - aim) / (before - now) if aim < now < before else math.inf
    return f"{text}, about {math.ceil(steps)} more of it" if steps < MOST_MINIMISATIONS else text


class Settling:
    """Search for a target in a box that yields, and for stability to shear if asked.

    Minimisers can end at saddles of the enthalpy. From there the packing is moved along the direction in which the enthalpy
    falls, and settles again: a further try.
    """

    def __init__(self, making: Making, checkpoint: Checkpoint | None) -> None:
        self._making, self._before = making, making.landscape.evaluations
        self._tries, self._softest = 1, (math.nan, math.nan)
        if checkpoint is None:
            self._goal.require(making.landscape)
            level = (
                None
                if isinstance(making.recipe.way, Given)
                else boxes.first_level(making.landscape)
            )
            self._at = boxes.Settling(making.state, first=level)
        else:
            self._before, self._tries = checkpoint.pop("before"), checkpoint.pop("tries")
            history = History.of(checkpoint.pop("history"))
            present = minimum_of(checkpoint.pop("present", None), history)
            self._at = boxes.Settling(**checkpoint, present=present, history=history)

    @property
    def _goal(self) -> boxes.Yielding:
        goal = self._making.goal
        assert isinstance(goal, boxes.Yielding)
        return goal

    @property
    def done(self) -> bool:
        """Whether the goal is reached, by a packing that is stable if asked, or the tries are over."""
        if not self._at.done or not self._making.recipe.stable_to_shear:
            return self._at.done
        value, bound = self._softest
        return value >= -bound or (value < 0 and self._tries >= _MOST_TRIES)

    def advance(self) -> Told:
        """Minimise once, or judge a packing at the target."""
        at, making = self._at, self._making
        if at.done:
            self._judge()
        else:
            boxes.advance(making.landscape, at, self._goal)
        u, residual = at.history.energy_density[-1], at.history.residual[-1]
        text = f"u {u:.2e}, stress off by {at.stress_error:.1e}, residual {residual:.1e}, step {at.n_steps} of the box"
        return making.told(f"box yields to {self._goal.aim}", text, at.state)

    def _judge(self) -> None:
        """Find the softest motion of particles and box, and move along it if the enthalpy falls."""
        at, landscape = self._at, self._making.landscape
        found = stability_of(landscape, at.state)
        self._softest = found.eigenvalue
        if found.sign >= 0 or self._tries >= _MOST_TRIES:
            return
        assert at.present is not None
        overlap = (
            2
            * at.present.evaluation.energy
            / at.present.evaluation.bond_force
            / at.present.evaluation.n_bonds
        )
        size = _OFF_SADDLE * overlap / max(np.abs(found.motion).max(), 1e-300)
        matrix = (
            np.eye(at.state.dimension, dtype=np.longdouble) + np.longdouble(size) * found.strain
        )
        moved = (
            landscape.displaced(at.state, size * found.motion).deformed(matrix).with_least_tilt()
        )
        self._at = boxes.Settling(moved, history=at.history)
        self._tries += 1

    def checkpoint(self) -> Checkpoint:
        """Return the state of the box and its minimum."""
        at = self._at
        minimum = {"present": told_minimum(at.present), "history": at.history.told()}
        return vars(at) | minimum | {"before": self._before, "tries": self._tries}

    def end(self) -> None:
        """Hand on the packing."""
        making = self._making
        making.minimum, making.state = self._at.present, self._at.state
        making.attributes |= {
            "stress_error": self._at.stress_error,
            "box_steps": self._at.n_steps,
            "box_evaluations": making.landscape.evaluations - self._before,
        }
        if making.recipe.stable_to_shear:
            value, bound = self._softest
            told = {"tries": self._tries, "bordered_eigenvalue": value}
            making.attributes |= told | {"bordered_eigenvalue_bound": bound}


class Minimising:
    """Minimisation at a fixed box, in parts."""

    def __init__(self, making: Making, checkpoint: Checkpoint | None) -> None:
        self._making, self._parts = making, 0
        self._found: Minimum | None = None
        self._history, self._state = History(), making.state
        if checkpoint is not None:
            self._history = History.of(checkpoint["history"])
            self._state, self._parts = checkpoint["state"], checkpoint["parts"]

    @property
    def done(self) -> bool:
        """Whether it has ended."""
        return self._found is not None

    def advance(self) -> Told:
        """Minimise for a part of the evaluations."""
        making = self._making
        goal, way = making.goal, making.recipe.way
        assert isinstance(way, Given)
        assert isinstance(goal, FixedBox)
        left = way.evaluations - self._parts * EVALUATIONS
        stop = Stop(goal.tolerance, evaluations=min(left, EVALUATIONS))
        found = minimise(making.landscape, self._state, goal.method, stop, self._history)
        if found.outcome is Outcome.STALLED and goal.method == "auto":
            found = minimise(making.landscape, found.state, "newton", stop, self._history)
        self._state = found.state
        self._parts += 1
        if found.outcome is not Outcome.EXHAUSTED or left <= EVALUATIONS:
            self._found = found
        text = f"u {found.energy_density:.3e}, residual {found.residual.largest:.1e} of {goal.tolerance:.0e}"
        return making.told("minimisation", text, found.state)

    def checkpoint(self) -> Checkpoint:
        """Return the state."""
        return {"state": self._state, "parts": self._parts, "history": self._history.told()}

    def end(self) -> None:
        """Hand on the minimum."""
        self._making.minimum, self._making.state = self._found, self._state


class Strengthening:
    """Search for a strict minimum."""

    def __init__(self, making: Making, checkpoint: Checkpoint | None) -> None:
        self._making = making
        if checkpoint is None:
            assert making.minimum is not None
            self._search = strict.start(making.landscape, making.minimum.state)
        else:
            history = History.of(checkpoint.pop("history"))
            minimum = minimum_of(checkpoint.pop("minimum"), history)
            assert minimum is not None
            self._search = StrictSearch(minimum, **checkpoint)

    @property
    def done(self) -> bool:
        """Whether the search has ended."""
        return self._search.done

    def advance(self) -> Told:
        """Take a step, or check a candidate."""
        search, making = self._search, self._making
        assert not isinstance(making.goal, boxes.Yielding)  # refused by the recipe
        strict.advance(making.landscape, search, making.goal)
        return making.told("search for a strict minimum", str(search), search.minimum.state)

    def checkpoint(self) -> Checkpoint:
        """Return the search; its proof is made anew."""
        search = self._search
        minimum = {
            "minimum": told_minimum(search.minimum),
            "history": search.minimum.history.told(),
        }
        return vars(search) | minimum | {"proof": None}

    def end(self) -> None:
        """Hand on the minimum and its proof."""
        search, making = self._search, self._making
        making.minimum = search.minimum
        making.attributes |= search.counts()
        if search.proof is not None:  # else it has unjammed, at a fixed box
            making.attributes |= search.proof.attributes()
