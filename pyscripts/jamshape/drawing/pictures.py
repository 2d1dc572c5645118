"""Figures of packings side by side, each with its counts."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.contacts import Contacts
from jamshape.drawing.colors import ORDER, Coloring, Scale
from jamshape.drawing.kinds import kinds_of
from jamshape.drawing.packing import Look, add_legend, colorings, draw_packing
from jamshape.drawing.saving import save_figure
from jamshape.drawing.space import save_smooth
from jamshape.drawing.text import attributes_text, scientific
from jamshape.files.h5md import FileFormatError, PathLike, read_attributes
from jamshape.files.lammps_text import read_any
from jamshape.files.meaning import NOTHING, Wanted
from jamshape.measures.order import order

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 3
INCHES = (7.0, 5.0, 4.0)  # longer edge of a panel, for one column, two, three
MANY_KINDS = 3  # number from which on the title omits parameters
ROOM = (0.75, 1.4)  # for text above and below a panel, single or one of several


class Picture(NamedTuple):
    """A packing with its description."""

    found: Contacts
    more: list[str]
    """Further entries of the title."""
    report: dict[str, Any]


class Drawn(NamedTuple):
    """A figure of packings and the colours of their particles."""

    figure: Figure
    colorings: list[Coloring]


def read_picture(
    path: Path, frame: int = -1, sides: int | None = None, color: str = "", wanted: Wanted = NOTHING
) -> Picture:
    """Read a packing, find its contacts and count.

    Parameters
    ----------
    path : Path
        H5MD, a LAMMPS dump or a data file.
    frame : int
        Counted from 0 or, if negative, from the end.
    sides : int, optional
        Bonds of a side-to-side contact; None for those of the packing's law.
    color : str
        Colouring; kinds of order are also reported as numbers.
    wanted : Wanted
        Dimension and shape of a data or dump file that does not state them.

    Raises
    ------
    FileFormatError, ValueError, OSError
        As in `read_any`.
    """
    packing = read_any(path, frame, *wanted)
    known: dict[str, Any] = {}
    with contextlib.suppress(FileFormatError):  # dumps and data files have no attributes
        known |= read_attributes(path)
    found = Contacts.of(packing, sides=sides)
    counts = found.counts
    told = {"packing": path, "shape": packing.shape_style, "dimension": packing.dimension}
    told |= {"n": packing.n, "rattlers": counts.n_rattlers, "contacts": len(found)}
    told |= {"phi": packing.phi, "u": float(found.energy.sum()) / packing.box.volume, "z": counts.z}
    known_order = order(packing) if color in ORDER else {}
    more = attributes_text(known)
    more += [rf"${name[0]}_{name[1]}={value:.3f}$" for name, value in known_order.items()]
    if "protocol" in known:
        more.append(str(known["protocol"]))
    return Picture(found, more, told | known_order)


def draw_pictures(pictures: Sequence[Picture], look: Look) -> Drawn:
    """Draw packings in panels of one figure, with a common scale of order.

    Raises
    ------
    ValueError
        If the order is undefined in a packing's dimension.
    """
    colored, scale = colorings([one.found for one in pictures], look.color)
    figure, panels = _make_panels(pictures, with_bar=scale is not None)
    for axes, one, colors in zip(panels, pictures, colored, strict=False):
        draw_packing(axes, one.found, colors, look)
        title = title_of(one.found, one.more, narrow=len(pictures) > 1)
        axes.set_title(title, fontsize=9, linespacing=1.4)
        add_legend(axes, colors)
    for axes in panels[len(pictures) :]:
        axes.set_axis_off()
    if scale:
        _add_bar(figure, panels, scale)
    return Drawn(figure, colored)


def save_pictures(figure: Figure, pictures: Sequence[Picture], out: PathLike, dpi: int) -> None:
    """Save a figure of packings; those in space with smooth edges."""
    if any(one.found.packing.dimension == 3 for one in pictures):
        save_smooth(figure, Path(out), dpi)
    else:
        save_figure(figure, out, dpi=dpi, bbox_inches="tight", pad_inches=0.05)


def title_of(found: Contacts, more: Sequence[str] = (), *, narrow: bool = False) -> str:
    """Describe the particles, if they are few kinds, and the counts.

    Parameters
    ----------
    found : Contacts
    more : sequence of str
        Further entries, at the end.
    narrow : bool
        Whether to use more lines, for a narrow panel.
    """
    packing, gap = found.packing, "    "
    u = float(found.energy.sum()) / packing.box.volume
    kinds, shape = kinds_of(packing), packing.shape
    known = [f"{shape.name}s in {packing.dimension}D"]
    known += [kinds.title] * (0 < len(kinds.parameters) < MANY_KINDS)
    where = gap.join([rf"$N={packing.n}$", rf"$\phi={packing.phi:.5f}$"])
    counted = [rf"$u={scientific(u)}$", f"$z={found.z:.3f}$"]
    counted += [f"step {packing.step}"] * (packing.step > 0)
    lines = [where, gap.join([*counted, *more])]
    lines = lines if narrow else [gap.join(lines)]
    return "\n".join([", ".join(known), *lines])


def _make_panels(pictures: Sequence[Picture], *, with_bar: bool) -> tuple[Figure, Any]:
    """Make a figure with a panel for each packing, with the proportions of the rectangle around its box."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    columns = min(COLUMNS, len(pictures))
    rows = -(-len(pictures) // columns)
    boxes = [one.found.packing.box for one in pictures if one.found.packing.dimension == 2]
    shapes = [box.bounds[1] - box.bounds[0] for box in boxes]
    ratios = [shape / shape.max() for shape in shapes] or [np.ones(2)]
    width, height = INCHES[columns - 1] * np.max(ratios, axis=0)
    size = (columns * width + 0.1 + 0.7 * with_bar, rows * (height + ROOM[len(pictures) > 1]))
    figure = Figure(figsize=size)
    figure.set_layout_engine("constrained", h_pad=0.1, w_pad=0.06)
    return figure, figure.subplots(rows, columns, squeeze=False).ravel()


def _add_bar(figure: Figure, panels: Any, scale: Scale) -> None:
    """Add a colour bar of local order."""
    bar = figure.colorbar(scale.mapped, ax=list(panels), fraction=0.04, pad=0.02, shrink=0.8)
    bar.set_label(scale.label)
