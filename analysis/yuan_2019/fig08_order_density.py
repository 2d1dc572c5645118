"""Draw what order does to density and contacts: Figs. 8 a and 11 a of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/fig_order_density.py SWEEP1 SWEEP2 --out order_density.png

S_2, C_4 and z_J of packings against their phi_J: of protocol 2 each packing, of protocol 1 averages over
samples (open, with standard errors). Only shapes that have both are drawn; all of them if none has. The last
line of standard output is one JSON object with the averages and, of shapes with both, the gain in phi_J.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from superellipsoid_files import (
    Groups,
    averages,
    family_legend,
    mark,
    only,
    parser_of,
    points,
    read_groups,
    rows,
    samples_text,
)
from sweep_files import mean

PANELS = {"S2": "nematic order $S_2$", "C4": "cubatic order $C_4$", "z": "contacts $z_J$"}


def with_both(groups: Groups) -> Groups:
    """Keep shapes of both protocols, or all if there is none."""
    protocols: dict[tuple[float, ...], set[int]] = {}
    for kind in groups:
        protocols.setdefault(kind[:3], set()).add(kind.protocol)
    shown = only(groups, lambda kind: len(protocols[kind[:3]]) > 1)
    return shown or groups


def draw(groups: Groups, out: Path) -> None:
    """Draw order and contacts against phi_J."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(12, 4), dpi=200, layout="constrained")
    panels = figure.subplots(1, len(PANELS))
    first = only(groups, lambda kind: kind.protocol == 1)
    second = only(groups, lambda kind: kind.protocol == 2)
    for axes, (name, text) in zip(panels, PANELS.items(), strict=True):
        points(axes, averages(first, "phi_J"), averages(first, name))
        for kind, samples in second.items():
            style: dict[str, Any] = mark(kind) | {"ls": "none", "ms": 5}
            x = [s.number("phi_J") for s in samples]
            axes.plot(x, [s.number(name) for s in samples], **style)
        axes.set(xlabel=r"packing fraction $\phi_J$", ylabel=text)
    for axes in panels[:2]:
        axes.set_ylim(0, max(0.5, axes.get_ylim()[1]))
    family_legend(panels[0], groups, samples_text(groups), loc="outside right center")
    figure.savefig(out)


def gains(groups: Groups) -> list[dict[str, Any]]:
    """Tell how much denser, more ordered and better connected protocol 2 is, shape by shape."""
    found = []
    for shape in dict.fromkeys(kind[:3] for kind in groups):
        row: dict[str, Any] = dict(zip(("p", "w1", "w2"), shape, strict=True))
        for name in ("phi_J", *PANELS):
            of = [
                [
                    s.number(name)
                    for k, ss in groups.items()
                    if k[:3] == shape and k.protocol == q
                    for s in ss
                ]
                for q in (1, 2)
            ]
            if not all(of):
                break
            row[name] = mean(of[1]).value - mean(of[0]).value
        else:
            found.append(row)
    return found


def main() -> None:
    """Read, average, draw, report."""
    options = parser_of(__doc__, "order_density.png").parse_args()
    groups = with_both(read_groups(options.packings))
    draw(groups, options.out)
    found = rows(groups, {name: averages(groups, name) for name in ("phi_J", *PANELS)})
    print(json.dumps({"out": str(options.out), "shapes": found, "gains": gains(groups)}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_order_density.py: {error}")
