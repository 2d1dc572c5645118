"""Flows in files: a run of `jamshape.flow.motion` recorded in H5MD, resumed after a kill."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jamshape.checks import require_stated
from jamshape.files.h5md import (
    FileFormatError,
    read_attributes,
    read_observables,
    read_series,
    read_style,
    require_attributes,
)
from jamshape.files.restarts import RestartFiles
from jamshape.files.run_writer import RunWriter, fold
from jamshape.flow.compression import Compression
from jamshape.flow.motion import FlowRun, Motion, Row
from jamshape.flow.shear import Shear
from jamshape.measures.runs import onset_report
from jamshape.packing import Packing

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from jamshape.lammps.session import Session


_SUMMARY = ("phi", "pressure", "z", "S_2", "S_4")


@dataclass(frozen=True)
class Recording:
    """Settings of the recording of a run in an H5MD file.

    Parameters
    ----------
    path
        The file; until the run is finished restart files lie beside it, as ``path.restart.a`` and ``.b``, and its journal.
    rows, frames
        Numbers of samples of the observables and of snapshots over the whole run.
    attributes
        Further attributes to store: the origin of the initial state.

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
    def restarts(self) -> RestartFiles:
        """The restart files."""
        return _restarts_of(self.path)


def _restarts_of(path: Path) -> RestartFiles:
    return RestartFiles(path.with_name(path.name + ".restart"))


def tidy(path: Path) -> None:
    """Remove what a kill at the very end of a run has left beside its file: its journal and restart files.

    Raises
    ------
    FileFormatError, OSError
        As `RunWriter`.
    """
    fold(path)
    _restarts_of(path).forget()


def is_finished(path: Path) -> bool:
    """Whether the file holds a run that reached its end."""
    return path.exists() and bool(read_attributes(path).get("finished"))


def require_same(to: Recording, settings: Motion, dimension: int) -> None:
    """Refuse the file of another run.

    Raises
    ------
    ValueError
    """
    what = f"a {settings.name}"
    if "finished" not in read_attributes(to.path):
        msg = f"{to.path} holds no {settings.name}, expected one; write to another file, or use again to replace it"
        raise ValueError(msg)
    expected = dataclasses.asdict(settings) | dict(to.attributes)
    require_attributes(to.path, expected | {"rows": to.rows, "frames": to.frames}, what)
    found = read_style(to.path)[1]
    if found != dimension:
        msg = (
            f"{to.path} holds {what} in {found} dimensions, expected {dimension};"
            " write to another file, or use again to replace it"
        )
        raise ValueError(msg)


def begin(session: Session, settings: Motion, start: Packing, to: Recording) -> FlowRun[Motion]:
    """Start a run and its file."""
    run = FlowRun(session, settings, start)
    to.restarts.forget()  # of another run, interrupted, and started over
    first = run.measure()
    run.write_restart(to.restarts.next())
    attributes = dataclasses.asdict(settings) | dict(to.attributes)
    attributes |= {"phi_start": start.phi, "rows": to.rows, "frames": to.frames, "finished": False}
    attributes |= {"left_out": session.left_out(), "lammps_version": session.version}
    RunWriter.create(to.path, run.packing(), attributes, first).close()
    return run


def settings_of(stored: Mapping[str, Any]) -> Motion:
    """Read the settings of a run from the attributes of its file."""
    kind = Shear if "gdot" in stored else Compression
    names = {f.name for f in dataclasses.fields(kind)} & set(stored)
    return kind(**{name: stored[name] for name in names})


def resume(session: Session, path: Path) -> tuple[FlowRun[Motion], Recording]:
    """Resume a killed run from its newest whole restart file, with its settings.

    Without any it starts over from its first frame.

    Raises
    ------
    FileFormatError
        If rows between the last one and the restart file are not there.
    """
    stored = read_attributes(path)
    to, settings = Recording(path, stored["rows"], stored["frames"]), settings_of(stored)
    with RunWriter.open(path) as writer:
        run = FlowRun(session, settings, writer.first, to.restarts.newest())
        last = int(read_series(path, "pressure").step[-1])
        if session.step > last + _every(run, to, writer.first):
            msg = (
                f"{path}: has rows up to step {last}, expected those up to step {session.step} of its"
                " restart file; bring its journal back beside it, or use again to replace it"
            )
            raise FileFormatError(msg)
        writer.truncate(session.step)
    counted = read_observables(path).get("evaluations")
    if counted is not None:
        run.count_from(float(counted[-1]))
    return run, to


def record(run: FlowRun[Motion], to: Recording) -> Iterator[Row]:
    """Run to the end and yield each sample, which is in the file by then.

    The file holds all samples up to the step of a restart file before that is written.
    """
    last = read_series(to.path, "pressure").step[-1]
    with RunWriter.open(to.path) as writer:
        every = _every(run, to, writer.first)
        per_frame = every * max(1, to.rows // to.frames)

        def keep(sample: Row) -> Row:
            _write_row(writer, sample)
            is_last = sample.step == run.last_step
            if is_last or sample.step % per_frame == 0:
                writer.append(run.packing())
            if not is_last and sample.step % per_frame == 0:
                run.write_restart(to.restarts.next())
            return sample

        # A restart file of an earlier version is older than the row of its step.
        if run.session.step > last:
            yield keep(run.sample())
        for sample in run.samples(every):
            yield keep(sample)
        writer.set_attributes({"finished": True})
    to.restarts.forget()


def _every(run: FlowRun[Motion], to: Recording, first: Packing) -> int:
    """Count the steps from row to row."""
    return max(1, run.settings.all_steps(first) // to.rows)


def _write_row(writer: RunWriter, row: Row) -> None:
    found = row.observables
    error = found["local_error" if "local_error" in found else "step_error"]
    writer.append_observables(row.step, row.time, found, (row.wall_seconds, error))


def summary_of(path: Path) -> dict[str, object]:
    """Summarise a run: its end, its rate, phi_J(kappa) where the pressure rises, and where frames stay jammed."""
    observables, stored = read_observables(path), read_attributes(path)
    names = [name for name in _SUMMARY if name in observables]  # slow runs count no contacts
    last: dict[str, object] = {name: float(observables[name][-1]) for name in names}
    return {"out": str(path), **last, "left_out": stored.get("left_out", "")} | onset_report(path)
