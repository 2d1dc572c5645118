"""The pipeline of a packing, of any shape and dimension, as a driver of stages.

A random start; compression to jamming, by dynamics, by quasistatic steps or at a fixed rate; the search for the
target energy, if any; a strict minimum, if asked for; all measurements; and the file. Compressions in LAMMPS
are runs with a file of their own, ``OUT.run.h5``, which serves searches for other energies; all other stages share one
file until the packing is finished, ``OUT.making.h5``, from which an interrupted call is resumed.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from jamshape.checks import TimeLimitError
from jamshape.files.checkpoint import Checkpoint
from jamshape.files.h5md import read_attributes, read_observables, require_attributes
from jamshape.files.lock import Lock
from jamshape.flow import lammps_driver
from jamshape.flow.compression import Compression
from jamshape.flow.lammps_driver import Sizes
from jamshape.landscape import Landscape
from jamshape.measures.onset import OnsetFit, fit_onset
from jamshape.measures.packing_summary import summary_of, with_results, write_minimum
from jamshape.minima import History, Minimum, Outcome
from jamshape.minima.boxes import Yielding
from jamshape.minima.checkpoints import minimum_of, told_minimum
from jamshape.minima.target import FixedBox
from jamshape.packing import Packing, State
from jamshape.protocols import approach
from jamshape.protocols.choosing import Choosing, frame_of
from jamshape.protocols.recipe import (
    Adaptive,
    Compressed,
    Dynamics,
    Given,
    Recipe,
    Steps,
    Thermalisation,
)
from jamshape.protocols.stages import (
    Begin,
    Compressing,
    Making,
    Minimising,
    Searching,
    Settling,
    Stage,
    Strengthening,
    Sweeping,
)
from jamshape.recording.driver import Plan, Row
from jamshape.recording.recorder import How, record, stopped
from jamshape.shapes.shape import Interaction

__all__ = [
    "Adaptive",
    "Compressed",
    "Dynamics",
    "Recipe",
    "Steps",
    "Thermalisation",
    "is_done",
    "made",
    "make",
    "require_same",
    "run_file",
    "summary_of",
    "tidy",
]

# Rows and frames of marschall-2018; frames are about 2e-3 of phi apart at jamming.
MAKING = "packing in the making"
"""Kind of the file beside a packing until it is finished."""

_SIZES = Sizes(600, 300)

# Settings of the search alone; a compression, whose file holds its final packing fraction, serves any search.
_OF_SEARCH = ("phi_start", "search", "start", "protocol")


def make(recipe: Recipe, out: Path, how: How = How()) -> None:  # noqa: B008
    """Make a packing and write it to `out`, or resume an interrupted call.

    Parameters
    ----------
    recipe : Recipe
    out : Path
        Replaced when the packing is found.
    how : How
        With `again`, all stages begin anew, but for a compression in LAMMPS that serves this recipe.

    Raises
    ------
    TargetError
        See `target.extrapolation`.
    ValueError
        As `Recipe.start` and `target.extrapolation`, or if another packing was being made there.
    TimeLimitError, OSError
        As `jamshape.recording.recorder.record`.
    """
    how = _after_compression(recipe, out, how)
    plan = _plan(recipe, run_file(recipe, out), partial(Pipeline.write, out=out))
    record(_making_file(out), plan, how)


def made(recipe: Recipe, how: How = How()) -> Packing:  # noqa: B008
    """Make a packing and write nothing, but for a compression in LAMMPS, whose file goes with a temporary folder.

    Arguments and errors as in `make`.

    Returns
    -------
    Packing
        With the results that its file would have.
    """
    found: list[Packing] = []
    place = TemporaryDirectory(prefix="jamshape-") if compresses(recipe) else nullcontext("")
    with place as folder:
        out = Path(folder, "packing.h5")
        try:
            how = _after_compression(recipe, out, how)
        except TimeLimitError as error:
            raise TimeLimitError(stopped("in the compression", how)) from error
        plan = _plan(recipe, run_file(recipe, out), lambda driver: found.append(driver.packing()))
        record(None, plan, how)
    if not found:  # the caller's handler of a signal has returned
        raise KeyboardInterrupt
    return found[0]


def _plan(recipe: Recipe, source: Path | None, finish: Callable[[Any], None]) -> Plan:
    def begin() -> Pipeline:
        return Pipeline(recipe, source, None)

    def restore(first: Packing, checkpoint: Checkpoint) -> Pipeline:
        del first
        return Pipeline(recipe, source, checkpoint)

    return Plan(MAKING, "a packing", recipe.identity, begin, restore, finish=finish)


def _making_file(out: Path) -> Path:
    return out.with_name(out.name + ".making.h5")


def tidy(out: Path) -> None:
    """Remove what a kill after the last write has left beside a finished packing."""
    left = _making_file(out)
    if left.exists():
        with Lock(left):
            left.unlink(missing_ok=True)


def run_file(recipe: Recipe, out: Path) -> Path | None:
    """Name the file of the compression in LAMMPS, if the recipe has one."""
    if isinstance(recipe.way, Steps | Given):
        return None
    given = recipe.way.source if isinstance(recipe.way, Compressed) else None
    return given or out.with_name(out.name + ".run.h5")


def compresses(recipe: Recipe) -> bool:
    """Whether the recipe has a compression in LAMMPS that is not given."""
    is_given = isinstance(recipe.way, Compressed) and recipe.way.source is not None
    return not isinstance(recipe.way, Steps | Given) and not is_given


def _after_compression(recipe: Recipe, out: Path, how: How) -> How:
    """Compress, and return what time is left."""
    began = time.perf_counter()
    compress(recipe, out, how)
    if how.seconds is None:
        return how
    return how._replace(seconds=max(0.0, how.seconds - (time.perf_counter() - began)))


def compress(recipe: Recipe, out: Path, how: How) -> None:
    """Record the compression in LAMMPS, if the recipe has one that is not given."""
    path = run_file(recipe, out)
    if path is None or not compresses(recipe):
        return
    plan = _compression(recipe)
    try:
        if path.exists():
            require_attributes(path, plan.settings, plan.what)
            recipe.require_particles(path)
        record(path, plan, how._replace(again=False))
    except ValueError:
        if not how.again:
            raise
        record(path, plan, how)


def _compression(recipe: Recipe) -> Plan:
    """Plan the compression in LAMMPS."""

    def start() -> Packing:
        packing = recipe.start()
        if recipe.target:
            recipe.target.require(Landscape(packing))
        return packing

    told, way = {"law": None} | recipe.before_target(), recipe.way
    if isinstance(way, Dynamics):
        return approach.plan(start, way.approach, told)
    assert isinstance(way, Compressed)
    flow = Compression(kappa=way.kappa, phi_end=way.phi_end, sides=2, integrator="rkc2")
    flow = flow.in_steps(recipe.phi_start, _SIZES.rows, recipe.dimension)
    of_run = {name: value for name, value in told.items() if name not in _OF_SEARCH}
    plan = lammps_driver.plan(start, flow, _SIZES, of_run)
    return dataclasses.replace(plan, kind=approach.FOR_A_PACKING)


class Pipeline:
    """A packing in the making.

    Parameters
    ----------
    recipe : Recipe
    source : path or None
        File of the compression in LAMMPS.
    checkpoint : Checkpoint, optional
        Checkpoint to resume from.
    """

    at_mark = True

    def __init__(self, recipe: Recipe, source: Path | None, checkpoint: Checkpoint | None) -> None:
        self._recipe, self._source = recipe, source
        told = checkpoint or {"stage": 0, "frame": -1, "wall_seconds": 0.0, "evaluations": 0}
        self._began = time.perf_counter() - told["wall_seconds"]
        start = recipe.start() if source is None else frame_of(source, told["frame"])
        self._making = Making(recipe, Landscape(start), State.of(start), frame=told["frame"])
        self._making.landscape.evaluations = told["evaluations"]
        if checkpoint:
            making = self._making
            making.state, making.attributes = told["state"], told.get("attributes", {})
            history = History.of(told["history"]) if "history" in told else History()
            making.minimum = minimum_of(told.get("minimum"), history)
        self._k = told["stage"]
        self._stage: Stage | None = None
        self._begin_stage(told.get("inner"))

    def _stages(self) -> list[Begin]:
        """List the stages; the last one follows from the minimum."""
        recipe, way = self._recipe, self._recipe.way
        finding: Begin = Settling if isinstance(recipe.goal, Yielding) else Searching
        if isinstance(way, Given):
            return [Minimising if isinstance(way.goal, FixedBox) else finding, self._last]
        found: list[Begin] = []
        if isinstance(way, Steps) and way.thermal:
            found += [partial(Compressing, phi=way.thermal.phi), Sweeping]
        if isinstance(way, Steps):
            found.append(Compressing)
        if isinstance(way, Compressed):
            assert self._source
            found.append(partial(Choosing, file=self._source))
        return found + [finding, self._last] * bool(recipe.target)

    def _last(self, making: Making, checkpoint: Checkpoint | None) -> Stage | None:
        """Begin a strict search, where there is to be one."""
        assert making.minimum
        if making.minimum.outcome is Outcome.UNJAMMED or not self._recipe.strict:
            return None
        return Strengthening(making, checkpoint)

    def _begin_stage(self, checkpoint: Checkpoint | None = None) -> None:
        """Begin the present stage, or the next one that there is to be; at the end there is none."""
        stages = self._stages()
        while self._k < len(stages):
            self._stage = stages[self._k](self._making, checkpoint)
            if self._stage is not None:
                return
            self._k += 1
        self._stage = None

    @property
    def done(self) -> bool:
        """Whether all stages have ended."""
        return self._stage is None

    def first(self) -> Row:
        """Return the progress at the start."""
        return Row(self._making.told("start", "", self._making.state))

    def advance(self) -> Row:
        """Let the present stage do a piece of work."""
        assert self._stage is not None
        self._making.landscape.forget_pairs()
        told = self._stage.advance()
        if self._stage.done:
            self._stage.end()
            self._k += 1
            self._begin_stage()
        return Row(told)

    def frame(self) -> Packing:
        """Return the particles."""
        return self._making.landscape.particles.with_(step=0, time=0.0)

    def checkpoint(self) -> Checkpoint:
        """Return the number of the stage, its own checkpoint, and the packing that earlier stages handed to it."""
        assert self._stage is not None
        making = self._making
        found = {
            "stage": self._k,
            "inner": self._stage.checkpoint(),
            "frame": making.frame,
            "wall_seconds": time.perf_counter() - self._began,
            "evaluations": making.landscape.evaluations,
            "state": making.state,
            "attributes": making.attributes,
            "minimum": told_minimum(making.minimum),
        }
        if making.minimum:
            found["history"] = making.minimum.history.told()
        return found

    def results(self) -> dict[str, Any]:
        """Name the present stage."""
        return {"stage": type(self._stage).__name__.lower()}

    def close(self) -> None:
        """Nothing is held outside of Python."""

    def write(self, out: Path) -> None:
        """Measure the packing and write its file."""
        write_minimum(out, self._making.landscape, self._minimum, self._told())

    def packing(self) -> Packing:
        """Measure the packing and return it with its results."""
        return with_results(self._making.landscape, self._minimum, self._told())

    @property
    def _minimum(self) -> Minimum:
        assert self._making.minimum is not None
        return self._making.minimum

    def _told(self) -> dict[str, Any]:
        """Return all but measurements."""
        told = self._recipe.attributes() | self._of_compression() | self._making.attributes
        told |= {"wall_seconds": time.perf_counter() - self._began}
        return told | {"evaluations": self._making.landscape.evaluations}

    def _of_compression(self) -> dict[str, Any]:
        way = self._recipe.way
        if isinstance(way, Given):
            return {}
        if isinstance(way, Steps):
            return {"acceptance": np.nan}  # replaced after Monte Carlo
        assert self._source
        return onsets_of(self._source) if isinstance(way, Dynamics) else _last_row(self._source)


def _last_row(run: Path) -> dict[str, float]:
    """Return the end of a compression."""
    rows = read_observables(run)
    names = ("phi", "u", "pressure", "evaluations")
    return {
        f"compression_{name}": float(rows[name][-1]) for name in names if len(rows.get(name, ()))
    }


def onsets_of(run: Path) -> dict[str, float]:
    """phi_J from p(phi) (Marschall & Teitel 2018, Fig. 4), closing and opening the box; NaN if none."""
    observables, power = read_observables(run), Interaction.told(read_attributes(run)).power
    rising = observables["kappa"] > 0
    found: dict[str, float] = {}
    for name, rows in (("compression", rising), ("opening", ~rising)):
        order = np.argsort(observables["phi"][rows])
        phi, p = (observables[key][rows][order] for key in ("phi", "pressure"))
        try:
            fit = fit_onset(phi, p, power=power)
        except ValueError:
            fit = OnsetFit(np.nan, np.nan, np.nan, 0, 0)
        found |= {f"phi_J_{name}": fit.phi_J, f"phi_J_{name}_error": fit.phi_J_error}
    return found


def is_done(out: Path) -> bool:
    """Whether the file holds a finished packing.

    Raises
    ------
    ValueError
        If it exists with other content.
    """
    if not out.exists():
        return False
    if "outcome" not in read_attributes(out):
        msg = (
            f"{out} holds no finished packing, expected one of make_packing.py;"
            " write to another file, or remove this one"
        )
        raise ValueError(msg)
    return True


def require_same(out: Path, recipe: Recipe) -> None:
    """Raise if a finished packing belongs to another recipe.

    Raises
    ------
    ValueError
    """
    require_attributes(out, recipe.identity)
    recipe.require_particles(out)
