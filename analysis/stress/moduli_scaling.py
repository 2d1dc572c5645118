"""Scaling of the shear modulus with pressure: <G> = G_0 + c p^beta of discs and rods.

    python analysis/stress/moduli_scaling.py --samples 200 --out moduli_scaling.png

Each packing is made at the lowest pressure, in a box that changes its volume only, and compressed to one pressure after the
other, as by Zhang, VanderWerf, Li, Zhang, Shattuck & O'Hern, Phys. Rev. E 104, 014901 (2021). G is the change of the shear stress
under simple shear at a fixed volume, averaged over all packings, also those of negative G. The fit gives weights by the standard errors;
the errors of beta and G_0 are those of the bootstrap over packings. Finished packings are kept in --runs: a command that is stopped and
repeated goes on. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray, IntArray
from jamshape.command import parser_of, plain, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.disk import store

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.stressed import (
    Series,
    Table,
    add_options,
    draws,
    found_of,
    mean_and_error,
    pressures_of,
    table_of,
)
from common.styles import color, marked

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BETAS = np.linspace(0.1, 2.0, 381)
PUBLISHED = {0.0: "0.5", 1.0: "0.8 to 0.9"}
"""Exponents of the paper, by alpha."""


class Fit(NamedTuple):
    """G = G_0 + c p^beta."""

    G_0: float
    c: float
    beta: float
    chi2: float


def fitted(p: FloatArray, G: FloatArray, error: FloatArray) -> Fit:
    """Fit by weighted least squares: a line in p^beta for each beta."""
    best = Fit(np.nan, np.nan, np.nan, np.inf)
    for beta in _BETAS:
        design = np.column_stack([np.ones_like(p), p**beta]) / error[:, None]
        (G_0, c), *_ = np.linalg.lstsq(design, G / error)
        chi2 = float((((G - G_0 - c * p**beta) / error) ** 2).sum())
        if chi2 < best.chi2:
            best = Fit(float(G_0), float(c), float(beta), chi2)
    return best


class Scaling(NamedTuple):
    """Averages of a system with their fit."""

    alpha: float
    n: int
    samples: int
    p: FloatArray
    G: FloatArray
    error: FloatArray
    positive: FloatArray
    """Averages over packings of positive G."""
    share: FloatArray
    """Of these."""
    undefined: FloatArray
    """Share of packings without a modulus: forces do not balance, or a floppy mode couples."""
    fit: Fit
    errors: Fit
    """Standard deviations over the bootstrap."""
    last: float
    """Highest pressure of the fit."""


def scaling_of(alpha: float, n: int, table: Table, last: float) -> Scaling:
    """Average and fit."""
    G, p = table.column("G"), table.pressures
    mean, error = mean_and_error(G)
    of = p <= last * (1 + 1e-9)
    fit = fitted(p[of], mean[of], error[of])
    drawn = np.array(
        [fitted(p[of], np.nanmean(G[k][:, of], axis=0), error[of]) for k in _few(len(G))]
    )
    return Scaling(
        alpha, n, len(G), p, mean, error, mean_and_error(np.where(G > 0, G, np.nan))[0],
        (G > 0).sum(axis=0) / np.isfinite(G).sum(axis=0), np.isnan(G).mean(axis=0),
        fit, Fit(*drawn.std(axis=0)), last,
    )  # fmt: skip


def _few(n: int) -> list[IntArray]:
    """Take a fifth of the draws, as each is fitted."""
    return list(draws(n))[::5]


def figure_from(found: list[Scaling]) -> Figure:
    """Draw G on the left and G - G_0 on the right."""
    figure = figure_of(9.5, 4.3, dpi=160)
    left, right = figure.subplots(1, 2)
    for k, of in enumerate(found):
        label = rf"$\alpha={of.alpha:g}$, {of.samples} packings"
        left.errorbar(of.p, of.G, of.error, **marked(k), label=label)
        left.plot(of.p, of.positive, ":", lw=1, color=color(k), label="the same, of $G>0$ only")
        _draw_power(right, of, k)
    left.set(xscale="log", yscale="log", ylabel=r"shear modulus $\langle G\rangle$  $[k_e/R^2]$")
    right.set(xscale="log", yscale="log", ylabel=r"$\langle G\rangle-G_0$  $[k_e/R^2]$")
    for axes in (left, right):
        axes.set_xlabel(r"pressure $p$  $[k_e/R^2]$")
        axes.legend(fontsize=7)
    first = found[0]
    names = ", ".join(f"{of.alpha:g}" for of in found)
    figure.suptitle(
        rf"spherocylinders in 2D, $\alpha={names}$, $N={first.n}$, size ratio 1.4, compressed to $p$ in square boxes"
        "\nbars: standard errors over packings, by the bootstrap; lines on the right: fits",
        fontsize=9,
    )
    return figure


def _draw_power(axes: Axes, of: Scaling, k: int) -> None:
    fit, error = of.fit, of.errors
    above = of.G - fit.G_0
    own = above > 2 * of.error
    axes.errorbar(of.p[own], above[own], of.error[own], **marked(k))
    p = of.p[of.p <= of.last * (1 + 1e-9)]
    label = rf"$\alpha={of.alpha:g}$: $\beta={fit.beta:.2f}\pm{error.beta:.2f}$"
    if of.alpha in PUBLISHED:
        label += f" (published {PUBLISHED[of.alpha]})"
    axes.plot(p, fit.c * p**fit.beta, "-", lw=0.9, color=color(k), label=label)


def rows_of(of: Scaling) -> list[dict[str, Any]]:
    """Rows of the table."""
    names = ("p", "G", "error", "positive", "share", "undefined")
    keys = ("pressure", "G", "G_error", "G_of_positive", "share_positive", "share_undefined")
    columns = [getattr(of, name) for name in names]
    return [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)]


def summary(of: Scaling) -> dict[str, Any]:
    """Describe a system in JSON."""
    numbers = {"G_0": of.fit.G_0, "G_0_error": of.errors.G_0, "c": of.fit.c, "beta": of.fit.beta}
    numbers |= {"beta_error": of.errors.beta, "chi2": of.fit.chi2, "fitted_to": of.last}
    return {"alpha": of.alpha, "n": of.n, "samples": of.samples, **numbers, "points": rows_of(of)}


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
    pressures = pressures_of(*options.pressures, options.per_decade)
    seeds = range(1, options.samples + 1)
    every = [
        Series(alpha, options.n, "isotropic", seed, pressures)
        for seed in seeds
        for alpha in options.alpha
    ]
    if not options.only_kept:
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
    store(options.out.with_suffix(".json"), json.dumps(plain(systems), indent=1).encode())
    report({"out": options.out, "systems": systems})


if __name__ == "__main__":
    run(parser(), main)
