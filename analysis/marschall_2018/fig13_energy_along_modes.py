"""Draw the energy along modes: Figs. 13 and 17 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig13_energy_along_modes.py PACKING.h5 --modes MODES.h5 --out energy_along_modes.png

MODES.h5 is of analysis/modes.py with --vectors; without it modes are found here. Modes are numbered from 0 by
ascending eigenvalue (--mode), or those next to a frequency are taken (--omega); else some of each band. Delta U
is the mean of both directions, without what the forces that the minimiser has left do; where it is negative
it is dashed. Below are the bonds that have broken and formed. Dots are where a fit of omega^2 delta^2 / 2
+ c delta^4 has both terms equal. The last line of standard output is one JSON object with these fits.
"""

from __future__ import annotations

import math
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from tqdm import tqdm

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import packing_text, unit_text
from jamshape.files.sets import PackingFile
from jamshape.vibration.table import ModeTable

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.energy_along import AlongModes, Crossover, EnergyAlong, fit_crossover
from common.mode_axes import mode_text
from common.mode_tables import Wanted, pick_modes, table_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PER_DECADE = 12
PER_BAND = {"low": 2, "middle": 2, "high": 2}
GUIDE = (3e-3, 0.3)  # ends of the lines of powers
CROSSOVER: dict[str, Any] = {"mec": "k", "mew": 0.6, "ms": 6}


class Curve(NamedTuple):
    """The energy along one mode."""

    along: EnergyAlong
    crossover: Crossover | None


Curves = dict[int, Curve]


def follow(modes: AlongModes, table: ModeTable, chosen: list[int], delta: FloatArray) -> Curves:
    """Find the energy along every mode."""
    found: Curves = {}
    for mode in tqdm(chosen, unit="mode"):
        along = modes.energy(table.vectors[:, mode], delta)
        found[mode] = Curve(along, fit_crossover(along))
    return found


def signed(axes: Axes, x: FloatArray, y: FloatArray, **style: Any) -> None:
    """Draw a curve on logarithmic axes, dashed where it is negative."""
    label = style.pop("label")
    axes.plot(x, np.where(y > 0, y, np.nan), "-", label=label, **style)
    axes.plot(x, np.where(y < 0, -y, np.nan), "--", **style)


def guides(axes: Axes, curves: Curves) -> None:
    """Draw delta^2 and delta^4 as lines below the curves."""
    delta = next(iter(curves.values())).along.delta
    stiff = [curve.along.mean_energy[0] / delta[0] ** 2 for curve in curves.values()]
    x = np.geomspace(*GUIDE, 2)
    x = x[(x >= delta[0]) & (x <= delta[-1])]
    if len(x) < 2 or not max(stiff) > 0:
        return
    note: dict[str, Any] = {"fontsize": 8, "ha": "left", "va": "center"}
    for power, y in ((2, 30.0 * max(stiff) * x**2), (4, 1e-7 * (x / x[1]) ** 4)):
        axes.plot(x, y, "k-", lw=1.2)
        axes.text(x[1] * 1.15, y[1], rf"$\sim\delta^{power}$", **note)


def draw_curve(top: Axes, bottom: Axes, curve: Curve, **style: Any) -> None:
    """Draw the energy along one mode, and the bonds that break and form."""
    label, (along, crossover) = style.pop("label"), curve
    signed(top, along.delta, along.mean_energy, label=label, **style)
    if crossover:
        at = np.interp(np.log(crossover.delta), np.log(along.delta), along.mean_energy)
        top.plot(crossover.delta, at, "o", color=style["color"], zorder=3, **CROSSOVER)
    for values, line in ((along.broken, "-"), (along.formed, ":")):
        count = values.mean(axis=0)
        bottom.plot(along.delta, np.where(count > 0, count, np.nan), line, **style)


def explain(top: Axes, bottom: Axes, curves: Curves) -> None:
    """Name lines and dots, as far as there are any."""
    for line, text in (("-", "broken"), (":", "formed")):
        bottom.plot([], [], line, color="k", lw=1.3, label=text)
    bottom.legend(fontsize=8, frameon=False, loc="upper left")
    if any(curve.crossover for curve in curves.values()):
        top.plot([], [], "o", color="w", label=r"crossover $\delta^*$", **CROSSOVER)
    if any((curve.along.mean_energy < 0).any() for curve in curves.values()):
        top.plot([], [], "--", color="k", lw=1.3, label=r"$-\Delta U$, where $\Delta U<0$")


def draw(curves: Curves, table: ModeTable, file: PackingFile, out: Path) -> None:
    """Draw energies, and the bonds that break and form."""
    from matplotlib import colormaps  # noqa: PLC0415 - not needed for --help and for errors

    figure = figure_of(8.4, 6.0)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[2.3, 1])
    shades = colormaps["viridis"](np.linspace(0.92, 0.0, len(curves)))
    for color, (mode, curve) in zip(shades, curves.items(), strict=True):
        style: dict[str, Any] = {"color": color, "lw": 1.3, "label": mode_text(table, mode)}
        draw_curve(top, bottom, curve, **style)
    for axes in (top, bottom):
        axes.set(xscale="log", yscale="log")
    guides(top, curves)
    delta = next(iter(curves.values())).along.delta
    top.set_xlim(delta[0], delta[-1])
    top.set_ylabel(r"$\Delta U\;/\;k_e$")
    bottom.set_ylabel("bonds")
    unit = unit_text([file.system()])
    bottom.set_xlabel(rf"displacement  $\delta\;/\;{unit}$  along the mode")
    explain(top, bottom, curves)
    text: dict[str, Any] = {"title_fontsize": 8, "fontsize": 8, "frameon": False}
    handles = top.get_legend_handles_labels()
    figure.legend(*handles, title=packing_text(file), loc="outside right upper", **text)
    save_figure(figure, out)


def row_of(table: ModeTable, mode: int, curve: Curve) -> dict[str, Any]:
    """Describe one mode."""
    along = curve.along
    row: dict[str, Any] = {"mode": mode, "eigenvalue": table["eigenvalues"][mode]}
    row |= {"bound": table.bound[mode], "slope_at_0": along.slope_at_0}
    row |= {"first_change": along.first_change}
    row |= {"differences_of_energies_from": along.differences_from}
    return row | {"crossover": curve.crossover}


def parser() -> ArgumentParser:
    """Describe the command line."""
    found = parser_of(__doc__, "energy_along_modes.png")
    found.add_argument("packing", type=Path, metavar="PACKING.h5")
    found.add_argument("--modes", type=Path, metavar="MODES.h5", help="of analysis/modes.py")
    found.add_argument("--mode", type=int, nargs="+", default=[], help="numbers, from 0")
    found.add_argument("--omega", type=float, nargs="+", default=[], help="frequencies")
    for name, value, meaning in (("--from", 1e-8, "smallest"), ("--to", 1.0, "largest")):
        text = f"{meaning} delta (%(default)s)"
        found.add_argument(name, type=float, default=value, dest=meaning, help=text)
    return found


def main(options: Namespace) -> None:
    """Read, choose, follow, draw, report."""
    if not 0 < options.smallest < options.largest < math.inf:
        msg = f"delta goes from {options.smallest:g} to {options.largest:g}, expected 0 < from < to"
        raise ValueError(msg)
    file = PackingFile.read(options.packing)
    packing = file.packing()
    table = table_of(packing, options.modes)
    chosen = pick_modes(table, Wanted(options.mode, options.omega, PER_BAND))
    decades = math.log10(options.largest / options.smallest)
    delta = np.geomspace(options.smallest, options.largest, math.ceil(decades * PER_DECADE) + 1)
    curves = follow(AlongModes(packing, table.coordinates), table, chosen, delta)
    draw(curves, table, file, options.out)
    rows = [row_of(table, mode, curve) for mode, curve in curves.items()]
    report({"out": options.out, **file.system().report(), "n": packing.n, "modes": rows})


if __name__ == "__main__":
    run(parser(), main)
