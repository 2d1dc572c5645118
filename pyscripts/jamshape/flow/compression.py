"""Compression through jamming, driven in LAMMPS (Marschall & Teitel 2018, Sec. II)."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from jamshape.checks import MOST_STEPS, require_number, require_positive
from jamshape.flow.motion import FlowRun, Motion

if TYPE_CHECKING:
    from collections.abc import Mapping

    from jamshape.packing import Packing


@dataclass(frozen=True)
class Compression(Motion):
    """Settings of a compression.

    Parameters
    ----------
    kappa
        Rate, dL/dt = -kappa L, [1/time]; negative to open the box.
    phi_end
        Final packing fraction.
    p_end
        Final pressure, [energy / length^D]: the run ends also at the first row that has it; None for none.

    Others as in `Motion`.

    Raises
    ------
    ValueError
        If the rate is zero, another number not positive, or as `Motion`.
    """

    kappa: float = 1e-4
    phi_end: float = 0.9
    p_end: float | None = None

    name: ClassVar[str] = "compression"

    def __post_init__(self) -> None:
        if require_number("kappa", self.kappa) == 0:
            msg = f"kappa is {self.kappa}, expected a rate other than zero"
            raise ValueError(msg)
        require_positive(phi_end=self.phi_end)
        if self.p_end is not None:
            require_positive(p_end=self.p_end)
            object.__setattr__(self, "p_end", float(self.p_end))
        super().__post_init__()

    @property
    def gradient(self) -> str:
        """Velocity gradient in the syntax of `fix overdamped/affine`."""
        return f"compress {self.kappa!r}"

    def in_steps(self, phi: float, steps: int, dimension: int = 2) -> Compression:
        """Return the same with a time step such that this number of them leads from `phi` to the end."""
        strain = math.log(self.phi_end / phi) / dimension
        return dataclasses.replace(self, dt=strain / (self.kappa * steps))

    def steps(self, phi: float, dimension: int = 2) -> int:
        """Count the time steps from packing fraction `phi` to `phi_end`.

        Raises
        ------
        ValueError
            If there are more than anyone can wait for.
        """
        strain, of_a_step = math.log(self.phi_end / phi), dimension * self.kappa * self.dt
        if abs(strain) > MOST_STEPS * abs(of_a_step):
            msg = (
                f"kappa = {self.kappa:g} and dt = {self.dt:g} take more than {MOST_STEPS:g} steps from"
                f" phi = {phi:g} to {self.phi_end:g}, expected a larger rate or time step"
            )
            raise ValueError(msg)
        return max(0, math.ceil(strain / of_a_step - 1e-6))

    def all_steps(self, start: Packing) -> int:
        """Count the time steps from a packing to the end."""
        return self.steps(start.phi, start.dimension)

    def steps_left(self, found: Mapping[str, float], dimension: int) -> int:
        """Count the time steps from observed values to the end; errors as in `Motion`."""
        phi = found["phi"]
        if phi > self.phi_end:
            msg = f"The state has phi = {phi:.6g}, expected less than phi_end = {self.phi_end}."
            raise ValueError(msg)
        return self.steps(phi, dimension)

    def is_over(self, found: Mapping[str, float]) -> bool:
        """Whether the final pressure is reached."""
        return self.p_end is not None and found["pressure"] >= self.p_end

    def where(self, found: Mapping[str, float]) -> str:
        """Describe the position and the end."""
        until = "" if self.p_end is None else f" or to pressure {self.p_end:g}"
        return f"phi {found['phi']:.4f} of {self.phi_end:g}{until}"

    def part(self, found: Mapping[str, float], phi_start: float) -> float:
        """Return the completed fraction of the strain."""
        done = math.log(found["phi"] / phi_start) / math.log(self.phi_end / phi_start)
        return min(1.0, done)


CompressionRun = FlowRun[Compression]
"""A compression in a LAMMPS session."""
