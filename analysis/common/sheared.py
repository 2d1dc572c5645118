"""Steady shears of rods of several aspect ratios."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from common.averages import SURE
from jamshape.arrays import FloatArray
from jamshape.measures.averages import Mean
from jamshape.measures.shears import ShearOf, read_shear

ByAlpha = dict[float, list[ShearOf]]


def by_alpha(paths: Iterable[Path]) -> ByAlpha:
    """Read runs with a steady state, by aspect ratio, in the order of phi, then of the rate.

    Raises
    ------
    ValueError
        If no run has a steady state, or they differ in more than aspect ratio, phi, rate and seed.
    """
    every = [read_shear(path) for path in paths]
    runs = [one for one in every if one.steady]
    if not runs:
        raise ValueError(every[0].problem)
    others = {
        (one.ensemble.system.without("alpha"), one.ensemble.n, one.ensemble.flow) for one in runs
    }
    if len(others) > 1:
        msg = f"runs are of {len(others)} ensembles, expected those of one; select its files"
        raise ValueError(msg)
    found: ByAlpha = {}
    for one in sorted(runs, key=lambda one: (one.ensemble.phi, one.ensemble.gdot)):
        found.setdefault(one.ensemble.system.number("alpha"), []).append(one)
    return dict(sorted(found.items()))


def slowest(runs: Sequence[ShearOf]) -> list[ShearOf]:
    """Select the runs at the lowest rate that all packing fractions have."""
    rates: dict[float, set[float]] = {}
    for one in runs:
        rates.setdefault(one.ensemble.phi, set()).add(one.ensemble.gdot)
    shared = set.intersection(*rates.values())
    if not shared:
        msg = "no rate is common to all packing fractions, expected one; select the runs of such a rate"
        raise ValueError(msg)
    return [one for one in runs if one.ensemble.gdot == min(shared)]


def over_phi(runs: Sequence[ShearOf], name: str) -> dict[float, Mean]:
    """Average a steady quantity at each packing fraction over its runs; errors are those of the runs."""
    found: dict[float, list[Mean]] = {}
    for one in runs:
        if one.steady and name in one.steady.averages:
            steady = one.steady[name]
            found.setdefault(one.ensemble.phi, []).append(Mean(steady.value, steady.error, 1))
    return {phi: _joined(means) for phi, means in sorted(found.items())}


def _joined(means: Sequence[Mean]) -> Mean:
    values, errors = ([getattr(m, name) for m in means] for name in ("value", "error"))
    return Mean(float(np.mean(values)), float(np.linalg.norm(errors)) / len(means), len(means))


def at_phi(means: Mapping[float, Mean], phi: float) -> Mean:
    """Interpolate linearly between packing fractions; NaN outside."""
    known = list(means)
    value = _between(phi, known, [m.value for m in means.values()])
    error = _between(phi, known, [m.error for m in means.values()])
    return Mean(value, error, min((m.samples for m in means.values()), default=0))


def _between(x: float, at: Sequence[float], values: Sequence[float]) -> float:
    found: FloatArray = np.asarray(np.interp(x, at, values, left=np.nan, right=np.nan))
    return float(found)


def exceeds(one: Mean, other: Mean) -> bool:
    """Whether a mean is above another one by more than two joint errors."""
    return bool(one.value - other.value > SURE * np.hypot(one.error, other.error))
