"""The energy landscape around one state, compiled: for the inner loops of integrators and minimisers.

The same energy as `Landscape`, as a function of displacements from a base and of a strain; evaluations
and factorisations cost a fraction of those there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from jamshape import _contact
from jamshape.arrays import FloatArray
from jamshape.landscape.landscape import Evaluation, Landscape
from jamshape.landscape.newton import LONGEST_STEP, WIDEST_TURN, Factorisation
from jamshape.landscape.threads import threads
from jamshape.packing import State, body_axes

# Units of force, energy and length for errors of displacements.
Units = _contact.StageUnits


# Kinks of the energy on which a state is held.
StageKinks = _contact.StageKinks

# Stopping criteria of a minimisation, and Newton's equations.
DescentStop = _contact.DescentStop
NewtonSystem = _contact.NewtonSystem


class DescentEnd(NamedTuple):
    """End of a minimisation, at the base of its local energy model."""

    outcome: str
    evaluation: Evaluation
    rows: list[tuple[float, int, float, float]]
    """Seconds, evaluations, residual and energy density of each state on the way."""


@dataclass(frozen=True, eq=False)
class Stage:
    """One stage of an implicit step: drag (x - centre) + dU/dx = 0, with x relative to the base.

    Parameters
    ----------
    drag : (n,) array
        Drag coefficients in these coordinates over the time: [energy / length^2].
    centre : (n,) array
        [length]
    guesses : two (n,) arrays
        Initial guesses; the second is used if particles collide at the first.
    extended : bool
        Whether to use extended precision.
    """

    drag: FloatArray
    centre: FloatArray
    guesses: tuple[FloatArray, FloatArray]
    extended: bool = False


class StageFactors(NamedTuple):
    """Factors of the Hessian plus drag at a point of a stage."""

    factors: Factorisation
    n_bonds: int
    """Number of bonds at that point."""
    kinks: StageKinks
    """Kinks on which the state was held there."""


class Solution(NamedTuple):
    """End of the iteration for a stage."""

    x: FloatArray
    evaluation: Evaluation
    """Evaluation before the last correction."""
    factors: StageFactors | None
    factorisations: int
    directions: int
    solved: bool
    kinks: StageKinks
    """Kinks on which it ends."""


class LocalEnergyModel:
    """Energy, gradient and Hessian of a landscape around a movable base.

    Parameters
    ----------
    landscape : Landscape
        Landscape whose pair list and evaluation counter are used.
    base : State
        Origin of coordinates.
    along_bodies : bool
        In 3D, whether rotations are about the axes of each body at the base, where its drag is diagonal, instead
        of those of space, and factors solve equations, by iteration where they are incomplete: for stages of a flow.

    Notes
    -----
    Uses the number of `threads` at construction.
    """

    def __init__(self, landscape: Landscape, base: State, *, along_bodies: bool = False) -> None:
        self.landscape, self._along_bodies = landscape, along_bodies
        self._compiled = landscape.bodies.local_energy_model(landscape.skin)
        self._compiled.share(threads())
        if along_bodies:
            self._compiled.follow_bodies()
        self.move_to(base)

    def move_to(self, base: State) -> None:
        """Move the base to another state."""
        self.base = base
        self._compiled.move_to(*base.split)

    def strain_along(self, axes: FloatArray) -> None:
        """Take `strain_derivatives` by the strain of these axes (D,), 0 or 1 each, instead of all."""
        self._compiled.strain_along(axes)

    @property
    def strain_derivatives(self) -> tuple[FloatArray, float]:
        """(n,) derivative of the gradient by the strain, and second derivative of the energy, where a Hessian was last factorised."""
        return self._compiled.coupling, self._compiled.strain_curvature

    def hold(self) -> None:
        """Store the base as the origin of `deform`."""
        self._compiled.hold()

    def deform(self, matrix: FloatArray, turns: FloatArray) -> None:
        """Move the origin to the stored base deformed by a matrix; `base` follows with the next `move`.

        Parameters
        ----------
        matrix : (2, D, D) array of float64
            Upper triangular, high and low parts: for positions and cell vectors.
        turns : (N, 1) or (N, 3) array of float64
            Rotation vectors.
        """
        self._compiled.deform(matrix, turns)

    def forget_pairs(self) -> None:
        """Rebuild the pair list, so that results depend on the base alone, to the last bit."""
        self.landscape.forget_pairs()
        self._compiled.forget_pairs()

    def move(self, x: FloatArray, strain: float) -> None:
        """Move the base to the state `at(x, strain)`."""
        self.base = State.joined(*self._compiled.move(x, strain))

    def at(self, x: FloatArray, strain: float) -> State:
        """Move along (n,) coordinates, then strain box and positions."""
        shift, turn = self.landscape.motion(x)
        if self._along_bodies and self.landscape.particles.dimension == 3:
            axes = body_axes(self.base.orientation.astype(np.float64))
            turn = np.einsum("nb,nbk->nk", turn, axes)
        return self.base.displaced(shift, turn).strained(strain)

    def evaluate(self, x: FloatArray, strain: float, *, extended: bool) -> Evaluation:
        """Evaluate the state `at(x, strain)`, with the errors of `Landscape.evaluate`."""
        self.landscape.evaluations += 1
        return self._accepted(self._compiled.evaluate(x, strain, extended))

    def factorise(self, x: FloatArray, strain: float, diagonal: FloatArray) -> Factorisation:
        """Factorise the Hessian at x plus a diagonal, shifted if it is not positive definite.

        The state at x must have been evaluated.
        """
        return Factorisation(self._compiled.factorise(x, strain, diagonal))

    def solve(
        self, stage: Stage, known: StageFactors | StageKinks | None, units: Units, accuracy: float
    ) -> Solution:
        """Solve a stage until the next correction is smaller than an accuracy in these units.

        Reuses factors of an earlier, similar stage, or only the kinks on which that ended.

        Raises
        ------
        CrossingError
            If spines cross at the second guess.
        """
        limits = _contact.StageLimits(accuracy, self._longest_step, WIDEST_TURN)
        posed = _contact.Stage(
            stage.drag, stage.centre, stage.extended, units, limits, *stage.guesses
        )
        factors, n_bonds, kinks = None, 0, known or StageKinks()
        if isinstance(known, StageFactors):
            factors, n_bonds, kinks = known.factors.compiled, known.n_bonds, known.kinks
        end = self._compiled.solve_stage(posed, factors, n_bonds, kinks)
        self.landscape.evaluations += end.evaluations
        found = None
        if end.factors is not None:
            found = StageFactors(Factorisation(end.factors), end.bonds_of_factors, end.kinks)
        return Solution(
            end.x, self._accepted(end.sums), found, end.factorisations, end.directions, end.solved,
            end.kinks,
        )  # fmt: skip

    def on_kinks(self, x: FloatArray, there: Evaluation, kinks: StageKinks) -> Evaluation:
        """Return the evaluation at x with the gradient of the mixtures on kinks."""
        gradient = self._compiled.mixed_gradient(x, there.gradient, kinks)
        return there._replace(gradient=gradient)

    def descend(self, stop: DescentStop, shift: float) -> DescentEnd:
        """Minimise the energy at fixed box by L-BFGS and Newton's method; the base moves along.

        Parameters
        ----------
        stop : DescentStop
        shift : float, [energy / length^2]
            Initial shift of the Hessian's diagonal.

        Raises
        ------
        CrossingError
            If spines cross at the base.
        ValueError
            If a contact does not converge there.
        """
        end = self._compiled.descend(stop, shift, lambda _row: None)
        self.landscape.evaluations += end.evaluations
        self.base = State.joined(*self._compiled.poses)
        return DescentEnd(end.outcome, self._accepted(end.sums), end.rows)

    def newton(self, shift: float) -> NewtonSystem:
        """Return Newton's equations at the base, with an initial shift of the Hessian's diagonal."""
        return NewtonSystem(self._compiled, shift)

    def part_within(self, x: FloatArray) -> float:
        """Return the fraction, at most 1, of a step along (n,) coordinates within the trust radius."""
        return float(self._compiled.part_within(x, self._longest_step, WIDEST_TURN))

    @property
    def _longest_step(self) -> float:
        return LONGEST_STEP * 0.5 * self.landscape.length

    def _accepted(self, found: Any) -> Evaluation:
        energy, gradient, strain_gradient, bond_force, n_bonds, crossing, unconverged, virial = (
            found
        )
        self.landscape.refuse(crossing, unconverged)
        bond_force /= max(n_bonds, 1)
        virial = virial.reshape(self.base.dimension, -1)
        return Evaluation(energy, gradient, strain_gradient, bond_force, n_bonds, virial)
