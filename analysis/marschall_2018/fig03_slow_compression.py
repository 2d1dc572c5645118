"""Draw p(phi) at several rates: Fig. 3 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig03_slow_compression.py RUN.h5 [MORE.h5 ...] --packing PACKING.h5 --out slow.png

Runs are of pyscripts/slow_compress.py or compress.py; there is a column for each system and N, with p on a
linear axis above and on a logarithmic one below, and a line for each rate: the mean over samples (seeds),
which are drawn thin. Vertical lines mark phi_J(kappa) of the slowest rate, from the lines through the pressures
just above the onsets (Fig. 4), and phi_J of packings at an energy. Prints a table (Markdown) of what runs cost (medians;
beside Heun's method with dt = 0.01), of phi_J(kappa), of phi_J by the frames (in the middle between the last frame
that unjams when it is minimised and the first that stays jammed; the error holds how far these lie apart), of how far it lies from that of the slowest rate, and of
the pressure above it over that of the slowest rate, sample by sample, with standard errors. The last line of
standard output is one JSON object.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import (
    ensemble_text,
    onset_symbol,
    pressure_unit,
    scientific,
    system_text,
)
from jamshape.files.ensembles import PackingFile, System
from jamshape.files.h5md import read_attributes
from jamshape.measures.averages import Mean
from jamshape.measures.runs import Run, read_run

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean
from common.axes import SMALL_TEXT, figure_of
from common.text import counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Packing fractions where runs are averaged and compared.
GRID = 1000

# Of the logarithmic axis of pressure, over the largest.
LEAST = 1e-6

# Of Heun's method, whose evaluations are compared.
HEUN_DT = 0.01

TABLE = (
    *(
        "system",
        "N",
        "kappa",
        "samples",
        "evaluations",
        "Heun's over these",
        "seconds",
        "phi_J(kappa)",
        "phi_J by frames",
    ),
    *("phi_J(kappa) less that of the slowest", "p above phi_J over that of the slowest, less 1"),
)


class Cost(NamedTuple):
    """What a slow compression cost."""

    evaluations: float
    heun: float
    """Evaluations of Heun's method with its fixed time step, over these."""
    seconds: float


class Place(NamedTuple):
    """A column of the figure."""

    system: System
    n: int


class Rate(NamedTuple):
    """Samples of one system compressed at one rate."""

    place: Place
    kappa: float
    runs: list[Run]

    @property
    def onsets(self) -> dict[int, float]:
        """phi_J(kappa) of each seed that has one."""
        return {one.seed: one.fit.phi_J for one in self.runs if one.fit}

    def onset(self) -> Mean:
        """Mean phi_J(kappa); the error of the fit where there is one sample."""
        fits = [one.fit for one in self.runs if one.fit]
        if len(fits) == 1:
            return Mean(fits[0].phi_J, fits[0].phi_J_error, 1)
        return mean([fit.phi_J for fit in fits])

    def jamming(self) -> Mean:
        """Mean phi_J by the frames of runs that were minimised, which no drag holds up.

        Frames of all samples lie at like packing fractions, so that averages do not make their brackets narrower.
        """
        known = [one.jamming for one in self.runs if one.jamming and one.jamming.phi_J > 0]
        found = mean([one.phi_J for one in known])
        widths = np.array([one.phi_J_error for one in known])
        scatter = found.error if len(known) > 1 else 0.0
        error = np.hypot(scatter, np.sqrt(np.mean(widths**2))) if known else math.nan
        return found._replace(error=float(error))

    def pressure(self) -> tuple[FloatArray, FloatArray]:
        """Mean p(phi) where all samples have one."""
        phi = np.linspace(max(r.phi[0] for r in self.runs), min(r.phi[-1] for r in self.runs), GRID)
        return phi, np.mean([np.interp(phi, r.phi, r.pressure) for r in self.runs], axis=0)


def rates_of(runs: list[Run]) -> list[Rate]:
    """Group runs, the fastest of each system first."""
    found: dict[tuple[Place, float], list[Run]] = {}
    for one in runs:
        place = Place(one.ensemble.system, one.ensemble.n)
        found.setdefault((place, -one.ensemble.kappa), []).append(one)
    return [Rate(place, -kappa, of) for (place, kappa), of in sorted(found.items())]


def cost_of(one: Run) -> Cost | None:
    """Read what a run of slow_compress.py cost."""
    attributes = read_attributes(one.path)
    if "flow_evaluations" not in attributes:
        return None
    evaluations = float(attributes["flow_evaluations"])
    heun = 2 * duration(one, attributes["kappa"]) / HEUN_DT
    return Cost(evaluations, heun / evaluations, float(attributes["flow_wall_seconds"]))


def duration(one: Run, kappa: ArrayLike) -> float:
    """Time of a run whose rates hold from packing fractions on, [[phi, kappa], ...], or are one number.

    The box shrinks with dL/dt = -kappa L, so that a packing fraction grows with D kappa phi.
    """
    rates = np.asarray(kappa, np.float64)
    begin, rate = rates.reshape(-1, 2).T if rates.size > 1 else np.array([[0.0], [float(rates)]])
    held = rate[np.searchsorted(begin, one.phi[:-1], side="right") - 1]
    strain = np.diff(np.log(one.phi)) / one.ensemble.system.dimension
    return float((strain / held).sum())


def draw(rates: list[Rate], packings: dict[Place, list[float]], out: Path) -> None:
    """Draw one column for each system and N; `packings` are their phi_J."""
    places = list(dict.fromkeys(of.place for of in rates))
    figure = figure_of(4.5 * len(places), 7, dpi=100)
    axes = figure.subplots(2, len(places), squeeze=False, sharex="col")
    for place, (linear, logarithmic) in zip(places, axes.T, strict=True):
        own = [of for of in rates if of.place == place]
        for axis in (linear, logarithmic):
            for k, of in enumerate(own):
                draw_pressures(axis, of, f"C{k}")
            draw_onsets(axis, own, packings.get(place, []))
        label = rf"pressure $p$  ${pressure_unit([place.system])}$"
        linear.set(ylabel=label)
        linear.set_title(ensemble_text(own[0].runs[0].ensemble, ["n", "size_ratio"]), fontsize=9)
        logarithmic.set(xlabel=r"packing fraction $\phi$", ylabel=label, yscale="log")
        logarithmic.set_ylim(
            bottom=LEAST * max(one.pressure.max() for of in own for one in of.runs)
        )
        # Below, where it hides no curve.
        below = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.17), "ncols": 2}
        logarithmic.legend(title="thick: mean, thin: each sample", **below, **SMALL_TEXT)
    save_figure(figure, out)


def draw_pressures(axis: Axes, of: Rate, color: str) -> None:
    """Draw the samples thin, their mean thick."""
    text = rf"$\kappa={scientific(of.kappa)}$, {counted(len(of.runs), 'sample')}"
    if len(of.runs) > 1:
        for one in of.runs:
            axis.plot(one.phi, one.pressure, "-", color=color, lw=0.4, alpha=0.5)
    axis.plot(*of.pressure(), "-", color=color, lw=1.2, label=text)


def draw_onsets(axis: Axes, own: list[Rate], packings: list[float]) -> None:
    """Mark phi_J(kappa) of the slowest rate that has one, and phi_J of packings."""
    fitted = [of for of in own if of.onsets]
    if fitted:
        onset = fitted[-1].onset()
        label = rf"${onset_symbol(fitted[-1].kappa)}={onset.tex}$"
        axis.axvline(onset.value, color="k", ls="--", lw=0.8, label=label)
    jamming = own[-1].jamming()
    if jamming.samples:
        label = rf"$\phi_J={jamming.tex}$, by frames"
        axis.axvline(jamming.value, color="k", ls="-.", lw=0.8, label=label)
    if packings:
        found = mean(packings)
        label = rf"$\phi_J={found.tex}$, from $u_0$ to 0"
        axis.axvline(found.value, color="k", ls=":", lw=0.8, label=label)


def read_packings(paths: list[Path]) -> dict[Place, list[float]]:
    """Read phi_J of packings; beside these lie the runs that made them, which have none."""
    found: dict[Place, list[float]] = {}
    for file in map(PackingFile.read, paths):
        if "phi_J" in file.attributes:
            system = file.system()._replace(protocol="", n_sweeps=0)
            place = Place(system, int(file.number("n")))
            found.setdefault(place, []).append(file.number("phi_J"))
    return found


def pressures_above(one: Run, slowest: Run, phi_J: float) -> tuple[float, float]:
    """Mean pressures above phi_J of a run and of the slowest one of the same sample."""
    phi = np.linspace(
        max(phi_J, one.phi[0], slowest.phi[0]), min(one.phi[-1], slowest.phi[-1]), GRID
    )
    first, second = (np.interp(phi, of.phi, of.pressure).mean() for of in (one, slowest))
    return float(first), float(second)


def excess(pairs: list[tuple[float, float]]) -> Mean:
    """Mean difference of such pressures, over the mean of the second; a sample alone may have none."""
    p, of_slowest = np.array(pairs).reshape(-1, 2).T
    return mean((p - of_slowest) / of_slowest.mean() if len(p) else [])


def row(of: Rate, rates: list[Rate]) -> dict[str, Any]:
    """One row of the table."""
    slowest = [other for other in rates if other.place == of.place][-1]
    twins = {one.seed: one for one in slowest.runs}
    shifts = [phi - slowest.onsets[s] for s, phi in of.onsets.items() if s in slowest.onsets]
    onset = slowest.onset().value
    found = of.place.system.report() | {"n": of.place.n, "kappa": of.kappa}
    costs = [cost for cost in map(cost_of, of.runs) if cost]
    medians = np.median(costs, axis=0).tolist() if costs else [None] * len(Cost._fields)
    found |= dict(zip(Cost._fields, medians, strict=True))
    found |= {"runs": [one.path for one in of.runs], "phi_J(kappa)": of.onset()}
    found |= {"phi_J(frames)": of.jamming()}
    if of is slowest:
        return found | {"shift": None, "excess": None}
    pairs = [(one, twins[one.seed]) for one in of.runs if one.seed in twins]
    above = [pressures_above(*pair, onset) for pair in pairs] if math.isfinite(onset) else []
    return found | {"shift": mean(shifts), "excess": excess(above)}


def table(rates: list[Rate], rows: list[dict[str, Any]]) -> str:
    """Write the rows as Markdown."""
    lines = ["| " + " | ".join(TABLE) + " |", "| --- " * len(TABLE) + "|"]
    for of, r in zip(rates, rows, strict=True):
        cost = ["" if r[name] is None else f"{r[name]:.3g}" for name in Cost._fields]
        names = ("phi_J(kappa)", "phi_J(frames)", "shift", "excess")
        means = [r[name].text() if r[name] else "" for name in names]
        system = system_text(of.place.system).replace("$", "").replace("\\", "")
        cells = (system, r["n"], f"{r['kappa']:g}", len(r["runs"]), *cost, *means)
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines) + "\n"


def main(options: Namespace) -> None:
    """Read, draw, report."""
    rates = rates_of([read_run(path) for path in options.files])
    draw(rates, read_packings(options.packing), options.out)
    rows = [row(of, rates) for of in rates]
    print(table(rates, rows))
    report({"out": options.out, "rows": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "slow.png", "RUN.h5")
    parser.add_argument("--packing", type=Path, nargs="*", default=[], help="of make_packing.py")
    run(parser, main)
