"""The whole path of one sample: compress, find the packing at u0, measure and store it.

Marschall & Teitel 2018, Sec. III B-C. Between its stages everything is in files beside the result, so
that a path that was cut off goes on where it was.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.contacts import coordination, find_contacts, find_rattlers
from jamshape.files.h5md import (
    RunWriter,
    read_attributes,
    read_observables,
    read_packing,
    require_attributes,
    write_packing,
)
from jamshape.flow.compression import CompressionRun, Row
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape, State
from jamshape.measures.contact_statistics import contact_scale, residuals
from jamshape.measures.onset import OnsetFit, fit_onset
from jamshape.minima.minimise import History, Minimum, Outcome, residual_of, rounding_floor
from jamshape.minima.target import Search, Target, direct, require_reachable
from jamshape.packing import Packing
from jamshape.protocols.approach import Approach, approach, begin_approach, resume_approach
from jamshape.protocols.random_start import Mixture, random_packing

# Rows of the convergence history that are kept in a packing's file.
_REPORT_ROWS = 2000

_ROWS_PER_RESTART = 50

_SUMMARY = (
    *("alpha", "n", "seed", "outcome", "phi", "phi_J", "phi_J_compression", "phi_J_opening"),
    *("u", "p", "residual_force", "residual_torque", "rounding_floor", "z", "z_single"),
    *("n_rattlers", "evaluations", "wall_seconds"),
)

_NOT_STORED = {"approach", "target", "mixture"}

_SHAPE_STYLE = "spherocylinder"

_REACHED = (Outcome.CONVERGED, Outcome.SLIDING)


@dataclass(frozen=True)
class Sample:
    """What a packing is made of.

    Parameters
    ----------
    n, alpha, size_ratio, seed
        Bidisperse spherocylinders, 1:1, of equal alpha = A / R; the seed is that of the random start.
    phi_start
        Packing fraction of the random start.
    approach, target
        How to compress, and what to look for.
    mixture
        Other particles than these.
    """

    n: int = 256
    alpha: float = 4.0
    size_ratio: float = 1.4
    seed: int = 1
    phi_start: float = 0.4
    approach: Approach = field(default_factory=Approach)
    target: Target = field(default_factory=Target)
    mixture: Mixture | None = None

    def start(self) -> Packing:
        """Make the random start; errors as `initial.random_packing`."""
        mixture = self.mixture or Mixture.bidisperse(self.alpha, self.size_ratio)
        return random_packing(self.n, self.phi_start, self.seed, mixture)

    def attributes(self) -> dict[str, Any]:
        """Return what identifies it, to be stored."""
        found = {k: v for k, v in vars(self.target).items() if k != "step"}
        return self.compression() | found | {"step": self.target.step}

    def compression(self) -> dict[str, Any]:
        """Return what identifies its compression, whatever the target."""
        found = {k: v for k, v in vars(self).items() if k not in _NOT_STORED}
        found |= {f"approach_{k}": v for k, v in vars(self.approach).items()}
        return found | {"kappa": self.approach.kappa, "mixture": self.mixture is not None}


@dataclass(frozen=True)
class Progress:
    """Where a path is."""

    stage: str
    phi: float
    energy_density: float
    residual: float


class Files:
    """Files beside the result of one sample: the compression and the search, as far as they are."""

    def __init__(self, out: Path) -> None:
        self.run = out.with_name(out.name + ".run.h5")
        self.search = out.with_name(out.name + ".search.h5")

    def restart(self, step: int) -> Path:
        """LAMMPS restart file of the compression at that step."""
        return self.run.with_suffix(f".restart{step}")

    def forget_restarts(self, but: int | None = None) -> None:
        """Remove all restart files, or all but one."""
        for path in self.run.parent.glob(self.run.with_suffix(".restart*").name):
            if but is None or path != self.restart(but):
                path.unlink()


def is_done(out: Path) -> bool:
    """Whether the file is there, with a finished packing.

    Raises
    ------
    ValueError
        If it is there with anything else.
    """
    if not out.exists():
        return False
    if "outcome" not in read_attributes(out):
        msg = (
            f"{out} holds no finished packing, expected one of make_packing.py;"
            " write to another file, or remove this one"
        )
        raise ValueError(msg)
    return True


def make(sample: Sample, out: Path, *, again: bool = False) -> Iterator[Progress]:
    """Make a packing and write it to `out`, going on with what an earlier call has left.

    Parameters
    ----------
    sample : Sample
    out : Path
        Replaced when the packing is found.
    again : bool
        Replace the compression of another sample, or a damaged one, too.

    Yields
    ------
    Progress
        After every row of the compression and every minimisation of the search.

    Raises
    ------
    TargetError
        As `target.direct`.
    ValueError
        As `initial.random_packing` and `target.direct`, or if another sample was being made there.
    """
    began, files = time.perf_counter(), Files(out)
    if files.run.exists():
        try:
            _require_compression(files.run, sample)
        except ValueError:
            if not again:
                raise
            files.run.unlink()
    if not is_compressed(files.run):
        require_reachable(Landscape(sample.start()), sample.target)
        yield from _compress(sample, files)
    start = read_packing(files.run)
    landscape = Landscape(start)
    search = _stored_search(files.search, sample) or Search(State.of(start), sample.target.step)
    for _ in direct(landscape, search, sample.target):
        if search.minimum is None:
            _store_search(files.search, search, start, sample)
        state, history = search.state, search.history
        phi = start.phi * start.box.volume / state.volume
        yield Progress("search", phi, history.energy_density[-1], history.residual[-1])
    assert search.minimum is not None
    attributes = sample.attributes() | _onset(files.run)
    attributes["wall_seconds"] = time.perf_counter() - began
    attributes["evaluations"] = landscape.evaluations
    write_minimum(out, landscape, search.minimum, attributes)
    files.search.unlink(missing_ok=True)


def require_same(out: Path, sample: Sample) -> None:
    """Refuse a finished packing that is another one than asked for; errors as below."""
    require_attributes(out, sample.attributes())
    _require_particles(out, sample)


def _require_compression(run: Path, sample: Sample) -> None:
    """Refuse the compression of another sample."""
    require_attributes(run, sample.compression(), "the compression of a packing")
    _require_particles(run, sample)


def _require_particles(path: Path, sample: Sample) -> None:
    """Refuse a file that is damaged or holds other particles than the sample's."""
    packing = read_packing(path)
    found = f"{path} holds {packing.n} particles of shape {packing.shape_style!r}"
    if packing.shape_style != _SHAPE_STYLE or packing.n != sample.n:
        msg = f"{found}, expected {sample.n} of {_SHAPE_STYLE!r}; write to another file"
        raise ValueError(msg)
    if sample.mixture and not np.array_equal(packing.diameters, sample.start().diameters):
        msg = f"{found}, expected those of another mixture; write to another file"
        raise ValueError(msg)


def is_compressed(run: Path) -> bool:
    """Whether the file holds a compression that reached its end."""
    return run.exists() and bool(read_attributes(run).get("finished"))


def _compress(sample: Sample, files: Files) -> Iterator[Progress]:
    with Session() as session:
        run, writer = _resumed(session, files) or _begun(session, sample, files)
        rows: list[Row] = []
        for row in approach(run, sample.approach):
            rows.append(row)
            if len(rows) == _ROWS_PER_RESTART:
                run.write_restart(files.restart(row.step))
                _write_rows(writer, rows)
                rate = {"rate": run.settings.kappa, "dt": run.settings.dt}
                writer.set_attributes({"restart_step": row.step, "restart_time": row.time, **rate})
                files.forget_restarts(but=row.step)
            found = row.observables
            yield Progress("compression", found["phi"], found["u"], found["fmax"])
        _write_rows(writer, rows)
        writer.append(run.packing())
    writer.set_attributes({"finished": True})
    files.forget_restarts()


def _write_rows(writer: RunWriter, rows: list[Row]) -> None:
    """Write the rows and forget them."""
    if rows:
        columns = {name: [row.observables[name] for row in rows] for name in rows[0].observables}
        writer.append_series([row.step for row in rows], [row.time for row in rows], columns)
        rows.clear()


def _begun(session: Session, sample: Sample, files: Files) -> tuple[CompressionRun, RunWriter]:
    run = begin_approach(session, sample.start(), sample.approach)
    attributes = sample.attributes() | {"finished": False, "restart_step": -1}
    return run, RunWriter.create(files.run, run.packing(), attributes)


def _resumed(session: Session, files: Files) -> tuple[CompressionRun, RunWriter] | None:
    if not files.run.exists():
        return None
    stored = read_attributes(files.run)
    restart = files.restart(stored.get("restart_step", -1))
    if not restart.exists():
        return None
    run = resume_approach(session, restart, stored)
    writer = RunWriter.open(files.run)
    writer.truncate(session.step)
    return run, writer


def _same(stored: Mapping[str, Any], expected: Mapping[str, Any]) -> bool:
    return all(stored.get(name) == value for name, value in expected.items())


def _onset(run: Path) -> dict[str, float]:
    """phi_J from p(phi) (Marschall & Teitel 2018, Fig. 4), closing and opening; NaN if none."""
    observables = read_observables(run)
    rising = observables["kappa"] > 0
    found: dict[str, float] = {}
    for name, rows in (("compression", rising), ("opening", ~rising)):
        order = np.argsort(observables["phi"][rows])
        phi, p = (observables[key][rows][order] for key in ("phi", "p"))
        try:
            fit = fit_onset(phi, p)
        except ValueError:
            fit = OnsetFit(np.nan, np.nan, np.nan, 0, 0)
        found |= {f"phi_J_{name}": fit.phi_J, f"phi_J_{name}_error": fit.phi_J_error}
    return found


def _store_search(path: Path, search: Search, like: Packing, sample: Sample) -> None:
    """Write a search between two minimisations: its states are two frames of one file."""
    attributes = sample.attributes() | {
        "search_step": search.step,
        "loose_in_a_row": search.loose_in_a_row,
        "opening": -1 if search.opening is None else int(search.opening),
        "has_loose": search.loose is not None,
    }
    states = [search.loose or search.state, search.state]
    frames = [s.packing(like).with_(step=k) for k, s in enumerate(states)]
    temporary = path.with_name(path.name + ".new")
    writer = RunWriter.create(temporary, frames[0], attributes)
    writer.append(frames[1])
    temporary.replace(path)


def _stored_search(path: Path, sample: Sample) -> Search | None:
    if not path.exists():
        return None
    stored = read_attributes(path)
    if not _same(stored, sample.attributes()):
        return None
    opening = int(stored["opening"])
    return Search(
        state=State.of(read_packing(path, 1)),
        step=float(stored["search_step"]),
        loose=State.of(read_packing(path, 0)) if stored["has_loose"] else None,
        loose_in_a_row=int(stored["loose_in_a_row"]),
        opening=None if opening < 0 else bool(opening),
    )


def write_minimum(
    path: Path, landscape: Landscape, minimum: Minimum, attributes: Mapping[str, Any]
) -> None:
    """Write a packing with everything that was measured on it."""
    packing = minimum.state.packing(landscape.particles)
    measured, observables = measure(landscape, minimum)
    write_packing(path, packing, dict(attributes) | measured, observables)
    steps, seconds, errors = thinned(minimum.history)
    RunWriter.open(path).append_report(steps, seconds, errors)


def measure(
    landscape: Landscape, minimum: Minimum
) -> tuple[dict[str, float | str], dict[str, FloatArray]]:
    """Measure a minimum: attributes and observables of its file."""
    packing = minimum.state.packing(landscape.particles)
    network = find_contacts(packing, landscape.k_e, landscape.sides)
    rattlers = find_rattlers(packing, network)
    counts = coordination(packing, network)
    evaluation, D = minimum.evaluation, packing.dimension
    over_bond = landscape.components(evaluation.gradient) / max(evaluation.bond_force, 1e-300)
    over_bond[rattlers] = 0.0
    largest = np.sqrt((over_bond[:, :D] ** 2).sum(axis=1)).max(), np.abs(over_bond[:, D:]).max()
    u = minimum.energy_density
    pressure = -evaluation.strain_gradient / (D * minimum.state.volume)
    attributes: dict[str, float | str] = {
        "outcome": minimum.outcome.value,
        "phi": packing.phi,
        "phi_J": energy_onset(packing.phi, u, pressure),
        "u": u,
        "p": pressure,
        "residual_force": float(largest[0]),
        "residual_torque": float(largest[1]),
        "residual": residual_of(landscape, evaluation).largest,
        "rounding_floor": rounding_floor(evaluation, landscape),
        **counts._asdict(),
    }
    observables = {"rattler_ids": packing.id[rattlers].astype(np.float64)}
    if counts.n_contacts and D == 2:
        gradient = landscape.components(evaluation.gradient)
        torque = gradient[:, D] * landscape.rotation_length
        scale = contact_scale(packing, network, rattlers)
        net = residuals(gradient[:, :D], torque, scale, rattlers)
        observables |= {"net_force": net.force, "net_torque": net.torque}
    return attributes, observables


def energy_onset(phi: float, u: float, pressure: float) -> float:
    """Phi where sqrt(u), linear in phi, vanishes: du/dphi = p / phi - u / phi at fixed particles.

    u = U / V and dU/dV = -p; with V = const / phi, d sqrt(u)/dphi = (p + u) / (2 phi sqrt(u)).
    """
    return phi - 2 * phi * u / (pressure + u) if u > 0 else math.nan


def thinned(history: History) -> tuple[list[int], list[float], list[float]]:
    """Pick rows of a history for a report: evaluations, seconds, residuals."""
    rows = np.unique(np.linspace(0, len(history.residual) - 1, _REPORT_ROWS).astype(int))
    picked = zip(
        *((history.evaluations[r], history.wall_seconds[r], history.residual[r]) for r in rows),
        strict=True,
    )
    steps, seconds, errors = map(list, picked)
    return steps, seconds, errors


def summary(out: Path) -> dict[str, Any]:
    """Summarise a finished packing."""
    return summary_of(out, _SUMMARY)


def summary_of(out: Path, names: Iterable[str]) -> dict[str, Any]:
    """Pick attributes of a finished packing, None for NaN, and say whether it is in equilibrium."""
    stored = read_attributes(out)
    found = {name: stored[name] for name in names if name in stored}
    tidy = {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in found.items()}
    return {"out": str(out), **tidy, "reached": stored["outcome"] in {o.value for o in _REACHED}}
