"""Bars that say how far a run is, in terminals and notebooks, and where runs without a file live."""

from __future__ import annotations

import shutil
import tempfile
import warnings
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

_Step = TypeVar("_Step")


class Bar(NamedTuple):
    """What a bar says."""

    unit: str
    total: int | None = None
    begun: int = 0
    """How much of it was done before."""


def follow(
    steps: Iterator[_Step],
    bar: Bar,
    told: Callable[[_Step], tuple[int | None, str]],
    *,
    shown: bool = True,
) -> None:
    """Go through all steps of a run, showing a bar on standard error.

    Parameters
    ----------
    steps : iterator
    bar : Bar
    told : callable
        Says of a step how much is done, or None to count steps, and what to write beside the bar.
    shown : bool
        Whether there is a bar at all.
    """
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore"
        )  # tqdm's word on notebooks without widgets; it writes text there
        from tqdm.auto import tqdm  # noqa: PLC0415 - not needed without a run

    settings: dict[str, Any] = {"mininterval": 1, "disable": not shown}
    with tqdm(total=bar.total, initial=bar.begun, unit=bar.unit, **settings) as line:
        for step in steps:
            done, text = told(step)
            line.set_postfix_str(text, refresh=False)
            line.update(1 if done is None else done - line.n)


class Folder:
    """A temporary folder that goes with the last who holds this."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="jamshape-"))
        self._end = weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


class Place(NamedTuple):
    """A file, and the folder that goes when nobody needs it any more."""

    path: Path
    folder: Folder | None = None


def place(file: str | Path | None, name: str) -> Place:
    """Make room for a file; without one, in a folder of its own that goes with the result."""
    if file is None:
        folder = Folder()
        return Place(folder.path / name, folder)
    path = Path(file)
    path.parent.mkdir(parents=True, exist_ok=True)
    return Place(path)
