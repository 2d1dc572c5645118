"""Draw phi_J of spheroids and superballs: Fig. 3 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/yuan_2019/fig03_phi_j.py SWEEP [MORE ...] --out phi_j_shapes.png

Left against the aspect ratio w of ellipsoids with two equal axes, the third over these; right against the
exponent p of particles with three equal axes. Open marks are of protocol 1, filled ones of protocol 2. The last
line of standard output is one JSON object with averages over samples and their standard errors.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.sets import System

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages, exactly, rows
from common.axes import figure_of, points
from common.ensembles import Groups, conditions, only, read_groups
from common.families import NEEDS, beta, family_legend, is_axisymmetric, shape_of
from common.styles import PAPER_LINE
from common.text import conditions_text

PHI_SPHERES = 0.64  # the paper's
TICKS = (0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3, 4)


def is_superball(system: System) -> bool:
    """Whether all axes are equal."""
    return shape_of(system)[1:] == (1, 1)


def draw(groups: Groups, options: Namespace) -> None:
    """Draw phi_J against w and against p."""
    figure = figure_of(9, 4)
    panels = figure.subplots(1, 2, sharey=True)
    cases: tuple[Any, ...] = ((is_axisymmetric, beta), (is_superball, lambda s: shape_of(s)[0]))
    for axes, (belongs, x) in zip(panels, cases, strict=True):
        shown = only(groups, belongs)
        points(axes, exactly(shown, x), averages(shown, "phi_J"))
        axes.axhline(PHI_SPHERES, **PAPER_LINE, label="spheres, paper")
        if shown:
            family_legend(axes, shown, conditions_text(shown), loc="best")
    panels[0].set_xscale("log")
    low, high = panels[0].get_xlim()
    ticks = [tick for tick in TICKS if low < tick < high]
    panels[0].set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panels[0].set_xticks([], minor=True)
    panels[0].set_xlabel("aspect ratio $w$ of spheroids")
    panels[0].set_ylabel(r"packing fraction $\phi_J$")
    panels[1].set_xlabel("exponent $p$ of superballs")
    save_figure(figure, options.out)


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    every = read_groups(options.files, needs=NEEDS)
    groups = only(every, lambda system: is_axisymmetric(system) or is_superball(system))
    if not groups:
        msg = f"none of {len(every)} shapes is a spheroid or a superball, expected one"
        raise ValueError(msg)
    draw(groups, options)
    found = rows(groups, {"phi_J": averages(groups, "phi_J")})
    told = {"out": options.out, "conditions": conditions(groups)}
    report(told | {"phi_J": found, "paper_spheres": PHI_SPHERES})


if __name__ == "__main__":
    run(parser_of(__doc__, "phi_j_shapes.png", "SWEEP"), main)
