"""Draw phi - phi_J against energy: the packing fractions of Figs. 14 and 18 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_jamming_distance.py LADDER [MORE.h5 ...] --out jamming_distance.png

LADDER is a folder of energy_ladder.py, or of packings at several u0. phi_J of a sample is where sqrt(u), linear
in phi, vanishes below its lowest energy. Means over samples with standard errors, on the right without the trend
u^(1/2); power laws of u are fitted to each sample. The last line of standard output is one JSON object with
these numbers beside the paper's.
"""

from __future__ import annotations

import json
import math
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path
from typing import Any

import numpy as np
from sweep_files import COLORS, MARKERS, PAPER_STYLE, REACHED, Mean, Sample, mean, plain

from jamshape.files.h5md import FileFormatError, read_attributes

EXPONENT = 0.5
# Captions of Figs. 14 and 18, N = 1024. The one of alpha = 4 at u = 1e-9, 4.3e-4, does not fit the others.
PAPER = {
    0.01: {1e-15: 7.4e-8, 1e-14: 2.4e-7, 1e-12: 2.4e-6},
    4.0: {1e-15: 9.1e-8, 1e-11: 9.3e-6, 1e-9: 4.3e-4},
}
MISPRINT = 4.3e-4
FEWEST = 3  # energies of a fit

Ladder = dict[float, dict[float, dict[float, float]]]
"""phi - phi_J by alpha, seed and u."""


def samples_in(path: Path) -> list[Sample]:
    """Read one packing, or those of a folder."""
    if not path.is_dir():
        return [Sample(path, read_attributes(path))]
    found = []
    for file in sorted(path.glob("*.h5")):
        try:
            found.append(Sample(file, read_attributes(file)))
        except FileFormatError:
            continue  # files of other kinds
    return [sample for sample in found if "outcome" in sample.attributes]


def read_ladder(paths: list[Path]) -> Ladder:
    """Read phi - phi_J of packings in equilibrium.

    Raises
    ------
    ValueError
        If there is no sample at two energies.
    """
    rows: dict[tuple[float, float], dict[float, tuple[float, float]]] = {}
    for sample in (s for path in paths for s in samples_in(path)):
        if sample.attributes.get("outcome") in REACHED:
            alpha, seed = sample.number("alpha"), sample.number("seed")
            phi = sample.number("phi"), sample.number("phi_J")
            rows.setdefault((alpha, seed), {})[sample.number("u0")] = phi
    ladder: Ladder = {}
    for (alpha, seed), points in sorted(rows.items()):
        if len(points) > 1:
            _, phi_J = points[min(points)]
            above = {u: phi - phi_J for u, (phi, _) in sorted(points.items())}
            ladder.setdefault(alpha, {})[seed] = above
    if not ladder:
        msg = (
            f"{', '.join(map(str, paths))}: no sample at two energies, expected energy_ladder.py's"
        )
        raise ValueError(msg)
    return ladder


def averages(samples: dict[float, dict[float, float]]) -> dict[float, Mean]:
    """Average over samples at each energy."""
    energies = sorted({u for points in samples.values() for u in points})
    return {u: mean([p[u] for p in samples.values() if u in p]) for u in energies}


def exponent(samples: dict[float, dict[float, float]]) -> Mean:
    """Fit a power law to every sample and average."""
    slopes = [
        np.polyfit(np.log(list(points)), np.log(list(points.values())), 1)[0]
        for points in samples.values()
        if len(points) >= FEWEST and min(points.values()) > 0
    ]
    return mean(slopes)


def draw(ladder: Ladder, out: Path) -> None:
    """Draw phi - phi_J on the left, without its trend on the right."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(9, 3.9), dpi=200, layout="constrained")
    left, right = figure.subplots(1, 2)
    energies = [u for samples in ladder.values() for u in averages(samples)]
    lowest, highest = min(energies), max(energies)
    for k, (alpha, samples) in enumerate(ladder.items()):
        points, law, color = averages(samples), exponent(samples), COLORS[k % len(COLORS)]
        u = np.array(list(points))
        value, error, _ = np.array(list(points.values())).T
        label = rf"$\alpha={alpha:g}$, {len(samples)} sample{'s' * (len(samples) > 1)}"
        if law.samples:
            off = "" if math.isnan(law.error) else rf"\pm {law.error:.4f}"
            label += rf": $u^{{{law.value:.4f}{off}}}$"
        style: dict[str, Any] = {"fmt": MARKERS[k % len(MARKERS)], "color": color, "mfc": "none"}
        style |= {"ms": 6, "capsize": 2, "lw": 1, "elinewidth": 1}
        left.errorbar(u, value, np.nan_to_num(error), label=label, **style)
        scale = u**EXPONENT
        right.errorbar(u, value / scale, np.nan_to_num(error) / scale, **style)
        paper = PAPER.get(alpha, {}).items()
        stars = [(x, y) for x, y in paper if lowest / 3 <= x <= highest * 3 and y != MISPRINT]
        if stars:
            x, y = np.transpose(stars)
            star: dict[str, Any] = {"ms": PAPER_STYLE["ms"], "lw": 0, "zorder": 1.5, "color": color}
            left.plot(x, y, "*", mec="k", mew=0.7, **star)
            right.plot(x, y / x**EXPONENT, "*", mec="k", mew=0.7, **star)
    left.plot(
        [], [], "*", color="w", mec="k", mew=0.7, ms=PAPER_STYLE["ms"], label="paper, $N=1024$"
    )
    for axes in (left, right):
        axes.set(xscale="log", xlabel=r"energy density  $u=U/L^2\;[k_e/(2R_s)^2]$")
    left.set(yscale="log", ylabel=r"$\phi-\phi_J$")
    right.set_ylabel(r"$(\phi-\phi_J)\;/\;u^{1/2}$")
    low, high = right.get_ylim()
    right.set_ylim(low - 0.2 * (high - low), high + 0.2 * (high - low))
    left.legend(fontsize=8, frameon=False, loc="upper left")
    figure.savefig(out)


def main() -> None:
    """Read, average, fit, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("packings", type=Path, nargs="+", metavar="LADDER", help="folder or files")
    parser.add_argument(
        "--out", type=Path, default=Path("jamming_distance.png"), help="(%(default)s)"
    )
    options = parser.parse_args()
    ladder = read_ladder(options.packings)
    draw(ladder, options.out)
    rows: list[dict[str, Any]] = []
    for alpha, samples in ladder.items():
        distance = {f"{u:g}": m.report() for u, m in averages(samples).items()}
        paper = {f"{u:g}": value for u, value in PAPER.get(alpha, {}).items()}
        rows.append({"alpha": alpha, "samples": len(samples), "distance": distance})
        rows[-1] |= {"paper": paper, "exponent": exponent(samples).report()}
        rows[-1]["exponent_expected"] = plain(EXPONENT)
    print(json.dumps({"out": str(options.out), "jamming_distance": rows}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_jamming_distance.py: {error}")
