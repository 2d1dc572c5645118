"""What both ways to a packing share: progress, and the search for an energy in a file."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jamshape.files.h5md import read_attributes, read_packing, write_frames
from jamshape.files.journal import remove_run
from jamshape.landscape import Landscape
from jamshape.minima import Minimum
from jamshape.minima.target import Search, Target, direct
from jamshape.packing import Packing, State
from jamshape.protocols.recipe import Recipe


@dataclass(frozen=True)
class Progress:
    """Where the making of a packing is."""

    stage: str
    phi: float
    energy_density: float
    residual: float


@dataclass(eq=False)
class SearchFile:
    """The file of a search for an energy, from which it goes on after a kill."""

    path: Path
    recipe: Recipe

    def read(self) -> Search | None:
        """Read the search, if it is there and of this recipe."""
        if not self.path.exists():
            return None
        stored = read_attributes(self.path)
        if not _same(stored, self.recipe.attributes()):
            return None
        opening = int(stored["opening"])
        return Search(
            state=State.of(read_packing(self.path, 1)),
            step=float(stored["search_step"]),
            loose=State.of(read_packing(self.path, 0)) if stored["has_loose"] else None,
            loose_in_a_row=int(stored["loose_in_a_row"]),
            opening=None if opening < 0 else bool(opening),
        )

    def write(self, search: Search, like: Packing) -> None:
        """Write a search between two minimisations: its states are two frames."""
        attributes = self.recipe.attributes() | {
            "search_step": search.step,
            "loose_in_a_row": search.loose_in_a_row,
            "opening": -1 if search.opening is None else int(search.opening),
            "has_loose": search.loose is not None,
        }
        write_states(self.path, [search.loose or search.state, search.state], like, attributes)

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
    search = file.read() or Search(start, target.step)
    area = float(landscape.particles.measures.sum())
    for at in direct(landscape, search, target):
        if at.minimum is None:
            file.write(at, landscape.particles)
        history = at.history
        phi = area / at.state.volume
        yield Progress("search", phi, history.energy_density[-1], history.residual[-1])
    assert search.minimum is not None
    return search.minimum


def write_states(
    path: Path, states: list[State], like: Packing, attributes: Mapping[str, Any]
) -> None:
    """Write states as the frames of one file, which replaces the one that is there when it is whole."""
    write_frames(path, [state.packing(like) for state in states], attributes)


def _same(stored: Mapping[str, Any], expected: Mapping[str, Any]) -> bool:
    return all(stored.get(name) == value for name, value in expected.items())
