"""Draw contacts against quartic modes: Fig. 9 b and the inset of Fig. 11 b of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/yuan_2019/fig09b_quartic_modes.py SWEEP [MORE ...] --follow 3 --out quartic_modes.png

N_c of every packing against d_f (N - N_r) - N_q - (D - 1), of d_f = 3 for spheres, 5 for spheroids and 6 for others in
space, and below how far it is from the unit line. N_q is the number of modes below the gap of the spectrum; --follow
tests this, in the first packing of each system, along so many modes on both sides of the gap: those below must
have a crossover to a quartic energy, those above none. Spectra are kept in files. The last line of standard
output is one JSON object with a row for each packing.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.sets import PackingFile, System

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.ensembles import Groups, conditions, read_groups
from common.families import family_legend, mark
from common.quartic import KEPT, QuarticCount, followed, kept_modes, quartic_count
from common.text import conditions_text

Counts = dict[System, list[QuarticCount]]
LINE: dict[str, Any] = {"ls": "--", "color": "0.5", "lw": 1, "zorder": 0}


def draw(groups: Groups, counts: Counts, options: Namespace) -> None:
    """Draw all packings on the unit line, and their distance from it."""
    figure = figure_of(5.6, 6)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    for system, found in counts.items():
        style: dict[str, Any] = mark(system) | {"ls": "none", "ms": 6}
        x = [count.expected for count in found]
        top.plot(x, [count.n_contacts for count in found], **style)
        bottom.plot(x, [count.missing for count in found], **style)
    every = np.array([[c.expected, c.n_contacts] for found in counts.values() for c in found])
    ends = np.array([every.min(), every.max()]) + np.array([-1, 1]) * (0.05 * np.ptp(every) + 1)
    top.plot(ends, ends, label="unit line", **LINE)
    bottom.axhline(0, **LINE)
    top.set_ylabel("contacts $N_c$")
    bottom.set(xlabel=r"$d_f(N-N_r)-N_q-(D-1)$", ylabel="difference")
    largest = max(abs(bottom.get_ylim()[0]), abs(bottom.get_ylim()[1]), 3)
    bottom.set_ylim(-largest, largest)
    family_legend(top, groups, conditions_text(groups, bars=False), loc="upper left")
    save_figure(figure, options.out)


def row_of(file: PackingFile, count: QuarticCount) -> dict[str, Any]:
    """Report one packing."""
    row = {"packing": file.path, **file.system().report(), **count._asdict()}
    return row | {"expected": count.expected, "on_line": count.missing == 0}


def main(options: Namespace) -> None:
    """Read, count, draw, report."""
    groups = read_groups(options.files)
    counts: Counts = {system: [] for system in groups}
    found: list[dict[str, Any]] = []
    every = [(system, file) for system, files in groups.items() for file in files]
    for system, file in tqdm(every, unit="packing"):
        count = quartic_count(kept_modes(file, options.modes))
        found.append(row_of(file, count))
        if options.follow > 0 and not counts[system]:
            found[-1] |= followed(file, options.follow)
        counts[system].append(count)
    draw(groups, counts, options)
    total = {"packings": len(found), "on_line": sum(row["on_line"] for row in found)}
    report({"out": options.out, "conditions": conditions(groups), **total, "counts": found})


if __name__ == "__main__":
    parser = parser_of(__doc__, "quartic_modes.png", "SWEEP")
    parser.add_argument("--modes", type=Path, metavar="FOLDER", help=KEPT)
    many = "modes followed on each side of the gap (%(default)s)"
    parser.add_argument("--follow", type=int, default=0, metavar="K", help=many)
    run(parser, main)
