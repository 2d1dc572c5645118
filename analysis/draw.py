"""Draw packings of any shape, in the plane and in space.

    python analysis/draw.py FILE [MORE ...] [--frame -1] [--color kind] --out packing.png

FILE is H5MD, a LAMMPS dump or a data file. In the plane black lines are along the spines, red dots where particles
touch; in space each particle whose centre is in the box is drawn whole, seen from afar. Colours tell the kinds of
particles, with rattlers in grey (unless all are); the order of the particles in contact with each, green to red as it
grows and grey without contacts: nematic (S2), tetratic (S4, in the plane), cubatic (C4, in space); the orientation;
or the packing (one). As Fig. 7 of Marschall & Teitel, PRE 97, 012905, and Figs. 2, 4 b, c and 8 b of Yuan,
VanderWerf, Shattuck & O'Hern, Soft Matter (2019). The last line of standard output is one JSON object with what
was counted.
"""

from __future__ import annotations

import contextlib
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.contacts import coordination, find_contacts, find_rattlers
from jamshape.drawing.colors import CHOICES, ORDER, Coloring, Scale
from jamshape.drawing.kinds import kinds_of
from jamshape.drawing.packing import Look, add_legend, colorings, draw_packing
from jamshape.drawing.space import save_smooth
from jamshape.drawing.text import is_told_by_parameters, scientific
from jamshape.files.h5md import FileFormatError, read_attributes
from jamshape.files.lammps_text import read_any
from jamshape.contacts import Contacts
from jamshape.measures.minimum import order

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 3
INCHES = (7.0, 5.0, 4.0)  # of the longer edge of a panel, for one column, two, three
MANY_KINDS = 3  # of which the title names no parameters
ROOM = (0.75, 1.4)  # above and below a panel, for words, of one and of several


class Picture(NamedTuple):
    """A packing with what is said of it."""

    found: Contacts
    numbers: list[str]
    """For the title."""
    report: dict[str, Any]


def picture(path: Path, options: Namespace) -> Picture:
    """Read a packing, find its contacts and count."""
    packing = read_any(path, options.frame)
    known: dict[str, Any] = {"sides": 2, "k_e": 1.0}
    with contextlib.suppress(FileFormatError):  # dumps and data files have no attributes
        known |= read_attributes(path)
    sides = known["sides"] if options.sides == "auto" else int(options.sides)
    network = find_contacts(packing, known["k_e"], sides)
    counts = coordination(packing, network)
    u = float(network.energy.sum()) / packing.box.volume
    told = {"packing": path, "shape": packing.shape_style, "dimension": packing.dimension}
    told |= {"n": packing.n, "rattlers": counts.n_rattlers, "contacts": len(network.pairs)}
    told |= {"phi": packing.phi, "u": u, "z": counts.z}
    known_order = order(packing) if options.color in ORDER else {}
    numbers = [rf"$N={packing.n}$", rf"$\phi={packing.phi:.5f}$"]
    numbers += [rf"$u={scientific(u)}$", f"$z={counts.z:.3f}$"]
    numbers += [f"step {packing.step}"] * (packing.step > 0)
    numbers += [rf"${name[0]}_{name[1]}={value:.3f}$" for name, value in known_order.items()]
    if "protocol" in known:
        numbers.append(f"protocol {known['protocol']}")
    return Picture(
        Contacts(packing, network, find_rattlers(packing, network)), numbers, told | known_order
    )


def draw(pictures: list[Picture], options: Namespace) -> list[Coloring]:
    """Draw all packings, with one scale of order."""
    look = Look(options.color, options.height, options.turn, options.level or 0)
    colored, scale = colorings([one.found for one in pictures], look.color)
    figure, panels = make_panels(pictures, with_bar=scale is not None)
    for axes, one, colors in zip(panels, pictures, colored, strict=False):
        draw_packing(axes, one.found, colors, look)
        axes.set_title(title(one, narrow=len(pictures) > 1), fontsize=9, linespacing=1.4)
        add_legend(axes, colors)
    for axes in panels[len(pictures) :]:
        axes.set_axis_off()
    if scale:
        add_bar(figure, panels, scale)
    smooth = any(one.found.packing.dimension == 3 for one in pictures)
    if smooth:
        save_smooth(figure, options.out, options.dpi)
    else:
        figure.savefig(options.out, dpi=options.dpi, bbox_inches="tight", pad_inches=0.05)
    return colored


def title(one: Picture, *, narrow: bool) -> str:
    """Name the particles, if they are few kinds, and what was counted; narrow ones in more lines."""
    packing, gap = one.found.packing, "    "
    kinds, shape = kinds_of(packing), packing.shape
    known = [f"{shape.name}s"] * (not is_told_by_parameters(shape))
    known += [kinds.title] * (0 < len(kinds.parameters) < MANY_KINDS)
    lines = [gap.join(one.numbers[:2]), gap.join(one.numbers[2:])]
    lines = lines if narrow else [gap.join(one.numbers)]
    return "\n".join([", ".join(known)] * (known != []) + lines)


def make_panels(pictures: list[Picture], *, with_bar: bool) -> tuple[Figure, Any]:
    """Make a figure with a panel for each packing, as long and wide as its box."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    columns = min(COLUMNS, len(pictures))
    rows = -(-len(pictures) // columns)
    shapes = [
        one.found.packing.box.edges[:2] for one in pictures if one.found.packing.dimension == 2
    ]
    ratios = [edges / edges.max() for edges in shapes] or [np.ones(2)]
    width, height = INCHES[columns - 1] * np.max(ratios, axis=0)
    size = (columns * width + 0.1 + 0.7 * with_bar, rows * (height + ROOM[len(pictures) > 1]))
    figure = Figure(figsize=size)
    figure.set_layout_engine("constrained", h_pad=0.1, w_pad=0.06)
    return figure, figure.subplots(rows, columns, squeeze=False).ravel()


def add_bar(figure: Figure, panels: Any, scale: Scale) -> None:
    """Explain the colours of local order."""
    bar = figure.colorbar(scale.mapped, ax=list(panels), fraction=0.04, pad=0.02, shrink=0.8)
    bar.set_label(scale.label)


def parser() -> ArgumentParser:
    """Describe the command line."""
    found = parser_of(__doc__, "packing.png")
    found.add_argument(
        "files", type=Path, nargs="+", metavar="FILE", help="H5MD, dumps, data files"
    )
    found.add_argument("--frame", type=int, default=-1, help="negative: from the end (-1)")
    found.add_argument("--color", choices=CHOICES, default="kind", help="by what (%(default)s)")
    sides = "points of a side-to-side contact; auto: as the file says, or else 2 (auto)"
    found.add_argument("--sides", choices=("auto", "1", "2"), default="auto", help=sides)
    up, around = "of the eye in space, degrees (%(default)s)", "of it about z (%(default)s)"
    found.add_argument("--height", type=float, default=22, help=up)
    found.add_argument("--turn", type=float, default=-58, help=around)
    finer = "of meshes in space, 1 to 4; each makes four triangles of one (3, or 2 for many)"
    found.add_argument("--level", type=int, choices=range(1, 5), help=finer)
    found.add_argument("--dpi", type=int, default=200, help="dots per inch (%(default)s)")
    return found


def main(options: Namespace) -> None:
    """Read, find the contacts, draw, report."""
    pictures = [picture(path, options) for path in options.files]
    colored = draw(pictures, options)
    rows = [one.report for one in pictures]
    for row, colors in zip(rows, colored, strict=True):
        if len(colors.values):
            row["mean_local"] = (
                np.nanmean(colors.values) if np.isfinite(colors.values).any() else None
            )
    # The numbers of a single packing stand at the top.
    report({"out": options.out, **(rows[0] if len(rows) == 1 else {}), "packings": rows})


if __name__ == "__main__":
    run(parser(), main)
