"""Averages of moduli over packings that are compressed, and the fit G = G_0 + c p^beta with its errors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from common.stressed import draws, mean_and_error, mean_of
from jamshape.arrays import FloatArray

_BETAS = np.linspace(0.1, 2.0, 381)


class Fit(NamedTuple):
    """G = G_0 + c p^beta."""

    G_0: float
    c: float
    beta: float
    chi2: float


def fitted(p: FloatArray, G: FloatArray, error: FloatArray) -> Fit:
    """Fit by weighted least squares: a line in p^beta for each beta; NaN from fewer than three points."""
    if len(p) < 3:
        return Fit(*[np.nan] * 4)
    weight = error**-2 / (error**-2).sum()
    x = p ** _BETAS[:, None]
    x_mean, G_mean = x @ weight, G @ weight
    off = x - x_mean[:, None]
    c = (off * (G - G_mean)) @ weight / (off**2 @ weight)
    G_0 = G_mean - c * x_mean
    chi2 = (((G - G_0[:, None] - c[:, None] * x) / error) ** 2).sum(axis=1)
    best = int(np.argmin(chi2))
    return Fit(float(G_0[best]), float(c[best]), float(_BETAS[best]), float(chi2[best]))


class Average(NamedTuple):
    """Average over packings with its fit."""

    G: FloatArray
    """(k,) by pressure."""
    error: FloatArray
    """(k,)"""
    fit: Fit
    errors: Fit
    """Standard deviations over the bootstrap."""


def average_of(p: FloatArray, G: FloatArray, last: float) -> Average:
    """Average (m, k) moduli and fit, up to a pressure; a fifth of the draws is fitted."""
    mean, error = mean_and_error(G)
    of = (p <= last * (1 + 1e-9)) & (error > 0)
    drawn = [fitted(p[of], mean_of(G[k][:, of]), error[of]) for k in list(draws(len(G)))[::5]]
    return Average(mean, error, fitted(p[of], mean[of], error[of]), Fit(*np.std(drawn, axis=0)))
