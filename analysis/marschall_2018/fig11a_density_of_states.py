"""Draw densities of vibrational states: Figs. 11(a), 14(a), 15(a), 18(a), 19(a) of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_density_of_states.py MODES [MORE.h5 ...] --out density_of_states.png

MODES are files of analysis/modes.py, or folders of them. One curve for each alpha and u0, averaged over
samples with standard errors; --alpha and --u0 select. The integral is 1; the rotations of discs, at
omega = 0, count in it and are not drawn. Modes of negative eigenvalue are drawn apart, on the left. Stars are
the frequencies of bands that the paper names. The last line of standard output is one JSON object with
the fractions of modes in each band, beside the paper's.
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
    draw_errors,
    samples_text,
    sizes,
    stable,
    unstable,
)
from sweep_files import COLORS, MARKERS, PAPER_STYLE, mean, plain

from jamshape.arrays import FloatArray
from jamshape.vibration.table import ModeTable

# Sec. III D, N = 1024, u = 1e-15: fractions of modes, and frequencies in the bands.
PAPER_FRACTIONS = {
    4.0: {"low": 0.0638, "middle": 0.00033, "high": 0.936},
    1.0: {"low": 0.0039, "middle": 0.0105, "high": 0.986},
    0.01: {"low": 0.0, "middle": (6 - 4.43) / 6, "high": 4.43 / 6},
}
PAPER_OMEGA = {4.0: (1e-8, 1e-4), 0.01: (3e-3, 3e-2)}
PAPER_U0 = 1e-15

DEGREES_OF_FREEDOM = 3  # of a particle in the plane


def densities(samples: list[ModeTable], edges: FloatArray, *, below: bool) -> FloatArray:
    """D(omega) of each sample, (samples, bins), of unstable modes or of the others."""
    select = unstable if below else stable
    counts = [np.histogram(sizes(t)[select(t)], edges)[0] / total(t) for t in samples]
    return np.asarray(counts / np.diff(edges))


def total(table: ModeTable) -> int:
    """Count all modes, rotations of discs included."""
    return DEGREES_OF_FREEDOM * int(table.attributes["n_backbone"])


def draw(tables: Tables, out: Path) -> None:
    """Draw all curves."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(7, 4.2), dpi=200, layout="constrained")
    (row,) = add_sides(figure, tables)
    least = np.inf
    edges = bin_edges(t for samples in tables.values() for t in samples)
    middles = np.sqrt(edges[1:] * edges[:-1])
    for k, (key, samples) in enumerate(tables.items()):
        style: dict[str, Any] = {"color": COLORS[k % len(COLORS)], "mfc": "none", "ms": 4}
        style |= {"fmt": f"{MARKERS[k % len(MARKERS)]}-", "lw": 0.8, "elinewidth": 0.8}
        for axes, below in ((row.stable, False), (row.unstable, True)):
            if axes is None:
                continue
            density = densities(samples, edges, below=below)
            error = density.std(axis=0) / np.sqrt(max(len(samples) - 1, 1))
            height = density.mean(axis=0)
            seen = height > 0
            least = min(least, height[seen].min(initial=np.inf))
            bars = np.array([np.minimum(error, 0.9 * height), error])
            bars[:, ~seen] = np.nan
            # Lines end at the gaps between bands.
            curve = np.where(seen, height, np.nan)
            shown = style | ({"yerr": bars} if len(samples) > 1 else {})
            axes.errorbar(middles, curve, capsize=1.5, label=key.label(tables), **shown)
    if row.unstable is not None:
        draw_errors(row.unstable, tables, COLORS)
    mark_paper(row.stable, tables)
    for axes in row.each():
        axes.set_yscale("log")
        axes.set_ylim(bottom=least / 8)
    text: dict[str, Any] = {"title": samples_text(tables), "title_fontsize": 8, "fontsize": 8}
    row.stable.legend(loc="upper right", frameon=False, **text)
    first = row.unstable or row.stable
    first.set_ylabel(r"density of states  $D(\omega)$")
    figure.savefig(out)


def mark_paper(axes: Any, tables: Tables) -> None:
    """Draw stars at frequencies that the paper names."""
    omega = [w for key in tables if key.u0 == PAPER_U0 for w in PAPER_OMEGA.get(key.alpha, ())]
    if omega:
        style = {name: PAPER_STYLE[name] for name in ("color", "mfc", "ms", "label")}
        axes.plot(
            omega, [0.03] * len(omega), "*", transform=axes.get_xaxis_transform(), **style, lw=0
        )


def report(key: Key, samples: list[ModeTable]) -> dict[str, Any]:
    """Give the fractions of modes in the bands."""
    found: dict[str, Any] = {"alpha": key.alpha, "u0": key.u0, "samples": len(samples)}
    for band in ("low", "middle", "high"):
        fraction = mean([len(t.in_band(band)) / total(t) for t in samples])
        counts = [int(unstable(t)[t.in_band(band)].sum()) for t in samples]
        of_paper = PAPER_FRACTIONS.get(key.alpha, {}).get(band) if key.u0 == PAPER_U0 else None
        found[band] = {"fraction": fraction.report(), "unstable": counts, "paper": of_paper}
    found["unsure"] = sum(int((t["sign"][~t["is_translation"]] == 0).sum()) for t in samples)
    found["z"] = plain(float(np.mean([t.attributes["z"] for t in samples])))
    return found


def main() -> None:
    """Read, count, draw, report."""
    options = asked(__doc__, "density_of_states.png")
    tables = options.tables
    draw(tables, options.out)
    rows = [report(key, samples) for key, samples in tables.items()]
    print(json.dumps({"out": str(options.out), "bands": rows}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_density_of_states.py: {error}")
