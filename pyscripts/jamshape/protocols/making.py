"""What all ways to a packing share: what each of them offers, progress, and the search for an energy in a file."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from jamshape.files.disk import remove_leftovers
from jamshape.files.h5md import read_attributes, read_packing, write_frames
from jamshape.files.journal import remove_run
from jamshape.landscape import Landscape
from jamshape.minima import Minimum
from jamshape.minima.target import Search, Target, TargetError
from jamshape.packing import Packing, State
from jamshape.protocols.recipe import SEARCHES, Recipe

MOST_MINIMISATIONS = 20_000
"""Of a search for an energy: with the steps of 1e-6 of the halving search they change phi by 0.04."""


@dataclass(frozen=True)
class Progress:
    """Where the making of a packing is.

    Parameters
    ----------
    stage
        "compression", "Monte Carlo", "choice" or "search".
    phase
        Part of the stage, and what it aims at, in words.
    phi
        Packing fraction.
    energy_density
        u, [energy / length^D].
    text
        What else there is to say, with what it is to become.
    part
        Of the phase, from 0 to 1; None where nobody can tell.
    """

    stage: str
    phase: str
    phi: float
    energy_density: float
    text: str
    part: float | None = None


class Making(Protocol):
    """A way to jamming that is being gone, in memory and in files beside the packing."""

    minimum: Minimum | None
    """The packing, where it needs no search for an energy."""

    def require_own(self) -> None:
        """Refuse what another recipe has left; raises ValueError."""

    def forget(self) -> None:
        """Remove what an earlier call has left."""

    def steps(self) -> Iterator[Progress]:
        """Go to the end, from where an earlier call has left it."""

    def landscape(self) -> Landscape:
        """Landscape of the packing."""

    def state(self) -> State:
        """Where the search for an energy begins."""

    def measured(self) -> dict[str, Any]:
        """Return what only this way knows."""

    def done(self) -> None:
        """Remove what nobody needs beside a finished packing."""


@dataclass(eq=False)
class SearchFile:
    """The file of a search for an energy, from which it goes on after a kill."""

    path: Path
    recipe: Recipe
    minimisations: int = 0
    """That were made so far."""

    def read(self, landscape: Landscape) -> Search | None:
        """Read the search, if it is there and of this recipe; the landscape goes on counting."""
        remove_leftovers(self.path)  # what goes on may be done before it writes the file again
        stored = stored_of(self.path, self.recipe)
        if stored is None:
            return None
        landscape.evaluations = int(stored.get("evaluations", 0))
        self.minimisations = int(stored.get("minimisations", 0))
        opening = int(stored["opening"])
        return Search(
            state=State.of(read_packing(self.path, 1)),
            step=float(stored["search_step"]),
            loose=State.of(read_packing(self.path, 0)) if stored["has_loose"] else None,
            loose_in_a_row=int(stored["loose_in_a_row"]),
            opening=None if opening < 0 else bool(opening),
        )

    def write(self, search: Search, landscape: Landscape) -> None:
        """Write a search between two minimisations: its states are two frames."""
        attributes = self.recipe.attributes() | {
            "search_step": search.step,
            "loose_in_a_row": search.loose_in_a_row,
            "opening": -1 if search.opening is None else int(search.opening),
            "has_loose": search.loose is not None,
            "evaluations": landscape.evaluations,
            "minimisations": self.minimisations,
        }
        states = [search.loose or search.state, search.state]
        write_states(self.path, states, landscape.particles, attributes)

    def forget(self) -> None:
        """Remove it, and what a process that was killed meanwhile has left of it."""
        remove_run(self.path)
        remove_leftovers(self.path)


def lead(
    landscape: Landscape, start: State, target: Target, file: SearchFile
) -> Generator[Progress, None, Minimum]:
    """Lead a state to an energy, going on with what is in the file; errors as `target.direct`.

    The search is that of the recipe's way (`SEARCHES`). Either ends by its own rule when its steps become too
    small, and after `MOST_MINIMISATIONS` at the latest.

    Yields
    ------
    Progress
        After each minimisation.

    Returns
    -------
    Minimum

    Raises
    ------
    TargetError
        As the search, or after so many minimisations.
    """
    search = file.read(landscape) or Search(start, target.step)
    # From a state that was written all is done again that had been done from there: it is written once.
    u, written = math.nan, search.state
    for at in SEARCHES[file.recipe.way.search](landscape, search, target):
        file.minimisations += 1
        if at.minimum is None and at.state is not written:
            file.write(at, landscape)
            written = at.state
            _require_few(file, at, target)
        told = _searching(at, landscape, target, u)
        u = at.history.energy_density[-1]
        yield replace(told, text=f"{told.text}, minimisation {file.minimisations}")
    assert search.minimum is not None
    return search.minimum


def _require_few(file: SearchFile, search: Search, target: Target) -> None:
    """End a search that takes too long; what it has reached stays in its file."""
    if file.minimisations >= MOST_MINIMISATIONS:
        msg = (
            f"the search has made {file.minimisations} minimisations and is at u ="
            f" {search.history.energy_density[-1]:.3g}, expected u = {target.u0:.3g} by then; take a"
            " start nearer to jamming, or the direct search"
        )
        raise TargetError(msg)


def _searching(search: Search, landscape: Landscape, target: Target, last: float) -> Progress:
    """Tell where a search is; `last` is u before its last step."""
    phi = float(landscape.particles.measures.sum()) / search.state.volume
    u, residual = search.history.energy_density[-1], search.history.residual[-1]
    ratio = f"u/u0 {u / target.u0:.3g}" if u > 0 else "unjammed"
    text = f"u {u:.2e}, {ratio}, residual {residual:.1e} of {target.tolerance:.0e}"
    text += f", step {search.step:.1e}{_steps_left(u, last, target)}"
    return Progress("search", f"search for u0 = {target.u0:g}", phi, u, text)


def _steps_left(u: float, last: float, target: Target) -> str:
    """Say how many equal steps lead down to u0, by sqrt(u), which is linear in the strain; nothing if unknown."""
    if not target.u0 < u < last:
        return ""
    now, before, aim = map(math.sqrt, (u, last, target.u0))
    return f", about {math.ceil((now - aim) / (before - now))} more of it"


def write_states(
    path: Path, states: list[State], like: Packing, attributes: Mapping[str, Any]
) -> None:
    """Write states as the frames of one file, which replaces the one that is there when it is whole."""
    write_frames(path, [state.packing(like) for state in states], attributes)


def stored_of(path: Path, recipe: Recipe) -> dict[str, Any] | None:
    """Read what an earlier call has left in a file, if it is there and of this recipe."""
    stored = read_attributes(path) if path.exists() else {}
    own = recipe.attributes()
    return stored if stored and all(stored.get(k) == v for k, v in own.items()) else None
