"""What all ways to a packing share: what each of them offers, progress, and the search for an energy in a file."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from jamshape.files.h5md import read_attributes, read_packing, write_frames
from jamshape.files.journal import remove_run
from jamshape.landscape import Landscape
from jamshape.minima import History, Minimum
from jamshape.minima.target import Search, Target, direct
from jamshape.packing import Packing, State
from jamshape.protocols.recipe import Recipe


@dataclass(frozen=True)
class Progress:
    """Where the making of a packing is.

    Parameters
    ----------
    stage
        "compression", "Monte Carlo" or "search".
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

    def read(self, landscape: Landscape) -> Search | None:
        """Read the search, if it is there and of this recipe; the landscape goes on counting."""
        if not self.path.exists():
            return None
        stored = read_attributes(self.path)
        if not _same(stored, self.recipe.attributes()):
            return None
        landscape.evaluations = int(stored.get("evaluations", 0))
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
        }
        states = [search.loose or search.state, search.state]
        write_states(self.path, states, landscape.particles, attributes)

    def forget(self) -> None:
        """Remove it."""
        remove_run(self.path)


def lead(
    landscape: Landscape, start: State, target: Target, file: SearchFile
) -> Generator[Progress, None, Minimum]:
    """Lead a state to an energy, going on with what is in the file; errors as `target.direct`.

    Yields
    ------
    Progress
        After each minimisation.

    Returns
    -------
    Minimum
    """
    search = file.read(landscape) or Search(start, target.step)
    area = float(landscape.particles.measures.sum())
    for at in direct(landscape, search, target):
        if at.minimum is None:
            file.write(at, landscape)
        history = at.history
        yield _searching(area / at.state.volume, history, target)
    assert search.minimum is not None
    return search.minimum


def _searching(phi: float, history: History, target: Target) -> Progress:
    u, residual = history.energy_density[-1], history.residual[-1]
    ratio = f"u/u0 {u / target.u0:.3g}" if u > 0 else "unjammed"
    text = f"u {u:.2e}, {ratio}, residual {residual:.1e} of {target.tolerance:.0e}"
    return Progress("search", f"search for u0 = {target.u0:g}", phi, u, text)


def write_states(
    path: Path, states: list[State], like: Packing, attributes: Mapping[str, Any]
) -> None:
    """Write states as the frames of one file, which replaces the one that is there when it is whole."""
    write_frames(path, [state.packing(like) for state in states], attributes)


def _same(stored: Mapping[str, Any], expected: Mapping[str, Any]) -> bool:
    return all(stored.get(name) == value for name, value in expected.items())
