"""Draw densities of vibrational states: Figs. 11(a), 14(a), 15(a), 18(a), 19(a) of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig11a_density_of_states.py MODES [MORE.h5 ...] --out density_of_states.png

MODES are files of analysis/modes.py, or folders of them. One curve for each system and u0, averaged over
samples with standard errors; --alpha and --u0 select. The integral is 1; the rotations of discs, at
omega = 0, count in it and are not drawn, translations are left out. Modes of negative eigenvalue are drawn apart, on the left. Stars are
the frequencies of bands that the paper names. The last line of standard output is one JSON object with
the fractions of modes in each band, beside the paper's, and those (fraction_bearing) without the bonds that bear less than
1e-6 of the mean force.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import report, run
from jamshape.drawing.saving import save_figure
from jamshape.vibration.ensembles import TOLD, Key
from jamshape.vibration.table import ModeTable

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean, standard_error
from common.axes import SMALL_TEXT, figure_of, log_bars
from common.ensembles import of_paper
from common.mode_axes import (
    Sides,
    add_sides,
    bin_edges,
    draw_errors,
    key_labels,
    legend_title,
    modes_parser,
    tables_asked,
)
from common.mode_tables import BY_GRAZING, Tables, every, sizes, stable, unstable
from common.published import BANDS
from common.styles import PAPER_STYLE, marked

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Sec. III D, N = 1024, u = 1e-15: frequencies in the bands.
PAPER_OMEGA = {4.0: (1e-8, 1e-4), 0.01: (3e-3, 3e-2)}
PAPER_U0 = 1e-15

SHADES = {"low": "C1", "middle": "C2", "high": "0.6"}
MARGIN = 1.3  # of a shaded band beyond its last mode
SLIDING = 0.9  # motion along the spines is named from this part on


def of_figure(key: Key) -> bool:
    """Whether the paper names numbers of such packings."""
    return of_paper(key.system) and key.u0 == PAPER_U0


def total(table: ModeTable) -> int:
    """Count all modes but translations, rotations of discs included."""
    freedoms = {2: 3, 3: 6}[table.coordinates.dimension]
    n_translations = int(table.attributes["n_modes"]) - table.n_vibrational
    return freedoms * int(table.attributes["n_backbone"]) - n_translations


def bearing(table: ModeTable, band: str) -> float:
    """Fraction of all modes in a band without grazing bonds; NaN of a table that does not count them."""
    grazing = table.attributes.get("n_grazing", np.nan)
    return float((len(table.in_band(band)) + BY_GRAZING[band] * grazing) / total(table))


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
    figure = figure_of(7, 4.2, dpi=125)
    (row,) = add_sides(figure, tables)
    edges, labels = bin_edges(every(tables)), key_labels(tables)
    least = min(
        draw_curve(row, samples, edges, label=labels[key], **marked(k, "-"))
        for k, (key, samples) in enumerate(tables.items())
    )
    if row.unstable is not None:
        draw_errors(row.unstable, tables)
    mark_paper(row.stable, tables)
    if len(tables) == 1:
        mark_bands(row, *next(iter(tables.items())))
    for axes in row.each():
        axes.set_yscale("log")
        axes.set_ylim(bottom=least / 8)
    title = legend_title(tables)
    figure.suptitle("density of vibrational states", size=9)
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


def mark_bands(row: Sides, key: Key, samples: list[ModeTable]) -> None:
    """Shade the frequencies of each band that has modes, and name it with its fraction of all modes."""
    found = row_of(key, samples)
    for band, shade in SHADES.items():
        part = found[band]["fraction"].value
        style: dict[str, Any] = {"color": shade, "alpha": 0.2, "lw": 0, "zorder": 0}
        if part > 0:
            style["label"] = band_text(band, samples, part, found[band]["paper"])
        for axes, selected in ((row.stable, stable), (row.unstable, unstable)):
            omega = np.concatenate(
                [sizes(t)[[k for k in t.in_band(band) if selected(t)[k]]] for t in samples]
            )
            if axes is not None and (omega > 0).any():
                axes.axvspan(omega[omega > 0].min() / MARGIN, omega.max() * MARGIN, **style)
                style.pop("label", None)


def band_text(band: str, samples: list[ModeTable], part: float, paper: float | None) -> str:
    """Name a band by its fraction of all modes and, where they are that, as sliding."""
    along = float(np.concatenate([t["parallel"][t.in_band(band)] for t in samples]).mean())
    text = f"{band} band" + f", {100 * along:.1f} % sliding" * (along > SLIDING)
    beside = "" if paper is None else f" (paper {paper:.4f})"
    return f"{text}: {part:.4f} of all modes{beside}"


def row_of(key: Key, samples: list[ModeTable]) -> dict[str, Any]:
    """Give the fractions of modes in the bands."""
    found: dict[str, Any] = key.report() | {"samples": len(samples)}
    paper = BANDS.get(key.number("alpha"), {}) if of_figure(key) else {}
    for band in TOLD:
        known = [t for t in samples if t.has_band(band)]
        fraction = mean([len(t.in_band(band)) / total(t) for t in known])
        counts = [int(unstable(t)[t.in_band(band)].sum()) for t in known]
        found[band] = {
            "fraction": fraction,
            "fraction_bearing": mean([bearing(t, band) for t in known]),
        }
        found[band] |= {"unstable": counts, "paper": paper.get(band)}
    found["without_bands"] = sum("why_no_bands" in t.attributes for t in samples)
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
