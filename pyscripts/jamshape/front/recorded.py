"""Record runs into files, and resume interrupted ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from jamshape.arguments import checked
from jamshape.checks import require_path
from jamshape.files.h5md import FileFormatError, read_attributes, read_packing
from jamshape.flow import quasistatic, quasistatic_recording, recording, slow_recording
from jamshape.flow.implicit import Step
from jamshape.flow.motion import FlowRun, Motion, Row
from jamshape.flow.recording import Recording
from jamshape.flow.slow_shear import SlowShear
from jamshape.front.progress import Told, follow
from jamshape.front.run import Recorded, run_file
from jamshape.lammps.session import Session


@checked
def resume(file: str | Path, *, progress: bool = True) -> Recorded:
    """Resume an interrupted run with its settings; load a finished one.

    Parameters
    ----------
    file : path
        File of `compress`, `slow_compress`, `shear` or `quasistatic_shear`.
    progress : bool
        Whether to show progress on standard error.

    Returns
    -------
    RunFile, ShearFile or QuasistaticShearFile

    Raises
    ------
    FileFormatError, OSError
        If it is not such a file, or cannot be read.

    Warns
    -----
    NotReachedWarning
        If the run did not reach its goal: force balance after each step of a quasistatic shear, or the pressure
        ``p_end`` of a slow compression.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=4)
    >>> run = js.compress(rods, n=24, phi=(0.4, 0.95), kappa=1e-3, file="run.h5", progress=False)
    >>> js.resume("run.h5").about["finished"]
    True
    """
    path = Path(file)
    stored = read_attributes(path)
    if "finished" not in stored or not stored.keys() & {"rows", *_OTHERS}:
        msg = f"{path} holds no run, expected a file of compress, slow_compress, shear or quasistatic_shear"
        raise FileFormatError(msg)
    if not stored.get("finished"):
        record = next((record for mark, record in _OTHERS.items() if mark in stored), None)
        if record:
            record(path, progress)
        else:
            require_path(path)
            to = Recording(path, stored["rows"], stored["frames"])
            record_flow(lambda session: recording.resume(session, path)[0], to, progress)
    recording.tidy(path)
    run = run_file(path)
    run.warn_unless_reached()
    return run


def record_flow(start: Callable[[Session], FlowRun[Motion]], to: Recording, progress: bool) -> None:
    """Run to the end in LAMMPS; `start` makes the run in a session."""
    with Session() as session:
        run = start(session)
        told = _told(run.settings, float(read_attributes(to.path)["phi_start"]))
        begun = told(run.sample()).part
        follow(recording.record(run, to), told, shown=progress, begun=begun or 0.0)


def _told(settings: Motion, phi_start: float) -> Callable[[Row], Told]:
    """Return a function that reports the completed fraction of the strain."""

    def told(row: Row) -> Told:
        found = row.observables
        text = f"{settings.where(found)}, pressure {found['pressure']:.2e}"
        return Told(settings.name, text, settings.part(found, phi_start))

    return told


def _record_slowly(path: Path, progress: bool) -> None:
    stored = read_attributes(path)
    course = slow_recording.course_of(stored)
    if isinstance(course, SlowShear):
        told, begun = _of_shear(course), float(stored["flow_strain"]) / course.strain_end
    else:
        told, begun = _of_compression(stored, read_packing(path).phi)
    follow(slow_recording.record(path), told, shown=progress, begun=begun)


def _of_compression(stored: Mapping[str, Any], phi: float) -> tuple[Callable[[Step], Told], float]:
    """Return a function that reports progress of a slow compression, and the fraction completed at phi."""
    first, end = float(stored["phi_start"]), float(stored["phi_end"])
    until = f" or {stored['p_end']:.3g}" if math.isfinite(stored["p_end"]) else ""

    def part_at(phi: float) -> float:
        return min(1.0, (phi - first) / (end - first))

    def told(step: Step) -> Told:
        where = f"phi {step.phi:.6f} of {end:g}, pressure {step.pressure:.3e}{until}"
        return Told("slow compression", f"{where}, step {step.dt:.1e}", part_at(step.phi))

    return told, part_at(phi)


def _of_shear(course: SlowShear) -> Callable[[Step], Told]:
    def told(step: Step) -> Told:
        where = f"strain {step.strain:.5f} of {course.strain_end:g}, pressure {step.pressure:.3e}"
        part = min(1.0, step.strain / course.strain_end)
        return Told("slow shear", f"{where}, step {step.dt:.1e}", part)

    return told


def _record_steps(path: Path, progress: bool) -> None:
    stored = read_attributes(path)
    end = float(stored["strain_end"])

    def told(row: quasistatic.Row) -> Told:
        text = f"strain {row.strain:.4f} of {end:g}, stress {row.stress:.2e}, pressure {row.pressure:.2e}"
        return Told("quasistatic shear", text, row.strain / end)

    begun = max(0, int(stored["shear_steps"])) * float(stored["strain_step"]) / end
    follow(quasistatic_recording.record(path), told, shown=progress, begun=min(1.0, begun))


_OTHERS: dict[str, Callable[[Path, bool], None]] = {
    "flow_steps": _record_slowly,
    "shear_steps": _record_steps,
}
"""Functions that resume runs outside LAMMPS, by an attribute that only these have."""
