"""Draw density and contacts against order: Figs. 8 a and 11 a of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/yuan_2019/fig08_order_density.py SWEEP1 SWEEP2 --out order_density.png

S_2, C_4 and z_J of packings against their phi_J: of protocol 2 each packing, of protocol 1 averages over
samples (open, with standard errors). Only shapes that have both are drawn; all of them if none has. The last
line of standard output is one JSON object with the averages and, of shapes with both, the gain in phi_J.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.ensembles import PackingFile, System

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages, mean, rows
from common.axes import figure_of, points
from common.ensembles import Groups, conditions, only, read_groups
from common.families import family_legend, is_thermal, mark
from common.text import conditions_text

PANELS = {"S2": "nematic order $S_2$", "C4": "cubatic order $C_4$", "z": "contacts $z_J$"}
NAMES = ("phi_J", *PANELS)


def particles(system: System) -> System:
    """Tell what is packed, however it was."""
    return system._replace(protocol="", n_sweeps=0)


def with_both(groups: Groups) -> Groups:
    """Keep shapes of both protocols, or all if there is none."""
    protocols: dict[System, set[str]] = {}
    for system in groups:
        protocols.setdefault(particles(system), set()).add(system.protocol)
    shown = only(groups, lambda system: len(protocols[particles(system)]) > 1)
    return shown or groups


def draw(groups: Groups, options: Namespace) -> None:
    """Draw order and contacts against phi_J."""
    figure = figure_of(12, 4)
    panels = figure.subplots(1, len(PANELS))
    first, second = only(groups, lambda s: not is_thermal(s)), only(groups, is_thermal)
    for axes, (name, text) in zip(panels, PANELS.items(), strict=True):
        points(axes, averages(first, "phi_J"), averages(first, name))
        for system, files in second.items():
            style: dict[str, Any] = mark(system) | {"ls": "none", "ms": 5}
            x = [file.number("phi_J") for file in files]
            axes.plot(x, [file.number(name) for file in files], **style)
        axes.set(xlabel=r"packing fraction $\phi_J$", ylabel=text)
    for axes in panels[:2]:
        axes.set_ylim(0, max(0.5, axes.get_ylim()[1]))
    family_legend(panels[0], groups, conditions_text(groups), loc="outside right center")
    save_figure(figure, options.out)


def gains(groups: Groups) -> list[dict[str, Any]]:
    """Tell how much denser, more ordered and better connected protocol 2 is, shape by shape."""
    sides: dict[System, tuple[list[PackingFile], list[PackingFile]]] = {}
    for system, files in groups.items():
        sides.setdefault(particles(system), ([], []))[is_thermal(system)].extend(files)
    found = []
    for shape, both in sides.items():
        if all(both):
            before, after = (
                {n: mean([f.number(n) for f in of]).value for n in NAMES} for of in both
            )
            found.append(shape.report() | {n: after[n] - before[n] for n in NAMES})
    return found


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    groups = with_both(read_groups(options.files, needs=NAMES))
    draw(groups, options)
    found = rows(groups, {name: averages(groups, name) for name in NAMES})
    told = {"out": options.out, "conditions": conditions(groups)}
    report(told | {"shapes": found, "gains": gains(groups)})


if __name__ == "__main__":
    run(parser_of(__doc__, "order_density.png", "SWEEP"), main)
