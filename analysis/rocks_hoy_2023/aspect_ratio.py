"""Draw phi_J and z of ellipses against aspect ratio.

    python analysis/rocks_hoy_2023/aspect_ratio.py SWEEP [MORE ...] --out aspect_ratio.png

Rocks & Hoy, Soft Matter (2023), with ellipses of aspect ratios from 1 to 10, state that z approaches the isostatic 6, and
falls again towards 4 as local nematic order grows: here z at the largest aspect ratio must be below the largest z by two joint errors. The last line of standard output is
one JSON object with averages and their standard errors.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.measures.averages import Mean

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages, rows
from common.axes import figure_of
from common.ensembles import Groups, conditions, read_groups
from common.sheared import exceeds
from common.styles import PAPER_LINE, color
from common.text import conditions_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = ("aspect_ratio", "phi_J", "z", "S2", "n_rattlers")
Z_ISO = 6


def figure_from(means: Mapping[str, Mapping[Any, Mean]], groups: Groups) -> Figure:
    """Draw both quantities."""
    figure = figure_of(10, 4.2, dpi=100)
    panels = figure.subplots(1, 2)
    labels = {"phi_J": r"packing fraction $\phi_J$", "z": "contacts per particle $z_J$"}
    for axes, (name, label) in zip(panels, labels.items(), strict=True):
        points = sorted((means["aspect_ratio"][s].value, *means[name][s][:2]) for s in groups)
        ratio, value, error = np.array(points).T
        axes.errorbar(ratio, value, error, fmt="o-", ms=4, lw=0.9, capsize=2, color=color(0),
                      label=r"ellipses, $w_1 = 1/$aspect ratio")  # fmt: skip
        axes.set(xlabel="aspect ratio", ylabel=label)
    panels[1].axhline(Z_ISO, **PAPER_LINE)
    panels[0].legend(fontsize=8)
    figure.suptitle(conditions_text(groups), fontsize=8)
    return figure


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    groups = read_groups(options.files, needs=NAMES)
    means = {name: averages(groups, name) for name in NAMES}
    save_figure(figure_from(means, groups), options.out)
    ratio, z = means["aspect_ratio"], means["z"]
    longest = max(groups, key=lambda s: ratio[s].value)
    largest = max((z[s] for s in groups), key=lambda m: m.value)
    counts = {
        "shapes_below_6": sum(m.value < Z_ISO for m in z.values()),
        "n_shapes": len(groups),
        "z_falls": int(exceeds(largest, z[longest])),
    }
    told = {"conditions": conditions(groups), **counts, "shapes": rows(groups, means)}
    report({"out": options.out, **told})


if __name__ == "__main__":
    run(parser_of(__doc__, "aspect_ratio.png", "SWEEP"), main)
