"""Signals as flags: a run ends at its next mark, where its file is whole."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import suppress
from types import FrameType
from typing import Any, Self

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupts:
    """Context in which Ctrl-C and SIGTERM are noted, and a second one ends the process at once.

    On leaving the context a noted signal is raised again, for whoever handles it outside. In other threads than the main
    one, and where a signal is ignored, nothing changes.
    """

    def __init__(self) -> None:
        self.noted: int | None = None
        """The signal that was noted."""
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for one in _SIGNALS:
                if signal.getsignal(one) not in {signal.SIG_IGN, None}:
                    self._before[one] = signal.signal(one, self._note)
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self._restore()
        if self.noted is not None and kind is None:
            signal.raise_signal(self.noted)

    def _note(self, number: int, frame: FrameType | None) -> None:
        del frame
        if self.noted is not None:
            self._restore()
            signal.raise_signal(number)
            return
        self.noted = number
        # Standard error may be closed, or just be written to.
        with suppress(OSError, ValueError, RuntimeError):
            print("\nstopping at the next checkpoint; once more ends at once", file=sys.stderr)

    def _restore(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before.clear()
