"""The equation of one stage of an implicit step, solved as the minimisation that it is.

In a box of given strain the stage displacement x obeys

    drag (x - x_0) / h + dU/dx = 0,

the minimum of U + (x - x_0).drag (x - x_0) / 2h. Its gradient is smooth between the kinks where bonds open and
close, and Newton's full steps find which of them do so for all bonds at once (semismooth Newton: Qi & Sun, Math.
Program. 58, 353 (1993)), mostly in three or four evaluations; searching along each step would let through one
bond at a time. On a kink that holds the solution steps go to and fro: it is found by bisection and kept as a stiff
valley (Lewis & Overton, Math. Program. 141, 135 (2013)). Stages that do not end are given up soon: half of the
time, the time step was too long anyway.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from jamshape.landscape import CrossingError, Evaluation, Landscape
from jamshape.minimise import limited
from jamshape.newton import Factorisation
from jamshape.packing import FloatArray
from jamshape.vicinity import Vicinity

# A stage is given up after so many directions.
_DIRECTIONS = 10

# After so many directions, which are enough for smooth stages, what is left are kinks: where the force along a
# step has turned round, to this fraction of what it was, and the solution is nearer than so many accuracies or
# steps go straight to and fro, with this cosine.
_SMOOTH, _OVERSHOT, _NEAR, _BACK = 3, 0.3, 100.0, 0.95

# After these directions a solution may be so many accuracies away, less than the error of the step: on several
# kinks at once the last digits take long. It is put half-way along the step, between the sides of a kink.
_ON_KINKS = 10.0

# A guess with a force above this multiple of the typical one has gone through a collision.
_COLLISION = 30.0


@dataclass(frozen=True, eq=False)
class Stage:
    """One stage.

    Parameters
    ----------
    vicinity : Vicinity
        About the state from which displacements count.
    strain : float
        Of the box since then: x moves particles by (1 + strain) x and turns them by x.
    drag : (n,) array
        Drag coefficients in these coordinates, over h: [energy / length^2].
    centre : (n,) array
        x_0, [length].
    extended : bool
        Whether doubles are too short.
    """

    vicinity: Vicinity
    strain: float
    drag: FloatArray
    centre: FloatArray
    extended: bool

    @cached_property
    def stretch(self) -> FloatArray:
        """(n,) displacement of a particle per coordinate: 1 + strain, or 1 for rotations."""
        return stretch_of(self.landscape, self.strain)

    @property
    def landscape(self) -> Landscape:
        """The landscape of the vicinity."""
        return self.vicinity.landscape

    def evaluate(self, x: FloatArray) -> tuple[Evaluation, FloatArray]:
        """Energy of the landscape, and the gradient of what is minimised."""
        found = self.vicinity.evaluate(x, self.strain, extended=self.extended)
        return found, self.stretch * found.gradient + self.drag * (x - self.centre)

    def factorise(self, x: FloatArray) -> Factorisation:
        """Factorise the Hessian of what is minimised, with a shift if it is not positive definite."""
        return self.vicinity.factorise(x, self.strain, self.drag)


class Solution(NamedTuple):
    """Where the solution of a stage ended."""

    x: FloatArray
    evaluation: Evaluation
    factors: Factorisation | None
    factorisations: int
    directions: int
    solved: bool


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
    guesses: tuple[FloatArray, FloatArray],
    factors: Factorisation | None,
    units: Units,
    accuracy: float,
) -> Solution:
    """Solve a stage until the next correction is smaller than `accuracy`.

    Parameters
    ----------
    stage : Stage
    guesses : two (n,) arrays
        The second is for when particles collide at the first.
    factors : Factorisation, optional
        Of an earlier, similar stage.
    units : Units
    accuracy : float
        Correction that may be left, in these units; ten times as much on kinks.

    Raises
    ------
    CrossingError
        If spines cross at the second guess.
    """
    at, made, kinks = _begun(stage, guesses, units), 0, _Kinks(stage, units)
    before = np.zeros(stage.landscape.size)
    for directions in range(_DIRECTIONS):
        correction = kinks.correction(factors, at) if factors else None
        if correction is None or correction.size > accuracy:
            factors, made = stage.factorise(at.x), made + 1
            correction = kinks.correction(factors, at)
        step, size = correction
        if size <= accuracy:
            return Solution(at.x + step, at.evaluation, factors, made, directions, True)
        if directions > _SMOOTH and size <= _ON_KINKS * accuracy:
            return Solution(at.x + 0.5 * step, at.evaluation, factors, made, directions, True)
        step = limited(stage.landscape, step)
        try:
            tried = _Point.of(stage, at.x + step)
            overshot = tried.gradient @ step > -_OVERSHOT * (at.gradient @ step)
            is_kink = size <= _NEAR * accuracy or _turns_round(step, before)
            if directions >= _SMOOTH and overshot and is_kink:
                tried = kinks.between(at, tried, accuracy / size)
        except CrossingError:
            break
        at, before = tried, step
    return Solution(at.x, at.evaluation, factors, made, directions, False)


class _Point(NamedTuple):
    """A displacement, and what was found there."""

    x: FloatArray
    evaluation: Evaluation
    gradient: FloatArray

    @classmethod
    def of(cls, stage: Stage, x: FloatArray) -> _Point:
        return cls(x, *stage.evaluate(x))


class _Correction(NamedTuple):
    """A step, and how large it is in the units of errors."""

    step: FloatArray
    size: float


def _begun(stage: Stage, guesses: tuple[FloatArray, FloatArray], units: Units) -> _Point:
    """Evaluate the guess to start from."""
    with contextlib.suppress(CrossingError):
        first = _Point.of(stage, guesses[0])
        if np.abs(first.gradient).max(initial=0.0) <= _COLLISION * units.force:
            return first
    return _Point.of(stage, guesses[1])


def _turns_round(step: FloatArray, before: FloatArray) -> bool:
    """Whether a step goes straight back."""
    return float(step @ before) < -_BACK * float(np.linalg.norm(step) * np.linalg.norm(before))


class _Kinks:
    """Kinks that were found, as stiff valleys on top of the factors (BFGS), and how to find one."""

    def __init__(self, stage: Stage, units: Units) -> None:
        self._stage, self._units = stage, units
        self._pairs: list[tuple[FloatArray, FloatArray, float]] = []

    def correction(self, factors: Factorisation, at: _Point) -> _Correction:
        """Newton's step from a point."""
        q, weights = -at.gradient, []
        for across, jump, inverse in reversed(self._pairs):
            weights.append(inverse * float(across @ q))
            q = q - weights[-1] * jump
        q = factors.solve(q)
        for (across, jump, inverse), weight in zip(self._pairs, reversed(weights), strict=True):
            q += (weight - inverse * float(jump @ q)) * across
        stage = self._stage
        return _Correction(q, self._units.of(stage.landscape, q, -at.gradient, stage.drag))

    def between(self, low: _Point, high: _Point, width: float) -> _Point:
        """Find a kink by bisection, to a part of the way between two points.

        The gradient is the mean of its sides' that does not push across: zero where it holds the solution.
        """
        way = high.x - low.x
        for _ in range(math.ceil(math.log2(1 / width))):
            middle = _Point.of(self._stage, 0.5 * (low.x + high.x))
            if float(middle.gradient @ way) > 0:
                high = middle
            else:
                low = middle
        across, jump = high.x - low.x, high.gradient - low.gradient
        here, there = float(low.gradient @ across), float(high.gradient @ across)
        self._pairs.append((across, jump, 1 / (there - here)))
        mean = (there * low.gradient - here * high.gradient) / (there - here)
        return _Point(high.x, high.evaluation, mean)


def rms(landscape: Landscape, vector: FloatArray) -> float:
    """Root mean square over particles of an (n,) vector of coordinates."""
    return float(np.linalg.norm(vector)) / math.sqrt(landscape.particles.n)


def stretch_of(landscape: Landscape, strain: float) -> FloatArray:
    """(n,) 1 + strain for displacements, 1 for rotations."""
    return np.where(landscape.is_rotation, 1.0, 1.0 + strain)
