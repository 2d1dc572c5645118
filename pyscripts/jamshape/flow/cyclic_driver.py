"""Cyclic shear in LAMMPS as a driver."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.files.checkpoint import Checkpoint
from jamshape.flow import lammps_driver, motion
from jamshape.flow.cyclic_shear import QUARTERS, CyclicShear
from jamshape.flow.lammps_driver import LammpsDriver, Sizes
from jamshape.recording.driver import Plan, Row

if TYPE_CHECKING:
    from jamshape.packing import Box, Packing


def plan(
    start: Callable[[], Packing], settings: CyclicShear, sizes: Sizes, made_from: Mapping[str, Any]
) -> Plan:
    """Plan a cyclic shear; parameters as in `lammps_driver.plan`, rows of a cycle and frames of the whole run."""
    if sizes.rows % QUARTERS or settings.steps_per_cycle % sizes.rows:
        msg = (
            f"rows is {sizes.rows} in a cycle of {settings.steps_per_cycle} steps, expected a multiple of 4 that"
            " divides them"
        )
        raise ValueError(msg)
    return lammps_driver.plan(start, settings, sizes, made_from, CyclicDriver)


class CyclicDriver(LammpsDriver):
    """A cyclic shear in LAMMPS; parameters as in `LammpsDriver`.

    It has marks where the rate changes its sign, too.
    """

    def __init__(
        self,
        first: Packing,
        settings: CyclicShear,
        sizes: Sizes,
        checkpoint: Checkpoint | None = None,
    ) -> None:
        self._cycle = settings
        begun_at = checkpoint["begun_at"] if checkpoint else None
        super().__init__(first, settings, sizes, checkpoint)
        self._begun_at = self._in_host(self._run.packing()) if begun_at is None else begun_at

    @staticmethod
    def _spacing(settings: CyclicShear, sizes: Sizes, first: Packing) -> tuple[int, int]:
        """Return the numbers of steps between rows and between frames."""
        del first
        cycle = settings.steps_per_cycle
        return cycle // sizes.rows, cycle * max(1, settings.cycles // sizes.frames)

    def advance(self) -> Row:
        """Run to the next row; there, end a cycle or reverse the rate."""
        row = super().advance()
        if row.step % self._cycle.steps_per_cycle == 0:
            self._begun_at = self._in_host(self._run.packing())
        if self._cycle.turns_at(row.step):
            self._run.steer()
            self.at_mark, self._marked = True, self._run.measure()["evaluations"]
        return row

    def checkpoint(self) -> Checkpoint:
        """Return that of a flow, and where particles were when the cycle began."""
        return super().checkpoint() | {"begun_at": self._begun_at}

    def _row(self, sample: motion.Row) -> Row:
        """Add the position in the cycles, the displacement, and powers over the volume."""
        found, packing = sample.observables, self._run.packing()
        found["cycle"] = sample.step / self._cycle.steps_per_cycle
        for name in ("dissipation", "torque_power"):
            found[name] /= packing.box.volume
        moved = self._in_host(packing, self._cycle.strained(found)) - self._begun_at
        found["displacement"] = float((moved**2).sum(axis=1).mean())
        return super()._row(sample)

    def _in_host(self, packing: Packing, strain: float = 0.0) -> FloatArray:
        """(N, D) positions as at strain 0, if particles moved with the host, from the point at rest.

        Of a box that yields, they are those in the box of the start.
        """
        box = packing.box
        found = packing.position + packing.image @ box.matrix.T - box.center
        if self._cycle.hold_pressure is not None:
            return np.asarray(found @ np.linalg.inv(self._deformation(box, strain)).T)
        if self._cycle.flow == "simple":
            found[:, 0] -= strain * found[:, 1]
        else:
            found[:, :2] *= np.exp([-strain, strain])
        return found

    def _deformation(self, box: Box, strain: float) -> FloatArray:
        """(D, D) deformation of a box whose height yields, since the start, whatever its cell vectors."""
        start = self._first.box
        found = np.eye(box.dimension)
        found[1, 1] = box.edges[1] / start.edges[1]
        tilted = box.tilt[0] - start.tilt[0]
        # The second cell vector may have become the sum of itself and several of the first.
        others = np.rint((strain * box.edges[1] - tilted) / box.edges[0])
        found[0, 1] = (tilted + others * box.edges[0]) / start.edges[1]
        return found
