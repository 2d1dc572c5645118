"""Ensembles: one packing for each of many seeds, made by several processes, as a driver."""

from __future__ import annotations

import dataclasses
import json
import math
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.command import plain
from jamshape.files.checkpoint import Checkpoint
from jamshape.files.h5md import read_attributes
from jamshape.files.outcomes import is_reached, shortfall
from jamshape.files.vocabulary import ENSEMBLE
from jamshape.minima import Outcome
from jamshape.packing import Packing
from jamshape.protocols.defaults import recipe_for
from jamshape.protocols.make import is_done, made, make, require_same
from jamshape.protocols.recipe import Recipe
from jamshape.recording.driver import Plan, Row, Told
from jamshape.recording.workers import Workers, cores
from jamshape.shapes.particles import Particles

FAILED = "failed"
"""Outcome of a sample without a packing."""

OUTCOMES = (*(one.value for one in Outcome), FAILED)
"""Outcomes by their number in the file."""

_NUMBERS = (
    *(
        "phi",
        "phi_J",
        "pressure",
        "u",
        "energy_per_particle",
        "z",
        "z_single",
        "z_bearing",
        "z_iso",
    ),
    *("n_contacts", "n_bonds", "n_rattlers", "n_negative", "S2", "S4", "C4"),
    *("residual", "evaluations", "wall_seconds"),
)
_SAMPLE = f"{__name__}:sample"

Sample = dict[str, Any]
"""Numbers of a sample, its outcome, and why it fell short, if it did."""


def sample(recipe: Recipe, out: Path | None) -> Sample:
    """Make a packing, into a file if one is given, and return its numbers."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        known = made(recipe).results if out is None else _kept(recipe, out)
    found: Sample = {name: float(known.get(name, math.nan)) for name in _NUMBERS}
    found |= {"outcome": known["outcome"], "reached": is_reached(known)}
    why = shortfall(known)
    return found | ({"why": why} if why else {})


def _kept(recipe: Recipe, out: Path) -> Mapping[str, Any]:
    """Make a packing in a file, unless it is there, and return its attributes."""
    if is_done(out):
        require_same(out, recipe)
    else:
        make(recipe, out)
    return read_attributes(out)


def file_of(folder: Path, recipe: Recipe) -> Path:
    """Name the file of a sample, as `jamshape sweep` does."""
    particles, told = recipe.particles, recipe.particles.told
    own = particles.shape.told(told)
    stem = particles.shape.stem(own) if own else "mixture"
    return folder / f"{stem}_seed{recipe.seed}.h5"


class Means(NamedTuple):
    """Processes and folder of an ensemble, on which its results do not depend."""

    jobs: int
    """Number of processes."""
    folder: Path | None = None
    """Folder for the packings."""
    arguments: str = ""
    """Arguments of `recipe_for` as JSON; empty if particles are not described by them."""

    @classmethod
    def of(
        cls,
        jobs: int,
        folder: Path | None,
        particles: Particles | None,
        settings: Mapping[str, Any],
    ) -> Means:
        """Describe the arguments of a recipe, so that its file is enough to resume."""
        given = dict(settings)
        if particles is not None:
            again = Particles.again(particles.shape.name, particles.told)
            if again != particles:
                return cls(jobs, folder)
            given["particles"] = {"shape": particles.shape.name, **particles.told}
        return cls(jobs, folder, json.dumps(plain(given)))


def plan_again(stored: Mapping[str, Any]) -> Plan | None:
    """Plan the ensemble of a file from its attributes; None if they do not describe it."""
    if not (recipe := _recipe_again(stored)):
        return None
    seeds, folder = [int(seed) for seed in stored["ensemble_seeds"]], str(stored["folder"])
    means = Means(cores(), Path(folder) if folder else None, str(stored["arguments"]))
    return plan(recipe, seeds, means)


def kept_file(stored: Mapping[str, Any], seed: int) -> Path | None:
    """Name the file of a sample from the attributes of its ensemble; None if it was not kept."""
    recipe, folder = _recipe_again(stored), str(stored.get("folder", ""))
    if not (recipe and folder):
        return None
    return file_of(Path(folder), dataclasses.replace(recipe, seed=seed))


def _recipe_again(stored: Mapping[str, Any]) -> Recipe | None:
    """Make the recipe of the first sample from attributes; None if they do not describe it."""
    if not (arguments := str(stored.get("arguments", ""))):
        return None
    given = json.loads(arguments)
    if known := given.pop("particles", None):
        given["particles"] = Particles.again(known.pop("shape"), known)
    return recipe_for(seed=int(stored["ensemble_seeds"][0]), **given)


def plan(recipe: Recipe, seeds: Sequence[int], means: Means) -> Plan:
    """Plan an ensemble.

    Parameters
    ----------
    recipe : Recipe
        All settings, with any seed.
    seeds : sequence of int
    means : Means
    """
    own = {name: value for name, value in recipe.identity.items() if name != "seed"}
    samples = [dataclasses.replace(recipe, seed=seed) for seed in seeds]

    def begin() -> EnsembleDriver:
        return EnsembleDriver(samples[0].start(), samples, means, {})

    def restore(first: Packing, checkpoint: Checkpoint) -> EnsembleDriver:
        return EnsembleDriver(first, samples, means, checkpoint)

    seeds_as_array = np.array(list(seeds), np.int64)
    return Plan(
        ENSEMBLE,
        "an ensemble",
        own | {"ensemble_seeds": seeds_as_array},
        begin,
        restore,
        {"ensemble_seeds": "seeds"},
    )


class EnsembleDriver:
    """An ensemble: a row for each seed, in their order; every time is a mark.

    Parameters
    ----------
    first : Packing
        Random start of the first sample, which stands for the particles.
    samples : sequence of Recipe
    means : Means
    checkpoint : Checkpoint
        Number of rows, samples that ended before earlier ones, and reasons of failures; empty at the start.
    """

    at_mark = True

    def __init__(
        self,
        first: Packing,
        samples: Sequence[Recipe],
        means: Means,
        checkpoint: Checkpoint,
    ) -> None:
        self._first, self._samples, self._means = first, samples, means
        self._n_rows = int(checkpoint.get("n_rows", 0))
        self._ended: dict[int, Sample] = {
            int(k): dict(s) for k, s in checkpoint.get("ended", {}).items()
        }
        self._failures: dict[str, str] = json.loads(checkpoint.get("failures", "{}"))
        self._left = [k for k in range(self._n_rows, len(samples)) if k not in self._ended]
        folder = means.folder
        tasks = [(samples[k], folder and file_of(folder, samples[k])) for k in self._left]
        self._workers = Workers(_SAMPLE, tasks, means.jobs)

    @property
    def done(self) -> bool:
        """Whether all samples have their rows."""
        return self._n_rows == len(self._samples)

    def first(self) -> Row:
        """Return the progress at the start."""
        return Row(self._told())

    def advance(self) -> Row:
        """Return the next row, or wait for a time for a sample."""
        if self._n_rows not in self._ended:
            if (done := self._workers.wait()) is not None:
                at = self._left[done.number]
                self._ended[at] = done.result or {"outcome": FAILED, "why": done.failure}
            return Row(self._told())
        found = self._ended.pop(self._n_rows)
        seed, step = self._samples[self._n_rows].seed, self._n_rows
        why = found.pop("why", None)
        if why is not None:
            self._failures[str(seed)] = why
        self._n_rows += 1
        numbers = {name: found.get(name, math.nan) for name in _NUMBERS}
        numbers |= {"seed": seed, "reached": bool(found.get("reached", False))}
        numbers["outcome"] = OUTCOMES.index(found["outcome"])
        aside = why and f"seed {seed}: {why}"
        return Row(self._told(aside), step, 0.0, numbers)

    def frame(self) -> Packing:
        """Return the particles."""
        return self._first

    def checkpoint(self) -> Checkpoint:
        """Return what ended before earlier samples, and why samples failed."""
        ended = {str(k): sample for k, sample in self._ended.items()}
        return {"n_rows": self._n_rows, "ended": ended, "failures": json.dumps(self._failures)}

    def results(self) -> Mapping[str, Any]:
        """Return the reasons of failures, names of outcomes, and the arguments that resume the file alone."""
        known = {"failures": json.dumps(self._failures), "outcomes": " ".join(OUTCOMES)}
        means = self._means
        return known | {"arguments": means.arguments, "folder": str(means.folder or "")}

    def close(self) -> None:
        """End the processes."""
        self._workers.close()

    def _told(self, aside: str | None = None) -> Told:
        done = self._n_rows + len(self._ended)
        failed = f", {len(self._failures)} failed" if self._failures else ""
        return Told(
            "packings", f"{done} of {len(self._samples)}{failed}", done / len(self._samples), aside
        )
