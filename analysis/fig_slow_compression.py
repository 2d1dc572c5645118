"""Draw p(phi) at several rates: Fig. 3 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_slow_compression.py RUN.h5 [MORE.h5 ...] --packing PACKING.h5 --out slow.png

Runs are of pyscripts/slow_compress.py or compress.py; there is a column for each alpha and N, with p on a
linear axis above and on a logarithmic one below. Lines mark phi_J of the slowest run, from the line
through its pressure just above the onset (Fig. 4), and of packings at an energy. The last line of
standard output is one JSON object with, for each run, the median relative difference of its pressure
from that of the slowest run above that one's phi_J.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.jamming import OnsetFit, fit_onset
from jamshape.packing import FloatArray
from jamshape.storage import read_attributes, read_observables

# Packing fractions where two runs are compared.
GRID = 1000


class Run(NamedTuple):
    """A compression, and its onset if it has one."""

    path: Path
    alpha: float
    n: int
    kappa: float
    phi: FloatArray
    p: FloatArray
    fit: OnsetFit | None


def read(path: Path) -> Run:
    """Read p(phi) and fit its onset."""
    attributes, observables = read_attributes(path), read_observables(path)
    if not ({"phi", "p"} <= observables.keys() and {"alpha", "n", "kappa"} <= attributes.keys()):
        msg = (
            f"{path} is no compression, expected observables phi and p, attributes alpha, n, kappa"
        )
        raise ValueError(msg)
    phi, p = observables["phi"], observables["p"]
    kappa = float(np.asarray(attributes["kappa"]).reshape(-1)[-1])
    try:
        fit = fit_onset(phi, p)
    except ValueError:  # it ends below jamming, or rearranges too soon
        fit = None
    return Run(path, float(attributes["alpha"]), int(attributes["n"]), kappa, phi, p, fit)


def draw(runs: list[Run], packings: list[dict[str, Any]], out: Path) -> None:
    """Draw one column for each alpha and N."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    systems = sorted({(run.alpha, run.n) for run in runs})
    figure = Figure(figsize=(4.5 * len(systems), 6), dpi=150, layout="constrained")
    axes = figure.subplots(2, len(systems), squeeze=False, sharex="col")
    for (alpha, n), (linear, logarithmic) in zip(systems, axes.T, strict=True):
        of = [run for run in runs if (run.alpha, run.n) == (alpha, n)]
        of.sort(key=lambda run: -run.kappa)
        for k, run in enumerate(of):
            for axis in (linear, logarithmic):
                axis.plot(run.phi, run.p, "-", color=f"C{k}", lw=1, label=f"{run.kappa:g}")
        fitted = [run.fit for run in of if run.fit]
        for axis in (linear, logarithmic):
            if fitted:
                label = rf"$\phi_J$ = {fitted[-1].phi_J:.5f}, fit"
                axis.axvline(fitted[-1].phi_J, color="k", ls="--", lw=0.8, label=label)
            for packing in packings:
                if (packing.get("alpha"), packing.get("n")) == (alpha, n):
                    label = rf"$\phi_J$ = {packing['phi_J']:.5f}, energy"
                    axis.axvline(packing["phi_J"], color="k", ls=":", lw=0.8, label=label)
        linear.set(title=rf"$\alpha$ = {alpha:g}, N = {n}", ylabel="pressure $p$")
        logarithmic.set(xlabel=r"packing fraction $\phi$", ylabel="pressure $p$", yscale="log")
        linear.legend(title=r"$\kappa$", fontsize=7)
    figure.savefig(out)


def difference(run: Run, slowest: Run) -> float | None:
    """Median relative difference of the pressures above phi_J of the slowest run."""
    if slowest.fit is None:
        return None
    end = min(run.phi[-1], slowest.phi[-1])
    phi = np.linspace(max(slowest.fit.phi_J, run.phi[0], slowest.phi[0]), end, GRID)
    p, of_slowest = np.interp(phi, run.phi, run.p), np.interp(phi, slowest.phi, slowest.p)
    return float(np.median(np.abs(p / of_slowest - 1)))


def main() -> None:
    """Read, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN.h5")
    parser.add_argument("--packing", type=Path, nargs="*", default=[], help="of make_packing.py")
    parser.add_argument("--out", type=Path, default=Path("slow.png"), help="(slow.png)")
    options = parser.parse_args()
    runs = [read(path) for path in options.runs]
    packings = [read_attributes(path) for path in options.packing]
    draw(runs, packings, options.out)
    slowest = {(r.alpha, r.n): r for r in sorted(runs, key=lambda run: -run.kappa)}
    rows = [
        {"run": str(r.path), "alpha": r.alpha, "n": r.n, "kappa": r.kappa, "phi": float(r.phi[-1]),
         "p": float(r.p[-1]), "phi_J": r.fit.phi_J if r.fit else None,
         "phi_J_error": r.fit.phi_J_error if r.fit else None,
         "difference": difference(r, slowest[r.alpha, r.n])}
        for r in runs
    ]  # fmt: skip
    print(json.dumps({"out": str(options.out), "runs": rows}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_slow_compression.py: {error}")
