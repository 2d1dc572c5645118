"""Draw superellipsoids: the nine shapes of Fig. 2 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/yuan_2019/fig02_shapes.py --out shapes.png
    python analysis/yuan_2019/fig02_shapes.py --shape 0.75 0.4 1 --shape 2 1 1.5 --out shapes.png

A shape is p, w1 = a/b and w2 = c/b; all are drawn with the same volume, the shortest axis upright. A is the
asphericity and beta the reduced aspect ratio. The last line of standard output is one JSON object with these
numbers.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import ConvexHull

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.space import lit, mean_normals, view
from jamshape.shapes.mesh import SurfaceMesh
from jamshape.shapes.roundness import (
    asphericity,
    axes_from,
    reduced_aspect_ratio,
    surface_area,
    volume,
)

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.families import NEEDS, with_three_axes
from common.styles import BODIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Numbers = tuple[float, float, float]
"""p, w1 and w2."""

PAPER_SHAPES: list[Numbers] = [
    (1, 0.3, 1), (1, 1, 3), (1, 0.8, 1.25), (1, 0.6, 2.36), (2, 1, 1),
    (0.75, 0.4, 1), (0.85, 0.7, 2), (1.5, 0.5, 1.5), (2, 1, 1.5),
]  # fmt: skip
NAMES: dict[Numbers, str] = {
    (1, 0.3, 1): "oblate ellipsoid",
    (1, 1, 3): "prolate ellipsoid",
    (1, 0.8, 1.25): "self-dual ellipsoid",
    (1, 0.6, 2.36): "general ellipsoid",
    (2, 1, 1): "superball",
}
COLUMNS, INCHES = 3, 2.6
REACH = 2.15  # half width of what is shown, in radii of the sphere of the same volume
LEVEL = 4
VIEW = view(28, -55)


def body(numbers: Numbers) -> SurfaceMesh:
    """Cover a shape with the volume of a unit sphere; the longest axis is x, the shortest z."""
    p, w1, w2 = numbers
    axes = axes_from(w1, w2)
    scale = np.cbrt(4 * np.pi / 3 / volume(axes, p))
    return with_three_axes().surface(2 * scale * axes[::-1], np.array([p]), LEVEL)


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


def measure(numbers: Numbers) -> dict[str, Any]:
    """Asphericity, reduced aspect ratio and, of a = 1, volume and surface area of a shape."""
    p, w1, w2 = numbers
    axes = axes_from(w1, w2)
    return dict(zip(NEEDS, numbers, strict=True)) | {
        "asphericity": float(asphericity(axes, p)),
        "beta": float(reduced_aspect_ratio(axes)),
        "volume": float(volume(axes, p)),
        "area": float(surface_area(axes, p).area),
    }


def draw(shapes: list[Numbers], found: list[dict[str, Any]], options: Namespace) -> None:
    """Draw all shapes with what was measured."""
    from matplotlib.colors import to_rgb  # noqa: PLC0415 - not needed for --help and for errors
    from matplotlib.figure import Figure  # noqa: PLC0415

    columns = min(COLUMNS, len(shapes))
    rows = -(-len(shapes) // columns)
    figure = Figure(figsize=(INCHES * columns, 0.93 * INCHES * rows), dpi=options.dpi)
    figure.set_layout_engine("constrained", h_pad=0.08, w_pad=0.04)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for k, (axes, numbers, known) in enumerate(zip(panels, shapes, found, strict=False)):
        draw_body(axes, body(numbers), np.array(to_rgb(BODIES[k % len(BODIES)])))
        text = f"({chr(ord('a') + k % 26)}) {NAMES.get(numbers, with_three_axes().name)}\n"
        text += "$p={:g}$,  $w_1={:g}$,  $w_2={:g}$\n".format(*numbers)
        text += rf"$\mathcal{{A}}={known['asphericity']:.4f}$,  $\beta={known['beta']:.3g}$"
        axes.set_title(text, fontsize=9, linespacing=1.4)
    for axes in panels[len(shapes) :]:
        axes.set_axis_off()
    save_figure(figure, options.out, pil_kwargs={"optimize": True})


def main(options: Namespace) -> None:
    """Measure, draw and report."""
    shapes = [(p, w1, w2) for p, w1, w2 in options.shape or PAPER_SHAPES]
    found = [measure(numbers) for numbers in shapes]
    draw(shapes, found, options)
    report({"out": options.out, "shapes": found})


if __name__ == "__main__":
    parser = parser_of(__doc__, "shapes.png")
    which: dict[str, Any] = {"nargs": 3, "action": "append", "metavar": ("P", "W1", "W2")}
    which["help"] = "p, w1 and w2; may be given several times (the nine of the paper)"
    parser.add_argument("--shape", type=float, **which)
    parser.add_argument("--dpi", type=int, default=110, help="dots per inch (%(default)s)")
    run(parser, main)
