"""Shear at a constant normal pressure, and draw friction and packing fraction against the viscous number.

    python analysis/shear/viscous_number.py --alphas 0 4 --rates 1e-3 1e-4 1e-5 --folder runs/viscous --out viscous_number.png

Makes a run of `jamshape shear --pressure` for each aspect ratio and rate in the folder; the same command resumes what
was stopped. J = k_d d^2 gdot / p_yy with the diameter d = 1 of the small discs, friction is -p_xy / p_yy, both averages over
the steady state, as in Boyer, Guazzelli & Pouliquen, Phys. Rev. Lett. 107, 188301 (2011). The last line of standard
output is one JSON object with all averages and their errors.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import jamshape as js
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.styles import marked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from jamshape.measures.steady import SteadyMean


class Point(NamedTuple):
    """Averages of one run."""

    alpha: float
    gdot: float
    J: float
    friction: SteadyMean
    phi: SteadyMean


def point_of(alpha: float, gdot: float, options: Namespace) -> Point:
    """Make or resume a run, and average over its steady state."""
    particles = js.Spherocylinders(alpha=alpha)
    path = Path(options.folder) / f"alpha{alpha:g}_gdot{gdot:g}.h5"
    path.parent.mkdir(parents=True, exist_ok=True)
    made = js.shear(
        particles, n=options.n, gdot=gdot, strain=options.strain, pressure=options.pressure,
        integration_tolerance=1e-3, file=path,
    )  # fmt: skip
    steady = made.steady()
    return Point(alpha, gdot, gdot / steady["p_yy"].value, steady["friction"], steady["phi"])


def figure(points: Sequence[Point], pressure: float) -> Figure:
    """Draw friction on the left and the packing fraction on the right."""
    drawn = figure_of(8.0, 3.6, dpi=160)
    left, right = drawn.subplots(1, 2)
    for k, alpha in enumerate(sorted({point.alpha for point in points})):
        of = sorted((point for point in points if point.alpha == alpha), key=lambda point: point.J)
        for axes, means in ((left, [p.friction for p in of]), (right, [p.phi for p in of])):
            axes.errorbar(
                [p.J for p in of], [m.value for m in means], [m.error for m in means],
                label=rf"$\alpha={alpha:g}$", **marked(k, "-"),
            )  # fmt: skip
    for axes in (left, right):
        axes.set_xscale("log")
        axes.set_xlabel(r"viscous number $J=k_d d^2\dot\gamma/p_{yy}$")
    left.set_ylabel(r"friction $-p_{xy}/p_{yy}$")
    right.set_ylabel(r"packing fraction $\phi$")
    left.legend(frameon=False)
    drawn.suptitle(rf"simple shear at $p_{{yy}}={pressure:g}$; bars: standard errors", fontsize=9)
    return drawn


def main(options: Namespace) -> None:
    """Shear, average, draw, report."""
    points = [point_of(alpha, gdot, options) for alpha in options.alphas for gdot in options.rates]
    save_figure(figure(points, options.pressure), options.out)
    rows = [
        {"alpha": p.alpha, "gdot": p.gdot, "J": p.J, "friction": p.friction.value,
         "friction_error": p.friction.error, "phi": p.phi.value, "phi_error": p.phi.error}
        for p in points
    ]  # fmt: skip
    report({"out": options.out, "pressure": options.pressure, "points": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "viscous_number.png")
    parser.add_argument("--alphas", type=float, nargs="+", default=[0.0, 4.0], help="aspect ratios")
    parser.add_argument(
        "--rates", type=float, nargs="+", default=[1e-3, 1e-4, 1e-5], help="shear rates, [1/time]"
    )
    parser.add_argument("--pressure", type=float, default=1e-3, help="normal pressure to hold")
    parser.add_argument("--n", type=int, default=64, help="number of particles")
    parser.add_argument("--strain", type=float, default=4.0, help="strain of each run")
    parser.add_argument("--folder", default="runs/viscous", help="folder of the runs")
    run(parser, main)
