"""Flow of the host medium: deformation of the box, and rotation of torque-free particles.

The host moves as u(r) = G r with a constant velocity gradient G, an upper triangular matrix, so that in a time t it
deforms by exp(G t). In two dimensions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from jamshape.arrays import FloatArray, LongArray


@dataclass(frozen=True, eq=False)
class Host:
    """A host in the plane.

    Parameters
    ----------
    gradient : (2, 2) array of float64, [1/time]
        du_k/dr_l, upper triangular.
    """

    gradient: FloatArray

    @classmethod
    def compressing(cls, kappa: float) -> Host:
        """Shrink all lengths at a rate."""
        return cls(-kappa * np.eye(2))

    @classmethod
    def shearing(cls, gdot: float, flow: str) -> Host:
        """Shear at a rate; `flow` is one of `jamshape.flow.shear.FLOWS`."""
        if flow == "simple":
            return cls(np.array([[0.0, gdot], [0.0, 0.0]]))
        return cls(np.diag([gdot, -gdot]))

    @property
    def rate(self) -> float:
        """Largest of the rates, [1/time]."""
        return float(np.abs(self.gradient).max())

    def deformation(self, time: float) -> LongArray:
        """(2, 2) exp(G t)."""
        a, d = (np.longdouble(self.gradient[k, k]) * time for k in (0, 1))
        mean, half = (a + d) / 2, (a - d) / 2
        # (exp(a) - exp(d)) / (a - d), with limit exp(a).
        slope = np.exp(mean) * (np.sinh(half) / half if half else np.longdouble(1))
        corner = np.longdouble(self.gradient[0, 1]) * time * slope
        return np.array([[np.exp(a), corner], [np.longdouble(0), np.exp(d)]])

    @property
    def turns_particles(self) -> bool:
        """Whether it rotates particles; isotropic compression does not."""
        (a, b), (_, d) = self.gradient
        return bool(a != d or b != 0.0)

    def spin(self, bodies: Any, angle: FloatArray) -> FloatArray:
        """(N,) angular velocities of particles without torque, at (N,) angles, [1/time]."""
        found: FloatArray = bodies.host_spin(np.ascontiguousarray(angle[:, None]), self.gradient)
        return found[:, 0]

    def turns(self, bodies: Any, angle: FloatArray, time: float) -> FloatArray:
        """(N,) rotations of torque-free particles in a time in which the host deforms little.

        One step of the fourth-order Runge-Kutta method, with an error of fifth order in the strain.
        """
        k1 = self.spin(bodies, angle)
        k2 = self.spin(bodies, angle + 0.5 * time * k1)
        k3 = self.spin(bodies, angle + 0.5 * time * k2)
        k4 = self.spin(bodies, angle + time * k3)
        return time * (k1 + 2 * k2 + 2 * k3 + k4) / 6
