"""The search for a strict minimum in a file, with progress, resumed after a kill."""

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
from jamshape.protocols.strict import StrictSearch, descend, start

_STORE_SECONDS = 5.0


@dataclass(eq=False)
class StrictFile:
    """File of a search for a strict minimum.

    Parameters
    ----------
    path
    recipe
    attributes
        Results for the file of the packing; empty before the end.
    """

    path: Path
    recipe: Recipe
    attributes: dict[str, Any] = field(default_factory=dict)

    def read(self, landscape: Landscape) -> StrictSearch | None:
        """Read the state of an earlier search with this recipe."""
        assert self.recipe.target is not None
        stored = stored_of(self.path, self.recipe)
        if stored is None:
            return None
        search = start(landscape, State.of(read_packing(self.path)))
        search.n_steps, search.n_fallen = int(stored["strict_steps"]), int(stored["strict_fallen"])
        return search

    def write(self, search: StrictSearch, landscape: Landscape) -> None:
        """Write a search between two steps."""
        attributes = self.recipe.attributes() | search.counts() | {"strict_search": True}
        write_states(self.path, [search.minimum.state], landscape.particles, attributes)


def lead_strictly(
    landscape: Landscape, minimum: Minimum, file: StrictFile
) -> Generator[Progress, None, Minimum]:
    """Continue from a minimum to a strict one, resuming from the file; errors as in `strict.descend`.

    Yields
    ------
    Progress
        After each step.

    Returns
    -------
    Minimum
        Its proof is then among the attributes of the file.
    """
    target = file.recipe.target
    assert target is not None
    search = file.read(landscape) or start(landscape, minimum.state)
    stored = time.perf_counter()
    for at in descend(landscape, search, target):
        if not at.done and time.perf_counter() - stored > _STORE_SECONDS:
            file.write(at, landscape)
            stored = time.perf_counter()
        yield _told(at, landscape)
    assert search.proof is not None
    file.attributes = search.counts() | search.proof.attributes()
    return search.minimum


def _told(at: StrictSearch, landscape: Landscape) -> Progress:
    phi = float(landscape.particles.measures.sum()) / at.minimum.state.volume
    left = "" if at.proof is None else f", {at.proof.n_negative} negative eigenvalues of 0"
    if at.proof is not None and at.proof.n_kinked:
        left += f", {at.proof.n_kinked} more at kinks, to both sides of which the energy rises"
    text = (
        f"step {at.n_steps} of at most {at.most_steps}, {at.n_free} motions slide, {at.n_met} of"
        f" them up to new contacts, longest step {at.farthest.max():.1e}{left}"
    )
    return Progress("strict", "search for a strict minimum", phi, at.minimum.energy_density, text)
