"""Draw the energy along quartic modes: Fig. 10 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/energy_ladder.py PACKING.h5 --u0 1e-14 1e-12 1e-10 1e-8 --out LADDER
    python analysis/yuan_2019/fig10_quartic_energy.py PACKING.h5 [MORE.h5 ...] LADDER --out quartic_energy.png

Delta U / N of some packings, the first three of different shape or sample, along modes below the gap of the spectrum
(lines) and above it (dashed), with dots where the energy is twice its quadratic start; on the right this delta* of the
quartic modes against the pressure, geometric means with the smallest and largest. Folders are of energy_ladder.py,
one packing at several pressures. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from tqdm import tqdm

from jamshape.checks import Range, require_in
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.styles import RED
from jamshape.drawing.text import packing_text, pressure_unit, systems_text, unit_text
from jamshape.files.sets import PackingFile, System

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.energy_along import EnergyAlong, quartic_crossover
from common.ensembles import read_groups
from common.families import label, mark
from common.mode_tables import Wanted, pick_modes
from common.quartic import along, found_modes, quartic_count
from common.styles import PAPER_LINE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANELS = 3
OTHERS = 2  # modes above the gap
GUIDE = (3e-3, 0.1)  # ends of the lines of powers


class Name(NamedTuple):
    """One sample of a system."""

    system: System
    seed: int

    @property
    def label(self) -> str:
        """For a legend."""
        return f"{label(self.system)}, seed {self.seed}"


class Followed(NamedTuple):
    """A packing and the energy along some of its modes."""

    name: Name
    file: PackingFile
    quartic: dict[int, EnergyAlong]
    others: dict[int, EnergyAlong]
    eigenvalues: dict[int, float]

    @property
    def pressure(self) -> float:
        """Of the packing, [energy / length^D]."""
        return self.file.number("pressure")

    @property
    def energies(self) -> list[EnergyAlong]:
        """Those along quartic modes, or along others if there are none."""
        return list((self.quartic or self.others).values())

    @property
    def crossovers(self) -> list[float]:
        """delta* of the quartic modes, NaN where there is none."""
        return [quartic_crossover(energy) for energy in self.quartic.values()]

    @property
    def crossover(self) -> float:
        """Geometric mean of delta*."""
        return float(np.exp(np.nanmean(np.log(self.crossovers))))


def follow(file: PackingFile, n_quartic: int) -> Followed:
    """Find the energy along modes of one packing."""
    table = found_modes(file)
    if not table.has_band("high"):
        msg = (
            f"{file.path}: {table.attributes['why_no_bands']}; expected a packing closer to jamming"
        )
        raise ValueError(msg)
    below = n_quartic if quartic_count(table).n_quartic else 0
    band = "middle" if len(table.in_band("middle")) else "low"
    per_band = {"low": 0, "middle": 0, "high": OTHERS} | {band: below}
    chosen = pick_modes(table, Wanted(per_band=per_band))
    energies, high = along(file, table, chosen), set(table.in_band("high").tolist())
    return Followed(
        Name(file.system(), int(file.number("seed"))),
        file,
        {k: v for k, v in energies.items() if k not in high},
        {k: v for k, v in energies.items() if k in high},
        {k: float(table["eigenvalues"][k]) for k in chosen},
    )


def draw_energies(axes: Axes, found: Followed) -> None:
    """Draw the energies of one packing."""
    from matplotlib import colormaps  # noqa: PLC0415 - not needed for --help and for errors

    n = found.file.number("n")
    shades = colormaps["viridis"](np.linspace(0.0, 0.85, max(len(found.quartic), 1)))
    for color, (mode, energy) in zip(shades, found.quartic.items(), strict=False):
        size = energy.mean_energy / n
        line: dict[str, Any] = {"color": color, "lw": 1.3, "label": f"mode {mode}, below the gap"}
        axes.plot(energy.delta, np.where(size > 0, size, np.nan), "-", **line)
        end = quartic_crossover(energy)
        if np.isfinite(end):
            at = np.interp(np.log(end), np.log(energy.delta), size)
            axes.plot(end, at, "o", color=color, ms=5, mec="k", mew=0.6, zorder=3)
    for energy in found.others.values():
        axes.plot(energy.delta, energy.mean_energy / n, "--", color=RED, lw=1.1)
    unit = unit_text([found.name.system])
    axes.set(xscale="log", yscale="log", xlabel=rf"amplitude $\delta\;/\;{unit}$")
    z = found.file.number("z")
    axes.set_title(f"{packing_text(found.file)}, $z_J={z:.2f}$", fontsize=8)
    draw_powers(axes, found, n)
    axes.plot([], [], "--", color=RED, lw=1.1, label="modes above it")
    axes.plot([], [], "o", color="w", ms=5, mec="k", mew=0.6, label=r"crossover $\delta^*$")
    axes.legend(fontsize=6, loc="lower right")


def draw_powers(axes: Axes, found: Followed, n: float) -> None:
    """Draw delta^2 and delta^4 below the energies."""
    delta = found.energies[0].delta
    part = delta[(delta > GUIDE[0]) & (delta < GUIDE[1])]
    low = min(energy.mean_energy[-1] / n for energy in found.energies)
    for power, height in ((4, 3e-4), (2, 1e-3)):
        line = height * low * (part / part[-1]) ** power
        axes.plot(part, line, "k-", lw=1)
        axes.annotate(rf"$\delta^{power}$", (part[0], line[0]), fontsize=8, ha="right")


def rungs_of(every: list[Followed], name: Name) -> list[Followed]:
    """Return one sample at all pressures, the lowest first, where it has a crossover."""
    own = [f for f in every if f.name == name and np.isfinite(f.crossovers).any()]
    return sorted(own, key=lambda f: f.pressure)


def draw_crossovers(axes: Axes, every: list[Followed]) -> None:
    """Draw crossovers against pressure."""
    for name in dict.fromkeys(found.name for found in every):
        rungs = rungs_of(every, name)
        if rungs:
            means = np.array([f.crossover for f in rungs])
            ends = [(np.nanmin(f.crossovers), np.nanmax(f.crossovers)) for f in rungs]
            bars = np.abs(np.transpose(ends) - means)
            style: dict[str, Any] = mark(name.system) | {"ls": "-", "lw": 0.8, "capsize": 2}
            pressures = [f.pressure for f in rungs]
            axes.errorbar(pressures, means, bars, label=name.label, ms=5, **style)
    systems = {found.name.system for found in every}
    axes.set(xscale="log", yscale="log", xlabel=rf"pressure $P\;{pressure_unit(systems)}$")
    axes.set_ylabel(rf"crossover $\delta^*\;/\;{unit_text(systems)}$")
    low, high = axes.get_xlim()
    x, middle = np.array([low, high]), (np.sqrt(low * high), np.sqrt(np.prod(axes.get_ylim())))
    axes.plot(x, middle[1] * np.sqrt(x / middle[0]), **PAPER_LINE, label=r"$\sqrt{P}$")
    axes.set_xlim(low, high)
    axes.xaxis.set_minor_formatter("")
    axes.set_title(f"{systems_text(systems)}\nbars: smallest and largest", fontsize=8)
    axes.legend(fontsize=7)


def draw(every: list[Followed], options: Namespace) -> None:
    """Draw energies, and crossovers against pressure."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    names = list(dict.fromkeys(found.name for found in every))
    shown = [next(f for f in every if f.name == name) for name in names][:PANELS]
    figure = Figure(figsize=(3.9 * (len(shown) + 1), 4), dpi=160, layout="constrained")
    panels = figure.subplots(1, len(shown) + 1)
    for axes, found in zip(panels, shown, strict=False):
        draw_energies(axes, found)
    panels[0].set_ylabel(r"$\Delta U/N\;/\;k_e$")
    draw_crossovers(panels[-1], every)
    save_figure(figure, options.out)


def exponents(every: list[Followed], name: Name) -> dict[str, float | None]:
    """Fit delta* of one packing to a power of the pressure: of all pressures, and of the lowest two."""
    rungs = rungs_of(every, name)
    x, y = (np.log([f.pressure for f in rungs]), np.log([f.crossover for f in rungs]))
    if len(x) < 2 or x[0] == x[1]:
        return {"exponent": None, "exponent_of_lowest": None}
    slopes = [float(np.polyfit(x[:n], y[:n], 1)[0]) for n in (len(x), 2)]
    return dict(zip(("exponent", "exponent_of_lowest"), slopes, strict=True))


def row_of(found: Followed) -> dict[str, Any]:
    """Describe one packing."""
    modes = [
        {"mode": k, "eigenvalue": found.eigenvalues[k], "quartic": k in found.quartic}
        | {"crossover": quartic_crossover(energy), "first_change": energy.first_change}
        for k, energy in (found.quartic | found.others).items()
    ]
    known: dict[str, Any] = {"packing": found.file.path, "pressure": found.pressure}
    return known | found.name.system.report() | {"seed": found.name.seed, "modes": modes}


def main(options: Namespace) -> None:
    """Read, follow, draw, report."""
    require_in("--modes", options.modes, Range(1, 10**6, "modes", whole=True))
    groups = read_groups(options.files)
    files = [file for files in groups.values() for file in files]
    every = [follow(file, options.modes) for file in tqdm(files, unit="packing")]
    draw(every, options)
    names = dict.fromkeys(found.name for found in every)
    slopes = [name.system.report() | {"seed": name.seed} | exponents(every, name) for name in names]
    rows = [row_of(found) for found in every]
    report({"out": options.out, "packings": rows, "delta_of_pressure": slopes})


if __name__ == "__main__":
    parser = parser_of(__doc__, "quartic_energy.png", "PACKING")
    number = "quartic modes of each packing, evenly by rank (%(default)s)"
    parser.add_argument("--modes", type=int, default=4, metavar="K", help=number)
    run(parser, main)
