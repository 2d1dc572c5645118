"""Draw residual forces and torques: Fig. 21 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig21_residuals.py SWEEP [MORE.h5 ...] --out residuals.png

Distributions over the particles that are no rattlers, of the net force over the mean bond force
(Eq. 36) and of the net torque over the mean contact torque (Eq. 37), as each packing's file gives
them. Packings whose forces do not balance are included. The last line of standard output is one JSON object with
quantiles.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.ensembles import PackingFile, System
from jamshape.files.h5md import read_observables

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import standard_error
from common.axes import SMALL_TEXT, figure_of, log_bars
from common.ensembles import Choice, choose, conditions, read_groups
from common.styles import marked
from common.text import bars_text, conditions_alone, counted, system_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PAPER_ALPHAS = (0.01, 4.0)
MOST = 5  # curves
PER_DECADE = 5  # bins
NAMES = {
    "net_force": r"net force / mean bond force,  $|\mathbf{F}_i|\,/\,\bar F$",
    "net_torque": r"net torque / mean contact torque,  $|\tau_i|\,/\,\bar\tau$",
}

Values = dict[System, list[FloatArray]]


def values_of(file: PackingFile, name: str) -> FloatArray:
    """Read one residual of all particles but the rattlers."""
    observables = read_observables(file.path)
    if name not in observables:
        msg = f"{file.path}: has no observable {name!r}, expected a packing of make_packing.py"
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


def draw_curve(axes: Axes, samples: list[FloatArray], bins: FloatArray, **style: Any) -> None:
    """Draw a distribution, averaged over samples with standard errors."""
    density = np.array([np.histogram(x, bins)[0] / len(x) / np.diff(bins) for x in samples])
    height, middles = density.mean(axis=0), np.sqrt(bins[1:] * bins[:-1])
    seen = height > 0
    bars = log_bars(height, standard_error(density))[:, seen]
    shown = style | ({"yerr": bars} if len(samples) > 1 else {})
    axes.errorbar(middles[seen], height[seen], **shown)


def draw(residuals: dict[str, Values], title: str, options: Namespace) -> None:
    """Draw both distributions."""
    figure = figure_of(9, 4.4)
    panels = figure.subplots(1, 2)
    for axes, (name, values) in zip(panels, residuals.items(), strict=True):
        bins, labels = decade_bins(values), system_labels(values)
        axes.set(xscale="log", yscale="log", xlabel=NAMES[name])
        axes.set_ylabel(r"probability density $\mathcal{P}$")
        if not len(bins):
            axes.text(0.5, 0.5, "none above 0", transform=axes.transAxes, ha="center")
            continue
        for k, (system, samples) in enumerate(values.items()):
            known = [x for x in samples if len(x)]  # discs have no torques
            if known:
                label = f"{labels[system]} ({counted(len(known), 'sample')})"
                draw_curve(axes, known, bins, label=label, **marked(k, "-"))
        axes.legend(**SMALL_TEXT)
    figure.suptitle(title + bars_text(values), fontsize=8)
    save_figure(figure, options.out)


def quantiles(samples: list[FloatArray]) -> dict[str, float | None]:
    """Median, 99th percentile and maximum over all particles of all samples."""
    every = np.concatenate(samples)
    if not len(every):
        return dict.fromkeys(("median", "percentile_99", "largest"))
    return {
        "median": float(np.median(every)),
        "percentile_99": float(np.percentile(every, 99)),
        "largest": float(every.max()),
    }


def main(options: Namespace) -> None:
    """Read, count, draw, report."""
    same = ("n", "size_ratio", "u0")
    every = read_groups(options.files, needs=["alpha"], same=same)
    groups = choose(every, "alpha", Choice(options.alpha, PAPER_ALPHAS, MOST))
    residuals = {
        name: {system: [values_of(file, name) for file in of] for system, of in groups.items()}
        for name in NAMES
    }
    draw(residuals, conditions_alone(groups), options)
    rows: list[dict[str, Any]] = []
    for system, files in groups.items():
        not_reached = sum(not file.reached for file in files)
        rows.append(system.report() | {"samples": len(files), "not_reached": not_reached})
        rows[-1] |= {name: quantiles(residuals[name][system]) for name in NAMES}
    report({"out": options.out, "conditions": conditions(groups), "residuals": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "residuals.png", "SWEEP")
    which = "of the curves (0.01 and 4 where there are such, as in the paper)"
    parser.add_argument("--alpha", type=float, nargs="+", default=[], help=which)
    run(parser, main)
