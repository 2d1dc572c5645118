"""Draw densities of vibrational states: Figs. 11(a), 14(a), 15(a), 18(a), 19(a) of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig11a_density_of_states.py MODES [MORE.h5 ...] --out density_of_states.png

MODES are files of analysis/modes.py, or folders of them. One curve for each system and u0, averaged over
samples with standard errors; --alpha and --u0 select. The integral is 1; the rotations of discs, at
omega = 0, count in it and are not drawn. Modes of negative eigenvalue are drawn apart, on the left. Stars are
the frequencies of bands that the paper names. The last line of standard output is one JSON object with
the fractions of modes in each band, beside the paper's.
"""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import report, run
from jamshape.drawing.axes import SMALL_TEXT, log_bars
from jamshape.drawing.mode_axes import (
    Sides,
    add_sides,
    bin_edges,
    draw_errors,
    key_labels,
    legend_title,
    modes_parser,
    tables_asked,
)
from jamshape.drawing.saving import save_figure
from jamshape.drawing.styles import PAPER_STYLE, marked
from jamshape.files.sets import of_paper
from jamshape.measures.averages import mean, standard_error
from jamshape.vibration.sets import TOLD, Key, Tables, every, sizes, stable, unstable
from jamshape.vibration.table import ModeTable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Sec. III D, N = 1024, u = 1e-15: fractions of modes, and frequencies in the bands.
PAPER_FRACTIONS = {
    4.0: {"low": 0.0638, "middle": 0.00033, "high": 0.936},
    1.0: {"low": 0.0039, "middle": 0.0105, "high": 0.986},
    0.01: {"low": 0.0, "middle": (6 - 4.43) / 6, "high": 4.43 / 6},
}
PAPER_OMEGA = {4.0: (1e-8, 1e-4), 0.01: (3e-3, 3e-2)}
PAPER_U0 = 1e-15


def of_figure(key: Key) -> bool:
    """Whether the paper names numbers of such packings."""
    return of_paper(key.system) and key.u0 == PAPER_U0


def total(table: ModeTable) -> int:
    """Count all modes, rotations of discs included."""
    freedoms = {2: 3, 3: 6}[table.coordinates.dimension]
    return freedoms * int(table.attributes["n_backbone"])


def densities(samples: list[ModeTable], edges: FloatArray, *, below: bool) -> FloatArray:
    """D(omega) of each sample, (samples, bins), of unstable modes or of the others."""
    select = unstable if below else stable
    counts = [np.histogram(sizes(t)[select(t)], edges)[0] / total(t) for t in samples]
    return np.asarray(counts / np.diff(edges))


def draw_curve(row: Sides, samples: list[ModeTable], edges: FloatArray, **style: Any) -> float:
    """Draw one curve on both sides; return its lowest point."""
    least, middles = np.inf, np.sqrt(edges[1:] * edges[:-1])
    for axes, below in ((row.stable, False), (row.unstable, True)):
        if axes is None:
            continue
        density = densities(samples, edges, below=below)
        height = density.mean(axis=0)
        seen = height > 0
        least = min(least, float(height[seen].min(initial=np.inf)))
        bars = np.where(seen, log_bars(height, standard_error(density)), np.nan)
        shown = style | ({"yerr": bars} if len(samples) > 1 else {})
        # Lines end at the gaps between bands.
        axes.errorbar(middles, np.where(seen, height, np.nan), **shown)
    return least


def draw(tables: Tables, options: Namespace) -> None:
    """Draw all curves."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(7, 4.2), dpi=200, layout="constrained")
    (row,) = add_sides(figure, tables)
    edges, labels = bin_edges(every(tables)), key_labels(tables)
    least = min(
        draw_curve(row, samples, edges, label=labels[key], **marked(k, "-"))
        for k, (key, samples) in enumerate(tables.items())
    )
    if row.unstable is not None:
        draw_errors(row.unstable, tables)
    mark_paper(row.stable, tables)
    for axes in row.each():
        axes.set_yscale("log")
        axes.set_ylim(bottom=least / 8)
    title = legend_title(tables)
    row.stable.legend(loc="upper right", frameon=False, title=title, **SMALL_TEXT)
    row.first.set_ylabel(r"density of states  $D(\omega)$")
    save_figure(figure, options.out)


def mark_paper(axes: Axes, tables: Tables) -> None:
    """Draw stars at frequencies that the paper names."""
    alphas = [key.number("alpha") for key in tables if of_figure(key)]
    omega = [w for alpha in alphas for w in PAPER_OMEGA.get(alpha, ())]
    if omega:
        style = {name: PAPER_STYLE[name] for name in ("color", "mfc", "ms", "label")}
        low: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "lw": 0}
        axes.plot(omega, [0.03] * len(omega), "*", **style, **low)


def row_of(key: Key, samples: list[ModeTable]) -> dict[str, Any]:
    """Give the fractions of modes in the bands."""
    found: dict[str, Any] = key.report() | {"samples": len(samples)}
    paper = PAPER_FRACTIONS.get(key.number("alpha"), {}) if of_figure(key) else {}
    for band in TOLD:
        fraction = mean([len(t.in_band(band)) / total(t) for t in samples])
        counts = [int(unstable(t)[t.in_band(band)].sum()) for t in samples]
        found[band] = {"fraction": fraction, "unstable": counts, "paper": paper.get(band)}
    found["unsure"] = sum(int((t["sign"][~t["is_translation"]] == 0).sum()) for t in samples)
    found["z"] = float(np.mean([t.attributes["z"] for t in samples]))
    return found


def main(options: Namespace) -> None:
    """Read, count, draw, report."""
    tables = tables_asked(options)
    draw(tables, options)
    rows = [row_of(key, samples) for key, samples in tables.items()]
    report({"out": options.out, "bands": rows})


if __name__ == "__main__":
    run(modes_parser(__doc__, "density_of_states.png"), main)
