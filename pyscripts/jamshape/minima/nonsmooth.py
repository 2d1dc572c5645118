"""Minima on kinks of the energy, where a convex combination of one-sided gradients vanishes.

The bond at the farther end of two nearly parallel rods passes from one tip to another where both are level
(`jamshape.vibration.kinks`). Its energy is the larger of two there, and its force jumps. A packing may come to rest
on such a kink: forces on both sides push towards it, so neither side is at rest, yet no motion lowers the energy.
That is the case if some convex combination of the gradients around the kink is zero: 0 is in the Clarke
subdifferential. A bundle-Newton method finds such points: it keeps several gradients and the Hessian, and minimises
the largest of the resulting quadratic models (L. Lukšan and J. Vlček, Math. Program. 83, 373 (1998)). Independent of
the shape; needs no LAMMPS.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.landscape import CrossingError, Evaluation, Landscape, State
from jamshape.landscape.local_energy_model import LocalEnergyModel
from jamshape.landscape.newton import least_shift
from jamshape.minima.descent import residual_of

# Largest number of steps: a handful suffice near jamming, some forty where overlaps are a third of a particle.
_STEPS = 100

# No kink is found if the residual has not halved in this number of steps, as where rods slide.
_PATIENCE = 15

# Size of the bundle, more than kinks that meet: seven were seen in packings of 1024 nearly round rods.
_MOST = 10

# Points of the bundle are so close that the error of the quadratic models is below this fraction of the tolerance.
_NEAR = 0.3

# Factor by which the distance to the next trial point grows until it is on another side.
_FARTHER = 4.0

# Two gradients belong to one side if they differ by no more than this fraction of the difference to others.
_SAME_SIDE = 1e-2

# Where several kinks meet, a model on a ray is on the side of another one if their gradients differ by less than this
# fraction of the difference to any third.
_OWN_SIDE = 0.25

# The Hessian is updated after a step of more than this fraction of the overlap.
_RENEW = 1e-2

# Doubles tell on which side of a kink a point is that is further from it than this, over `Landscape.length`. Long doubles
# take ten times as long.
_IN_DOUBLES = 1e-11

_ACCURACY = 1e-9  # of the iterative solution of Newton's equations
_EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class Piece:
    """Quadratic model of the energy about a point near the kink."""

    x: FloatArray
    """(n,) point relative to the base of the kink, [length]."""
    evaluation: Evaluation
    relaxed: FloatArray
    """(n,) inverse Hessian times gradient, a Newton step back, [length]."""


class Rest(NamedTuple):
    """A state at rest, possibly on a kink of the energy."""

    state: State
    evaluation: Evaluation
    """Evaluation with the convex combination as gradient."""
    n_sides: int
    """Number of gradients combined; 1 without a kink."""


@dataclass(eq=False)
class Corner:
    """Bundle of quadratic models about a point, the largest of which approximates the energy.

    Parameters
    ----------
    landscape : Landscape
    base : State
    tolerance
        Largest residual.
    """

    landscape: Landscape
    base: State
    tolerance: float
    pieces: list[Piece] = field(default_factory=list)
    """The first is at the lowest point so far."""

    def __post_init__(self) -> None:
        self._differentiate(self.landscape.evaluate(self.base))
        self.add(np.zeros(self.landscape.size))

    @property
    def overlap(self) -> float:
        """Mean overlap of a bond, [length]."""
        force, unit = (
            self.pieces[0].evaluation.bond_force,
            self.landscape.length**2 / self.landscape.stiffness,
        )
        return (
            force
            * unit
            * self.landscape.law.overlap_over_harmonic(force * unit / self.landscape.length)
        )

    @property
    def near(self) -> float:
        """Required distance of the points, [length]."""
        return _NEAR * self.tolerance * self.overlap

    def _differentiate(self, here: Evaluation) -> None:
        self._local_model = LocalEnergyModel(self.landscape, self.base)
        self._newton = self._local_model.newton(least_shift(self.landscape, here))
        self._newton.prepare()
        self._hessian: Any = self.landscape.curvature(self.base).hessian

    def add(self, x: FloatArray) -> None:
        """Add the model about a point; put it first if its energy is the lowest, up to rounding."""
        piece = self._piece(x)
        lowest = self.pieces[0].evaluation.energy if self.pieces else np.inf
        at = 0 if piece.evaluation.energy <= lowest * (1 + 2 * _EPS) else len(self.pieces)
        self.pieces.insert(at, piece)

    def _piece(self, x: FloatArray) -> Piece:
        found = self.landscape.evaluate(self.landscape.displaced(self.base, x))
        [relaxed] = self._newton.solve(found.gradient[None], _ACCURACY)
        return Piece(x, found, relaxed)

    def times(self, x: FloatArray) -> FloatArray:
        """Multiply by the Hessian, shifted to be positive definite."""
        product: FloatArray = self._hessian @ x + self._newton.shift * x
        return product

    def gradients(self) -> FloatArray:
        """(k, n) gradients of the models at the lowest point."""
        first = self.pieces[0]
        return np.array([p.evaluation.gradient + self.times(first.x - p.x) for p in self.pieces])

    def below(self) -> FloatArray:
        """(k,) depth of each model below the energy at the lowest point."""
        first = self.pieces[0]
        found = []
        for piece in self.pieces:
            step = first.x - piece.x
            rise = piece.evaluation.gradient @ step + step @ self.times(step) / 2
            found.append(first.evaluation.energy - piece.evaluation.energy - rise)
        return np.maximum(found, 0.0)

    def mixed(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return weights of the gradients at the minimum of the largest model, their combination, and the step."""
        first, gradients = self.pieces[0], self.gradients()
        steps = np.array([p.relaxed + first.x - p.x for p in self.pieces])
        products = gradients @ steps.T
        if not np.isfinite(products).all():
            msg = "second derivatives without an inverse"  # as for flat faces, where they jump
            raise RuntimeError(msg)
        weights = weights_of(products, self.below())
        return weights, weights @ gradients, -(weights @ steps)

    def draw_near(self, tip: FloatArray) -> None:
        """Move models closer to the kink, on their side of it.

        The difference of two gradients is the normal of a single kink. Where several meet, it may point to a third side;
        the sides are cones then, and a ray from their tip, here the minimum of the largest model, stays on one. The normal
        serves if that minimum is not near the tip.
        """
        first, gradients = self.pieces[0], self.gradients()
        is_single = len(self.pieces) == 2  # rays for two models, too, find fewer kinks
        for k in range(1, len(self.pieces)):
            x, jump = self.pieces[k].x, gradients[k] - gradients[0]
            far = float(np.abs(x - first.x).max())
            if far <= self.near:
                continue
            normal, ray = (first.x, jump), (tip, x - tip)
            for origin, way in (normal,) if is_single else (ray, normal):
                closer = self._closest(k, gradients, origin, way, far) if way.any() else None
                if closer is not None:
                    self.pieces[k] = closer
                    break

    def _closest(
        self, k: int, gradients: FloatArray, origin: FloatArray, way: FloatArray, far: float
    ) -> Piece | None:
        """Return the model closest to the origin of a ray on the side of model k; None without one nearer than `far`."""
        own_side = 1.0 if len(gradients) == 2 else _OWN_SIDE
        unit, distance = way / np.abs(way).max(), self.near
        while distance < far:
            x = origin + distance * unit
            extended = distance < _IN_DOUBLES * self.landscape.length
            there = self._local_model.evaluate(x, 0.0, extended=extended)
            gradient = there.gradient + self.times(self.pieces[0].x - x)
            others = np.linalg.norm(gradients - gradient, axis=1)
            if others[k] < own_side * np.delete(others, k).min():
                return self._piece(x)
            distance *= _FARTHER
        return None

    def along(self, step: FloatArray) -> FloatArray:
        """Return the part of a step along all kinks, which changes no difference of the models."""
        jumps = (self.gradients()[1:] - self.pieces[0].evaluation.gradient).T
        across = np.linalg.lstsq(jumps, step, rcond=None)[0]
        return np.asarray(step - jumps @ across)

    def is_near(self, weights: FloatArray) -> bool:
        """Whether the points of all models with nonzero weight are so close that the Hessian is negligible."""
        far = (
            np.abs(p.x - self.pieces[0].x).max()
            for p, w in zip(self.pieces, weights, strict=True)
            if w > 0
        )
        return bool(max(far) <= _FARTHER * self.near)

    def forget(self, weights: FloatArray) -> None:
        """Drop models without weight, those of a side with a closer model, and the smallest weights of too many."""
        first, gradients = self.pieces[0], self.gradients()
        far = [np.abs(piece.x - first.x).max() for piece in self.pieces]
        kept: list[int] = []
        for k in sorted(range(len(self.pieces)), key=lambda k: far[k]):
            others = np.linalg.norm(gradients[kept] - gradients[k], axis=1)
            widest = np.linalg.norm(gradients - gradients[k], axis=1).max()
            if k == 0 or (weights[k] > 0 and (others > _SAME_SIDE * widest).all()):
                kept.append(k)
        most = sorted(kept[1:], key=lambda k: -weights[k])[: _MOST - 1]
        self.pieces = [self.pieces[k] for k in (0, *sorted(most))]

    def rest(self, evaluation: Evaluation, n_sides: int) -> Rest:
        """Return the lowest point."""
        state = self.landscape.displaced(self.base, self.pieces[0].x)
        return Rest(state, evaluation, n_sides)

    def renew(self) -> None:
        """Update the Hessian at the lowest point, if it is far from where it was evaluated."""
        first = self.pieces[0]
        if np.abs(first.x).max() <= _RENEW * self.overlap:
            return
        self.base = self.landscape.displaced(self.base, first.x)
        self._differentiate(first.evaluation)
        self.pieces = [self._piece(piece.x - first.x) for piece in self.pieces]


def weights_of(products: FloatArray, below: FloatArray) -> FloatArray:
    """Find the convex weights that minimise half their square in `products` plus `below`.

    Parameters
    ----------
    products : (k, k) array
        Products of gradients with the inverse Hessian; k is small, since all subsets are tried.
    below : (k,) array

    Returns
    -------
    (k,) array of float64

    Examples
    --------
    >>> weights_of(np.array([[1.0, -3.0], [-3.0, 9.0]]), np.zeros(2))
    array([0.75, 0.25])
    """
    k, scale = len(below), max(float(np.abs(products).max()), 1e-300)
    Q, a = (products + products.T) / (2 * scale), below / scale
    best, least = np.eye(k)[0], math.inf
    for size in range(1, k + 1):
        for chosen in map(list, itertools.combinations(range(k), size)):
            system = np.ones((size + 1, size + 1))
            system[-1, -1], system[:-1, :-1] = 0.0, Q[np.ix_(chosen, chosen)]
            solved = np.linalg.lstsq(system, np.append(-a[chosen], 1.0), rcond=None)[0]
            weights = np.zeros(k)
            weights[chosen] = solved[:-1]
            value = float(weights @ Q @ weights / 2 + a @ weights)
            if (weights >= 0).all() and abs(weights.sum() - 1) < 1e-6 and value < least:
                best, least = weights, value
    return np.asarray(best / best.sum())


def at_rest(landscape: Landscape, state: State, tolerance: float) -> Rest | None:
    """Relax a state at which a minimisation stalled onto the adjacent kink of the energy.

    Parameters
    ----------
    landscape : Landscape
    state : State
    tolerance : float
        Largest residual of the combined gradient.

    Returns
    -------
    Rest or None
        None if forces do not balance nearby, as where particles slide.
    """
    try:
        corner = Corner(landscape, state, tolerance)
        least, last_gain = math.inf, 0
        for k in range(_STEPS):
            first = corner.pieces[0]
            if first.evaluation.bond_force == 0.0:
                return None
            if residual_of(landscape, first.evaluation).largest <= tolerance:
                return corner.rest(first.evaluation, 1)
            weights, mixture, step = corner.mixed()
            mixed = first.evaluation._replace(gradient=mixture)
            residual = residual_of(landscape, mixed).largest
            if residual <= tolerance and corner.is_near(weights):
                return corner.rest(mixed, int(np.count_nonzero(weights)))
            if residual <= max(least / 2, tolerance):
                least, last_gain = residual, k
            if k - last_gain > _PATIENCE:
                return None
            corner.forget(weights)
            corner.draw_near(first.x + step)
            corner.add(first.x + step)
            if k > last_gain and corner.pieces[0] is first:
                corner.add(first.x + corner.along(step))
            corner.renew()
    except (CrossingError, RuntimeError):
        return None
    return None
