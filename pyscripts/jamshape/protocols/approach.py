"""Slow approach to jamming in LAMMPS: compression at a rate that falls as the pressure rises.

The pressure of a flowing state is the rate times a viscosity that diverges at phi_J. A fixed slow rate wastes
nearly all of its time far below; here the rate is halved whenever the pressure exceeds a bound, down to
the slowest rate, and the run ends when even that rate no longer keeps the pressure low: the state is jammed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jamshape.checks import require_positive
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.flow.motion import Row
from jamshape.lammps.session import Session
from jamshape.packing import Packing

# Rate and time step of `compressed_start`.
_KAPPA_FAST, _DT_FAST = 1e-4, 0.2

# Largest number of time steps: days for small packings. Slower rates need implicit steps.
MOST_STEPS = 1_000_000_000

_NO_END = 1e3  # a packing fraction that is never reached

# Time steps stay below this fraction of the stable one; denser states allow less.
_STABLE = 0.6

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
        Time step; reduced to the stable one reported by the fix.
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
    dt: float = 0.25
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
    """Compress a random packing fast, in LAMMPS, to the start of slow compressions."""
    with Session() as session:
        fast = Compression(kappa=_KAPPA_FAST, phi_end=phi, dt=_DT_FAST, sides=2)
        # Whole steps that end exactly at phi.
        steps = max(1, fast.all_steps(start))
        run = CompressionRun(session, fast.in_steps(start.phi, steps, start.dimension), start)
        run.advance(run.last_step)
        return run.packing()


def begin_approach(session: Session, start: Packing, settings: Approach) -> CompressionRun:
    """Prepare a run in a fresh session."""
    flow = Compression(kappa=settings.kappa_start, phi_end=_NO_END, dt=settings.dt, sides=2)
    return CompressionRun(session, flow, start)


def resume_approach(
    session: Session, restart: Path, like: Packing, stored: Mapping[str, Any]
) -> CompressionRun:
    """Resume from a LAMMPS restart file of particles, with the stored `rate`, `dt` and `restart_time`."""
    flow = Compression(kappa=stored["rate"], phi_end=_NO_END, dt=stored["dt"], sides=2)
    return CompressionRun(session, flow, like, restart, time=stored["restart_time"])


def approach(run: CompressionRun, settings: Approach) -> Iterator[Row]:
    """Compress until the state is jammed, then open the box until the pressure nearly vanishes.

    Raises if the total number of time steps exceeds `MOST_STEPS`.

    Parameters
    ----------
    run : CompressionRun
        From `begin_approach`.
    settings : Approach

    Yields
    ------
    Row
        Observables after every `settings.strain`, or less; they include `kappa`, negative while
        the box is opened.

    Raises
    ------
    ApproachError
        After `MOST_STEPS` time steps.
    """
    if run.settings.kappa > 0:
        yield from _compress(run, settings)
    yield from _open(run, settings)


def _compress(run: CompressionRun, settings: Approach) -> Iterator[Row]:
    while True:
        # At fast rates no rows are recorded in between.
        finer = math.sqrt(settings.kappa / run.settings.kappa)
        sample = _advance(run, settings, min(settings.strain / finer, _LARGEST_STRAIN))
        kappa, pressure = run.settings.kappa, sample.observables["pressure"]
        is_jammed = kappa == settings.kappa and pressure >= settings.p_end
        # Before the row is yielded: a restart file written at the row resumes with the next step.
        if is_jammed:
            run.change(kappa=-settings.kappa)
        elif kappa > settings.kappa and pressure >= settings.p_flow:
            run.change(kappa=max(kappa / 2, settings.kappa))
        yield sample
        if is_jammed:
            return


def _open(run: CompressionRun, settings: Approach) -> Iterator[Row]:
    pressure = run.measure()["pressure"]
    while pressure > settings.p_open:
        # Near jamming the pressure is about 0.3 (phi - phi_J): go a fraction of the way.
        sample = _advance(run, settings, min(settings.strain, _PART * pressure))
        yield sample
        pressure = sample.observables["pressure"]


def _advance(run: CompressionRun, settings: Approach, strain: float) -> Row:
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
    stable = min(settings.dt, _STABLE * sample.observables["dt_max"])
    if not 0.5 * stable <= run.settings.dt <= stable:
        run.change(dt=0.7 * stable if stable < settings.dt else stable)
    return sample
