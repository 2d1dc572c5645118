"""Draw phi_J over the plane of shapes: Fig. 7 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/yuan_2019/fig07_shape_map.py SWEEP [MORE ...] --out shape_map.png

Left phi_J against the reduced aspect ratio beta, in bands of asphericity A = 0.1, 0.15, 0.2, 0.25 (+- 0.025),
without boxes (p > 1), as in the paper, and what is below; right phi_J as color against A and beta, with contours
where there are enough shapes (10). Packings of protocol 2, which are ordered, are left out unless --protocol asks for
them. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.styles import BLACK
from jamshape.files.ensembles import System
from jamshape.files.vocabulary import NUMBERED, protocol_named
from jamshape.measures.averages import Mean

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages, exactly, rows
from common.axes import beta_axis, figure_of
from common.ensembles import Groups, conditions, only, read_groups
from common.families import NEEDS, beta, is_thermal, shape_of
from common.styles import COLORS, PAPER_LINE
from common.text import conditions_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BANDS = (0.05, 0.1, 0.15, 0.2, 0.25)
HALF = 0.025
ENOUGH = 10  # shapes for contours
LEAST_ROUND = 0.05  # radius of the inner over the outer circle of a triangle at the rim

Averages = dict[System, Mean]


def draw_bands(axes: Axes, A: Averages, phi: Averages) -> None:
    """Draw phi_J against beta in bands of asphericity."""
    for color, middle in zip((*COLORS[:4], BLACK), BANDS, strict=True):
        low = -1.0 if middle == BANDS[0] else middle - HALF
        inside = [s for s in A if low <= A[s].value < middle + HALF and shape_of(s)[0] <= 1]
        inside.sort(key=beta)
        if not inside:
            continue
        error = np.nan_to_num([phi[s].error for s in inside])
        text = rf"$\mathcal{{A}}={middle:g}$" if low > 0 else rf"$\mathcal{{A}}<{middle + HALF:g}$"
        style: dict[str, Any] = {"ms": 5, "lw": 1, "capsize": 2, "mfc": "none"}
        style |= {"fmt": "o-" if low > 0 else "o", "color": color, "label": text}
        axes.errorbar([beta(s) for s in inside], [phi[s].value for s in inside], error, **style)
    axes.set_ylabel(r"packing fraction $\phi_J$")
    beta_axis(axes.xaxis)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8)
    else:
        axes.set(xticks=[], yticks=[])
        axes.text(0.5, 0.5, r"no shape with $p\leq 1$", transform=axes.transAxes, ha="center")


def draw_map(figure: Any, axes: Axes, A: Averages, phi: Averages) -> bool:
    """Draw phi_J as color; return whether there are contours."""
    x, y = (np.array(values) for values in ([A[s].value for s in A], [beta(s) for s in A]))
    z = np.array([phi[s].value for s in A])
    spread = np.ptp(x) > 0 and np.ptp(np.log(y)) > 0
    contours = bool(len(x) >= ENOUGH and spread)
    if contours:
        draw_contours(axes, x, y, z)
    dots = axes.scatter(x, y, c=z, cmap="viridis", s=60, edgecolors="k", linewidths=0.6, zorder=3)
    figure.colorbar(dots, ax=axes, label=r"$\phi_J$")
    axes.axhline(1, **PAPER_LINE, label=r"$\beta=1$")
    axes.legend(fontsize=8)
    axes.set_xlabel(r"asphericity $\mathcal{A}$")
    beta_axis(axes.yaxis)
    return contours


def draw_contours(axes: Axes, x: Any, y: Any, z: Any) -> None:
    """Draw lines of equal z over the triangles between points, flat ones at the rim left out."""
    from matplotlib.tri import TriAnalyzer, Triangulation  # noqa: PLC0415 - not needed for --help

    levels = np.arange(np.floor(z.min() * 100) / 100, z.max() + 0.01, 0.01)
    even = Triangulation(x / np.ptp(x), np.log(y) / np.ptp(np.log(y)))
    flat = TriAnalyzer(even).get_flat_tri_mask(LEAST_ROUND)
    mesh = Triangulation(x, y, even.triangles, flat)
    axes.tricontourf(mesh, z, levels, cmap="viridis", alpha=0.6)
    axes.tricontour(mesh, z, levels, colors="0.4", linewidths=0.5)


def draw(groups: Groups, options: Namespace) -> bool:
    """Draw both panels; return whether there are contours."""
    figure = figure_of(9.5, 4.2)
    left, right = figure.subplots(1, 2)
    A, phi = averages(groups, "asphericity"), averages(groups, "phi_J")
    draw_bands(left, A, phi)
    figure.suptitle(conditions_text(groups), fontsize=9)
    contours = draw_map(figure, right, A, phi)
    save_figure(figure, options.out)
    return contours


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    every = read_groups(options.files, needs=(*NEEDS, "asphericity", "phi_J"))
    asked = options.protocol
    groups = only(every, lambda s: s.protocol == asked if asked else not is_thermal(s))
    if not groups:
        of = f"of the protocol {asked}" if asked else "made without Monte Carlo"
        msg = f"no packing is {of}, expected one"
        raise ValueError(msg)
    contours = draw(groups, options)
    columns = {name: averages(groups, name) for name in ("phi_J", "asphericity")}
    columns["beta"] = exactly(groups, beta)
    told = {"out": options.out, "conditions": conditions(groups), "contours": contours}
    report(told | {"shapes": rows(groups, columns)})


if __name__ == "__main__":
    parser = parser_of(__doc__, "shape_map.png", "SWEEP")
    parser.add_argument(
        "--protocol", type=protocol_named, choices=tuple(NUMBERED.values()),
        help="or its number (all without Monte Carlo)",
    )  # fmt: skip
    run(parser, main)
