"""Rheology against packing fraction: stress, contacts, order and rotation at several rates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jamshape.drawing.axes import SMALL_TEXT
from jamshape.drawing.styles import color
from jamshape.drawing.text import ensemble_text, scientific, system_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from jamshape.files.sets import System
    from jamshape.measures.shears import ShearOf


class Panel(NamedTuple):
    """One quantity."""

    name: str
    label: str
    is_logarithmic: bool = False
    over_rate: bool = False
    """Whether it is divided by the rate."""


PANELS = (
    Panel("pressure", r"viscosity $\eta_p=p/\dot\gamma$", True, True),
    Panel("sigma", r"shear stress over rate $\sigma/\dot\gamma$", True, True),
    Panel("mu", r"stress ratio $\mu=\sigma/p$"),
    Panel("z", "contact number $z$"),
    Panel("S_2", "nematic order $S_2$"),
    Panel("rotation", r"rotation $-\langle\dot\theta\rangle/\dot\gamma$"),
)

_MARKERS = "osD^v"


class Line(NamedTuple):
    """Key of a line."""

    system: System
    gdot: float


def lines_of(runs: Sequence[ShearOf]) -> dict[Line, list[ShearOf]]:
    """Group runs with a steady state by system and rate, in the order of phi."""
    lines: dict[Line, list[ShearOf]] = {}
    for run in sorted(runs, key=lambda run: (run.ensemble.gdot, run.ensemble.phi)):
        if run.steady:
            lines.setdefault(Line(run.ensemble.system, run.ensemble.gdot), []).append(run)
    return lines


def rheology_figure(runs: Sequence[ShearOf]) -> Figure:
    """Draw six panels over phi: systems by colour, rates by marker."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    lines = lines_of(runs)
    labels = system_labels({line.system: None for line in lines})
    tints = {system: color(k) for k, system in enumerate(labels)}
    rates = sorted({line.gdot for line in lines})
    figure = Figure(figsize=(10.5, 6.2), dpi=160, layout="constrained")
    panels = figure.subplots(2, 3, sharex=True)
    for axes, panel in zip(panels.flat, PANELS, strict=True):
        for line, of in lines.items():
            style = {"color": tints[line.system], "marker": _MARKERS[rates.index(line.gdot) % 5]}
            label = rf"{labels[line.system]}, $\dot\gamma={scientific(line.gdot)}$"
            _draw_line(axes, panel, of, style | {"label": label})
        axes.set_ylabel(panel.label)
        if panel.is_logarithmic:
            axes.set_yscale("log")
    for axes in panels[1]:
        axes.set_xlabel(r"packing fraction $\phi$")
    first = next(iter(lines.values()))[0]
    title = f"{ensemble_text(first.ensemble, ('n',))}, steady {first.ensemble.flow} shear"
    if len(labels) > 1:
        title = f"$N={first.ensemble.n}$, steady {first.ensemble.flow} shear"
    figure.suptitle(f"{title}; bars: standard errors of correlated samples", fontsize=9)
    handles = panels[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=3, frameon=False, **_small())
    return figure


def _small() -> dict[str, float]:
    return {"fontsize": SMALL_TEXT["fontsize"]}


def _draw_line(axes: Axes, panel: Panel, of: Sequence[ShearOf], style: Mapping[str, str]) -> None:
    known = [run for run in of if run.steady and panel.name in run.steady.averages]
    rate = np.array([run.ensemble.gdot if panel.over_rate else 1.0 for run in known])
    means = [run.steady[panel.name] for run in known if run.steady]
    value = np.array([one.value for one in means]) / rate
    error = np.array([one.error for one in means]) / rate
    phi = [run.ensemble.phi for run in known]
    how = {"ms": 4, "lw": 0.9, "capsize": 1.5, "mfc": "none"}
    axes.errorbar(phi, value, error, **how, **style)  # type: ignore[arg-type]
