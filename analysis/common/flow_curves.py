"""Flow curves: pressure and stress against the shear rate, and the packing fraction at which a flow jams.

Below jamming the pressure is proportional to the rate, p = eta gdot; above, p = p_0 + c gdot^b
(Herschel-Bulkley). The onset phi_J of shear jamming is where p_0 vanishes, and where the viscosity eta diverges as
(phi_J - phi)^-beta. Marschall, Keta, Olsson & Teitel, Phys. Rev. Lett. 122, 188002 (2019).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from common.averages import SURE
from jamshape.arrays import FloatArray
from jamshape.measures.averages import Mean
from jamshape.measures.shears import ShearOf

_FEWEST_RATES = 3  # of a curve
_POWERS = (0.05, 1.2)  # range of b


class FlowCurve(NamedTuple):
    """Pressures at one packing fraction and several rates, and the fitted law."""

    phi: float
    rates: FloatArray
    """(K,) ascending, [1/time]."""
    pressures: FloatArray
    """(K,) [energy / length^D]"""
    errors: FloatArray
    """(K,)"""
    yields: float
    """p_0, not below 0; NaN for fewer than three rates."""
    yields_error: float
    factor: float
    """c"""
    power: float
    """b"""

    @property
    def has_yielded(self) -> bool:
        """Whether p_0 is significantly above zero."""
        return self.yields > SURE * self.yields_error

    @property
    def viscosity(self) -> Mean:
        """Pressure over rate, at the lowest rate."""
        return Mean(self.pressures[0] / self.rates[0], self.errors[0] / self.rates[0], 1)

    def at(self, rate: FloatArray) -> FloatArray:
        """Return the pressure of the law."""
        return np.asarray(self.yields + self.factor * rate**self.power)


def fit_flow_curve(
    phi: float, rates: FloatArray, pressures: FloatArray, errors: FloatArray
) -> FlowCurve:
    """Fit p = p_0 + c gdot^b with p_0 >= 0 by least squares of relative deviations.

    Parameters
    ----------
    phi : float
    rates, pressures, errors : (K,) arrays of float64

    Returns
    -------
    FlowCurve
        Law of NaN for fewer than three rates. The error of p_0 is that of the linearised fit.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415 - it takes long to load

    order = np.argsort(rates)
    rates, pressures, errors = rates[order], pressures[order], errors[order]
    if len(rates) < _FEWEST_RATES:
        return FlowCurve(phi, rates, pressures, errors, *[math.nan] * 4)
    least = np.nan_to_num(errors, nan=0.0)
    weights = 1 / np.maximum(least, 1e-3 * pressures)
    x, scale = np.log(rates / rates[-1]), float(pressures[-1])

    def off(law: FloatArray) -> FloatArray:
        return np.asarray(
            (law[0] + law[1] * np.exp(law[2] * x) - pressures / scale) * weights * scale
        )

    low, high = [0.0, 1e-9, _POWERS[0]], [1.0, 10.0, _POWERS[1]]
    starts = ([0.01, 0.9, 0.9], [0.5 * pressures[0] / scale, 0.5, 0.5])
    found = min(
        (least_squares(off, np.clip(s, low, high), bounds=(low, high)) for s in starts),
        key=lambda one: one.cost,
    )
    covariance = np.linalg.pinv(found.jac.T @ found.jac)
    p0, c, b = found.x
    error = math.sqrt(max(covariance[0, 0], 0.0)) * scale
    factor = float(c * scale / rates[-1] ** b)
    return FlowCurve(phi, rates, pressures, errors, float(p0 * scale), error, factor, float(b))


def curves_of(runs: Sequence[ShearOf]) -> list[FlowCurve]:
    """Fit a curve to each packing fraction; samples that differ in their seed are points of their own."""
    by_phi: dict[float, list[ShearOf]] = {}
    for one in runs:
        by_phi.setdefault(one.ensemble.phi, []).append(one)
    curves = []
    for phi, of in sorted(by_phi.items()):
        means = [one.steady["pressure"] for one in of if one.steady]
        rates = np.array([one.ensemble.gdot for one in of])
        values, errors = (
            np.array([getattr(m, name) for m in means]) for name in ("value", "error")
        )
        curves.append(fit_flow_curve(phi, rates, values, errors))
    return curves


class ShearOnset(NamedTuple):
    """Jamming onset of a flow."""

    from_yield: Mean
    """phi at which the line through the yield pressures vanishes."""
    from_viscosity: Mean
    """phi at which the viscosity at the lowest rate diverges."""
    beta: Mean
    """Exponent of the divergence."""


def shear_onset(curves: Sequence[FlowCurve]) -> ShearOnset:
    """Find phi_J of shear, from yield pressures above and from viscosities below.

    Parameters
    ----------
    curves
        Curves of one system at several packing fractions.

    Returns
    -------
    ShearOnset
        NaN for fewer than three packing fractions on that side. Viscosities count if the pressure is
        proportional to the rate to within a fifth.
    """
    above = yielded(curves)
    below = [curve for curve in curves if _is_newtonian(curve)]
    unknown = Mean(math.nan)
    from_yield = _zero_of_line(above) if len(above) >= _FEWEST_RATES else unknown
    if len(below) < _FEWEST_RATES:
        return ShearOnset(from_yield, unknown, unknown)
    return ShearOnset(from_yield, *_divergence(below))


def yielded(curves: Sequence[FlowCurve]) -> list[FlowCurve]:
    """Select curves with a yield pressure that are denser than all those without."""
    known = [curve for curve in curves if math.isfinite(curve.yields)]
    loose = max((curve.phi for curve in known if not curve.has_yielded), default=-math.inf)
    return [curve for curve in known if curve.phi > loose]


def _is_newtonian(curve: FlowCurve) -> bool:
    if len(curve.rates) < 2:
        return False
    eta = curve.pressures[:2] / curve.rates[:2]
    return bool(abs(eta[1] / eta[0] - 1) < 0.2)


def _zero_of_line(curves: Sequence[FlowCurve]) -> Mean:
    """Find the zero of a line through the lowest yield pressures."""
    lowest = sorted(curves, key=lambda curve: curve.phi)[: _FEWEST_RATES + 1]
    phi = np.array([curve.phi for curve in lowest])
    p0 = np.array([curve.yields for curve in lowest])
    weights = 1 / np.array([max(curve.yields_error, 1e-3 * curve.yields) for curve in lowest])
    (slope, offset), covariance = np.polyfit(phi, p0, 1, w=weights, cov="unscaled")
    zero = -offset / slope
    gradient = np.array([-zero, -1.0]) / slope
    return Mean(float(zero), float(np.sqrt(gradient @ covariance @ gradient)), len(lowest))


def _divergence(curves: Sequence[FlowCurve]) -> tuple[Mean, Mean]:
    """Fit eta = c (phi_J - phi)^-beta in logarithms."""
    from scipy.optimize import curve_fit  # noqa: PLC0415 - it takes long to load

    phi = np.array([curve.phi for curve in curves])
    eta = [curve.viscosity for curve in curves]
    values = np.array([one.value for one in eta])
    errors = np.array([max(one.error / one.value, 1e-3) if one.error > 0 else 0.02 for one in eta])

    def law(x: FloatArray, log_c: float, log_distance: float, beta: float) -> FloatArray:
        return np.asarray(log_c - beta * np.log(phi.max() + np.exp(log_distance) - x))

    with np.errstate(all="ignore"):
        try:
            found, covariance = curve_fit(
                law, phi, np.log(values), (0.0, math.log(0.01), 2.0), errors, absolute_sigma=True
            )
        except RuntimeError:  # it does not diverge
            return Mean(math.nan), Mean(math.nan)
    distance = math.exp(found[1])
    spread = np.sqrt(np.diag(covariance))
    n = len(curves)
    onset = Mean(float(phi.max() + distance), float(distance * spread[1]), n)
    return onset, Mean(float(found[2]), float(spread[2]), n)
