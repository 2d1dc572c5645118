"""Slow approach to jamming in LAMMPS: compression at a rate that falls as the pressure rises.

The pressure of a flowing state is the rate times a viscosity that diverges at phi_J. A fixed slow rate wastes
nearly all of its time far below; here the rate is halved whenever the pressure exceeds a bound, down to
the slowest rate, and the run ends when even that rate no longer keeps the pressure low: the state is jammed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from jamshape.checks import require_positive
from jamshape.files.checkpoint import Checkpoint
from jamshape.flow import motion
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.flow.motion import drag_over_force
from jamshape.lammps.session import Session
from jamshape.packing import Packing
from jamshape.recording.driver import Plan, Row, Told
from jamshape.shapes.shape import Interaction

FOR_A_PACKING = "compression for a packing"
"""Kind of the files of compressions in LAMMPS with which packings begin."""

ROWS_PER_MARK = 50
"""Rows between two marks."""

# Rate of `compressed_start`, unless its drag exceeds a part of the force at which contacts break, and the largest
# strain in one of its adaptive time steps, which are stable for every shape.
_KAPPA_FAST, _PART_OF_STRENGTH, _STRAIN_FAST = 1e-4, 0.01, 5e-4

# Largest number of time steps: days for small packings. Slower rates need implicit steps.
MOST_STEPS = 50_000_000

_ROUNDING = 1e-9  # relative, of a packing fraction

_NO_END = 1e3  # a packing fraction that is never reached

_LARGEST_STRAIN = 1e-3  # between rows, while the rate is high
_PART = 0.3  # of the pressure, between rows while it falls


@dataclass(frozen=True)
class Approach:
    """Settings of an approach to jamming.

    Parameters
    ----------
    kappa
        Slowest and final rate, [1/time].
    kappa_start
        Initial rate.
    p_flow
        Pressure above which the rate is halved, [energy / length^D].
    p_end
        Pressure to reach at the slowest rate.
    p_open
        Pressure to return to by opening the box at that rate.
    dt
        Longest of the adaptive time steps.
    strain
        Strain of the box between rows at the slowest rate; larger at faster ones.

    Raises
    ------
    ValueError
        If a number is not positive, `kappa` above `kappa_start`, or so small that the pressure does not
        rise by `p_end` in `MOST_STEPS` time steps.
    """

    kappa: float = 1e-7
    kappa_start: float = 1e-4
    p_flow: float = 2e-4
    p_end: float = 1e-3
    p_open: float = 1e-6
    dt: float = 5.0
    strain: float = 5e-5

    def __post_init__(self) -> None:
        require_positive(**vars(self))
        if self.kappa > self.kappa_start:
            msg = f"kappa is {self.kappa}, expected at most kappa_start = {self.kappa_start}"
            raise ValueError(msg)
        # The pressure of a jammed state rises by about the strain of the box, in units of k_e.
        least = self.p_end / (MOST_STEPS * self.dt)
        if self.kappa < least:
            msg = (
                f"kappa is {self.kappa:g}, expected at least {least:g}: otherwise {MOST_STEPS:.0e} time steps do"
                " not reach jamming; use jamshape slow, whose steps are implicit"
            )
            raise ValueError(msg)


class ApproachError(RuntimeError):
    """The state did not jam in time; the message gives its position."""


def compressed_start(start: Packing, phi: float) -> Packing:
    """Compress a random packing fast, in LAMMPS, to the start of slow flows, unless it is that dense already."""
    if start.phi >= phi * (1 - _ROUNDING):
        return start
    kappa = min(_KAPPA_FAST, _PART_OF_STRENGTH / drag_over_force(start, 1.0))
    dt = _STRAIN_FAST / kappa
    with Session() as session:
        fast = Compression(kappa=kappa, phi_end=phi, dt=dt, sides=2, integrator="rkc2")
        # Whole steps that end exactly at phi.
        steps = max(1, fast.all_steps(start))
        run = CompressionRun(session, fast.in_steps(start.phi, steps, start.dimension), start)
        run.advance(run.last_step)
        return run.packing()


def plan(start: Callable[[], Packing], settings: Approach, made_from: Mapping[str, Any]) -> Plan:
    """Plan an approach to jamming, and the return to a vanishing pressure."""

    def begin() -> ApproachDriver:
        # As the file has it: LAMMPS's own copy has other bits.
        first = start().sorted_by_id()
        law = Interaction(sides=2, power=first.law.power)
        return ApproachDriver(first.with_(law=law, step=0, time=0.0), settings)

    def restore(first: Packing, checkpoint: Checkpoint) -> ApproachDriver:
        return ApproachDriver(first, settings, checkpoint)

    return Plan(FOR_A_PACKING, "the compression of a packing", made_from, begin, restore)


class ApproachDriver:
    """Compression until the state is jammed, and then opening of the box until the pressure nearly vanishes.

    Rows come after every `Approach.strain`, or less; they include ``kappa``, negative while the box is opened.

    Parameters
    ----------
    first : Packing
    settings : Approach
    checkpoint : Checkpoint, optional
        Checkpoint to resume from.
    """

    def __init__(
        self, first: Packing, settings: Approach, checkpoint: Checkpoint | None = None
    ) -> None:
        told = checkpoint or {"kappa": settings.kappa_start, "dt": settings.dt, "rows": 0}
        self._first, self._settings, self._rows = first, settings, told["rows"]
        self._pressure: float
        self._pressure, self._marked = told.get("pressure", math.inf), checkpoint or None
        flow = Compression(
            kappa=told["kappa"], phi_end=_NO_END, dt=told["dt"], sides=2, integrator="rkc2"
        )
        self._session = Session()
        try:
            self._run = CompressionRun(
                self._session, flow, first, checkpoint["run"] if checkpoint else None
            )
        except BaseException:
            self._session.close()
            raise

    @property
    def done(self) -> bool:
        """Whether the pressure has vanished again."""
        opens = self._run.settings.kappa < 0
        return bool(opens and self._pressure <= self._settings.p_open)

    @property
    def at_mark(self) -> bool:
        """Whether `checkpoint` may be called now."""
        return bool(self._rows % ROWS_PER_MARK == 0)

    def first(self) -> Row:
        """Return the progress at the start."""
        return Row(self._told(self._run.measure()))

    def advance(self) -> Row:
        """Run to the next row; raises ApproachError after `MOST_STEPS` time steps."""
        run, settings = self._run, self._settings
        if self.at_mark:
            self.checkpoint()
        self._marked = None
        if run.settings.kappa < 0:
            # Near jamming the pressure is about 0.3 (phi - phi_J): go a fraction of the way.
            sample = _advance(run, settings, min(settings.strain, _PART * self._pressure))
            self._pressure = sample.observables["pressure"]
        else:
            sample = self._compressed()
        self._rows += 1
        found = sample.observables
        return Row(self._told(found), sample.step, sample.time, found, has_frame=self.done)

    def _compressed(self) -> motion.Row:
        run, settings = self._run, self._settings
        # At fast rates no rows are recorded in between.
        finer = math.sqrt(settings.kappa / run.settings.kappa)
        sample = _advance(run, settings, min(settings.strain / finer, _LARGEST_STRAIN))
        kappa, pressure = run.settings.kappa, sample.observables["pressure"]
        if kappa == settings.kappa and pressure >= settings.p_end:
            run.change(kappa=-settings.kappa)
            self._pressure = run.measure()["pressure"]
        elif kappa > settings.kappa and pressure >= settings.p_flow:
            run.change(kappa=max(kappa / 2, settings.kappa))
        return sample

    def _told(self, found: Mapping[str, float]) -> Told:
        pressure, rate, aim = found["pressure"], self._run.settings.kappa, self._settings
        where = f"phi {found['phi']:.6f}, pressure {pressure:.2e}"
        if rate < 0:
            return Told("opening of the box", f"{where} down to {aim.p_open:.0e}")
        return Told(
            "compression",
            f"{where} up to {aim.p_end:.0e} at rate {rate:.1e} down to {aim.kappa:.0e}",
        )

    def frame(self) -> Packing:
        """Return the present state."""
        return self._run.packing() if self._session.step else self._first

    def checkpoint(self) -> Checkpoint:
        """Return the state of LAMMPS, the rate, the time step, and the last pressure."""
        if self._marked is None:
            settings = self._run.settings
            found = {"kappa": settings.kappa, "dt": settings.dt, "rows": self._rows}
            self._marked = found | {"pressure": self._pressure, "run": self._run.mark()}
        return self._marked

    def results(self) -> dict[str, Any]:
        """Return the rate and the version of LAMMPS."""
        return {"rate": self._run.settings.kappa, "lammps_version": self._session.version}

    def close(self) -> None:
        """End LAMMPS."""
        self._session.close()


def _advance(run: CompressionRun, settings: Approach, strain: float) -> motion.Row:
    longest = min(settings.dt, strain / abs(run.settings.kappa))
    if not 0.5 * longest <= run.settings.dt <= longest:
        run.change(dt=longest)
    step = abs(run.settings.kappa) * run.settings.dt
    run.advance(min(run.session.step + max(1, round(strain / step)), MOST_STEPS + 1))
    sample = run.sample()
    if sample.step > MOST_STEPS:
        found, aim = (
            sample.observables,
            settings.p_end if run.settings.kappa > 0 else settings.p_open,
        )
        msg = (
            f"after {MOST_STEPS:.0e} time steps phi = {found['phi']:.6g} and a pressure of"
            f" {found['pressure']:.2g}, expected {aim:g}; use a larger kappa"
        )
        raise ApproachError(msg)
    sample.observables["kappa"] = run.settings.kappa
    return sample
