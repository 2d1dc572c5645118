"""Axes of aspect ratio, reduced aspect ratio and energy, and averages on them."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from common.families import mark
from jamshape.arrays import FloatArray
from jamshape.drawing.text import pressure_unit
from jamshape.files.ensembles import System
from jamshape.measures.averages import Mean

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Distance of discs from the smallest other alpha on a logarithmic axis, as a factor.
DISCS_LEFT_BY = 4.0

ASPHERICITY = r"asphericity $\mathcal{A}-1$,  $\mathcal{A}=p^2/4\pi a$"
"""Label of an axis, in the plane."""

SMALL_TEXT: dict[str, Any] = {"fontsize": 8, "title_fontsize": 8}

_BETA_TICKS = (0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3, 5, 10)


def figure_of(width: float, height: float, dpi: int = 200) -> Figure:
    """Make a figure of a size in inches; matplotlib is loaded only here, not for --help and errors."""
    from matplotlib.figure import Figure  # noqa: PLC0415

    return Figure(figsize=(width, height), dpi=dpi, layout="constrained")


def discs_at(alphas: Iterable[float]) -> float:
    """Return the position of discs on a logarithmic axis of alpha."""
    return min((alpha for alpha in alphas if alpha > 0), default=1.0) / DISCS_LEFT_BY


def label_alpha_axis(axes: Axes, discs: float | None) -> None:
    """Make the axis of alpha logarithmic, with a tick for discs if there are any."""
    axes.set_xscale("log")
    axes.set_xlabel(r"aspect ratio $\alpha = A/R$")
    low, high = axes.get_xlim()
    if discs is None or discs < low:
        return
    decades = range(math.ceil(math.log10(discs * 2)), math.floor(math.log10(high)) + 1)
    ticks = [10.0**k for k in decades]
    minor = [m * 10.0**k for k in range(-9, 3) for m in range(2, 10)]
    minor = [tick for tick in minor if discs * 2 < tick < high]
    axes.set_xticks([discs, *ticks], ["0\nround", *[f"$10^{{{k}}}$" for k in decades]])
    axes.set_xticks(minor, [""] * len(minor), minor=True)
    axes.set_xlim(low, high)
    axes.axvline(discs * 2, color="0.8", lw=0.8, ls=":", zorder=0)


def energy_label(systems: Collection[System]) -> str:
    """Return the label of an axis of the energy density."""
    dimensions = {system.dimension for system in systems}
    power = dimensions.pop() if len(dimensions) == 1 else "D"
    return rf"energy density  $u=U/L^{power}\;{pressure_unit(systems)}$"


def error_bars(axes: Axes, means: Mapping[float, Mean], discs: float | None, **style: Any) -> None:
    """Draw means at their alpha, discs at a given position or not at all, with error bars.

    A line, if the style has one, stops before the discs: round particles are not the limit of
    nearly round ones.
    """
    points = [(alpha, *m[:2]) for alpha, m in sorted(means.items()) if alpha > 0]
    if discs is not None and 0.0 in means:
        points = [(discs, *means[0.0][:2]), (discs, math.nan, math.nan), *points]
    x, y, error = np.array(points).reshape(-1, 3).T
    bars = error if np.isfinite(error).any() else None
    axes.errorbar(x, y, bars, **{"capsize": 2, "ms": 5, "lw": 1, "elinewidth": 1} | style)


def log_bars(value: FloatArray, error: FloatArray) -> FloatArray:
    """(2, K) errors below and above that end above 0, for a logarithmic axis."""
    known = np.nan_to_num(error)
    return np.array([np.minimum(known, 0.9 * value), known])


def points(axes: Axes, x: Mapping[System, Mean], y: Mapping[System, Mean], **more: Any) -> None:
    """Draw averages of systems against each other with their standard errors."""
    for system in x:
        a, b = x[system], y[system]
        bars = {"yerr": b.error, "xerr": a.error}
        style: dict[str, Any] = {"ls": "none", "ms": 6, "capsize": 2, "elinewidth": 1}
        style |= {name: error for name, error in bars.items() if not math.isnan(error)}
        axes.errorbar([a.value], [b.value], **style | mark(system) | more)


def beta_axis(axis: Any) -> None:
    """Label an x or y axis of matplotlib with beta: logarithmic, with readable ticks."""
    axis.set_label_text(r"reduced aspect ratio $\beta=ac/b^2$")
    getattr(axis.axes, f"set_{axis.axis_name}scale")("log")
    low, high = axis.get_view_interval()
    ticks = [tick for tick in _BETA_TICKS if low / 1.01 < tick < 1.01 * high]
    axis.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    axis.set_ticks([], minor=True)
