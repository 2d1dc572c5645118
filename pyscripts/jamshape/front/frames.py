"""Frames of any file with particles, as a sequence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import overload

import numpy as np

from jamshape.arguments import ArgumentTypeError, checked
from jamshape.arrays import FloatArray, IntArray
from jamshape.checks import said
from jamshape.files.disk import named
from jamshape.files.frames import row_of
from jamshape.files.h5md import FileFormatError, read_attributes, read_clock, read_packings
from jamshape.files.lammps_text import DumpFile, read_any
from jamshape.files.meaning import NOTHING, Wanted, require_told
from jamshape.files.signature import DUMP, GSD, HDF5, format_of
from jamshape.front.packing import Packing, public, results_of
from jamshape.packing import Packing as PackingLike
from jamshape.vibration.table import holds_modes

_PARTICLES_AT_ONCE = 2**15  # of frames in memory


class Frames(Sequence[Packing]):
    """Packings of a file, each read when it is asked for; `frames` makes them.

    Slices are such sequences, too.

    Parameters
    ----------
    path : Path
    clock : (T,) array of int64, (T,) array of float64, [time]
        Steps and times of all frames of the file.
    read : callable
        Reads the packings of some rows, counted from 0, one by one.
    rows : range
        Rows of these frames.
    """

    def __init__(
        self,
        path: Path,
        clock: tuple[IntArray, FloatArray],
        read: Callable[[range], Iterator[Packing]],
        rows: range,
    ) -> None:
        self.path, self._clock, self._read, self._rows = path, clock, read, rows

    @property
    def steps(self) -> IntArray:
        """(T,) time steps."""
        return self._clock[0][np.asarray(self._rows, dtype=np.int64)]

    @property
    def times(self) -> FloatArray:
        """(T,) times, [time]; 0 where the file does not say."""
        return self._clock[1][np.asarray(self._rows, dtype=np.int64)]

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, frame: int) -> Packing: ...
    @overload
    def __getitem__(self, frame: slice) -> Frames: ...
    def __getitem__(self, frame: int | slice) -> Packing | Frames:
        if isinstance(frame, slice):
            return Frames(self.path, self._clock, self._read, self._rows[frame])
        if isinstance(frame, bool | np.bool_) or not hasattr(frame, "__index__"):
            msg = f"frames are looked up by {said(frame)}, expected a whole number or a slice, such as 0 or [2:10:2]"
            raise ArgumentTypeError(msg)
        row = self._rows[row_of(int(frame), len(self), self.path)]
        return next(self._read(range(row, row + 1)))

    def __iter__(self) -> Iterator[Packing]:
        return self._read(self._rows)

    def __repr__(self) -> str:
        return f"<{len(self)} frames of {named(self.path)}>"


@checked
def frames(path: str | Path, *, dimension: int | None = None, shape: str | None = None) -> Frames:
    """Open the frames of a file as a sequence, which reads each packing when it is asked for.

    Parameters
    ----------
    path : path
        A run or a packing in H5MD, a LAMMPS dump, also compressed (``.gz``, ``.zst``), a data file, or a GSD file.
    dimension, shape
        As in `load`; those of the first frame apply to all.

    Returns
    -------
    Frames
        With a length, ``times`` and ``steps``; slices are such sequences. An incomplete last frame of a dump is left
        out, with a warning.

    Raises
    ------
    FileFormatError
        If the file is none of these; also later, if a frame is damaged.
    ValueError
        If the file says another dimension or shape.
    OSError
        If it cannot be opened.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=4)
    >>> run = js.compress(rods, n=24, phi=(0.4, 0.95), kappa=1e-3, file="run.h5", progress=False)
    >>> frames = js.frames("run.h5")
    >>> frames, int(frames.steps[-1]), [round(packing.phi, 3) for packing in frames[::10]]
    (<21 frames of run.h5>, 400, [0.4, 0.616, 0.95])
    """
    at, wanted = Path(path).absolute(), Wanted(dimension, shape)
    found = format_of(at)
    if found == HDF5:
        if holds_modes(at):
            msg = f"{path} holds modes, expected a packing or a run"
            raise FileFormatError(msg)
        return recorded_frames(at, wanted)
    if found == GSD:
        return _of_gsd(at, wanted)
    if found != DUMP:
        one = public(read_any(at, -1, *wanted), file=at)
        clock = np.array([one.step]), np.array([one.time])
        return Frames(at, clock, partial(_repeated, one), range(1))
    dump = DumpFile(at, *wanted)
    dump.warn_if_cut()
    if not len(dump):
        dump.packing(0)  # raises
    clock = np.array(dump.index.steps), np.array(dump.index.times, np.float64)
    return Frames(at, clock, partial(_one_by_one, dump.packing, at), range(len(dump)))


def recorded_frames(path: Path, wanted: Wanted = NOTHING) -> Frames:
    """Open the frames of an H5MD file, which is open only while one is read: a run replaces it as a whole."""
    clock = read_clock(path)
    if any(wanted):
        require_told(path, Packing.read(path, 0), wanted)
    return Frames(path, clock, partial(_recorded, path), range(len(clock[0])))


def _recorded(path: Path, rows: range) -> Iterator[Packing]:
    """Read frames of an H5MD file in blocks, since their rows share chunks."""
    most = 1
    while rows:
        known = read_attributes(path)
        for packing in read_packings(path, rows[:most]):
            results = results_of(path, packing) if "outcome" in known else known
            yield public(packing, results, path)
        rows, most = rows[most:], max(1, _PARTICLES_AT_ONCE // packing.n)


def _of_gsd(path: Path, wanted: Wanted) -> Frames:
    from jamshape.exchange.gsd import read_gsd, read_gsd_clock  # noqa: PLC0415 - gsd may be missing

    clock = read_gsd_clock(path)
    if any(wanted):
        require_told(path, read_gsd(path, 0), wanted)
    read = partial(_one_by_one, partial(read_gsd, path), path)
    return Frames(path, clock, read, range(len(clock[0])))


def _repeated(one: Packing, rows: range) -> Iterator[Packing]:
    return iter([one] * len(rows))


def _one_by_one(read: Callable[[int], PackingLike], path: Path, rows: range) -> Iterator[Packing]:
    return (public(read(row), file=path) for row in rows)
