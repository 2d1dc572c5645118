"""The modes of one packing in a figure: density of states, participation and kinds of motion."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from jamshape.drawing.styles import BLUE, GREEN, ORANGE, RED
from jamshape.drawing.text import unit_text
from jamshape.vibration.sets import Key, key_of
from jamshape.vibration.statistics import density_of_states, mean_in_bins
from jamshape.vibration.table import ModeTable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Style and label of each kind of motion.
COMPONENTS = {
    "rotation": ("o-", BLUE, r"$u_\theta^2$, rotation"),
    "parallel": ("s-", RED, r"$u_\parallel^2$, along the axis"),
    "perpendicular": ("D-", GREEN, r"$u_\perp^2$, across it"),
    "of_round": ("^-", ORANGE, r"$u^2$ of particles without such an axis"),
}


def frequency_unit(keys: Iterable[Key]) -> str:
    """Return the unit of frequencies in TeX, without dollars."""
    return rf"[\sqrt{{k_e}}\,/\,{unit_text(key.system for key in keys)}]"


def draw_density(axes: Axes, table: ModeTable) -> None:
    """Draw the density of frequencies of stable modes."""
    bins = density_of_states(table["omega"][~table["is_translation"]])
    filled = bins.n_modes > 0
    axes.loglog(bins.omega[filled], bins.density[filled], "o", mfc="none")
    unit = frequency_unit([key_of(table)])
    axes.set(xlabel=rf"frequency $\omega$  ${unit}$", ylabel=r"density of states $D(\omega)$")


def mode_figure(table: ModeTable, title: str) -> Figure:
    """Draw the density of states, the participation ratio and the kinds of motion over frequency."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed where nothing is drawn

    omega = table["omega"]
    bins = density_of_states(omega[~table["is_translation"]])
    figure = Figure(figsize=(6, 8), dpi=150, layout="constrained")
    top, middle, bottom = figure.subplots(3, 1, sharex=True)
    draw_density(top, table)
    top.set_title(title)
    frequency = top.get_xlabel()
    top.set_xlabel("")
    participation = mean_in_bins(table["participation"], omega, bins.edges)
    middle.loglog(bins.omega, participation, "o", mfc="none")
    middle.set_ylabel(r"participation $P(\omega)$")
    for kind, (marker, color, label) in COMPONENTS.items():
        if table[kind].any():
            values = mean_in_bins(table[kind], omega, bins.edges)
            bottom.semilogx(bins.omega, values, marker[0], color=color, mfc="none", label=label)
    bottom.set(xlabel=frequency, ylabel="share of the motion")
    bottom.legend()
    return figure
