"""Time in which a box yields to a normal pressure: the slowest relaxation of packings, and shears with slower boxes.

    python analysis/stress/box_time.py --runs runs/stress/box_time --out box_time.png

Left: the slowest relaxation time of packings of discs and rods in free boxes, 1 / the smallest eigenvalue of the dynamical
matrix, against pressure, and k_d d^2 / p, d the diameter of a disc of the mean area. Right: packing fraction of
sheared discs against strain, with t_box equal to multiples of its default. The last line of standard output is
one JSON object with these times, and averages over the strains beyond 1. The same command resumes runs that it began.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jamshape as js
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.styles import color, marked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AFTER = 1.0
"""Strain from which averages are taken."""


def slowest(alpha: float, p: float, options: Namespace) -> dict[str, float]:
    """Make packings at a pressure; return their mean slowest relaxation time, and k_d d^2 / p, for k_d = 1."""
    found = []
    for seed in range(1, options.samples + 1):
        path = options.runs / f"a{alpha:g}_n{options.n}_p{p:g}_seed{seed}.h5"
        packing = js.make_packing(js.Spherocylinders(alpha=alpha), n=options.n, seed=seed, pressure=p, stable_to_shear=True,
                                  file=path, progress=False)  # fmt: skip
        modes = js.modes(packing)
        # Eigenvalues in the metric of areas and moments are relaxation rates.
        eigenvalues = modes.omega[modes.vibrational] ** 2
        found.append(1 / float(eigenvalues[eigenvalues > 0].min()))
    return {
        "alpha": alpha, "p": p, "slowest": math.exp(sum(map(math.log, found)) / len(found)),
        "expected": 4 * float(packing.measures.mean()) / (math.pi * p),
    }  # fmt: skip


def sheared(factor: float, usual: float, options: Namespace) -> js.ShearFile:
    """Shear discs with a multiple of the default time."""
    path = options.runs / f"shear_n{options.n}_times{factor:g}.h5"
    return js.shear(
        js.Spherocylinders(alpha=0), n=options.n, gdot=options.gdot, strain=options.strain, pressure=options.pressure,
        t_box=None if factor == 1 else factor * usual, frames=2, file=path, progress=False,
    )  # fmt: skip


def averages_of(factor: float, made: js.ShearFile) -> dict[str, Any]:
    """Average over the strains beyond the start-up."""
    steady, p = made.steady(after=AFTER), made.about["hold_pressure"]
    rows = made["p_yy"][made.strain >= AFTER]
    means = {name: steady[name] for name in ("phi", "friction")}
    found: dict[str, Any] = {"factor": factor, "t_box": made.about["box_time"]}
    for name, mean in means.items():
        found |= {name: mean.value, f"{name}_error": mean.error}
    return found | {"p_yy_over_p": float(rows.mean() / p), "spread_over_p": float(rows.std() / p)}


def figure(times: list[dict[str, float]], shears: dict[float, js.ShearFile]) -> Figure:
    """Draw relaxation times on the left and packing fractions on the right."""
    drawn = figure_of(8.0, 3.6, dpi=160)
    left, right = drawn.subplots(1, 2)
    for k, alpha in enumerate(sorted({one["alpha"] for one in times})):
        of = [one for one in times if one["alpha"] == alpha]
        p = [one["p"] for one in of]
        left.errorbar(p, [one["slowest"] for one in of], label=rf"$\alpha={alpha:g}$", **marked(k))
        left.plot(p, [one["expected"] for one in of], color=color(k), lw=1)
    left.set(
        xscale="log",
        yscale="log",
        xlabel="pressure $p$",
        ylabel="slowest relaxation time; line: $k_d d^2/p$",
    )
    for factor, made in shears.items():
        right.plot(made.strain, made.phi, lw=1, label=rf"${factor:g}\,t_\mathrm{{box}}$")
    right.set(xlabel=r"strain $\gamma$", ylabel=r"packing fraction $\phi$")
    for axes in (left, right):
        axes.legend(frameon=False, fontsize=8)
    return drawn


def main(options: Namespace) -> None:
    """Make packings and shears, draw, report."""
    options.runs.mkdir(parents=True, exist_ok=True)
    times = [slowest(alpha, p, options) for alpha in options.alphas for p in options.pressures]
    usual = sheared(1, math.nan, options)
    time = float(usual.about["box_time"])
    shears = {factor: usual if factor == 1 else sheared(factor, time, options) for factor in options.factors}  # fmt: skip
    save_figure(figure(times, shears), options.out)
    rows = [averages_of(factor, made) for factor, made in shears.items()]
    report({"out": options.out, "times": times, "shears": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "box_time.png")
    parser.add_argument("--alphas", type=float, nargs="+", default=[0.0, 1.0], help="aspect ratios")
    parser.add_argument(
        "--pressures", type=float, nargs="+", default=[1e-2, 1e-3, 1e-4, 1e-5], help="of packings"
    )
    parser.add_argument("--samples", type=int, default=4, help="number of packings at each")
    parser.add_argument("--n", type=int, default=128, help="number of particles")
    parser.add_argument("--gdot", type=float, default=1e-4, help="shear rate, [1/time]")
    parser.add_argument("--strain", type=float, default=4.0, help="strain of each shear")
    parser.add_argument("--pressure", type=float, default=1e-3, help="normal pressure to hold")
    parser.add_argument(
        "--factors", type=float, nargs="+", default=[0.1, 1.0, 10.0, 100.0, 1000.0],
        help="multiples of the default time",
    )  # fmt: skip
    parser.add_argument(
        "--runs", type=Path, default=Path("runs/stress/box_time"), help="folder of the runs"
    )
    run(parser, main)
