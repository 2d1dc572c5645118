"""Draw orientational order against packing fraction: Fig. 2 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig02_order.py RUN.h5 [MORE.h5 ...] --out order.png

Runs of pyscripts/compress.py that differ in their seed only are averaged. In the plane sqrt(N) S_n that depends
neither on N nor on phi, at the dashed line, is the order of random orientations: none. The last
line of standard output is one JSON object with the averages over phi, and the rise of the order, sample by sample, from
the start to --rise-to.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.ensembles import PackingFile
from jamshape.measures.averages import Mean
from jamshape.measures.runs import Ensemble, ensemble_of, observables_of

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean, standard_error
from common.axes import SMALL_TEXT, figure_of
from common.text import counted, ensemble_labels, ensembles_title

ORDERS = {"S_2": "nematic", "S_4": "tetratic"}
POINTS = 30
RANDOM = np.sqrt(np.pi) / 2  # in the plane

Samples = list[dict[str, FloatArray]]


class Curve(NamedTuple):
    """sqrt(N) S_n over phi, averaged over samples."""

    phi: FloatArray
    """(POINTS,)"""
    mean: FloatArray
    """(2, POINTS), of the `ORDERS`."""
    error: FloatArray
    """(2, POINTS), 0 for one sample."""
    over_phi: tuple[Mean, Mean]
    """Averages over phi, whose errors are those over samples."""
    rise: tuple[Mean, Mean]
    """From the start to a packing fraction, sample by sample."""
    samples: int


def read(paths: list[Path]) -> dict[Ensemble, Samples]:
    """Read the observables of all runs, by ensemble in the order of N."""
    runs: dict[Ensemble, Samples] = {}
    for path in paths:
        file = PackingFile.read(path)
        runs.setdefault(ensemble_of(file), []).append(observables_of(file, ("phi", *ORDERS)))
    return dict(sorted(runs.items(), key=lambda item: item[0].n))


def average(n: int, runs: Samples, rise_to: float | None) -> Curve:
    """Average sqrt(N) S_n over samples where all have been, and its rise to a packing fraction there (the last)."""
    start, end = max(run["phi"][0] for run in runs), min(run["phi"][-1] for run in runs)
    if not start < end:
        msg = f"runs with N = {n} share no range of phi, expected compressions that overlap"
        raise ValueError(msg)
    last = end if rise_to is None else rise_to
    if not start <= last <= end:
        msg = f"--rise-to is {last:g}, expected from {start:.4g} to {end:.4g}, where all runs with N = {n} have been"
        raise ValueError(msg)
    phi = np.linspace(start, end, POINTS)
    scaled, ends = sampled(n, runs, phi), sampled(n, runs, np.array([start, last]))
    over_phi, rise = both(scaled.mean(axis=2)), both(ends[:, :, 1] - ends[:, :, 0])
    return Curve(phi, scaled.mean(axis=0), standard_error(scaled), over_phi, rise, len(runs))


def sampled(n: int, runs: Samples, phi: FloatArray) -> FloatArray:
    """(m, 2, k) sqrt(N) S_n of m runs at k packing fractions."""
    at = [[np.interp(phi, run["phi"], run[name]) for name in ORDERS] for run in runs]
    return np.asarray(np.sqrt(n) * np.array(at))


def both(orders: FloatArray) -> tuple[Mean, Mean]:
    """Average (m, 2) nematic and tetratic order over m samples."""
    nematic, tetratic = orders.T
    return mean(nematic), mean(tetratic)


def draw(curves: dict[Ensemble, Curve], options: Namespace) -> None:
    """Draw S_2 on the left and S_4 on the right."""
    figure = figure_of(8, 3.7)
    panels, labels = figure.subplots(1, 2, sharey=True), ensemble_labels(curves)
    for order, (axes, (name, text)) in enumerate(zip(panels, ORDERS.items(), strict=True)):
        for k, (ensemble, curve) in enumerate(curves.items()):
            bars = curve.error[order] if curve.error[order].any() else None
            label = f"{labels[ensemble]} ({counted(curve.samples, 'sample')})"
            style = {"marker": "osDv^"[k % 5], "ms": 3.5, "lw": 0.8, "elinewidth": 0.8}
            axes.errorbar(
                curve.phi, curve.mean[order], bars, capsize=1.5, mfc="none", label=label, **style
            )
        if any(ensemble.system.dimension == 2 for ensemble in curves):
            line = {"color": "0.3", "ls": "--", "lw": 1, "zorder": 0}
            axes.axhline(RANDOM, label=r"random, $\sqrt{\pi}/2$", **line)
        ylabel = rf"{text} order $\sqrt{{N}}\,\langle {name} \rangle$"
        axes.set(xlabel=r"packing fraction $\phi$", ylabel=ylabel)
        axes.tick_params(labelleft=True)
    panels[0].set_ylim(bottom=0)
    if any(curve.samples > 1 for curve in curves.values()):
        panels[0].plot([], [], "|", color="0.3", label="standard error of the mean")
    handles = panels[0].get_legend_handles_labels()
    place: dict[str, Any] = {"loc": "outside upper center", "ncols": 3, "frameon": False}
    figure.legend(*handles, title=ensembles_title(curves), **SMALL_TEXT, **place)
    save_figure(figure, options.out)


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    runs = read(options.files)
    curves = {of: average(of.n, samples, options.rise_to) for of, samples in runs.items()}
    draw(curves, options)
    rows = []
    for ensemble, curve in curves.items():
        means = {f"sqrtN_{n}": of._asdict() for n, of in zip(ORDERS, curve.over_phi, strict=True)}
        means |= {f"rise_{n}": of._asdict() for n, of in zip(ORDERS, curve.rise, strict=True)}
        row = ensemble.report() | {"phi_start": curve.phi[0], "phi_end": curve.phi[-1]}
        rows.append(row | means)
    report({"out": options.out, "random": RANDOM, "ensembles": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "order.png", "RUN.h5")
    parser.add_argument(
        "--rise-to", type=float, metavar="PHI", help="packing fraction (the last one)"
    )
    run(parser, main)
