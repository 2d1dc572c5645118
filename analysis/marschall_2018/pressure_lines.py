"""Draw zeros of lines through p(phi): phi_J as in Figs. 3 and 4 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/pressure_lines.py RUN.h5 [MORE.h5 ...] --quasistatic FOLDER --out pressure_lines.png

Runs are of `jamshape slow` or `compress`, FOLDER is of quasistatic_pressure.py, or the table of its packings of
sample_tables.py, with their pressures in the folders that it names. A line is fitted to the rows of each sample
whose pressures are between two values, --windows, anew after each drop of the pressure, and its zero is averaged over samples, with standard errors; bars
over the axis of pressure show these values. Below jamming the pressure of a driven packing is viscous, and such lines vanish
where flow begins; above it plastic events lower the pressure, and lines beyond the first of them vanish above the first
jamming of the packing. Horizontal lines are the first jamming of the packings of FOLDER, phi_J after the box was opened
again, and the paper's phi_J. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import csv
import itertools
import math
import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import pressure_unit, scientific, systems_text
from jamshape.files.ensembles import PackingFile, System
from jamshape.measures.averages import Mean
from jamshape.measures.packing_summary import energy_onset
from jamshape.measures.runs import read_run

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean, mean_over
from common.axes import SMALL_TEXT, figure_of
from common.ensembles import distances, finished, of_paper
from common.mode_axes import energy_text
from common.published import PHI_J
from common.styles import PAPER_LINE, marked
from common.text import counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WINDOWS = ("5e-4,2e-3", "1e-3,3e-3", "2e-3,5e-3", "5e-3,1e-2")
FEWEST = 4  # rows of a line
DROP = 0.02  # relative fall of the pressure that ends a line
QUASISTATIC = 0.0  # in place of a rate


class Place(NamedTuple):
    """A panel of the figure."""

    system: System
    n: int

    @classmethod
    def of(cls, file: PackingFile) -> Place:
        """Return the panel of a packing or a run, whatever its protocol."""
        return cls(file.system()._replace(protocol=""), int(file.number("n")))


class Curve(NamedTuple):
    """The pressure of one sample."""

    phi: FloatArray
    pressure: FloatArray


class Opened(NamedTuple):
    """A packing that was compressed quasistatically and opened again."""

    first: float
    """phi_J before, the first jamming."""
    end: float
    """phi from which it was opened."""
    drop: float
    """Pressure from which it dropped first; NaN if it never did."""
    file: PackingFile
    """The packing that is left."""


class Window(NamedTuple):
    """Pressures of the rows of a line."""

    low: float
    high: float

    @classmethod
    def of(cls, text: str) -> Window:
        """Read two pressures, such as 1e-3,3e-3.

        Raises
        ------
        ValueError
        """
        try:
            low, high = map(float, text.split(","))
        except ValueError:
            low = high = math.nan
        if not 0 < low < high:
            msg = f"--windows has {text!r}, expected two pressures such as 1e-3,3e-3"
            raise ValueError(msg)
        return cls(low, high)


Rates = dict[float, list[Curve]]
"""Samples by rate."""


def rises(pressure: FloatArray) -> list[slice]:
    """Split a pressure where it drops.

    Examples
    --------
    >>> rises(np.array([0.1, 0.2, 0.3, 0.2, 0.3]))
    [slice(0, 3, None), slice(3, 5, None)]
    """
    starts, top = [0], 0.0
    for k, p in enumerate(pressure):
        if p < (1 - DROP) * top:
            starts.append(k)
            top = p
        top = max(top, p)
    return [slice(*ends) for ends in itertools.pairwise([*starts, len(pressure)])]


def zero_of(curve: Curve, window: Window) -> float:
    """Fit a line to the rows of each rise whose pressure is in a window, and return its zero; NaN if they are too few.

    Of several rises it is the mean of their zeros, weighted with their rows: one line across a plastic drop would be too flat.

    Examples
    --------
    >>> phi = np.linspace(0.8, 0.9, 11)
    >>> round(zero_of(Curve(phi, 0.2 * (phi - 0.82)), Window(1e-3, 1e-2)), 9)
    0.82
    """
    zeros, weights = [], []
    for part in rises(curve.pressure):
        phi, pressure = curve.phi[part], curve.pressure[part]
        rows = (pressure >= window.low) & (pressure <= window.high)
        if rows.sum() < FEWEST:
            continue
        slope, offset = np.polyfit(phi[rows] - phi[0], pressure[rows], 1)
        if slope > 0:
            zeros.append(phi[0] - offset / slope)
            weights.append(int(rows.sum()))
    return float(np.average(zeros, weights=weights)) if zeros else math.nan


def first_drop(curve: Curve) -> float:
    """Return the pressure from which it dropped first; NaN if it never did."""
    first, *later = rises(curve.pressure)
    return float(curve.pressure[first].max()) if later else math.nan


def read_quasistatic(folders: list[Path]) -> tuple[dict[Place, Rates], dict[Place, list[Opened]]]:
    """Read folders of quasistatic_pressure.py: curves, and packings before and after."""
    curves: dict[Place, Rates] = {}
    packings: dict[Place, list[Opened]] = {}
    for file in finished(folders) if folders else []:
        with file.path.with_suffix(".csv").open(newline="", encoding="utf-8") as table:
            rows = [{name: float(x) for name, x in row.items()} for row in csv.DictReader(table)]
        phi, pressure, u = (np.array([r[name] for r in rows]) for name in ("phi", "pressure", "u"))
        place = Place.of(file)
        curve = Curve(phi, pressure)
        curves.setdefault(place, {}).setdefault(QUASISTATIC, []).append(curve)
        first = energy_onset(*(float(values[0]) for values in (phi, u, pressure)))
        packings.setdefault(place, []).append(
            Opened(first, float(phi[-1]), first_drop(curve), file)
        )
    return curves, packings


def add_runs(curves: dict[Place, Rates], paths: list[Path]) -> None:
    """Add the pressures of runs."""
    for one in map(read_run, paths):
        place = Place(one.ensemble.system, one.ensemble.n)
        of = curves.setdefault(place, {}).setdefault(one.ensemble.kappa, [])
        of.append(Curve(one.phi, one.pressure))


def rate_text(kappa: float) -> str:
    """Name a rate."""
    return rf"$\kappa={scientific(kappa)}$" if kappa else "quasistatic"


def draw_system(axes: Axes, rates: Rates, windows: list[Window]) -> None:
    """Draw the zeros of each rate against the pressures of their lines."""
    for k, (kappa, samples) in enumerate(sorted(rates.items(), reverse=True)):
        label = f"{rate_text(kappa)}, {counted(len(samples), 'sample')}"
        for window in windows:
            zero = mean([zero_of(one, window) for one in samples])
            if not zero.samples:
                continue
            middle = math.sqrt(window.low * window.high) * 1.05**k
            bars = np.array([[middle - window.low], [window.high - middle]])
            error = np.nan_to_num(zero.error)
            axes.errorbar(middle, zero.value, error, bars, label=label, **marked(k))
            label = ""


def draw_levels(axes: Axes, system: System, packings: list[Opened]) -> None:
    """Draw first jamming, phi_J after opening, and the paper's phi_J as horizontal lines."""
    levels = {
        r"first jamming, $\phi_J={}$": ("-", mean([one.first for one in packings])),
        r"opened again, $\phi_J={}$": ("-.", opened_of(packings)),
    }
    for text, (line, found) in levels.items():
        if found.samples:
            axes.axhline(found.value, color="k", ls=line, lw=0.8, label=text.format(found.tex))
    if of_paper(system) and (paper := PHI_J.get(system.number("alpha"))):
        axes.axhline(paper.value, **PAPER_LINE, label=f"paper, {paper.value:g}")


def title_of(system: System, n: int, packings: dict[Place, list[Opened]]) -> str:
    """Describe a panel."""
    files = [one.file for one in packings.get(Place(system, n), [])]
    energies = dict.fromkeys(energy_text(file.number("u0")) for file in files)
    opened = [f"opened to {text}" for text in energies]
    return "\n".join([systems_text([system]), ", ".join([f"$N={n}$", *opened])])


def opened_of(packings: list[Opened]) -> Mean:
    """Average phi_J after opening."""
    files = [one.file for one in packings]
    return mean_over(files, [file.number("phi_J") for file in files])


def draw(
    curves: dict[Place, Rates], packings: dict[Place, list[Opened]], options: Namespace
) -> None:
    """Draw a panel for each system."""
    figure = figure_of(4.2 * len(curves), 4.4)
    panels = figure.subplots(1, len(curves), squeeze=False, sharex=True)[0]
    for axes, ((system, n), rates) in zip(panels, curves.items(), strict=True):
        draw_system(axes, rates, options.windows)
        draw_levels(axes, system, packings.get(Place(system, n), []))
        axes.set_title(title_of(system, n, packings), fontsize=9)
        axes.set(xscale="log", xlabel=rf"pressure $p$ of the line  ${pressure_unit([system])}$")
        low, high = axes.get_ylim()
        axes.set_ylim(low - 0.5 * (high - low), high)
        axes.legend(loc="lower right", frameon=False, **SMALL_TEXT)
    panels[0].set_ylabel(r"$\phi$ where the line through $p(\phi)$ vanishes")
    save_figure(figure, options.out)


def rows_of(curves: dict[Place, Rates], windows: list[Window]) -> list[dict[str, Any]]:
    """Report the zeros."""
    return [
        place.system.report()
        | {"n": place.n, "kappa": kappa, **window._asdict()}
        | {"phi_J": mean([zero_of(one, window) for one in samples])}
        for place, rates in curves.items()
        for kappa, samples in sorted(rates.items())
        for window in windows
    ]


def packings_of(packings: dict[Place, list[Opened]]) -> list[dict[str, Any]]:
    """Report first jamming, and the packings after opening."""
    found = []
    for place, every in packings.items():
        files = [one.file for one in every]
        row = place.system.report() | {"n": place.n, "phi_end": max(one.end for one in every)}
        row |= {"first": mean([one.first for one in every]), "opened": opened_of(every)}
        row["drops"] = [one.drop for one in every]
        row["rise"] = mean([one.file.number("phi_J") - one.first for one in every])
        row["distance"] = mean_over(files, distances(files))
        for name in ("z", "z_bearing"):
            row[name] = mean_over(files, [file.number(name) for file in files])
        found.append(row)
    return found


def print_rows(rows: list[dict[str, Any]]) -> None:
    """Print a table of the zeros (Markdown)."""
    print("| alpha | kappa | p of the line | samples | zero |", "| --- " * 5 + "|", sep="\n")
    for row in rows:
        zero: Mean = row["phi_J"]
        kappa = f"{row['kappa']:g}" if row["kappa"] else "quasistatic"
        window = f"{row['low']:g} to {row['high']:g}"
        alpha = row.get("alpha", math.nan)
        print(f"| {alpha:g} | {kappa} | {window} | {zero.samples} | {zero.text()} |")


def main(options: Namespace) -> None:
    """Read, fit, draw, report."""
    options.windows = [Window.of(text) for text in options.windows]
    curves, packings = read_quasistatic(options.quasistatic)
    add_runs(curves, options.files)
    if not curves:
        msg = "there are no runs, expected RUN.h5 or --quasistatic FOLDER"
        raise ValueError(msg)
    curves = dict(sorted(curves.items()))
    draw(curves, packings, options)
    rows = rows_of(curves, options.windows)
    print_rows(rows)
    report({"out": options.out, "zeros": rows, "packings": packings_of(packings)})


if __name__ == "__main__":
    parser = parser_of(__doc__, "pressure_lines.png")
    parser.add_argument("files", type=Path, nargs="*", metavar="RUN.h5", help="compressions")
    quasistatic = "of quasistatic_pressure.py"
    parser.add_argument("--quasistatic", type=Path, nargs="*", default=[], help=quasistatic)
    lines = "pressures between which lines are fitted (%(default)s)"
    parser.add_argument(
        "--windows", nargs="+", default=list(WINDOWS), metavar="LOW,HIGH", help=lines
    )
    run(parser, main)
