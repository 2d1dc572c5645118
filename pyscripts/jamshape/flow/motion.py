"""Overdamped motion of particles in a flowing host, driven in LAMMPS: the common part of all flows."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

import numpy as np

from jamshape.checks import require_one_of, require_positive
from jamshape.files.checkpoint import Checkpoint
from jamshape.lammps.module import one_at_a_time
from jamshape.packing import Packing
from jamshape.shapes.shape import Stiffness, stiffness_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from jamshape.lammps.session import Session

# Columns of `compute packing` and elements of `fix overdamped/affine`, as in their doc comments.
_PACKING = {
    "phi": 0, "u": 1, "pressure": 2, "z": 3, "S_2": 4, "S_4": 5, "fmax": 6, "frms": 7,
    "z_single": 8, "rattlers": 9, "bonds": 10, "overlap": 11, "tmax": 12,
}  # fmt: skip
_SECOND = 20  # normal stress difference p_yy - p_zz
_FLOW = {"strain": 1, "lambda_max": 2, "dt_max": 3, "evaluations": 5, "step_error": 7}
_SUBSTEPS = {"substeps": 8, "rejected": 9, "forced": 10, "substep": 11, "substep_shortest": 12,
             "local_error": 13, "stages": 14, "overlap_length": 15}  # fmt: skip

_OF_BOX = (20, 21)  # its time, and the viscosity of the host

INTEGRATORS = ("heun", "heun/adaptive", "rkc2")
"""Integrators of `fix overdamped/affine`; all but the first choose their own steps."""

_LONGEST_RUN = 1_000_000_000  # steps in one `run` command, which counts in 32 bits


@dataclass(frozen=True, kw_only=True)
class Motion(ABC):
    """Settings of motion in a host, apart from its rate.

    Parameters
    ----------
    dt
        Time step, [time]; an adaptive integrator divides it as needed.
    sides
        Bonds of a side-to-side contact, 1 or 2.
    k_e, k_d
        Stiffness [energy], of each pair of species as in `Interaction`, and drag [energy time / length^(D + 2)].
    integrator
        One of `INTEGRATORS`.
    tolerance
        Local error over the typical overlap, for adaptive integrators.

    Raises
    ------
    ValueError
        If a step, stiffness, drag or tolerance is not positive, `sides` is neither 1 nor 2, or the integrator is
        unknown.
    """

    dt: float = 0.05
    sides: int = 1
    k_e: Stiffness = 1.0
    k_d: float = 1.0
    integrator: str = "heun"
    tolerance: float = 1e-4

    of_packing: ClassVar[Mapping[str, int]] = _PACKING
    """Observables, with their columns in `compute packing`."""
    of_fix: ClassVar[Mapping[str, int]] = _FLOW
    """The same for `fix overdamped/affine`."""
    tilts: ClassVar[bool] = False
    """Whether the box tilts."""
    name: ClassVar[str] = "flow"
    """Name in messages."""

    def __post_init__(self) -> None:
        numbers = ("dt", "k_d", "tolerance", *(() if np.ndim(self.k_e) else ("k_e",)))
        require_positive(**{name: getattr(self, name) for name in numbers})
        object.__setattr__(self, "k_e", stiffness_of(self.k_e))
        require_one_of("sides", self.sides, (1, 2))
        # It becomes LAMMPS input, and may come from a file.
        require_one_of("integrator", self.integrator, INTEGRATORS)
        for f in dataclasses.fields(self):
            if (
                isinstance(f.default, float) and f.name != "k_e"
            ):  # not a NumPy scalar, which LAMMPS cannot read
                object.__setattr__(self, f.name, float(getattr(self, f.name)))

    @property
    def chooses_steps(self) -> bool:
        """Whether the integrator is adaptive and divides the time step."""
        return self.integrator != "heun"

    @property
    @abstractmethod
    def gradient(self) -> str:
        """Velocity gradient in the syntax of `fix overdamped/affine`."""

    @property
    def control(self) -> str:
        """Controlled stress in the syntax of `fix overdamped/affine`."""
        return ""

    def stresses(
        self, found: Mapping[str, float], second: float, dimension: int
    ) -> dict[str, float]:
        """Further observables, from the others and the second normal stress difference."""
        del found, second, dimension
        return {}

    def times(self, box: float, viscosity: float) -> dict[str, float]:
        """Return the times to report, from that in which the box relaxes and the viscosity of the host at the size of particles."""
        del box, viscosity
        return {}

    def gradient_at(self, step: int) -> str:
        """Velocity gradient of the steps that follow one."""
        del step
        return self.gradient

    @abstractmethod
    def all_steps(self, start: Packing) -> int:
        """Count the time steps from a packing to the end."""

    @abstractmethod
    def steps_left(self, found: Mapping[str, float], dimension: int) -> int:
        """Count the time steps from observed values, and the ``step``, to the end.

        Raises
        ------
        ValueError
            If the end is already passed.
        """

    def is_over(self, found: Mapping[str, float]) -> bool:
        """Whether observed values end the run before its last step."""
        del found
        return False

    @abstractmethod
    def where(self, found: Mapping[str, float]) -> str:
        """Describe the position and the end."""

    @abstractmethod
    def part(self, found: Mapping[str, float], phi_start: float) -> float:
        """Return the completed fraction, from 0 to 1."""


@dataclass(frozen=True)
class Row:
    """One row of a run: position and observables."""

    step: int
    time: float
    wall_seconds: float
    observables: dict[str, float]


def drag_over_force(packing: Packing, rate: float, k_d: float = 1.0, k_e: Stiffness = 1.0) -> float:
    """Estimate the drag on a particle held by others, over the strength of one contact.

    The drag is that at the host's velocity at its outer radius; a contact bears its stiffness, the smallest
    of a table, over the distance of first touch.
    """
    pull = k_d * packing.measures * rate * packing.outer_radius
    return float((2 * pull * packing.inner_radius).max() / np.min(k_e))


_Motion = TypeVar("_Motion", bound=Motion)


class FlowRun(Generic[_Motion]):
    """A flow in a LAMMPS session, from a packing or from a restart file.

    Parameters
    ----------
    session
        Fresh session.
    settings
    start
        Initial state; of an earlier run, any of its states.
    checkpoint
        Checkpoint of an earlier run to resume.

    Raises
    ------
    ValueError
        If the end is before the state.
    """

    def __init__(
        self,
        session: Session,
        settings: _Motion,
        start: Packing,
        checkpoint: Checkpoint | None = None,
    ) -> None:
        self.session, self.settings = session, settings
        self._began = perf_counter()
        self._time, self._step_of_time, self._evaluations = 0.0, 0, 0.0
        if checkpoint is None:
            session.load(start)
        else:
            self._began -= checkpoint["wall_seconds"]
            self._time, self._step_of_time = checkpoint["time"], checkpoint["step_of_time"]
            self._evaluations = checkpoint["evaluations"]
            session.load_restart(checkpoint["restart"], start)
        self._set_up(start)
        found = self.measure() | {"step": session.step}
        self.last_step = session.step + settings.steps_left(found, start.dimension)

    def _set_up(self, start: Packing) -> None:
        s = self.settings
        self.session.interact(start.law.but(s.k_e, s.sides))
        # A box from a restart file tilts if it did.
        tilt = "change_box all triclinic" if s.tilts and not self.session.is_tilted else ""
        self.session.commands(f"""
            {tilt}
            {self.session.neighbours()}
            {self._fix()}
            timestep {s.dt!r}
            compute packing all packing
            thermo_style custom step c_packing[1]
            thermo_modify norm no lost error
            run 0 post no
        """)

    def _fix(self) -> str:
        s = self.settings
        return (
            f"fix flow all overdamped/affine drag {s.k_d!r} {s.gradient_at(self.session.step)}{s.control}"
            f" integrator {s.integrator}"
            f"{f' tolerance {s.tolerance!r}' if s.chooses_steps else ''}"
        )

    def change(self, **changes: Any) -> None:
        """Continue with other settings, such as another rate or time step."""
        self._time, self._step_of_time = self.time, self.session.step
        self._evaluations = self.measure()["evaluations"]
        self.settings = dataclasses.replace(self.settings, **changes)
        self.session.commands(
            f"unfix flow\n{self._fix()}\ntimestep {self.settings.dt!r}\nrun 0 post no"
        )

    def steer(self) -> None:
        """Continue with the velocity gradient of the present step; strain and integrator continue."""
        gradient = self.settings.gradient_at(self.session.step)
        self.session.commands(f"fix_modify flow {gradient}\nrun 0 post no")

    @property
    def time(self) -> float:
        """Time since the start, valid after changes of the time step."""
        return self._time + (self.session.step - self._step_of_time) * self.settings.dt

    def mark(self) -> Checkpoint:
        """Return all that a resumed run needs, and continue as after reading it.

        Writing a restart file wraps and sorts atoms and, in a tilted box, rounds their positions, so it is written
        at every mark, needed or not.
        """
        evaluations = self.measure()["evaluations"]
        found = {
            "restart": self.session.restart(),
            "time": self._time,
            "step_of_time": self._step_of_time,
            "evaluations": evaluations,
            "wall_seconds": perf_counter() - self._began,
        }
        self.session.commands("run 0 post no")
        return found

    def advance(self, step: int) -> None:
        """Run to `step`."""
        while self.session.step < step:
            steps = min(step - self.session.step, _LONGEST_RUN)
            self.session.commands(f"run {steps} pre no post no")

    def sample(self) -> Row:
        """Measure the present state."""
        step = self.session.step
        wall = perf_counter() - self._began
        return Row(step, self.time, wall, self.measure())

    def measure(self) -> dict[str, float]:
        """Return observables of the present state, named as in `compute packing`."""
        lmp = self.session.lmp
        flow = dict(self.settings.of_fix) | (_SUBSTEPS if self.settings.chooses_steps else {})
        with one_at_a_time():
            values = lmp.extract_compute("packing", 0, 1)
            found = {name: float(values[k]) for name, k in self.settings.of_packing.items()}
            second, dimension = float(values[_SECOND]), lmp.extract_setting("dimension")
            found |= self.settings.stresses(found, second, dimension)
            found |= {name: float(lmp.extract_fix("flow", 0, 1, k)) for name, k in flow.items()}
        found["evaluations"] += self._evaluations
        return found

    def times(self) -> dict[str, float]:
        """Return the times that the settings report."""
        with one_at_a_time():
            found = [float(self.session.lmp.extract_fix("flow", 0, 1, k)) for k in _OF_BOX]
        return self.settings.times(*found)

    def packing(self) -> Packing:
        """Return the present state, sorted by ID."""
        return self.session.packing(self.time)
