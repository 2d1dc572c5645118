"""Draw nematic and cubatic order of packings: Fig. 4 a of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/yuan_2019/fig04_global_order.py SWEEP [MORE ...] --out global_order.png

Left S_2 against C_4, right S_2 against the reduced aspect ratio beta. Large marks are averages over samples with
their standard errors, small ones single packings; open of protocol 1, filled of protocol 2. Lines are at 1/sqrt(N),
and the cross where as many particles of random directions are (average of 200 draws). Spheres have no direction
and are not drawn. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.styles import BLACK
from jamshape.measures.order3d import cubatic_order, nematic_order
from jamshape.packing import body_axes

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages, exactly, mean, rows
from common.axes import beta_axis, figure_of, points
from common.ensembles import Groups, conditions, n_of, only, read_groups
from common.families import NEEDS, beta, family_legend, mark
from common.styles import PAPER_LINE
from common.text import conditions_text

DRAWS = 40


def random_order(n: int) -> dict[str, float]:
    """Average S_2 and C_4 over draws of n random orientations."""
    rng = np.random.default_rng(1)
    draws = [body_axes(rng.normal(size=(n, 4))) for _ in range(DRAWS)]
    nematic = mean([nematic_order(axes[:, 0]).magnitude for axes in draws]).value
    return {"S2": nematic, "C4": mean([cubatic_order(axes).magnitude for axes in draws]).value}


def draw(every: Groups, at_random: dict[str, float], options: Namespace) -> None:
    """Draw S_2 against C_4 and beta."""
    figure = figure_of(10.5, 4.2)
    both, flat = figure.subplots(1, 2, sharey=True)
    known, level = averages(every, "S2"), 1 / math.sqrt(n_of(every))
    groups = only(every, lambda system: known[system].samples > 0)
    for system, files in groups.items():
        single: dict[str, Any] = mark(system) | {"ls": "none", "ms": 2.5, "alpha": 0.5}
        single["mfc"] = single["color"]
        values = [file.number("S2") for file in files]
        both.plot([file.number("C4") for file in files], values, **single)
        flat.plot([beta(system)] * len(files), values, **single)
    S2 = averages(groups, "S2")
    points(both, averages(groups, "C4"), S2)
    points(flat, exactly(groups, beta), S2)
    both.plot(at_random["C4"], at_random["S2"], "+", color=BLACK, ms=10, label="random directions")
    for axes in (both, flat):
        axes.axhline(level, **PAPER_LINE, label=r"$1/\sqrt{N}$")
        axes.set(xscale="log", yscale="log")
    both.axvline(level, **PAPER_LINE)
    both.set(xlabel="cubatic order $C_4$", ylabel="nematic order $S_2$")
    flat.axvline(1, color="0.8", lw=0.8, ls=":", zorder=0)
    beta_axis(flat.xaxis)
    family_legend(flat, groups, conditions_text(every), loc="outside right center")
    both.plot([], [], "o", color="0.4", ms=2.5, label="small: single packings")
    both.legend(fontsize=8, loc="best")
    save_figure(figure, options.out)


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    groups = read_groups(options.files, needs=(*NEEDS, "S2", "C4"))
    at_random = random_order(n_of(groups))
    draw(groups, at_random, options)
    found = rows(groups, {name: averages(groups, name) for name in ("S2", "C4")})
    extra = {"random": at_random, "one_over_sqrt_n": 1 / math.sqrt(n_of(groups))}
    report({"out": options.out, "conditions": conditions(groups), "order": found} | extra)


if __name__ == "__main__":
    run(parser_of(__doc__, "global_order.png", "SWEEP"), main)
