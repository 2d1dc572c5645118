"""Draw phi_J over the plane of shapes: Fig. 7 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/fig_shape_map.py SWEEP [MORE ...] --out shape_map.png

Left phi_J against the reduced aspect ratio beta, in bands of asphericity A = 0.1, 0.15, 0.2, 0.25 (+- 0.025),
without boxes (p > 1), as in the paper, and what is below; right phi_J as color against A and beta, with contours
where there are enough shapes (10). One protocol is drawn (--protocol 1). The last line of standard output is one
JSON object.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from superellipsoid_files import (
    OF_PAPER,
    Averages,
    Groups,
    averages,
    beta_axis,
    exactly,
    only,
    parser_of,
    read_groups,
    rows,
    samples_text,
)
from sweep_files import BLACK, COLORS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BANDS = (0.05, 0.1, 0.15, 0.2, 0.25)
HALF = 0.025
ENOUGH = 10  # shapes for contours
LEAST_ROUND = 0.05  # radius of the inner over the outer circle of a triangle at the rim


def draw_bands(axes: Axes, A: Averages, phi: Averages) -> None:
    """Draw phi_J against beta in bands of asphericity."""
    for color, middle in zip((*COLORS[:4], BLACK), BANDS, strict=True):
        low = -1.0 if middle == BANDS[0] else middle - HALF
        inside = [k for k in A if low <= A[k].value < middle + HALF and k.p <= 1]
        inside.sort(key=lambda kind: kind.beta)
        if not inside:
            continue
        error = np.nan_to_num([phi[k].error for k in inside])
        text = rf"$\mathcal{{A}}={middle:g}$" if low > 0 else rf"$\mathcal{{A}}<{middle + HALF:g}$"
        style: dict[str, Any] = {
            "fmt": "o-" if low > 0 else "o",
            "ms": 5,
            "lw": 1,
            "capsize": 2,
            "mfc": "none",
        }
        style |= {"color": color, "label": text}
        axes.errorbar([k.beta for k in inside], [phi[k].value for k in inside], error, **style)
    axes.set_ylabel(r"packing fraction $\phi_J$")
    beta_axis(axes.xaxis)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8)


def draw_map(figure: Any, axes: Axes, A: Averages, phi: Averages) -> bool:
    """Draw phi_J as color; return whether there are contours."""
    from matplotlib.tri import TriAnalyzer, Triangulation  # noqa: PLC0415

    x = np.array([A[k].value for k in A])
    y = np.array([k.beta for k in A])
    z = np.array([phi[k].value for k in A])
    spread = np.ptp(x) > 0 and np.ptp(np.log(y)) > 0
    contours = len(x) >= ENOUGH and spread
    if contours:
        levels = np.arange(np.floor(z.min() * 100) / 100, z.max() + 0.01, 0.01)
        mesh = Triangulation(x / np.ptp(x), np.log(y) / np.ptp(np.log(y)))
        flat = TriAnalyzer(mesh).get_flat_tri_mask(LEAST_ROUND)
        mesh = Triangulation(x, y, mesh.triangles, flat)
        axes.tricontourf(mesh, z, levels, cmap="viridis", alpha=0.6)
        axes.tricontour(mesh, z, levels, colors="0.4", linewidths=0.5)
    dots = axes.scatter(x, y, c=z, cmap="viridis", s=60, edgecolors="k", linewidths=0.6, zorder=3)
    figure.colorbar(dots, ax=axes, label=r"$\phi_J$")
    axes.axhline(1, **OF_PAPER)
    axes.set_xlabel(r"asphericity $\mathcal{A}$")
    beta_axis(axes.yaxis)
    return bool(contours)


def draw(groups: Groups, out: Path) -> bool:
    """Draw both panels."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(9.5, 4.2), dpi=200, layout="constrained")
    left, right = figure.subplots(1, 2)
    A, phi = averages(groups, "asphericity"), averages(groups, "phi_J")
    draw_bands(left, A, phi)
    left.set_title(samples_text(groups), fontsize=9)
    contours = draw_map(figure, right, A, phi)
    figure.savefig(out)
    return contours


def main() -> None:
    """Read, average, draw, report."""
    parser = parser_of(__doc__, "shape_map.png")
    parser.add_argument("--protocol", type=int, choices=(1, 2), default=1, help="(%(default)s)")
    options = parser.parse_args()
    groups = only(read_groups(options.packings), lambda kind: kind.protocol == options.protocol)
    if not groups:
        msg = f"no packing is of protocol {options.protocol}, expected one"
        raise ValueError(msg)
    contours = draw(groups, options.out)
    columns = {name: averages(groups, name) for name in ("phi_J", "asphericity")}
    columns["beta"] = exactly(groups, lambda kind: kind.beta)
    found = {"out": str(options.out), "contours": contours, "shapes": rows(groups, columns)}
    print(json.dumps(found))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_shape_map.py: {error}")
