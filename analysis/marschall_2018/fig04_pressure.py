"""Draw pressure against packing fraction: Figs. 3 and 4 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_pressure.py RUN.h5 [MORE.h5 ...] --out pressure.png

At the jamming packing fraction phi_J of a run of pyscripts/compress.py the line through its pressure
just above the onset leads to zero. The last line of standard output is one JSON object with each
phi_J and, if the runs differ in nothing but their seed, the mean.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.files.h5md import read_attributes, read_observables
from jamshape.measures.onset import OnsetFit, fit_onset

PAPER_PHI_J = {0.0: 0.8412, 1.0: 0.8875, 4.0: 0.866}  # Secs. III A, B; by alpha, at N = 1024
ENSEMBLE = ("alpha", "n", "kappa", "size_ratio")
NAMED = 10  # runs, at most, that the legend names


class Run(NamedTuple):
    """A compression and its onset, or the sentence that says why there is none."""

    path: Path
    attributes: dict[str, Any]
    phi: FloatArray
    p: FloatArray
    fit: OnsetFit | None = None
    problem: str = ""


def read(path: Path) -> Run:
    """Read p(phi) and fit its onset."""
    observables = read_observables(path)
    if not {"phi", "p"} <= observables.keys():
        msg = f"{path}: has no observables phi and p, expected a run of compress.py"
        raise ValueError(msg)
    run = Run(path, read_attributes(path), observables["phi"], observables["p"])
    try:
        return run._replace(fit=fit_onset(run.phi, run.p))
    except ValueError as error:
        return run._replace(problem=f"{path}: {error}")


def mean_phi_J(runs: list[Run]) -> list[float]:
    """Average over several runs of one ensemble, with the standard error; else empty."""
    found = [run.fit.phi_J for run in runs if run.fit]
    if len(found) < 2 or len({tuple(map(run.attributes.get, ENSEMBLE)) for run in runs}) > 1:
        return []
    return [float(np.mean(found)), float(np.std(found, ddof=1) / np.sqrt(len(found)))]


def written(phi_J: float, error: float) -> str:
    """Write the digits that the error leaves."""
    digits = int(np.clip(np.ceil(-np.log10(error or 1e-9)), 3, 9))
    return rf"${phi_J:.{digits}f} \pm {error:.{digits}f}$"


def draw(runs: list[Run], mean: list[float], out: Path) -> None:
    """Draw all of each curve on the left; on the right the onsets with their lines."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(8, 3.7), dpi=200, layout="constrained")
    whole, onset = figure.subplots(1, 2)
    fits = [(k, run, run.fit) for k, run in enumerate(runs) if run.fit]
    for k, run, fit in fits:
        rise = fit.slope * (run.phi[fit.last] - fit.phi_J)
        onset.plot([fit.phi_J, run.phi[fit.last]], [0, rise], "k", lw=1, zorder=3)
        onset.plot(fit.phi_J, 0, "o", color=f"C{k}", mec="k", ms=5, zorder=4)
    if fits:
        onset.margins(x=0.3, y=0.3)
        onset.set(xlim=onset.get_xlim(), ylim=(-0.03 * onset.get_ylim()[1], None))
    for k, run in enumerate(runs):
        label = f"{run.path.stem}: {written(*run.fit[:2]) if run.fit else 'none'}"
        label = label if len(runs) <= NAMED else f"{len(runs)} runs" * (k == 0)
        whole.semilogy(run.phi, run.p, color=f"C{k}", lw=1)
        onset.plot(run.phi, run.p, ".-", color=f"C{k}", ms=3, lw=0.5, label=label)
    paper = {PAPER_PHI_J.get(run.attributes.get("alpha", -1.0)) for run in runs} - {None}
    for axes in (whole, onset):
        for phi in paper:
            axes.axvline(phi, color="0.4", ls=":", lw=1, label=f"{phi} quasistatic (paper)")
        axes.set(xlabel=r"packing fraction $\phi$", ylabel=r"pressure $p$  [$k_e/(2R_s)^2$]")
    whole.set_ylim(bottom=1e-6 * max(run.p.max() for run in runs) or None)
    onset.set_title(rf"$\phi_J =$ {written(*mean)}, mean of {len(fits)}" if mean else "", size=9)
    onset.legend(title=r"$\phi_J$", loc="upper left", fontsize=7, title_fontsize=8)
    figure.savefig(out)


def main() -> None:
    """Read, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN.h5", help="of compress.py")
    parser.add_argument("--out", type=Path, default=Path("pressure.png"), help="(pressure.png)")
    options = parser.parse_args()
    runs = [read(path) for path in options.runs]
    mean = mean_phi_J(runs)
    draw(runs, mean, options.out)
    none = dict.fromkeys(OnsetFit._fields)
    fits = [{"run": str(run.path), **(run.fit._asdict() if run.fit else none)} for run in runs]
    phi_J, error = mean or (None, None)
    print(json.dumps({"out": str(options.out), "runs": fits, "mean": phi_J, "error": error}))
    if problems := [run.problem for run in runs if run.problem]:
        raise ValueError(problems[0])


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_pressure.py: {error}")
