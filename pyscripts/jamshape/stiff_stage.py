"""The equation of one stage of an implicit step, solved as the minimisation that it is.

In a box of given strain the stage displacement x obeys

    drag (x - x_0) / h + dU/dx = 0,

the minimum of U + (x - x_0).drag (x - x_0) / 2h. Newton's method on it would factorise at every contact that
opens or closes, and never end in the kinks of U. Here the factors of one Hessian serve many stages, and what
has changed since is learnt from differences of gradients (BFGS), of which those across a kink
tell that the kink is a stiff valley (Lewis & Overton, Math. Program. 141, 135 (2013)).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse

from jamshape.landscape import CrossingError, Evaluation, Landscape, State
from jamshape.minimise import Bracket, limited
from jamshape.newton import LEAST_SHIFT, Factorisation
from jamshape.packing import FloatArray

# A stage is given up after so many directions, and factorises anew after so many that did not bring
# it to its end.
_DIRECTIONS = 24
_PER_FACTORISATION = (3, 3, 3, 6, 24)

# Evaluations along one direction; the force along it is to fall to this fraction.
_TRIES = 12
_FALL = 0.5

# A guess with a force above this multiple of the typical one has gone through a collision; to find the
# solution from there takes longer than to come closer to the collision first.
_COLLISION = 30.0

# Pairs of differences that are kept.
_MEMORY = 30


@dataclass(frozen=True, eq=False)
class Stage:
    """One stage.

    Parameters
    ----------
    landscape : Landscape
    base : State
        From which displacements count.
    strain : float
        Of the box since then: x moves particles by (1 + strain) x and turns them by x.
    drag : (n,) array
        Drag coefficients in these coordinates, over h: [energy / length^2].
    centre : (n,) array
        x_0, [length].
    extended : bool
        Whether doubles are too short.
    """

    landscape: Landscape
    base: State
    strain: float
    drag: FloatArray
    centre: FloatArray
    extended: bool

    @property
    def stretch(self) -> FloatArray:
        """(n,) displacement of a particle per coordinate: 1 + strain, or 1 for rotations."""
        return stretch_of(self.landscape, self.strain)

    def state(self, x: FloatArray) -> State:
        """Displace and strain the base."""
        return self.landscape.displaced(self.base, x).strained(self.strain)

    def evaluate(self, x: FloatArray) -> tuple[Evaluation, FloatArray]:
        """Energy of the landscape, and the gradient of what is minimised."""
        found = self.landscape.evaluate(self.state(x), extended=self.extended)
        return found, self.stretch * found.gradient + self.drag * (x - self.centre)

    def factorise(self, x: FloatArray) -> Factorisation:
        """Factorise the Hessian of what is minimised, with a shift if it is not positive definite."""
        stretch = scipy.sparse.diags(self.stretch)
        hessian = self.landscape.curvature(self.state(x)).hessian
        matrix = (stretch @ hessian @ stretch + scipy.sparse.diags(self.drag)).tocsc()
        shift, least = 0.0, LEAST_SHIFT * float(np.abs(matrix.diagonal()).max())
        while True:
            try:
                factors = Factorisation(matrix, shift)
            except RuntimeError:  # exactly singular
                factors = None
            if factors is not None and factors.n_negative == 0:
                return factors
            shift = max(10 * shift, least, float(self.drag.min()))


class Solution(NamedTuple):
    """Where the solution of a stage ended."""

    x: FloatArray
    evaluation: Evaluation
    factors: Factorisation | None
    factorisations: int
    directions: int
    solved: bool


class _Secants:
    """Inverse Hessian by L-BFGS from the factors of an older one."""

    def __init__(self) -> None:
        self._pairs: deque[tuple[FloatArray, FloatArray, float]] = deque(maxlen=_MEMORY)

    def learn(self, step: FloatArray, change: FloatArray) -> None:
        product = float(step @ change)
        if product > 0:
            self._pairs.append((step, change, 1 / product))

    def forget(self) -> None:
        self._pairs.clear()

    def solve(self, factors: Factorisation, right: FloatArray) -> FloatArray:
        q, weights = right.copy(), []
        for step, change, inverse in reversed(self._pairs):
            weights.append(inverse * float(step @ q))
            q -= weights[-1] * change
        q = factors.solve(q)
        for (step, change, inverse), weight in zip(self._pairs, reversed(weights), strict=True):
            q += (weight - inverse * float(change @ q)) * step
        return q


class Units(NamedTuple):
    """What errors are measured in.

    A displacement that changes overlaps counts by their change: in the energy norm, over that of the
    overlaps that are there. One that slides along contacts counts where it has changed the
    overlaps in second order: over the square root of overlap times size.
    """

    force: float
    """Of a typical bond."""
    energy: float
    """Twice the typical energy of the packing."""
    length: float
    """sqrt(overlap size), [length]."""

    def of(
        self, landscape: Landscape, shift: FloatArray, force: FloatArray, drag: FloatArray
    ) -> float:
        """Size of an (n,) displacement, the (n,) force that makes it and the drag over the time."""
        hard = math.sqrt(max(float(shift @ (force - drag * shift)), 0.0) / self.energy)
        return max(hard, rms(landscape, shift) / self.length)


def solve(
    stage: Stage,
    guess: FloatArray,
    factors: Factorisation | None,
    units: Units,
    accuracy: float,
) -> Solution:
    """Solve a stage until the next correction is smaller than `accuracy`.

    Parameters
    ----------
    stage : Stage
    guess : (n,) array
    factors : Factorisation, optional
        Of an earlier, similar stage.
    units : Units
    accuracy : float
        Correction that may be left, in these units.

    Raises
    ------
    CrossingError
        If spines cross at the guess.
    """
    secants, made = _Secants(), 0
    x = guess
    evaluation, gradient = stage.evaluate(x)
    if np.abs(gradient).max(initial=0.0) > _COLLISION * units.force:
        return Solution(x, evaluation, factors, 0, 0, False)
    if factors is None:
        factors, made = stage.factorise(x), 1
    since = 0
    for directions in range(_DIRECTIONS):
        step = -secants.solve(factors, gradient)
        if units.of(stage.landscape, step, -gradient, stage.drag) <= accuracy:
            return Solution(x + step, evaluation, factors, made, directions, True)
        if since >= _PER_FACTORISATION[min(made, len(_PER_FACTORISATION) - 1)]:
            factors, made, since = stage.factorise(x), made + 1, 0
            secants.forget()
            step = -factors.solve(gradient)
        since += 1
        step = limited(stage.landscape, step)
        moved, evaluation, new = _search(stage, x, gradient, evaluation, step)
        secants.learn(moved - x, new - gradient)
        x, gradient = moved, new
    return Solution(x, evaluation, factors, made, directions, False)


def _search(
    stage: Stage, x: FloatArray, gradient: FloatArray, evaluation: Evaluation, step: FloatArray
) -> tuple[FloatArray, Evaluation, FloatArray]:
    """Go along a direction until the force along it has fallen, or turns round in a short bracket."""
    slope = float(gradient @ step)
    bracket, factor = Bracket(slope), 1.0
    best = x, evaluation, gradient
    for _ in range(_TRIES):
        tried = x + factor * step
        try:
            evaluation, new = stage.evaluate(tried)
        except CrossingError:
            factor = bracket.next(factor, np.inf)
            continue
        here = float(new @ step)
        best = tried, evaluation, new
        if abs(here) <= _FALL * abs(slope) or (here < 0 and factor == 1.0):
            break
        factor = bracket.next(factor, here)
    return best


def rms(landscape: Landscape, vector: FloatArray) -> float:
    """Root mean square over particles of an (n,) vector of coordinates."""
    return float(np.linalg.norm(vector)) / math.sqrt(landscape.particles.n)


def stretch_of(landscape: Landscape, strain: float) -> FloatArray:
    """(n,) 1 + strain for displacements, 1 for rotations."""
    stretch = np.ones((landscape.particles.n, landscape.components_per_particle))
    stretch[:, : landscape.particles.dimension] += strain
    return landscape.coordinates(stretch)
