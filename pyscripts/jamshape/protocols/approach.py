"""Slow approach to jamming in LAMMPS: compression at a rate that falls as the pressure rises.

The pressure of a flowing state is the rate times a viscosity that diverges at phi_J. A fixed slow rate wastes
nearly all of its time far below; here the rate is halved whenever the pressure passes a bound, down to
the slowest rate, and the run ends when that one no longer keeps the pressure low: the state is jammed.
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

# Of `compressed_start`.
_KAPPA_FAST, _DT_FAST = 1e-4, 0.2

# Time steps after which it has failed: days for small packings. Slower rates are those of implicit steps.
MOST_STEPS = 1_000_000_000

_NO_END = 1e3  # a packing fraction that is never reached

# Time steps stay below this fraction of what is stable; denser states allow less.
_STABLE = 0.6

# Strain between rows: at most this while the rate is high; this part of the pressure when it falls.
_LARGEST_STRAIN = 1e-3
_PART = 0.3


@dataclass(frozen=True)
class Approach:
    """How to approach jamming.

    Parameters
    ----------
    kappa
        The slowest rate, with which it ends, [1/time].
    kappa_start
        The rate at the start.
    p_flow
        Pressure above which the rate is halved, [energy / length^D].
    p_end
        Pressure to reach at the slowest rate.
    p_open
        Pressure to return to by opening the box at that rate.
    dt
        Time step; lowered to what the fix says is stable.
    strain
        Of the box, from one row to the next, at the slowest rate; more while it is faster.

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
                f"kappa is {self.kappa:g}, expected at least {least:g}: below, {MOST_STEPS:.0e} time steps do"
                " not lead through jamming; use jamshape slow, whose steps are implicit"
            )
            raise ValueError(msg)


class ApproachError(RuntimeError):
    """The state was not jammed in time; the sentence says where it is."""


def compressed_start(start: Packing, phi: float) -> Packing:
    """Compress a random packing fast, in LAMMPS, to where slow compressions begin."""
    with Session() as session:
        fast = Compression(kappa=_KAPPA_FAST, phi_end=phi, dt=_DT_FAST, sides=2)
        # Whole steps that end where they shall.
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
    """Go on from a LAMMPS restart file of particles, with the stored `rate`, `dt` and `restart_time`."""
    flow = Compression(kappa=stored["rate"], phi_end=_NO_END, dt=stored["dt"], sides=2)
    return CompressionRun(session, flow, like, restart, time=stored["restart_time"])


def approach(run: CompressionRun, settings: Approach) -> Iterator[Row]:
    """Compress until the state is jammed, then open the box until the pressure is nearly gone.

    Either ends so, or after `MOST_STEPS` time steps in all.

    Parameters
    ----------
    run : CompressionRun
        As `begin_approach` gives it.
    settings : Approach

    Yields
    ------
    Row
        Observables after every `settings.strain`, or less; `kappa` is one of them, negative while
        the box is opened.

    Raises
    ------
    ApproachError
        After so many time steps.
    """
    if run.settings.kappa > 0:
        yield from _compress(run, settings)
    yield from _open(run, settings)


def _compress(run: CompressionRun, settings: Approach) -> Iterator[Row]:
    while True:
        # Fast rates pass states that nobody looks at.
        finer = math.sqrt(settings.kappa / run.settings.kappa)
        sample = _advance(run, settings, min(settings.strain / finer, _LARGEST_STRAIN))
        kappa, pressure = run.settings.kappa, sample.observables["pressure"]
        is_jammed = kappa == settings.kappa and pressure >= settings.p_end
        # Before the row is told: a restart file that is written at it goes on with what comes next.
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
        # Near jamming the pressure is about 0.3 (phi - phi_J): go a part of the way.
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
            f"{MOST_STEPS:.0e} time steps have led to phi = {found['phi']:.6g} and a pressure of"
            f" {found['pressure']:.2g}, expected {aim:g} by then; take a larger kappa"
        )
        raise ApproachError(msg)
    sample.observables["kappa"] = run.settings.kappa
    stable = min(settings.dt, _STABLE * sample.observables["dt_max"])
    if not 0.5 * stable <= run.settings.dt <= stable:
        run.change(dt=0.7 * stable if stable < settings.dt else stable)
    return sample
