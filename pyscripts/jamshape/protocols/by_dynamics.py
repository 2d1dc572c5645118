"""Packings from slow compression in LAMMPS (Marschall & Teitel 2018, Sec. III B-C)."""

from __future__ import annotations

import glob
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.files.h5md import read_attributes, read_observables, read_packing, require_attributes
from jamshape.files.journal import remove_run
from jamshape.files.restarts import is_whole
from jamshape.files.run_writer import RunWriter, fold
from jamshape.flow.compression import CompressionRun
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
_OF_RESTART = ("restart_step", "restart_time", "rate", "dt")


class ByDynamics:
    """A compression in LAMMPS and its files beside the target packing.

    Parameters
    ----------
    recipe : Recipe
    out : Path
        Path of the packing.
    """

    minimum: Minimum | None = None

    def __init__(self, recipe: Recipe, out: Path) -> None:
        assert isinstance(recipe.way, Dynamics)
        self.recipe, self.approach = recipe, recipe.way.approach
        self.run_file = out.with_name(out.name + ".run.h5")
        self._newest: dict[str, float] = {}

    def forget(self) -> None:
        """Remove remains of an earlier call."""
        remove_run(self.run_file)
        self._forget_restarts()

    def require_own(self) -> None:
        """Raise if the compression belongs to another recipe.

        Raises
        ------
        ValueError
        """
        if self.run_file.exists():
            expected = self.recipe.before_target()
            require_attributes(self.run_file, expected, "the compression of a packing")
            self.recipe.require_particles(self.run_file)

    def steps(self) -> Iterator[Progress]:
        """Compress, resuming an earlier call."""
        if is_compressed(self.run_file):
            fold(self.run_file)
            self._forget_restarts()  # left by a kill after the end
            return
        if self.recipe.target:
            require_reachable(Landscape(self.recipe.start()), self.recipe.target)
        with Session() as session:
            run = self._resumed(session) or self._begun(session)
            with RunWriter.open(self.run_file) as writer:
                for count, row in enumerate(approach(run, self.approach), start=1):
                    writer.append_observables(row.step, row.time, row.observables)
                    if count % _ROWS_PER_RESTART == 0:
                        self._keep(run, writer)
                    yield self._progress(row.observables)
                writer.append(run.packing())
                writer.set_attributes({"finished": True})
        self._forget_restarts()

    def _progress(self, found: Mapping[str, float]) -> Progress:
        """Return the pressure and the rate, with their targets."""
        pressure, rate, aim = found["pressure"], found["kappa"], self.approach
        where = (found["phi"], found["u"])
        if rate < 0:
            text = f"pressure {pressure:.2e} down to {aim.p_open:.0e}"
            return Progress("compression", "opening of the box", *where, text)
        text = f"pressure {pressure:.2e} up to {aim.p_end:.0e} at rate {rate:.1e} down to {aim.kappa:.0e}"
        return Progress("compression", "compression", *where, text)

    def landscape(self) -> Landscape:
        """Landscape of the packing."""
        return Landscape(read_packing(self.run_file))

    def state(self) -> State:
        """Return the initial state of the search for the energy."""
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
        """Keep the run, which serves searches for other energies."""

    def _restart(self, step: int) -> Path:
        return self.run_file.with_suffix(f".restart{step}")

    def _forget_restarts(self, *but: int) -> None:
        """Remove all restart files, except some."""
        kept = [self._restart(step) for step in but]
        name = glob.escape(self.run_file.with_suffix(".restart").name)
        for path in self.run_file.parent.glob(f"{name}*"):
            if path not in kept:
                path.unlink()

    def _keep(self, run: CompressionRun, writer: RunWriter) -> None:
        """Write a restart file, and keep the previous one."""
        run.write_restart(self._restart(run.session.step))
        older, self._newest = self._newest, _of_restart(run)
        writer.set_attributes(self._newest | {f"older_{k}": v for k, v in older.items()})
        self._forget_restarts(run.session.step, int(older["restart_step"]))

    def _begun(self, session: Session) -> CompressionRun:
        self._forget_restarts()
        run = begin_approach(session, self.recipe.start(), self.approach)
        run.write_restart(self._restart(run.session.step))
        self._newest = _of_restart(run)
        attributes = self.recipe.attributes() | {"finished": False} | self._newest
        attributes["lammps_version"] = session.version
        RunWriter.create(self.run_file, run.packing(), attributes).close()
        return run

    def _resumed(self, session: Session) -> CompressionRun | None:
        """Resume from the newest complete restart file, if any."""
        if not self.run_file.exists():
            return None
        stored = read_attributes(self.run_file)
        older = {name: stored.get(f"older_{name}") for name in _OF_RESTART}
        for of in (stored, older):
            step = of.get("restart_step")
            if step is not None and is_whole(self._restart(int(step))):
                return self._gone_on(session, of)
        return None

    def _gone_on(self, session: Session, of: Mapping[str, Any]) -> CompressionRun:
        step = int(of["restart_step"])
        with RunWriter.open(self.run_file) as writer:
            run = resume_approach(session, self._restart(step), writer.first, of)
            writer.truncate(step)
        self._newest = {name: float(of[name]) for name in _OF_RESTART}
        counted = read_observables(self.run_file).get("evaluations")
        if counted is not None and len(counted):  # none before the first row
            run.count_from(float(counted[-1]))
        return run


def _of_restart(run: CompressionRun) -> dict[str, float]:
    """Return the state that restart files lack."""
    settings = run.settings
    return {
        "restart_step": run.session.step,
        "restart_time": run.time,
        "rate": settings.kappa,
        "dt": settings.dt,
    }


def is_compressed(run: Path) -> bool:
    """Whether the file holds a finished compression."""
    return run.exists() and bool(read_attributes(run).get("finished"))
