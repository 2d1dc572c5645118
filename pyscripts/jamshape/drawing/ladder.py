"""Contacts of a packing against its energy or pressure."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from jamshape.drawing.text import pressure_unit, systems_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from jamshape.arrays import FloatArray, IntArray
    from jamshape.files.ensembles import System


class Rungs(NamedTuple):
    """States of a ladder: (T,) energy densities or pressures, z, and contacts that opened and closed on the way to each."""

    values: FloatArray
    z: FloatArray
    opened: IntArray
    closed: IntArray


def draw_rungs(axes: Axes, rungs: Rungs, system: System, label: str) -> None:
    """Draw z and the numbers of changes of contacts against the values, whose quantity has a label."""
    axes.plot(rungs.values, rungs.z, "o-", color="C0", ms=4, lw=0.8, label="$z$")
    numbers = axes.twinx()
    for name, marker, color in (("opened", "v", "C1"), ("closed", "^", "C2")):
        values = getattr(rungs, name)[1:]
        numbers.plot(rungs.values[1:], values, marker, color=color, ms=5, mfc="none", label=name)
    axes.set(xscale="log", xlabel=rf"{label}  ${pressure_unit([system])}$")
    axes.set_ylabel("bonds per particle $z$")
    numbers.set(ylim=(0, None), ylabel="contacts changed since the state before")
    axes.set_title(f"{systems_text([system])}, ladder", size=9)
    handles = [*axes.get_legend_handles_labels()[0], *numbers.get_legend_handles_labels()[0]]
    axes.legend(handles=handles, fontsize=8)
