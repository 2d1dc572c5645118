"""The onset of jamming, read off the pressure of a compression."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jamshape.packing import FloatArray

# Up to this fraction of the largest pressure counts as none.
_FLOOR = 1e-4

# A fall below the largest pressure so far by more than this fraction of it is a plastic drop.
_DROP = 0.02

# A line has this many rows, rises by this fraction of the largest pressure,
_MIN_ROWS = 5
_MIN_RISE = 0.02

# ends at this multiple of the pressure where it starts: it is longer than its extrapolation,
_MIN_GROWTH = 2.0

# knows its zero to this fraction of the way from there to its end,
_MAX_ERROR = 0.1

# and has this fraction of the slope of the longest line; a foot has less below phi_J.
_MIN_SLOPE = 0.5

# Smaller drops and smaller rises are noise, in its standard deviations.
_NOISE_DROP = 6
_NOISE_RISE = 10

# Of the lines with an error up to this multiple of the smallest one the longest is taken.
_NEARLY_BEST = 2.0

# Ends of lines that are tried, evenly spread; more only cost time.
_TRIED_ENDS = 40

_ROUNDING = 1e-14


class OnsetFit(NamedTuple):
    """The line p = slope (phi - phi_J) through the rows from `first` to `last`, both included."""

    phi_J: float
    phi_J_error: float
    """Standard error of the fit and what a quadratic term moves phi_J by, added in squares."""
    slope: float
    first: int
    last: int


def fit_onset(phi: ArrayLike, p: ArrayLike, p_error: ArrayLike | None = None) -> OnsetFit:
    """Fit a line to the pressure just above the onset of jamming and extrapolate it to zero.

    Marschall & Teitel 2018, Fig. 4, find by eye "the part of the p vs phi curve where the pressure
    first develops a linear behavior upon increasing phi, before there occurs any plastic
    rearrangements". Here:

    1. The curve after its last row without pressure is cut into parts wherever the pressure drops.
    2. Lines are fitted between all pairs of ends within each part. One counts if it rises out of
       the noise and further than its extrapolation to zero, if its slope is not far below that of
       the longest one, and if a quadratic term hardly moves its zero. So the rounded foot that
       a finite rate of compression makes is left out: lines through it fail the last two.
    3. Of the first part that has such lines the one with the smallest error is taken, or
       the longest of those nearly as good.

    Parameters
    ----------
    phi : (T,) array_like
        Packing fractions of a compression, ascending.
    p : (T,) array_like, [energy / length^D]
    p_error : (T,) array_like, optional
        Standard errors, such as those of a mean over samples, which weigh the rows. When left out
        the weights are equal and the scatter about the line gives the error.

    Returns
    -------
    OnsetFit
        The error is that of the fit: samples of one ensemble differ by more, and at a finite rate
        of compression phi_J is that of the rate.

    Raises
    ------
    ValueError
        If there is no onset in the data, nothing above it is linear, or an argument is out of its
        range.
    """
    x, y, weight = _checked(phi, p, p_error)
    quiet = np.flatnonzero(y <= _FLOOR * y.max())
    onset = int(quiet[-1]) + 1 if len(quiet) else 0
    noise = _noise(y[:onset] if onset > 2 * _MIN_ROWS else y)
    enough = max(_MIN_RISE * y.max(), _NOISE_RISE * noise)
    parts = [
        part
        for part in _between_drops(y, onset, _NOISE_DROP * noise)
        if np.ptp(y[part]) >= enough > 0
    ]
    if not parts:
        msg = (
            f"p has no onset of jamming up to phi = {x[-1]:.6g}, expected a lasting rise from zero;"
            " compress further"
        )
        raise ValueError(msg)
    lines = [list(_lines(x, y, weight, part, enough)) for part in parts]
    longest = max((line for part in lines for line in part), key=_rise_of(x), default=None)
    for part in lines:
        steep = [line for line in part if longest and line.slope >= _MIN_SLOPE * longest.slope]
        if steep:
            best = min(line.phi_J_error for line in steep)
            good = [line for line in steep if line.phi_J_error <= _NEARLY_BEST * best]
            return max(good, key=_rise_of(x))
    msg = (
        f"p rises after phi = {x[parts[0].start]:.6g} but nowhere in a line that leads to zero,"
        " expected a linear stretch above the onset; compress further, or more slowly, or"
        " take more rows"
    )
    raise ValueError(msg)
