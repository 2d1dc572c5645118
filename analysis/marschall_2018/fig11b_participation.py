"""Draw participation ratios of modes: Figs. 11(b), 15(b), 19(b) of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig11b_participation.py MODES [MORE.h5 ...] --out participation.png

MODES are files of analysis/modes.py, or folders of them. One curve for each system and u0, averaged over
the modes in a bin of frequency of all samples, with standard errors; --alpha and --u0 select. Eq. 32 gives 3 for
a mode spread evenly over x, y and A theta of all particles (2 for discs, 6 in space), 1/N for one that moves a
single coordinate. Modes of negative eigenvalue are drawn apart, on the left. The last line of standard output
is one JSON object with averages over bands.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.command import report, run
from jamshape.drawing.saving import save_figure

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.mode_axes import (
    add_sides,
    bin_edges,
    draw_binned,
    draw_legend,
    key_labels,
    legend_title,
    modes_parser,
    tables_asked,
)
from common.mode_tables import Tables, band_means, every
from common.styles import marked


def draw(tables: Tables, options: Namespace) -> None:
    """Draw all curves."""
    figure = figure_of(7, 4.2)
    (row,) = add_sides(figure, tables)
    edges, labels = bin_edges(every(tables)), key_labels(tables)
    for k, (key, samples) in enumerate(tables.items()):
        draw_binned(row, samples, "participation", edges, label=labels[key], **marked(k, "-"))
    single = 1 / float(np.mean([table.attributes["n_backbone"] for table in every(tables)]))
    even = {2: 3.0, 3: 6.0}[max(key.system.dimension for key in tables)]
    for axes in row.each():
        axes.set_yscale("log")
        axes.set_ylim(0.6 * single, 1.6 * even)
        for level in (even, single):
            axes.axhline(level, color="0.5", ls=":", lw=1, zorder=0)
    note: dict[str, Any] = {"fontsize": 8, "color": "0.3", "ha": "right"}
    note["transform"] = row.stable.get_yaxis_transform()
    row.stable.text(0.98, even * 1.08, "spread evenly", va="bottom", **note)
    row.stable.text(0.98, single / 1.08, "one coordinate", va="top", **note)
    row.first.set_ylabel(r"participation ratio  $P(\omega)$")
    draw_legend(row.stable, every(tables), title=legend_title(tables))
    save_figure(figure, options.out)


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    tables = tables_asked(options)
    draw(tables, options)
    rows = [
        key.report() | {"samples": len(samples)} | band_means(samples, "participation")
        for key, samples in tables.items()
    ]
    report({"out": options.out, "participation": rows})


if __name__ == "__main__":
    run(modes_parser(__doc__, "participation.png"), main)
