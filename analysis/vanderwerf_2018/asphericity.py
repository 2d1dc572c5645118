"""Draw phi_J and z_J against asphericity: the packings in the plane of VanderWerf, Jin, Shattuck & O'Hern, PRE 97, 012909 (2018).

    python analysis/vanderwerf_2018/asphericity.py SWEEP [MORE ...] --out asphericity.png

The asphericity is perimeter^2 / (4 pi area), 1 for discs. The paper states that both follow one master-like curve for
all shapes. The last line of standard output is one JSON object with averages and their standard errors.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages, rows
from common.axes import ASPHERICITY, figure_of, points
from common.ensembles import Groups, conditions, read_groups
from common.families import family, family_legend
from common.styles import PAPER_LINE
from common.text import conditions_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMES = ("phi_J", "z", "asphericity", "n_rattlers")
LINEAR_BELOW = 1e-3  # asphericity above that of discs
Z_ISO = {"discs": 4, "others": 6}


def draw(groups: Groups, options: Namespace) -> None:
    """Draw both panels."""
    figure = figure_of(10.5, 4.4)
    left, right = figure.subplots(1, 2)
    at = {s: m._replace(value=m.value - 1) for s, m in averages(groups, "asphericity").items()}
    for axes, name, text in (
        (left, "phi_J", r"packing fraction $\phi_J$"),
        (right, "z", "contacts per particle $z_J$"),
    ):
        points(axes, at, averages(groups, name))
        scale(axes)
        axes.set_ylabel(text)
    for who, z in Z_ISO.items():
        right.axhline(z, **(PAPER_LINE | {"ls": ":"} if who == "discs" else PAPER_LINE))
        right.annotate(f"isostatic, {who}", (0.98, z), xycoords=("axes fraction", "data"),
                       ha="right", va="bottom", fontsize=8, color="0.4")  # fmt: skip
    family_legend(left, groups, conditions_text(groups), loc="outside right center")
    save_figure(figure, options.out)


def scale(axes: Axes) -> None:
    """Make the axis of the asphericity logarithmic above that of discs."""
    axes.set_xscale("symlog", linthresh=LINEAR_BELOW, linscale=0.3)
    axes.set_xlim(left=-LINEAR_BELOW / 4)
    axes.set_xlabel(ASPHERICITY)


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    groups = read_groups(options.files, needs=NAMES)
    draw(groups, options)
    found = rows(groups, {name: averages(groups, name) for name in NAMES})
    for row, system in zip(found, groups, strict=True):
        row["family"] = family(system)
    report({"out": options.out, "conditions": conditions(groups), "shapes": found})


if __name__ == "__main__":
    run(parser_of(__doc__, "asphericity.png", "SWEEP"), main)
