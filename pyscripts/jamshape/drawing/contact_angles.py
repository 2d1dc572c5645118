"""The figure of contact angles: P(phi) of several systems (Marschall & Teitel 2018, Fig. 10)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.drawing.styles import COLORS, color
from jamshape.drawing.text import counted
from jamshape.measures.touching import AngleCurve
from jamshape.shapes.table import DEFAULT, shape_named

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def contact_angle_figure(curves: Mapping[str, AngleCurve], title: str) -> Figure:
    """Draw P(phi) of each curve with its name, and a band of one standard error on both sides."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(6, 4.3), dpi=200, layout="constrained")
    axes = figure.subplots()
    for k, (name, found) in enumerate(curves.items()):
        _draw_curve(axes, found, color(k), f"{name} ({counted(found.samples, 'sample')})")
    if any(found.samples > 1 for found in curves.values()):
        axes.fill_between([], [], color="0.5", alpha=0.25, lw=0, label="standard error")
    axes.axhline(1 / np.pi, color="0.4", ls=":", lw=1, label=r"discs, $1/\pi$", zorder=0)
    seen = np.concatenate([found.density[found.density > 0] for found in curves.values()])
    axes.set_yscale("log")
    axes.set(xlim=(0, 180), ylim=(max(seen.min() / 1.6, 3e-3), 8 * seen.max()))
    axes.set_xticks(range(0, 181, 30))
    axes.set_xlabel(r"angle $\varphi$ from the spine  [degrees]")
    axes.set_ylabel(r"density of contacts $P(\varphi)$  [1/rad]")
    place: dict[str, Any] = {"alignment": "left", "loc": "upper left", "frameon": False}
    axes.legend(fontsize=8, **place)
    axes.set_title(title, fontsize=8)
    _draw_particle(axes.inset_axes((0.72, 0.72, 0.26, 0.26)))
    return figure


def _draw_curve(axes: Axes, found: AngleCurve, tint: str, label: str) -> None:
    axes.stairs(found.density, found.edges, color=tint, lw=1.1, label=label, baseline=None)
    low, high = found.density - found.error, found.density + found.error
    band: dict[str, Any] = {"fill": True, "color": tint, "alpha": 0.25, "lw": 0}
    axes.stairs(high, found.edges, baseline=np.maximum(low, 1e-9), **band)


def _draw_particle(axes: Axes) -> None:
    """Illustrate the angle on a particle."""
    from matplotlib.patches import Arc, Polygon  # noqa: PLC0415 - not needed for --help

    body = shape_named(DEFAULT).outline(np.array([3.6, 2.0, 2.0]), 1.0)
    axes.add_patch(Polygon(body, facecolor="0.9", edgecolor="k", lw=0.8))
    axes.plot([-0.8, 1.8], [0, 0], "k", lw=0.8)
    axes.plot([0, 0.5], [0, 1], "k", lw=0.8)
    axes.plot(0.5, 1, "o", color=COLORS[1], ms=4)
    axes.add_patch(Arc((0, 0), 0.9, 0.9, theta1=0, theta2=np.degrees(np.arctan2(1, 0.5)), lw=0.8))
    axes.text(0.55, 0.25, r"$\varphi$", fontsize=9)
    axes.set(xlim=(-2, 2), ylim=(-1.15, 1.15), aspect="equal")
    axes.set_axis_off()
