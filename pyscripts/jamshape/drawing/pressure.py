"""Pressure against packing fraction, with its onset and the bracket of jamming."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from jamshape.drawing.text import ensemble_text, onset_symbol, pressure_unit
from jamshape.measures.averages import Mean

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from jamshape.measures.runs import Run


def draw_pressure(axes: Axes, run: Run, color: str = "C0") -> None:
    """Draw the pressure of a run and the line that defines its onset, with a legend."""
    axes.plot(run.phi, run.pressure, ".-", color=color, ms=3, lw=0.5, label="pressure")
    draw_onset(axes, run, color, f"line to the onset at this rate, {onset_text(run)}")
    draw_jamming(axes, run, "C2")
    # Overlaps of a fast start relax first, with a pressure that may exceed all later ones.
    begun = run.pressure[int(np.argmin(run.pressure)) :]
    if begun.max() > 0:
        axes.set_ylim(-0.03 * begun.max(), 1.3 * begun.max())
    unit = pressure_unit([run.ensemble.system])
    axes.set(xlabel=r"packing fraction $\phi$", ylabel=rf"pressure $p$  ${unit}$")
    axes.set_title(ensemble_text(run.ensemble), size=9)
    axes.legend(loc="upper left", fontsize=8)


def draw_onset(axes: Axes, run: Run, color: str, label: str = "") -> None:
    """Draw the onset of a run, if it has one, and the line fitted to its pressure."""
    fit = run.fit
    if fit:
        rise = fit.slope * (run.phi[fit.last] - fit.phi_J)
        axes.plot([fit.phi_J, run.phi[fit.last]], [0, rise], "k", lw=1, zorder=3)
        axes.plot(fit.phi_J, 0, "o", color=color, mec="k", ms=5, zorder=4, ls="", label=label)


def draw_jamming(axes: Axes, run: Run, color: str, name: str = "") -> None:
    """Draw the packing fractions between which minimised frames begin to stay jammed, if known."""
    found = run.jamming
    if found is None or math.isnan(found.unjams) or math.isnan(found.jams):
        return
    low, high = (rf"$\phi={phi:.4f}$" for phi in found[:2])
    text = f"{name}minimised: {low} unjams, {high} stays jammed"
    axes.axvspan(found.unjams, found.jams, color=color, alpha=0.25, lw=0, label=text)


def onset_text(run: Run) -> str:
    """Write the onset of a run, at its rate."""
    symbol = onset_symbol(run.ensemble.kappa)
    return f"${symbol}={Mean(*run.fit[:2]).tex}$" if run.fit else f"no ${symbol}$"
