"""Draw mean frequencies of bands against energy: Figs. 14(b), 18(b), 20 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig14_band_frequency.py MODES [MORE.h5 ...] --out band_frequency.png

MODES are files of analysis/modes.py, or folders of them, of packings at several energies (energy_ladder.py).
Bands below the high one: low, of second order in the prestress, modes that slide; middle, of first order. Means of
sqrt|lambda| over the modes of a sample, then over samples with standard errors; where modes have negative
eigenvalues these and the others are also shown apart. Power laws of u are fitted to each sample where there is
a gap below the high band; the last line of standard output is one JSON object with the means of their exponents.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.command import report, run
from jamshape.drawing.modes import frequency_unit
from jamshape.drawing.saving import save_figure
from jamshape.drawing.styles import BLUE, RED
from jamshape.drawing.text import systems_text
from jamshape.files.sets import System
from jamshape.measures.averages import Mean
from jamshape.vibration.table import ModeTable

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean
from common.axes import energy_label, figure_of, log_bars
from common.ensembles import of_paper
from common.mode_axes import modes_parser, tables_asked
from common.mode_tables import Tables, n_of, seed_of, sizes, stable, unstable
from common.text import range_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PAPER_EXPONENTS = {"low": 0.5, "middle": 0.25}
STYLES = {"low": ("s", RED), "middle": ("o", BLUE)}
FEWEST = 3  # energies of a fit

# Numbers of modes that are the same but for this fraction.
SAME = 0.1
NOTEWORTHY = 0.003  # difference of exponents

# Bands have merged with the high one if their eigenvalues are not apart by this factor.
GAP = 2.0

ONE_SIGN = {1: ("2", r"only $\lambda>0$"), -1: ("1", r"only $\lambda<0$")}

Curve = dict[float, Mean]
Ladder = dict[float, list[ModeTable]]
"""Samples of one system by u0."""


class Fit(NamedTuple):
    """Mean frequency = factor u^exponent."""

    exponent: Mean
    """Over samples."""
    factor: float


class Band(NamedTuple):
    """A band of one system."""

    name: str
    ladder: Ladder

    def apart(self) -> Ladder:
        """Leave out energies where the band of some sample has merged with the high one."""
        return {u: of for u, of in self.ladder.items() if all(is_apart(t, self.name) for t in of)}

    def curve(self, sign: int = 0) -> Curve:
        """Average over samples at each energy; energies without modes of the band are left out."""
        found = {
            u: mean([mean_size(t, self.name, sign) for t in of]) for u, of in self.ladder.items()
        }
        return {u: m for u, m in found.items() if m.samples}

    def fit(self, *, same: bool = False) -> Fit | None:
        """Fit a power law to every sample, where the band is one, or None if energies are too few.

        With `same` only where it has the number of modes that it has most often, or nearly so: bonds
        that only graze open as u falls, which lets more rods slide.
        """
        by_seed: dict[int, list[tuple[float, float, int]]] = {}
        for u, samples in self.apart().items():
            for table in samples:
                point = (u, mean_size(table, self.name), len(table.in_band(self.name)))
                by_seed.setdefault(seed_of(table), []).append(point)
        lines = []
        for points in by_seed.values():
            u, omega, count = np.array(points).T
            known = np.isfinite(omega)
            if same and known.any():
                known &= np.abs(count - np.median(count[known])) <= SAME * count
            if known.sum() >= FEWEST:
                lines.append(np.polyfit(np.log(u[known]), np.log(omega[known]), 1))
        if not lines:
            return None
        slopes, offsets = np.array(lines).T
        return Fit(mean(slopes), float(np.exp(offsets.mean())))


def ladders(tables: Tables) -> dict[System, Ladder]:
    """Group by system and u0, those that have a band below the high one."""
    found: dict[System, Ladder] = {}
    for key, samples in tables.items():
        found.setdefault(key.system, {})[key.u0] = samples
    return {
        system: ladder
        for system, ladder in found.items()
        if any(len(t.in_band(band)) for of in ladder.values() for t in of for band in STYLES)
    }


def mean_size(table: ModeTable, band: str, sign: int = 0) -> float:
    """Average sqrt|lambda| of the modes of a band, of one sign or of both; NaN without modes."""
    known = {1: stable(table), -1: unstable(table), 0: stable(table) | unstable(table)}[sign]
    rows = table.in_band(band)
    values = sizes(table)[rows][known[rows]]
    return float(values.mean()) if len(values) else math.nan


def is_apart(table: ModeTable, band: str) -> bool:
    """Whether there is a gap between a band and the high one."""
    size = sizes(table) ** 2
    own, high = (size[table.in_band(name)] for name in (band, "high"))
    return bool(high.min(initial=math.inf) > GAP * own.max(initial=0.0))


def draw_points(axes: Axes, points: Curve, **style: Any) -> None:
    """Draw means with standard errors."""
    value, error = np.array([mean[:2] for mean in points.values()], np.float64).T
    bars = log_bars(value, error)
    axes.errorbar(list(points), value, bars, capsize=2, lw=0.8, **style)


def draw_band(axes: Axes, band: Band) -> None:
    """Draw means of one band, its power law, and modes of either sign apart."""
    every = band.curve()
    if not every:
        return
    marker, color = STYLES[band.name]
    points = Band(band.name, band.apart()).curve()
    merged = {u: m for u, m in every.items() if u not in points}
    if merged:
        text = f"{band.name} and high band merge"
        draw_points(axes, merged, fmt="x", color=color, ms=5, label=text)
    if not points:
        return
    law = band.fit()
    if law:
        u = np.geomspace(min(points) / 2, max(points) * 2, 2)
        axes.plot(u, law.factor * u**law.exponent.value, "-", color=color, lw=1, zorder=1)
    label = band_label(band, law)
    draw_points(axes, points, fmt=marker, color=color, mfc="none", ms=5, label=label)
    signs = {sign: band.curve(sign) for sign in ONE_SIGN}
    if signs[-1]:
        for sign, (symbol, what) in ONE_SIGN.items():
            values = [m.value for m in signs[sign].values()]
            place = np.array(list(signs[sign])) * 1.2**sign
            axes.plot(place, values, symbol, color="0.35", ms=6, label=what, zorder=1)


def band_label(band: Band, law: Fit | None) -> str:
    """Name a band and its exponent, also of the same number of modes if that is another one."""
    text = f"{band.name} band"
    if law:
        text += rf": $\bar\omega\sim u^{{{law.exponent.tex}}}$"
        same = band.fit(same=True)
        if same and abs(same.exponent.value - law.exponent.value) > NOTEWORTHY:
            text += f"\n(${same.exponent.tex}$ for the same number of modes)"
    return text


def draw(found: dict[System, Ladder], tables: Tables, options: Namespace) -> None:
    """Draw one panel for each system."""
    figure = figure_of(0.9 + 3.4 * len(found), 3.9)
    panels = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
    for axes, (system, ladder) in zip(panels, found.items(), strict=True):
        for band in STYLES:
            draw_band(axes, Band(band, ladder))
        many = range_text((len(samples) for samples in ladder.values()), "sample")
        title = f"{systems_text([system])}\n$N={n_of(tables)}$, {many}"
        axes.set(xscale="log", yscale="log", xlabel=energy_label([system]))
        axes.legend(title=title, title_fontsize=8, fontsize=7, frameon=False, loc="upper left")
    guides(panels)
    panels[0].set_ylabel(rf"mean frequency  $\bar\omega\;{frequency_unit(tables)}$")
    save_figure(figure, options.out)


def guides(panels: Any) -> None:
    """Draw the exponents of the paper below the points."""
    low, high = panels[0].get_ylim()
    panels[0].set_ylim(low / 100, high * (100 * high / low) ** 0.55)  # room for legends
    for axes in panels:
        left, right = axes.get_xlim()
        u = np.geomspace(left * (right / left) ** 0.45, left * (right / left) ** 0.85, 2)
        for exponent, text in ((0.25, "1/4"), (0.5, "1/2")):
            y = low / 50 * (u / u[0]) ** exponent
            axes.plot(u, y, "k-", lw=1.2)
            axes.text(u[1] * 1.3, y[1], rf"$u^{{{text}}}$", fontsize=8, va="center")
        axes.set_xlim(left, right)


def row_of(system: System, band: Band) -> dict[str, Any]:
    """Report one band of one system."""
    law, same = band.fit(), band.fit(same=True)
    found: dict[str, Any] = system.report() | {"band": band.name}
    found["exponent"] = law.exponent if law else None
    found["exponent_at_same_number"] = same.exponent if same else None
    found["paper_exponent"] = PAPER_EXPONENTS[band.name] if of_paper(system) else None
    found["merged"] = [u for u in band.ladder if u not in band.apart()]
    found["omega"] = {f"{u:g}": m for u, m in band.curve().items()}
    for name, sign in (("positive", 1), ("negative", -1)):
        found[f"omega_{name}"] = {f"{u:g}": m.value for u, m in band.curve(sign).items()}
    return found


def main(options: Namespace) -> None:
    """Read, average, fit, draw, report."""
    tables = tables_asked(options)
    found = ladders(tables)
    if not found:
        msg = "no packing has modes below the high band, expected rods"
        raise ValueError(msg)
    draw(found, tables, options)
    rows = [row_of(system, Band(name, of)) for system, of in found.items() for name in STYLES]
    report({"out": options.out, "bands": rows})


if __name__ == "__main__":
    run(modes_parser(__doc__, "band_frequency.png"), main)
