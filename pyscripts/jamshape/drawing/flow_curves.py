"""Flow curves: pressure against shear rate, and viscosity and yield pressure against packing fraction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from jamshape.drawing.text import ensemble_text, pressure_unit
from jamshape.measures.flow_curves import yielded

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from jamshape.measures.flow_curves import FlowCurve, ShearOnset
    from jamshape.measures.shears import Sheared


def flow_curve_figure(curves: Sequence[FlowCurve], onset: ShearOnset, of: Sheared) -> Figure:
    """Draw p against the rate on the left, and p/gdot and p_0 against phi on the right."""
    from matplotlib import colormaps  # noqa: PLC0415 - not needed for --help and for errors
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(9.5, 4.2), dpi=160, layout="constrained")
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
