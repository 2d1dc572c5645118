"""Draw missing contacts against blocked motions: the packings in the plane of VanderWerf, Jin, Shattuck & O'Hern, PRE 97, 012909 (2018).

    python analysis/vanderwerf_2018/constraints.py SWEEP [MORE ...] --out constraints.png

On the left N_q, the modes below the gap of the spectrum, of every packing against its missing contacts,
N_iso - N_c, both without modes that are free altogether: on the unit line but for redundant contacts. On the right the
motions that contacts block to second order only, over N_q: at least 1, since these block the N_q modes. Spectra are
kept in files. The last line of standard output is one JSON object with a row for each packing.
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
from jamshape.files.ensembles import System

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import ASPHERICITY, figure_of
from common.constraints import Constraints, constraints_of
from common.ensembles import Groups, conditions, read_groups
from common.families import family, family_legend, mark
from common.quartic import KEPT, kept_modes
from common.text import conditions_text

Counts = dict[System, list[Constraints]]
LINE: dict[str, Any] = {"ls": "--", "color": "0.5", "lw": 1, "zorder": 0}


def draw(
    groups: Groups, counts: Counts, asphericity: dict[System, float], options: Namespace
) -> None:
    """Draw both panels."""
    figure = figure_of(10.5, 4.4)
    left, right = figure.subplots(1, 2)
    for system, found in counts.items():
        style: dict[str, Any] = mark(system) | {"ls": "none", "ms": 6}
        missing = [c.n_isostatic - c.n_contacts - c.n_free for c in found]
        left.plot(missing, [c.n_quartic for c in found], **style)
        ratios = [c.n_blocked / c.n_quartic for c in found if c.n_quartic]
        right.plot([max(asphericity[system] - 1, 1e-4)] * len(ratios), ratios, **style)
    low, top = left.get_xlim()
    left.plot([low, top], [low, top], label="unit line", **LINE)
    left.set(
        xlabel=r"missing contacts $N_\mathrm{iso}-N_c$, less free modes",
        ylabel="quartic modes $N_q$",
    )
    right.axhline(1, **LINE)
    right.set(xscale="log", yscale="log", ylabel="blocked motions over $N_q$")
    right.set_xlabel(ASPHERICITY)
    family_legend(left, groups, conditions_text(groups, bars=False), loc="outside right center")
    save_figure(figure, options.out)


def main(options: Namespace) -> None:
    """Read, count, draw, report."""
    groups = read_groups(options.files)
    counts: Counts = {system: [] for system in groups}
    found: list[dict[str, Any]] = []
    every = [(system, file) for system, files in groups.items() for file in files]
    for system, file in tqdm(every, unit="packing"):
        count = constraints_of(file.packing(), kept_modes(file, options.modes))
        counts[system].append(count)
        enough = count.n_blocked >= count.n_quartic
        row = {"packing": file.path, "family": family(system), **file.system().report()}
        found.append(row | count._asdict() | {"is_matched": count.is_matched, "enough": enough})
    aspherical = {s: float(np.mean([f.number("asphericity") for f in groups[s]])) for s in groups}
    draw(groups, counts, aspherical, options)
    names = ("is_matched", "enough")
    total = {"packings": len(found)} | {name: sum(row[name] for row in found) for name in names}
    report({"out": options.out, "conditions": conditions(groups), **total, "counts": found})


if __name__ == "__main__":
    parser = parser_of(__doc__, "constraints.png", "SWEEP")
    parser.add_argument("--modes", type=Path, metavar="FOLDER", help=KEPT)
    run(parser, main)
