"""Draw stress, contacts, order and rotation of steady shear against packing fraction.

    python analysis/shear/rheology.py runs/shear/*.h5 --out rheology.png

Runs of `jamshape shear`, of several packing fractions, rates and kinds of particles: p over the rate, sigma over the rate,
mu, z, S_2 and the mean rotation, as Marschall, Keta, Olsson & Teitel, Phys. Rev. Lett. 122, 188002 (2019) and
Marschall & Teitel, Phys. Rev. E 100, 032906 (2019). Averages leave the start-up out, which `--after` sets for all. Prints a
table (Markdown); memory is the strain over which the packing's pressure remembers. The last line of standard output is one JSON object with all averages and their errors.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import ensemble_text, scientific
from jamshape.files.ensembles import System
from jamshape.measures.shears import ShearOf, read_shear
from jamshape.measures.steady import SteadyMean

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import SMALL_TEXT, figure_of
from common.styles import color
from common.text import system_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Numbers below this power of ten are written with it.
_SMALLEST = -2


COLUMNS = {
    "pressure": "p",
    "sigma": "sigma",
    "mu": "mu",
    "z": "z",
    "S_2": "S_2",
    "rotation": "rotation",
}


def table(runs: list[ShearOf]) -> str:
    """Write the averages as Markdown, a row for each run."""
    heads = ("alpha", "gdot", "phi", "strain", "start-up", *COLUMNS.values(), "memory")
    lines = [heads, ("---",) * len(heads)]
    for one in runs:
        of, steady = one.ensemble, one.steady
        assert steady
        alpha = f"{of.system.number('alpha'):g}"
        means = [_text(steady.averages.get(name)) for name in COLUMNS]
        known = (
            alpha,
            f"{of.gdot:g}",
            f"{of.phi:.4g}",
            f"{steady.strain:.3g}",
            f"{steady.startup:.2g}",
        )
        lines.append((*known, *means, f"{steady['pressure'].memory:.2g}"))
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _text(one: SteadyMean | None) -> str:
    """Write an average with its error in two digits of the error."""
    if one is None:
        return ""
    if not one.error > 0:
        return f"{one.value:.3g}"
    digits = max(0, 1 - math.floor(math.log10(abs(one.error))))
    power = math.floor(math.log10(abs(one.value))) if one.value else 0
    if power < _SMALLEST:
        scale = 10.0**-power
        return f"({one.value * scale:.{max(0, digits + power)}f} +- {one.error * scale:.{max(0, digits + power)}f})e{power}"
    return f"{one.value:.{digits}f} +- {one.error:.{digits}f}"


class Panel(NamedTuple):
    """One quantity."""

    name: str
    label: str
    is_logarithmic: bool = False
    over_rate: bool = False
    """Whether it is divided by the rate."""


PANELS = (
    Panel("pressure", r"viscosity $\eta_p=p/\dot\gamma$", True, True),
    Panel("sigma", r"shear stress over rate $\sigma/\dot\gamma$", True, True),
    Panel("mu", r"stress ratio $\mu=\sigma/p$"),
    Panel("z", "contact number $z$"),
    Panel("S_2", "nematic order $S_2$"),
    Panel("rotation", r"rotation $-\langle\dot\theta\rangle/\dot\gamma$"),
)

_MARKERS = "osD^v"


class Line(NamedTuple):
    """Key of a line."""

    system: System
    gdot: float


def lines_of(runs: Sequence[ShearOf]) -> dict[Line, list[ShearOf]]:
    """Group runs with a steady state by system and rate, in the order of phi."""
    lines: dict[Line, list[ShearOf]] = {}
    for one in sorted(runs, key=lambda one: (one.ensemble.gdot, one.ensemble.phi)):
        if one.steady:
            lines.setdefault(Line(one.ensemble.system, one.ensemble.gdot), []).append(one)
    return lines


def rheology_figure(runs: Sequence[ShearOf]) -> Figure:
    """Draw six panels over phi: systems by colour, rates by marker."""
    lines = lines_of(runs)
    labels = system_labels({line.system: None for line in lines})
    tints = {system: color(k) for k, system in enumerate(labels)}
    rates = sorted({line.gdot for line in lines})
    figure = figure_of(10.5, 6.2, dpi=160)
    panels = figure.subplots(2, 3, sharex=True)
    for axes, panel in zip(panels.flat, PANELS, strict=True):
        for line, of in lines.items():
            style = {"color": tints[line.system], "marker": _MARKERS[rates.index(line.gdot) % 5]}
            label = rf"{labels[line.system]}, $\dot\gamma={scientific(line.gdot)}$"
            _draw_line(axes, panel, of, style | {"label": label})
        axes.set_ylabel(panel.label)
        if panel.is_logarithmic:
            axes.set_yscale("log")
    for axes in panels[1]:
        axes.set_xlabel(r"packing fraction $\phi$")
    first = next(iter(lines.values()))[0]
    title = f"{ensemble_text(first.ensemble, ('n',))}, steady {first.ensemble.flow} shear"
    if len(labels) > 1:
        title = f"$N={first.ensemble.n}$, steady {first.ensemble.flow} shear"
    figure.suptitle(f"{title}; bars: standard errors of correlated samples", fontsize=9)
    handles = panels[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=3, frameon=False, **_small())
    return figure


def _small() -> dict[str, float]:
    return {"fontsize": SMALL_TEXT["fontsize"]}


def _draw_line(axes: Axes, panel: Panel, of: Sequence[ShearOf], style: Mapping[str, str]) -> None:
    known = [run for run in of if run.steady and panel.name in run.steady.averages]
    rate = np.array([run.ensemble.gdot if panel.over_rate else 1.0 for run in known])
    means = [run.steady[panel.name] for run in known if run.steady]
    value = np.array([one.value for one in means]) / rate
    error = np.array([one.error for one in means]) / rate
    phi = [run.ensemble.phi for run in known]
    how = {"ms": 4, "lw": 0.9, "capsize": 1.5, "mfc": "none"}
    axes.errorbar(phi, value, error, **how, **style)  # type: ignore[arg-type]


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    runs = [read_shear(path, options.after) for path in options.files]
    steady = [one for one in runs if one.steady]
    if not steady:
        raise ValueError(runs[0].problem)
    save_figure(rheology_figure(steady), options.out)
    ordered = sorted(
        steady, key=lambda one: (one.ensemble.system, one.ensemble.gdot, one.ensemble.phi)
    )
    print(table(ordered))
    rows = [
        one.ensemble.report() | {"seed": one.seed, "strain": one.strain[-1]} | one.steady.report()
        for one in steady
        if one.steady
    ]
    report(
        {"out": options.out, "runs": rows, "short": [one.problem for one in runs if one.problem]}
    )


if __name__ == "__main__":
    parser = parser_of(__doc__, "rheology.png", "RUN.h5")
    parser.add_argument("--after", type=float, help="strain from which to average (chosen)")
    run(parser, main)
