"""The pipeline of a packing, of any shape and dimension.

A random start; compression to jamming, by dynamics, by quasistatic steps or at a fixed rate; the search for the
target energy, if any; all measurements; and the file. Between its steps everything is in files
beside the result, so that an interrupted pipeline resumes where it was.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from jamshape.files.h5md import read_attributes, require_attributes
from jamshape.files.journal import remove_run
from jamshape.measures.minimum import summary_of, write_minimum
from jamshape.protocols.by_compression import ByCompression
from jamshape.protocols.by_dynamics import ByDynamics
from jamshape.protocols.by_steps import BySteps
from jamshape.protocols.making import Making, Progress, SearchFile, lead
from jamshape.protocols.recipe import (
    Adaptive,
    Compressed,
    Dynamics,
    Recipe,
    Steps,
    Thermalisation,
    Way,
)
from jamshape.protocols.retry_file import RetryFile, try_again
from jamshape.protocols.strict_file import StrictFile, lead_strictly

_MAKING: dict[type[Way], Callable[[Recipe, Path], Making]] = {
    Dynamics: ByDynamics,
    Adaptive: BySteps,
    Steps: BySteps,
    Compressed: ByCompression,
}
"""Implementation of each way."""

__all__ = [
    "Adaptive",
    "Compressed",
    "Dynamics",
    "Progress",
    "Recipe",
    "Steps",
    "Thermalisation",
    "is_done",
    "make",
    "require_same",
    "summary_of",
    "tidy",
]


def make(
    recipe: Recipe, out: Path, *, again: bool = False, retry: bool = True
) -> Iterator[Progress]:
    """Make a packing and write it to `out`, resuming an earlier call.

    Where forces do not balance at the energy, there is a second attempt (`protocols.retry`).

    Parameters
    ----------
    recipe : Recipe
    out : Path
        Replaced when the packing is found.
    again : bool
        Start over if files are damaged or belong to another recipe.
    retry : bool
        Whether to make a second attempt.

    Yields
    ------
    Progress
        After every row of a compression, every minimisation and every block of sweeps.

    Raises
    ------
    TargetError
        See `target.direct`.
    ValueError
        As `Recipe.start` and `target.direct`, or if another packing was being made there.
    """
    began = time.perf_counter()
    way = _way(recipe, out)
    try:
        way.require_own()
    except ValueError:
        if not again:
            raise
        way.forget()
    yield from way.steps()
    landscape, minimum = way.landscape(), way.minimum
    before, search = landscape.evaluations, _search(recipe, out)
    if recipe.target:
        minimum = yield from lead(landscape, way.state(), recipe.target, search)
    assert minimum is not None
    searched = landscape.evaluations
    strict, second = StrictFile(_strict_file(out), recipe), RetryFile(_strict_file(out), recipe)
    if recipe.strict:
        minimum = yield from lead_strictly(landscape, minimum, strict)
    elif retry and recipe.is_searched and not minimum.is_at_rest:
        minimum = yield from try_again(landscape, minimum, second)
    attributes: dict[str, Any] = recipe.attributes() | way.measured()
    if recipe.target:
        attributes |= {"search": recipe.way.search, "search_minimisations": search.minimisations}
        attributes |= {"search_evaluations": searched - before}
    attributes |= strict.attributes | second.attributes
    seconds = attributes.pop("seconds_before", 0.0) + time.perf_counter() - began
    attributes |= {"wall_seconds": seconds, "evaluations": landscape.evaluations}
    write_minimum(out, landscape, minimum, attributes)
    tidy(recipe, out)


def tidy(recipe: Recipe, out: Path) -> None:
    """Remove files for resuming that a kill left beside a finished packing."""
    _search(recipe, out).forget()
    remove_run(_strict_file(out))
    _way(recipe, out).done()


def _way(recipe: Recipe, out: Path) -> Making:
    return _MAKING[type(recipe.way)](recipe, out)


def _search(recipe: Recipe, out: Path) -> SearchFile:
    return SearchFile(out.with_name(out.name + ".search.h5"), recipe)


def _strict_file(out: Path) -> Path:
    return out.with_name(out.name + ".strict.h5")


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
    require_attributes(out, recipe.attributes())
    recipe.require_particles(out)
