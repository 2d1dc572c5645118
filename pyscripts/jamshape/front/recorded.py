"""Record runs into files, and resume interrupted ones."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from jamshape.arguments import checked
from jamshape.checks import require_given, require_path
from jamshape.files.h5md import FileFormatError, read_attributes
from jamshape.files.vocabulary import ENSEMBLE, KIND
from jamshape.flow import cyclic_driver, implicit_driver, lammps_driver, quasistatic_driver
from jamshape.flow.compression import Compression
from jamshape.flow.cyclic_shear import CyclicShear
from jamshape.flow.motion import Motion
from jamshape.flow.quasistatic import QuasistaticShear
from jamshape.flow.shear import Shear
from jamshape.front.ensemble_file import EnsembleFile
from jamshape.front.progress import display
from jamshape.front.run import (
    CyclicShearFile,
    LadderFile,
    QuasistaticShearFile,
    Recorded,
    RunFile,
    ShearFile,
)
from jamshape.packing import Packing
from jamshape.protocols import ensemble, ladder
from jamshape.protocols.approach import FOR_A_PACKING
from jamshape.protocols.ladder import Ladder
from jamshape.protocols.make import MAKING
from jamshape.recording.driver import Plan
from jamshape.recording.recorder import How, record


class Kind(NamedTuple):
    """A kind of files of runs."""

    opens: type[Recorded]
    """Class of the run."""
    plan_of: Callable[[Mapping[str, Any]], Plan | None] | None = None
    """Makes a plan from the attributes of a file; None if they are incomplete, as of parts of a packing."""


def recorded(path: Path, plan: Plan, *, again: bool, seconds: float | None, progress: bool) -> None:
    """Record or resume a run, showing progress; errors as `record`, and warnings as `resume`."""
    require_path(path)
    require_given(seconds=seconds)
    with display(shown=progress) as tell:
        record(path, plan, How(again, seconds, lambda row: tell(row.told)))
    run_file(path).warn_unless_reached()


@checked
def resume(file: str | Path, *, seconds: float | None = None, progress: bool = True) -> Recorded:
    """Resume an interrupted run with its settings; load a finished one.

    Parameters
    ----------
    file : path
        File of `compress`, `slow_compress`, `shear`, `cyclic_shear`, `quasistatic_shear`, `ladder` or `ensemble`; one of
        particles with a distribution of their own needs the call that began it.
    seconds, progress
        See `compress`.

    Returns
    -------
    RunFile, ShearFile, CyclicShearFile, QuasistaticShearFile, LadderFile or EnsembleFile

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
    plan_of = kind_of(path).plan_of
    plan = plan_of and plan_of(stored)
    if plan is None:
        msg = f"{path} is of the kind {stored[KIND]}, expected a run that its file describes alone; repeat the call that began it"
        raise FileFormatError(msg)
    plan = dataclasses.replace(plan, settings={})
    recorded(path, plan, again=False, seconds=seconds, progress=progress)
    return run_file(path)


def run_file(path: Path, folder: Any = None) -> Recorded:
    """Open a run's file as the class of its kind; errors as `kind_of`."""
    return kind_of(path).opens(path, folder)


def kind_of(path: Path) -> Kind:
    """Look up the kind of a run in a file.

    Raises
    ------
    FileFormatError
        If it holds none.
    """
    if kind := KINDS.get(str(read_attributes(path).get(KIND))):
        return kind
    msg = (
        f"{path} holds no run, expected a file of compress, slow_compress, shear, cyclic_shear,"
        " quasistatic_shear, ladder or ensemble"
    )
    raise FileFormatError(msg)


def _no_start() -> Packing:
    """Stand for a start that is in the file."""
    raise AssertionError


def _plan_in_lammps(kind: type[Motion], stored: Mapping[str, Any]) -> Plan:
    sizes = lammps_driver.Sizes(int(stored["rows"]), int(stored["frames"]))
    settings = _of_fields(kind, stored)
    if kind is CyclicShear:
        return cyclic_driver.plan(_no_start, settings, sizes, {})
    return lammps_driver.plan(_no_start, settings, sizes, {})


def _plan_implicit(stored: Mapping[str, Any]) -> Plan:
    return implicit_driver.plan(_no_start, implicit_driver.course_of(stored), {})


def _plan_quasistatic(stored: Mapping[str, Any]) -> Plan:
    how = QuasistaticShear.of(stored)
    return quasistatic_driver.plan(_no_start, how, int(stored["frames"]), {})


def _plan_ladder(stored: Mapping[str, Any]) -> Plan:
    return ladder.plan(_no_start, Ladder.of(stored), {})


def _of_fields(kind: type[Any], stored: Mapping[str, Any]) -> Any:
    """Make settings from the attributes of their names."""
    names = {field.name for field in dataclasses.fields(kind)} & stored.keys()
    return kind(**{name: stored[name] for name in names})


KINDS: dict[str, Kind] = {
    "compression": Kind(RunFile, partial(_plan_in_lammps, Compression)),
    "shear": Kind(ShearFile, partial(_plan_in_lammps, Shear)),
    "cyclic shear": Kind(CyclicShearFile, partial(_plan_in_lammps, CyclicShear)),
    "slow compression": Kind(RunFile, _plan_implicit),
    "slow shear": Kind(ShearFile, _plan_implicit),
    "quasistatic shear": Kind(QuasistaticShearFile, _plan_quasistatic),
    "ladder": Kind(LadderFile, _plan_ladder),
    ENSEMBLE: Kind(EnsembleFile, ensemble.plan_again),
    FOR_A_PACKING: Kind(RunFile),
    MAKING: Kind(RunFile),
}
"""Kinds of runs by the attribute `kind` of their files, see `recording.driver.Plan`; packings have none."""
