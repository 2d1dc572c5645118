"""Axes of frequency, and quantities of modes on them.

Modes that lower the energy, of negative eigenvalue, have no frequency. They are drawn apart, left of the
others, at sqrt(-lambda) on an axis that runs the other way.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from common.mode_tables import (
    Tables,
    every,
    n_of,
    pooled,
    read_tables,
    selected,
    sizes,
    stable,
    unstable,
)
from common.styles import color
from common.text import bars_text, samples_text, short, system_labels
from jamshape.arrays import FloatArray
from jamshape.command import parser_of
from jamshape.drawing.modes import frequency_unit
from jamshape.drawing.text import attributes_text, scientific, systems_text
from jamshape.vibration.sets import Key
from jamshape.vibration.statistics import mean_in_bins
from jamshape.vibration.table import ModeTable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PER_DECADE = 8  # bins

# Smallest width of the axes of unstable modes, over that of the others.
_LEAST_WIDTH = 0.16

# Heights on these axes between which errors are drawn.
_ERRORS = (0.02, 0.42)

_ROWS = 12  # fewest rows in that space
_MANY = 100  # modes from which on errors are fainter

# Smallest gap for a legend, over the width of the axes.
_ROOM = 0.25


def modes_parser(doc: str | None, out: str) -> ArgumentParser:
    """Make the parser of a figure of modes, with options for alpha and u0."""
    parser = parser_of(doc, out, "MODES")
    for name in ("alpha", "u0"):
        asked: dict[str, Any] = {
            "type": float,
            "nargs": "+",
            "default": [],
            "help": "only these (all)",
        }
        parser.add_argument(f"--{name}", **asked)
    return parser


def tables_asked(options: Namespace) -> Tables:
    """Read the modes named on a command line; errors as `read_tables` and `selected`."""
    tables = selected(read_tables(options.files), "alpha", options.alpha)
    return selected(tables, "u0", options.u0)


def key_labels(keys: Collection[Key]) -> dict[Key, str]:
    """Label curves by their differences, for a legend."""
    systems = {key.system: None for key in keys}
    names, energies = system_labels(systems), {key.u0 for key in keys}
    labels = {}
    for key in keys:
        parts = [names[key.system]] * (len(systems) > 1 or len(energies) == 1)
        parts += [energy_text(key.u0)] * (len(energies) > 1)
        labels[key] = ", ".join(parts)
    return labels


def energy_text(u0: float) -> str:
    """Format an energy density."""
    return attributes_text({"u0": u0})[0]


def legend_title(tables: Tables) -> str:
    """Describe the packings on one line, and N, samples, and a common energy on the next."""
    energies = {key.u0 for key in tables}
    told = [samples_text(n_of(tables), tables)]
    told += map(energy_text, energies if len(energies) == 1 else [])
    text = f"{systems_text(key.system for key in tables)}\n{', '.join(told)}"
    return text + bars_text(tables)


def bin_edges(tables: Iterable[ModeTable], per_decade: int = PER_DECADE) -> FloatArray:
    """Return logarithmic bins around all frequencies, including those of unstable modes."""
    found = pooled(tables, sizes, lambda table: stable(table) | unstable(table))
    if not len(found):
        msg = "no mode has an eigenvalue above its error, expected modes of a jammed packing"
        raise ValueError(msg)
    first = math.floor(per_decade * math.log10(found.min()))
    last = math.floor(per_decade * math.log10(found.max())) + 1
    edges: FloatArray = 10.0 ** (np.arange(first, last + 1) / per_decade)
    return edges


class Sides(NamedTuple):
    """Axes of a quantity against frequency: for unstable modes, if there are any, and for the others."""

    unstable: Axes | None
    stable: Axes

    def each(self) -> list[Axes]:
        """Return the existing axes."""
        return [axes for axes in self if axes is not None]

    @property
    def first(self) -> Axes:
        """The axes on the left."""
        return self.unstable or self.stable


def add_sides(figure: Figure, tables: Tables, n_rows: int = 1) -> list[Sides]:
    """Make rows of axes that share their frequencies, with all labels except those of the quantities."""
    limits = [_limits(every(tables), select) for select in (unstable, stable)]
    decades = [0.0 if lim is None else math.log10(lim[1] / lim[0]) for lim in limits]
    if limits[1] is None:
        msg = "no mode has a positive eigenvalue, expected modes of a jammed packing"
        raise ValueError(msg)
    if limits[0] is None:
        panels = figure.subplots(n_rows, 1, squeeze=False, sharex="col")
        rows = [Sides(None, row[0]) for row in panels]
    else:
        ratio = max(decades[0] / decades[1], _LEAST_WIDTH)
        panels = figure.subplots(
            n_rows, 2, squeeze=False, sharex="col", sharey="row", width_ratios=[ratio, 1]
        )
        rows = [Sides(*row) for row in panels]
    for row in rows:
        _dress(row, limits)
    bottom = rows[-1]
    bottom.stable.set_xlabel(rf"frequency  $\omega$  ${frequency_unit(tables)}$")
    if bottom.unstable is not None:
        bottom.unstable.set_xlabel(r"$\sqrt{-\lambda}$,  $\lambda<0$")
    return rows


def _limits(tables: Sequence[ModeTable], select: Any) -> tuple[float, float] | None:
    """Return the range of frequencies of the selected modes, with some margin."""
    found = pooled(tables, sizes, select)
    return (float(found.min()) / 2, float(found.max()) * 2) if len(found) else None


def _dress(row: Sides, limits: Sequence[tuple[float, float] | None]) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter  # noqa: PLC0415 - with the figure only

    for axes in row.each():
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(numticks=99))
        axes.xaxis.set_minor_locator(LogLocator(subs=range(2, 10), numticks=99))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.tick_params(axis="x", labelsize=9)
    if limits[1]:
        row.stable.set_xlim(*limits[1])
    if row.unstable is None or not limits[0]:
        return
    low, high = limits[0]
    row.unstable.set_xlim(high, low)
    row.unstable.set_facecolor("#f3f3f3")
    row.stable.tick_params(labelleft=False, left=False, which="both")
    row.unstable.spines["right"].set_visible(False)
    row.stable.spines["left"].set(linestyle=(0, (4, 3)), color="0.5")


class Binned(NamedTuple):
    """Averages over all modes of all samples in bins of frequency; (bins,) each."""

    omega: FloatArray
    """Geometric bin centres."""
    value: FloatArray
    """NaN in empty bins, so that lines end at gaps between bands."""
    error: FloatArray
    """Standard error; 0 for one mode."""


def binned(samples: Sequence[ModeTable], name: str, edges: FloatArray, *, below: bool) -> Binned:
    """Average a column over modes in bins, either unstable modes or the others."""
    select = unstable if below else stable
    omega, values = pooled(samples, sizes, select), pooled(samples, lambda t: t[name], select)
    count = np.histogram(omega, edges)[0]
    average = mean_in_bins(values, omega, edges)
    square = mean_in_bins(values**2, omega, edges)
    error = np.sqrt(np.maximum(square - average**2, 0.0) / np.maximum(count - 1, 1))
    return Binned(np.sqrt(edges[1:] * edges[:-1]), average, error)


def draw_binned(
    row: Sides, samples: Sequence[ModeTable], name: str, edges: FloatArray, **style: Any
) -> None:
    """Draw averages of a column with standard errors on both sides."""
    for axes, below in ((row.stable, False), (row.unstable, True)):
        if axes is not None:
            found = binned(samples, name, edges, below=below)
            axes.errorbar(found.omega, found.value, np.nan_to_num(found.error), **style)


class _Unstable(NamedTuple):
    """An unstable mode."""

    size: float
    """-lambda"""
    error: float
    """Estimated distance of the eigenvalue from that of the minimum."""
    bound: float
    color: str


def draw_errors(axes: Axes, tables: Tables) -> None:
    """Draw every unstable mode, one below the other, with the errors of its eigenvalue.

    Black bars are bounds for the packing as it is, mostly too short to be seen; light ones
    estimate the distance from the eigenvalue at force balance. If a bar leaves the
    axes on the right, even the sign may differ there.
    """
    rows = sorted(
        _Unstable(size, error, bound, color(k))
        for k, samples in enumerate(tables.values())
        for table in samples
        for size, error, bound in _errors(table).tolist()
    )
    low, high = _ERRORS
    step = (high - low) / max(len(rows), _ROWS)
    style: dict[str, Any] = {"transform": axes.get_xaxis_transform()}
    for k, row in enumerate(rows):
        height = low + step * (k + 0.5)
        faint = 0.35 if len(rows) < _MANY else 0.15
        bars = ((row.error, row.color, 0.9, faint), (row.bound, "k", 1.6, 1.0))
        for width, shade, lw, opacity in bars:
            ends = np.sqrt(np.maximum([row.size - width, row.size + width], 1e-300))
            axes.plot(ends, [height] * 2, "-", color=shade, lw=lw, alpha=opacity, **style)
        axes.plot(np.sqrt(row.size), height, "|", color=row.color, ms=3, mew=1, **style)
    note: dict[str, Any] = {"fontsize": 7, "color": "0.3", "ha": "center", "va": "bottom"}
    top = low + step * len(rows)
    axes.text(0.5, top + 0.01, "each, with error", transform=axes.transAxes, **note)


def _errors(table: ModeTable) -> FloatArray:
    """(K, 3) magnitudes of unstable eigenvalues, estimated distances from the minimum's, bounds of their errors."""
    columns = (table["eigenvalues"], np.nan_to_num(table["state_error"]), table.bound)
    return np.asarray(np.abs(np.column_stack(columns)[unstable(table)]))


def draw_legend(axes: Axes, samples: Iterable[ModeTable], **style: Any) -> None:
    """Draw a legend in the widest gap between the frequencies of these modes."""
    omega = pooled(samples, sizes, stable)
    low, high = axes.get_xlim()
    ends = np.log10(np.concatenate([[low], np.sort(omega), [high]]))
    widest = int(np.argmax(np.diff(ends)))
    middle = 0.5 * (ends[widest] + ends[widest + 1])
    place = (middle - ends[0]) / (ends[-1] - ends[0])
    text: dict[str, Any] = {"fontsize": 8, "title_fontsize": 8, "frameon": False}
    if ends[widest + 1] - ends[widest] > _ROOM * (ends[-1] - ends[0]):
        axes.legend(loc="center", bbox_to_anchor=(place, 0.5), **text, **style)
    else:
        axes.legend(loc="best", **text, **style)


def mode_text(table: ModeTable, mode: int) -> str:
    """Label a mode by its number and its frequency, or its eigenvalue if that is not positive."""
    value, bound = table["eigenvalues"][mode], table.bound[mode]
    if table["sign"][mode] > 0:
        return rf"mode {mode}: $\omega={short(np.sqrt(value))}$"
    if table["is_translation"][mode]:
        return f"mode {mode}: translation"
    size = f"-{scientific(-value)}" if value < 0 else scientific(value)
    return rf"mode {mode}: $\lambda={size}\pm {scientific(bound)}$"
