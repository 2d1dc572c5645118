"""Draw the shapes that were packed: Fig. 12 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/yuan_2019/fig12_shape_plane.py SWEEP [MORE ...] --out shape_plane.png

Reduced aspect ratio beta against asphericity A. Lines are oblate and prolate ellipsoids (Eqs. 8 and 9, of which the
asphericity is 1 minus what is printed) and, in grey, flat and long bodies with p = 2. The last line of
standard output is one JSON object with the shapes.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.styles import BLUE, RED
from jamshape.shapes.roundness import asphericity, axes_from

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages, exactly, rows
from common.axes import beta_axis, figure_of, points
from common.ensembles import Groups, conditions, read_groups
from common.families import NEEDS, beta, family_legend
from common.text import conditions_text

LARGEST, POINTS = 6.0, 40  # of beta, and of 1/beta
BOX = 2.0  # exponent of the grey lines


def draw(groups: Groups, options: Namespace) -> None:
    """Draw shapes and the curves that bound them."""
    figure = figure_of(7, 4.6)
    axes = figure.subplots()
    long = np.geomspace(1, LARGEST, POINTS)
    for p, style in ((1.0, "-"), (BOX, "--")):
        for bodies, values, color, name in (
            (axes_from(1 / long, np.ones_like(long)), 1 / long, BLUE, "oblate"),
            (axes_from(np.ones_like(long), long), long, RED, "prolate"),
        ):
            shown = color if p == 1 else "0.6"
            text = f"any {name} ellipsoid" if p == 1 else f"{name}, $p={BOX:g}$"
            A = asphericity(bodies, p)
            axes.plot(A, values, style, color=shown, lw=1, zorder=0, label=text)
    known = averages(groups, "asphericity")
    points(axes, known, exactly(groups, beta))
    axes.axhline(1, color="0.8", lw=0.8, ls=":", zorder=0)
    largest = max(0.36, 1.05 * max(m.value for m in known.values()))
    axes.set(xlim=(-0.01, largest), xlabel=r"asphericity $\mathcal{A}$")
    beta_axis(axes.yaxis)
    family_legend(axes, groups, conditions_text(groups, bars=False), loc="outside right center")
    save_figure(figure, options.out)


def main(options: Namespace) -> None:
    """Read, draw, report."""
    groups = read_groups(options.files, needs=(*NEEDS, "asphericity"))
    draw(groups, options)
    columns = {"asphericity": averages(groups, "asphericity"), "beta": exactly(groups, beta)}
    told = {"out": options.out, "conditions": conditions(groups)}
    report(told | {"shapes": rows(groups, columns)})


if __name__ == "__main__":
    run(parser_of(__doc__, "shape_plane.png", "SWEEP"), main)
