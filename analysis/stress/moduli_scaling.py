"""Scaling of the shear modulus with pressure: <G> = G_0 + c p^beta of discs and rods.

    python analysis/stress/moduli_scaling.py --samples 200 --out moduli_scaling.png

Each packing is made at the lowest pressure, in a box that changes its volume only, and compressed to one pressure after the
other, as by Zhang, VanderWerf, Li, Zhang, Shattuck & O'Hern, Phys. Rev. E 104, 014901 (2021). G is the change of the shear stress
under simple shear at a fixed volume. Averages are over all packings, over those of positive G only, and over all packings and all directions of
shear. Fits are weighted by the standard errors; the errors of beta and G_0 are those of the bootstrap over packings. Finished packings are kept in --runs: a command that is stopped and
repeated goes on. With series.csv of sample_tables.py in place of that folder it draws from the table. The last
line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.moduli_fit import Average, average_of
from common.stressed import (
    Series,
    Table,
    add_options,
    found_of,
    mean_of,
    pressures_of,
    table_of,
    write_table,
)
from common.styles import marked

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AVERAGES = ("all", "positive", "directions")
"""G of all packings, of those of positive G, and of all packings over all directions of shear."""
DRAWN = AVERAGES[:2]


class Scaling(NamedTuple):
    """Averages of a system."""

    alpha: float
    n: int
    samples: int
    p: FloatArray
    averages: dict[str, Average]
    """By `AVERAGES`; tables of packings have no directions."""
    positive: FloatArray
    """(k,) fraction of packings of positive G."""
    undefined: FloatArray
    """(k,) fraction of packings without a modulus: forces do not balance, or a floppy mode couples."""
    last: float
    """Highest pressure of the fit."""


def columns_of(table: Table) -> dict[str, FloatArray]:
    """List (m, k) moduli to average, as in `AVERAGES`."""
    G = table.column("G")
    found = dict(zip(AVERAGES, (G, np.where(G > 0, G, np.nan), table.column("G_dc")), strict=True))
    return {name: of for name, of in found.items() if name in DRAWN or np.isfinite(of).any()}


def scaling_of(alpha: float, n: int, table: Table, last: float) -> Scaling:
    """Average and fit."""
    G, p = table.column("G"), table.pressures
    averages = {name: average_of(p, of, last) for name, of in columns_of(table).items()}
    positive = mean_of(np.where(np.isfinite(G), G > 0, np.nan))
    undefined = np.isnan(G).mean(axis=0)
    return Scaling(alpha, n, len(G), p, averages, positive, undefined, last)


def figure_from(found: list[Scaling]) -> Figure:
    """Draw G on the left and G - G_0 on the right."""
    figure = figure_of(9.5, 4.6, dpi=160)
    left, right = figure.subplots(1, 2)
    for k, of in enumerate(found):
        for j, name in enumerate(DRAWN):
            style = marked(k + j * len(found))
            label = rf"$\alpha={of.alpha:g}$, {of.samples} packings" + ", of $G>0$" * (
                name != "all"
            )
            average = of.averages[name]
            left.errorbar(of.p, average.G, average.error, **style, label=label)
            _draw_power(right, of, name, style)
    for axes in (left, right):
        is_positive = axes.dataLim.y1 > 0  # few small packings may all be unstable
        axes.set(xscale="log", xlabel=r"pressure $p$  $[k_e/R^2]$")
        axes.set_yscale("log" if is_positive else "linear")
    left.set(ylabel=r"shear modulus $\langle G\rangle$  $[k_e/R^2]$")
    right.set(ylabel=r"$\langle G\rangle-G_0$  $[k_e/R^2]$")
    left.legend(fontsize=7)
    right.legend(fontsize=7)
    names = ", ".join(f"{of.alpha:g}" for of in found)
    figure.suptitle(
        rf"spherocylinders in 2D, $\alpha={names}$, $N={found[0].n}$, size ratio 1.4, compressed to $p$ in square boxes"
        "\nbars: standard errors over packings, by the bootstrap; lines: fits of $G_0+cp^\\beta$",
        fontsize=9,
    )
    return figure


def _draw_power(axes: Axes, of: Scaling, name: str, style: dict[str, Any]) -> None:
    average = of.averages[name]
    fit, above = average.fit, average.G - average.fit.G_0
    own = above > average.error
    axes.errorbar(of.p[own], above[own], average.error[own], **style)
    p = of.p[of.p <= of.last * (1 + 1e-9)]
    label = rf"$\alpha={of.alpha:g}$" + ", $G>0$" * (name != "all")
    label += rf": $\beta=${fit.beta:.2f}$\pm${average.errors.beta:.2f}"
    axes.plot(p, fit.c * p**fit.beta, "-", lw=0.9, color=style["color"], label=label)


def summary(of: Scaling) -> dict[str, Any]:
    """Describe a system in JSON."""
    fits = {
        name: {
            "G_0": one.fit.G_0, "G_0_error": one.errors.G_0, "c": one.fit.c,
            "beta": one.fit.beta, "beta_error": one.errors.beta, "chi2": one.fit.chi2,
        }
        for name, one in of.averages.items()
    }  # fmt: skip
    points = [
        {"pressure": p, "fraction_positive": of.positive[k], "fraction_undefined": of.undefined[k]}
        | {f"G_{name}": one.G[k] for name, one in of.averages.items()}
        | {f"G_{name}_error": one.error[k] for name, one in of.averages.items()}
        for k, p in enumerate(of.p)
    ]
    told = {"alpha": of.alpha, "n": of.n, "samples": of.samples, "fitted_to": of.last}
    return {**told, "fits": fits, "points": points}


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "moduli_scaling.png")
    found.add_argument("--alpha", type=float, nargs="+", default=[0.0, 1.0])
    found.add_argument("--n", type=int, default=64)
    found.add_argument(
        "--fit-to", type=float, default=1e-2, help="highest pressure of the fit (%(default)s)"
    )
    add_options(found, samples=200)
    return found


def main(options: Namespace) -> None:
    """Make, average, fit, draw, report."""
    pressures = pressures_of(options)
    seeds = range(1, options.samples + 1)
    every = [
        Series(alpha, options.n, "isotropic", seed, pressures)
        for seed in seeds
        for alpha in options.alpha
    ]
    if not (options.only_kept or options.runs.is_file()):
        found_of(options.runs, every, options.jobs)
    tables = [
        table_of(options.runs, (one for one in every if one.alpha == a)) for a in options.alpha
    ]
    found = [
        scaling_of(alpha, options.n, table, options.fit_to)
        for alpha, table in zip(options.alpha, tables, strict=True)
    ]
    save_figure(figure_from(found), options.out)
    systems = [summary(of) for of in found]
    write_table(options, systems)
    report({"out": options.out, "systems": systems})


if __name__ == "__main__":
    run(parser(), main)
