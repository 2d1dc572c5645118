"""Flows in LAMMPS as a driver: compression and shear at a rate, by explicit steps."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from jamshape.checks import require_stated
from jamshape.files.checkpoint import Checkpoint
from jamshape.flow import motion
from jamshape.flow.motion import FlowRun, Motion
from jamshape.flow.shear import Shearing
from jamshape.lammps.session import Session
from jamshape.recording.driver import Plan, Row, Told

if TYPE_CHECKING:
    from jamshape.packing import Packing

EVALUATIONS_PER_MARK = 2000
"""Least number of evaluations of all forces between marks, next to which building neighbour lists anew is cheap."""


_ARGUMENTS = {"strain_end": "strain", "phi_sheared": "phi", "tolerance": "integration_tolerance",
              "hold_pressure": "pressure"}  # fmt: skip


def plan(
    start: Callable[[], Packing],
    settings: Motion,
    sizes: Sizes,
    made_from: Mapping[str, Any],
    kind: type[LammpsDriver] | None = None,
) -> Plan:
    """Plan a compression or a shear.

    Parameters
    ----------
    start
        Makes the initial state.
    settings
    sizes
        Numbers of rows and frames.
    made_from
        Attributes of the particles and the start.
    kind
        Class of the driver; by default `LammpsDriver`.
    """
    driver = kind or LammpsDriver

    def begin() -> LammpsDriver:
        own = start().sorted_by_id()
        law = own.law.but(settings.k_e, settings.sides)
        first = own.with_(law=law, step=0, time=0.0)
        settings.all_steps(first)  # refuses what does not end
        if isinstance(settings, Shearing) and (said := settings.warning(first)):
            warnings.warn(said, stacklevel=2)
        return driver(first, settings, sizes)

    def restore(first: Packing, checkpoint: Checkpoint) -> LammpsDriver:
        return driver(first, settings, sizes, checkpoint or None)

    told = dataclasses.asdict(settings) | dict(made_from) | dataclasses.asdict(sizes)
    told["dt"] = told.pop("dt")  # may follow from the others
    return Plan(settings.name, f"a {settings.name}", told, begin, restore, _ARGUMENTS)


@dataclasses.dataclass(frozen=True)
class Sizes:
    """Numbers of samples of the observables and of snapshots, over the whole run or as the driver says."""

    rows: int = 400
    frames: int = 20

    def __post_init__(self) -> None:
        require_stated(rows=self.rows, frames=self.frames)  # of files as well


class LammpsDriver:
    """A flow in LAMMPS.

    Parameters
    ----------
    first : Packing
        The initial state.
    settings : Motion
    sizes : Sizes
    checkpoint : Checkpoint, optional
        Checkpoint to resume from.
    """

    def __init__(
        self, first: Packing, settings: Motion, sizes: Sizes, checkpoint: Checkpoint | None = None
    ) -> None:
        self._every, self._per_frame = self._spacing(settings, sizes, first)
        self._first, self.at_mark = first, False
        self._marked = checkpoint["evaluations"] if checkpoint else 0.0
        self._kept: Checkpoint | None = None  # of the present mark
        self._is_over = False
        self._session = Session()
        try:
            self._run = FlowRun(self._session, settings, first, checkpoint)
        except BaseException:
            self._session.close()
            raise

    @staticmethod
    def _spacing(settings: Any, sizes: Sizes, first: Packing) -> tuple[int, int]:
        """Return the numbers of steps between rows and between frames."""
        every = max(1, settings.all_steps(first) // sizes.rows)
        return every, every * max(1, sizes.rows // sizes.frames)

    @property
    def done(self) -> bool:
        """Whether the final strain, packing fraction or pressure is reached."""
        return self._is_over or self._session.step >= self._run.last_step

    def first(self) -> Row:
        """Measure the state from which the run begins or resumes."""
        return self._row(self._run.sample())

    def advance(self) -> Row:
        """Run to the next row."""
        run = self._run
        if self.at_mark:
            self.checkpoint()
        self._kept = None
        run.advance(min(run.last_step, (self._session.step // self._every + 1) * self._every))
        sample = run.sample()
        evaluations = sample.observables["evaluations"]
        self.at_mark = evaluations - self._marked >= EVALUATIONS_PER_MARK
        if self.at_mark:
            self._marked = evaluations
        return self._row(sample)

    def _row(self, sample: motion.Row) -> Row:
        found, settings = sample.observables, self._run.settings
        self._is_over = settings.is_over(found)
        text = f"{settings.where(found)}, pressure {found['pressure']:.2e}"
        told = Told(settings.name, text, settings.part(found, self._first.phi))
        error = found["local_error" if "local_error" in found else "step_error"]
        has_frame = self.done or sample.step % self._per_frame == 0
        return Row(told, sample.step, sample.time, found, sample.wall_seconds, error, has_frame)

    def frame(self) -> Packing:
        """Return the present state; at the start as it was given to LAMMPS, to begin again with the same bits."""
        return self._run.packing() if self._session.step else self._first

    def checkpoint(self) -> Checkpoint:
        """Return a LAMMPS restart file and what it lacks."""
        self._kept = self._kept or self._run.mark()
        return self._kept

    def results(self) -> dict[str, Any]:
        """Return what LAMMPS left out, its version, the power of a law that is not harmonic, and times of a box that yields."""
        session = self._session
        own = {"left_out": session.left_out(), "lammps_version": session.version}
        law = {k: v for k, v in self._first.law.stated().items() if k == "power"}
        return own | law | self._run.times()

    def close(self) -> None:
        """End LAMMPS."""
        self._session.close()
