"""Distributions of small forces or gaps of round and of nearly round particles, and the powers that they begin with."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from common.averages import SURE
from common.axes import figure_of
from common.ensembles import conditions, read_groups
from common.families import family
from common.styles import marked
from common.text import conditions_text
from jamshape.arrays import FloatArray
from jamshape.command import report
from jamshape.drawing.saving import save_figure
from jamshape.files.ensembles import PackingFile, System

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Estimate = Callable[[FloatArray, float], tuple[float, float]]
"""Exponent of values below a bound, and its error."""


class Quantity(NamedTuple):
    """A quantity whose small values x have the density x^(sign power)."""

    name: str
    """Plural, such as forces."""
    label: str
    """Label of an axis, in TeX."""
    symbol: str
    """Symbol of the power, in TeX."""
    power: str
    """Name of the power in JSON."""
    sign: int
    """1 if the density vanishes where the power is above 0, -1 if it diverges."""
    bounds: tuple[float, ...]
    """Largest values of further fits."""


class Distribution(NamedTuple):
    """Values of a system."""

    system: System
    Delta: float
    """Aspect ratio less 1."""
    values: FloatArray
    """(B,) of all packings, ascending."""
    power: float
    """From the values below a bound."""
    error: float
    limit: tuple[float, float]
    """Power extrapolated to a bound of 0, and its error."""

    @property
    def has_power(self) -> int:
        """1 if the power of the smallest values is above 0 by more than two errors."""
        power, error = self.limit
        return int(power > SURE * error)


def exponent_of(values: FloatArray, below: float) -> tuple[float, float]:
    """Estimate the exponent of a density x^exponent and its error from the values below a bound.

    The maximum likelihood: 1 + exponent = 1 / <ln(below / x)>.

    Examples
    --------
    >>> exponent, error = exponent_of(0.2 * np.linspace(0, 1, 100001)[1:], 0.2)  # uniform
    >>> abs(exponent) < 1e-3, round(error, 4)
    (True, 0.0032)
    """
    small = values[(values > 0) & (values <= below)]
    if len(small) < 2:
        return float("nan"), float("nan")
    slope = 1 / float(np.mean(np.log(below / small)))
    return slope - 1, slope / len(small) ** 0.5


def extrapolated(values: FloatArray, below: float) -> tuple[float, float]:
    """Extrapolate the exponent linearly to a bound of 0, from that bound and half of it; return it and its error.

    A density x^exponent (1 + c x + ...) has an estimate that is off in proportion to the bound. The values below half of the
    bound are part of those below it, so that the covariance of both estimates is the variance of the second.

    Examples
    --------
    >>> sample = 0.2 * (np.sqrt(1 + 8 * np.linspace(0, 1, 100001)[1:]) - 1) / 2  # density (1 + 10 x) / 0.4
    >>> round(exponent_of(sample, 0.02)[0], 2), abs(extrapolated(sample, 0.02)[0]) < 0.01
    (0.05, True)
    """
    (whole, error), (half, error_half) = exponent_of(values, below), exponent_of(values, below / 2)
    return 2 * half - whole, max(4 * error_half**2 - 3 * error**2, 0.0) ** 0.5


def power_of(
    of: Quantity, values: FloatArray, below: float, estimate: Estimate = exponent_of
) -> tuple[float, float]:
    """Estimate the power of a quantity and its error."""
    exponent, error = estimate(values, below)
    return of.sign * exponent, error


def figure_from(found: list[Distribution], of: Quantity, title: str, below: float) -> Figure:
    """Draw cumulative distributions on the left and powers on the right, extrapolated ones filled."""
    figure = figure_of(10.5, 4.4, dpi=90)
    left, right = figure.subplots(1, 2)
    for k, one in enumerate(found):
        style = marked(k, "-")
        label = rf"{family(one.system)}, $\Delta={one.Delta:.2g}$"
        fraction = np.arange(1, len(one.values) + 1) / len(one.values)
        line: dict[str, Any] = {"color": style["color"], "ls": ("-", "--")[k % 2], "lw": 1}
        left.plot(one.values, fraction, **line, label=label)
        where = max(one.Delta, 1e-3)
        right.errorbar(where, one.power, one.error, **style)
        right.errorbar(1.1 * where, *one.limit, **style | {"mfc": style["color"]})
    left.axvline(below, color="0.6", lw=0.8, ls=":")
    left.set(xscale="log", yscale="log", xlim=(1e-4, None))
    left.set_ylim(0.5 / max(len(one.values) for one in found), 1.3)
    left.set(xlabel=of.label, ylabel=f"fraction of smaller {of.name}")
    right.axhline(0, color="0.6", lw=0.8, ls=":")
    right.set(xscale="log", ylabel=rf"exponent ${of.symbol}$ of small {of.name}")
    right.set_xlabel(r"$\Delta$, aspect ratio $-\,1$ (discs at $10^{-3}$); $w_1=1/(1+\Delta)$")
    right.set_title("open: below the bound; filled: extrapolated to 0", fontsize=8)
    figure.suptitle(title, fontsize=8)
    left.legend(fontsize=7)
    return figure


def add_options(parser: ArgumentParser, below: float) -> None:
    """Add the bound of the fit."""
    parser.add_argument(
        "--below", type=float, default=below, help="largest value of the fit (%(default)s)"
    )


def study(options: Namespace, of: Quantity, values_of: Callable[[PackingFile], FloatArray]) -> None:
    """Read, fit, draw, report the values of each packing."""
    groups = read_groups(options.files, needs=("aspect_ratio",))
    found = []
    for system, files in groups.items():
        values = np.sort(np.concatenate([values_of(file) for file in files]))
        Delta = files[0].number("aspect_ratio") - 1
        limit = power_of(of, values, options.below, extrapolated)
        found.append(
            Distribution(system, Delta, values, *power_of(of, values, options.below), limit)
        )
    found.sort(key=lambda one: one.Delta)
    title = conditions_text(groups, bars=False)
    save_figure(figure_from(found, of, title, options.below), options.out)
    rows = [
        {"family": family(one.system), "Delta": round(one.Delta, 9), "count": len(one.values)}
        | {of.power: one.power, f"{of.power}_error": one.error, "has_power": one.has_power}
        | {
            name: [(below, *power_of(of, one.values, below, estimate)) for below in of.bounds]
            for name, estimate in (("by_bound", exponent_of), ("extrapolated", extrapolated))
        }
        for one in found
    ]
    report({"out": options.out, "conditions": conditions(groups), of.name: rows})
