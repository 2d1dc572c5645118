"""Record runs into files, and resume interrupted ones."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jamshape.arguments import checked
from jamshape.checks import require_given, require_path
from jamshape.files.h5md import FileFormatError, read_attributes
from jamshape.flow import cyclic_driver, implicit_driver, lammps_driver, quasistatic_driver
from jamshape.flow.cyclic_shear import CyclicShear
from jamshape.flow.quasistatic import QuasistaticShear
from jamshape.front.progress import display
from jamshape.front.run import Recorded, run_file
from jamshape.packing import Packing
from jamshape.protocols import ladder
from jamshape.protocols.ladder import Ladder
from jamshape.recording.driver import Plan
from jamshape.recording.recorder import How, record


def recorded(path: Path, plan: Plan, *, again: bool, seconds: float | None, progress: bool) -> None:
    """Record a run, or go on with it, showing progress; errors as `record`, and warnings as `resume`."""
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
        File of `compress`, `slow_compress`, `shear`, `cyclic_shear`, `quasistatic_shear` or `ladder`.
    seconds, progress
        See `compress`.

    Returns
    -------
    RunFile, ShearFile, CyclicShearFile, QuasistaticShearFile or LadderFile

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
    plan = _plan_of(path, read_attributes(path))
    recorded(path, plan, again=False, seconds=seconds, progress=progress)
    return run_file(path)


def _plan_of(path: Path, stored: Mapping[str, Any]) -> Plan:
    """Return the plan of the run in a file, which has its own settings."""
    if "flow_steps" in stored:
        plan = implicit_driver.plan(_no_start, implicit_driver.course_of(stored), {})
    elif "shear_steps" in stored:
        how = QuasistaticShear.of(stored)
        plan = quasistatic_driver.plan(_no_start, how, int(stored["frames"]), {})
    elif "ladder_parameter" in stored:
        plan = ladder.plan(_no_start, Ladder.of(stored), {})
    elif {"finished", "rows", "frames"} <= stored.keys():
        sizes = lammps_driver.Sizes(int(stored["rows"]), int(stored["frames"]))
        settings = lammps_driver.settings_of(stored)
        of = cyclic_driver if isinstance(settings, CyclicShear) else lammps_driver
        plan = of.plan(_no_start, settings, sizes, {})
    else:
        msg = (
            f"{path} holds no run, expected a file of compress, slow_compress, shear, cyclic_shear,"
            " quasistatic_shear or ladder"
        )
        raise FileFormatError(msg)
    return dataclasses.replace(plan, settings={})


def _no_start() -> Packing:
    """Stand for a start that is in the file."""
    raise AssertionError
