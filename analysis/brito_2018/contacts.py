"""Draw the contacts of nearly round particles against asphericity.

    python analysis/brito_2018/contacts.py SWEEP [MORE ...] --out contacts.png

z - z_0 against Delta, the aspect ratio less 1; z_0 is the mean contact number of the round particles in the sweeps, in
the same dimension and number. A power is fitted to each family with three shapes or more up to --fit-to. Brito, Ikeda,
Urbani, Wyart & Zamponi, PNAS 115, 11736 (2018), state that packings are hypostatic: z < z_iso. The last line of standard
output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.ensembles import System
from jamshape.measures.averages import Mean

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages
from common.axes import figure_of
from common.ensembles import Groups, conditions, read_groups
from common.families import family, family_legend, mark
from common.styles import PAPER_LINE
from common.text import conditions_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDS = ("z", "z_iso", "aspect_ratio")
_ROUND = 1e-9  # of the aspect ratio
_FEWEST = 3  # shapes of a fit


class Point(NamedTuple):
    """A shape."""

    system: System
    Delta: float
    z: Mean
    excess: Mean
    """z - z_0"""
    hypostatic: int
    """Packings with fewer contacts than z_iso."""
    packings: int


class Power(NamedTuple):
    """z - z_0 = c Delta^x of a family."""

    c: float
    x: float
    x_error: float
    """Of the weighted fit of logarithms."""


def points_of(groups: Groups) -> list[Point]:
    """Subtract the contacts of round particles.

    Raises
    ------
    ValueError
        If a dimension has no round particles.
    """
    z, ratio = averages(groups, "z"), averages(groups, "aspect_ratio")
    z_0 = {s.dimension: z[s] for s in groups if ratio[s].value < 1 + _ROUND}
    found = []
    for system, files in groups.items():
        if system.dimension not in z_0:
            msg = f"no packing in {system.dimension}D is of round particles, expected some for z_0; add such a sweep"
            raise ValueError(msg)
        base = z_0[system.dimension]
        excess = Mean(z[system].value - base.value, float(np.hypot(z[system].error, base.error)))
        below = sum(file.number("z") < file.number("z_iso") - 1e-9 for file in files)
        found.append(Point(system, ratio[system].value - 1, z[system], excess, below, len(files)))
    return [one for one in found if one.Delta > _ROUND]


def powers_of(points: list[Point], fit_to: float) -> dict[str, Power]:
    """Fit a power to each family in each dimension."""
    found: dict[str, list[Point]] = {}
    for one in points:
        if one.Delta <= fit_to * (1 + _ROUND) and one.excess.value > 0:
            found.setdefault(name_of(one.system), []).append(one)
    return {name: power_of(of) for name, of in found.items() if len(of) >= _FEWEST}


def name_of(system: System) -> str:
    """Name a family and its dimension."""
    return f"{family(system)} in {system.dimension}D"


def power_of(points: list[Point]) -> Power:
    """Fit a line to logarithms, weighted by relative errors."""
    x, y = np.log([one.Delta for one in points]), np.log([one.excess.value for one in points])
    weights = [one.excess.value / one.excess.error for one in points]
    (slope, offset), covariance = np.polyfit(x, y, 1, w=weights, cov="unscaled")
    return Power(float(np.exp(offset)), float(slope), float(np.sqrt(covariance[0, 0])))


def figure_from(
    points: list[Point], powers: Mapping[str, Power], groups: Groups, fit_to: float
) -> Figure:
    """Draw z - z_0, the fits and a slope of 1/2."""
    figure = figure_of(8.6, 4.6, dpi=100)
    axes = figure.subplots()
    for one in points:
        style: dict[str, Any] = mark(one.system) | {"ls": "none", "capsize": 2}
        style["mfc"] = style["color"] if one.system.dimension == 3 else "none"
        axes.errorbar(one.Delta, one.excess.value, one.excess.error, **style)
    Delta = np.geomspace(min(one.Delta for one in points), fit_to, 20)
    for name, power in powers.items():
        of = next(one.system for one in points if name_of(one.system) == name)
        label = rf"{name}: $\Delta^{{{power.x:.3f}\pm{power.x_error:.1g}}}$"
        line: dict[str, Any] = {"color": mark(of)["color"], "ls": ":" if of.dimension == 3 else "-"}
        axes.plot(Delta, power.c * Delta**power.x, lw=0.9, label=label, **line)
    axes.plot(Delta, 2.5 * Delta**0.5, label=r"slope of $\Delta^{1/2}$", **PAPER_LINE)
    axes.set(xscale="log", yscale="log", ylabel="$z-z_0$")
    axes.set_xlabel(
        r"$\Delta$, aspect ratio $-\,1$; spherocylinders: $\alpha =\Delta$, ellipses: $w_1=1/(1+\Delta)$"
    )
    title = f"{conditions_text(groups)}; filled: 3D"
    family_legend(axes, [one.system for one in points], title, loc="outside right center")
    return figure


def main(options: Namespace) -> None:
    """Read, fit, draw, report."""
    groups = read_groups(options.files, needs=NEEDS)
    points = points_of(groups)
    powers = powers_of(points, options.fit_to)
    save_figure(figure_from(points, powers, groups, options.fit_to), options.out)
    rows: list[dict[str, Any]] = [
        {"family": name_of(p.system), "Delta": p.Delta, "z": p.z, "excess": p.excess}
        | {"hypostatic": p.hypostatic, "packings": p.packings}
        for p in points
    ]
    counts = {name: sum(row[name] for row in rows) for name in ("hypostatic", "packings")}
    fits = [{"family": name} | power._asdict() for name, power in powers.items()]
    told = {"conditions": conditions(groups), **counts, "powers": fits, "shapes": rows}
    report({"out": options.out, **told})


if __name__ == "__main__":
    parser = parser_of(__doc__, "contacts.png", "SWEEP")
    parser.add_argument("--fit-to", type=float, default=0.3, help="largest Delta (%(default)s)")
    run(parser, main)
