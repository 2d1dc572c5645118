"""Draw phi_J of spheroids and superballs: Fig. 3 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/fig_phi_j_shapes.py SWEEP [MORE ...] --out phi_j_shapes.png

Left against the aspect ratio w of ellipsoids with two equal axes, the third over these; right against the
exponent p of particles with three equal axes. Open marks are of protocol 1, filled ones of protocol 2. The last
line of standard output is one JSON object with averages over samples and their standard errors.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from superellipsoid_files import (
    OF_PAPER,
    PHI_SPHERES,
    Groups,
    Kind,
    averages,
    exactly,
    family_legend,
    only,
    parser_of,
    points,
    read_groups,
    rows,
    samples_text,
)

TICKS = (0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3, 4)


def is_spheroid(kind: Kind) -> bool:
    """Whether two axes of an ellipsoid are equal."""
    return kind.is_axisymmetric


def is_superball(kind: Kind) -> bool:
    """Whether all axes are equal."""
    return kind.w1 == kind.w2 == 1


def draw(groups: Groups, out: Path) -> None:
    """Draw phi_J against w and against p."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(9, 4), dpi=200, layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    cases: tuple[Any, ...] = ((is_spheroid, lambda k: k.beta), (is_superball, lambda k: k.p))
    for axes, (belongs, x) in zip(panels, cases, strict=True):
        shown = only(groups, belongs)
        points(axes, exactly(shown, x), averages(shown, "phi_J"))
        axes.axhline(PHI_SPHERES, **OF_PAPER, label="spheres, paper")
        if shown:
            family_legend(axes, shown, samples_text(shown), loc="best")
    panels[0].set_xscale("log")
    low, high = panels[0].get_xlim()
    ticks = [tick for tick in TICKS if low < tick < high]
    panels[0].set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panels[0].set_xticks([], minor=True)
    panels[0].set_xlabel("aspect ratio $w$ of spheroids")
    panels[0].set_ylabel(r"packing fraction $\phi_J$")
    panels[1].set_xlabel("exponent $p$ of superballs")
    figure.savefig(out)


def main() -> None:
    """Read, average, draw, report."""
    options = parser_of(__doc__, "phi_j_shapes.png").parse_args()
    every = read_groups(options.packings)
    groups = only(every, lambda kind: is_spheroid(kind) or is_superball(kind))
    if not groups:
        msg = f"none of {len(every)} shapes is a spheroid or a superball, expected one"
        raise ValueError(msg)
    draw(groups, options.out)
    found = rows(groups, {"phi_J": averages(groups, "phi_J")})
    print(json.dumps({"out": str(options.out), "phi_J": found, "paper_spheres": PHI_SPHERES}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_phi_j_shapes.py: {error}")
