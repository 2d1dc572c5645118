"""Draw p(phi) at several rates: Fig. 3 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_slow_compression.py RUN.h5 [MORE.h5 ...] --packing PACKING.h5 --out slow.png

Runs are of pyscripts/slow_compress.py or compress.py; there is a column for each alpha and N, with p on a
linear axis above and on a logarithmic one below, and a line for each rate: the mean over samples (seeds),
which are drawn thin. Vertical lines mark phi_J of the slowest rate, from the lines through the pressures
just above the onsets (Fig. 4), and of packings at an energy. Prints a table (Markdown) of what runs cost (medians;
beside Heun's method with dt = 0.01), of phi_J, of how far it lies from that of the slowest rate, and of
the pressure above phi_J over that of the slowest rate, sample by sample, with standard errors. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import json
import math
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.files.h5md import read_attributes, read_observables
from jamshape.measures.onset import OnsetFit, fit_onset

# Packing fractions where runs are averaged and compared.
GRID = 1000


# Of Heun's method, whose evaluations are compared.
HEUN_DT = 0.01


class Cost(NamedTuple):
    """What a slow compression cost."""

    evaluations: float
    heun: float
    """Evaluations of Heun's method with its fixed time step, over these."""
    seconds: float


class Run(NamedTuple):
    """A compression, its onset if it has one, its cost if that is known."""

    path: Path
    alpha: float
    n: int
    seed: int
    kappa: float
    phi: FloatArray
    p: FloatArray
    fit: OnsetFit | None
    cost: Cost | None


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
    system = float(attributes["alpha"]), int(attributes["n"]), int(attributes.get("seed", 0))
    return Run(path, *system, kappa, phi, p, fit, cost_of(attributes, kappa))


def cost_of(attributes: Mapping[str, Any], kappa: float) -> Cost | None:
    """Read what a run of slow_compress.py cost."""
    if "flow_evaluations" not in attributes:
        return None
    evaluations = float(attributes["flow_evaluations"])
    heun = 2 * float(attributes["flow_strain"]) / (kappa * HEUN_DT)
    return Cost(evaluations, heun / evaluations, float(attributes["flow_wall_seconds"]))


class Ensemble(NamedTuple):
    """Samples of one system compressed at one rate."""

    alpha: float
    n: int
    kappa: float
    runs: list[Run]

    @classmethod
    def all_of(cls, runs: list[Run]) -> list[Ensemble]:
        """Group runs, the fastest of each system first."""
        keys = sorted({(r.alpha, r.n, -r.kappa) for r in runs})
        return [
            cls(alpha, n, -rate, [r for r in runs if (r.alpha, r.n, -r.kappa) == (alpha, n, rate)])
            for alpha, n, rate in keys
        ]

    @property
    def onsets(self) -> dict[int, float]:
        """phi_J of each seed that has one."""
        return {run.seed: run.fit.phi_J for run in self.runs if run.fit}

    def onset(self) -> Mean:
        """Mean phi_J; the error of the fit where there is one sample."""
        if len(self.onsets) == 1:
            fit = next(run.fit for run in self.runs if run.fit)
            return Mean(fit.phi_J, fit.phi_J_error, 1)
        return Mean.of(list(self.onsets.values()))

    def pressure(self) -> tuple[FloatArray, FloatArray]:
        """Mean p(phi) where all samples have one."""
        phi = np.linspace(max(r.phi[0] for r in self.runs), min(r.phi[-1] for r in self.runs), GRID)
        return phi, np.mean([np.interp(phi, r.phi, r.p) for r in self.runs], axis=0)


class Mean(NamedTuple):
    """A mean over samples and its standard error."""

    value: float
    error: float
    samples: int

    @classmethod
    def of(cls, values: list[float]) -> Mean:
        """Average; not a number without samples, no error with one."""
        n = len(values)
        error = float(np.std(values, ddof=1) / np.sqrt(n)) if n > 1 else float("nan")
        return cls(float(np.mean(values)) if n else float("nan"), error, n)

    def plain(self) -> dict[str, float | None]:
        """Give numbers that JSON knows."""
        return {k: v if math.isfinite(v) else None for k, v in self._asdict().items()}

    def __str__(self) -> str:
        """Write it with as many digits as its error has."""
        if not math.isfinite(self.value):
            return ""
        if not math.isfinite(self.error):
            return f"{self.value:.4f}"
        return f"{self.value:.4f} +- {self.error:.4f}"


def draw(ensembles: list[Ensemble], packings: list[dict[str, Any]], out: Path) -> None:
    """Draw one column for each alpha and N."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    systems = sorted({(of.alpha, of.n) for of in ensembles})
    figure = Figure(figsize=(4.5 * len(systems), 6), dpi=100, layout="constrained")
    axes = figure.subplots(2, len(systems), squeeze=False, sharex="col")
    for (alpha, n), (linear, logarithmic) in zip(systems, axes.T, strict=True):
        own = [of for of in ensembles if (of.alpha, of.n) == (alpha, n)]
        for axis in (linear, logarithmic):
            for k, of in enumerate(own):
                draw_pressures(axis, of, f"C{k}")
            draw_onsets(axis, own, [p for p in packings if is_of(p, alpha, n)])
        linear.set(title=rf"$\alpha$ = {alpha:g}, N = {n}", ylabel="pressure $p$")
        logarithmic.set(xlabel=r"packing fraction $\phi$", ylabel="pressure $p$", yscale="log")
        linear.legend(title=r"$\kappa$ (samples)", fontsize=7)
    figure.savefig(out)


def draw_pressures(axis: Any, of: Ensemble, color: str) -> None:
    """Draw the samples thin, their mean thick."""
    if len(of.runs) > 1:
        for run in of.runs:
            axis.plot(run.phi, run.p, "-", color=color, lw=0.4, alpha=0.5)
    axis.plot(*of.pressure(), "-", color=color, lw=1.2, label=f"{of.kappa:g} ({len(of.runs)})")


def draw_onsets(axis: Any, own: list[Ensemble], packings: list[dict[str, Any]]) -> None:
    """Mark phi_J of the slowest rate that has one, and of packings."""
    fitted = [of.onset() for of in own if of.onsets]
    if fitted:
        label = rf"$\phi_J$ = {fitted[-1].value:.5f}, fit"
        axis.axvline(fitted[-1].value, color="k", ls="--", lw=0.8, label=label)
    if packings:
        mean = float(np.mean([packing["phi_J"] for packing in packings]))
        axis.axvline(mean, color="k", ls=":", lw=0.8, label=rf"$\phi_J$ = {mean:.5f}, energy")


def is_of(packing: dict[str, Any], alpha: float, n: int) -> bool:
    """Whether a file holds a packing of a system; beside packings lie the runs that made them."""
    return "phi_J" in packing and (packing.get("alpha"), packing.get("n")) == (alpha, n)


def pressures_above(run: Run, slowest: Run, phi_J: float) -> tuple[float, float]:
    """Mean pressures above phi_J of a run and of the slowest one of the same sample."""
    phi = np.linspace(
        max(phi_J, run.phi[0], slowest.phi[0]), min(run.phi[-1], slowest.phi[-1]), GRID
    )
    p, of_slowest = np.interp(phi, run.phi, run.p), np.interp(phi, slowest.phi, slowest.p)
    return float(p.mean()), float(of_slowest.mean())


def excess(pairs: list[tuple[float, float]]) -> Mean:
    """Mean difference of such pressures, over the mean of the second; a sample alone may have none."""
    p, of_slowest = np.array(pairs).reshape(-1, 2).T
    return Mean.of(((p - of_slowest) / of_slowest.mean()).tolist() if len(p) else [])


def row(of: Ensemble, ensembles: list[Ensemble]) -> dict[str, Any]:
    """One row of the table."""
    slowest = [other for other in ensembles if (other.alpha, other.n) == (of.alpha, of.n)][-1]
    twins = {run.seed: run for run in slowest.runs}
    shifts = [phi - slowest.onsets[s] for s, phi in of.onsets.items() if s in slowest.onsets]
    onset = slowest.onset().value
    found: dict[str, Any] = {"alpha": of.alpha, "n": of.n, "kappa": of.kappa}
    costs = [run.cost for run in of.runs if run.cost]
    medians = np.median(costs, axis=0).tolist() if costs else [None] * len(Cost._fields)
    found |= dict(zip(Cost._fields, medians, strict=True))
    found |= {"runs": [str(run.path) for run in of.runs], "phi_J": of.onset()}
    if of is slowest:
        return found | {"shift": None, "excess": None}
    pairs = [(run, twins[run.seed]) for run in of.runs if run.seed in twins]
    above = [pressures_above(*pair, onset) for pair in pairs] if math.isfinite(onset) else []
    return found | {"shift": Mean.of(shifts), "excess": excess(above)}


def table(rows: list[dict[str, Any]]) -> str:
    """Write the rows as Markdown."""
    names = (
        *("alpha", "N", "kappa", "samples", "evaluations", "Heun's over these", "seconds", "phi_J"),
        *("phi_J less that of the slowest", "p above phi_J over that of the slowest, less 1"),
    )
    lines = ["| " + " | ".join(names) + " |", "| --- " * len(names) + "|"]
    for r in rows:
        cost = ["" if r[name] is None else f"{r[name]:.3g}" for name in Cost._fields]
        cells = (f"{r['alpha']:g}", r["n"], f"{r['kappa']:g}", len(r["runs"]), *cost, r["phi_J"],
                 r["shift"] or "", r["excess"] or "")  # fmt: skip
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Read, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN.h5")
    parser.add_argument("--packing", type=Path, nargs="*", default=[], help="of make_packing.py")
    parser.add_argument("--out", type=Path, default=Path("slow.png"), help="(slow.png)")
    options = parser.parse_args()
    ensembles = Ensemble.all_of([read(path) for path in options.runs])
    draw(ensembles, [read_attributes(path) for path in options.packing], options.out)
    rows = [row(of, ensembles) for of in ensembles]
    print(table(rows))
    plain = [
        {k: v.plain() if isinstance(v, Mean) else v for k, v in found.items()} for found in rows
    ]
    print(json.dumps({"out": str(options.out), "rows": plain}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_slow_compression.py: {error}")
