"""Pressure against packing fraction, with the onset of jamming."""

from __future__ import annotations

from typing import TYPE_CHECKING

from jamshape.drawing.text import ensemble_text, pressure_unit, scientific
from jamshape.measures.averages import Mean

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from jamshape.measures.runs import Run


def draw_pressure(axes: Axes, run: Run, color: str = "C0") -> None:
    """Draw the pressure of a run and the line that leads to its onset, and say what they are."""
    axes.plot(run.phi, run.pressure, ".-", color=color, ms=3, lw=0.5, label="pressure")
    if run.fit:
        draw_onset(axes, run, color)
    unit = pressure_unit([run.ensemble.system])
    axes.set(xlabel=r"packing fraction $\phi$", ylabel=rf"pressure $p$  ${unit}$")
    axes.set_title(ensemble_text(run.ensemble), size=9)
    axes.legend(loc="upper left", fontsize=8)


def draw_onset(axes: Axes, run: Run, color: str) -> None:
    """Draw the line from the onset through the pressure, which the run must have."""
    fit = run.fit
    assert fit is not None
    rise = fit.slope * (run.phi[fit.last] - fit.phi_J)
    found = Mean(*fit[:2]).tex
    rate = scientific(run.ensemble.kappa)
    text = rf"onset at this rate, $\phi_J(\kappa={rate})={found}$"
    axes.plot(
        [fit.phi_J, run.phi[fit.last]], [0, rise], "k", lw=1, zorder=3, label="line to the onset"
    )
    axes.plot(fit.phi_J, 0, "o", color=color, mec="k", ms=5, zorder=4, ls="", label=text)
