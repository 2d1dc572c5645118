"""Draw packings of superellipsoids: Figs. 2, 4 b, c and 8 b of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/draw_superellipsoids.py PACKING.h5 [MORE.h5 ...] --color C4 --out packings.png

Each particle whose centre is in the periodic box is drawn whole, seen from afar. Colors: local nematic (S2) or
cubatic (C4) order of the particles in contact, green to red as it grows, grey without contacts; orientation: the
direction of the axis that tells it, x, y, z as red, green, blue; one: the same for all of a packing. The last
line of standard output is one JSON object with what was measured.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from fig_shapes import COLORS
from shading import draw_packing, save_smooth, view
from superellipsoid_files import LOCAL_ORDER, local_order
from sweep_files import GREEN, RED, YELLOW, plain

from jamshape.arrays import FloatArray
from jamshape.files.h5md import read_attributes, read_packing
from jamshape.measures.order3d import directors
from jamshape.packing import Packing, body_axes
from jamshape.protocols.superellipsoid_jammed import order

COLUMNS, INCHES = 3, 3.4
UNKNOWN = 0.75  # grey
MANY = 250  # particles from which on meshes are coarser


class Picture(NamedTuple):
    """What is drawn in one panel."""

    packing: Packing
    title: str
    report: dict[str, Any]
    values: FloatArray
    """(N,) local order, or empty."""


def picture(path: Path, color: str) -> Picture:
    """Read and measure one packing.

    Raises
    ------
    ValueError
        If its particles are no superellipsoids in space.
    """
    packing = read_packing(path)
    if packing.dimension != 3 or packing.shape_style != "superellipsoid":
        kind = f"{packing.dimension}D and of {packing.shape_style}s"
        msg = f"{path}: is {kind}, expected 3D and of superellipsoids; draw.py draws others"
        raise ValueError(msg)
    stored, known = read_attributes(path), order(packing)
    values = local_order(packing)[color] if color in LOCAL_ORDER else np.empty(0)
    report: dict[str, Any] = {"packing": str(path), "n": packing.n, "phi": packing.phi} | known
    if len(values):
        report["mean_local"] = plain(float(np.nanmean(values))) if values.size else None
    a, b, c = np.sort(packing.diameters[0])
    shape = f"$p={packing.exponent[0]:g}$, $w_1={a / b:.3g}$, $w_2={c / b:.3g}$"
    protocol = f"protocol {stored['protocol']}, " if "protocol" in stored else ""
    numbers = rf"$\phi={packing.phi:.3f}$, $S_2={known['S2']:.2f}$, $C_4={known['C4']:.2f}$"
    return Picture(packing, f"{shape}\n{protocol}{numbers}", report, values)


def colors_of(shown: Picture, color: str, base: FloatArray, mapped: Any) -> FloatArray:
    """(N, 3) colors of the particles; `mapped` makes them of local order."""
    packing = shown.packing
    if color in LOCAL_ORDER:
        known = np.isfinite(shown.values)
        rgb = np.asarray(mapped(np.where(known, shown.values, 0.0)))[:, :3]
        return np.where(known[:, None], rgb, UNKNOWN)
    if color == "orientation":
        axes = body_axes(packing.quaternions)
        return np.asarray(0.1 + 0.85 * np.abs(directors(axes, packing.diameters / 2)))
    return np.tile(base, (packing.n, 1))


def draw(shown: list[Picture], options: Namespace) -> None:
    """Draw all packings, with one scale of color."""
    from matplotlib.cm import ScalarMappable  # noqa: PLC0415 - not needed for --help and for errors
    from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgb  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    columns = min(COLUMNS, len(shown))
    rows = -(-len(shown) // columns)
    ordered = options.color in LOCAL_ORDER
    figure = Figure(figsize=(INCHES * columns + 0.7 * ordered, 1.1 * INCHES * rows))
    figure.set_layout_engine("constrained", h_pad=0.06, w_pad=0.06)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    every = np.concatenate([picture.values for picture in shown])
    ends = (0.0, max(float(np.nanmax(every, initial=0.1)), 0.1)) if ordered else (0.0, 1.0)
    scale = LinearSegmentedColormap.from_list("order", [GREEN, YELLOW, RED])
    mapped = ScalarMappable(Normalize(*ends), scale)
    seen_from = view(options.height, options.turn)
    for k, (axes, one) in enumerate(zip(panels, shown, strict=False)):
        level = options.level or (3 if one.packing.n < MANY else 2)
        rgb = colors_of(
            one, options.color, np.array(to_rgb(COLORS[k % len(COLORS)])), mapped.to_rgba
        )
        draw_packing(axes, one.packing, rgb, seen_from, level)
        axes.set_title(one.title, fontsize=9, linespacing=1.4)
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    if ordered:
        bar = figure.colorbar(mapped, ax=list(panels), fraction=0.04, pad=0.02, shrink=0.8)
        bar.set_label(LOCAL_ORDER[options.color])
    save_smooth(figure, options.out, options.dpi)


def parse() -> Namespace:
    """Read the command line."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("packings", type=Path, nargs="+", metavar="PACKING", help="H5MD files")
    kinds = [*LOCAL_ORDER, "orientation", "one"]
    parser.add_argument("--color", choices=kinds, default="one", help="by what (%(default)s)")
    parser.add_argument(
        "--height", type=float, default=22, help="of the eye, degrees (%(default)s)"
    )
    parser.add_argument("--turn", type=float, default=-58, help="of it about z (%(default)s)")
    finer = "of the surfaces' meshes, 1 to 4; each makes four triangles of one (3, or 2 for many)"
    parser.add_argument("--level", type=int, choices=range(1, 5), help=finer)
    parser.add_argument("--out", type=Path, default=Path("packings.png"), help="(%(default)s)")
    parser.add_argument("--dpi", type=int, default=120, help="dots per inch (%(default)s)")
    return parser.parse_args()


def main(options: Namespace) -> None:
    """Read, measure, draw, report."""
    shown = [picture(path, options.color) for path in options.packings]
    draw(shown, options)
    print(json.dumps({"out": str(options.out), "packings": [one.report for one in shown]}))


if __name__ == "__main__":
    try:
        main(parse())
    except (OSError, ValueError) as error:
        sys.exit(f"draw_superellipsoids.py: {error}")
