"""The recorder: writes rows, frames and checkpoints of any driver, and resumes any interrupted run.

During a run nothing else touches its file. The file is locked before it is read, and replaced as a whole at
checkpoints, whose distance follows their cost, so that they take less than a fiftieth of the run. A killed run
computes again what came after its last checkpoint, to the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import closing, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from jamshape.checks import ArgumentError, TimeLimitError
from jamshape.files.checkpoint import Checkpoint
from jamshape.files.content import Content
from jamshape.files.disk import remove_leftovers
from jamshape.files.hdf5 import FileFormatError
from jamshape.files.lock import Lock
from jamshape.files.vocabulary import KIND
from jamshape.recording.driver import Driver, Plan, Row
from jamshape.recording.interrupts import Interrupts

PAUSE = 100.0
"""Time between two checkpoints, over that of writing one."""

SECONDS = 1.0
"""Least time between two checkpoints, [seconds]."""


class How(NamedTuple):
    """Arguments of recording that every run has."""

    again: bool = False
    """Begin anew, whatever the file holds."""
    seconds: float | None = None
    """Time after which the run stops at the next mark, [seconds]."""
    tell: Callable[[Row], None] = lambda _: None
    """Receives every row, once it is safe where a checkpoint was due."""


_USUAL = How()


def record(path: Path | None, plan: Plan, how: How = _USUAL) -> None:
    """Record a run to its end, or resume it; a finished one remains unchanged.

    Parameters
    ----------
    path : path or None
        The file; with None nothing is written, and only the `finish` of the plan learns the results.
    plan : Plan
    how : How

    Raises
    ------
    ValueError
        If the file holds another run.
    TimeLimitError
        If `how.seconds` are over before the end; the file holds all that is needed to resume.
    FileFormatError
        If the file cannot be read as a run.
    OSError
        If another process writes the file, or it cannot be written.
    """
    end = math.inf if how.seconds is None else perf_counter() + how.seconds
    # A noted signal is raised again when the lock is released.
    with Interrupts() as interrupts, nullcontext() if path is None else Lock(path):
        run = _Run(None, plan.begin(), plan.finish) if path is None else _opened(path, plan, how)
        if run is None:
            return
        with closing(run.driver):
            _follow(run, interrupts, how, end)


@dataclass
class _Run:
    """A run in progress."""

    content: Content | None
    """None if nothing is to be written."""
    driver: Driver
    finish: Callable[[Driver], None] | None
    due: float = field(default_factory=lambda: perf_counter() + SECONDS)
    """Time at which a checkpoint is due."""

    def add(self, row: Row) -> None:
        """Keep a row, and the frame that belongs to it."""
        content = self.content
        if content is None:
            return
        content.add_row(row.step, row.time, row.observables or {})
        if row.error is not None:
            content.report.append((row.step, row.wall_seconds, row.error))
        if row.has_frame:
            content.add_frame(self.driver.frame())

    def store(self, checkpoint: Checkpoint | None) -> None:
        """Write the file, which is finished without a checkpoint."""
        if self.content is None:
            return
        began = perf_counter()
        self.content.attributes |= dict(self.driver.results()) | {"finished": checkpoint is None}
        self.content.checkpoint = checkpoint
        self.content.write()
        now = perf_counter()
        self.due = now + max(SECONDS, PAUSE * (now - began))


def _follow(run: _Run, interrupts: Interrupts, how: How, end: float) -> None:
    """Advance to the end, or to the mark at which the run stops after a time."""
    content, driver = run.content, run.driver
    if (first := driver.first()).told.part is not None:
        how.tell(first)
    while not driver.done:
        row = driver.advance()
        run.add(row)
        stops = interrupts.noted is not None or perf_counter() >= end
        is_mark = driver.at_mark and not driver.done
        if content and is_mark and (stops or perf_counter() >= run.due):
            run.store(driver.checkpoint())
        how.tell(row)
        if not (is_mark and stops):
            continue
        if interrupts.noted is not None:
            return  # raised again outside
        raise TimeLimitError(stopped(f"at {row.told.text}", how, content.path if content else None))
    if run.finish is None:
        run.store(None)
        return
    run.finish(driver)
    if content:
        content.path.unlink(missing_ok=True)


def stopped(where: str, how: How, path: Path | None = None) -> str:
    """Return the message that the time was up; only with a file the run can be resumed."""
    said = f"stopped after {how.seconds:.3g} s {where}, expected the end"
    if path is None:
        return f"{said}; with a file the same call resumes it"
    return f"{path}: {said}; the same command resumes"


def _opened(path: Path, plan: Plan, how: How) -> _Run | None:
    """Begin a run, or resume that of a file; None if that is finished."""
    remove_leftovers(path)
    content = None if how.again or not path.exists() else Content.read(path)
    if content is None:
        return _begun(path, plan)
    require_same(content, plan)
    return None if content.attributes["finished"] else _resumed(content, plan)


def _begun(path: Path, plan: Plan) -> _Run:
    """Begin a run; its file keeps the start, and shows at once whether it can be written."""
    driver = plan.begin()
    settings = {name: value for name, value in plan.settings.items() if value is not None}
    content = Content(path, [driver.frame()], {KIND: plan.kind, **settings})
    run = _Run(content, driver, plan.finish)
    run.add(driver.first()._replace(error=None, has_frame=False))
    if plan.finish is None:
        run.store({})
    return run


def _resumed(content: Content, plan: Plan) -> _Run:
    """Resume from the checkpoint of a file."""
    checkpoint, content.checkpoint = content.checkpoint, None
    try:
        if checkpoint is not None:
            driver = plan.restore(content.frames[0], checkpoint)
            return _Run(content, driver, plan.finish)
        cause = None
    except (KeyError, TypeError) as error:  # a number is missing, or of another kind
        cause = error
    msg = (
        f"{content.path} holds {plan.what} that was interrupted in another version of jamshape, expected one with a"
        " checkpoint of this version; use again to replace it"
    )
    raise FileFormatError(msg) from cause


def require_same(content: Content, plan: Plan) -> None:
    """Refuse the file of another run.

    Raises
    ------
    ArgumentError
    """
    advice = "choose another {file:name}, or use {again} to replace it"
    given = {"file": content.path, "again": True}
    stored, path = content.attributes, str(content.path).replace("{", "{{").replace("}", "}}")
    if "dimension" not in stored and content.frames:  # slow runs of earlier versions
        stored = {**stored, "dimension": content.frames[0].dimension}
    if stored.get(KIND) != plan.kind or "finished" not in stored:
        said = f"{path} does not hold {plan.what}, expected one; {advice}"
        raise ArgumentError(said, given)
    for name, value in plan.settings.items():
        if name in _LATER and name not in stored:
            continue
        if not _is_same(stored.get(name), value):
            argument = plan.arguments.get(name, _LATER.get(name, name))
            said = (
                f"{path} holds {plan.what} with {{{argument}}}, expected {_Shown(value)}; {advice}"
            )
            raise ArgumentError(said, {argument: _Shown(stored.get(name)), **given})


_LATER = {"start_digest": "start"}
"""Settings that files of earlier versions lack, with their arguments."""


class _Shown:
    """A stored value in a message."""

    def __init__(self, value: Any) -> None:
        self._value = value

    def __repr__(self) -> str:
        """Return it on one line."""
        return " ".join(str(self._value).split())


def _is_same(stored: Any, value: Any) -> bool:
    if stored is None or value is None:
        return stored is value
    return np.array_equal(stored, value)
