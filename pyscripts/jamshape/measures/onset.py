"""The onset of jamming from the pressure of a compression."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray
from jamshape.shapes.shape import HARMONIC

# Pressures up to this fraction of the largest count as zero.
_FLOOR = 1e-4

_DROP = 0.02  # relative fall of the pressure that counts as a drop
_COLLAPSE = 0.5  # likewise, as a collapse

_MIN_ROWS = 5  # of a line
_MIN_RISE = 0.02  # of a line, over the largest pressure
_MIN_GROWTH = 1.5  # pressure at the end of a line over that at its start
_MAX_ERROR = 0.15  # of the zero of a line, over the distance from there to its end
_MIN_SLOPES = (0.7, 0.5)  # of a line over the steepest chord: preferred, and acceptable
_CHORD_RISE = 0.25  # of a chord, over the pressure at its end
_CHORD_END = 10.0  # largest pressure at the end of a chord over that at the end of the line

# Among lines with an error up to this multiple of the smallest one the lowest is chosen.
_NEARLY_BEST = 2.0

# Alternative windows begin below this multiple of the pressure where the line ends.
_REACH = 10.0

_NOISE_DROP, _NOISE_RISE = 6, 10  # smaller drops and rises are noise, in its standard deviations

# Correlated scatter counts for fewer rows; this is the largest correlation.
_MAX_MEMORY = 0.9

# Number of line ends to try, evenly spread in pressure.
_TRIED_ENDS = 40

_ROUNDING = 1e-14


class OnsetFit(NamedTuple):
    """The line p = slope (phi - phi_J) through the rows from `first` to `last`, inclusive."""

    phi_J: float  # noqa: N815 - the paper's symbol
    phi_J_error: float  # noqa: N815
    """Contributions from scatter, curvature and the choice of rows, added in squares."""
    slope: float
    first: int
    last: int


def fit_onset(
    phi: ArrayLike, p: ArrayLike, p_error: ArrayLike | None = None, power: float = HARMONIC
) -> OnsetFit:
    """Fit a line to the pressure just above the onset of jamming and extrapolate it to zero.

    Marschall & Teitel 2018, Fig. 4, find by eye "the part of the p vs phi curve where the pressure first develops a linear
    behavior upon increasing phi, before there occurs any plastic rearrangements". Here:

    1. The curve after its last row without pressure is split into parts at drops of the pressure. Parts that later lose
    more than half of their pressure are discarded: they were not the onset.
    2. Lines are fitted between all pairs of ends within each part. A line is valid if it rises out of the noise, if a
    quadratic term hardly moves its zero, and if the curve is not much steeper soon after. The last two exclude the
    rounded foot due to a finite compression rate.
    3. In the first part with valid lines, the one with the smallest error is chosen, or the lowest of those nearly as
    good. Its error includes the choice of the window: the root mean square deviation of phi_J over the others, of all
    parts, that begin below ten times the pressure where it ends, each weighted with its number of rows, valid or not.

    Parameters
    ----------
    phi : (T,) array_like
        Packing fractions of a compression, ascending.
    p : (T,) array_like, [energy / length^D]
    p_error : (T,) array_like, optional
        Standard errors, such as those of a mean over samples. Only their ratios matter, as weights;
        the scatter about the line gives the error of the fit.
    power : float
        A of the law of contacts: p^(1 / (A - 1)), linear in phi, is fitted instead of p.

    Returns
    -------
    OnsetFit
        phi_J(kappa), at the rate of this compression: it rises as kappa falls, until kappa is about 1e-9. The error covers
        neither whether states there stay jammed (`jamshape.measures.jamming`) nor differences between samples, which are
        larger, nor rows so sparse that a line misses the first stretch.

    Raises
    ------
    ValueError
        If the data have no onset, no linear part above it, or an argument is out of its range.
    """
    x, y, weight = _checked(phi, p, p_error)
    y = np.copysign(np.abs(y) ** (1 / (power - 1)), y)
    scale = float(np.abs(y).max()) or 1.0
    y = y / scale
    parts, min_rise = _lasting_rises(y)
    if not parts:
        msg = (
            f"p has no onset of jamming up to phi = {x[-1]:.6g}, expected a lasting rise from zero;"
            " compress further"
        )
        raise ValueError(msg)
    best = _first_best((x, y, weight), parts, min_rise)
    if best is None:
        msg = (
            f"p rises after phi = {x[parts[0].start]:.6g} but nowhere in a line that leads to zero,"
            " expected a linear stretch above the onset; compress further, or more slowly, or"
            " take more rows"
        )
        raise ValueError(msg)
    return best._replace(slope=scale * best.slope)


def _first_best(
    data: tuple[FloatArray, FloatArray, FloatArray], parts: Sequence[slice], min_rise: float
) -> OnsetFit | None:
    """Choose among the lines of the first part that has any; None if there are none."""
    x, y, weight = data
    chords = _Chords(x, y, [pair for part in parts for pair in _pairs(y, part)])
    found = [
        [
            (line, line.slope / chords.steepest(_CHORD_END * y[last]))
            for first, last in _pairs(y, part)
            if y[last] - y[first] >= min_rise and (line := _line(x, y, weight, first, last))
        ]
        for part in parts
    ]
    others = [line for lines in found for line, slope in lines if slope >= _MIN_SLOPES[-1]]
    for min_slope, lines in itertools.product(_MIN_SLOPES, found):
        if chosen := [line for line, slope in lines if slope >= min_slope]:
            best = _chosen(chosen)
            return _with_spread(best, [of for of in others if y[of.first] <= _REACH * y[best.last]])
    return None


class _Chords:
    """Slopes of the chords between pairs of rows, by the pressure where they end."""

    def __init__(self, x: FloatArray, y: FloatArray, pairs: Sequence[tuple[int, int]]) -> None:
        first, last = np.array(pairs).T
        high = y[last] - y[first] >= _CHORD_RISE * y[last]
        first, last = first[high], last[high]
        order = np.argsort(y[last])
        self._end = y[last][order]
        slope = ((y[last] - y[first]) / (x[last] - x[first]))[order]
        self._steepest = np.maximum.accumulate(slope)

    def steepest(self, end: float) -> float:
        """Return the largest slope of chords that end at or below that pressure."""
        n = int(np.searchsorted(self._end, end, side="right"))
        return float(self._steepest[n - 1]) if n else 0.0


def _checked(
    phi: ArrayLike, p: ArrayLike, p_error: ArrayLike | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return phi, p and the weights."""
    x, y = np.asarray(phi, dtype=np.float64), np.asarray(p, dtype=np.float64)
    sigma = np.ones_like(x) if p_error is None else np.asarray(p_error, dtype=np.float64)
    if x.ndim != 1 or not x.shape == y.shape == sigma.shape or len(x) < _MIN_ROWS:
        msg = f"phi and p have shapes {x.shape} and {y.shape}, expected (T,) with T >= {_MIN_ROWS}"
        raise ValueError(msg)
    if not (np.isfinite([x, y, sigma]).all() and (np.diff(x) > 0).all() and (sigma > 0).all()):
        msg = "phi, p or p_error is not that of a compression, expected ascending phi, finite p"
        raise ValueError(msg)
    return x, y, (sigma.min() / sigma) ** 2


def _noise(y: FloatArray) -> float:
    """Estimate the standard deviation of white noise on a smooth curve from its second differences."""
    return float(np.median(np.abs(np.diff(y, 2))) / (0.6745 * np.sqrt(6)))


def _lasting_rises(y: FloatArray) -> tuple[list[slice], float]:
    """Find the parts of y that rise without drops or later collapse, and the smallest significant rise."""
    quiet = np.flatnonzero(y <= _FLOOR * y.max())
    onset = int(quiet[-1]) + 1 if len(quiet) else 0
    noise = _noise(y[:onset] if onset > 2 * _MIN_ROWS else y)
    min_rise = max(_MIN_RISE * float(y.max()), _NOISE_RISE * noise)
    rises = [
        part
        for part in _between_drops(y, onset, _NOISE_DROP * noise)
        if len(y[part]) >= _MIN_ROWS
        and np.ptp(y[part]) >= min_rise > 0
        and y[part.stop :].min(initial=np.inf) >= _COLLAPSE * y[part].max()
    ]
    return rises, min_rise


def _between_drops(y: FloatArray, onset: int, min_drop: float) -> Iterator[slice]:
    start = top = onset
    for row in range(onset, len(y)):
        if y[row] > y[top]:
            top = row
        elif y[top] - y[row] > max(min_drop, _DROP * y[top]):
            yield slice(start, top + 1)
            start = top = row
    yield slice(start, len(y))


def _pairs(y: FloatArray, part: slice) -> Iterator[tuple[int, int]]:
    """Yield the ends of all lines to try in one part."""
    highest = np.maximum.accumulate(y[part])
    levels = np.linspace(highest[0], highest[-1], _TRIED_ENDS)
    tried = np.unique([*(part.start + np.searchsorted(highest, levels)), part.stop - 1])
    for first, last in itertools.combinations(tried.tolist(), 2):
        if last - first + 1 >= _MIN_ROWS:
            yield first, last


def _line(
    phi: FloatArray, p: FloatArray, weight: FloatArray, first: int, last: int
) -> OnsetFit | None:
    """Fit a line by weighted least squares; None if it does not lead to zero."""
    x, y, w = (values[first : last + 1] for values in (phi, p, weight))
    w = w / w.sum()
    x_mean, y_mean = float(w @ x), float(w @ y)
    t = x - x_mean
    t_2 = float(w @ t**2)
    slope = float(w @ (t * y)) / t_2
    start, end = y_mean + slope * t[[0, -1]]
    if slope <= 0 or end < _MIN_GROWTH * start:
        return None
    zero = -y_mean / slope

    # The quadratic fit is y_mean + slope t + c q with q orthogonal to 1 and t, so a + b t + c t^2.
    t_3 = float(w @ t**3) / t_2
    q = t**2 - t_3 * t - t_2
    c = float(w @ (q * y)) / float(w @ q**2)
    a, b = y_mean - c * t_2, slope - c * t_3
    discriminant = b**2 - 4 * a * c
    if b <= 0 or discriminant < 0:
        return None
    bent_zero = -2 * a / (b + np.sqrt(discriminant))

    scatter = y - y_mean - slope * t
    memory = np.clip(scatter[1:] @ scatter[:-1] / (scatter @ scatter or 1.0), 0, _MAX_MEMORY)
    variance = float(w @ scatter**2) / (len(x) - 2) * (1 + memory) / (1 - memory)
    error = np.hypot(np.sqrt(variance * (1 + zero**2 / t_2)) / slope, bent_zero - zero)
    if error > _MAX_ERROR * (t[-1] - zero):
        return None
    phi_J = x_mean + zero
    return OnsetFit(phi_J, max(float(error), _ROUNDING * abs(phi_J)), slope, first, last)


def _chosen(lines: Sequence[OnsetFit]) -> OnsetFit:
    """Choose the first of the best lines."""
    smallest = min(line.phi_J_error for line in lines)
    good = [line for line in lines if line.phi_J_error <= _NEARLY_BEST * smallest]
    return min(good, key=lambda line: (line.first, -line.last))


def _with_spread(best: OnsetFit, others: Sequence[OnsetFit]) -> OnsetFit:
    """Add the spread of phi_J among other lines to the error of a line."""
    squares = [(line.phi_J - best.phi_J) ** 2 for line in others]
    spread = np.sqrt(np.average(squares, weights=[line.last - line.first + 1 for line in others]))
    return best._replace(phi_J_error=float(np.hypot(best.phi_J_error, spread)))
