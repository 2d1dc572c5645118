"""Energy of a packing along one of its modes: Marschall & Teitel 2018, Figs. 13 and 17.

Also for superellipsoids: Yuan et al. 2019, Fig. 10.

The energy of a soft mode at small amplitudes is far below the rounding of the total energy. Here it is the integral
of the force along the mode, in which the rounding of bonds cancels as far as the mode keeps their lengths: it
resolves eigenvalues of 1e-16 at amplitudes of 1e-11.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray
from jamshape.landscape import CrossingError, Landscape, State
from jamshape.packing import Packing
from jamshape.vibration.hessian import Coordinates

# A crossover fit is the longest with a smaller relative deviation of the force.
_DEVIATION = 0.03
_FEWEST = 6  # amplitudes
_BEYOND = 10.0  # quartic force over the quadratic one at its end

_TWICE = 2.0  # energy over its quadratic start where the quartic term equals it
_BELOW = 0.99  # fraction of the quadratic start below which bonds have opened

# Energy differences are used where they exceed the rounding of the energy by this factor.
_CLEAR = 1e6
_IN_A_ROW = 3  # differences that must agree with the integral of the force
_AGREE = 0.1  # relative deviation that counts as agreement


@dataclass(frozen=True, eq=False)
class EnergyAlong:
    """Energy along a mode and against it: rows 0 and 1 of all fields.

    Parameters
    ----------
    delta : (K,) array of float64, [length]
        Amplitudes, ascending.
    slope : (2, K) array of float64, [energy / length]
        dU/d(delta), minus its value at 0. NaN, here and below, beyond the amplitude at which spines would cross.
    energy : (2, K) array of float64, [energy]
        Its integral: Delta U, with the residual force at 0 balanced. Where energy differences have more than
        enough digits, these are used, which leaves no error at kinks.
    difference : (2, K) array of float64, [energy]
        The same as an energy difference, which drowns in rounding at small delta.
    broken, formed : (2, K) array of float64
        Number of bonds of the packing that have opened, and of new bonds.
    slope_at_0 : float, [energy / length]
        dU/d(delta) of the packing: the residual force of the minimiser along the mode.
    n_bonds : int
        Number of bonds of the packing.
    """

    delta: FloatArray
    slope: FloatArray
    energy: FloatArray
    difference: FloatArray
    broken: FloatArray
    formed: FloatArray
    slope_at_0: float
    n_bonds: int

    @property
    def mean_slope(self) -> FloatArray:
        """(K,) mean of both directions, in which odd terms of the energy cancel."""
        return np.asarray(self.slope.mean(axis=0))

    @property
    def mean_energy(self) -> FloatArray:
        """(K,) mean of both directions, in which odd terms of the energy cancel."""
        return np.asarray(self.energy.mean(axis=0))

    @property
    def first_change(self) -> float:
        """Smallest delta where a bond has broken or formed, in either direction; NaN if none has."""
        changed = ((self.broken > 0) | (self.formed > 0)).any(axis=0)
        return float(self.delta[changed][0]) if changed.any() else float("nan")

    @property
    def differences_from(self) -> float:
        """Smallest delta above which energy differences are accurate to ten percent; NaN if none."""
        off = np.abs(self.difference - self.energy).max(axis=0)
        right = off < _AGREE * np.abs(self.energy).min(axis=0)
        in_a_row = np.convolve(right, np.ones(_IN_A_ROW), "valid") == _IN_A_ROW
        return float(self.delta[np.argmax(in_a_row)]) if in_a_row.any() else float("nan")


class Crossover(NamedTuple):
    """Delta U = stiffness delta^2 / 2 + quartic delta^4."""

    delta: float
    """[length] amplitude where both terms are equal."""
    delta_error: float
    stiffness: float
    """[energy / length^2] omega^2, unless a bond that barely touched has closed or opened before."""
    quartic: float
    """[energy / length^4]"""
    begin: float
    """[length] smallest delta of the fit."""
    end: float
    """[length] largest delta of the fit."""
    deviation: float
    """Root mean square relative deviation of the force from the fit."""


def fit_crossover(along: EnergyAlong) -> Crossover | None:
    """Fit the sum of a quadratic and a quartic energy to the force along a mode.

    The fit is to the mean of both directions, in relative deviations, over the longest range of amplitudes in which
    that sum holds and the quartic term comes to dominate. Beyond it, bonds that grazed have opened and
    new ones push back: the energy is
    quadratic again, and steeper.

    Returns
    -------
    Crossover or None
        None if there is no such range.
    """
    seen = np.isfinite(along.mean_slope) & (along.mean_slope != 0)
    x, y = along.delta[seen], along.mean_slope[seen] / along.delta[seen]
    if len(x) < _FEWEST:
        return None
    u = x**2 / x[-1] ** 2
    best = max((_longest(u, y, first) for first in range(len(x) - _FEWEST + 1)), key=_span)
    if not best.n_points:
        return None
    part = slice(best.first, best.first + best.n_points)
    quartic = best.b / (4 * x[-1] ** 2)
    delta = np.sqrt(best.a / (2 * quartic))
    return Crossover(
        delta=float(delta),
        delta_error=float(0.5 * delta * _relative_error(u[part], y[part], best)),
        stiffness=best.a,
        quartic=float(quartic),
        begin=float(x[part][0]),
        end=float(x[part][-1]),
        deviation=best.deviation,
    )


def quartic_crossover(along: EnergyAlong) -> float:
    """Find delta* above which a mode is quartic (Yuan et al. 2019, Sec. 3.2), whatever follows there.

    The smallest amplitude at which the energy is twice that of the initial stiffness; for an
    unstable mode, at which it returns to its value at 0. Superellipsoids press harder on some neighbours and lose
    others as they rotate, at about delta*, so that `fit_crossover` finds few ranges with one quartic term. Along modes
    that bonds constrain to first order some of these open, and the energy falls below its start before it rises.

    Returns
    -------
    float, [length]
        NaN if the energy first falls a percent below its quadratic start, or never is twice as large.
    """
    start = along.mean_slope[0] / along.delta[0]
    ratio = along.mean_energy / (0.5 * start * along.delta**2)
    if start < 0:  # from 1 down to 0
        ratio = _TWICE - ratio
    ratio = ratio[np.isfinite(ratio)]
    off = np.flatnonzero((ratio < _BELOW) | (ratio > _TWICE))
    if not len(off) or ratio[off[0]] < _BELOW:
        return float("nan")
    k = int(off[0])
    if start < 0:
        ratio = np.where(ratio < 2 * _TWICE, ratio, 2 * _TWICE)
    around = slice(max(k - 1, 0), k + 1)
    return float(np.exp(np.interp(_TWICE, ratio[around], np.log(along.delta[around]))))


class _Fit(NamedTuple):
    """Least squares of y = a + b u, relative to y, over consecutive points."""

    a: float
    b: float
    deviation: float
    first: int
    n_points: int
    """0 if there is no good fit."""
    span: float
    """Ratio of the last u to the first."""


def _span(fit: _Fit) -> float:
    return fit.span


def _longest(u: FloatArray, y: FloatArray, first: int) -> _Fit:
    """Find the longest good fit that begins at a point."""
    u, y = u[first:], y[first:]
    columns = np.column_stack([np.ones_like(y), u, u**2, y, u * y]) / (y**2)[:, None]
    s, su, suu, sy, suy = np.cumsum(columns, axis=0).T
    count = np.arange(1, len(u) + 1)
    with np.errstate(all="ignore"):  # too few points, or equal y
        determinant = s * suu - su**2
        a = (suu * sy - su * suy) / determinant
        b = (s * suy - su * sy) / determinant
        square = np.maximum(count - a * sy - b * suy, 0.0) / (count - 2)
        good = (a > 0) & (b > 0) & (count >= _FEWEST) & (square < _DEVIATION**2)
        good &= (u > _BEYOND * a / b) & (2 * u[0] < a / b)
    if not good.any():
        return _Fit(0.0, 0.0, np.inf, first, 0, 0.0)
    last = int(np.flatnonzero(good)[-1])
    deviation = float(np.sqrt(square[last]))
    return _Fit(float(a[last]), float(b[last]), deviation, first, last + 1, float(u[last] / u[0]))


def _relative_error(u: FloatArray, y: FloatArray, fit: _Fit) -> float:
    """Return the standard error of ln(a / b)."""
    design = np.column_stack([np.ones_like(u), u]) / y[:, None]
    covariance = fit.deviation**2 * np.linalg.inv(design.T @ design)
    gradient = np.array([1 / fit.a, -1 / fit.b])
    return float(np.sqrt(gradient @ covariance @ gradient))


class AlongModes:
    """Moves the particles of a packing, without rattlers, along its modes.

    Rattlers are removed, as in the paper, so that no mode runs into them.

    Parameters
    ----------
    packing : Packing
        Packing at a minimum.
    coordinates : Coordinates
        Coordinates of the modes.
    k_e : float, [energy], optional
        By default that of the packing's law.
    """

    def __init__(
        self, packing: Packing, coordinates: Coordinates, k_e: float | None = None
    ) -> None:
        self.coordinates = coordinates
        rows = ["position", "orientation", "diameters", "form", "species", "id", "image"]
        rows += ["position_rest", "orientation_rest"]
        backbone = coordinates.backbone
        self.particles = packing.with_(**{row: getattr(packing, row)[backbone] for row in rows})
        self._landscape = Landscape(self.particles, k_e)
        self._state = State.of(self.particles)

    def energy(self, vector: FloatArray, delta: ArrayLike) -> EnergyAlong:
        """Follow the energy along a mode and against it.

        Parameters
        ----------
        vector : (n,) array of float64
            Unit vector in the coordinates.
        delta : (K,) array_like, [length]
            Amplitudes, positive and ascending; a dozen per decade or more.

        Raises
        ------
        ValueError
            If amplitudes are not positive and ascending.
        """
        amplitudes = np.asarray(delta, np.float64)
        if amplitudes.ndim != 1 or not (np.diff(amplitudes, prepend=0.0) > 0).all():
            msg = "amplitudes are not positive and ascending, expected sorted positive ones"
            raise ValueError(msg)
        shift, turn = (part[self.coordinates.backbone] for part in self.coordinates.motion(vector))
        walks = [
            _Walk(self._landscape, self._state, sign * shift, sign * turn) for sign in (1.0, -1.0)
        ]
        for walk in walks:
            walk.along(amplitudes)
        start = walks[0].start
        return EnergyAlong(
            delta=amplitudes,
            slope=np.array([walk.slope for walk in walks]),
            energy=np.array([walk.energy for walk in walks]),
            difference=np.array([walk.difference for walk in walks]),
            broken=np.array([walk.broken for walk in walks]),
            formed=np.array([walk.formed for walk in walks]),
            slope_at_0=start.slope,
            n_bonds=start.n_bonds,
        )


class _At(NamedTuple):
    """Evaluation at one amplitude."""

    slope: float
    energy: float
    n_bonds: int


class _Walk:
    """Follows the energy in one direction."""

    def __init__(
        self, landscape: Landscape, state: State, shift: FloatArray, turn: FloatArray
    ) -> None:
        self._landscape, self._state, self._shift, self._turn = landscape, state, shift, turn
        self.start = self._at(0.0)
        self._bonds = self._network(0.0)
        # Change of the coordinates, in all bonds, each times its force.
        eps = float(np.finfo(np.longdouble).eps) * float(state.edges.max())
        self._rounding = eps * landscape.evaluate(state).bond_force * np.sqrt(self.start.n_bonds)

    def along(self, delta: FloatArray) -> None:
        """Fill the rows of `EnergyAlong`; forces are integrated by Simpson's rule."""
        rows = np.full((5, len(delta)), np.nan)
        self.slope, self.energy, self.difference, self.broken, self.formed = rows
        last, before, energy = 0.0, self._forces(0.0), 0.0
        changes, changed = (0, 0), False
        for k, here in enumerate(delta):
            try:
                middle, at = self._forces(0.5 * (last + here)), self._forces(here)
            except CrossingError:
                return
            gain = at.energy - before.energy
            if abs(gain) < _CLEAR * self._rounding:
                gain = (here - last) / 6 * (before.slope + 4 * middle.slope + at.slope)
            energy += gain
            # Bonds seldom break and form in one step before their number first changes.
            changed = changed or at.n_bonds != self.start.n_bonds
            if changed:
                changes = self._changes(here)
            rows[:, k] = at.slope, energy, at.energy, *changes
            last, before = here, at

    def _forces(self, delta: float) -> _At:
        """Evaluate relative to the force and the energy at 0."""
        at, start = self._at(delta), self.start
        return _At(
            at.slope - start.slope, at.energy - start.energy - start.slope * delta, at.n_bonds
        )

    def _displaced(self, delta: float) -> State:
        return self._state.displaced(delta * self._shift, delta * self._turn)

    def _at(self, delta: float) -> _At:
        found, landscape = self._landscape.evaluate(self._displaced(delta)), self._landscape
        D = self._state.dimension
        gradient = landscape.components(found.gradient)
        torque = gradient[:, D:] * landscape.rotation_length[:, None]  # per radian
        slope = np.sum(gradient[:, :D] * self._shift) + np.sum(torque * self._turn)
        return _At(float(slope), found.energy, found.n_bonds)

    def _network(self, delta: float) -> dict[tuple[int, ...], int]:
        """Count the bonds of every contact, keyed by its particles and periodic image."""
        found = self._landscape.derivatives(self._displaced(delta), extended=True)
        contacts = np.column_stack([found["particles"], found["shift"]]).tolist()
        return dict(zip(map(tuple, contacts), found["n_bonds"].tolist(), strict=True))

    def _changes(self, delta: float) -> tuple[int, int]:
        """Count broken bonds and new ones."""
        now = self._network(delta)
        gains = [now.get(key, 0) - self._bonds.get(key, 0) for key in now.keys() | self._bonds]
        return sum(max(-gain, 0) for gain in gains), sum(max(gain, 0) for gain in gains)
