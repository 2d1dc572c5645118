"""Interface of long calculations that are recorded, stopped and resumed.

A driver advances by steps or by bounded pieces of work. At its *marks*, which its settings fix, it drops caches, pair
lists, extrapolations and the order of atoms, whether or not a checkpoint is written there: what is computed does not
depend on what is written, and the continuation from a checkpoint is the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from numpy.typing import ArrayLike

from jamshape.files.checkpoint import Checkpoint
from jamshape.packing import Packing


class Told(NamedTuple):
    """Progress of a run."""

    phase: str
    """Name, such as ``compression``."""
    text: str
    """Current state."""
    part: float | None = None
    """Completed fraction of the phase, from 0 to 1; None if unknown."""
    aside: str | None = None
    """Note to print once."""


class Row(NamedTuple):
    """Record of one advance of a driver."""

    told: Told
    step: int = 0
    time: float = 0.0
    observables: Mapping[str, ArrayLike] | None = None
    """Numbers or arrays by name; None where there is nothing to record."""
    wall_seconds: float = 0.0
    error: float | None = None
    """Error of the step, for the convergence history; None without one."""
    has_frame: bool = False
    """Whether the state is recorded as well."""


class Driver(Protocol):
    """A calculation in progress."""

    @property
    def done(self) -> bool:
        """Whether the end is reached."""

    @property
    def at_mark(self) -> bool:
        """Whether `checkpoint` may be called now."""

    def first(self) -> Row:
        """Return what to record of the start, whose state is the first frame."""

    def advance(self) -> Row:
        """Do one step, or a bounded piece of work."""

    def frame(self) -> Packing:
        """Return the present state, with its step and time."""

    def checkpoint(self) -> Checkpoint:
        """Return all that is needed to resume from here."""

    def results(self) -> Mapping[str, Any]:
        """Return attributes for the file: counts so far, and at the end what was found."""

    def close(self) -> None:
        """Free what the driver holds outside of Python."""


@dataclass(frozen=True)
class Plan:
    """Settings of a run, and how to begin and to resume it.

    Parameters
    ----------
    kind
        Kind of its file, such as ``compression``: the attribute of that name, which `front.recorded` opens and resumes it by.
    what
        Name in messages, with its article, such as ``a compression``.
    settings
        Attributes that identify it: a file with others is refused, and so is one that has an attribute which is None here. Those that
        follow from others are the last.
    begin
        Makes the driver at its start.
    restore
        Makes the driver from the particles of the file, whose first frame they are, and a checkpoint, which is empty
        at the start.
    arguments
        Names of the arguments that settings of other names come from.
    finish
        Writes the results elsewhere at the end, when the file is not needed any more.
    """

    kind: str
    what: str
    settings: Mapping[str, Any]
    begin: Callable[[], Driver]
    restore: Callable[[Packing, Checkpoint], Driver]
    arguments: Mapping[str, str] = field(default_factory=dict)
    finish: Callable[[Driver], None] | None = None
