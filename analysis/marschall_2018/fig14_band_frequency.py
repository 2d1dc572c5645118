"""Draw mean frequencies of bands against energy: Figs. 14(b), 18(b), 20 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_band_frequency.py MODES [MORE.h5 ...] --out band_frequency.png

MODES are files of analysis/modes.py, or folders of them, of packings at several energies (energy_ladder.py).
Bands below the high one: low, of second order in the prestress, modes that slide; middle, of first order. Means of
sqrt|lambda| over the modes of a sample, then over samples with standard errors; where modes have negative
eigenvalues these and the others are also shown apart. Power laws of u are fitted to each sample where there is
a gap below the high band; the last line of standard output is one JSON object with the means of their exponents.
"""

from __future__ import annotations

import json
import math
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from mode_files import Tables, number, read_tables, selected, sizes, stable, unstable
from sweep_files import BLUE, RED, Mean, mean, plain

from jamshape.arrays import FloatArray
from jamshape.vibration.table import ModeTable

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

Curve = dict[float, Mean]


class Fit(NamedTuple):
    """Mean frequency = factor u^exponent."""

    exponent: Mean
    """Over samples."""
    factor: float


def mean_size(table: ModeTable, band: str, sign: int = 0) -> float:
    """Average sqrt|lambda| of the modes of a band, of one sign or of both; NaN without modes."""
    known = stable(table) | unstable(table) if sign == 0 else stable(table)
    if sign < 0:
        known = unstable(table)
    rows = table.in_band(band)
    values = sizes(table)[rows][known[rows]]
    return float(values.mean()) if len(values) else math.nan


def is_apart(table: ModeTable, band: str) -> bool:
    """Whether there is a gap between a band and the high one."""
    size = sizes(table) ** 2
    own, high = (size[table.in_band(name)] for name in (band, "high"))
    return bool(high.min(initial=math.inf) > GAP * own.max(initial=0.0))


def apart(tables: Tables, alpha: float, band: str) -> Tables:
    """Leave out energies where the band of some sample has merged with the high one."""
    return {
        key: samples
        for key, samples in tables.items()
        if key.alpha == alpha and all(is_apart(t, band) for t in samples)
    }


def curve(tables: Tables, alpha: float, band: str, sign: int = 0) -> Curve:
    """Average over samples at each energy; energies without modes of the band are left out."""
    found = {
        key.u0: mean([mean_size(t, band, sign) for t in samples])
        for key, samples in tables.items()
        if key.alpha == alpha
    }
    return {u: m for u, m in found.items() if m.samples}


def fit(tables: Tables, alpha: float, band: str, *, same: bool = False) -> Fit | None:
    """Fit a power law to every sample, where the band is one, or None if there are too few energies.

    With `same` only where it has the number of modes that it has most often, or nearly so: bonds that
    only graze open as u falls, which lets more rods slide.
    """
    by_seed: dict[float, list[tuple[float, float, int]]] = {}
    for key, samples in apart(tables, alpha, band).items():
        for table in samples:
            point = (key.u0, mean_size(table, band), len(table.in_band(band)))
            by_seed.setdefault(number(table, "seed"), []).append(point)
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


def draw_points(axes: Axes, points: Curve, **style: Any) -> None:
    """Draw means with standard errors."""
    u = np.array(list(points))
    value, error, _ = np.array(list(points.values()), np.float64).T
    bars: FloatArray = np.array(
        [np.minimum(np.nan_to_num(error), 0.9 * value), np.nan_to_num(error)]
    )
    axes.errorbar(u, value, bars, capsize=2, lw=0.8, **style)


def draw(tables: Tables, fits: dict[tuple[float, str], Fit | None], out: Path) -> None:
    """Draw one panel for each alpha."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    alphas = sorted({alpha for alpha, _ in fits})
    figure = Figure(figsize=(0.9 + 3.4 * len(alphas), 3.9), dpi=200, layout="constrained")
    panels = figure.subplots(1, len(alphas), sharey=True, squeeze=False)[0]
    for axes, alpha in zip(panels, alphas, strict=True):
        samples = [len(s) for key, s in tables.items() if key.alpha == alpha]
        for band, (marker, color) in STYLES.items():
            every = curve(tables, alpha, band)
            if not every:
                continue
            points = curve(apart(tables, alpha, band), alpha, band)
            merged = {u: m for u, m in every.items() if u not in points}
            if merged:
                text = f"{band} and high band merge"
                draw_points(axes, merged, fmt="x", color=color, ms=5, label=text)
            if not points:
                continue
            law = fits[alpha, band]
            text = f"{band} band"
            if law:
                x = law.exponent
                text += rf": $\bar\omega\sim u^{{{with_error(x)}}}$"
                same = fit(tables, alpha, band, same=True)
                if same and abs(same.exponent.value - x.value) > NOTEWORTHY:
                    text += f"\n(${with_error(same.exponent)}$ for the same number of modes)"
                u = np.geomspace(min(points) / 2, max(points) * 2, 2)
                axes.plot(u, law.factor * u**x.value, "-", color=color, lw=1, zorder=1)
            draw_points(axes, points, fmt=marker, color=color, mfc="none", ms=5, label=text)
            signs = {sign: curve(tables, alpha, band, sign) for sign in (1, -1)}
            if signs[-1]:
                names = {1: ("2", r"only $\lambda>0$"), -1: ("1", r"only $\lambda<0$")}
                for sign, (symbol, what) in names.items():
                    values = [m.value for m in signs[sign].values()]
                    place = np.array(list(signs[sign])) * 1.2**sign
                    axes.plot(place, values, symbol, color="0.35", ms=6, label=what, zorder=1)
        many = f"{min(samples)}" if len(set(samples)) == 1 else f"{min(samples)} to {max(samples)}"
        title = rf"$\alpha={alpha:g}$, {many} samples"
        axes.set(xscale="log", yscale="log", xlabel=r"energy density  $u=U/L^2\;[k_e/(2R_s)^2]$")
        axes.legend(title=title, title_fontsize=8, fontsize=7, frameon=False, loc="upper left")
    guides(panels)
    panels[0].set_ylabel(r"mean frequency  $\bar\omega\;[\sqrt{k_e}/2R_s]$")
    figure.savefig(out)


def with_error(value: Mean) -> str:
    """Write a number with its error in TeX."""
    if math.isnan(value.error):
        return f"{value.value:.3f}"
    digits = min(max(3, -math.floor(math.log10(max(value.error, 1e-9)))), 5)
    return rf"{value.value:.{digits}f}\pm {value.error:.{digits}f}"


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
            axes.text(u[1] * 1.4, y[1], text, fontsize=8, va="center")
        axes.set_xlim(left, right)


def main() -> None:
    """Read, average, fit, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("modes", type=Path, nargs="+", metavar="MODES", help="folder or files")
    parser.add_argument("--alpha", type=float, nargs="+", default=[], help="only these (all)")
    parser.add_argument(
        "--out", type=Path, default=Path("band_frequency.png"), help="(%(default)s)"
    )
    options = parser.parse_args()
    tables = selected(read_tables(options.modes), options.alpha, [])
    with_bands = sorted(
        {key.alpha for key, s in tables.items() for b in STYLES for t in s if len(t.in_band(b))}
    )
    if not with_bands:
        msg = "no packing has modes below the high band, expected rods"
        raise ValueError(msg)
    fits = {(a, b): fit(tables, a, b) for a in with_bands for b in STYLES}
    draw(tables, fits, options.out)
    rows = [row(tables, alpha, band, law) for (alpha, band), law in fits.items()]
    print(json.dumps({"out": str(options.out), "bands": rows}))


def row(tables: Tables, alpha: float, band: str, law: Fit | None) -> dict[str, Any]:
    """Report one band of one alpha."""
    found: dict[str, Any] = {"alpha": alpha, "band": band}
    found["exponent"] = law.exponent.report() if law else None
    same = fit(tables, alpha, band, same=True)
    found["exponent_at_same_number"] = same.exponent.report() if same else None
    found["paper_exponent"] = PAPER_EXPONENTS[band]
    found["merged"] = [
        key.u0 for key in tables if key.alpha == alpha and key not in apart(tables, alpha, band)
    ]
    found["omega"] = {f"{u:g}": m.report() for u, m in curve(tables, alpha, band).items()}
    for name, sign in (("positive", 1), ("negative", -1)):
        means = curve(tables, alpha, band, sign)
        found[f"omega_{name}"] = {f"{u:g}": plain(m.value) for u, m in means.items()}
    return found


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_band_frequency.py: {error}")
