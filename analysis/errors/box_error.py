"""Error of the stress and residual force against run time, of packings in boxes that yield freely to a pressure.

    python analysis/errors/box_error.py --n 64 --out box_error.png

Discs and rods of alpha = 4 in 2D, spheroids in 3D. A packing at an energy, in a box that changed its volume only and so with a shear
stress, is led to each pressure in a free box. After every step of the box are recorded: the largest difference of the pressure tensor to p 1, over p;
the largest net force and torque over the mean force of a bond; and the seconds so far in which the processor was busy. A curve is the smallest
value so far of the larger one of both errors. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import json
import sys
import time
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from studies.shown import figure_of, markdown

import jamshape as js
from jamshape.arrays import FloatArray
from jamshape.command import parser_of, plain, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.disk import store
from jamshape.landscape import Landscape, State
from jamshape.minima.boxes import FREE, Settling, Yielding, advance
from jamshape.minima.target import TargetError
from jamshape.shapes.particles import Particles

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.styles import color

if TYPE_CHECKING:
    from matplotlib.figure import Figure

U0 = 1e-8  # of the starts
LEVELS = (1e-2, 1e-4, 1e-6, 1e-8)  # of errors in the table
LEAST = 1e-16  # on the axes


class Shape(NamedTuple):
    """Particles of a panel."""

    particles: Particles
    dimension: int
    label: str


SHAPES = (
    Shape(js.Spherocylinders(alpha=0), 2, r"spherocylinders in 2D, $\alpha=0$"),
    Shape(js.Spherocylinders(alpha=4), 2, r"spherocylinders in 2D, $\alpha=4$"),
    Shape(js.Superellipsoids(w1=0.7), 3, r"superellipsoids in 3D, $w_1=0.7$"),
)


class Curve(NamedTuple):
    """What was found after each step of the box."""

    shape: str
    pressure: float
    outcome: str
    seconds: FloatArray
    stress: FloatArray
    residual: FloatArray

    def until(self, level: float) -> float:
        """Seconds after which the stress error is smaller; NaN if it never is."""
        reached = self.seconds[self.stress <= level]
        return float(reached[0]) if len(reached) else np.nan


def curve_of(label: str, start: js.Packing, pressure: float) -> Curve:
    """Lead a packing to a pressure, and record errors."""
    landscape, at = Landscape(start), Settling(State.of(start))
    goal, rows, outcome = Yielding(FREE, pressure=pressure), [], "reached"
    began = time.process_time()
    measuring = 0.0  # is not counted
    while not at.done:
        try:
            advance(landscape, at, goal)
        except TargetError:
            outcome = "not reached"
            break
        now = time.process_time()
        assert at.present is not None
        off = landscape.stress(at.present.state) - pressure * np.eye(start.dimension)
        error = float(np.abs(off).max()) / pressure
        rows.append((now - began - measuring, error, at.present.residual.largest))
        measuring += time.process_time() - now
    return Curve(label, pressure, outcome, *np.array(rows).T)


def figure_from(curves: list[Curve], n: int) -> Figure:
    """Draw a panel for each shape."""
    shapes = list(dict.fromkeys(of.shape for of in curves))
    figure: Figure = figure_of(3.6 * len(shapes), 3.9)
    panels = figure.subplots(1, len(shapes), squeeze=False, sharey=True)[0]
    for axes, name in zip(panels, shapes, strict=True):
        own = [of for of in curves if of.shape == name]
        for k, of in enumerate(own):
            larger = np.maximum(of.stress, of.residual)
            best = np.maximum(np.minimum.accumulate(larger), LEAST)
            label = f"$p=10^{{{np.log10(of.pressure):.0f}}}$"
            axes.step(of.seconds, best, where="post", lw=1, color=color(k), label=label)
        axes.axhline(1e-8, color="0.6", lw=0.8, ls=":")
        axes.set(xscale="log", yscale="log", xlabel="core seconds")
        axes.set_title(f"{name}, $N={n}$", fontsize=9)
    panels[0].set_ylabel("relative error")
    panels[0].legend(fontsize=7)
    figure.suptitle(
        f"boxes of variable shape brought to $p$ from $u_0=${U0:g}: the larger of the error of the pressure tensor over $p$"
        "\nand of the largest net force over the mean force of a bond, smallest so far; dotted: required",
        fontsize=9,
    )
    return figure


def formatted(seconds: float) -> str:
    """Format seconds, or that there are none."""
    return f"{seconds:.2g} s" if np.isfinite(seconds) else "-"


def table_of(curves: list[Curve]) -> str:
    """Write a line for each curve: seconds to stress errors."""
    heads = (
        "particles",
        "p",
        *(f"to {level:g}" for level in LEVELS),
        "steps",
        "stress error",
        "residual",
        "outcome",
    )
    return markdown(
        heads,
        [
            (of.shape, f"{of.pressure:g}", *map(formatted, map(of.until, LEVELS)),
             str(len(of.seconds)), f"{of.stress[-1]:.1e}", f"{of.residual[-1]:.1e}", of.outcome)
            for of in curves
        ],
    )  # fmt: skip


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "box_error.png")
    found.add_argument("--n", type=int, default=64)
    found.add_argument("--seed", type=int, default=1)
    found.add_argument("--pressures", type=float, nargs="+", default=[1e-2, 1e-4, 1e-6, 1e-8])
    return found


def main(options: Namespace) -> None:
    """Measure, draw, report."""
    curves = []
    for shape in SHAPES:
        settings: dict[str, Any] = {
            "dimension": shape.dimension,
            "n": options.n,
            "seed": options.seed,
        }
        start = js.make_packing(shape.particles, u0=U0, progress=False, **settings)
        curves += [curve_of(shape.label, start, p) for p in options.pressures]
    save_figure(figure_from(curves, options.n), options.out)
    print(table_of(curves))
    store(options.out.with_suffix(".json"), f"{json.dumps(plain(curves), indent=1)}\n".encode())
    named = [
        {"name": f"p = {of.pressure:g}, {of.shape}", "seconds": of.seconds, "error": of.stress}
        for of in curves
    ]
    report({"out": options.out, "n": options.n, "curves": named})


if __name__ == "__main__":
    run(parser(), main)
