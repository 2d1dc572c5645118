"""Draw what kinds of motion modes are: Figs. 11(c), 15(c), 19(c) of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_mode_components.py MODES [MORE.h5 ...] --alpha 4 --out mode_components.png

MODES are files of analysis/modes.py, or folders of them. Displacement along and across the spines and
rotation (Eqs. 33-35), averaged over the modes in a bin of frequency of all samples, with standard errors; one
panel for each alpha and u0, which --alpha and --u0 select. Modes of negative eigenvalue are drawn apart, on
the left. The last line of standard output is one JSON object with averages over bands.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

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
from sweep_files import BLUE, GREEN, RED, mean

from jamshape.vibration.table import ModeTable

STYLES = {
    "rotation": ("o", BLUE, r"$u_\theta^2$, rotation"),
    "parallel": ("s", RED, r"$u_\parallel^2$, along the spine"),
    "perpendicular": ("D", GREEN, r"$u_\perp^2$, across it"),
}
MOST = 4  # panels


def turning(tables: Tables) -> Tables:
    """Leave out discs, of which no direction is along and none across.

    Raises
    ------
    ValueError
        If there is nothing else, or more than fits into a figure.
    """
    found = {key: samples for key, samples in tables.items() if key.alpha > 0}
    if not 1 <= len(found) <= MOST:
        msg = f"modes have {len(found)} pairs of alpha > 0 and u0, expected 1 to {MOST};"
        msg += " select with --alpha and --u0"
        raise ValueError(msg)
    return found


def draw(tables: Tables, out: Path) -> None:
    """Draw one panel for each alpha and u0."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(7, 1.4 + 2.4 * len(tables)), dpi=200, layout="constrained")
    rows = add_sides(figure, tables, len(tables))
    edges = bin_edges(t for samples in tables.values() for t in samples)
    for row, (key, samples) in zip(rows, tables.items(), strict=True):
        for name, (marker, color, label) in STYLES.items():
            draw_binned(row, samples, name, edges, fmt=f"{marker}-", color=color, label=label)
        for axes in row.each():
            axes.set_ylim(-0.04, 1.04)
        (row.unstable or row.stable).set_ylabel("share of the motion")
        row.stable.set_title(
            f"{key.label(tables)}, {samples_text({key: samples})}", fontsize=8, loc="right"
        )
    draw_legend(rows[0].stable, next(iter(tables.values())))
    figure.savefig(out)


def report(key: Key, samples: list[ModeTable]) -> dict[str, Any]:
    """Average over bands."""
    found: dict[str, Any] = {"alpha": key.alpha, "u0": key.u0, "samples": len(samples)}
    for band in ("low", "middle", "high"):
        parts = [(t, t.in_band(band)) for t in samples if len(t.in_band(band))]
        found[band] = {
            name: mean([t[name][rows].mean() for t, rows in parts]).report() for name in STYLES
        }
    return found


def main() -> None:
    """Read, average, draw, report."""
    options = asked(__doc__, "mode_components.png")
    tables = turning(options.tables)
    draw(tables, options.out)
    rows = [report(key, samples) for key, samples in tables.items()]
    print(json.dumps({"out": str(options.out), "components": rows}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_mode_components.py: {error}")
