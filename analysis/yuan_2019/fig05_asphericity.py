"""Draw phi_J and z_J against asphericity: Figs. 5 and 6 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/yuan_2019/fig05_asphericity.py SWEEP [MORE ...] --quantity phi_J --out phi_j_asphericity.png
    python analysis/yuan_2019/fig05_asphericity.py SWEEP [MORE ...] --quantity z --out z_asphericity.png

phi_J in one panel, with the paper's peak, 0.70 to 0.74 near A = 0.05, and 0.64 of spheres; z_J in two, of
axisymmetric particles (z_iso = 10) and of all others (12), spheres in both. Open marks are of protocol 1, filled
ones of protocol 2. The last line of standard output is one JSON object with averages and their standard errors.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.styles import YELLOW

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages, rows
from common.axes import figure_of, points
from common.ensembles import Groups, conditions, read_groups
from common.families import NEEDS, SPHERES, family, family_legend, is_axisymmetric
from common.styles import PAPER_LINE
from common.text import conditions_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PHI_SPHERES, Z_SPHERES = 0.64, 6.0  # the paper's
PEAK = (0.05, 0.70, 0.74)  # asphericity at the peak of phi_J, and where phi_J lies there
LOG_BELOW = 1e-3  # asphericity: linear up to this, which is next to 0


def draw_phi(groups: Groups, axes: Axes) -> None:
    """Draw phi_J, and where the paper says that it is."""
    at, low, high = PEAK
    axes.axhline(PHI_SPHERES, **PAPER_LINE, label="spheres, paper")
    axes.axvline(at, **(PAPER_LINE | {"ls": ":"}), label=r"$\mathcal{A}_c$, paper")
    axes.axhspan(low, high, color=YELLOW, alpha=0.25, lw=0, zorder=0, label="peak, paper")
    points(axes, averages(groups, "asphericity"), averages(groups, "phi_J"))
    axes.set_xlim(left=min(-0.005, axes.get_xlim()[0]))
    axes.set(xlabel=r"asphericity $\mathcal{A}$", ylabel=r"packing fraction $\phi_J$")
    family_legend(axes, groups, conditions_text(groups), loc="outside right center")


def draw_z(groups: Groups, panels: list[Axes]) -> None:
    """Draw z_J below the isostatic one, of particles with and without an axis of symmetry."""
    for axes, symmetric, isostatic in ((panels[0], True, 10), (panels[1], False, 12)):
        shown = {
            system: files
            for system, files in groups.items()
            if family(system) == SPHERES or is_axisymmetric(system) == symmetric
        }
        points(axes, averages(shown, "asphericity"), averages(shown, "z"))
        text = rf"isostatic, $z_\mathrm{{iso}}={isostatic}$"
        axes.axhline(isostatic, **PAPER_LINE, label=text)
        axes.axhline(Z_SPHERES, **(PAPER_LINE | {"ls": ":"}), label="spheres, 6")
        axes.set_xscale("symlog", linthresh=LOG_BELOW, linscale=0.3)
        axes.set_xlim(-LOG_BELOW / 4, max(0.4, axes.get_xlim()[1]))
        axes.set_xlabel(r"asphericity $\mathcal{A}$")
        text = "with an axis of symmetry" if symmetric else "without"
        axes.set_title(text, fontsize=9)
        axes.legend(loc="lower right", fontsize=8)
    panels[0].set_ylabel("contacts per particle $z_J$")
    family_legend(panels[0], groups, conditions_text(groups), loc="outside right center")


def draw(groups: Groups, options: Namespace) -> None:
    """Draw one figure."""
    if options.quantity == "phi_J":
        figure = figure_of(7.4, 4.4)
        draw_phi(groups, figure.subplots())
    else:
        figure = figure_of(11, 4.2)
        draw_z(groups, list(figure.subplots(1, 2)))
    save_figure(figure, options.out)


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    names = (options.quantity, "asphericity", "beta", "z_iso", "n_rattlers")
    groups = read_groups(options.files, needs=(*NEEDS, *names))
    draw(groups, options)
    found = rows(groups, {name: averages(groups, name) for name in names})
    paper = {"spheres": PHI_SPHERES if options.quantity == "phi_J" else Z_SPHERES}
    told = {"out": options.out, "conditions": conditions(groups)}
    report(told | {"shapes": found, "paper": paper})


if __name__ == "__main__":
    parser = parser_of(__doc__, "asphericity.png", "SWEEP")
    what = "what is drawn (%(default)s)"
    parser.add_argument("--quantity", choices=("phi_J", "z"), default="phi_J", help=what)
    run(parser, main)
