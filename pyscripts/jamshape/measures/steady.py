"""Averages over the steady state of a shear, with start-up detection and errors for correlated samples."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.measures.averages import Mean

_EARLIEST, _LATEST = 1 / 16, 0.5  # where the start-up may end, in fractions of a run
_TRIED = 16  # places to try between them

# Fewest samples for a meaningful error.
_FEWEST = 8

# Relative changes below this count as none.
_ROUNDING = 1e-13

# Series that determine the end of the start-up.
_SLOW = ("pressure", "shear_stress", "S_2_x", "S_2_y")


class SteadyMean(NamedTuple):
    """An average over a steady state."""

    value: float
    error: float
    """Standard error, from blocks longer than the memory."""
    memory: float
    """Correlation strain, twice the integral of the autocorrelation."""
    independent: float
    """Number of correlation strains averaged over."""

    @property
    def mean(self) -> Mean:
        """Value and error, for figures."""
        return Mean(self.value, self.error, max(1, round(self.independent)))


@dataclass(frozen=True)
class SteadyState:
    """Averages over the steady state of a shear.

    Parameters
    ----------
    startup
        Strain at which averaging begins.
    strain
        Final strain.
    averages
        By name: ``pressure``, ``sigma``, ``mu``, ``shear_stress`` (-p_xy), ``normal_difference``
        (p_xx - p_yy), ``z``, at a held pressure ``p_yy``, ``phi`` and ``friction`` (-p_xy / p_yy), and for nonround particles ``S_2`` and ``rotation`` (-dtheta/dgamma); ``sigma``
        and ``S_2`` are those of the mean tensors, so that fluctuations of few particles do not bias them.
    director
        Angle of the mean nematic director from x, from -pi/2 to pi/2.
    """

    startup: float
    strain: float
    averages: Mapping[str, SteadyMean]
    director: float

    def __getitem__(self, name: str) -> SteadyMean:
        """Look up an average by its name."""
        return self.averages[name]

    def report(self) -> dict[str, Any]:
        """Return all results by name, for JSON and attributes of files."""
        found: dict[str, Any] = {"startup": self.startup, "director": self.director}
        for name, one in self.averages.items():
            parts = ("", "_error", "_memory", "_independent")
            found |= {f"{name}{part}": value for part, value in zip(parts, one, strict=True)}
        return found


class Blocks(NamedTuple):
    """The mean of a correlated series."""

    mean: float
    error: float
    inefficiency: float
    """Statistical inefficiency, samples per independent sample."""


def block_average(values: FloatArray) -> Blocks:
    """Average a correlated series, with an error from blocks.

    Neighbours are averaged in pairs again and again (Flyvbjerg & Petersen, J. Chem. Phys. 91, 461 (1989)). The error
    is from the first blocking with B^3 > 2 n g^2, for B samples a block and its inefficiency g (Lee et al., Phys.
    Rev. E 83, 066706 (2011)), or else the largest one.

    Parameters
    ----------
    values : (T,) array of float64

    Returns
    -------
    Blocks
        The error is NaN for fewer than 8 values.

    Examples
    --------
    >>> import numpy as np
    >>> noise = np.random.default_rng(1).normal(size=4096)
    >>> found = block_average(noise)
    >>> round(found.error * 64, 1), round(found.inefficiency, 1)
    (1.0, 1.0)
    """
    n, mean = len(values), float(np.mean(values)) if len(values) else math.nan
    if n < _FEWEST:
        return Blocks(mean, math.nan, math.nan)
    first = _error(values)
    if first <= _ROUNDING * np.abs(values).max():
        return Blocks(mean, 0.0, 1.0)
    largest, length, blocks = first, 1, values
    while len(blocks) >= _FEWEST:
        error = _error(blocks)
        largest = max(largest, error)
        # Blocks may be equal that leave out the first values.
        if error > 0 and length**3 > 2 * n * (error / first) ** 4:
            return Blocks(mean, error, (error / first) ** 2)
        even = len(blocks) // 2 * 2
        blocks = blocks[len(blocks) - even :].reshape(-1, 2).mean(axis=1)
        length *= 2
    return Blocks(mean, largest, (largest / first) ** 2)


def steady_state(
    observables: Mapping[str, FloatArray], strain: FloatArray, after: float | None = None
) -> SteadyState:
    """Average over the steady state of a shear.

    Parameters
    ----------
    observables
        (T,) arrays by name, from a run of `jamshape.flow.shear`.
    strain : (T,) array of float64
        Ascending; steps may differ.
    after : float, optional
        Strain from which to average. By default, it maximises the number of independent samples of the slowest of
        pressure, shear stress and order, after at least a sixteenth of the run (Chodera, J. Chem. Theory Comput. 12, 1799
        (2016)).

    Returns
    -------
    SteadyState

    Raises
    ------
    ValueError
        If fewer than 8 samples are left.
    """
    edges = np.linspace(strain[0], strain[-1], len(strain))
    series = _series_of(observables, strain) if len(strain) > 1 else {}
    chosen = _begin(series) if after is None and series else 0
    first = chosen if after is None else int(np.searchsorted(edges, after))
    left = len(strain) - 1 - first
    if left < _FEWEST:
        msg = (
            f"{max(left, 0)} samples remain after a strain of {edges[min(first, len(edges) - 1)]:.4g}, expected"
            f" {_FEWEST} or more; shear further, or average from an earlier strain on"
        )
        raise ValueError(msg)
    part = {name: values[first:] for name, values in series.items()}
    apart = float(edges[-1] - edges[first]) / left
    averages = {name: _averaged(values, apart) for name, values in _projected(part).items()}
    director = 0.5 * math.atan2(part["S_2_y"].mean(), part["S_2_x"].mean())
    return SteadyState(float(edges[first]), float(edges[-1]), averages, director)


def _series_of(observables: Mapping[str, FloatArray], strain: FloatArray) -> dict[str, FloatArray]:
    """Return (T - 1,) series, means over as many equal strains."""
    known = {name: np.array(values, np.float64) for name, values in observables.items()}
    for name in known.keys() - {"turned"}:
        known[name][0] = known[name][1]  # the start itself was not sheared
    found = {name: known[name] for name in ("pressure", "normal_difference", "z")}
    if "p_yy" in known:  # a controlled one
        found |= {name: known[name] for name in ("p_yy", "phi")}
    found |= {
        "shear_stress": -known["p_xy"],
        "S_2_x": known["S_2"] * np.cos(2 * known["director"]),
        "S_2_y": known["S_2"] * np.sin(2 * known["director"]),
    }
    edges = np.linspace(strain[0], strain[-1], len(strain))
    found = {name: _means_between(edges, strain, values) for name, values in found.items()}
    if "turned" in known:
        found["rotation"] = -np.diff(np.interp(edges, strain, known["turned"])) / np.diff(edges)
    return found


def _means_between(edges: FloatArray, strain: FloatArray, values: FloatArray) -> FloatArray:
    """Average piecewise linear samples over the intervals between edges."""
    done = np.concatenate([[0.0], np.cumsum(np.diff(strain) * (values[1:] + values[:-1]) / 2)])
    # The integral within a piece is quadratic.
    piece = np.clip(np.searchsorted(strain, edges, side="right") - 1, 0, len(strain) - 2)
    into, width = edges - strain[piece], np.diff(strain)[piece]
    slope = np.diff(values)[piece] / width
    integral = done[piece] + into * (values[piece] + 0.5 * slope * into)
    return np.asarray(np.diff(integral) / np.diff(edges))


def _begin(series: Mapping[str, FloatArray]) -> int:
    """Choose the sample at which the slowest series has become steady."""
    n = len(series["pressure"])
    tried = np.unique(np.linspace(_EARLIEST * n, _LATEST * n, _TRIED).astype(int))

    def begin_of(values: FloatArray) -> int:
        left = [(n - k) / block_average(values[k:]).inefficiency for k in tried]
        return int(tried[int(np.nanargmax(left))]) if np.isfinite(left).any() else 0

    return max(begin_of(series[name]) for name in _SLOW)


def _projected(part: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Project tensors on the axes of their means."""
    half, stress = part["normal_difference"] / 2, part["shear_stress"]
    sigma, pressure = _along_mean(half, stress), part["pressure"]
    found = {name: part[name] for name in ("pressure", "shear_stress", "normal_difference", "z")}
    found["sigma"] = sigma
    if part["S_2_x"].any():  # undefined for round particles
        found["S_2"] = _along_mean(part["S_2_x"], part["S_2_y"])
        found |= {"rotation": part["rotation"]} if "rotation" in part else {}
    if pressure.mean() > 0:
        found["mu"] = _ratio(sigma, pressure)
    if "p_yy" in part:
        found |= {"p_yy": part["p_yy"], "phi": part["phi"]}
        found["friction"] = _ratio(stress, part["p_yy"])
    return found


def _ratio(of: FloatArray, over: FloatArray) -> FloatArray:
    """(T,) values whose mean is the ratio m of the means, and has its error: that of the mean of `of` - m `over`."""
    ratio = of.mean() / over.mean()
    return np.asarray(ratio + (of - ratio * over) / over.mean())


def _along_mean(x: FloatArray, y: FloatArray) -> FloatArray:
    """(T,) components of vectors along their mean."""
    size = math.hypot(x.mean(), y.mean())
    return (x * x.mean() + y * y.mean()) / size if size > 0 else np.zeros_like(x)


def _averaged(values: FloatArray, apart: float) -> SteadyMean:
    found = block_average(values)
    memory = found.inefficiency * apart
    return SteadyMean(found.mean, found.error, memory, len(values) / found.inefficiency)


def _error(values: FloatArray) -> float:
    return float(np.std(values, ddof=1) / math.sqrt(len(values)))
