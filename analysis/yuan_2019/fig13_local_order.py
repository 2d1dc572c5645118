"""Draw global against local order: Fig. 13 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/yuan_2019/fig13_local_order.py SWEEP [MORE ...] --out local_order.png

S_2 and C_4 of whole packings against the averages over their particles of those of the particles in contact
(Appendix B). Crosses are what as many random directions have, by the number of contacts: few neighbours seem
ordered. Spheres have no direction and are not drawn. The last line of standard output is one JSON object with
averages over samples and their errors.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.contacts import find_contacts
from jamshape.drawing.colors import ORDER
from jamshape.drawing.saving import save_figure
from jamshape.drawing.styles import BLACK
from jamshape.files.sets import System
from jamshape.measures.averages import Mean
from jamshape.measures.local_order import local_order
from jamshape.measures.order3d import local_cubatic_order, local_nematic_order
from jamshape.packing import Packing, body_axes

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages, mean, rows
from common.axes import figure_of, points
from common.ensembles import Groups, conditions, only, read_groups
from common.families import family_legend
from common.text import conditions_text

GLOBAL = {"S2": "nematic order $S_2$", "C4": "cubatic order $C_4$"}

Columns = dict[str, dict[System, Mean]]


def averaged(packing: Packing) -> dict[str, float]:
    """Average local order over the particles of a packing."""
    found = local_order(packing, find_contacts(packing).pairs)
    return {name: mean(found[name]).value for name in GLOBAL}


def at_random(packing: Packing, rng: np.random.Generator) -> dict[str, Mean]:
    """Average local order if all directions were random."""
    axes, pairs = body_axes(rng.normal(size=(packing.n, 4))), find_contacts(packing).pairs
    orders = (local_nematic_order(axes[:, 0], pairs), local_cubatic_order(axes, pairs))
    return {name: Mean(mean(of).value, samples=1) for name, of in zip(GLOBAL, orders, strict=True)}


def measure(groups: Groups) -> tuple[Columns, Columns]:
    """Average local order over particles and samples, and that of the same contacts at random."""
    found: Columns = {name: {} for name in GLOBAL}
    lost: Columns = {name: {} for name in GLOBAL}
    rng = np.random.default_rng(1)
    for system, files in groups.items():
        packings = [file.packing() for file in files]
        own, random = [averaged(packing) for packing in packings], at_random(packings[0], rng)
        for name in GLOBAL:
            found[name][system] = mean([values[name] for values in own])
            lost[name][system] = random[name]
    return found, lost


def draw(groups: Groups, local: Columns, lost: Columns, options: Namespace) -> None:
    """Draw both kinds of order."""
    figure = figure_of(10.5, 4.2)
    panels = figure.subplots(1, 2)
    for axes, name in zip(panels, GLOBAL, strict=True):
        known = averages(groups, name)
        shown = {s: m for s, m in local[name].items() if m.samples and known[s].samples}
        x = [m.value for m in lost[name].values()]
        low = np.full(len(x), min((known[s].value for s in shown), default=0.0))
        axes.plot(x, low, "+", color=BLACK, ms=6, alpha=0.6, label="local, random directions")
        points(axes, shown, known)
        axes.set(xlabel=ORDER[name], ylabel=GLOBAL[name])
    turning = only(groups, lambda system: any(of[system].samples for of in local.values()))
    family_legend(panels[0], turning, conditions_text(groups), loc="outside right center")
    save_figure(figure, options.out)


def main(options: Namespace) -> None:
    """Read, measure, draw, report."""
    groups = read_groups(options.files, needs=tuple(GLOBAL))
    local, lost = measure(groups)
    draw(groups, local, lost, options)
    columns = {name: averages(groups, name) for name in GLOBAL}
    columns |= {f"local_{name}": values for name, values in local.items()}
    columns |= {f"random_{name}": values for name, values in lost.items()}
    told = {"out": options.out, "conditions": conditions(groups)}
    report(told | {"order": rows(groups, columns)})


if __name__ == "__main__":
    run(parser_of(__doc__, "local_order.png", "SWEEP"), main)
