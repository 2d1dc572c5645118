"""Draw packings side by side: Fig. 7 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig07_snapshots.py SWEEP [MORE.h5 ...] --out snapshots.png

Of each system the first sample, those of some alpha if the shape has one: particles coloured by their kind, rattlers
grey; in the plane black lines are along the spines, red dots where particles touch, two for a side-to-side
contact. The last line of standard output is one JSON object with what was counted.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from jamshape.command import parser_of, report, run
from jamshape.contacts import Contacts
from jamshape.drawing.packing import add_legend, colorings, draw_packing
from jamshape.drawing.saving import save_figure
from jamshape.drawing.space import save_smooth
from jamshape.drawing.text import packing_text

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.ensembles import Choice, Groups, choose, read_groups
from common.text import counted

PAPER_ALPHAS = (0.01, 4.0)
INCHES, ROOM = 5.0, 0.9  # of a panel, and below it
COLUMNS, MOST = 3, 2


def draw(found: list[Contacts], names: list[str], options: Namespace) -> None:
    """Draw one packing for each system."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    columns = min(COLUMNS, len(found))
    rows = -(-len(found) // columns)
    figure = Figure(figsize=(INCHES * columns, (INCHES + ROOM) * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for k, (axes, one) in enumerate(zip(panels, found, strict=False)):
        (colored,), _ = colorings([one], "kind")
        draw_packing(axes, one, colored)
        packing = one.packing
        counts = rf"$\phi={packing.phi:.4f}$, {counted(int(one.rattlers.sum()), 'rattler')}"
        axes.set_title(f"({chr(97 + k % 26)}) {names[k]}, {counts}", fontsize=9)
        add_legend(axes, colored)
    for axes in panels[len(found) :]:
        axes.set_axis_off()
    if any(one.packing.dimension == 3 for one in found):
        save_smooth(figure, options.out, options.dpi)
    else:
        save_figure(figure, options.out, dpi=options.dpi)


def chosen(groups: Groups, alphas: list[float]) -> Groups:
    """Select systems by alpha, those of the paper where none is asked for; all if none has one."""
    with_alpha = any("alpha" in dict(system.parameters) for system in groups)
    return choose(groups, "alpha", Choice(alphas, PAPER_ALPHAS, MOST)) if with_alpha else groups


def main(options: Namespace) -> None:
    """Read, find the contacts, draw, report."""
    groups = chosen(read_groups(options.files, same=()), options.alpha)
    files = [files[0] for files in groups.values()]
    found = [file.contacts() for file in files]
    draw(found, [packing_text(file) for file in files], options)
    rows: list[dict[str, Any]] = [
        system.report()
        | {"file": file.path, "seed": file.number("seed"), "n": one.packing.n}
        | {"phi": one.packing.phi, "rattlers": one.rattlers.sum()}
        | {"contacts": len(one.network.pairs)}
        for system, file, one in zip(groups, files, found, strict=True)
    ]
    report({"out": options.out, "snapshots": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "snapshots.png", "SWEEP")
    which = "of the packings (0.01 and 4 where there are such, as in the paper)"
    parser.add_argument("--alpha", type=float, nargs="+", default=[], help=which)
    parser.add_argument("--dpi", type=int, default=200, help="dots per inch (%(default)s)")
    run(parser, main)
