"""Stability to shear of discs, and moduli of packings that are stable, against p N^2.

    python analysis/stress/shear_stability.py --n 64 128 256 --samples 100 --out shear_stability.png

Two ensembles: packings in boxes that change their volume only, of which some are unstable to shear (Dagois-Bohy, Tighe, Simon, Henkes
& van Hecke, Phys. Rev. Lett. 109, 095703 (2012)), and packings in boxes that yield freely, which have no shear stress and are
stable. Their contacts beyond 2 N - 1 and 2 N + 1 (N without rattlers), their shear modulus averaged over directions
and bulk modulus are expected to depend on p N^2 (Goodrich, Dagois-Bohy, Tighe, van Hecke, Liu & Nagel, Phys. Rev. E 90, 022138
(2014)). A line is fitted to log(G N) at p N^2 > --large. Each packing is made at the lowest pressure and compressed to one after the
other. Finished packings are kept in --runs: a command that is stopped and repeated goes on. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray, IntArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.stressed import (
    Series,
    Table,
    add_options,
    draws,
    found_of,
    mean_and_error,
    mean_of,
    pressures_of,
    table_of,
    write_table,
)
from common.styles import marked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ISOTROPIC, FREE = "isotropic", "free"
LEAST = {ISOTROPIC: -1, FREE: 1}
"""Least number of contacts beyond 2 N of packings of discs with a bulk modulus, and with all moduli."""


class Size(NamedTuple):
    """Averages of packings of one size; each with its error, by pressure."""

    n: int
    samples: dict[str, int]
    x: FloatArray
    """p N^2"""
    unstable: FloatArray
    """(2, k) fraction of the packings in boxes of fixed shape."""
    undecided: int
    """Of these packings, at all pressures."""
    still_unstable: int
    """Packings in free boxes that are not known to be stable."""
    excess: dict[str, FloatArray]
    """(2, k) contacts beyond the least number, by box."""
    least_excess: dict[str, float]
    G: FloatArray
    """(2, k) G N in free boxes."""
    K: FloatArray
    """(2, k)"""
    failed: int
    """Packings whose forces do not balance."""


def size_of(n: int, tables: dict[str, Table]) -> Size:
    """Average the packings of one size."""
    fixed, free = tables[ISOTROPIC], tables[FREE]
    stable = fixed.column("is_stable")
    excess = {
        box: table.column("n_bonds") - 2 * table.column("n_particles") - LEAST[box]
        for box, table in tables.items()
    }
    done = [table.column("reached") > 0 for table in tables.values()]
    failed = sum(int((~one).sum()) for one in done)
    return Size(
        n=n,
        samples={box: len(table) for box, table in tables.items()},
        x=fixed.pressures * n**2,
        unstable=_fraction(1 - stable),
        undecided=int((done[0] & np.isnan(stable)).sum()),
        still_unstable=int((done[1] & ~(free.column("is_stable") > 0)).sum()),
        excess={box: np.array(mean_and_error(one)) for box, one in excess.items()},
        least_excess={box: float(np.nanmin(one)) for box, one in excess.items()},
        G=n * np.array(mean_and_error(free.column("G_dc"))),
        K=np.array(mean_and_error(free.column("K"))),
        failed=failed,
    )


def _fraction(is_so: FloatArray) -> FloatArray:
    """(2, k) fraction of known packings, with the error of a binomial distribution; half a packing at least."""
    known = np.isfinite(is_so).sum(axis=0)
    fraction = mean_of(is_so)
    inner = np.clip(fraction, 0.5 / known, 1 - 0.5 / known)
    return np.array([fraction, np.sqrt(inner * (1 - inner) / known)])


class Slope(NamedTuple):
    """Power of G N at large p N^2, over all sizes, and its limit at small ones."""

    power: float
    power_error: float
    plateau: float
    plateau_error: float
    large: float
    small: float


def slope_of(tables: dict[int, Table], large: float, small: float) -> Slope:
    """Fit a line to log(G N) against log(p N^2), and average G N below; errors by the bootstrap."""
    drawn = [
        _slope({n: table.column("G_dc")[k] for (n, table), k in zip(tables.items(), of, strict=True)},
               tables, large, small)
        for of in _drawn(tables)
    ]  # fmt: skip
    power, plateau = _slope({n: t.column("G_dc") for n, t in tables.items()}, tables, large, small)
    errors = np.std(drawn, axis=0)
    return Slope(power, float(errors[0]), plateau, float(errors[1]), large, small)


def _drawn(tables: dict[int, Table]) -> Iterator[tuple[IntArray, ...]]:
    return zip(*(draws(len(table)) for table in tables.values()), strict=True)


def _slope(
    G: dict[int, FloatArray], tables: dict[int, Table], large: float, small: float
) -> tuple[float, float]:
    x = np.concatenate([table.pressures * n**2 for n, table in tables.items()])
    y = np.concatenate([n * mean_of(G[n]) for n in tables])
    of = (x > large) & (y > 0)
    power = np.polyfit(np.log(x[of]), np.log(y[of]), 1)[0] if of.sum() > 1 else np.nan
    return float(power), float(y[x < small].mean()) if (x < small).any() else np.nan


def figure_from(sizes: list[Size], slope: Slope) -> Figure:
    """Draw stability, contacts, shear and bulk modulus."""
    figure = figure_of(9.5, 7.2, dpi=150)
    panels = figure.subplots(2, 2)
    for k, of in enumerate(sizes):
        label = f"$N={of.n}$, {of.samples[ISOTROPIC]} packings"
        panels[0, 0].errorbar(of.x, *of.unstable, **marked(k, "-"), label=label)
        label = f"$N={of.n}$, {of.samples[FREE]} packings"
        for axes, values in (
            (panels[0, 1], of.excess[FREE]),
            (panels[1, 0], of.G),
            (panels[1, 1], of.K),
        ):
            axes.errorbar(of.x, *values, **marked(k), label=label)
    x = np.geomspace(slope.large, max(of.x[-1] for of in sizes), 2)
    biggest = sizes[-1]
    y = biggest.G[0][-1] * (x / biggest.x[-1]) ** 0.5
    panels[1, 0].plot(x, y, "-", color="0.5", lw=0.9, label="slope 1/2")
    labels = (
        ("fraction unstable to shear", "boxes of fixed shape"),
        ("contacts beyond $2N+1$", "boxes that yield freely"),
        (r"$G_{dc}N$  $[k_e/R^2]$", rf"$G_{{dc}}N\sim(pN^2)^b$ at $pN^2>{slope.large:g}$, $b=${slope.power:.2f}$\pm${slope.power_error:.2f}"),
        (r"$K$  $[k_e/R^2]$", "boxes that yield freely"),
    )  # fmt: skip
    for axes, (name, title) in zip(panels.flat, labels, strict=True):
        axes.set(xscale="log", xlabel=r"$pN^2$  $[k_e/R^2]$", ylabel=name)
        axes.set_title(title, fontsize=9)
        axes.legend(fontsize=7)
    panels[0, 1].set_yscale("symlog", linthresh=1)
    panels[0, 1].set_ylim(-0.3, 1.5 * max(of.excess[FREE][0][-1] for of in sizes))
    panels[1, 0].set_yscale("log")
    panels[1, 1].set_ylim(bottom=0)
    figure.suptitle(
        r"spherocylinders in 2D, $\alpha=0$ (discs), size ratio 1.4, compressed from pressure to pressure"
        "\nbars: standard errors over packings",
        fontsize=9,
    )
    return figure


def summary(of: Size, pressures: FloatArray) -> dict[str, Any]:
    """Describe a size in JSON."""
    columns = {
        "unstable": of.unstable, "excess_fixed": of.excess[ISOTROPIC], "excess_free": of.excess[FREE],
        "G_N": of.G, "K": of.K,
    }  # fmt: skip
    points = [
        {"pressure": p, "p_N2": x}
        | {
            name + end: value[row, k]
            for name, value in columns.items()
            for row, end in enumerate(("", "_error"))
        }
        for k, (p, x) in enumerate(zip(pressures, of.x, strict=True))
    ]
    counts = {name: getattr(of, name) for name in ("undecided", "still_unstable", "failed")}
    told = {"n": of.n, "samples": of.samples, **counts, "least_excess": of.least_excess}
    return told | {"points": points}


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "shear_stability.png")
    found.add_argument("--n", type=int, nargs="+", default=[64, 128, 256])
    found.add_argument("--large", type=float, default=10.0, help="p N^2 of the fit (%(default)s)")
    found.add_argument(
        "--small", type=float, default=0.1, help="p N^2 of the plateau (%(default)s)"
    )
    add_options(found, samples=100)
    return found


def main(options: Namespace) -> None:
    """Make, average, draw, report."""
    pressures = pressures_of(options)
    seeds = range(1, options.samples + 1)
    every = {
        (n, box): [Series(0.0, n, box, seed, pressures) for seed in seeds]
        for n in options.n
        for box in LEAST
    }
    if not options.only_kept:
        found_of(
            options.runs,
            [of for one in zip(*every.values(), strict=True) for of in one],
            options.jobs,
        )
    tables = {key: table_of(options.runs, of) for key, of in every.items()}
    sizes = [size_of(n, {box: tables[n, box] for box in LEAST}) for n in options.n]
    slope = slope_of({n: tables[n, FREE] for n in options.n}, options.large, options.small)
    save_figure(figure_from(sizes, slope), options.out)
    found = {"slope": slope, "sizes": [summary(of, np.array(pressures)) for of in sizes]}
    write_table(options, found)
    report({"out": options.out, **found})


if __name__ == "__main__":
    run(parser(), main)
