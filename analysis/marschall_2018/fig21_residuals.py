"""Draw what is left of forces and torques: Fig. 21 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_residuals.py SWEEP [MORE.h5 ...] --out residuals.png

Distributions over the particles that are no rattlers, of the net force over the mean bond force
(Eq. 36) and of the net torque over the mean contact torque (Eq. 37), as each packing's file gives
them. Packings that stalled are included. The last line of standard output is one JSON object with
quantiles.
"""

from __future__ import annotations

import json
import math
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path
from typing import Any

import numpy as np
from sweep_files import COLORS, MARKERS, Sample, choose_alphas, plain, read_sweep

from jamshape.arrays import FloatArray
from jamshape.files.h5md import read_observables

PAPER_ALPHAS = (0.01, 4.0)
PER_DECADE = 5  # bins
NAMES = ("net_force", "net_torque")
LABELS = (
    r"net force / mean bond force,  $|\mathbf{F}_i|\,/\,\bar F$",
    r"net torque / mean contact torque,  $|\tau_i|\,/\,\bar\tau$",
)

Values = dict[float, list[FloatArray]]


def values_of(sample: Sample, name: str) -> FloatArray:
    """Read one residual of all particles but the rattlers."""
    observables = read_observables(sample.path)
    if name not in observables:
        msg = f"{sample.path}: has no observable {name!r}, expected a packing of make_packing.py"
        raise ValueError(msg)
    values: FloatArray = np.abs(np.asarray(observables[name][-1], np.float64))
    return values[np.isfinite(values)]


def decade_bins(values: Values) -> FloatArray:
    """Bins of equal relative width around all values above 0."""
    every = np.concatenate([x for samples in values.values() for x in samples])
    every = every[every > 0]
    if not len(every):
        return np.empty(0)
    low = math.floor(PER_DECADE * math.log10(every.min()))
    high = math.floor(PER_DECADE * math.log10(every.max())) + 1
    bins: FloatArray = 10.0 ** (np.arange(low, high + 1) / PER_DECADE)
    return bins


def draw(residuals: dict[str, Values], n: int, out: Path) -> None:
    """Draw both distributions, averaged over samples with standard errors."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(9, 3.9), dpi=200, layout="constrained")
    panels = figure.subplots(1, 2)
    for axes, values, text in zip(panels, residuals.values(), LABELS, strict=True):
        bins = decade_bins(values)
        axes.set(
            xscale="log", yscale="log", xlabel=text, ylabel=r"probability density $\mathcal{P}$"
        )
        if not len(bins):
            axes.text(0.5, 0.5, "none above 0", transform=axes.transAxes, ha="center")
            continue
        middles = np.sqrt(bins[1:] * bins[:-1])
        for k, (alpha, samples) in enumerate(values.items()):
            samples = [x for x in samples if len(x)]  # noqa: PLW2901 - discs have no torques
            if not samples:
                continue
            density = np.array([np.histogram(x, bins)[0] / len(x) / np.diff(bins) for x in samples])
            height, error = density.mean(axis=0), density.std(axis=0)
            error /= np.sqrt(max(len(samples) - 1, 1))
            seen = height > 0
            bars = np.array([np.minimum(error, 0.9 * height), error])[:, seen]  # log axis: not to 0
            label = rf"$\alpha={alpha:g}$ ({len(samples)} sample{'s' * (len(samples) > 1)})"
            style: dict[str, Any] = {"color": COLORS[k % len(COLORS)], "mfc": "none", "ms": 4}
            style |= {"fmt": f"{MARKERS[k % len(MARKERS)]}-", "lw": 0.8, "elinewidth": 0.8}
            style |= {"yerr": bars} if len(samples) > 1 else {}
            axes.errorbar(middles[seen], height[seen], capsize=1.5, label=label, **style)
        axes.legend(title=f"$N={n}$", title_fontsize=8, fontsize=8)
    figure.savefig(out)


def quantiles(samples: list[FloatArray]) -> dict[str, float | None]:
    """Median, 99th percentile and maximum over all particles of all samples."""
    every = np.concatenate(samples)
    if not len(every):
        return dict.fromkeys(("median", "percentile_99", "largest"))
    return {
        "median": plain(float(np.median(every))),
        "percentile_99": plain(float(np.percentile(every, 99))),
        "largest": plain(float(every.max())),
    }


def main() -> None:
    """Read, count, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("packings", type=Path, nargs="+", metavar="SWEEP", help="folder or files")
    which = "of the curves (0.01 and 4 where there are such, as in the paper)"
    parser.add_argument("--alpha", type=float, nargs="+", default=[], help=which)
    parser.add_argument("--out", type=Path, default=Path("residuals.png"), help="(%(default)s)")
    options = parser.parse_args()
    sweep = read_sweep(options.packings, with_stalled=True)
    alphas = choose_alphas(sweep, options.alpha, PAPER_ALPHAS, most=5)
    residuals = {
        name: {alpha: [values_of(sample, name) for sample in sweep[alpha]] for alpha in alphas}
        for name in NAMES
    }
    n = next(iter(sweep.values()))[0].attributes["n"]
    draw(residuals, n, options.out)
    rows: list[dict[str, Any]] = []
    for alpha in alphas:
        stalled = sum(not sample.reached for sample in sweep[alpha])
        rows.append({"alpha": alpha, "samples": len(sweep[alpha]), "stalled": stalled})
        rows[-1] |= {name: quantiles(residuals[name][alpha]) for name in NAMES}
    print(json.dumps({"out": str(options.out), "residuals": rows}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_residuals.py: {error}")
