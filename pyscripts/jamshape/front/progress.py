"""Progress of long runs in terminals, notebooks and logs, and temporary files."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
import warnings
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from jamshape.checks import require_no_folder, require_one_process
from jamshape.files.disk import require_hdf5_name
from jamshape.recording.driver import Told

_Step = TypeVar("_Step")

_LOG_SECONDS = 10.0  # between two lines of a log
_BAR_SECONDS = 1.0  # between two updates of a bar

# Layout of a bar when the remaining time is known, and when it is not.
_WITH_REST = "{desc}:{percentage:5.1f} %|{bar}| [{elapsed}, remain {remaining}]{postfix}"
_WITHOUT_REST = "{desc} [{elapsed}]{postfix}"


def follow(
    steps: Iterator[_Step], told: Callable[[_Step], Told], *, shown: bool = True, begun: float = 0.0
) -> None:
    """Iterate over all steps of a run and report progress on standard error.

    Terminals and notebooks show a bar, other outputs, such as the log of a batch job, a line every ten
    seconds. The remaining time is estimated where the completed fraction is known.

    Parameters
    ----------
    steps : iterator
    told : callable
        Returns the progress at a step.
    shown : bool
        Whether to report anything.
    begun : float
        Fraction of the first phase that was completed before.
    """
    with display(shown=shown, begun=begun) as tell:
        for step in steps:
            tell(told(step))


@contextmanager
def display(*, shown: bool = True, begun: float | None = None) -> Iterator[Callable[[Told], None]]:
    """Yield a function that shows progress, as in `follow`.

    Parameters
    ----------
    shown : bool
        Whether to show anything.
    begun : float, optional
        Fraction of the first phase that was completed before; by default that of the first progress shown.
    """
    line: _Bar | _Log | None = None

    def tell(at: Told) -> None:
        nonlocal line, shown
        if not shown or sys.stderr is None:
            return
        try:
            if line is None:
                part = at.part if begun is None else begun
                line = (_Bar if _is_looked_at() else _Log)(part or 0.0)
            line.say(at)
        except (OSError, ValueError):  # a standard error that is closed or full ends no run
            shown, line = False, None

    try:
        yield tell
    finally:
        if line:
            with suppress(OSError, ValueError):
                line.end()


def _is_looked_at() -> bool:
    """Whether standard error is a terminal or in a notebook."""
    shell = sys.modules.get("IPython")
    return sys.stderr.isatty() or (shell is not None and shell.get_ipython() is not None)


def _tqdm() -> Any:
    with warnings.catch_warnings():
        # Silences tqdm's warning about notebooks without widgets; it writes text there.
        warnings.simplefilter("ignore")
        from tqdm.auto import tqdm  # noqa: PLC0415 - not needed without a run

    return tqdm


class _Bar:
    """A bar that fills in each phase."""

    def __init__(self, begun: float) -> None:
        self._begun, self._phase = begun, ""
        self._line: Any = None

    def say(self, at: Told) -> None:
        if at.phase != self._phase:
            self._begin(at)
        if at.aside:
            self._line.write(at.aside, file=sys.stderr)
        self._line.set_postfix_str(at.text, refresh=False)
        self._line.update(1 if at.part is None else at.part - self._line.n)

    def end(self) -> None:
        if self._line is not None:
            self._line.close()

    def _begin(self, at: Told) -> None:
        self.end()
        knows = at.part is not None
        self._line = _tqdm()(
            desc=at.phase,
            total=1.0 if knows else None,
            initial=self._begun,
            mininterval=_BAR_SECONDS,
            bar_format=_WITH_REST if knows else _WITHOUT_REST,
        )
        self._phase, self._begun = at.phase, 0.0


class _Log:
    """Log lines: the first at once, then at intervals, and the last."""

    def __init__(self, begun: float) -> None:
        self._first, self._phase = begun, ""
        self._began = self._written = -_LOG_SECONDS
        self._waiting: Told | None = None

    def say(self, at: Told) -> None:
        now = time.perf_counter()
        if at.phase != self._phase:
            self.end()
            self._first = self._first if not self._phase else 0.0
            self._phase, self._began, self._written = at.phase, now, -_LOG_SECONDS
        if at.aside:
            print(at.aside, file=sys.stderr)
        self._waiting = at
        if now - self._written >= _LOG_SECONDS:
            self._write()

    def end(self) -> None:
        if self._waiting:
            self._write()

    def _write(self) -> None:
        at, self._waiting = self._waiting, None
        assert at is not None
        self._written = time.perf_counter()
        seconds = self._written - self._began
        print(f"{at.phase}: {_how_far(at, self._first, seconds)}{at.text}", file=sys.stderr)


def _how_far(at: Told, first: float, seconds: float) -> str:
    """Format the completed fraction, the elapsed time and the remaining time at this pace."""
    interval = _tqdm().format_interval
    if at.part is None:
        return f"[{interval(seconds)}] "
    here = at.part - first
    rest = interval(seconds * (1 - at.part) / here) if here > 0 and seconds > 1 else "?"
    return f"{100 * at.part:.1f} % [{interval(seconds)}, remain {rest}] "


class Folder:
    """A temporary folder, removed with its last reference, in the process that made it."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="jamshape-"))
        self._end = weakref.finalize(self, _remove_if_own, self.path, os.getpid())


def _remove_if_own(folder: Path, maker: int) -> None:
    """Remove a folder, but not from a forked process, whose parent may still need it."""
    if os.getpid() == maker:
        shutil.rmtree(folder, ignore_errors=True)


class Place(NamedTuple):
    """A file, and its temporary folder, if any."""

    path: Path
    folder: Folder | None = None


def place(file: str | Path | None, name: str) -> Place:
    """Return the place of an H5MD file; without one, in a temporary folder removed with the result.

    Raises
    ------
    ValueError
        If the file has the suffix of another format, or is a folder.
    """
    if file is None:
        folder = Folder()
        return Place(folder.path / name, folder)
    require_one_process()
    path = Path(file)
    require_hdf5_name(path)
    require_no_folder(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    return Place(path)
