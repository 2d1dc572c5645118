"""Shear at a constant rate and packing fraction or normal pressure, driven in LAMMPS (Marschall, Keta, Olsson & Teitel 2019)."""

from __future__ import annotations

import dataclasses
import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from jamshape.checks import MOST_STEPS, RANGES, require_in, require_one_of, require_positive
from jamshape.flow.box_control import BoxControl
from jamshape.flow.motion import FlowRun, Motion, drag_over_force

if TYPE_CHECKING:
    from collections.abc import Mapping

    from jamshape.packing import Packing

_WORDS = {"simple": "shear", "pure": "pure"}

FLOWS = tuple(_WORDS)
"""Simple shear, u_x = gdot y, and pure shear, which stretches x and shrinks y."""

LARGEST_STRAIN = 0.01
"""Largest shear of the box in a time step: neighbours pass each other in discrete steps."""

# Drag on a particle held by others, over the strength of a contact, above which rods may begin to cross.
_BEARABLE = 0.5

_STRAINS = {"simple": "shear_strain", "pure": "pure_strain"}


@dataclass(frozen=True, kw_only=True)
class Shearing(Motion):
    """Settings of any shear in LAMMPS, as a base class.

    Parameters
    ----------
    flow
        One of `FLOWS`.
    hold_pressure
        Normal pressure p_yy that the height of the box holds, [energy / length^D]; None holds the volume.
    t_box
        Time in which the height relaxes, [time]; with a pressure. That of `fix overdamped/affine` if None.

    Others as in `Motion`.

    Raises
    ------
    ValueError
        If the flow is unknown or drives a height that yields, a time comes without its pressure, the box would shear by more
        than 0.01 in a time step, or as `Motion`.
    """

    flow: str = "simple"
    hold_pressure: float | None = None
    t_box: float | None = None

    of_packing: ClassVar[Mapping[str, int]] = dict(Motion.of_packing) | {
        "normal_difference": 14, "p_xy": 15, "sigma": 16, "mu": 17, "director": 21,
    }  # fmt: skip
    of_fix: ClassVar[Mapping[str, int]] = dict(Motion.of_fix) | {
        "shear_strain": 16, "pure_strain": 17, "turned": 18,
    }  # fmt: skip
    tilts: ClassVar[bool] = True

    def __post_init__(self) -> None:
        require_one_of("flow", self.flow, FLOWS)
        self._take_pressure()
        super().__post_init__()
        if self.gdot * self.dt > LARGEST_STRAIN * (1 + 1e-9):
            msg = (
                f"gdot = {self.gdot:g} and dt = {self.dt:g} shear by {self.gdot * self.dt:g} in a step,"
                f" expected at most {LARGEST_STRAIN:g}; use a smaller time step"
            )
            raise ValueError(msg)

    def _take_pressure(self) -> None:
        if held := BoxControl.of_shear(self.hold_pressure, self.t_box, self.flow):
            object.__setattr__(self, "hold_pressure", held.pressure)
            object.__setattr__(self, "t_box", held.t_box)

    @property
    @abstractmethod
    def gdot(self) -> float:
        """Magnitude of the rate, [1/time]."""

    @property
    def gradient(self) -> str:
        """Velocity gradient in the syntax of `fix overdamped/affine`."""
        return f"{_WORDS[self.flow]} {self.gdot!r}"

    @property
    def control(self) -> str:
        """Controlled stress in the syntax of `fix overdamped/affine`."""
        if self.hold_pressure is None:
            return ""
        time = "" if self.t_box is None else f" tbox {self.t_box!r}"
        return f" stress yy {self.hold_pressure!r}{time}"

    def times(self, box: float, viscosity: float) -> dict[str, float]:
        """Return the times of the box and of the packing, where a pressure is held."""
        if self.hold_pressure is None:
            return {}
        return {"box_time": box, "relaxation_time": viscosity / self.hold_pressure}

    def stresses(
        self, found: Mapping[str, float], second: float, dimension: int
    ) -> dict[str, float]:
        """Return the normal pressure, where it is controlled."""
        if self.hold_pressure is None:
            return {}
        away = second - found["normal_difference"]
        return {"p_yy": found["pressure"] + away / dimension}

    def strained(self, found: Mapping[str, float]) -> float:
        """Return the strain among observables."""
        return found[_STRAINS[self.flow]]

    def warning(self, packing: Packing) -> str:
        """Return a warning if the rate may drive particles through each other, else an empty text."""
        ratio = drag_over_force(packing, self.gdot, self.k_d, self.k_e)
        if ratio < _BEARABLE:
            return ""
        return (
            f"gdot = {self.gdot:g} drags particles with up to {ratio:.2g} times the force that a contact bears, so that long"
            f" ones may cross, which ends the run; contacts bear rates below {self.gdot * _BEARABLE / ratio:.2g}"
        )


@dataclass(frozen=True)
class Shear(Shearing):
    """Settings of a shear.

    Parameters
    ----------
    gdot
        Rate, [1/time]: dv_x/dy of simple shear, dv_x/dx = -dv_y/dy of pure shear.
    strain_end
        Final strain, the rate times the time since the start.

    Others as in `Shearing`.

    Raises
    ------
    ValueError
        If a number is not positive, pure shear goes beyond 3, or as `Shearing`.
    """

    gdot: float = 1e-4
    strain_end: float = 5.0

    name: ClassVar[str] = "shear"

    def __post_init__(self) -> None:
        require_positive(gdot=self.gdot, strain_end=self.strain_end)
        if self.flow == "pure":
            require_in("strain", self.strain_end, RANGES["pure_strain"])
        super().__post_init__()

    def in_steps(self, rows: int) -> Shear:
        """Return the same with a time step equal to the interval of rows, or a divisor of it."""
        steps = rows * math.ceil(self.strain_end / (rows * LARGEST_STRAIN))
        return dataclasses.replace(self, dt=self.strain_end / (self.gdot * steps))

    def all_steps(self, start: Packing) -> int:
        """Count the time steps from a packing to the end."""
        del start
        return self._steps(self.strain_end)

    def steps_left(self, found: Mapping[str, float], dimension: int) -> int:
        """Count the time steps from observed values to the end."""
        del dimension
        return self._steps(self.strain_end - self.strained(found))

    def where(self, found: Mapping[str, float]) -> str:
        """Describe the position and the end."""
        strain = f"strain {self.strained(found):.4f} of {self.strain_end:g}"
        return f"{strain}, shear stress {-found['p_xy']:.2e}"

    def part(self, found: Mapping[str, float], phi_start: float) -> float:
        """Return the completed fraction of the strain."""
        del phi_start
        return min(1.0, self.strained(found) / self.strain_end)

    def _steps(self, strain: float) -> int:
        if strain > MOST_STEPS * self.gdot * self.dt:
            msg = (
                f"gdot = {self.gdot:g} and dt = {self.dt:g} take more than {MOST_STEPS:g} steps to a strain"
                f" of {self.strain_end:g}, expected a larger rate or time step"
            )
            raise ValueError(msg)
        return max(0, math.ceil(strain / (self.gdot * self.dt) - 1e-6))


ShearRun = FlowRun[Shear]
"""A shear in a LAMMPS session."""
