"""Quasistatic shear as a driver: every step is a mark, since its minimisation depends on the state alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from jamshape.files.checkpoint import Checkpoint
from jamshape.flow import quasistatic
from jamshape.flow.quasistatic import QuasistaticShear, Sheared
from jamshape.landscape import Landscape, State
from jamshape.packing import Packing
from jamshape.recording.driver import Plan, Row, Told

MOST_STEPS_PER_FRAME = 50
"""Largest number of steps between frames."""

_ROW = tuple(
    name for name in quasistatic.Row._fields if name not in {"step", "wall_seconds", "residual"}
)
_COUNTS = (
    *(
        "steps",
        "u",
        "stress",
        "pressure",
        "volume",
        "strain",
        "flows",
        "evaluations",
        "wall_seconds",
    ),
)


_ARGUMENTS = {
    "strain_step": "step",
    "strain_end": "strain",
    "phi_sheared": "phi",
    "hold_pressure": "pressure",
}


def plan(
    start: Callable[[], Packing], how: QuasistaticShear, frames: int, made_from: Mapping[str, Any]
) -> Plan:
    """Plan a quasistatic shear with about a number of frames; the start has two bonds side to side."""

    def begin() -> QuasistaticDriver:
        packing = start()
        # Images would count cell vectors that no longer exist.
        none = np.zeros_like(packing.image)
        first = packing.with_(law=packing.law.but(sides=2), step=0, time=0.0, image=none)
        return QuasistaticDriver(first, how, frames, Sheared(State.of(first)))

    def restore(first: Packing, checkpoint: Checkpoint) -> QuasistaticDriver:
        if not checkpoint:
            return QuasistaticDriver(first, how, frames, Sheared(State.of(first)))
        counts = {name: checkpoint[name] for name in _COUNTS}
        return QuasistaticDriver(first, how, frames, Sheared(checkpoint["state"], **counts))

    settings = how.settings | dict(made_from) | {"frames": frames}
    return Plan("quasistatic shear", "a quasistatic shear", settings, begin, restore, _ARGUMENTS)


class QuasistaticDriver:
    """A quasistatic shear.

    Parameters
    ----------
    first : Packing
        The first frame; the second is its minimum, from which steps count.
    how : QuasistaticShear
    frames : int
    run : Sheared
        Initial or resumed state.
    """

    at_mark = True

    def __init__(self, first: Packing, how: QuasistaticShear, frames: int, run: Sheared) -> None:
        self._first, self._how, self._run = first, how, run
        self._landscape = Landscape(first)
        known = how.steps if not how.stress_step else frames
        self._per_frame = max(1, min(MOST_STEPS_PER_FRAME, known // frames))

    @property
    def done(self) -> bool:
        """Whether the final strain is reached."""
        return self._how.is_over(self._run)

    def first(self) -> Row:
        """Return the progress at the start."""
        return Row(self._told(f"strain {self._run.strain:.4f}"))

    def advance(self) -> Row:
        """Minimise the start, or shear by a step and minimise."""
        row = quasistatic.advance(self._landscape, self._run, self._how)
        observables = {name: getattr(row, name) for name in _ROW}
        end = f"{self._how.cycles} cycles" if self._how.cycles else f"{self._how.strain_end:g}"
        text = f"strain {row.strain:.4f} of {end}, stress {row.stress:.2e}, pressure {row.pressure:.2e}"
        turns = self._how.cycles > 0 and row.step % self._how.quarter == 0
        return Row(
            self._told(text), row.step + 1, row.strain, observables, row.wall_seconds, row.residual,
            has_frame=row.step % self._per_frame == 0 or turns or self.done,
        )  # fmt: skip

    def frame(self) -> Packing:
        """Return the present state; its time is the strain."""
        run = self._run
        return run.state.packing(self._first).with_(step=run.steps + 1, time=run.strain)

    def checkpoint(self) -> Checkpoint:
        """Return the state and all counts."""
        return {"state": self._run.state} | {name: getattr(self._run, name) for name in _COUNTS}

    def results(self) -> dict[str, Any]:
        """Return the law, and counts so far."""
        found = self._first.law.stated()
        return found | {f"shear_{name}": getattr(self._run, name) for name in _COUNTS}

    def close(self) -> None:
        """Nothing is held outside of Python."""

    def _told(self, text: str) -> Told:
        run, how = self._run, self._how
        part = run.strain / how.strain_end if how.stress_step else max(0, run.steps) / how.steps
        return Told("quasistatic shear", text, min(1.0, part))
