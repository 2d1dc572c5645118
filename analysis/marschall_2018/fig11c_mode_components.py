"""Draw the components of modes, sliding and rotation: Figs. 11(c), 15(c), 19(c) of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig11c_mode_components.py MODES [MORE.h5 ...] --alpha 4 --out mode_components.png

MODES are files of analysis/modes.py, or folders of them. Displacement along and across the axis that tells a
particle's direction, and rotation (Eqs. 33-35), averaged over the modes in a bin of frequency of all samples, with
standard errors; one panel for each system and u0, which --alpha and --u0 select. Modes of negative eigenvalue are
drawn apart, on the left. The last line of standard output is one JSON object with averages over bands.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from jamshape.command import report, run
from jamshape.drawing.modes import COMPONENTS
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import systems_text
from jamshape.vibration.ensembles import TOLD, Key
from jamshape.vibration.table import ModeTable

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.mode_axes import (
    add_sides,
    bin_edges,
    draw_binned,
    draw_legend,
    energy_text,
    modes_parser,
    tables_asked,
)
from common.mode_tables import Tables, band_means, every, n_of
from common.text import samples_text

MOST = 4  # panels


def turning(tables: Tables) -> Tables:
    """Leave out discs and spheres, which do not turn.

    Raises
    ------
    ValueError
        If there is nothing else, or more than fits into a figure.
    """
    found = {
        key: samples
        for key, samples in tables.items()
        if any(table.coordinates.is_rotation.any() for table in samples)
    }
    if not 1 <= len(found) <= MOST:
        msg = f"modes are of {len(found)} systems that turn and u0, expected 1 to {MOST};"
        msg += " select with --alpha and --u0"
        raise ValueError(msg)
    return found


def draw(tables: Tables, options: Namespace) -> None:
    """Draw one panel for each system and u0."""
    figure = figure_of(7, 1.4 + 2.4 * len(tables))
    rows = add_sides(figure, tables, len(tables))
    edges = bin_edges(every(tables))
    thin: dict[str, Any] = {"mfc": "none", "ms": 4, "lw": 0.8, "elinewidth": 0.8, "capsize": 1.5}
    for row, (key, samples) in zip(rows, tables.items(), strict=True):
        for name, (marker, color, text) in COMPONENTS.items():
            if any(table[name].any() for table in samples):
                style = {"fmt": marker, "color": color, "label": text}
                draw_binned(row, samples, name, edges, **thin, **style)
        for axes in row.each():
            axes.set_ylim(-0.04, 1.04)
        row.first.set_ylabel("share of the motion")
        told = [energy_text(key.u0), samples_text(n_of(tables), {key: samples})]
        title = ", ".join([systems_text([key.system]), *told])
        row.stable.set_title(title, fontsize=8, loc="right")
    draw_legend(rows[0].stable, next(iter(tables.values())))
    save_figure(figure, options.out)


def row_of(key: Key, samples: list[ModeTable]) -> dict[str, Any]:
    """Average over bands."""
    parts = {name: band_means(samples, name) for name in COMPONENTS}
    bands = {band: {name: part[band] for name, part in parts.items()} for band in TOLD}
    return key.report() | {"samples": len(samples)} | bands


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    tables = turning(tables_asked(options))
    draw(tables, options)
    rows = [row_of(key, samples) for key, samples in tables.items()]
    report({"out": options.out, "components": rows})


if __name__ == "__main__":
    run(modes_parser(__doc__, "mode_components.png"), main)
