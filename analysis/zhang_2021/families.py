"""Draw how the shear modulus changes with pressure along geometrical families, and by changes of contacts.

    python analysis/zhang_2021/families.py --alpha 0 1 --n 64 --samples 50 --runs series --out families.png

Reads what compress.py made, or series.csv of sample_tables.py (--runs). A geometrical family is a packing at the pressures at
which its contacts stay the same. As by Zhang, VanderWerf, Li, Zhang, Shattuck & O'Hern, Phys. Rev. E 104, 014901 (2021), <G> = <G_f> + <G_r>: G_f begins at <G> of the
lowest pressure and grows by the mean of dG/dp along families (trapezoidal rule); changes of contacts contribute the rest, G_r.
Errors are those of the bootstrap over packings. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import SURE
from common.axes import figure_of
from common.stressed import (
    Series,
    Table,
    add_options,
    draws,
    mean_and_error,
    mean_of,
    pressures_of,
    table_of,
)
from common.styles import PAPER_LINE, color, marked

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Means(NamedTuple):
    """Averages over packings by pressure, (k,), with their standard errors."""

    value: FloatArray
    error: FloatArray


class Families(NamedTuple):
    """Geometrical families of a system."""

    alpha: float
    n: int
    samples: int
    p: FloatArray
    """(k,)"""
    slopes: FloatArray
    """(m, k) dG/dp of each family; NaN where contacts change, a modulus is not defined, or the sign is uncertain."""
    slope: Means
    G: Means
    G_f: Means

    @property
    def rising(self) -> FloatArray:
        """(k,) fraction of families whose G rises with pressure."""
        return mean_of(np.where(np.isfinite(self.slopes), self.slopes > 0, np.nan))


def families_of(alpha: float, n: int, table: Table) -> Families:
    """Average a system."""
    G, slopes, p = table.column("G"), table.column("slope"), table.pressures
    drawn = [by_families(p, mean_of(G[k]), mean_of(slopes[k])) for k in draws(len(G))]
    slope, of_G = Means(*mean_and_error(slopes)), Means(*mean_and_error(G))
    G_f = Means(by_families(p, of_G.value, slope.value), np.std(drawn, axis=0))
    return Families(alpha, n, len(G), p, slopes, slope, of_G, G_f)


def by_families(p: FloatArray, G: FloatArray, slope: FloatArray) -> FloatArray:
    """Integrate dG/dp from G at the lowest pressure; arrays are (k,)."""
    steps = np.diff(p) * (slope[1:] + slope[:-1]) / 2
    return np.asarray(G[0] + np.concatenate([[0.0], np.cumsum(steps)]))


def figure_from(found: Sequence[Families]) -> Figure:
    """Draw the slopes, their signs, and both contributions to G."""
    figure = figure_of(11, 4.0, dpi=85)
    left, middle, right = figure.subplots(1, 3)
    for k, of in enumerate(found):
        label = rf"$\alpha={of.alpha:g}$, {of.samples} packings"
        left.errorbar(of.p, *of.slope, **marked(k, "-"), label=label)
        middle.plot(of.p, of.rising, "o-", ms=4, lw=0.8, color=color(k))
        _draw_parts(right, of, k)
    left.axhline(0, **PAPER_LINE)
    left.set(ylabel=r"$\langle dG/dp\rangle$ along families")
    middle.set(ylabel="fraction of families whose $G$ rises", ylim=(-0.03, 1.03))
    right.set(ylabel=r"$\langle G\rangle$  $[k_e/R^2]$")
    for axes in (left, middle, right):
        axes.set(xscale="log", xlabel=r"pressure $p$  $[k_e/R^2]$")
    left.legend(fontsize=7)
    right.legend(fontsize=7)
    figure.suptitle(
        f"spherocylinders in 2D, $N={found[0].n}$, size ratio 1.4, compressed to $p$ in square boxes; bars: standard errors"
        " over packings, by the bootstrap",
        fontsize=9,
    )
    return figure


def _draw_parts(axes: Axes, of: Families, k: int) -> None:
    name = rf"$\alpha={of.alpha:g}$"
    axes.errorbar(of.p, *of.G, **marked(k, "-"), label=rf"$G$, {name}")
    for part, line, label in ((of.G_f.value, "--", "G_f"), (of.G.value - of.G_f.value, ":", "G_r")):
        axes.plot(of.p, part, line, lw=1, color=color(k), label=rf"${label}$, {name}")
    axes.set_yscale("symlog", linthresh=1e-3)


def summary(of: Families, discs: Families) -> dict[str, Any]:
    """Describe a system in JSON; families of the lowest pressure are counted."""
    first = of.slopes[:, 0][np.isfinite(of.slopes[:, 0])]
    off = of.G_f.value[-1] - discs.G_f.value[-1]
    columns = {"slope": of.slope, "G": of.G, "G_f": of.G_f}
    points = [
        {"pressure": p, "fraction_rising": of.rising[k]}
        | {"fraction_same_contacts": np.isfinite(of.slopes[:, k]).mean()}
        | {name: means.value[k] for name, means in columns.items()}
        | {f"{name}_error": means.error[k] for name, means in columns.items()}
        | {"G_r": of.G.value[k] - of.G_f.value[k]}
        for k, p in enumerate(of.p)
    ]
    told = {"alpha": of.alpha, "n": of.n, "samples": of.samples, "families": len(first)}
    told |= {"rising": int((first > 0).sum()), "falling": int((first < 0).sum())}
    told["has_both"] = int(min(told["rising"], told["falling"]) > 0)
    told["G_f_above_discs"] = int(off > SURE * np.hypot(of.G_f.error[-1], discs.G_f.error[-1]))
    return {**told, "points": points}


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "families.png")
    found.add_argument("--alpha", type=float, nargs="+", default=[0.0, 1.0])
    found.add_argument("--n", type=int, default=64)
    add_options(found, samples=50)
    return found


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    pressures, seeds = pressures_of(options), range(1, options.samples + 1)
    found = []
    for alpha in sorted(options.alpha):
        series = [Series(alpha, options.n, "isotropic", seed, pressures) for seed in seeds]
        found.append(families_of(alpha, options.n, table_of(options.runs, series)))
    save_figure(figure_from(found), options.out)
    report({"out": options.out, "systems": [summary(of, found[0]) for of in found]})


if __name__ == "__main__":
    run(parser(), main)
