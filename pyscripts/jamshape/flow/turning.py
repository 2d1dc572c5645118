"""Rotations of particles within a trial step, by the host and by forces.

The coordinates of a particle's rotation are those relative to a particle that follows the host alone: in the plane the
difference psi of their angles, in space the rotation vector psi about body axes, Q = Q_host exp(psi). With the right Jacobian J
of psi, J psi' is the difference of their angular velocities about body axes, and J^-T dU/dpsi the torque, so that

    psi' = -J^-1 M^-1 J^-T dU/dpsi + J^-1 (w - w_host),

M the drag, which is diagonal about body axes, w what the host alone would cause. The stages of an implicit step solve
psi' = -M^-1 dU/dpsi + excess.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from jamshape.packing import body_axes, spin_of_vector, turned

if TYPE_CHECKING:
    from jamshape.arrays import FloatArray
    from jamshape.flow.host import Host
    from jamshape.landscape import Landscape


class Turning:
    """Rotations in the plane.

    Parameters
    ----------
    landscape
    begun : (N, 1) or (N, 4) array of float64
        Angles or quaternions at the start of the step.
    """

    _host: Host

    def __init__(self, landscape: Landscape, begun: FloatArray) -> None:
        self._landscape, self._begun = landscape, begun
        self._now = begun
        """Orientations of particles that follow the host alone."""

    def by_host(self, host: Host, after: float) -> FloatArray:
        """Follow a host for a time since the start; return its (N, 1 or 3) rotations."""
        self._host = host
        if not self._host.turns_particles:
            return np.zeros((len(self._begun), 1))
        turns = self._host.turns(self._landscape.bodies, self._begun, after)
        self._now = self._begun + turns
        return turns

    def mean(self, x: FloatArray) -> float:
        """Average the rotation of particles about z, by host and by forces as far as (n,) coordinates."""
        host = self._now - self._begun if self._host.turns_particles else np.zeros_like(self._now)
        return float((host + self._landscape.motion(x)[1])[:, 0].mean())

    def excess(self, x: FloatArray, velocity: FloatArray) -> FloatArray:
        """(n,) velocity at (n,) coordinates in excess of that by the gradient there, if the velocity is about this."""
        del velocity
        if not self._host.turns_particles:
            return np.zeros(self._landscape.size)
        bodies = self._landscape.bodies
        spin = self._host.spin(bodies, self._now + self._landscape.motion(x)[1])
        spin -= self._host.spin(bodies, self._now)
        return self._as_coordinates(spin)

    def settled(self, x: FloatArray, velocity: FloatArray) -> FloatArray:
        """(n,) velocity at (n,) coordinates as that at the origin of the next step, which is there."""
        return velocity - self.excess(x, velocity)

    def _as_coordinates(self, rates: FloatArray) -> FloatArray:
        """Gather (N, 1 or 3) angular velocities in (n,) coordinates."""
        D = self._landscape.particles.dimension
        components = np.zeros((len(rates), D + rates.shape[1]))
        components[:, D:] = rates * self._landscape.rotation_length[:, None]
        return self._landscape.coordinates(components)


class TurningInSpace(Turning):
    """Rotations in space; without any if all particles are round."""

    def by_host(self, host: Host, after: float) -> FloatArray:
        """Follow a host for a time since the start; return its (N, 3) rotations."""
        self._host = host
        if not (self._host.turns_particles and self._can_turn):
            return np.zeros((len(self._begun), 3))
        turns = self._host.turns(self._landscape.bodies, self._begun, after)
        self._now = turned(self._begun, turns)
        self._turns = turns
        return turns

    def mean(self, x: FloatArray) -> float:
        """Average the rotation of particles about z, by host and by forces as far as (n,) coordinates."""
        if not self._can_turn:
            return 0.0
        along_z = body_axes(self._now)[:, :, 2]
        turns = (along_z * self._landscape.motion(x)[1]).sum(axis=1)
        if self._host.turns_particles:
            turns += self._turns[:, 2]
        return float(turns.mean())

    def excess(self, x: FloatArray, velocity: FloatArray) -> FloatArray:
        """(n,) velocity at (n,) coordinates in excess of that by the gradient there, if the velocity is about this."""
        if not self._can_turn:
            return np.zeros(self._landscape.size)
        turn, rate = self._landscape.motion(x)[1], self._landscape.motion(velocity)[1]
        moment = self._landscape.bodies.moment
        by_torque = spin_of_vector(-turn, rate) - self._beyond_host(turn)
        by_gradient = spin_of_vector(turn, moment * by_torque) / moment
        return self._as_coordinates(rate - by_gradient)

    def settled(self, x: FloatArray, velocity: FloatArray) -> FloatArray:
        """(n,) velocity at (n,) coordinates as that at the origin of the next step, which is there."""
        if not self._can_turn:
            return velocity
        turn, rate = self._landscape.motion(x)[1], self._landscape.motion(velocity)[1]
        spin = spin_of_vector(-turn, rate) - self._beyond_host(turn)
        return velocity + self._as_coordinates(spin - rate)

    @property
    def _can_turn(self) -> bool:
        return bool(self._landscape.rotation_length.any())

    def _beyond_host(self, turn: FloatArray) -> FloatArray:
        """(N, 3) host rotation about body axes of particles that forces have rotated, less that of others."""
        if not self._host.turns_particles:
            return np.zeros_like(turn)
        bodies = self._landscape.bodies
        # Body axes: Q_host exp(turn), its rotation vector in space that of the turn along the axes of Q_host.
        vector = np.einsum("nb,nbk->nk", turn, body_axes(self._now))
        there = turned(self._now, vector)
        spin = self._host.spin(bodies, there) - self._host.spin(bodies, self._now)
        found: FloatArray = np.einsum("nbk,nk->nb", body_axes(there), spin)
        return found


def turning_of(landscape: Landscape, begun: FloatArray) -> Turning:
    """Return the rotations of a step in this dimension."""
    kind = Turning if landscape.particles.dimension == 2 else TurningInSpace
    return kind(landscape, begun)
