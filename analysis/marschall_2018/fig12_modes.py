"""Draw modes of a packing: Figs. 12 and 16 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_modes.py PACKING.h5 --modes MODES.h5 --omega 3e-3 3e-2 --out modes.png
    python analysis/fig_modes.py PACKING.h5 --modes MODES.h5 --mode 0 20 --zoom --out modes.png

MODES.h5 is of analysis/modes.py with --vectors; without it modes are found here. Modes are numbered from 0 by
ascending eigenvalue, or those next to a frequency are taken; else one of each of the two lowest bands. Arrows
are displacements, colours rotations: blue counterclockwise, red clockwise; both over the largest displacement or
rotation A theta of the mode. Rattlers are grey. With --zoom only that part of the box is drawn which most
of the mode is in. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from draw import RATTLER, images, outlines
from mode_files import mode_text, pick_modes, table_of

from jamshape.arrays import FloatArray
from jamshape.files.h5md import read_packing
from jamshape.packing import Box, Packing
from jamshape.vibration.table import ModeTable

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


class Motion(NamedTuple):
    """One mode, over its largest displacement or rotation."""

    shift: FloatArray
    """(N, 2)"""
    turn: FloatArray
    """(N,) A theta."""


def motion_of(packing: Packing, table: ModeTable, mode: int) -> Motion:
    """Take one mode of a table, as particles move."""
    shift, turn = table.coordinates.motion(table.vectors[:, mode])
    length = packing.half_length * turn[:, 0]
    largest = max(np.sqrt((shift**2).sum(axis=1)).max(), np.abs(length).max())
    return Motion(shift / largest, length / largest)


def window(packing: Packing, motion: Motion) -> tuple[FloatArray, float]:
    """Find the centre and the width of a square that holds most of the mode."""
    weight = (motion.shift**2).sum(axis=1) + motion.turn**2
    box, center = packing.box, packing.position[np.argmax(weight)]
    away = packing.position - center
    away -= box.edges * np.rint(away / box.edges)
    distance = np.abs(away).max(axis=1)
    order = np.argsort(distance)
    held = np.cumsum(weight[order]) / weight.sum()
    size = float((packing.half_length + packing.radius).max())
    reach = distance[order][np.searchsorted(held, HELD)] + size
    width = max(2 * float(reach), LENGTHS * 2 * size)
    return center, min(width, float(box.edges.max()))


def draw_mode(axes: Axes, packing: Packing, held: Any, motion: Motion, *, zoom: bool) -> Any:
    """Draw particles and arrows; return what the colours are of."""
    from matplotlib.collections import PolyCollection  # noqa: PLC0415 - not needed for --help

    center, width = window(packing, motion)
    box = packing.box
    if not zoom or width >= box.edges.max():
        center, width = box.lo + 0.5 * box.edges, float(box.edges.max())
    part = Box(center - 0.5 * box.edges, box.edges)  # of the same periodic packing
    A, R = packing.half_length, packing.radius
    reach = A[:, None] * np.abs(packing.axes) + R[:, None]
    i, place = images(packing.position, reach, part)
    line = float(np.clip(12 / width, 0.2, 0.8))
    most = np.hypot(np.sqrt((motion.shift**2).sum(axis=1)), motion.turn).argmax()
    bodies = PolyCollection(
        list(outlines(place, packing.axes[i], A[i], R[i])),
        array=motion.turn[i],
        cmap=COLORS,
        clim=(-1, 1),
        edgecolors="0.25",
        lw=np.where(i == most, 2.5 * line, line),
    )
    axes.add_collection(bodies)
    loose = ~held[i]
    grey = outlines(place[loose], packing.axes[i][loose], A[i][loose], R[i][loose])
    axes.add_collection(PolyCollection(list(grey), facecolors=RATTLER, edgecolors="0.25", lw=line))
    longest = LONGEST * width
    arrows: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "units": "inches"}
    arrows |= {"width": 0.016, "headwidth": 3.6, "headlength": 4.5, "headaxislength": 4}
    seen = np.sqrt((motion.shift[i] ** 2).sum(axis=1)) > LEAST
    axes.quiver(*place[seen].T, *(longest * motion.shift[i][seen]).T, minlength=0.2, **arrows)
    low, high = center - 0.5 * width, center + 0.5 * width
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xticks=[], yticks=[])
    return bodies


def draw(packing: Packing, table: ModeTable, modes: list[int], out: Path, *, zoom: bool) -> None:
    """Draw modes side by side, with a legend on the right."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    columns = min(len(modes), 3)
    n_rows = -(-len(modes) // columns)
    size = (INCHES * columns + 0.9, (INCHES + 0.45) * n_rows)
    figure = Figure(figsize=size, dpi=120, layout="constrained")
    panels = figure.subplots(n_rows, columns, squeeze=False).ravel()
    held = np.zeros(packing.n, bool)
    held[table.coordinates.backbone] = True
    for k, (axes, mode) in enumerate(zip(panels, modes, strict=False)):
        bodies = draw_mode(axes, packing, held, motion_of(packing, table, mode), zoom=zoom)
        axes.set_title(f"({chr(97 + k)})  {mode_text(table, mode)}", fontsize=9, loc="left")
    for axes in panels[len(modes) :]:
        axes.set_axis_off()
    if table.coordinates.is_rotation.any():
        add_color_bar(figure.colorbar(bodies, ax=list(panels), aspect=30, shrink=0.75, pad=0.01))
    arrow = {"arrowstyle": "-|>", "lw": 1.2, "color": "k", "shrinkA": 0, "shrinkB": 0}
    last = panels[columns * n_rows - 1]
    last.annotate(
        "", (1.0, -0.035), (1.0 - LONGEST, -0.035), xycoords="axes fraction", arrowprops=arrow
    )
    label = {"ha": "right", "va": "center", "fontsize": 8, "transform": last.transAxes}
    last.text(1.0 - LONGEST - 0.02, -0.035, "displacement: largest motion", **label)
    figure.savefig(out)


def add_color_bar(bar: Any) -> None:
    """Say what the colours are."""
    bar.set_ticks([-1, -0.5, 0, 0.5, 1])
    bar.ax.tick_params(labelsize=8)
    bar.set_label(r"rotation  $A\,\delta\theta\,/$ largest motion", fontsize=8)
    bar.ax.text(0.5, 1.02, "counter-\nclockwise", **_note(bar.ax, "bottom"))
    bar.ax.text(0.5, -0.02, "clockwise", **_note(bar.ax, "top"))


def _note(axes: Axes, va: str) -> dict[str, Any]:
    return {"ha": "center", "va": va, "fontsize": 7, "transform": axes.transAxes}


def report(table: ModeTable, mode: int) -> dict[str, Any]:
    """Describe one mode."""
    found = {"mode": mode, "eigenvalue": float(table["eigenvalues"][mode])}
    found |= {"bound": float(table.bound[mode]), "sign": int(table["sign"][mode])}
    names = ("omega", "participation", "parallel", "perpendicular", "rotation")
    return found | {name: float(table[name][mode]) for name in names}


def parse() -> Namespace:
    """Read the command line."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("packing", type=Path, metavar="PACKING.h5")
    parser.add_argument("--modes", type=Path, metavar="MODES.h5", help="of analysis/modes.py")
    parser.add_argument("--mode", type=int, nargs="+", default=[], help="numbers, from 0")
    parser.add_argument("--omega", type=float, nargs="+", default=[], help="frequencies")
    parser.add_argument("--zoom", action="store_true", help="draw only where the mode is")
    parser.add_argument("--out", type=Path, default=Path("modes.png"), help="(%(default)s)")
    return parser.parse_args()


def main(options: Namespace) -> None:
    """Read, choose, draw, report."""
    packing = read_packing(options.packing)
    if packing.dimension != 2:
        msg = f"{options.packing}: is three-dimensional, expected two dimensions"
        raise ValueError(msg)
    table = table_of(packing, options.modes)
    modes = pick_modes(table, options.mode, options.omega, PER_BAND)[:MOST]
    draw(packing, table, modes, options.out, zoom=options.zoom)
    rows = [report(table, mode) for mode in modes]
    print(json.dumps({"out": str(options.out), "modes": rows}))


if __name__ == "__main__":
    try:
        main(parse())
    except (OSError, ValueError) as error:
        sys.exit(f"fig_modes.py: {error}")
