"""Boxes that yield to a normal stress, as overdamped as the particles: the law of `fix overdamped/affine` for implicit steps.

With the enthalpy H = U + p V, e the logarithmic strain of the box along the controlled axes, m of them, and N particles
of the stiffness k_e,

    m t_box k_e N de/dt = -dH/de = sum over these axes of V (P_kk - p),

that is G_kk = (P_kk - p) / zeta with zeta = t_box k_e N / V. The box is thus one more coordinate of a gradient flow. It is
measured as a length q = e length, such that a change of q moves all neighbours by as much as one of a particle's coordinates
divided by sqrt(N).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jamshape import _contact
from jamshape.arrays import FloatArray, LongArray
from jamshape.checks import ArgumentError, require_positive
from jamshape.landscape import Evaluation, Landscape
from jamshape.landscape.newton import Factorisation
from jamshape.minima.boxes import strains_of

# Packing fraction beyond which contacts, which overlap almost fully, no longer bear a pressure; as in box_control.cpp.
_MOST_DENSE = 4.0


@dataclass(frozen=True)
class BoxControl:
    """A normal stress that a box holds.

    Parameters
    ----------
    pressure : float, [energy / length^D]
    t_box : float, [time], optional
        Time in which the box relaxes; by default as fast as packings do at the pressure (see `default_times`).
    box : str
        ``isotropic``, or normal components that are held, such as ``yy``.

    Raises
    ------
    ValueError
        If a number is not positive.
    """

    pressure: float
    t_box: float | None = None
    box: str = "yy"

    def __post_init__(self) -> None:
        require_positive(hold_pressure=self.pressure)
        if self.t_box is not None:
            require_positive(t_box=self.t_box)

    @classmethod
    def of_shear(cls, pressure: float | None, t_box: float | None, flow: str) -> BoxControl | None:
        """Return the control of the height of a sheared box; None without a pressure.

        Raises
        ------
        ValueError
            If there is a time without a pressure, a number is not positive, or the flow drives the height itself.
        """
        if pressure is None and t_box is None:
            return None
        if pressure is None:
            msg = f"t_box {t_box} without a pressure, expected both or no time"
            raise ValueError(msg)
        held = cls(float(pressure), None if t_box is None else float(t_box))
        if flow != "simple":
            msg = f"flow {flow} drives the height of the box, which a pressure needs, expected flow simple or no pressure"
            raise ValueError(msg)
        return held


def default_times(landscape: Landscape, k_d: float) -> tuple[float, float]:
    """Return the default time of a box, [time], and the viscosity of the host, k_d d^2, [energy time / length^D]."""
    particles = landscape.particles
    mean = float(particles.measures.mean())
    found: tuple[float, float] = _contact.box_times(
        k_d, mean, landscape.stiffness, particles.dimension
    )
    return found


class Border(NamedTuple):
    """Response of the particles to the box, and its stiffness: the border of the matrix of a stage."""

    response: FloatArray
    """(n,) dx/dq."""
    stiffness: float
    """d^2H/dq^2 with particles that follow, [energy / length^2]."""

    def solve(self, inner: FloatArray, force: FloatArray, stiffness: float) -> FloatArray:
        """Solve the bordered equations, where no drag is between particles and box.

        Parameters
        ----------
        inner : (n,) array
            Solution at a fixed box.
        force : (n + 1,) array
            Right side.
        stiffness : float
            Of the box, with drag.
        """
        moved = float(force[-1] + self.response @ force[:-1]) / stiffness
        return np.append(inner + self.response * moved, moved)


@dataclass
class Secant:
    """Stiffness of a box in a stage: first from a border, then from its last two forces."""

    before: tuple[float, float] | None = None

    def stiffness(self, now: tuple[float, float], drag: float, border: Border) -> float:
        """Return the stiffness with drag, from coordinate and force; at least the drag, as of a stable packing."""
        before, self.before = self.before, now
        if before is None or before[0] == now[0]:
            return drag + max(border.stiffness, 0.0)
        return max((before[1] - now[1]) / (now[0] - before[0]), drag)


class YieldingBox:
    """Coordinate of a box that yields.

    Parameters
    ----------
    control : BoxControl
    landscape : Landscape
    k_d : float
        Drag, [energy time / length^(D + 2)].
    """

    def __init__(self, control: BoxControl, landscape: Landscape, k_d: float) -> None:
        particles = landscape.particles
        usual, viscosity = default_times(landscape, k_d)
        t_box = usual if control.t_box is None else control.t_box
        self.times = {"box_time": t_box, "relaxation_time": viscosity / control.pressure}
        """Time of the box, and that in which packings relax at the pressure."""
        self.pressure = control.pressure
        self.axes: FloatArray = np.diagonal(strains_of(control.box, particles.dimension)[0]).copy()
        """(D,) 1 for axes that yield, 0 for others."""
        self._n_axes = float(self.axes.sum())
        self.length = 2 * float(landscape.inner_radius.mean()) * math.sqrt(particles.n)
        """q over the strain, [length]."""
        self._unit: LongArray = np.diag(self.axes).astype(np.longdouble)
        resistance = self._n_axes * t_box * landscape.stiffness * particles.n
        self.drag = resistance / self.length**2
        """Drag coefficient of q, [energy time / length^2]."""
        self.longest_explicit = t_box / particles.dimension
        """Relaxation time of a box whose contacts have a bulk modulus of k_e N / V, [time]."""

    def strain(self, q: float) -> LongArray:
        """(D, D) logarithmic strain."""
        return self._unit * (q / self.length)

    def growth(self, q: float) -> float:
        """Return the volume over that at q = 0."""
        return math.exp(self._n_axes * q / self.length)

    def is_beyond(self, q: float, strain: float) -> bool:
        """Whether the strain at q is larger, or not a number."""
        return not abs(q) <= strain * self.length

    def slope(self, evaluation: Evaluation, volume: float) -> float:
        """Return dH/dq, [energy / length]."""
        held = self._n_axes * self.pressure * volume
        return (held - self._stress(evaluation)) / self.length

    def border(
        self, factors: Factorisation, second: tuple[FloatArray, float], at: tuple[Evaluation, float]
    ) -> Border:
        """Return the border of a matrix.

        Parameters
        ----------
        factors
            Of the matrix.
        second : (n,) array and float
            Derivatives of gradient and energy by the strain, and by it again.
        at
            Evaluation and volume there.
        """
        (coupling, curvature), (evaluation, volume) = second, at
        pulled = coupling / self.length
        response = -factors.solve(pulled)
        # By the logarithm of the strain.
        own = curvature - self._stress(evaluation) + self._n_axes**2 * self.pressure * volume
        return Border(response, own / self.length**2 + float(pulled @ response))

    def require_bearing(self, phi: float) -> None:
        """Raise ArgumentError if contacts no longer bear the pressure."""
        if phi <= _MOST_DENSE:
            return
        said = (
            f"the box shrank to a packing fraction of {phi:.3g}, expected at most {_MOST_DENSE:g}: contacts do not bear"
            " {pressure}; use a smaller one"
        )
        raise ArgumentError(said, {"pressure": self.pressure})

    def _stress(self, evaluation: Evaluation) -> float:
        """Sum the stress times the volume over the axes."""
        return float(self.axes @ np.diagonal(evaluation.virial))
