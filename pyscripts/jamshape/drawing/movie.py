"""Movies of packings: a picture that changes from frame to frame, in a view that does not."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from subprocess import CalledProcessError
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.checks import ArgumentError
from jamshape.contacts import Contacts
from jamshape.drawing import plane, space
from jamshape.drawing.colors import ORDER, Scale, order_of
from jamshape.drawing.packing import MANY, Look, colorings, shown_at
from jamshape.drawing.styles import CONTACT
from jamshape.files.disk import replacing

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.figure import Figure

_INCHES = 4.8  # longer edge of the view
_TITLE = 0.6  # height of the title
_BAR = 0.9  # width of a colour bar
_CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])

FFMPEG, PILLOW = "ffmpeg", "pillow"
MOVIES = {".gif": PILLOW, ".mp4": FFMPEG, ".m4v": FFMPEG, ".mkv": FFMPEG, ".mov": FFMPEG}
"""Writers of matplotlib by the suffix of a file."""


class Shot(NamedTuple):
    """Content of one frame."""

    found: Contacts
    """The packing, with its contacts; those of a mode are those of its packing."""
    centers: FloatArray
    """(N, D) places at which to draw the particles."""
    title: str
    has_points: bool = True
    """Whether to draw points of contact, in the plane."""

    @classmethod
    def of(cls, found: Contacts, title: str) -> Shot:
        """Show a packing in its box."""
        box = found.packing.box
        return cls(found, box.lo + box.wrapped(found.packing.position)[0], title)


def require_movie(path: Path) -> str:
    """Return the name of the writer of a file, or raise an ArgumentError that says what is missing."""
    from matplotlib import animation  # noqa: PLC0415 - slow

    name = MOVIES.get(path.suffix.lower())
    given = {"file": path}
    if name is None:
        ends = ", ".join(MOVIES)
        said = (
            f"{{file}} has the suffix {path.suffix!r}, expected one of {ends}; choose one of them"
        )
        raise ArgumentError(said, given)
    if not animation.writers.is_available(name):
        said = "{file} needs ffmpeg, which is not installed; install it, or choose a name that ends in .gif"
        raise ArgumentError(said, given)
    return name


class Movie:
    """A movie of packings, which notebooks show.

    Parameters
    ----------
    shots : sequence of Shot
        One for each frame; taken one by one.
    look : Look
    fps : float
        Frames per second.
    dpi : int
        Dots per inch, of a view 4.8 inches long.
    """

    def __init__(self, shots: Sequence[Shot], look: Look, fps: float, dpi: int) -> None:
        self._shots, self._fps = shots, fps
        view, self._scale = _first_look(shots, look)
        self._figure, axes = _figure(view, dpi, with_bar=self._scale is not None)
        kind = _Plane if shots[0].found.packing.dimension == 2 else _Space
        self._scene = kind(axes, shots[0], look)
        if self._scale:
            bar = self._figure.colorbar(self._scale.mapped, ax=axes, shrink=0.8)
            bar.set_label(self._scale.label)
        self._axes, self._look = axes, look

    def __len__(self) -> int:
        """Count the frames."""
        return len(self._shots)

    def draw(self, frame: int) -> Figure:
        """Draw a frame; returns the figure, which is the same for all."""
        shot = self._shots[frame]
        self._scene.show(shot, self._colors(shot))
        self._axes.set_title(shot.title, fontsize=10)
        return self._figure

    def save(self, path: Path) -> None:
        """Write the movie in the format of its suffix; an existing file is replaced when writing is complete.

        Raises
        ------
        ArgumentError
            If there is no such format, or no ffmpeg for it.
        OSError
            If the file cannot be written.
        RuntimeError
            If ffmpeg fails.
        """
        from matplotlib.animation import writers  # noqa: PLC0415 - slow

        kind: Any = writers[require_movie(path)]
        writer = kind(fps=self._fps)
        with replacing(path) as temporary, TemporaryDirectory() as folder:
            made = Path(folder) / f"movie{path.suffix.lower()}"  # writers look at the suffix
            try:
                self._animation().save(made, writer, dpi=self._figure.dpi)
            except CalledProcessError as error:
                msg = f"ffmpeg did not write {path}, expected one that encodes H.264; choose a name that ends in .gif"
                raise RuntimeError(msg) from error
            shutil.copyfile(made, temporary)

    def _repr_html_(self) -> str:
        animation: Any = self._animation()
        return str(animation.to_jshtml(fps=self._fps))

    def _animation(self) -> FuncAnimation:
        from matplotlib.animation import FuncAnimation  # noqa: PLC0415 - slow

        def show(frame: int) -> list[Any]:
            self.draw(frame)
            return []

        how: dict[str, Any] = {"init_func": list, "cache_frame_data": False}
        return FuncAnimation(self._figure, show, range(len(self)), **how)

    def _colors(self, shot: Shot) -> FloatArray:
        if self._scale:
            return self._scale.rgb(order_of(shot.found, self._look.color))
        return colorings([shot.found], self._look.color)[0][0].rgb


class _View(NamedTuple):
    """Corners of the visible rectangle."""

    low: FloatArray
    high: FloatArray


def _first_look(shots: Sequence[Shot], look: Look) -> tuple[_View, Scale | None]:
    """Find a view for all frames, and a common scale of order."""
    lows, highs, orders = [], [], []
    for shot in shots:
        low, high = _bounds(shot.found.packing, look)
        lows.append(low)
        highs.append(high)
        if look.color in ORDER:
            orders.append(order_of(shot.found, look.color))
    view = _View(np.min(lows, axis=0), np.max(highs, axis=0))
    return view, Scale.of(look.color, np.concatenate(orders)) if orders else None


def _bounds(packing: Any, look: Look) -> tuple[FloatArray, FloatArray]:
    """Return the corners of the rectangle around a box and particles at its edges."""
    box, pad = packing.box, float(packing.outer_radius.max())
    corners = box.lo + box.vectors(np.array(list(np.ndindex(*[2] * packing.dimension))))
    if packing.dimension == 3:
        corners = space.view(look.height, look.turn).flat(corners)
    return corners.min(axis=0) - pad, corners.max(axis=0) + pad


def _figure(view: _View, dpi: int, *, with_bar: bool) -> tuple[Figure, Any]:
    """Make a figure with the proportions of a view."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed where nothing is drawn

    edges = view.high - view.low
    inches = _INCHES * edges / edges.max() + [_BAR * with_bar, _TITLE]
    even = 2 * np.ceil(inches * dpi / 2) / dpi  # numbers of pixels, which video formats require
    figure = Figure(figsize=tuple(even), dpi=dpi, layout=None if not with_bar else "constrained")
    share = 1 - _TITLE / even[1]
    axes = figure.add_subplot() if with_bar else figure.add_axes((0, 0, 1, share))
    limits: dict[str, Any] = {
        "xlim": (view.low[0], view.high[0]),
        "ylim": (view.low[1], view.high[1]),
    }
    axes.set(**limits, aspect="equal")
    axes.set_axis_off()
    return figure, axes


class _Plane:
    """A picture in the plane: bodies, spines, points of contact and the box; parameters as in `Movie`."""

    def __init__(self, axes: Any, first: Shot, look: Look) -> None:
        from matplotlib.collections import LineCollection, PolyCollection  # noqa: PLC0415

        del look
        shown = shown_at(axes, first.found)
        self._dot = shown.dot
        self._bodies: Any = PolyCollection([], edgecolors="k", lw=shown.line)
        self._spines = LineCollection([], colors="k", lw=1.5 * shown.line)
        self._points = PolyCollection([], facecolors=CONTACT, lw=0)
        for part in (self._bodies, self._spines, self._points):
            axes.add_collection(part, autolim=False)
        (self._box,) = axes.plot([], [], color="0.2", lw=1.2, ls="--")

    def show(self, shot: Shot, colors: FloatArray) -> None:
        """Show a frame."""
        packing, box = shot.found.packing, shot.found.packing.box
        at = plane.Images(np.arange(packing.n), shot.centers)
        self._bodies.set_verts(plane.outlines(packing, at))
        self._bodies.set_facecolor(colors)
        self._spines.set_segments(list(plane.spines(packing, at)))
        if shot.has_points:
            network = shot.found.network
            first = network.pairs[network.bonds.contact, 0]  # next to which points are given
            points = network.bonds.point + (shot.centers - packing.position)[first]
            self._points.set_verts(plane.discs(points, self._dot))
        self._box.set_data(*(box.lo + box.vectors(_CORNERS)).T)


class _Space:
    """A picture in space: faces that are seen, and the edges of the box; parameters as in `Movie`."""

    def __init__(self, axes: Any, first: Shot, look: Look) -> None:
        from matplotlib.collections import LineCollection, PolyCollection  # noqa: PLC0415

        self._view = space.view(look.height, look.turn)
        self._level = look.level or (2 if first.found.packing.n < MANY else 1)
        self._back = LineCollection([], colors="0.45", lw=0.8, zorder=1)
        self._bodies: Any = PolyCollection([], lw=0, antialiaseds=False, zorder=2)
        self._front = LineCollection([], colors="0.15", lw=0.9, zorder=3)
        for part in (self._back, self._bodies, self._front):
            axes.add_collection(part, autolim=False)

    def show(self, shot: Shot, colors: FloatArray) -> None:
        """Show a frame."""
        packing = shot.found.packing
        faces = space.faces_of(packing, self._level, self._view, shot.centers)
        polygons, shades = space.painted(faces, colors, self._view)
        back, front = space.box_edges(packing, self._view)
        self._bodies.set_verts(list(polygons))
        self._bodies.set_facecolor(shades)
        self._back.set_segments(list(back))
        self._front.set_segments(list(front))
