"""Find the strain amplitude at which cycles of packings of rods are no longer elastic, with its error.

    python analysis/shear/elastic_limit.py --alpha 0 1 4 --n 64 --u0 1e-4 --samples 8 --out runs/elastic_limit

Makes packings, one for each seed, and bisects the amplitude with quasistatic cycles: one is elastic if it loses less than
1e-3 of amplitude times range of the stress, and ends with the contacts with which it began. Draws which fraction of the
packings is still elastic at an amplitude. Started again after a kill it goes on: packings and amplitudes that are there
are not made again. The last line of standard output is one JSON object with the two amplitudes that enclose the limit
of each packing (0 or null if the limit is beyond all amplitudes), and for each alpha the mean of the middles of the
others with its standard error and their median.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from tqdm import tqdm

import jamshape as js
from jamshape.command import parser_of, plain, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import attributes_text
from jamshape.files.disk import store

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean
from common.axes import figure_of
from common.elastic_limit import ElasticLimit, elastic_limit

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def parser() -> ArgumentParser:
    """Describe the command line."""
    found = parser_of(__doc__)
    alphas = "aspect ratios of the rods; 0 are discs"
    found.add_argument("--alpha", type=float, nargs="+", default=[0.0, 1.0, 4.0], help=alphas)
    found.add_argument("--n", type=int, default=64, help="particles (%(default)s)")
    found.add_argument("--u0", type=float, default=1e-4, help="energy U/L^D (%(default)s)")
    found.add_argument("--samples", type=int, default=8, help="seeds (%(default)s)")
    close = "relative distance of the amplitudes that enclose the limit (%(default)s)"
    found.add_argument("--accuracy", type=float, default=0.05, help=close)
    found.add_argument(
        "--steps", type=int, default=20, help="steps of a quarter of a cycle (%(default)s)"
    )
    found.add_argument("--out", type=Path, required=True, help="folder")
    return found


def limit_of(alpha: float, seed: int, options: Namespace) -> ElasticLimit:
    """Make a packing and find its limit, unless both are there."""
    name = f"alpha{alpha:g}_n{options.n}_u{options.u0:g}_seed{seed}"
    file = options.out / f"{name}.h5"
    told = options.out / f"{name}_{options.accuracy:g}_{options.steps}.json"
    if not told.exists():
        packing = js.make_packing(
            js.Spherocylinders(alpha=alpha), n=options.n, u0=options.u0, seed=seed, file=file, progress=False
        )  # fmt: skip
        found = elastic_limit(packing, options.accuracy, options.steps)
        store(told, json.dumps(plain(found)).encode())
    low, high, cycles = json.loads(told.read_text()).values()
    return ElasticLimit(low, np.inf if high is None else high, cycles)


def figure_for(limits: dict[float, list[ElasticLimit]], options: Namespace) -> Figure:
    """Draw the fraction of packings that are elastic at an amplitude, with the interval of each limit."""
    figure = figure_of(5.0, 3.6)
    axes = figure.subplots()
    for k, (alpha, found) in enumerate(limits.items()):
        ordered = sorted(one for one in found if one.is_enclosed)
        at = [one.value for one in ordered]
        left = 1 - np.arange(1, len(at) + 1) / len(found)
        bars = [one.error for one in ordered]
        axes.errorbar(at, left, xerr=bars, fmt=".-", color=f"C{k}", drawstyle="steps-pre", lw=1,
                      label=rf"$\alpha={alpha:g}$")  # fmt: skip
    axes.set(
        xscale="log", xlabel="strain amplitude", ylabel="fraction still elastic", ylim=(-0.03, 1.03)
    )
    energy = attributes_text({"u0": options.u0})[0]
    axes.set_title(
        f"spherocylinders in 2D, $N={options.n}$, {energy}, {options.samples} packings each\n"
        "bars: amplitudes that enclose each limit",
        size=9,
    )
    axes.legend(fontsize=8)
    return figure


def main(options: Namespace) -> None:
    """Find, draw, report."""
    options.out.mkdir(parents=True, exist_ok=True)
    limits: dict[float, list[ElasticLimit]] = {alpha: [] for alpha in options.alpha}
    with tqdm(total=len(limits) * options.samples, unit="packing") as bar:
        for alpha, found in limits.items():
            for seed in range(1, options.samples + 1):
                found.append(limit_of(alpha, seed, options))
                bar.update()
    picture = options.out / "elastic_limit.png"
    save_figure(figure_for(limits, options), picture)
    rows = []
    for alpha, found in limits.items():
        at = [one.value for one in found if one.is_enclosed]
        median = float(np.median(at)) if at else np.nan
        rows.append({"alpha": alpha, "amplitude": mean(at), "median": median, "limits": found})
    report({"out": picture, "n": options.n, "u0": options.u0, "elastic_limits": rows})


if __name__ == "__main__":
    run(parser(), main)
