"""Shear to and fro between two strains at a constant rate, driven in LAMMPS."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from jamshape.checks import MOST_STEPS, RANGES, require_in, require_positive, require_stated
from jamshape.flow.shear import LARGEST_STRAIN, Shearing

if TYPE_CHECKING:
    from jamshape.packing import Packing

QUARTERS = 4
"""Number of quarters of a cycle: to the amplitude, to 0, to minus the amplitude, and to 0."""

_ROUNDING = 1e-6  # of a number of steps


@dataclass(frozen=True)
class CyclicShear(Shearing):
    """Settings of a cyclic shear.

    The strain is a triangle wave, which begins at 0 with a positive rate.

    Parameters
    ----------
    amplitude
        Largest strain.
    period
        Time of a cycle, [time].
    cycles
        Number of cycles.

    Others as in `Shearing`.

    Raises
    ------
    ValueError
        If a number is out of its range, a quarter of the period is no multiple of the time step, or as `Shearing`.
    """

    amplitude: float = 0.05
    period: float = 2000.0
    cycles: int = 20

    of_fix: ClassVar[Mapping[str, int]] = dict(Shearing.of_fix) | {
        "dissipation": 4, "torque_power": 19,
    }  # fmt: skip
    name: ClassVar[str] = "cyclic shear"

    def __post_init__(self) -> None:
        require_positive(amplitude=self.amplitude, period=self.period)
        require_stated(cycles=self.cycles)
        if self.flow == "pure":
            require_in("amplitude", self.amplitude, RANGES["pure_strain"])
        super().__post_init__()
        steps = self.period / (QUARTERS * self.dt)
        if round(steps) < 1 or abs(steps - round(steps)) > _ROUNDING * max(1.0, steps * 1e-6):
            msg = (
                f"dt = {self.dt:g} divides a quarter of the period into {steps:g} steps, expected a whole number;"
                " choose another time step"
            )
            raise ValueError(msg)

    @property
    def gdot(self) -> float:
        """Magnitude of the rate, [1/time]."""
        return QUARTERS * self.amplitude / self.period

    @property
    def steps_per_cycle(self) -> int:
        """Number of time steps in a cycle."""
        return QUARTERS * round(self.period / (QUARTERS * self.dt))

    def turns_at(self, step: int) -> bool:
        """Whether the rate changes its sign after a step."""
        return step % (self.steps_per_cycle // 2) == self.steps_per_cycle // QUARTERS

    def gradient_at(self, step: int) -> str:
        """Velocity gradient of the steps that follow one."""
        quarter = step // (self.steps_per_cycle // QUARTERS) % QUARTERS
        word, rate = self.gradient.split()
        return self.gradient if quarter in {0, QUARTERS - 1} else f"{word} -{rate}"

    def all_steps(self, start: Packing) -> int:
        """Count the time steps from a packing to the end."""
        del start
        if self.cycles * self.period > MOST_STEPS * self.dt:
            msg = (
                f"cycles = {self.cycles} of period = {self.period:g} take more than {MOST_STEPS:g} steps of dt ="
                f" {self.dt:g}, expected fewer or a larger time step"
            )
            raise ValueError(msg)
        return self.cycles * self.steps_per_cycle

    def steps_left(self, found: Mapping[str, float], dimension: int) -> int:
        """Count the time steps from observed values, and the ``step``, to the end."""
        del dimension
        return self.cycles * self.steps_per_cycle - int(found["step"])

    def where(self, found: Mapping[str, float]) -> str:
        """Describe the position and the end."""
        at = f"cycle {found['cycle']:.2f} of {self.cycles}, strain {self.strained(found):.4f}"
        return f"{at}, shear stress {-found['p_xy']:.2e}"

    def part(self, found: Mapping[str, float], phi_start: float) -> float:
        """Return the completed fraction of the cycles."""
        del phi_start
        return found["cycle"] / self.cycles


def dividing(period: float, rows: int, longest: float) -> float:
    """Return the longest time step that divides the interval of rows, a fraction of a period.

    Examples
    --------
    >>> dividing(100.0, 20, 0.3)
    0.29411764705882354
    """
    return period / (rows * math.ceil(period / (rows * longest) - _ROUNDING))


def longest_step(amplitude: float, period: float) -> float:
    """Return the time in which the box shears by the largest strain of a time step."""
    return LARGEST_STRAIN * period / (QUARTERS * amplitude)
