"""Flow of the host medium: deformation of the box, and rotation of torque-free particles.

The host moves as u(r) = G r with a constant velocity gradient G, an upper triangular matrix, so that in a time t it
deforms by exp(G t).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from jamshape.arrays import FloatArray, LongArray
from jamshape.packing import rate_of_vector, turned


def exponential(matrix: LongArray) -> LongArray:
    """(D, D) exponential of an upper triangular matrix (D, D), in space without entries above the diagonal in its last column."""
    rates = np.diagonal(matrix)
    found: LongArray = np.diag(np.exp(rates))
    mean, half = (rates[0] + rates[1]) / 2, (rates[0] - rates[1]) / 2
    # (exp(a) - exp(d)) / (a - d), with limit exp(a).
    slope = np.exp(mean) * (np.sinh(half) / half if half else np.longdouble(1))
    found[0, 1] = matrix[0, 1] * slope
    return found


@dataclass(frozen=True, eq=False)
class Host:
    """A host in the plane or in space.

    Parameters
    ----------
    gradient : (D, D) array of float64, [1/time]
        du_k/dr_l, upper triangular; in space without shear along z.
    """

    gradient: FloatArray

    @classmethod
    def compressing(cls, kappa: float, dimension: int = 2) -> Host:
        """Shrink all lengths at a rate."""
        return cls(-kappa * np.eye(dimension))

    @classmethod
    def shearing(cls, gdot: float, flow: str, dimension: int = 2) -> Host:
        """Shear in the plane of x and y at a rate; `flow` is one of `jamshape.flow.shear.FLOWS`."""
        gradient = np.zeros((dimension, dimension))
        gradient[:2, :2] = [[0.0, gdot], [0.0, 0.0]] if flow == "simple" else np.diag([gdot, -gdot])
        return cls(gradient)

    @property
    def rate(self) -> float:
        """Largest of the rates, [1/time]."""
        return float(np.abs(self.gradient).max())

    def deformation(self, time: float) -> LongArray:
        """(D, D) exp(G t)."""
        return exponential(self.gradient.astype(np.longdouble) * time)

    @property
    def turns_particles(self) -> bool:
        """Whether it rotates particles; isotropic compression does not."""
        return bool((self.gradient != self.gradient[0, 0] * np.eye(len(self.gradient))).any())

    def spin(self, bodies: Any, orientation: FloatArray) -> FloatArray:
        """(N, 1 or 3) angular velocities of particles without torque, at (N, 1) angles or (N, 4) quaternions, [1/time]."""
        found: FloatArray = bodies.host_spin(np.ascontiguousarray(orientation), self.gradient)
        return found

    def turns(self, bodies: Any, orientation: FloatArray, time: float) -> FloatArray:
        """(N, 1 or 3) rotations of torque-free particles in a time in which the host deforms little.

        One step of the fourth-order Runge-Kutta method, with an error of fifth order in the strain; in space for
        rotation vectors (Munthe-Kaas 1998, BIT 38, 92).
        """

        def rate(turn: FloatArray) -> FloatArray:
            if turn.shape[1] == 1:
                return self.spin(bodies, orientation + turn)
            return rate_of_vector(turn, self.spin(bodies, turned(orientation, turn)))

        k1 = self.spin(bodies, orientation)
        k2 = rate(0.5 * time * k1)
        k3 = rate(0.5 * time * k2)
        k4 = rate(time * k3)
        return time * (k1 + 2 * k2 + 2 * k3 + k4) / 6
