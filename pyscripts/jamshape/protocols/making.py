"""Common parts of all ways to a packing: interface, progress, and the search for an energy in a file."""

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
"""Limit of a search: with the steps of 1e-6 of the halving search they change phi by 0.04."""


@dataclass(frozen=True)
class Progress:
    """Progress of a packing.

    Parameters
    ----------
    stage
        "compression", "Monte Carlo", "choice" or "search".
    phase
        Part of the stage, and its goal, in words.
    phi
        Packing fraction.
    energy_density
        u, [energy / length^D].
    text
        Further text, with targets.
    part
        Completed fraction of the phase, from 0 to 1; None if unknown.
    """

    stage: str
    phase: str
    phi: float
    energy_density: float
    text: str
    part: float | None = None


class Making(Protocol):
    """A way to jamming in progress, in memory and in files beside the packing."""

    minimum: Minimum | None
    """The packing, if it needs no search for an energy."""

    def require_own(self) -> None:
        """Refuse remains of another recipe; raises ValueError."""

    def forget(self) -> None:
        """Remove remains of an earlier call."""

    def steps(self) -> Iterator[Progress]:
        """Continue to the end, resuming an earlier call."""

    def landscape(self) -> Landscape:
        """Landscape of the packing."""

    def state(self) -> State:
        """Return the initial state of the search for an energy."""

    def measured(self) -> dict[str, Any]:
        """Return results specific to this way."""

    def done(self) -> None:
        """Remove files not needed beside a finished packing."""


@dataclass(eq=False)
class SearchFile:
    """File of a search for an energy, for resuming after a kill."""

    path: Path
    recipe: Recipe
    minimisations: int = 0
    """Number so far."""

    def read(self, landscape: Landscape) -> Search | None:
        """Read the search, if it belongs to this recipe; the landscape continues its count."""
        remove_leftovers(self.path)  # a resumed run may end without writing the file again
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
        """Remove the file, and remains of a killed process."""
        remove_run(self.path)
        remove_leftovers(self.path)


def lead(
    landscape: Landscape, start: State, target: Target, file: SearchFile
) -> Generator[Progress, None, Minimum]:
    """Relax a state at an energy, resuming from the file; errors as in `target.direct`.

    The search is that of the recipe's way (`SEARCHES`). It ends when its steps become too
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
        As the search, or after `MOST_MINIMISATIONS`.
    """
    search = file.read(landscape) or Search(start, target.step)
    # Resuming repeats everything since the last written state, so each is written once.
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
    """Stop a search that takes too long; its state stays in its file."""
    if file.minimisations >= MOST_MINIMISATIONS:
        msg = (
            f"after {file.minimisations} minimisations the search is at u ="
            f" {search.history.energy_density[-1]:.3g}, expected u = {target.u0:.3g}; use a"
            " start nearer to jamming, or the direct search"
        )
        raise TargetError(msg)


def _searching(search: Search, landscape: Landscape, target: Target, last: float) -> Progress:
    """Return the progress of a search; `last` is u before its last step."""
    phi = float(landscape.particles.measures.sum()) / search.state.volume
    u, residual = search.history.energy_density[-1], search.history.residual[-1]
    ratio = f"u/u0 {u / target.u0:.3g}" if u > 0 else "unjammed"
    text = f"u {u:.2e}, {ratio}, residual {residual:.1e} of {target.tolerance:.0e}"
    text += f", step {search.step:.1e}{_steps_left(u, last, target)}"
    return Progress("search", f"search for u0 = {target.u0:g}", phi, u, text)


def _steps_left(u: float, last: float, target: Target) -> str:
    """Estimate the number of equal steps down to u0, from sqrt(u), which is linear in the strain."""
    if not target.u0 < u < last:
        return ""
    now, before, aim = map(math.sqrt, (u, last, target.u0))
    return f", about {math.ceil((now - aim) / (before - now))} more of it"


def write_states(
    path: Path, states: list[State], like: Packing, attributes: Mapping[str, Any]
) -> None:
    """Write states as the frames of one file, which is replaced when complete."""
    write_frames(path, [state.packing(like) for state in states], attributes)


def stored_of(path: Path, recipe: Recipe) -> dict[str, Any] | None:
    """Read the attributes that an earlier call with this recipe has written, if any."""
    stored = read_attributes(path) if path.exists() else {}
    own = recipe.attributes()
    return stored if stored and all(stored.get(k) == v for k, v in own.items()) else None
