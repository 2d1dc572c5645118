"""Index of the frames of a text dump: where each begins, from one pass over the file that parses only headers."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from typing import IO, NamedTuple

import numpy as np

_MARK = b"\nITEM: TIMESTEP"
_CHUNK = 2**22
_AROUND = 64  # bytes before and behind a mark that hold ITEM: TIME and the step
_COUNT = re.compile(rb"ITEM: NUMBER OF ATOMS\s+(\d+)")
_ROWS = b"\nITEM: ATOMS"


class DumpIndex(NamedTuple):
    """Frames of a dump."""

    starts: list[int]
    """Offset of each frame, then of the end."""
    steps: list[int]
    times: list[float]
    """Times, 0 where ``dump_modify time yes`` did not write them."""
    is_cut: bool
    """Whether the last of these frames is incomplete."""

    @property
    def n_whole(self) -> int:
        """Number of complete frames."""
        return len(self.steps) - self.is_cut


def index_of(file: IO[bytes]) -> DumpIndex:
    """Find the frames of an open dump."""
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    starts: list[int] = []
    steps: list[int] = []
    times: list[float] = []
    for at, before, behind in _marks(file):
        lines = before.split(b"\n")
        has_time = len(lines) > 1 and lines[-2].strip() == b"ITEM: TIME"
        start = at - len(lines[-2]) - len(lines[-1]) - 2 if has_time else at
        starts.append(start if starts else 0)
        times.append(_number(lines[-1]) if has_time else 0.0)
        steps.append(int(_number(behind.split(b"\n")[1] if b"\n" in behind else b"")))
    if not starts and size:  # not a dump, as its reader will say
        starts, steps, times = [0], [0], [0.0]
    if not starts:
        return DumpIndex([0], [], [], is_cut=False)
    file.seek(starts[-1])
    length = _length(file.read())
    is_cut = length is None
    if length is not None and starts[-1] + length < size:
        starts, steps, times, is_cut = (
            [*starts, starts[-1] + length],
            [*steps, 0],
            [*times, 0.0],
            True,
        )
    return DumpIndex([*starts, size], steps, times, is_cut)


def _marks(file: IO[bytes]) -> Iterator[tuple[int, bytes, bytes]]:
    """Yield the offset of each line ITEM: TIMESTEP, and the text before and from there."""
    begin, text, at = -1, b"\n", 0  # offset of the text, and where to search in it
    is_last = False
    while not is_last:
        more = file.read(_CHUNK)
        is_last = not more
        text += more
        limit = len(text) if is_last else max(len(text) - _AROUND, 0)
        while (found := text.find(_MARK, at, limit)) >= 0:
            start = found + 1
            yield (
                begin + start,
                text[max(found - _AROUND, 0) : found],
                text[start : start + _AROUND],
            )
            at = start
        at = max(at, limit - len(_MARK) + 1)
        drop = max(at - _AROUND - 1, 0)
        begin, text, at = begin + drop, text[drop:], at - drop


def _number(text: bytes) -> float:
    """Read a number; 0 for any other text, which the reader of its frame reports."""
    try:
        return float(text) if b"." in text or b"e" in text else int(text)
    except ValueError:
        return 0


def _length(text: bytes) -> int | None:
    """Measure the first frame of a text; None if it is cut."""
    head, rows, _ = text.partition(_ROWS)
    count = _COUNT.search(head)
    if not rows:
        return None
    if count is None:  # as its reader will say
        return len(text)
    ends = np.flatnonzero(np.frombuffer(text, np.uint8, offset=len(head) + 1) == ord("\n"))
    n = int(count[1])
    return None if len(ends) <= n else len(head) + 1 + int(ends[n]) + 1
