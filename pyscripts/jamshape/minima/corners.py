"""Minima on corners of the energy, where no forces are zero but a mixture of those around.

The bond at the farther end of two nearly parallel rods passes from one tip to another where both are level
(`jamshape.vibration.kinks`). Its energy is the larger one of two there, and its force jumps. A packing may come to rest on
such a corner: on each side the forces push back to it, so that none is at rest, and yet no motion lowers the energy. That
is so where some average of the gradients next to the corner, with weights that are not negative, is zero: 0 is in the
subdifferential of Clarke. A method of Newton's kind finds such points by keeping several gradients and the energy's second
derivatives, and going to the minimum of the largest of all these parabolas (L. Lukšan and J. Vlček, Math. Program. 83, 373
(1998)). General in the shape; needs no LAMMPS.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.landscape import CrossingError, Evaluation, Landscape, State
from jamshape.landscape.newton import least_shift
from jamshape.landscape.vicinity import Vicinity
from jamshape.minima.descent import residual_of

# Steps to a corner: a handful near jamming, some forty where overlaps are a third of a particle.
_STEPS = 100

# It is none if the residual has not halved in so many steps, as where rods slide.
_PATIENCE = 15

# Parabolas that are kept: one more than corners that are met at once.
_MOST = 7

# Parabolas are those of points so near to each other that what second derivatives miss is this part of the tolerance.
_NEAR = 0.3

# How much farther from the lowest point the next one is looked at, until it is on another side.
_FARTHER = 4.0

# Two gradients are of one side if they differ by no more than this part of how much others differ.
_SAME_SIDE = 1e-2

# Second derivatives are found anew after a step of more than this part of the overlap.
_RENEW = 1e-2

_ACCURACY = 1e-9  # of Newton's equations, where these are iterated
_EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class Piece:
    """The energy's parabola about a point near the corner."""

    x: FloatArray
    """(n,) from the base of the corner, [length]."""
    evaluation: Evaluation
    relaxed: FloatArray
    """(n,) the gradient by the inverse of the second derivatives: a Newton step back, [length]."""


class Rest(NamedTuple):
    """A state at rest, maybe on a corner of the energy."""

    state: State
    evaluation: Evaluation
    """Its gradient is the mixture."""
    n_sides: int
    """Whose gradients are mixed; 1 where there is no corner."""


@dataclass(eq=False)
class Corner:
    """Parabolas about a point, the largest of which is taken for the energy.

    Parameters
    ----------
    landscape : Landscape
    base : State
    tolerance
        Of the residual.
    """

    landscape: Landscape
    base: State
    tolerance: float
    pieces: list[Piece] = field(default_factory=list)
    """The first is the lowest point so far."""

    def __post_init__(self) -> None:
        self._differentiate(self.landscape.evaluate(self.base))
        self.add(np.zeros(self.landscape.size))

    @property
    def overlap(self) -> float:
        """Of a bond, [length]."""
        unit = self.landscape.length**2 / self.landscape.k_e
        return self.pieces[0].evaluation.bond_force * unit

    @property
    def near(self) -> float:
        """How near points are to be to each other, [length]."""
        return _NEAR * self.tolerance * self.overlap

    def _differentiate(self, here: Evaluation) -> None:
        vicinity = Vicinity(self.landscape, self.base)
        self._newton = vicinity.newton(least_shift(self.landscape, here))
        self._newton.prepare()
        self._hessian: Any = self.landscape.curvature(self.base).hessian

    def add(self, x: FloatArray) -> None:
        """Take the parabola about a point; put it first if its energy is the lowest, to rounding."""
        piece = self._piece(x)
        lowest = self.pieces[0].evaluation.energy if self.pieces else np.inf
        at = 0 if piece.evaluation.energy <= lowest * (1 + 2 * _EPS) else len(self.pieces)
        self.pieces.insert(at, piece)

    def _piece(self, x: FloatArray) -> Piece:
        found = self.landscape.evaluate(self.landscape.displaced(self.base, x))
        [relaxed] = self._newton.solve(found.gradient[None], _ACCURACY)
        return Piece(x, found, relaxed)

    def times(self, x: FloatArray) -> FloatArray:
        """Multiply by the second derivatives, with the shift that makes them positive."""
        product: FloatArray = self._hessian @ x + self._newton.shift * x
        return product

    def gradients(self) -> FloatArray:
        """(k, n) gradients of the parabolas at the lowest point."""
        first = self.pieces[0]
        return np.array([p.evaluation.gradient + self.times(first.x - p.x) for p in self.pieces])

    def below(self) -> FloatArray:
        """(k,) how far each parabola is below the energy at the lowest point."""
        first = self.pieces[0]
        found = []
        for piece in self.pieces:
            step = first.x - piece.x
            rise = piece.evaluation.gradient @ step + step @ self.times(step) / 2
            found.append(first.evaluation.energy - piece.evaluation.energy - rise)
        return np.maximum(found, 0.0)

    def mixed(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Find the weights of the gradients at the minimum of the largest parabola, their mixture, and the step there."""
        first, gradients = self.pieces[0], self.gradients()
        steps = np.array([p.relaxed + first.x - p.x for p in self.pieces])
        products = gradients @ steps.T
        if not np.isfinite(products).all():
            msg = "second derivatives without an inverse"  # such as of flat faces, where they jump
            raise RuntimeError(msg)
        weights = weights_of(products, self.below())
        return weights, weights @ gradients, -(weights @ steps)

    def draw_near(self, weights: FloatArray) -> None:
        """Take parabolas that count at points nearer to the lowest one, on the way that leads to their side: that of the jump."""
        first, gradients = self.pieces[0], self.gradients()
        for k in range(1, len(self.pieces)):
            far = np.abs(self.pieces[k].x - first.x).max()
            jump = gradients[k] - gradients[0]
            if weights[k] == 0 or far <= self.near or not jump.any():
                continue
            way, distance = jump / np.abs(jump).max(), self.near
            while distance < far:
                there = self._piece(first.x + distance * way)
                gradient = there.evaluation.gradient + self.times(first.x - there.x)
                others = np.linalg.norm(gradients[[0, k]] - gradient, axis=1)
                if others[1] < others[0]:
                    self.pieces[k] = there
                    break
                distance *= _FARTHER

    def is_near(self, weights: FloatArray) -> bool:
        """Whether the points of all parabolas that count are so near that second derivatives add nothing."""
        far = (
            np.abs(p.x - self.pieces[0].x).max()
            for p, w in zip(self.pieces, weights, strict=True)
            if w > 0
        )
        return bool(max(far) <= _FARTHER * self.near)

    def forget(self, weights: FloatArray) -> None:
        """Leave out parabolas that do not count, those of a side that a nearer one has, and the least of too many."""
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
        """Find second derivatives at the lowest point, if it is far from where they were found."""
        first = self.pieces[0]
        if np.abs(first.x).max() <= _RENEW * self.overlap:
            return
        self.base = self.landscape.displaced(self.base, first.x)
        self._differentiate(first.evaluation)
        self.pieces = [self._piece(piece.x - first.x) for piece in self.pieces]


def weights_of(products: FloatArray, below: FloatArray) -> FloatArray:
    """Find the weights, not negative and of sum 1, that make half their square in `products` and `below` least.

    Parameters
    ----------
    products : (k, k) array
        Of gradients, by the inverse of the second derivatives; k is small, since all subsets are tried.
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
    """Lead a state at which a minimisation stalled to the corner of the energy beside it.

    Parameters
    ----------
    landscape : Landscape
    state : State
    tolerance : float
        Largest residual of the mixture.

    Returns
    -------
    Rest or None
        None if forces do not come to balance near by, such as where particles slide.
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
            corner.draw_near(weights)
            corner.forget(weights)
            corner.add(first.x + step)
            corner.renew()
    except (CrossingError, RuntimeError):
        return None
    return None
