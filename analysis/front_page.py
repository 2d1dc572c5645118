"""Draw the strip of pictures of the front page: packings of four shapes, a sheared packing, a mode.

    python analysis/front_page.py --out docs/pictures

Each picture is a PNG of 360 x 360 pixels, `front_rods.png` and so on. Nothing is kept but the pictures. The last line of
standard output is one JSON object: the packing fraction of each packing, and the frequency of the mode.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import jamshape as js
from jamshape.command import parser_of, report, run
from jamshape.files.disk import replacing

if TYPE_CHECKING:
    from argparse import Namespace

    from matplotlib.axes import Axes

INCHES, DPI = 2.4, 150
COLORS = 64  # of a palette
ARROW = 2.0  # longest arrow of the mode, in diameters of the smallest disc


def packings() -> dict[str, tuple[js.Packing, str]]:
    """Make the packings of the pictures; returns each with the quantity that colours its particles."""

    def made(particles: js.Particles, n: int, u0: float = 1e-8) -> js.Packing:
        return js.make_packing(particles, n=n, seed=1, u0=u0, progress=False)

    return {
        "rods": (made(js.Spherocylinders(alpha=4), 64), "orientation"),
        "superballs": (made(js.Superellipsoids(p=2.0), 150), "one"),
        "bumpy": (made(js.Clumps(discs=js.bumpy_discs(8, depth=0.3)), 64), "kind"),
        "polygons": (
            made(js.Spheropolygons(corners=js.regular_polygon(5), rounding=0.15), 64),
            "kind",
        ),
    }


def draw_shear(axes: Axes) -> js.Packing:
    """Draw the stress of ellipses under quasistatic shear; returns the packing from which it starts."""
    ellipses = js.Superellipsoids(w1=0.6)
    start = js.make_packing(ellipses, n=48, dimension=2, seed=1, u0=1e-5, progress=False)
    sheared = js.quasistatic_shear(start=start, step=1e-3, strain=0.3, progress=False)
    axes.plot(sheared.strain, 1e4 * sheared.stress)
    axes.set_xlabel(r"strain $\gamma$", fontsize=8)
    axes.set_ylabel(r"stress $-p_{xy}$ [$10^{-4}\,k_e/a^2$]", fontsize=8)
    axes.tick_params(labelsize=7)
    return start


def draw_mode(axes: Axes) -> float:
    """Draw the displacements of the softest mode of discs; returns its frequency."""
    discs = js.make_packing(
        js.Spherocylinders(alpha=0), n=150, seed=1, u0=1e-8, phi_start=0.5, progress=False
    )
    modes = js.modes(discs)
    softest = int(modes.vibrational[0])
    shift, _ = modes.coordinates.motion(modes.vectors[:, softest])
    js.plot(discs, axes, color="one")
    for patches in axes.collections:
        patches.set_alpha(0.35)
    place = discs.box.lo + discs.box.wrapped(discs.position)[0]
    longest = np.linalg.norm(shift, axis=1).max() / (ARROW * 2 * discs.radius.min())
    arrows = {"angles": "xy", "scale_units": "xy", "scale": longest, "width": 0.009, "zorder": 3}
    axes.quiver(*place.T, *shift.T, **arrows)
    return float(modes.omega[softest])


def save(figure: Figure, folder: Path, name: str) -> None:
    """Save a picture of the strip in few colours, so that the page loads fast."""
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    picture = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    path = folder / f"front_{name}.png"
    with replacing(path) as temporary:
        picture.quantize(COLORS).save(temporary, format="PNG", optimize=True)


def square(*, with_labels: bool = False) -> tuple[Figure, Axes]:
    """Return a figure of the strip and its axes, which fill it or leave space for labels."""
    figure = Figure(figsize=(INCHES, INCHES), dpi=DPI)
    place = (0.2, 0.17, 0.77, 0.8) if with_labels else (0.02, 0.02, 0.96, 0.96)
    return figure, figure.add_axes(place)


def main(options: Namespace) -> None:
    """Draw and save all pictures."""
    found = {}
    for name, (packing, color) in packings().items():
        figure, axes = square()
        js.plot(packing, axes, color=color)
        clean(figure)
        save(figure, Path(options.out), name)
        found[f"phi_{name}"] = packing.phi
    figure, axes = square(with_labels=True)
    found["phi_shear"] = draw_shear(axes).phi
    save(figure, Path(options.out), "shear")
    figure, axes = square()
    found["omega_mode"] = draw_mode(axes)
    clean(figure)
    save(figure, Path(options.out), "mode")
    report(found)


def clean(figure: Figure) -> None:
    """Leave the particles alone: no title, legend or axis."""
    for axes in figure.axes:
        axes.set_title("")
        axes.set_axis_off()
        if legend := axes.get_legend():
            legend.remove()


if __name__ == "__main__":
    run(parser_of(__doc__, "docs/pictures"), main)
