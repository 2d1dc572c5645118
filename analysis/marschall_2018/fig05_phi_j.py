"""Draw the jamming density against aspect ratio: Fig. 5 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig05_phi_j.py SWEEP [MORE.h5 ...] --out phi_j.png

phi_J is known in three ways: of each packing, led from its energy density u0 to zero; and of the run
at finite rate kappa before it, where there is one, led from its pressure to zero as in the paper, once as the box
closes and once as it opens again: phi_J(kappa). Those two tell what the rate does: they rise as kappa falls. Any shapes with
an aspect ratio alpha may be given, each is a curve. The last line of standard output is one JSON object with
the averages over samples.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.ensembles import PackingFile, System
from jamshape.measures.averages import Mean

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean_over
from common.axes import SMALL_TEXT, discs_at, error_bars, figure_of, label_alpha_axis
from common.ensembles import (
    Curve,
    Groups,
    conditions,
    curves_over,
    distances,
    of_paper,
    read_groups,
)
from common.published import PHI_J
from common.styles import PAPER_STYLE, color
from common.text import conditions_text, system_labels

WAYS = {
    "phi_J": ("o-", r"$\phi_J$ from $u_0$ to 0"),
    "phi_J_compression": ("s", r"$\phi_J(\kappa)$ from $p$ to 0, compression"),
    "phi_J_opening": ("^", r"$\phi_J(\kappa)$ from $p$ to 0, opening again"),
}

ENOUGH = 5  # points for a line through them

Averages = dict[str, dict[float, Mean]]


def averages(curve: Curve) -> Averages:
    """Average over the samples of each alpha, those left out that do not know."""
    return {name: {alpha: average(of, name) for alpha, of in curve.items()} for name in WAYS}


def distance(samples: Sequence[PackingFile]) -> Mean:
    """Average phi - phi_J over samples that know their energy and pressure."""
    known = [s for s in samples if {"phi", "u", "pressure"} <= s.attributes.keys()]
    return mean_over(known, distances(known))


def average(samples: Sequence[PackingFile], name: str) -> Mean:
    """Average over samples that know a number."""
    known = [s for s in samples if name in s.attributes]
    return mean_over(known, [s.number(name) for s in known])


def draw(known: dict[System, Averages], groups: Groups, options: Namespace) -> None:
    """Draw phi_J against alpha, discs at the left end."""
    figure = figure_of(5.6, 4)
    axes = figure.subplots()
    discs = discs_at([*PHI_J, *(alpha for of in known.values() for alpha in of["phi_J"])])
    labels = system_labels(known)
    for k, (system, of) in enumerate(known.items()):
        for way, (name, (marker, text)) in enumerate(WAYS.items()):
            found = {alpha: m for alpha, m in of[name].items() if m.samples}
            if found:
                # One curve alone has two colours, of packings and of runs.
                tint = color(2 * k + (way > 0) * (len(known) == 1))
                label = ", ".join(filter(None, [labels[system], text]))
                shown = marker if len(found) >= ENOUGH else marker.rstrip("-")
                style: dict[str, Any] = {"fmt": shown, "color": tint, "label": label}
                error_bars(axes, found, discs, mfc=tint if way == 0 else "none", **style)
    if any(of_paper(system) for system in known):
        error_bars(axes, PHI_J, discs, **PAPER_STYLE)
    label_alpha_axis(axes, discs)
    axes.set_ylabel(r"jamming density $\langle\phi_J\rangle$")
    place: dict[str, Any] = {"loc": "outside upper center", "ncols": 2, "frameon": False}
    figure.legend(title=conditions_text(groups), **SMALL_TEXT, **place)
    save_figure(figure, options.out)


def rows(system: System, known: Averages, curve: Curve) -> list[dict[str, Any]]:
    """Report the averages of one curve."""
    paper = PHI_J if of_paper(system) else {}
    return [
        system.report()
        | {"alpha": alpha, "paper": paper[alpha].value if alpha in paper else None}
        | {name: of[alpha] for name, of in known.items()}
        | {"distance": distance(curve[alpha])}
        for alpha in known["phi_J"]
    ]


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    groups = read_groups(options.files, needs=["alpha"], same=("n", "size_ratio", "u0"))
    curves = curves_over(groups, "alpha")
    known = {system: averages(curve) for system, curve in curves.items()}
    if not np.isfinite([m.value for of in known.values() for m in of["phi_J"].values()]).all():
        msg = f"{options.files[0]}: phi_J is not known at some alpha, expected it of each packing"
        raise ValueError(msg)
    draw(known, groups, options)
    found = [row for system, of in known.items() for row in rows(system, of, curves[system])]
    report({"out": options.out, "conditions": conditions(groups), "phi_J": found})


if __name__ == "__main__":
    run(parser_of(__doc__, "phi_j.png", "SWEEP"), main)
