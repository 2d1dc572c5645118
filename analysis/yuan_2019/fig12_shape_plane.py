"""Draw the shapes that were packed: Fig. 12 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/fig_shape_plane.py SWEEP [MORE ...] --out shape_plane.png

Reduced aspect ratio beta against asphericity A. Lines are oblate and prolate ellipsoids (Eqs. 8 and 9, of which the
asphericity is 1 minus what is printed) and, in grey, flat and long superellipsoids with p = 2. The last line of
standard output is one JSON object with the shapes.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from superellipsoid_files import (
    Groups,
    averages,
    beta_axis,
    exactly,
    family_legend,
    parser_of,
    points,
    read_groups,
    rows,
    samples_text,
)
from sweep_files import BLUE, RED

from jamshape.shapes.roundness import asphericity, axes_from

LARGEST = 6.0  # of beta, and of 1/beta
BOX = 2.0  # exponent of the grey lines


def draw(groups: Groups, out: Path) -> None:
    """Draw shapes and the curves that bound them."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(7, 4.6), dpi=200, layout="constrained")
    axes = figure.subplots()
    long = np.geomspace(1, LARGEST, 40)
    flat, tall = axes_from(1 / long, np.ones_like(long)), axes_from(np.ones_like(long), long)
    for p, style in ((1.0, "-"), (BOX, "--")):
        for shape, beta, color, name in (
            (flat, 1 / long, BLUE, "oblate"),
            (tall, long, RED, "prolate"),
        ):
            shown = color if p == 1 else "0.6"
            text = f"{name} ellipsoids" if p == 1 else f"{name}, $p={BOX:g}$"
            axes.plot(asphericity(shape, p), beta, style, color=shown, lw=1, zorder=0, label=text)
    points(axes, averages(groups, "asphericity"), exactly(groups, lambda kind: kind.beta))
    axes.axhline(1, color="0.8", lw=0.8, ls=":", zorder=0)
    largest = max(0.36, 1.05 * max(m.value for m in averages(groups, "asphericity").values()))
    axes.set(xlim=(-0.01, largest), xlabel=r"asphericity $\mathcal{A}$")
    beta_axis(axes.yaxis)
    family_legend(axes, groups, samples_text(groups), loc="outside right center")
    figure.savefig(out)


def main() -> None:
    """Read, draw, report."""
    options = parser_of(__doc__, "shape_plane.png").parse_args()
    groups = read_groups(options.packings)
    draw(groups, options.out)
    columns = {"asphericity": averages(groups, "asphericity")}
    columns["beta"] = exactly(groups, lambda kind: kind.beta)
    print(json.dumps({"out": str(options.out), "shapes": rows(groups, columns)}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_shape_plane.py: {error}")
