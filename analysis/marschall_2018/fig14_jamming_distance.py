"""Draw phi - phi_J against energy: the packing fractions of Figs. 14 and 18 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig14_jamming_distance.py LADDER [MORE.h5 ...] --out jamming_distance.png

LADDER is a folder of energy_ladder.py, or of packings at several u0. phi_J of a sample is where sqrt(u), linear
in phi, vanishes below its lowest energy; where a packing has rearranged on its way to another energy, so that this
phi_J is no longer its own, it is left out. Means over samples with standard errors, on the right without the trend
u^(1/2); power laws of u are fitted to each sample. The last line of standard output is one JSON object with
these numbers beside the paper's.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import systems_text
from jamshape.files.sets import PackingFile, System
from jamshape.measures.averages import Mean

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean
from common.axes import SMALL_TEXT, energy_label, figure_of
from common.ensembles import finished, of_paper
from common.published import DISTANCE
from common.styles import PAPER_STYLE, color, marked
from common.text import bars_text, counted, system_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

EXPONENT = 0.5
MISPRINT = 4.3e-4  # does not fit the others
FEWEST = 3  # energies of a fit
SAME = 0.1  # of phi - phi_J, by which phi_J of a packing that is still the same may differ
STAR: dict[str, Any] = {"ms": PAPER_STYLE["ms"], "lw": 0, "zorder": 1.5, "mec": "k", "mew": 0.7}

Samples = dict[int, dict[float, float]]
"""phi - phi_J by seed and u."""
Ladder = dict[System, Samples]


def read_ladder(files: list[PackingFile]) -> Ladder:
    """Read phi - phi_J of packings.

    Raises
    ------
    ValueError
        If there is no sample at two energies.
    """
    ladder = _ladder_of(files)
    if not ladder:
        places = ", ".join(dict.fromkeys(str(file.path) for file in files))
        msg = f"{places}: no sample at two energies, expected energy_ladder.py's"
        raise ValueError(msg)
    return ladder


def _ladder_of(files: list[PackingFile]) -> Ladder:
    rows: dict[tuple[System, int], dict[float, tuple[float, float]]] = {}
    for file in files:
        of = file.system(), int(file.number("seed"))
        phi = file.number("phi"), file.number("phi_J")
        rows.setdefault(of, {})[file.number("u0")] = phi
    ladder: Ladder = {}
    for (system, seed), points in sorted(rows.items()):
        if len(points) > 1:
            _, phi_J = points[min(points)]
            above = {
                u: phi - phi_J
                for u, (phi, own) in sorted(points.items())
                if abs(own - phi_J) <= SAME * abs(phi - phi_J)
            }
            ladder.setdefault(system, {})[seed] = above
    return ladder


def averages(samples: Samples) -> dict[float, Mean]:
    """Average over samples at each energy."""
    energies = sorted({u for points in samples.values() for u in points})
    return {u: mean([p[u] for p in samples.values() if u in p]) for u in energies}


def exponent(samples: Samples) -> Mean:
    """Fit a power law to every sample and average."""
    slopes = [
        np.polyfit(np.log(list(points)), np.log(list(points.values())), 1)[0]
        for points in samples.values()
        if len(points) >= FEWEST and min(points.values()) > 0
    ]
    return mean(slopes)


def paper_of(system: System) -> dict[float, float]:
    """Phi - phi_J by u, as the paper has it."""
    return DISTANCE.get(system.number("alpha"), {}) if of_paper(system) else {}


def draw_system(panels: list[Axes], samples: Samples, **style: Any) -> None:
    """Draw means of one system, as they are and without their trend."""
    points, law = averages(samples), exponent(samples)
    u = np.array(list(points))
    value, error = np.array([mean[:2] for mean in points.values()]).T
    style["label"] += f", {counted(len(samples), 'sample')}"
    if law.samples:
        style["label"] += rf": $u^{{{law.tex}}}$"
    for axes, scale in zip(panels, (np.ones_like(u), u**EXPONENT), strict=True):
        axes.errorbar(u, value / scale, np.nan_to_num(error) / scale, **style)


def draw_paper(panels: list[Axes], stars: dict[float, float], tint: str) -> None:
    """Draw numbers of the paper, as they are and without their trend."""
    x, y = np.array(list(stars)), np.array(list(stars.values()))
    panels[0].plot(x, y, "*", color=tint, **STAR)
    panels[1].plot(x, y / x**EXPONENT, "*", color=tint, **STAR)


def draw(ladder: Ladder, n: str, options: Namespace) -> None:
    """Draw phi - phi_J on the left, without its trend on the right."""
    figure = figure_of(9, 3.9)
    left, right = panels = list(figure.subplots(1, 2))
    energies = [u for samples in ladder.values() for u in averages(samples)]
    labels, with_stars = system_labels(ladder), False
    for k, (system, samples) in enumerate(ladder.items()):
        draw_system(panels, samples, **marked(k) | {"label": labels[system], "ms": 6})
        inside = (min(energies) / 3, max(energies) * 3)
        paper = paper_of(system).items()
        stars = {u: y for u, y in paper if inside[0] <= u <= inside[1] and y != MISPRINT}
        if stars:
            with_stars = True
            draw_paper(panels, stars, color(k))
    if with_stars:
        left.plot([], [], "*", color="w", label=PAPER_STYLE["label"], **STAR)
    for axes in panels:
        axes.set(xscale="log", xlabel=energy_label(ladder))
    left.set(yscale="log", ylabel=r"$\phi-\phi_J$")
    right.set_ylabel(r"$(\phi-\phi_J)\;/\;u^{1/2}$")
    low, high = right.get_ylim()
    right.set_ylim(low - 0.2 * (high - low), high + 0.2 * (high - low))
    title = f"{systems_text(ladder)}\n{n}" + bars_text(ladder)
    left.legend(title=title, frameon=False, loc="upper left", **SMALL_TEXT)
    save_figure(figure, options.out)


def row_of(system: System, samples: Samples) -> dict[str, Any]:
    """Report one system."""
    distance = {f"{u:g}": m for u, m in averages(samples).items()}
    paper = {f"{u:g}": value for u, value in paper_of(system).items()}
    row = system.report() | {"samples": len(samples), "distance": distance}
    row |= {"paper": paper, "exponent": exponent(samples)}
    return row | {"exponent_expected": EXPONENT}


def main(options: Namespace) -> None:
    """Read, average, fit, draw, report."""
    files = finished(options.files)
    ladder, sizes = read_ladder(files), sorted({file.packing().n for file in files})
    reached = [file for file in files if file.reached]
    draw(ladder, f"$N={' and '.join(map(str, sizes))}$", options)
    rows = [row_of(system, samples) for system, samples in ladder.items()]
    found = {"out": options.out, "not_reached": len(files) - len(reached), "jamming_distance": rows}
    if len(reached) < len(files):
        found["jamming_distance_reached"] = [
            row_of(system, samples) for system, samples in _ladder_of(reached).items()
        ]
    report(found)


if __name__ == "__main__":
    run(parser_of(__doc__, "jamming_distance.png", "LADDER"), main)
