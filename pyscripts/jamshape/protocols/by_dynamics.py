"""The way to a packing through a slow compression in LAMMPS (Marschall & Teitel 2018, Sec. III B-C)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.files.h5md import (
    read_attributes,
    read_observables,
    read_packing,
    require_attributes,
)
from jamshape.files.run_writer import RunWriter
from jamshape.flow.compression import CompressionRun, Row
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape
from jamshape.measures.onset import OnsetFit, fit_onset
from jamshape.minima import Minimum
from jamshape.minima.target import require_reachable
from jamshape.packing import State
from jamshape.protocols.approach import approach, begin_approach, resume_approach
from jamshape.protocols.making import Progress
from jamshape.protocols.recipe import Dynamics, Recipe

_ROWS_PER_RESTART = 50


class ByDynamics:
    """A compression in LAMMPS and its files beside the packing that is to be made.

    Parameters
    ----------
    recipe : Recipe
    out : Path
        Of the packing.
    """

    minimum: Minimum | None = None

    def __init__(self, recipe: Recipe, out: Path) -> None:
        assert isinstance(recipe.way, Dynamics)
        self.recipe, self.approach = recipe, recipe.way.approach
        self.run_file = out.with_name(out.name + ".run.h5")

    def forget(self) -> None:
        """Remove what an earlier call has left."""
        self.run_file.unlink(missing_ok=True)
        self._forget_restarts()

    def require_own(self) -> None:
        """Refuse the compression of another recipe.

        Raises
        ------
        ValueError
        """
        if self.run_file.exists():
            expected = self.recipe.before_target()
            require_attributes(self.run_file, expected, "the compression of a packing")
            self.recipe.require_particles(self.run_file)

    def steps(self) -> Iterator[Progress]:
        """Compress, going on with what an earlier call has left."""
        if is_compressed(self.run_file):
            return
        if self.recipe.target:
            require_reachable(Landscape(self.recipe.start()), self.recipe.target)
        with Session() as session:
            run, writer = self._resumed(session) or self._begun(session)
            rows: list[Row] = []
            for row in approach(run, self.approach):
                rows.append(row)
                if len(rows) == _ROWS_PER_RESTART:
                    self._keep(run, writer, rows)
                found = row.observables
                yield Progress("compression", found["phi"], found["u"], found["fmax"])
            _write_rows(writer, rows)
            writer.append(run.packing())
        writer.set_attributes({"finished": True})
        self._forget_restarts()

    def landscape(self) -> Landscape:
        """Landscape of the packing."""
        return Landscape(read_packing(self.run_file))

    def state(self) -> State:
        """Where the search for the energy begins."""
        return State.of(read_packing(self.run_file))

    def measured(self) -> dict[str, Any]:
        """phi_J from p(phi) (Marschall & Teitel 2018, Fig. 4), closing and opening; NaN if none."""
        observables = read_observables(self.run_file)
        rising = observables["kappa"] > 0
        found: dict[str, Any] = {}
        for name, rows in (("compression", rising), ("opening", ~rising)):
            order = np.argsort(observables["phi"][rows])
            phi, p = (observables[key][rows][order] for key in ("phi", "pressure"))
            try:
                fit = fit_onset(phi, p)
            except ValueError:
                fit = OnsetFit(np.nan, np.nan, np.nan, 0, 0)
            found |= {f"phi_J_{name}": fit.phi_J, f"phi_J_{name}_error": fit.phi_J_error}
        return found

    def done(self) -> None:
        """Keep the run, from which other energies may be looked for."""

    def _restart(self, step: int) -> Path:
        return self.run_file.with_suffix(f".restart{step}")

    def _forget_restarts(self, but: int | None = None) -> None:
        """Remove all restart files, or all but one."""
        for path in self.run_file.parent.glob(self.run_file.with_suffix(".restart*").name):
            if but is None or path != self._restart(but):
                path.unlink()

    def _keep(self, run: CompressionRun, writer: RunWriter, rows: list[Row]) -> None:
        last = rows[-1]
        run.write_restart(self._restart(last.step))
        _write_rows(writer, rows)
        rate = {"rate": run.settings.kappa, "dt": run.settings.dt}
        writer.set_attributes({"restart_step": last.step, "restart_time": last.time, **rate})
        self._forget_restarts(but=last.step)

    def _begun(self, session: Session) -> tuple[CompressionRun, RunWriter]:
        run = begin_approach(session, self.recipe.start(), self.approach)
        attributes = self.recipe.attributes() | {"finished": False, "restart_step": -1}
        return run, RunWriter.create(self.run_file, run.packing(), attributes)

    def _resumed(self, session: Session) -> tuple[CompressionRun, RunWriter] | None:
        if not self.run_file.exists():
            return None
        stored = read_attributes(self.run_file)
        restart = self._restart(stored.get("restart_step", -1))
        if not restart.exists():
            return None
        like = read_packing(self.run_file, 0)
        run = resume_approach(session, restart, like, stored)
        writer = RunWriter.open(self.run_file)
        writer.truncate(session.step)
        return run, writer


def is_compressed(run: Path) -> bool:
    """Whether the file holds a compression that reached its end."""
    return run.exists() and bool(read_attributes(run).get("finished"))


def _write_rows(writer: RunWriter, rows: list[Row]) -> None:
    """Write the rows and forget them."""
    if rows:
        columns = {name: [row.observables[name] for row in rows] for name in rows[0].observables}
        writer.append_series([row.step for row in rows], [row.time for row in rows], columns)
        rows.clear()
