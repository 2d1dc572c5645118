"""Draw phi_J and z_J against asphericity: Figs. 5 and 6 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/fig_asphericity.py SWEEP [MORE ...] --quantity phi_J --out phi_j_asphericity.png
    python analysis/fig_asphericity.py SWEEP [MORE ...] --quantity z --out z_asphericity.png

phi_J in one panel, with the paper's peak, 0.70 to 0.74 near A = 0.05, and 0.64 of spheres; z_J in two, of
axisymmetric particles (z_iso = 10) and of all others (12), spheres in both. Open marks are of protocol 1, filled
ones of protocol 2. The last line of standard output is one JSON object with averages and their standard errors.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from superellipsoid_files import (
    OF_PAPER,
    PEAK,
    PHI_SPHERES,
    Z_SPHERES,
    Groups,
    averages,
    family_legend,
    parser_of,
    points,
    read_groups,
    rows,
    samples_text,
)
from sweep_files import YELLOW

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SPHERES = "spheres"
LEAST, LOG_BELOW = 1e-5, 1e-3  # asphericity: linear up to the first, which is next to 0


def draw_phi(groups: Groups, axes: Axes) -> None:
    """Draw phi_J, and where the paper says that it is."""
    at, low, high = PEAK
    axes.axhline(PHI_SPHERES, **OF_PAPER, label="spheres, paper")
    axes.axvline(at, **(OF_PAPER | {"ls": ":"}), label=r"$\mathcal{A}_c$, paper")
    band = r"peak, paper"
    axes.axhspan(low, high, color=YELLOW, alpha=0.25, lw=0, zorder=0, label=band)
    points(axes, averages(groups, "asphericity"), averages(groups, "phi_J"))
    axes.set_xlim(left=min(-0.005, axes.get_xlim()[0]))
    axes.set(xlabel=r"asphericity $\mathcal{A}$", ylabel=r"packing fraction $\phi_J$")
    family_legend(axes, groups, samples_text(groups), loc="outside right center")


def draw_z(groups: Groups, panels: list[Axes]) -> None:
    """Draw z_J below the isostatic one, of particles with and without an axis of symmetry."""
    cases = ((panels[0], True, 10), (panels[1], False, 12))
    for axes, symmetric, isostatic in cases:
        chosen = [k for k in groups if k.family == SPHERES or k.is_axisymmetric == symmetric]
        shown = {kind: groups[kind] for kind in chosen}
        points(axes, averages(shown, "asphericity"), averages(shown, "z"))
        text = rf"isostatic, $z_\mathrm{{iso}}={isostatic}$"
        axes.axhline(isostatic, **OF_PAPER, label=text)
        axes.axhline(Z_SPHERES, **(OF_PAPER | {"ls": ":"}), label="spheres, 6")
        axes.set_xscale("symlog", linthresh=LOG_BELOW, linscale=0.3)
        axes.set_xlim(-LOG_BELOW / 4, max(0.4, axes.get_xlim()[1]))
        axes.set_xlabel(r"asphericity $\mathcal{A}$")
        title = samples_text(shown) if shown else ""
        family_legend(axes, shown, title, loc="best")
    panels[0].set_ylabel("contacts per particle $z_J$")


def main() -> None:
    """Read, average, draw, report."""
    parser = parser_of(__doc__, "asphericity.png")
    what = "what is drawn (%(default)s)"
    parser.add_argument("--quantity", choices=("phi_J", "z"), default="phi_J", help=what)
    options = parser.parse_args()
    groups = read_groups(options.packings)
    draw(groups, options.quantity, options.out)
    names = (options.quantity, "asphericity", "beta", "z_iso", "n_rattlers")
    found = rows(groups, {name: averages(groups, name) for name in names})
    paper = {"spheres": PHI_SPHERES if options.quantity == "phi_J" else Z_SPHERES}
    print(json.dumps({"out": str(options.out), "shapes": found, "paper": paper}))


def draw(groups: Groups, quantity: str, out: Path) -> None:
    """Draw one figure."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    if quantity == "phi_J":
        figure = Figure(figsize=(7.4, 4.4), dpi=200, layout="constrained")
        draw_phi(groups, figure.subplots())
    else:
        figure = Figure(figsize=(9, 4.2), dpi=200, layout="constrained")
        draw_z(groups, list(figure.subplots(1, 2)))
    figure.savefig(out)


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_asphericity.py: {error}")
