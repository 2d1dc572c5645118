"""Averages over samples, with their standard errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray
from jamshape.measures.averages import Mean

SURE = 2.0
"""Joint errors from which a difference counts as one."""

_Group = TypeVar("_Group")


class Measured(Protocol):
    """A sample with named numbers, such as `jamshape.files.ensembles.PackingFile`."""

    @property
    def reached(self) -> bool:
        """Whether it reached its goal."""

    def number(self, name: str) -> float:
        """Look up a number."""


class Reported(Protocol):
    """A group with a JSON description, such as `jamshape.files.ensembles.System`."""

    def report(self) -> dict[str, Any]:
        """Return the description."""


_Named = TypeVar("_Named", bound=Reported)


def mean(values: ArrayLike) -> Mean:
    """Average over samples without NaN; NaN if there are none.

    Examples
    --------
    >>> mean([1.0, 3.0, float("nan")])
    Mean(value=2.0, error=1.0, samples=2, reached=None)
    """
    array = np.asarray(values, np.float64)
    array = array[np.isfinite(array)]
    n = len(array)
    error = float(np.std(array, ddof=1) / np.sqrt(n)) if n > 1 else math.nan
    return Mean(float(array.mean()) if n else math.nan, error, n)


def mean_over(samples: Sequence[Measured], values: Sequence[float]) -> Mean:
    """Average one number per sample, with and without samples that did not reach their goal."""
    found = mean(values)
    of = zip(samples, values, strict=True)
    reached = [value for sample, value in of if sample.reached]
    return found if len(reached) == len(values) else found._replace(reached=mean(reached))


def standard_error(values: ArrayLike) -> FloatArray:
    """Return the standard error of the mean over the first axis; 0 for one sample."""
    array = np.asarray(values, np.float64)
    return np.asarray(array.std(axis=0) / np.sqrt(max(len(array) - 1, 1)))


def averages(groups: Mapping[_Group, Sequence[Measured]], name: str) -> dict[_Group, Mean]:
    """Average one number over the samples of each group, see `mean_over`."""
    return {group: mean_over(of, [s.number(name) for s in of]) for group, of in groups.items()}


def exactly(
    groups: Mapping[_Group, Sequence[Any]], value: Callable[[_Group], float]
) -> dict[_Group, Mean]:
    """Return for each group a number that needs no average."""
    return {group: Mean(value(group), math.nan, len(samples)) for group, samples in groups.items()}


def rows(
    groups: Mapping[_Named, Any], columns: Mapping[str, Mapping[_Named, Mean]]
) -> list[dict[str, Any]]:
    """Return averages for JSON, a row for each group."""
    return [
        group.report() | {name: values[group] for name, values in columns.items()}
        for group in groups
    ]
