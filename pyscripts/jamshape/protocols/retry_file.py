"""A second attempt in a file beside the packing, resumed after a kill to the same packing, to the bit."""

from __future__ import annotations

import time
from collections.abc import Generator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from jamshape.files.h5md import read_packing
from jamshape.landscape import Landscape
from jamshape.minima import Minimum
from jamshape.packing import State
from jamshape.protocols.making import Progress, stored_of, write_states
from jamshape.protocols.recipe import Recipe
from jamshape.protocols.retry import Retry, go_on

_STORE_SECONDS = 5.0

_NUMBERS = ("budget", "longest", "n_steps", "evaluations")


@dataclass(eq=False)
class RetryFile:
    """File of a second attempt.

    Parameters
    ----------
    path
    recipe
    attributes
        Attributes of the attempt for the file of the packing; empty if there was none.
    """

    path: Path
    recipe: Recipe
    attributes: dict[str, Any] = field(default_factory=dict)

    def read(self) -> Retry | None:
        """Read the state of an earlier call with this recipe."""
        stored = stored_of(self.path, self.recipe)
        if stored is None or "retry_budget" not in stored:
            return None
        numbers = {name: stored[f"retry_{name}"] for name in _NUMBERS}
        return Retry(State.of(read_packing(self.path)), **numbers)

    def write(self, retry: Retry, landscape: Landscape) -> None:
        """Write a second attempt between two steps."""
        numbers = {f"retry_{name}": getattr(retry, name) for name in _NUMBERS}
        attributes = self.recipe.attributes() | numbers
        write_states(self.path, [retry.state], landscape.particles, attributes)


def try_again(
    landscape: Landscape, minimum: Minimum, file: RetryFile
) -> Generator[Progress, None, Minimum]:
    """Repeat the search from an unbalanced minimum, for as much work as it has taken so far.

    Yields
    ------
    Progress
        After each step.

    Returns
    -------
    Minimum
        The given one, if the attempt does not help.
    """
    target = file.recipe.target
    assert target is not None
    taken = landscape.evaluations
    retry = file.read() or Retry(minimum.state, taken)
    landscape.evaluations = taken + retry.evaluations
    stored = time.perf_counter()
    for at in go_on(landscape, retry, target):
        if not at.is_over and time.perf_counter() - stored > _STORE_SECONDS:
            file.write(at, landscape)
            stored = time.perf_counter()
        yield _told(at, landscape, minimum)
    file.attributes = {"retry_of": minimum.outcome.value} | retry.counts()
    return retry.minimum or minimum


def _told(at: Retry, landscape: Landscape, first: Minimum) -> Progress:
    volume = at.state.volume
    phi = float(landscape.particles.measures.sum()) / volume
    text = (
        f"step {max(at.n_steps, 0)}, {at.work} of the work of {at.budget} evaluations, after a minimum that"
        f" ended {first.outcome.value} with a residual of {first.residual.largest:.1e}"
    )
    part = min(1.0, at.work / at.budget)
    return Progress("retry", "second attempt", phi, first.energy_density, text, part)
