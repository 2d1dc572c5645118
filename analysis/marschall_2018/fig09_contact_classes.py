"""Draw classes of contact against aspect ratio: Fig. 9 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig09_contact_classes.py SWEEP [MORE.h5 ...] --out contact_classes.png

On the left the fractions of the bonds that are side-to-side (two bonds a contact), tip-to-side and
tip-to-tip; on the right the fraction of the particles that have a contact on a flat side, beside
what these sides are of the perimeter. Rattlers are left out. The last line of standard output is one
JSON object with the averages over samples.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.styles import BLUE, GREEN, ORANGE, RED
from jamshape.files.sets import System
from jamshape.measures.averages import Mean

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean_over
from common.axes import SMALL_TEXT, discs_at, error_bars, figure_of, label_alpha_axis
from common.contact_classes import NAMES, class_numbers
from common.ensembles import Curve, conditions, of_paper, one_curve, read_groups
from common.styles import PAPER_STYLE
from common.text import conditions_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PAPER_FLAT = {0.01: Mean(0.963)}  # Sec. III C
STYLES = {
    "side_to_side": ("s-", BLUE, "side-to-side, as two"),
    "tip_to_side": ("o-", RED, "tip-to-side"),
    "tip_to_tip": ("D-", GREEN, "tip-to-tip"),
}
FLAT_STYLES = {
    "flat_of_backbone": ("s", BLUE, "of those that are no rattlers"),
    "flat_of_all": ("o", RED, "of all particles"),
}

Averages = dict[float, dict[str, Mean]]


def averages(curve: Curve) -> Averages:
    """Average over the samples of each alpha."""
    known: Averages = {}
    for alpha, files in curve.items():
        found = [class_numbers(file.contacts()) for file in files]
        known[alpha] = {name: mean_over(files, [of[name] for of in found]) for name in NAMES}
    return known


def perimeter_share(alpha: Any) -> Any:
    """Flat sides over perimeter, 4A / (4A + 2 pi R)."""
    return 2 * alpha / (2 * alpha + np.pi)


def draw_all(axes: Axes, known: Averages, discs: float, styles: dict[str, Any]) -> None:
    """Draw several fractions."""
    for name, (fmt, tint, text) in styles.items():
        means = {alpha: row[name] for alpha, row in known.items()}
        error_bars(axes, means, discs, fmt=fmt, color=tint, mfc="none", label=text)


def draw_paper(axes: Axes, known: Averages, discs: float) -> None:
    """Draw the number of the paper, and what the flat sides of its particles are of the perimeter."""
    error_bars(axes, PAPER_FLAT, discs, **PAPER_STYLE)
    curve = np.geomspace(2 * discs, max(10.0, *known), 200)
    axes.plot(curve, perimeter_share(curve), "--", color=ORANGE, label="flat part of the perimeter")


def draw(system: System, known: Averages, title: str, options: Namespace) -> None:
    """Draw classes on the left and flat contacts on the right."""
    figure = figure_of(9, 4.4)
    classes, flat = figure.subplots(1, 2, sharex=True)
    discs = discs_at([*known, *PAPER_FLAT])
    draw_all(classes, known, discs, STYLES)
    classes.set_ylabel("fraction of contact bonds")
    figure.suptitle(title, fontsize=8)
    classes.legend(**SMALL_TEXT)
    draw_all(flat, known, discs, FLAT_STYLES)
    if of_paper(system):
        draw_paper(flat, known, discs)
    flat.set_ylabel("fraction of particles with a flat contact")
    flat.legend(fontsize=8, loc="upper left", bbox_to_anchor=(0, 0.45))
    for axes in (classes, flat):
        axes.set_ylim(-0.03, 1.03)
        label_alpha_axis(axes, discs)
    save_figure(figure, options.out)


def main(options: Namespace) -> None:
    """Read, count, draw, report."""
    groups = read_groups(options.files, needs=["alpha"], same=("n", "size_ratio", "u0"))
    system, curve = one_curve(groups, "alpha")
    known, paper = averages(curve), PAPER_FLAT if of_paper(system) else {}
    draw(system, known, conditions_text(groups), options)
    rows = [
        system.report()
        | {"alpha": alpha, "flat_perimeter": perimeter_share(alpha) if paper else None}
        | {"paper_flat": paper[alpha].value if alpha in paper else None, **row}
        for alpha, row in known.items()
    ]
    told = {"out": options.out, "conditions": conditions(groups)}
    report(told | {"contact_classes": rows})


if __name__ == "__main__":
    run(parser_of(__doc__, "contact_classes.png", "SWEEP"), main)
