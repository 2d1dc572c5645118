"""Tables, pictures and curves of error against run time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple


class Point(NamedTuple):
    """One run of a study."""

    name: str
    """Name of its curve: 'method, case'."""
    seconds: float
    error: float


def curves(points: Iterable[Point]) -> list[dict[str, Any]]:
    """Group points by name, in their order; those without a finite error are left out."""
    found: dict[str, dict[str, Any]] = {}
    for point in points:
        if math.isfinite(point.error):
            curve = found.setdefault(point.name, {"name": point.name, "seconds": [], "error": []})
            curve["seconds"].append(point.seconds)
            curve["error"].append(point.error)
    return list(found.values())


def markdown(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a table."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def figure_of(width: float, height: float, title: str = "") -> Any:
    """Begin a picture; the title says what was measured, and of what."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(width, height), dpi=150, layout="constrained")
    if title:
        figure.suptitle(title, fontsize=10)
    return figure


def median_and_largest(axis: Any, color: str, points: Sequence[tuple[float, float, float]]) -> None:
    """Draw medians (filled) and largest errors (open) against a cost, from (cost, median, largest)."""
    cost, median, largest = zip(*points, strict=True) if points else ((), (), ())
    axis.loglog(cost, median, "o-", color=color)
    axis.loglog(cost, largest, "s--", color=color, mfc="none")


def name_median_and_largest(axis: Any) -> None:
    """Add a legend for median and largest."""
    axis.xaxis.set_minor_formatter("")  # within a decade they would run into each other
    axis.plot([], [], "o-", color="0.3", label="median")
    axis.plot([], [], "s--", color="0.3", mfc="none", label="largest")
    axis.legend(fontsize=8)
