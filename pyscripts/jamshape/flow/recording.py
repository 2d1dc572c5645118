"""Compressions in files: a run of `jamshape.flow.compression` recorded in H5MD, which goes on after a kill."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from jamshape.checks import require_stated
from jamshape.files.h5md import (
    read_attributes,
    read_observables,
    read_packing,
    read_series,
    read_style,
    require_attributes,
)
from jamshape.files.run_writer import RunWriter
from jamshape.flow.compression import Compression, CompressionRun, Row
from jamshape.measures.onset import fit_onset
from jamshape.measures.runs import rate_of
from jamshape.packing import Packing

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from jamshape.lammps.session import Session


_SUMMARY = ("phi", "pressure", "z", "S_2", "S_4")


@dataclass(frozen=True)
class Recording:
    """What a compression leaves in its H5MD file.

    Parameters
    ----------
    path
        The file; until the run is finished restart files lie beside it, as ``path.restart.a`` and ``.b``.
    rows, frames
        How many samples of the observables and how many snapshots, over the whole run.
    attributes
        Stored with the run, beside its settings: what made the initial state.

    Raises
    ------
    ValueError
        If a number is out of its range.
    """

    path: Path
    rows: int = 400
    frames: int = 20
    attributes: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_stated(rows=self.rows, frames=self.frames)

    @property
    def restart_prefix(self) -> Path:
        """Path of the restart files without their last letter."""
        return self.path.with_name(self.path.name + ".restart")

    def newest_restart(self) -> Path:
        """Find the last restart file of a run that was killed.

        Raises
        ------
        FileNotFoundError
            When there is none.
        """
        paths = self._restart_files()
        found = [path for path in paths if path.is_file()]
        if not found:
            msg = f"Found neither {paths[0]} nor {paths[1].name}, expected one: start anew."
            raise FileNotFoundError(msg)
        return max(found, key=lambda path: path.stat().st_mtime)

    def forget_restarts(self) -> None:
        """Remove the restart files, which a finished run does not need."""
        for path in self._restart_files():
            path.unlink(missing_ok=True)

    def _restart_files(self) -> list[Path]:
        return [Path(f"{self.restart_prefix}.{end}") for end in "ab"]


def is_finished(path: Path) -> bool:
    """Whether the file holds a compression that reached its end."""
    return path.exists() and bool(read_attributes(path).get("finished"))


def require_same(to: Recording, settings: Compression, dimension: int) -> None:
    """Refuse the file of another run.

    Raises
    ------
    ValueError
    """
    if "finished" not in read_attributes(to.path):
        msg = (
            f"{to.path} holds no compression, expected one; write to another file, or make it again"
        )
        raise ValueError(msg)
    expected = dataclasses.asdict(settings) | dict(to.attributes)
    require_attributes(to.path, expected | {"rows": to.rows, "frames": to.frames}, "a compression")
    found = read_style(to.path)[1]
    if found != dimension:
        msg = (
            f"{to.path} holds a compression in {found} dimensions, expected {dimension};"
            " write to another file, or make it again"
        )
        raise ValueError(msg)


def begin(session: Session, settings: Compression, start: Packing, to: Recording) -> CompressionRun:
    """Start a compression and its file."""
    run = CompressionRun(session, settings, start)
    to.forget_restarts()  # of another run, which was cut off and is begun anew
    attributes = dataclasses.asdict(settings) | dict(to.attributes)
    attributes |= {"phi_start": start.phi, "rows": to.rows, "frames": to.frames, "finished": False}
    attributes["left_out"] = session.left_out()
    RunWriter.create(to.path, run.packing(), attributes, run.measure())
    return run


def resume(session: Session, path: Path) -> tuple[CompressionRun, Recording]:
    """Go on with a compression that was killed, from its last restart file, as it was set."""
    stored = read_attributes(path)
    names = {f.name for f in dataclasses.fields(Compression)} & set(stored)
    settings = Compression(**{name: stored[name] for name in names})
    to = Recording(path, stored["rows"], stored["frames"])
    run = CompressionRun(session, settings, read_packing(path, 0), to.newest_restart())
    RunWriter.open(path).truncate(session.step)
    return run, to


def record(run: CompressionRun, to: Recording) -> Iterator[Row]:
    """Run to the end and yield each sample, which is in the file within about a second.

    What a restart file goes on from is there before it: all samples before its step.
    """
    writer = RunWriter.open(to.path)
    whole = run.settings.steps(float(read_attributes(to.path)["phi_start"]), writer.first.dimension)
    every = max(1, whole // to.rows)
    per_frame = every * max(1, to.rows // to.frames)
    run.keep_restarts(per_frame, to.restart_prefix)
    rows = _Rows(writer, "local_error" if run.settings.chooses_steps else "step_error")

    def keep(sample: Row) -> Row:
        rows.add(sample)
        is_frame = sample.step % per_frame == 0 or sample.step == run.last_step
        if is_frame or rows.is_late or (sample.step + every) % per_frame == 0:
            rows.write()
        if is_frame:
            writer.append(run.packing())
        return sample

    # A restart file is older than the row of its step, which a kill may have cut off.
    if run.session.step > read_series(to.path, "pressure").step[-1]:
        yield keep(run.sample())
    for sample in run.samples(every):
        yield keep(sample)
    rows.write()
    writer.set_attributes({"finished": True})
    to.forget_restarts()


class _Rows:
    """Samples on their way to the file: to open it for each one would take longer than small runs do."""

    _SECONDS = 1.0

    def __init__(self, writer: RunWriter, error: str) -> None:
        self._writer, self._error = writer, error
        self._rows: list[Row] = []
        self._written = perf_counter()

    @property
    def is_late(self) -> bool:
        """Whether the last ones have waited long enough."""
        return perf_counter() - self._written > self._SECONDS

    def add(self, row: Row) -> None:
        self._rows.append(row)

    def write(self) -> None:
        """Write what is there."""
        rows, self._rows, self._written = self._rows, [], perf_counter()
        if rows:
            steps, times = [row.step for row in rows], [row.time for row in rows]
            columns = {k: [row.observables[k] for row in rows] for k in rows[0].observables}
            self._writer.append_series(steps, times, columns)
            self._writer.append_report(
                steps, [row.wall_seconds for row in rows], columns[self._error]
            )


def summary_of(path: Path) -> dict[str, object]:
    """Summarise a run: its end, its rate and, where the pressure rises, phi_J of that rate."""
    observables, stored = read_observables(path), read_attributes(path)
    names = [name for name in _SUMMARY if name in observables]  # slow runs count no contacts
    last: dict[str, object] = {name: float(observables[name][-1]) for name in names}
    last |= {"kappa": rate_of(stored), "left_out": stored.get("left_out", "")}
    try:
        fit = fit_onset(observables["phi"], observables["pressure"])
    except ValueError:  # the run ends below jamming
        return {"out": str(path), **last, "phi_J": None}
    return {"out": str(path), **last, "phi_J": fit.phi_J, "phi_J_error": fit.phi_J_error}
