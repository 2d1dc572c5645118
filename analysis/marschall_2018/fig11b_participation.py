"""Draw participation ratios of modes: Figs. 11(b), 15(b), 19(b) of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_participation.py MODES [MORE.h5 ...] --out participation.png

MODES are files of analysis/modes.py, or folders of them. One curve for each alpha and u0, averaged over
the modes in a bin of frequency of all samples, with standard errors; --alpha and --u0 select. Eq. 32 gives 3 for
a mode spread evenly over x, y and A theta of all particles (2 for discs), 1/N for one that moves a
single coordinate. Modes of negative eigenvalue are drawn apart, on the left. The last line of standard output
is one JSON object with averages over bands.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from mode_files import (
    Key,
    Tables,
    add_sides,
    asked,
    bin_edges,
    draw_binned,
    draw_legend,
    samples_text,
)
from sweep_files import COLORS, MARKERS, mean

from jamshape.vibration.table import ModeTable

EVEN = 3.0


def draw(tables: Tables, out: Path) -> None:
    """Draw all curves."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(7, 4.2), dpi=200, layout="constrained")
    (row,) = add_sides(figure, tables)
    edges = bin_edges(t for samples in tables.values() for t in samples)
    for k, (key, samples) in enumerate(tables.items()):
        style = {"fmt": f"{MARKERS[k % len(MARKERS)]}-", "color": COLORS[k % len(COLORS)]}
        draw_binned(row, samples, "participation", edges, label=key.label(tables), **style)
    single = 1 / float(np.mean([t.attributes["n_backbone"] for s in tables.values() for t in s]))
    for axes in row.each():
        axes.set_yscale("log")
        axes.set_ylim(0.6 * single, 5.0)
        for level in (EVEN, single):
            axes.axhline(level, color="0.5", ls=":", lw=1, zorder=0)
    note: dict[str, Any] = {"fontsize": 8, "color": "0.3", "ha": "right"}
    note["transform"] = row.stable.get_yaxis_transform()
    row.stable.text(0.98, EVEN * 1.08, "spread evenly", va="bottom", **note)
    row.stable.text(0.98, single / 1.08, "one coordinate", va="top", **note)
    first = row.unstable or row.stable
    first.set_ylabel(r"participation ratio  $P(\omega)$")
    every = [table for samples in tables.values() for table in samples]
    draw_legend(row.stable, every, title=samples_text(tables))
    figure.savefig(out)


def report(key: Key, samples: list[ModeTable]) -> dict[str, Any]:
    """Average over bands."""
    found: dict[str, Any] = {"alpha": key.alpha, "u0": key.u0, "samples": len(samples)}
    for band in ("low", "middle", "high"):
        parts = [t["participation"][t.in_band(band)] for t in samples]
        found[band] = mean([part.mean() for part in parts if len(part)]).report()
    return found


def main() -> None:
    """Read, average, draw, report."""
    options = asked(__doc__, "participation.png")
    tables = options.tables
    draw(tables, options.out)
    rows = [report(key, samples) for key, samples in tables.items()]
    print(json.dumps({"out": str(options.out), "participation": rows}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_participation.py: {error}")
