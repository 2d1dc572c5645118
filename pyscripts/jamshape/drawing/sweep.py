"""Packing fraction at jamming and contact number of many packings, against the parameter that was swept."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jamshape.drawing.styles import BLUE, RED
from jamshape.drawing.text import attribute_text, system_text, systems_text
from jamshape.shapes.table import shape_named

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from jamshape.files.ensembles import PackingFile, System

_CURVES = (("phi_J", r"$\phi_J$", BLUE), ("z", "$z$, without rattlers", RED))
_WIDE = 30.0  # ratio of positive values above which their axis is logarithmic


class _Swept(NamedTuple):
    """Axis of the swept parameter."""

    places: Mapping[System, float]
    label: str
    """Symbol of the parameter; empty where systems stand side by side."""

    @classmethod
    def of(cls, systems: Sequence[System]) -> _Swept:
        """Take the one parameter in which systems of a shape differ, or else put systems side by side."""
        parameters = shape_named(systems[0].shape).parameters
        alike = len({system.shape for system in systems}) == 1
        varied = [p for p in parameters if alike and len({s.number(p.name) for s in systems}) > 1]
        if len(varied) == 1 and not any(math.isnan(s.number(varied[0].name)) for s in systems):
            name, symbol = varied[0].name, varied[0].symbol
            return cls({system: system.number(name) for system in systems}, f"${symbol}$")
        return cls({system: float(k) for k, system in enumerate(systems)}, "")

    def scale(self, axes: Axes) -> None:
        """Choose ticks or a scale."""
        if not self.label:
            texts = [system_text(system) for system in self.places]
            axes.set_xticks(range(len(texts)), texts, rotation=15, ha="right", fontsize=8)
            return
        positive = [value for value in self.places.values() if value > 0]
        if positive and max(positive) > _WIDE * min(positive):
            axes.set_xscale("symlog", linthresh=min(positive))
        axes.set_xlabel(self.label)


def sweep_figure(files: Sequence[PackingFile]) -> Figure:
    """Draw phi_J and z of samples, with their means and standard errors, against the swept parameter.

    Means are of samples at rest; the others have open marks.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415 - slow

    groups: dict[System, list[PackingFile]] = {}
    for file in files:
        groups.setdefault(file.system(), []).append(file)
    swept = _Swept.of(list(groups))
    figure = Figure(figsize=(5.5, 5.5), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for axes, (name, label, color) in zip((above, below), _CURVES, strict=True):
        for system, samples in groups.items():
            _draw(axes, swept.places[system], name, samples, color)
        axes.set_ylabel(label)
        axes.legend(*_legend(color, all_at_rest=all(f.reached for f in files)), fontsize=8)
    swept.scale(below)
    known = files[0].attributes
    told = [attribute_text(name, known) for name in ("n", "u0") if name in known]
    told.append(f"{min(map(len, groups.values()))} samples")
    figure.suptitle(f"{systems_text(groups)}\n{', '.join(told)}", fontsize=9)
    return figure


def _draw(axes: Axes, x: float, name: str, samples: Sequence[PackingFile], color: str) -> None:
    """Draw the samples of a system and their mean."""
    at_rest = np.array([s.number(name) for s in samples if s.reached])
    others = [s.number(name) for s in samples if not s.reached]
    axes.plot([x] * len(at_rest), at_rest, ".", color=color, alpha=0.35)
    axes.plot([x] * len(others), others, "o", color=color, mfc="none", ms=4)
    if len(at_rest):
        error = at_rest.std(ddof=1) / np.sqrt(len(at_rest)) if len(at_rest) > 1 else 0.0
        axes.errorbar(x, at_rest.mean(), error, fmt="_", color="black", capsize=3)


def _legend(color: str, *, all_at_rest: bool) -> tuple[list[object], list[str]]:
    from matplotlib.lines import Line2D  # noqa: PLC0415 - slow

    marks: dict[str, object] = {
        "sample": Line2D([], [], color=color, marker=".", ls="", alpha=0.35),
        "not at rest": Line2D([], [], color=color, marker="o", mfc="none", ms=4, ls=""),
        "mean and its standard error": Line2D([], [], color="black", marker="_", ls=""),
    }
    if all_at_rest:
        del marks["not at rest"]
    return list(marks.values()), list(marks)
