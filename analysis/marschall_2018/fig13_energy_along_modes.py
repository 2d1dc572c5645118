"""Draw the energy along modes: Figs. 13 and 17 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_energy_along_modes.py PACKING.h5 --modes MODES.h5 --out energy_along_modes.png

MODES.h5 is of analysis/modes.py with --vectors; without it modes are found here. Modes are numbered from 0 by
ascending eigenvalue (--mode), or those next to a frequency are taken (--omega); else some of each band. Delta U
is the mean of both directions, without what the forces that the minimiser has left do; where it is negative
it is dashed. Below are the bonds that have broken and formed. Dots are where a fit of omega^2 delta^2 / 2
+ c delta^4 has both terms equal. The last line of standard output is one JSON object with these fits.
"""

from __future__ import annotations

import json
import math
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from mode_files import mode_text, pick_modes, scientific, table_of
from sweep_files import plain
from tqdm import tqdm

from jamshape.arrays import FloatArray
from jamshape.files.h5md import read_attributes, read_packing
from jamshape.vibration.energy_along import AlongModes, Crossover, EnergyAlong, fit_crossover
from jamshape.vibration.table import ModeTable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PER_DECADE = 12
PER_BAND = {"low": 2, "middle": 2, "high": 2}

Curves = dict[int, tuple[EnergyAlong, Crossover | None]]


def follow(modes: AlongModes, table: ModeTable, chosen: list[int], delta: FloatArray) -> Curves:
    """Find the energy along every mode."""
    found: Curves = {}
    for mode in tqdm(chosen, unit="mode"):
        along = modes.energy(table.vectors[:, mode], delta)
        found[mode] = (along, fit_crossover(along))
    return found


def signed(axes: Axes, x: FloatArray, y: FloatArray, **style: Any) -> None:
    """Draw a curve on logarithmic axes, dashed where it is negative."""
    label = style.pop("label")
    axes.plot(x, np.where(y > 0, y, np.nan), "-", label=label, **style)
    axes.plot(x, np.where(y < 0, -y, np.nan), "--", **style)


def guides(axes: Axes, curves: Curves) -> None:
    """Draw delta^2 and delta^4 as lines below the curves."""
    delta = next(iter(curves.values()))[0].delta
    stiff = [along.mean_energy[0] / delta[0] ** 2 for along, _ in curves.values()]
    x = np.geomspace(3e-3, 0.3, 2)
    x = x[(x >= delta[0]) & (x <= delta[-1])]
    if len(x) < 2 or not max(stiff) > 0:
        return
    note: dict[str, Any] = {"fontsize": 8, "ha": "left", "va": "center"}
    for power, height in ((2, 30.0), (4, 1e-7)):
        y = height * max(stiff) * x**power if power == 2 else height * x**power / x[1] ** 4
        axes.plot(x, y, "k-", lw=1.2)
        axes.text(x[1] * 1.15, y[1], rf"$\delta^{power}$", **note)


def draw(curves: Curves, table: ModeTable, title: str, out: Path) -> None:
    """Draw energies, and the bonds that break and form."""
    from matplotlib import colormaps  # noqa: PLC0415 - not needed for --help and for errors
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(8.4, 6.0), dpi=200, layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[2.3, 1])
    shades = colormaps["viridis"](np.linspace(0.92, 0.0, len(curves)))
    for color, (mode, (along, crossover)) in zip(shades, curves.items(), strict=True):
        style: dict[str, Any] = {"color": color, "lw": 1.3}
        signed(top, along.delta, along.mean_energy, label=mode_text(table, mode), **style)
        if crossover:
            at = np.interp(np.log(crossover.delta), np.log(along.delta), along.mean_energy)
            top.plot(crossover.delta, at, "o", color=color, ms=6, mec="k", mew=0.6, zorder=3)
        for values, line in ((along.broken, "-"), (along.formed, ":")):
            count = values.mean(axis=0)
            bottom.plot(along.delta, np.where(count > 0, count, np.nan), line, **style)
    for axes in (top, bottom):
        axes.set(xscale="log", yscale="log")
    guides(top, curves)
    delta = next(iter(curves.values()))[0].delta
    top.set_xlim(delta[0], delta[-1])
    top.set_ylabel(r"$\Delta U\;/\;k_e$")
    bottom.set_ylabel("bonds")
    bottom.set_xlabel(r"displacement  $\delta\;/\;2R_s$  along the mode")
    for line, text in (("-", "broken"), (":", "formed")):
        bottom.plot([], [], line, color="k", lw=1.3, label=text)
    bottom.legend(fontsize=8, frameon=False, loc="upper left")
    if any(crossover for _, crossover in curves.values()):
        top.plot([], [], "o", color="w", mec="k", mew=0.6, ms=6, label=r"crossover $\delta^*$")
    if any((along.mean_energy < 0).any() for along, _ in curves.values()):
        top.plot([], [], "--", color="k", lw=1.3, label=r"$-\Delta U$, where $\Delta U<0$")
    figure.legend(
        *top.get_legend_handles_labels(),
        title=title,
        title_fontsize=8,
        fontsize=8,
        frameon=False,
        loc="outside right upper",
    )
    figure.savefig(out)


def report(table: ModeTable, mode: int, found: tuple[EnergyAlong, Crossover | None]) -> Any:
    """Describe one mode."""
    along, crossover = found
    row: dict[str, Any] = {"mode": mode, "eigenvalue": float(table["eigenvalues"][mode])}
    row |= {"bound": float(table.bound[mode]), "slope_at_0": along.slope_at_0}
    row |= {"first_change": plain(along.first_change)}
    row |= {"differences_of_energies_from": plain(along.differences_from)}
    row["crossover"] = crossover and {k: plain(v) for k, v in crossover._asdict().items()}
    return row


def parse() -> Namespace:
    """Read the command line."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("packing", type=Path, metavar="PACKING.h5")
    parser.add_argument("--modes", type=Path, metavar="MODES.h5", help="of analysis/modes.py")
    parser.add_argument("--mode", type=int, nargs="+", default=[], help="numbers, from 0")
    parser.add_argument("--omega", type=float, nargs="+", default=[], help="frequencies")
    for name, value, meaning in (("from", 1e-8, "smallest"), ("to", 1.0, "largest")):
        parser.add_argument(
            f"--{name}",
            type=float,
            default=value,
            dest=meaning,
            help=f"{meaning} delta ({value:g})",
        )
    parser.add_argument(
        "--out", type=Path, default=Path("energy_along_modes.png"), help="(%(default)s)"
    )
    return parser.parse_args()


def main(options: Namespace) -> None:
    """Read, choose, follow, draw, report."""
    if not 0 < options.smallest < options.largest < math.inf:
        msg = f"delta goes from {options.smallest:g} to {options.largest:g}, expected 0 < from < to"
        raise ValueError(msg)
    packing, stored = read_packing(options.packing), read_attributes(options.packing)
    table = table_of(packing, options.modes)
    chosen = pick_modes(table, options.mode, options.omega, PER_BAND)
    decades = math.log10(options.largest / options.smallest)
    delta = np.geomspace(options.smallest, options.largest, math.ceil(decades * PER_DECADE) + 1)
    curves = follow(AlongModes(packing, table.coordinates), table, chosen, delta)
    of = [rf"$\alpha={stored['alpha']:g}$"] if "alpha" in stored else []
    of += [rf"$N={packing.n}$"]
    of += [rf"$u={scientific(stored['u0'])}$"] if "u0" in stored else []
    draw(curves, table, ", ".join(of), options.out)
    rows = [report(table, mode, found) for mode, found in curves.items()]
    print(json.dumps({"out": str(options.out), "modes": rows}))


if __name__ == "__main__":
    try:
        main(parse())
    except (OSError, ValueError) as error:
        sys.exit(f"fig_energy_along_modes.py: {error}")
