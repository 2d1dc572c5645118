"""Movies of runs, of modes and of packings in a row."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.arguments import ArgumentTypeError, checked
from jamshape.checks import (
    ArgumentError,
    Range,
    require_in,
    require_no_effect,
    require_stated,
    said,
)
from jamshape.contacts import Contacts
from jamshape.drawing.colors import color_of
from jamshape.drawing.movie import Movie, Shot, require_movie
from jamshape.drawing.packing import Look
from jamshape.drawing.text import scientific
from jamshape.files.signature import HDF5, format_of
from jamshape.front.files import load
from jamshape.front.frames import Frames, frames
from jamshape.front.modes import Modes
from jamshape.front.run import (
    CyclicShearFile,
    LadderFile,
    QuasistaticShearFile,
    Recorded,
    RunFile,
    ShearFile,
)
from jamshape.landscape import State
from jamshape.packing import Packing

if TYPE_CHECKING:
    from collections.abc import Sequence

_FPS = Range(0.1, 1000.0, "frames per second")
_EVERY = Range(1, 10**6, "frames", whole=True)
_AMPLITUDE = Range(1e-6, 10.0, "smallest radii")

_STEPS = 24  # frames of an oscillation
_USUAL = 0.5  # amplitude


@checked
def animate(
    thing: Recorded | Modes | Sequence[Packing] | str | Path,
    mode: int | str | Path | None = None,
    file: str | Path | None = None,
    *,
    fps: float = 10.0,
    dpi: int = 100,
    every: int | None = None,
    color: str | None = None,
    amplitude: float | None = None,
) -> Movie | None:
    """Make a movie of a run, of a mode, or of packings in a row.

    The view is the same in all frames, and the box is drawn as it deforms. Particles are drawn where their centres are in
    the box; those of a mode swing along its eigenvector.

    Parameters
    ----------
    thing : run, Modes, sequence of Packing, or path
        A run has its own frames, and so does a file that `load` reads; packings have the same dimension.
    mode : int, optional
        Row of the mode; left out for anything else, so that the file comes next.
    file : path, optional
        Movie to write: ``.gif`` by Pillow, or ``.mp4``, ``.m4v``, ``.mkv`` and ``.mov`` by ffmpeg.
    fps : float
        Frames per second.
    dpi : int
        Dots per inch; the longer edge of the view is 4.8 inches.
    every : int, optional
        Show every n-th frame; all by default.
    color : {"kind", "orientation", "one", "S2", "S4", "C4"}, optional
        Quantity that colours the particles; "kind" by default.
    amplitude : float, optional
        Largest displacement in a mode, at the ends of a particle that turns, over the smallest radius; 0.5 by default.

    Returns
    -------
    Movie or None
        Without a file an object that notebooks show, with a player.

    Raises
    ------
    TypeError
        If it is none of these.
    ValueError
        If there is no such mode or format, a number is out of its range or has no effect, or ffmpeg is missing.
    RuntimeError
        If ffmpeg fails.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> packing = js.make_packing(rods, n=16, u0=1e-8, file="packing.h5", progress=False)
    >>> js.animate(js.modes(packing), 7, "mode.gif")
    >>> run = js.quasistatic_shear(start=packing, step=5e-3, strain=0.05, frames=5, file="movie.h5", progress=False)
    >>> js.animate(run, "shear.gif", every=2)
    """
    if isinstance(mode, str | Path):
        if file is not None:
            msg = f"mode is {mode!r} beside a file, expected the number of a mode, or only one name"
            raise ArgumentTypeError(msg)
        mode, file = None, mode
    if file is not None:
        require_movie(Path(file))  # before any work
    require_in("fps", fps, _FPS)
    require_stated(dpi=dpi)
    color = color_of(color or "kind")
    shots: Any
    if isinstance(thing, str | Path):
        thing = _opened(Path(thing))
    if isinstance(thing, Modes):
        require_no_effect("mode", mode, every=every)
        shots = _swinging(thing, mode, amplitude)
    else:
        for name, value in (("mode", mode), ("amplitude", amplitude)):
            if value is not None:
                text = f"{{{name}}} has no effect on a {type(thing).__name__}, expected modes; leave it out"
                raise ArgumentError(text, {name: value})
        shots = _Frames(thing, 1 if every is None else every)
    movie = Movie(shots, Look(color), fps, dpi)
    if file is None:
        return movie
    movie.save(Path(file))
    return None


def _opened(path: Path) -> Recorded | Modes | Frames:
    """Open a file for a movie: a run, modes, or the frames of any other one."""
    found = load(path) if format_of(path) == HDF5 else None
    return frames(path) if found is None or isinstance(found, Packing) else found


class _Frames:
    """Every n-th frame of a run or of packings, read one by one."""

    def __init__(self, thing: Any, every: int) -> None:
        require_in("every", every, _EVERY)
        if not (isinstance(thing, Recorded) or hasattr(thing, "__getitem__")):
            try:
                thing = list(thing)
            except TypeError:
                msg = f"thing is {said(thing)}, expected a run, modes or packings in a row"
                raise ArgumentTypeError(msg) from None
        self._thing, self._rows = thing, range(0, len(thing), every)
        if not self._rows:
            msg = "no packings were given, expected one or more"
            raise ValueError(msg)
        self._dimension = self._packing(0).dimension

    def __len__(self) -> int:
        return len(self._rows)

    def _packing(self, row: int) -> Packing:
        packing = (
            self._thing.packing(row) if isinstance(self._thing, Recorded) else self._thing[row]
        )
        if not isinstance(packing, Packing):
            msg = f"thing has {said(packing)} in it, expected a packing in each frame"
            raise ArgumentTypeError(msg)
        return packing

    def __getitem__(self, k: int) -> Shot:
        row = self._rows[k]
        packing = self._packing(row)
        if packing.dimension != self._dimension:
            msg = (
                f"thing has packings in {self._dimension}D and in {packing.dimension}D, expected one dimension; make a"
                " movie of each"
            )
            raise ValueError(msg)
        where = next((of for kind, of in _WHERE.items() if isinstance(self._thing, kind)), _where)
        phi = rf"$\phi={packing.phi:.5f}$"
        return Shot.of(Contacts.of(packing), f"{phi}    {where(self._thing, row, packing)}")


def _where(thing: Any, row: int, packing: Packing) -> str:
    """Describe the place of a packing in a row."""
    return f"step {packing.step}" if packing.step else f"{row + 1} of {len(thing)}"


_WHERE: dict[type, Callable[[Any, int, Packing], str]] = {
    RunFile: lambda _, __, packing: f"time {packing.time:.5g}",
    ShearFile: lambda run, _, packing: rf"strain $\gamma={run.gdot * packing.time:.3f}$",
    CyclicShearFile: lambda run, _, packing: f"cycle {packing.time / run.about['period']:.0f}",
    QuasistaticShearFile: lambda _, __, packing: rf"strain $\gamma={packing.time:.4f}$",
    LadderFile: lambda run, row, _: f"$u={scientific(run.values[row])}$",
}
"""Titles by kind of run."""


def _swinging(modes: Modes, mode: int | None, amplitude: float | None) -> list[Shot]:
    """Return an oscillation along an eigenvector."""
    packing, vectors = modes.packing, modes.vectors
    if packing is None or not vectors.shape[1]:
        msg = (
            f"{modes.file or 'modes'} holds no packing with its eigenvectors, expected both; write it again with"
            " modes.save(path) or jamshape modes --vectors"
        )
        raise ValueError(msg)
    if mode is None:
        text = "{mode:name} is missing, expected the number of a mode, from 0"
        raise ArgumentError(text, {"mode": mode})
    require_in("mode", mode, Range(-len(modes), len(modes) - 1, "a mode", whole=True))
    size = _USUAL if amplitude is None else amplitude
    require_in("amplitude", size, _AMPLITUDE)
    shift, turn = modes.coordinates.motion(vectors[:, mode])
    reach = np.sqrt((shift**2).sum(axis=1))
    reach += np.sqrt((turn**2).sum(axis=1)) * packing.outer_radius
    scale = size * float(packing.inner_radius.min()) / float(reach.max())
    found, box, state = Contacts.of(packing), packing.box, State.of(packing)
    inside = box.lo + box.wrapped(packing.position)[0]
    omega, number = modes.omega[mode], mode % len(modes)
    title = rf"$\phi={packing.phi:.5f}$    mode {number}, $\omega={omega:.4g}$"
    shots = []
    for phase in 2 * math.pi * np.arange(_STEPS) / _STEPS:
        part = scale * math.sin(phase)
        moved = state.displaced(part * shift, part * turn).packing(packing)
        shown = dataclasses.replace(found, packing=moved)
        shots.append(Shot(shown, inside + part * shift, title, has_points=False))
    return shots
