"""Draw modes of a packing in the plane: Figs. 12 and 16 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig12_modes.py PACKING.h5 --modes MODES.h5 --omega 3e-3 3e-2 --out modes.png
    python analysis/marschall_2018/fig12_modes.py PACKING.h5 --modes MODES.h5 --mode 0 20 --zoom --out modes.png

MODES.h5 is of analysis/modes.py with --vectors; without it modes are found here. Modes are numbered from 0 by
ascending eigenvalue, or those next to a frequency are taken; else one of each of the two lowest bands. Arrows
are displacements, colours rotations: blue counterclockwise, red clockwise; both over the largest displacement or
rotation A theta of the mode. Rattlers are grey. With --zoom only that part of the box is drawn which most
of the mode is in. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import BoolArray, FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.plane import draw_bodies, images, show_box
from jamshape.drawing.saving import save_figure
from jamshape.drawing.styles import RATTLER
from jamshape.drawing.text import packing_text
from jamshape.files.sets import PackingFile
from jamshape.landscape import Landscape
from jamshape.packing import Box, Packing
from jamshape.vibration.table import ModeTable

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.mode_axes import mode_text
from common.mode_tables import Wanted, pick_modes, table_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INCHES = 4.4  # of a panel
COLORS = "RdBu"  # red for negative, clockwise rotations
LONGEST = 0.11  # arrow, over the width of what is drawn
MOST = 6  # panels
PER_BAND = {"low": 1, "middle": 1}

# The part that --zoom draws holds this fraction of the squares of the motion, and is so many times as
# wide as the longest particle.
HELD, LENGTHS = 0.9, 2.6

LEAST = 0.05  # arrow, over the longest
COLUMNS = ("omega", "participation", "parallel", "perpendicular", "rotation")


class Motion(NamedTuple):
    """One mode, over its largest displacement or rotation."""

    shift: FloatArray
    """(N, 2)"""
    turn: FloatArray
    """(N,) A theta, A the length that a radian counts for."""

    @property
    def size(self) -> FloatArray:
        """(N,) displacements."""
        return np.asarray(np.linalg.norm(self.shift, axis=1))


def motion_of(lengths: FloatArray, table: ModeTable, mode: int) -> Motion:
    """Take one mode of a table, as particles move; a radian counts for these (N,) lengths."""
    shift, turn = table.coordinates.motion(table.vectors[:, mode])
    length = lengths * turn[:, 0]
    largest = max(np.linalg.norm(shift, axis=1).max(), np.abs(length).max())
    return Motion(shift / largest, length / largest)


def window(packing: Packing, motion: Motion) -> Box:
    """Find a square that holds most of the mode."""
    weight = motion.size**2 + motion.turn**2
    box, center = packing.box, packing.position[np.argmax(weight)]
    away = packing.position - center
    away -= box.vectors(np.rint(box.fractions(away)))
    distance = np.abs(away).max(axis=1)
    order = np.argsort(distance)
    held = np.cumsum(weight[order]) / weight.sum()
    size = float(packing.outer_radius.max())
    reach = distance[order][np.searchsorted(held, HELD)] + size
    width = max(2 * float(reach), LENGTHS * 2 * size)
    if width >= box.edges.max():
        return box
    return Box(center - 0.5 * width, np.full(2, width))


def draw_mode(axes: Axes, packing: Packing, held: BoolArray, drawn: tuple[Motion, Box]) -> Any:
    """Draw particles and arrows in a part of the box; return what the colours are of."""
    motion, seen = drawn
    box = packing.box
    part = Box(
        seen.center - (box.center - box.lo), box.edges, box.tilt
    )  # of the same periodic packing
    width = float(seen.edges.max())
    line = float(np.clip(12 / width, 0.2, 0.8))
    most = np.arange(packing.n) == np.hypot(motion.size, motion.turn).argmax()
    style: dict[str, Any] = {"edgecolors": "0.25", "lw": np.where(most, 2.5 * line, line)}
    scale = {"cmap": COLORS, "clim": (-1, 1)}
    bodies = draw_bodies(axes, packing, part, array=motion.turn, **scale, **style)
    if not held.all():
        loose = {"facecolors": RATTLER, "edgecolors": "0.25", "lw": line}
        draw_bodies(axes, taken(packing, ~held), part, **loose)
    draw_arrows(axes, packing, motion, (part, LONGEST * width))
    show_box(axes, seen)
    return bodies


def taken(packing: Packing, chosen: BoolArray) -> Packing:
    """Take some particles out of a packing."""
    names = ("position", "orientation", "diameters", "exponent", "species", "id", "image")
    return packing.with_(**{name: getattr(packing, name)[chosen] for name in names})


def draw_arrows(axes: Axes, packing: Packing, motion: Motion, scale: tuple[Box, float]) -> None:
    """Draw displacements that are not too short, in a box, the largest this long."""
    part, longest = scale
    at = images(packing.position, packing.outer_radius, part)
    seen = motion.size[at.owner] > LEAST
    shown: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "units": "inches"}
    shown |= {"width": 0.016, "headwidth": 3.6, "headlength": 4.5, "headaxislength": 4}
    arrows = longest * motion.shift[at.owner[seen]]
    axes.quiver(*at.center[seen].T, *arrows.T, minlength=0.2, **shown)


def draw(file: PackingFile, table: ModeTable, modes: list[int], options: Namespace) -> None:
    """Draw modes side by side, with a legend on the right."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    packing, columns = file.packing(), min(len(modes), 3)
    n_rows = -(-len(modes) // columns)
    size = (INCHES * columns + 0.9, (INCHES + 0.45) * n_rows + 0.2)
    figure = Figure(figsize=size, dpi=120, layout="constrained")
    panels = figure.subplots(n_rows, columns, squeeze=False).ravel()
    held = np.zeros(packing.n, bool)
    held[table.coordinates.backbone] = True
    lengths = Landscape(packing).rotation_length
    for k, (axes, mode) in enumerate(zip(panels, modes, strict=False)):
        motion = motion_of(lengths, table, mode)
        part = window(packing, motion) if options.zoom else packing.box
        bodies = draw_mode(axes, packing, held, (motion, part))
        axes.set_title(f"({chr(97 + k)})  {mode_text(table, mode)}", fontsize=9, loc="left")
    for axes in panels[len(modes) :]:
        axes.set_axis_off()
    if table.coordinates.is_rotation.any():
        add_color_bar(figure.colorbar(bodies, ax=list(panels), aspect=30, shrink=0.75, pad=0.01))
    add_key(panels[len(modes) - 1], with_rattlers=not held.all())
    figure.suptitle(packing_text(file), fontsize=9)
    save_figure(figure, options.out)


def add_key(axes: Axes, *, with_rattlers: bool) -> None:
    """Say what arrows, thick outlines and grey are, below a panel."""
    arrow = {"arrowstyle": "-|>", "lw": 1.2, "color": "k", "shrinkA": 0, "shrinkB": 0}
    below = -0.021  # of the panel; the layout cuts what is lower
    ends = ((1.0, below), (1.0 - LONGEST, below))
    axes.annotate("", *ends, xycoords="axes fraction", arrowprops=arrow)
    label: dict[str, Any] = {"ha": "right", "va": "center", "fontsize": 7}
    text = "displacement: largest motion"
    axes.text(1.0 - LONGEST - 0.02, below, text, transform=axes.transAxes, **label)
    others = "thick outline: moves most" + ", grey: rattlers" * with_rattlers
    label |= {"ha": "left", "transform": axes.transAxes}
    axes.text(0.0, below, others, **label)


def add_color_bar(bar: Any) -> None:
    """Say what the colours are."""
    bar.set_ticks([-1, -0.5, 0, 0.5, 1])
    bar.ax.tick_params(labelsize=8)
    bar.set_label(r"rotation  $A\,\delta\theta\,/$ largest motion", fontsize=8)
    note: dict[str, Any] = {"ha": "center", "fontsize": 7, "transform": bar.ax.transAxes}
    bar.ax.text(0.5, 1.02, "counter-\nclockwise", va="bottom", **note)
    bar.ax.text(0.5, -0.02, "clockwise", va="top", **note)


def row_of(table: ModeTable, mode: int) -> dict[str, Any]:
    """Describe one mode."""
    found = {"mode": mode, "eigenvalue": table["eigenvalues"][mode], "bound": table.bound[mode]}
    found["sign"] = int(table["sign"][mode])
    return found | {name: table[name][mode] for name in COLUMNS}


def parser() -> ArgumentParser:
    """Describe the command line."""
    found = parser_of(__doc__, "modes.png")
    found.add_argument("packing", type=Path, metavar="PACKING.h5")
    found.add_argument("--modes", type=Path, metavar="MODES.h5", help="of analysis/modes.py")
    found.add_argument("--mode", type=int, nargs="+", default=[], help="numbers, from 0")
    found.add_argument("--omega", type=float, nargs="+", default=[], help="frequencies")
    found.add_argument("--zoom", action="store_true", help="draw only where the mode is")
    return found


def main(options: Namespace) -> None:
    """Read, choose, draw, report."""
    file = PackingFile.read(options.packing)
    packing = file.packing()
    if packing.dimension != 2:
        msg = f"{options.packing}: is three-dimensional, expected two dimensions"
        raise ValueError(msg)
    table = table_of(packing, options.modes)
    modes = pick_modes(table, Wanted(options.mode, options.omega, PER_BAND))[:MOST]
    draw(file, table, modes, options)
    rows = [row_of(table, mode) for mode in modes]
    report({"out": options.out, **file.system().report(), "n": packing.n, "modes": rows})


if __name__ == "__main__":
    run(parser(), main)
