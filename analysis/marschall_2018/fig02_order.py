"""Draw orientational order against packing fraction: Fig. 2 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_order.py RUN.h5 [MORE.h5 ...] --out order.png

Runs of pyscripts/compress.py that differ in their seed only are averaged. sqrt(N) S_n that depends
neither on N nor on phi, at the dashed line, is the order of random orientations: none. The last
line of standard output is one JSON object with the averages over phi.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.files.h5md import read_attributes, read_observables

ENSEMBLE = ("n", "alpha", "kappa", "size_ratio")
SYMBOLS = ("N", r"\alpha", r"\kappa", "R_b/R_s")
ORDERS = ("S_2", "S_4")
POINTS = 30
RANDOM = np.sqrt(np.pi) / 2

Ensemble = tuple[Any, ...]


def read(paths: list[Path]) -> dict[Ensemble, list[dict[str, FloatArray]]]:
    """Read the observables of all runs, by ensemble in the order of N."""
    runs: dict[Ensemble, list[dict[str, FloatArray]]] = {}
    for path in paths:
        observables, attributes = read_observables(path), read_attributes(path)
        if not {"phi", *ORDERS} <= observables.keys() or "n" not in attributes:
            msg = f"{path}: has no observables phi, S_2, S_4, expected a run of compress.py"
            raise ValueError(msg)
        key = tuple(attributes.get(name, np.nan) for name in ENSEMBLE)
        runs.setdefault(key, []).append(observables)
    return dict(sorted(runs.items()))


def average(n: int, runs: list[dict[str, FloatArray]]) -> tuple[FloatArray, FloatArray]:
    """Average sqrt(N) S_n over samples where all have been; errors of the mean if there are two.

    Returns
    -------
    phi : (POINTS,)
    mean and error : (2, 2, POINTS), each for both of `ORDERS`; the error of one sample is 0.
    """
    start, end = max(run["phi"][0] for run in runs), min(run["phi"][-1] for run in runs)
    if not start < end:
        msg = f"runs with N = {n} share no range of phi, expected compressions that overlap"
        raise ValueError(msg)
    phi = np.linspace(start, end, POINTS)
    S = np.array([[np.interp(phi, run["phi"], run[name]) for name in ORDERS] for run in runs])
    return phi, np.sqrt(n) * np.array([S.mean(axis=0), S.std(axis=0) / np.sqrt(max(len(S) - 1, 1))])


def label(key: Ensemble, keys: list[Ensemble], samples: int) -> str:
    """Name N, what else differs between the ensembles, and the number of samples."""
    columns = zip(SYMBOLS, key, *keys, strict=True)
    shown = [f"${a} =${v:g}" for a, v, *all_v in columns if a == "N" or len(set(all_v)) > 1]
    return ", ".join(shown) + f" ({samples} sample{'s' * (samples > 1)})"


def draw(
    curves: dict[Ensemble, tuple[FloatArray, FloatArray]], labels: list[str], out: Path
) -> None:
    """Draw S_2 on the left and S_4 on the right."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(8, 3.7), dpi=200, layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for axes, name, order in zip(panels, ("nematic", "tetratic"), (0, 1), strict=True):
        for k, (phi, values) in enumerate(curves.values()):
            mean, error = values[:, order]
            bars = error if error.any() else None
            style = {"marker": "osDv^"[k % 5], "ms": 3.5, "lw": 0.8, "elinewidth": 0.8}
            axes.errorbar(phi, mean, bars, capsize=1.5, mfc="none", label=labels[k], **style)
        axes.axhline(RANDOM, color="0.3", ls="--", lw=1, label=r"random, $\sqrt{\pi}/2$", zorder=0)
        ylabel = rf"{name} order $\sqrt{{N}}\,\langle {ORDERS[order]} \rangle$"
        axes.set(xlabel=r"packing fraction $\phi$", ylabel=ylabel)
        axes.tick_params(labelleft=True)
    panels[0].set_ylim(bottom=0)
    handles = panels[0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside upper center", ncols=3, fontsize=8, frameon=False)
    figure.savefig(out)


def main() -> None:
    """Read, average, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN.h5", help="of compress.py")
    parser.add_argument("--out", type=Path, default=Path("order.png"), help="(order.png)")
    options = parser.parse_args()
    runs = read(options.runs)
    curves = {key: average(key[0], samples) for key, samples in runs.items()}
    labels = [label(key, list(runs), len(samples)) for key, samples in runs.items()]
    draw(curves, labels, options.out)
    report = []
    for key, (phi, values) in curves.items():
        means = {f"sqrtN_{n}": m.mean() for n, m in zip(ORDERS, values[0], strict=True)}
        known = dict(zip(ENSEMBLE, key, strict=True)) | {"samples": len(runs[key])}
        report.append(known | {"phi_start": phi[0], "phi_end": phi[-1]} | means)
    print(json.dumps({"out": str(options.out), "random": RANDOM, "ensembles": report}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_order.py: {error}")
