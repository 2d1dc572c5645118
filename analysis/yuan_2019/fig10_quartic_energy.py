"""Draw the energy along quartic modes: Fig. 10 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/energy_ladder.py PACKING.h5 --u0 1e-14 1e-12 1e-10 1e-8 --out LADDER
    python analysis/fig_quartic_energy.py PACKING.h5 [MORE.h5 ...] LADDER --out quartic_energy.png

Delta U / N of some packings, the first three of different shape or sample, along modes below the gap of the spectrum
(lines) and above it (dashed), with dots where the energy is twice its quadratic start; on the right this delta* of the
quartic modes against the pressure, geometric means with the smallest and largest. Folders are of energy_ladder.py,
one packing at several pressures. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from mode_files import pick_modes
from superellipsoid_files import Kind, mark, parser_of, read_groups
from superellipsoid_modes import along, found_modes
from sweep_files import Sample, plain
from tqdm import tqdm

from jamshape.vibration.energy_along import EnergyAlong, quartic_crossover

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANELS = 3
OTHERS = 2  # modes above the gap

Name = tuple[Kind, int]  # one sample of a shape


class Followed(NamedTuple):
    """A packing and the energy along some of its modes."""

    name: Name
    sample: Sample
    quartic: dict[int, EnergyAlong]
    others: dict[int, EnergyAlong]
    eigenvalues: dict[int, float]

    @property
    def pressure(self) -> float:
        """Of the packing, [energy / length^3]."""
        return self.sample.number("pressure")

    @property
    def crossovers(self) -> list[float]:
        """delta* of the quartic modes, NaN where there is none."""
        return [quartic_crossover(energy) for energy in self.quartic.values()]


def follow(name: Name, sample: Sample, n_quartic: int) -> Followed:
    """Find the energy along modes of one packing."""
    table = found_modes(sample)
    per_band = {"low": 0, "middle": n_quartic, "high": OTHERS}
    below = len(table.in_band("low")) + len(table.in_band("middle"))
    if not below:
        per_band["middle"] = 0
    elif not len(table.in_band("middle")):
        per_band = {"low": n_quartic, "middle": 0, "high": OTHERS}
    chosen = pick_modes(table, [], [], per_band)
    energies, high = along(sample, table, chosen), set(table.in_band("high").tolist())
    return Followed(
        name,
        sample,
        {k: v for k, v in energies.items() if k not in high},
        {k: v for k, v in energies.items() if k in high},
        {k: float(table["eigenvalues"][k]) for k in chosen},
    )


def draw_energies(axes: Axes, found: Followed, n: int) -> None:
    """Draw the energies of one packing."""
    from matplotlib import colormaps  # noqa: PLC0415 - not needed for --help and for errors

    shades = colormaps["viridis"](np.linspace(0.0, 0.85, max(len(found.quartic), 1)))
    for color, energy in zip(shades, found.quartic.values(), strict=False):
        size = energy.mean_energy / n
        axes.plot(energy.delta, np.where(size > 0, size, np.nan), "-", color=color, lw=1.3)
        end = quartic_crossover(energy)
        if np.isfinite(end):
            at = np.interp(np.log(end), np.log(energy.delta), size)
            axes.plot(end, at, "o", color=color, ms=5, mec="k", mew=0.6, zorder=3)
    for energy in found.others.values():
        axes.plot(energy.delta, energy.mean_energy / n, "--", color="#D55E00", lw=1.1)
    axes.set(xscale="log", yscale="log", xlabel=r"amplitude $\delta\;/\;a$")
    kind, seed = found.name
    z = found.sample.number("z")
    axes.set_title(f"{kind.label}, seed {seed}, $z_J={z:.2f}$", fontsize=9)
    delta = next(iter((found.quartic or found.others).values())).delta
    part = delta[(delta > 3e-3) & (delta < 0.1)]
    low = min(e.mean_energy[-1] / n for e in (found.quartic or found.others).values())
    for power, height in ((4, 3e-4), (2, 1e-3)):
        line = height * low * (part / part[-1]) ** power
        axes.plot(part, line, "k-", lw=1)
        axes.annotate(rf"$\delta^{power}$", (part[0], line[0]), fontsize=8, ha="right")


def draw(every: list[Followed], out: Path) -> None:
    """Draw energies, and crossovers against pressure."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    names = list(dict.fromkeys(found.name for found in every))
    shown = [next(f for f in every if f.name == name) for name in names][:PANELS]
    figure = Figure(figsize=(3.9 * (len(shown) + 1), 4), dpi=160, layout="constrained")
    panels = figure.subplots(1, len(shown) + 1)
    for axes, found in zip(panels, shown, strict=False):
        draw_energies(axes, found, int(found.sample.number("n")))
    panels[0].set_ylabel(r"$\Delta U/N\;/\;\epsilon$")
    last = panels[-1]
    for name in names:
        rungs = sorted((f for f in every if f.name == name), key=lambda f: f.pressure)
        rungs = [f for f in rungs if np.isfinite(f.crossovers).any()]
        if not rungs:
            continue
        means = np.array([_geometric(f.crossovers) for f in rungs])
        ends = [(np.nanmin(f.crossovers), np.nanmax(f.crossovers)) for f in rungs]
        bars = np.abs(np.transpose(ends) - means)
        style: dict[str, Any] = mark(name[0]) | {"ls": "-", "lw": 0.8, "capsize": 2, "ms": 5}
        label = f"{name[0].label}, seed {name[1]}"
        last.errorbar([f.pressure for f in rungs], means, bars, label=label, **style)
    last.set(xscale="log", yscale="log", xlabel=r"pressure $P\,a^3/\epsilon$")
    last.set_ylabel(r"crossover $\delta^*\;/\;a$")
    low, high = last.get_xlim()
    x = np.array([low, high])
    middle = np.sqrt(low * high), np.sqrt(np.prod(last.get_ylim()))
    line = middle[1] * np.sqrt(x / middle[0])
    last.plot(x, line, "--", color="0.5", lw=1, zorder=0, label=r"$\sqrt{P}$")
    last.set_xlim(low, high)
    last.legend(fontsize=7)
    figure.savefig(out)


def _geometric(values: list[float]) -> float:
    return float(np.exp(np.nanmean(np.log(values))))


def exponents(every: list[Followed], name: Name) -> dict[str, float | None]:
    """Fit delta* of one packing to a power of the pressure: of all pressures, and of the lowest two."""
    rungs = [f for f in every if f.name == name and np.isfinite(f.crossovers).any()]
    rungs.sort(key=lambda f: f.pressure)
    x = np.log([f.pressure for f in rungs])
    y = np.log([_geometric(f.crossovers) for f in rungs])
    if len(x) < 2 or x[0] == x[1]:
        return {"exponent": None, "exponent_of_lowest": None}
    slopes = [float(np.polyfit(x[:n], y[:n], 1)[0]) for n in (len(x), 2)]
    return dict(zip(("exponent", "exponent_of_lowest"), slopes, strict=True))


def row(found: Followed) -> dict[str, Any]:
    """Describe one packing."""
    modes: list[dict[str, Any]] = [
        {
            "mode": k,
            "eigenvalue": found.eigenvalues[k],
            "quartic": k in found.quartic,
            "crossover": plain(quartic_crossover(energy)),
            "first_change": plain(energy.first_change),
        }
        for k, energy in (found.quartic | found.others).items()
    ]
    known: dict[str, Any] = {"packing": str(found.sample.path), "pressure": found.pressure}
    return known | found.name[0].report() | {"seed": found.name[1], "modes": modes}


def main(options: Namespace) -> None:
    """Read, follow, draw, report."""
    groups = read_groups(options.packings)
    packings = [(k, s) for k, samples in groups.items() for s in samples]
    every = [
        follow((kind, int(sample.number("seed"))), sample, options.modes)
        for kind, sample in tqdm(packings, unit="packing")
    ]
    draw(every, options.out)
    names = dict.fromkeys(found.name for found in every)
    slopes = [
        kind.report() | {"seed": seed} | exponents(every, (kind, seed)) for kind, seed in names
    ]
    rows = [row(found) for found in every]
    print(json.dumps({"out": str(options.out), "packings": rows, "delta_of_pressure": slopes}))


if __name__ == "__main__":
    asked = parser_of(__doc__, "quartic_energy.png")
    number = "quartic modes of each packing, evenly by rank (%(default)s)"
    asked.add_argument("--modes", type=int, default=4, metavar="K", help=number)
    try:
        main(asked.parse_args())
    except (OSError, ValueError) as error:
        sys.exit(f"fig_quartic_energy.py: {error}")
