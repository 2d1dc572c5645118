"""Draw spectra of the dynamical matrix: Figs. 9 a and 11 b of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/yuan_2019/fig09a_eigenvalues.py SWEEP [MORE ...] --out eigenvalues.png

Eigenvalues of the first packing of each system, sorted by size, translations left out, and below how
much of each mode is rotation (mean over neighbours). Dots are where the quartic modes end, regime 1 of the paper;
regimes 2 and 3 are the modes above that are mostly rotation, mostly translation. Rotations count as a times the
angle, and modes of negative eigenvalue are dotted. Spectra are kept in files; --shape selects. The last line of
standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import unit_text
from jamshape.files.sets import System
from jamshape.vibration.table import ModeTable

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import SMALL_TEXT, figure_of
from common.ensembles import Groups, conditions, read_groups
from common.families import shape_of
from common.quartic import KEPT, by_size, kept_modes, quartic_count
from common.text import conditions_alone, system_labels

Tables = dict[System, ModeTable]
SMOOTH = 31  # modes that the share of rotation is averaged over
MOST = 12  # systems drawn, unless asked for


def smooth(values: FloatArray) -> FloatArray:
    """Average over neighbours."""
    width = min(SMOOTH, len(values))
    sums = np.convolve(values, np.ones(width), "same")
    return np.asarray(sums / np.convolve(np.ones(len(values)), np.ones(width), "same"))


def draw(tables: Tables, title: str, options: Namespace) -> None:
    """Draw eigenvalues and the share of rotation."""
    from matplotlib import colormaps  # noqa: PLC0415 - not needed for --help and for errors

    figure = figure_of(8.4, 6)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[2.2, 1])
    shades = colormaps["turbo"](np.linspace(0.05, 0.95, len(tables)))
    labels = system_labels(tables)
    for color, (system, table) in zip(shades, tables.items(), strict=True):
        rows = by_size(table)
        values, place = table["eigenvalues"][rows], np.arange(1, len(rows) + 1)
        size, end = np.abs(values), quartic_count(table).n_quartic
        label = f"{labels[system]}, $z={table.attributes['z']:.2f}$"
        style: dict[str, Any] = {"color": color, "lw": 1.3}
        top.plot(place, np.where(values > 0, size, np.nan), "-", label=label, **style)
        top.plot(place, np.where(values < 0, size, np.nan), ":", **style)
        if end:
            top.plot(end, size[end - 1], "o", color=color, ms=5, mec="k", mew=0.6)
        bottom.plot(place, smooth(table["rotation"][rows]), "-", color=color, lw=1.0)
    top.plot([], [], "o", color="w", ms=5, mec="k", mew=0.6, label="last quartic mode")
    top.plot([], [], ":", color="0.4", lw=1.3, label=r"dotted: $-\lambda_i$, where $\lambda_i<0$")
    unit = unit_text(tables)
    top.set(yscale="log", ylabel=rf"$\lambda_i\;[k_e/{unit}^2]$")
    bottom.set(xlabel="mode $i$", ylabel="share of rotation", ylim=(-0.03, 1.03))
    figure.suptitle(title, fontsize=8)
    figure.legend(loc="outside right center", frameon=False, **SMALL_TEXT)
    save_figure(figure, options.out)


def row_of(system: System, table: ModeTable) -> dict[str, Any]:
    """Count the modes of the three regimes."""
    rows, counts = by_size(table), quartic_count(table)
    stiff = table["rotation"][rows[counts.n_quartic :]]
    turning = int((stiff > 0.5).sum())
    regimes = [counts.n_quartic, turning, len(stiff) - turning]
    found = system.report() | {"z": table.attributes["z"], "regimes": regimes}
    return found | {"gap": counts.gap, "negative": counts.n_negative}


def chosen(groups: Groups, shapes: list[list[float]]) -> list[System]:
    """Select systems by p, w1 and w2; the first ones if none is asked for.

    Raises
    ------
    ValueError
        If one that is asked for is not there.
    """
    asked = [tuple(numbers) for numbers in shapes]
    missing = [shape for shape in asked if shape not in {shape_of(system) for system in groups}]
    if missing:
        msg = "no packing has p, w1, w2 = {:g}, {:g}, {:g}, expected a shape of the sweep"
        raise ValueError(msg.format(*missing[0]))
    return [s for s in groups if shape_of(s) in asked] if asked else list(groups)[:MOST]


def parser() -> ArgumentParser:
    """Describe the command line."""
    found = parser_of(__doc__, "eigenvalues.png", "SWEEP")
    found.add_argument("--modes", type=Path, metavar="FOLDER", help=KEPT)
    which: dict[str, Any] = {"nargs": 3, "action": "append", "metavar": ("P", "W1", "W2")}
    which |= {"help": "p, w1 and w2; may be given several times (the first 12)", "default": []}
    found.add_argument("--shape", type=float, **which)
    return found


def main(options: Namespace) -> None:
    """Read, find modes, draw, report."""
    groups = read_groups(options.files)
    systems = chosen(groups, options.shape)
    tables: Tables = {}
    for system in tqdm(systems, unit="packing"):
        tables[system] = kept_modes(groups[system][0], options.modes)
    draw(tables, conditions_alone({s: groups[s] for s in systems}), options)
    found = [row_of(system, table) for system, table in tables.items()]
    report({"out": options.out, "conditions": conditions(groups), "spectra": found})


if __name__ == "__main__":
    run(parser(), main)
