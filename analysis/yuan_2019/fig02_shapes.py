"""Draw superellipsoids: the nine shapes of Fig. 2 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/fig_shapes.py --out shapes.png
    python analysis/fig_shapes.py --shape 0.75 0.4 1 --shape 2 1 1.5 --out shapes.png

A shape is p, w1 = a/b and w2 = c/b; all are drawn with the same volume, the shortest axis upright. A is the
asphericity and beta the reduced aspect ratio. The last line of standard output is one JSON object with these
numbers.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import ConvexHull
from shading import lit, mean_normals, view

from jamshape.arrays import FloatArray
from jamshape.shapes.roundness import (
    asphericity,
    axes_from,
    reduced_aspect_ratio,
    surface_area,
    volume,
)
from jamshape.shapes.superellipsoid_surface import SurfaceMesh, surface_mesh

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Shape = tuple[float, float, float]

PAPER_SHAPES: list[Shape] = [
    (1, 0.3, 1), (1, 1, 3), (1, 0.8, 1.25), (1, 0.6, 2.36), (2, 1, 1),
    (0.75, 0.4, 1), (0.85, 0.7, 2), (1.5, 0.5, 1.5), (2, 1, 1.5),
]  # fmt: skip
NAMES: dict[Shape, str] = {
    (1, 0.3, 1): "oblate ellipsoid",
    (1, 1, 3): "prolate ellipsoid",
    (1, 0.8, 1.25): "self-dual ellipsoid",
    (1, 0.6, 2.36): "general ellipsoid",
    (2, 1, 1): "superball",
}
COLORS = [
    "#4fa3a5",
    "#e07b53",
    "#7b8fc7",
    "#c76f9b",
    "#8ab54a",
    "#d9a832",
    "#5c9ad1",
    "#9a7fc0",
    "#d0685f",
]
COLUMNS, INCHES = 3, 2.6
REACH = 2.15  # half width of what is shown, in radii of the sphere of the same volume
LEVEL = 4


VIEW = view(28, -55)


def body(shape: Shape) -> SurfaceMesh:
    """Cover a shape with the volume of a unit sphere; the longest axis is x, the shortest z."""
    p, w1, w2 = shape
    axes = axes_from(w1, w2)
    axes = axes * np.cbrt(4 * np.pi / 3 / volume(axes, p))
    return surface_mesh(axes[::-1], p, LEVEL)


def draw_body(axes: Axes, mesh: SurfaceMesh, color: FloatArray) -> None:
    """Draw one body as it looks from afar: convex, so that what faces the eye is seen."""
    from matplotlib.collections import PolyCollection  # noqa: PLC0415 - not needed for --help

    normals = mean_normals(mesh)
    seen = normals @ VIEW.eye > -0.1
    flat = VIEW.flat(mesh.vertices)
    faces = lit(color, normals[seen], VIEW)
    # Smoothed, neighbours would leave a line between them; the outline hides their steps.
    axes.add_collection(
        PolyCollection(list(flat[mesh.triangles[seen]]), facecolors=faces, lw=0, antialiaseds=False)
    )
    outline = flat[ConvexHull(flat).vertices]
    axes.fill(*outline.T, fill=False, ec=0.35 * color, lw=0.9, joinstyle="round")
    axes.set(xlim=(-REACH, REACH), ylim=(-0.78 * REACH, 0.7 * REACH), aspect="equal")
    axes.set_axis_off()


def measure(shape: Shape) -> dict[str, Any]:
    """Asphericity, reduced aspect ratio and, of a = 1, volume and surface area of a shape."""
    p, w1, w2 = shape
    axes = axes_from(w1, w2)
    return {
        "p": p,
        "w1": w1,
        "w2": w2,
        "asphericity": float(asphericity(axes, p)),
        "beta": float(reduced_aspect_ratio(axes)),
        "volume": float(volume(axes, p)),
        "area": float(surface_area(axes, p).area),
    }


def draw(shapes: list[Shape], out: Path, dpi: int) -> list[dict[str, Any]]:
    """Draw all shapes; return what was measured."""
    from matplotlib.colors import to_rgb  # noqa: PLC0415 - not needed for --help and for errors
    from matplotlib.figure import Figure  # noqa: PLC0415

    columns = min(COLUMNS, len(shapes))
    rows = -(-len(shapes) // columns)
    size = (INCHES * columns, 0.93 * INCHES * rows)
    figure = Figure(figsize=size, dpi=dpi)
    figure.set_layout_engine("constrained", h_pad=0.08, w_pad=0.04)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    report = [measure(shape) for shape in shapes]
    for k, (axes, shape, known) in enumerate(zip(panels, shapes, report, strict=False)):
        draw_body(axes, body(shape), np.array(to_rgb(COLORS[k % len(COLORS)])))
        text = f"({chr(ord('a') + k % 26)}) {NAMES.get(shape, 'superellipsoid')}\n"
        text += "$p={:g}$,  $w_1={:g}$,  $w_2={:g}$\n".format(*shape)
        text += rf"$\mathcal{{A}}={known['asphericity']:.4f}$,  $\beta={known['beta']:.3g}$"
        axes.set_title(text, fontsize=9, linespacing=1.4)
    for axes in panels[len(shapes) :]:
        axes.set_axis_off()
    figure.savefig(out, pil_kwargs={"optimize": True})
    return report


def main() -> None:
    """Draw and report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    which = "p, w1 and w2; may be given several times (the nine of the paper)"
    parser.add_argument(
        "--shape", type=float, nargs=3, action="append", metavar=("P", "W1", "W2"), help=which
    )
    parser.add_argument("--out", type=Path, default=Path("shapes.png"), help="(%(default)s)")
    parser.add_argument("--dpi", type=int, default=110, help="dots per inch (%(default)s)")
    options = parser.parse_args()
    shapes = [(p, w1, w2) for p, w1, w2 in options.shape or PAPER_SHAPES]
    report = draw(shapes, options.out, options.dpi)
    print(json.dumps({"out": str(options.out), "shapes": report}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_shapes.py: {error}")
