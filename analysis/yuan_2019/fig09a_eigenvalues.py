"""Draw spectra of the dynamical matrix: Figs. 9 a and 11 b of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/fig_eigenvalues.py SWEEP [MORE ...] --out eigenvalues.png

Eigenvalues of the first packing of each shape and protocol, sorted by size, translations left out, and below how
much of each mode is rotation (mean over neighbours). Dots are where the quartic modes end, regime 1 of the paper;
regimes 2 and 3 are the modes above that are mostly rotation, mostly translation. Rotations count as a times the
angle, and modes of negative eigenvalue are dotted. Spectra are kept in files; --shape selects. The last line of
standard output is one JSON object.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from superellipsoid_files import Kind, parser_of, read_groups
from superellipsoid_modes import by_size, kept_modes, modes_option, quartic_count
from tqdm import tqdm

from jamshape.arrays import FloatArray
from jamshape.vibration.table import ModeTable

Tables = dict[Kind, ModeTable]
SMOOTH = 31  # modes that the share of rotation is averaged over
MOST = 12  # shapes drawn, unless asked for


def smooth(values: FloatArray) -> FloatArray:
    """Average over neighbours."""
    width = min(SMOOTH, len(values))
    sums = np.convolve(values, np.ones(width), "same")
    return np.asarray(sums / np.convolve(np.ones(len(values)), np.ones(width), "same"))


def draw(tables: Tables, n: int, out: Path) -> None:
    """Draw eigenvalues and the share of rotation."""
    from matplotlib import colormaps  # noqa: PLC0415 - not needed for --help and for errors
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(8.4, 6), dpi=200, layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[2.2, 1])
    shades = colormaps["turbo"](np.linspace(0.05, 0.95, len(tables)))
    for color, (kind, table) in zip(shades, tables.items(), strict=True):
        rows = by_size(table)
        values, place = table["eigenvalues"][rows], np.arange(1, len(rows) + 1)
        size, end = np.abs(values), quartic_count(table).n_quartic
        label = f"{kind.label}, $z={table.attributes['z']:.2f}$"
        top.plot(place, np.where(values > 0, size, np.nan), "-", color=color, lw=1.3, label=label)
        top.plot(place, np.where(values < 0, size, np.nan), ":", color=color, lw=1.3)
        if end:
            top.plot(end, size[end - 1], "o", color=color, ms=5, mec="k", mew=0.6)
        bottom.plot(place, smooth(table["rotation"][rows]), "-", color=color, lw=1.0)
    top.set(yscale="log", ylabel=r"$\lambda_i\;a^2/\epsilon$")
    bottom.set(xlabel="mode $i$", ylabel="share of rotation", ylim=(-0.03, 1.03))
    title = f"$(p, w_1, w_2)$, $N={n}$"
    text: dict[str, Any] = {"fontsize": 8, "title_fontsize": 8, "frameon": False}
    figure.legend(title=title, loc="outside right upper", **text)
    figure.savefig(out)


def row(kind: Kind, table: ModeTable) -> dict[str, Any]:
    """Count the modes of the three regimes."""
    rows, counts = by_size(table), quartic_count(table)
    stiff = table["rotation"][rows[counts.n_quartic :]]
    turning = int((stiff > 0.5).sum())
    regimes = [counts.n_quartic, turning, len(stiff) - turning]
    found = kind.report() | {"z": table.attributes["z"], "regimes": regimes}
    return found | {"gap": counts.gap, "negative": counts.n_negative}


def main() -> None:
    """Read, find modes, draw, report."""
    parser = parser_of(__doc__, "eigenvalues.png")
    modes_option(parser)
    which = "p, w1 and w2; may be given several times (the first 12)"
    shape: dict[str, Any] = {"nargs": 3, "action": "append", "metavar": ("P", "W1", "W2")}
    parser.add_argument("--shape", type=float, help=which, **shape)
    options = parser.parse_args()
    groups = read_groups(options.packings)
    shapes = [tuple(asked) for asked in options.shape or []]
    missing = [asked for asked in shapes if asked not in {kind[:3] for kind in groups}]
    if missing:
        msg = "no packing has p, w1, w2 = {:g}, {:g}, {:g}, expected a shape of the sweep"
        raise ValueError(msg.format(*missing[0]))
    chosen = [kind for kind in groups if kind[:3] in shapes] or list(groups)[:MOST]
    tables: Tables = {}
    for kind in tqdm(chosen, unit="packing"):
        tables[kind] = kept_modes(groups[kind][0], options.modes)
    draw(tables, int(groups[chosen[0]][0].number("n")), options.out)
    found = [row(kind, table) for kind, table in tables.items()]
    print(json.dumps({"out": str(options.out), "spectra": found}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_eigenvalues.py: {error}")
