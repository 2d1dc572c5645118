"""Volume, surface area, asphericity and aspect ratios of superellipsoids.

Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019), Sec. 2.1. The surface of a superellipsoid with
semi-axes a, b, c is |x/a|^2p + |y/b|^2p + |z/c|^2p = 1: p = 1 is an ellipsoid, p < 1 is like an octahedron
(p = 1/2 is one) and p > 1 like a box. Shapes are (..., 3) semi-axes along the body's x, y, z, in any
order, and an exponent p, a number or (...). The paper's a, b, c are the sorted semi-axes,
a <= b <= c.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy  # loads its parts once they are used
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray

OCTAHEDRON = 0.5  # the least p of a convex body

# Quadrature stops when halving its step changes the area by less than this fraction; steps are tried in turn.
_CONVERGED = 1e-13
_STEPS = (1 / 4, 1 / 8, 1 / 16, 1 / 32)

# The integrand is truncated where its weight has fallen to exp of minus this.
_TAIL = 40.0


class SurfaceArea(NamedTuple):
    """Areas of surfaces and bounds on their errors."""

    area: FloatArray
    """(...), [length^2]"""
    error: FloatArray
    """(...), [length^2], change by the last halving of the step."""


def perimeter(semi_axes: ArrayLike, p: float) -> float:
    r"""Length of the curve \|x/a\|^2p + \|y/b\|^2p = 1, to rounding.

    With u = \|x/a\|^2p = 1 / (1 + exp(-s)), both coordinates are smooth in s and their slopes decay exponentially, so
    that equal steps in s converge exponentially.

    Parameters
    ----------
    semi_axes : (2,) array_like, [length]
    p : float

    Returns
    -------
    float, [length]

    Examples
    --------
    >>> round(perimeter([1, 1], 1) / (2 * np.pi), 12)
    1.0
    """
    a, b = np.asarray(semi_axes, np.float64)
    power, step = 2 * p, min(0.1, 0.1 * p)
    s = np.arange(-_TAIL * max(1.0, power), _TAIL * max(1.0, power), step)
    log_u, log_v = -np.logaddexp(0, -s), -np.logaddexp(0, s)
    slope_x = a * np.exp(log_u / power + log_v) / power
    slope_y = b * np.exp(log_v / power + log_u) / power
    return float(4 * step * np.hypot(slope_x, slope_y).sum())


def checked(semi_axes: ArrayLike, p: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Check shapes of convex superellipsoids, and broadcast the exponents.

    Parameters
    ----------
    semi_axes : (..., 3) array_like, [length]
    p : (...) array_like

    Returns
    -------
    semi_axes : (..., 3) array of float64
    p : (...) array of float64

    Raises
    ------
    ValueError
        If a semi-axis is not a positive length, an exponent is below 1/2, or the numbers of
        shapes and exponents disagree.
    """
    axes, exponent = np.asarray(semi_axes, np.float64), np.asarray(p, np.float64)
    if axes.ndim < 1 or axes.shape[-1] != 3:
        msg = f"semi-axes have shape {axes.shape}, expected (..., 3)"
        raise ValueError(msg)
    if not (np.isfinite(axes) & (axes > 0)).all():
        msg = f"semi-axes hold {axes[~(np.isfinite(axes) & (axes > 0))][0]}, expected lengths > 0"
        raise ValueError(msg)
    convex = np.isfinite(exponent) & (exponent >= OCTAHEDRON)
    if not convex.all():
        found = f"exponent p is {exponent[~convex][0] if exponent.ndim else exponent}"
        msg = f"{found}, expected at least 1/2, for which bodies are convex"
        raise ValueError(msg)
    try:
        shape = np.broadcast_shapes(axes.shape[:-1], exponent.shape)
    except ValueError:
        found = f"{axes.shape[:-1]} shapes have {exponent.shape} exponents p"
        msg = f"{found}, expected one for all or one each"
        raise ValueError(msg) from None
    return np.broadcast_to(axes, (*shape, 3)), np.broadcast_to(exponent, shape)


def axes_from(w1: ArrayLike, w2: ArrayLike) -> FloatArray:
    """Semi-axes (a, b, c) in units of a from aspect ratios w1 = a/b and w2 = c/b.

    Yuan et al. 2019, Sec. 2.1, where lengths are in units of a. Spheroids have one aspect ratio w there:
    oblate, b = c, w = a/c < 1: (w1, w2) = (w, 1); prolate, a = b, w = c/a > 1: (w1, w2) = (1, w).

    Parameters
    ----------
    w1 : (...) array_like
        In (0, 1].
    w2 : (...) array_like
        At least 1.

    Returns
    -------
    (..., 3) array of float64
        Ascending: (1, 1 / w1, w2 / w1).

    Raises
    ------
    ValueError
        If a ratio is out of its range.
    """
    short, long = np.broadcast_arrays(np.asarray(w1, np.float64), np.asarray(w2, np.float64))
    if not ((short > 0) & (short <= 1) & (long >= 1) & np.isfinite(long)).all():
        msg = f"aspect ratios are w1 = {short} and w2 = {long}, expected 0 < w1 <= 1 <= w2"
        raise ValueError(msg)
    return np.stack([np.ones_like(short), 1 / short, long / short], axis=-1)


def volume(semi_axes: ArrayLike, p: ArrayLike, p_across: ArrayLike | None = None) -> FloatArray:
    """Volume, 8 a b c Gamma(1 + 1/2p)^3 / Gamma(1 + 3/2p).

    See `checked` for parameters and errors; `p_across` is half the exponent n2 of sections across z, p by default.
    These then have another area, Gamma(1 + 1/n2)^2 / Gamma(1 + 2/n2) in place of that of p.

    Returns
    -------
    (...) array of float64, [length^3]
    """
    axes, exponent = checked(semi_axes, p)
    of_unit = (
        8 * scipy.special.gamma(1 + 0.5 / exponent) ** 3 / scipy.special.gamma(1 + 1.5 / exponent)
    )
    if p_across is not None:
        _, across = checked(semi_axes, p_across)
        of_unit = of_unit * _section(across) / _section(exponent)
    return np.asarray(of_unit * axes.prod(axis=-1))


def _section(p: FloatArray) -> FloatArray:
    """Return a quarter of the area of a section with semi-axes 1."""
    return np.asarray(scipy.special.gamma(1 + 0.5 / p) ** 2 / scipy.special.gamma(1 + 1 / p))


def surface_area(
    semi_axes: ArrayLike, p: ArrayLike, p_across: ArrayLike | None = None
) -> SurfaceArea:
    r"""Area of the surface.

    With u, v, w = |x/a|^2p, |y/b|^2p, |z/c|^2p on the surface, u + v + w = 1, equal volumes of the
    cones to the centre have the weight :math:`(u v w)^{1/2p - 1}`, and the cone over dA is one third of
    dA times the distance of the tangent plane from the centre:

    .. math:: A = 3 V \left\langle \sqrt{u^m / a^2 + v^m / b^2 + w^m / c^2} \right\rangle,
        \quad m = 2 - 1/p.

    With u = 1/(1 + e^y), v/w = e^z the average over y and z has a smooth bounded integrand that
    decays exponentially, for all p; and double exponentially in :math:`\sinh^{-1}`, which is sampled at equal
    steps. For p = 1, :math:`A = 4 \pi R_G(a^2 b^2, b^2 c^2, c^2 a^2)` (Carlson).

    With two exponents, w and u + v are the variables of p, and u/v is that of sections across z.

    See `checked` for parameters and errors; `p_across` is half the exponent of sections across z, p by default.

    Returns
    -------
    SurfaceArea
        The relative error is below 1e-13 for p from 0.5 to 20 and axis ratios up to 100.
    """
    axes, exponent = checked(semi_axes, p)
    across = exponent if p_across is None else checked(semi_axes, p_across)[1]
    is_one = (exponent == across)[..., None]
    shapes = np.concatenate(
        [np.where(is_one, np.sort(axes, axis=-1), axes), exponent[..., None], across[..., None]],
        axis=-1,
    )
    different, which = np.unique(shapes.reshape(-1, 5), axis=0, return_inverse=True)
    found = np.array([_area_of(row[:3], *row[3:].tolist()) for row in different]).reshape(-1, 2)
    area, error = np.moveaxis(found[which.ravel()].reshape(*exponent.shape, 2), -1, 0)
    return SurfaceArea(area, error)


def asphericity(
    semi_axes: ArrayLike, p: ArrayLike, p_across: ArrayLike | None = None
) -> FloatArray:
    """Asphericity, 1 - (4 pi)^(1/3) (3 V)^(2/3) / A: 0 for a sphere, 1 for a needle or a sheet.

    Yuan et al. 2019, Eq. 2. (Their text has 1 for spheres; the right-hand sides of their Eqs. 8
    and 9, of oblate and prolate ellipsoids, are 1 minus this.)

    See `checked` for parameters and errors.

    Returns
    -------
    (...) array of float64
    """
    of_sphere = np.cbrt(4 * np.pi * (3 * volume(semi_axes, p, p_across)) ** 2)
    # Rounding may give a value just below 0 for a sphere.
    return np.maximum(0.0, 1 - of_sphere / surface_area(semi_axes, p, p_across).area)


def reduced_aspect_ratio(semi_axes: ArrayLike) -> FloatArray:
    """Reduced aspect ratio beta = a c / b^2 of the sorted semi-axes.

    Yuan et al. 2019, Sec. 2.1: below 1 for flat, above 1 for long shapes, 1 for self-dual ones.

    Parameters
    ----------
    semi_axes : (..., 3) array_like, [length]

    Returns
    -------
    (...) array of float64

    Raises
    ------
    ValueError
        If a semi-axis is not a positive length.
    """
    axes, _ = checked(semi_axes, 1.0)
    a, b, c = np.moveaxis(np.sort(axes, axis=-1), -1, 0)
    return np.asarray((a / b) * (c / b))


def _area_of(axes: FloatArray, p: float, p_across: float) -> tuple[float, float]:
    """Area of one shape and its error; with one exponent the axes ascend."""
    size = float(np.cbrt(axes.prod()))
    unit = axes / size
    if p == p_across == 1:
        a, b, c = unit**2
        area = 4 * np.pi * float(scipy.special.elliprg(a * b, b * c, c * a))
        return size**2 * area, size**2 * area * _CONVERGED
    # With one exponent the longest axis stands alone: its corner of the surface is the sharpest.
    known = None if p == p_across else p_across
    scale = 3 * float(volume(unit, p, known)) * size**2
    mean, change = _mean_slope(unit, p, p_across, _STEPS[0]), np.inf
    for step in _STEPS[1:]:
        before, mean = mean, _mean_slope(unit, p, p_across, step)
        change = abs(mean - before)
        if change < _CONVERGED * mean:
            break
    return scale * mean, scale * max(change, _CONVERGED * mean)


def _mean_slope(axes: FloatArray, p: float, p_across: float, step: float) -> float:
    """Average of the root in `surface_area`, by the trapezoidal rule.

    Both coordinates are (pi/2) sinh(xi). All is kept as logarithms: at p = 10 coordinates reach
    800. The sum of the weights replaces their integral, a product of beta functions.
    """
    reach = np.arcsinh(_TAIL * 2 * max(p, p_across) / (np.pi / 2))
    n = int(np.ceil(reach / step))
    xi = step * np.arange(-n, n + 1)
    y, stretch = np.pi / 2 * np.sinh(xi), np.cosh(xi)
    log_less, log_more = -np.logaddexp(0, -y), -np.logaddexp(0, y)  # of s and of 1 - s
    power, m = 0.5 / p, 2 - 1 / p
    power_across, m_across = 0.5 / p_across, 2 - 1 / p_across
    outer = stretch * np.exp(power * log_more + 2 * power * log_less)
    inner = stretch * np.exp(power_across * (log_more + log_less))
    b, c, a = axes
    pair = np.exp(m_across * log_less) / b**2 + np.exp(m_across * log_more) / c**2
    slope = np.sqrt(np.exp(m * log_more)[:, None] / a**2 + np.exp(m * log_less)[:, None] * pair)
    return float(outer @ slope @ inner / (outer.sum() * inner.sum()))
