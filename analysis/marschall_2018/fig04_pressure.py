"""Draw pressure against packing fraction: Figs. 3 and 4 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig04_pressure.py RUN.h5 [MORE.h5 ...] --out pressure.png

On the left all of each run of pyscripts/compress.py, on the right its onset: the line through its pressure just
above leads to zero at phi_J(kappa), the jamming packing fraction at the rate of the run, which rises as kappa
falls. Its error holds how far other stretches of the same curve put it. Where frames were minimised, as
`jamshape compress` and `jamshape slow` do, a band goes from the densest that unjams to the next that stays jammed:
phi_J(kappa) outside is the onset of flow. The last line of standard output is one JSON object with each phi_J(kappa),
its rate, the band and, if the runs differ in nothing but their seed, the mean.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jamshape.command import parser_of, report, run
from jamshape.drawing.pressure import draw_jamming, draw_onset, onset_text
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import ensemble_text, onset_symbol, pressure_unit
from jamshape.measures.averages import Mean
from jamshape.measures.onset import OnsetFit
from jamshape.measures.runs import Run, read_run

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean
from common.axes import SMALL_TEXT, figure_of
from common.ensembles import of_paper
from common.published import PHI_J

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMED = 10  # runs, at most, that the legend names


def mean_phi_J(runs: list[Run]) -> Mean | None:
    """Average over several runs of one ensemble, with the standard error; else None."""
    found = [one.fit.phi_J for one in runs if one.fit]
    if len(found) < 2 or len({one.ensemble for one in runs}) > 1:
        return None
    return mean(found)


def draw_onsets(axes: Axes, runs: list[Run]) -> None:
    """Draw the lines that lead to the onsets, and what is around them."""
    for k, one in enumerate(runs):
        draw_onset(axes, one, f"C{k}")
    known = [phi for one in runs if one.jamming for phi in one.jamming[:2]]
    axes.plot(known, [0] * len(known), lw=0)  # in view
    if any(one.fit for one in runs):
        axes.plot(
            [], [], "ko-", lw=1, ms=5, mfc="none", label=r"line that leads to $\phi_J(\kappa)$"
        )
        axes.margins(x=0.3, y=0.3)
        axes.set(xlim=axes.get_xlim(), ylim=(-0.03 * axes.get_ylim()[1], None))


def draw(runs: list[Run], average: Mean | None, options: Namespace) -> None:
    """Draw all of each curve on the left; on the right the onsets with their lines."""
    # Each band has a long line of its own in the legend.
    columns = 1 if any(one.jamming for one in runs) else 2
    lines = 4 + min(len(runs), NAMED) * (3 - columns) / columns
    figure = figure_of(8, 3.7 + 0.17 * lines)
    whole, onset = figure.subplots(1, 2)
    draw_onsets(onset, runs)
    for k, one in enumerate(runs):
        named = f"{one.path.stem}: {onset_text(one)}"
        text = named if len(runs) <= NAMED else f"{len(runs)} runs" * (k == 0)
        whole.semilogy(one.phi, one.pressure, color=f"C{k}", lw=1)
        onset.plot(one.phi, one.pressure, ".-", color=f"C{k}", ms=3, lw=0.5, label=text)
        if len(runs) <= NAMED:
            draw_jamming(onset, one, f"C{k}", f"{one.path.stem}, ")
    systems = [one.ensemble.system for one in runs]
    alphas = {s.number("alpha") for s in systems if of_paper(s)}
    paper = [PHI_J[alpha].value for alpha in sorted(alphas & PHI_J.keys())]
    for axes in (whole, onset):
        for phi in paper:
            text = rf"paper, $N=1024$: $\phi_J(\kappa\to 0)={phi}$"
            axes.axvline(phi, color="0.4", ls=":", lw=1, label=text)
        unit = pressure_unit(systems)
        axes.set(xlabel=r"packing fraction $\phi$", ylabel=rf"pressure $p$  ${unit}$")
    whole.set_ylim(bottom=1e-6 * max(one.pressure.max() for one in runs) or None)
    names = ("n", "size_ratio", "kappa")
    titles = dict.fromkeys(ensemble_text(one.ensemble, names) for one in runs)
    figure.suptitle("\n".join(["pressure of a compression through jamming", *titles]), size=9)
    if average:
        title = f"${onset_symbol(runs[0].ensemble.kappa)}={average.tex}$"
        onset.set_title(f"{title}, mean of {average.samples}", size=9)
    place: dict[str, Any] = {"loc": "outside lower center", "ncols": columns, "frameon": False}
    handles = onset.get_legend_handles_labels()
    figure.legend(*handles, title="onsets, each at the rate of its run", **SMALL_TEXT, **place)
    save_figure(figure, options.out)


def row_of(one: Run) -> dict[str, Any]:
    """Report the onset of a run, and where its frames stay jammed, if that is known."""
    row: dict[str, Any] = {"run": one.path, "kappa": one.ensemble.kappa}
    fit = one.fit._asdict() if one.fit else dict.fromkeys(OnsetFit._fields)
    row |= {name.replace("phi_J", "phi_J(kappa)"): value for name, value in fit.items()}
    if one.jamming is None:
        return row
    verdict = one.jamming.verdict(one.fit, one.ensemble.kappa)
    return row | one.jamming.attributes() | {"onset": verdict}


def main(options: Namespace) -> None:
    """Read, draw, report."""
    runs = [read_run(path) for path in options.files]
    average = mean_phi_J(runs)
    draw(runs, average, options)
    phi_J, error = average[:2] if average else (None, None)
    rows = [row_of(one) for one in runs]
    report({"out": options.out, "runs": rows, "mean": phi_J, "error": error})
    if problems := [one.problem for one in runs if one.problem]:
        raise ValueError(problems[0])


if __name__ == "__main__":
    run(parser_of(__doc__, "pressure.png", "RUN.h5"), main)
