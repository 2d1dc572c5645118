"""Draw flow curves, pressure against shear rate, and find the packing fraction at which the flow jams.

    python analysis/shear/flow_curves.py runs/shear/*.h5 --out flow_curves.png

Runs of `jamshape shear` of one kind of particles at several packing fractions and rates. To each packing fraction with
three rates p = p_0 + c gdot^b is fitted (Herschel & Bulkley; Marschall, Keta, Olsson & Teitel, Phys. Rev. Lett. 122, 188002
(2019)). phi_J of shear is where the line through the yield pressures p_0 begins, and where p/gdot diverges as
(phi_J - phi)^-beta below. The last line of standard output is one JSON object with all fits.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import ensemble_text, pressure_unit
from jamshape.measures.shears import Sheared, read_shear

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.flow_curves import FlowCurve, ShearOnset, curves_of, shear_onset, yielded

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def flow_curve_figure(curves: Sequence[FlowCurve], onset: ShearOnset, of: Sheared) -> Figure:
    """Draw p against the rate on the left, and p/gdot and p_0 against phi on the right."""
    from matplotlib import colormaps  # noqa: PLC0415 - not needed for --help and for errors

    figure = figure_of(9.5, 4.2, dpi=160)
    left, right = figure.subplots(1, 2)
    unit = pressure_unit([of.system])
    for curve, shade in zip(curves, np.linspace(0, 0.9, len(curves)), strict=True):
        _draw_curve(left, curve, colormaps["viridis"](shade))
    left.set(
        xscale="log",
        yscale="log",
        xlabel=r"rate $\dot\gamma$  $[1/t_0]$",
        ylabel=f"pressure $p$  ${unit}$",
    )
    left.legend(fontsize=7, ncols=2, title=r"lines: $p_0+c\,\dot\gamma^b$", title_fontsize=7)
    _draw_onset(right, curves, onset)
    figure.suptitle(f"{ensemble_text(of, ('n',))}, steady {of.flow} shear", fontsize=9)
    return figure


def _draw_curve(axes: Axes, curve: FlowCurve, tint: tuple[float, float, float, float]) -> None:
    label = rf"$\phi={curve.phi:.4g}$"
    axes.errorbar(
        curve.rates, curve.pressures, curve.errors, fmt="o", ms=4, color=tint, label=label
    )
    if np.isfinite(curve.yields):
        rate = np.geomspace(curve.rates[0] / 3, curve.rates[-1] * 1.5, 100)
        axes.plot(rate, curve.at(rate), "-", lw=0.8, color=tint)


def _draw_onset(axes: Axes, curves: Sequence[FlowCurve], onset: ShearOnset) -> None:
    phi = [curve.phi for curve in curves]
    eta = [curve.viscosity.value for curve in curves]
    axes.plot(phi, eta, "o-", color="C0", lw=0.8, ms=4, label=r"$p/\dot\gamma$ at the lowest rate")
    axes.set(yscale="log", xlabel=r"packing fraction $\phi$", ylabel=r"$p/\dot\gamma$")
    other = axes.twinx()
    above = yielded(curves)
    values = ([c.phi for c in above], [c.yields for c in above], [c.yields_error for c in above])
    other.errorbar(*values, fmt="s", color="C1", ms=4, label="yield pressure $p_0$")
    other.set_ylabel("$p_0$")
    for found, tint, text in (
        (onset.from_yield, "C1", "from $p_0$"),
        (onset.from_viscosity, "C0", r"from $p/\dot\gamma$"),
    ):
        if np.isfinite(found.value):
            axes.axvline(
                found.value, color=tint, ls="--", lw=0.9, label=rf"$\phi_J={found.tex}$ {text}"
            )
    handles, labels = axes.get_legend_handles_labels()
    more, names = other.get_legend_handles_labels()
    axes.legend(handles + more, labels + names, fontsize=7, loc="upper left")


def main(options: Namespace) -> None:
    """Read, fit, draw, report."""
    every = [read_shear(path, options.after) for path in options.files]
    runs = [one for one in every if one.steady]
    systems = {one.ensemble.system for one in runs}
    if len(systems) != 1:
        msg = (
            f"runs of {len(systems)} systems with a steady state were given, expected those of one"
        )
        raise ValueError(msg)
    curves = curves_of(runs)
    onset = shear_onset(curves)
    save_figure(flow_curve_figure(curves, onset, runs[0].ensemble), options.out)
    rows = [{"phi": c.phi, "p_0": c.yields, "p_0_error": c.yields_error, "c": c.factor, "b": c.power,
             "eta_p": c.viscosity.value} for c in curves]  # fmt: skip
    report({"out": options.out, **runs[0].ensemble.system.report(), "phi_J": onset, "curves": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "flow_curves.png", "RUN.h5")
    parser.add_argument("--after", type=float, help="strain from which to average (chosen)")
    run(parser, main)
