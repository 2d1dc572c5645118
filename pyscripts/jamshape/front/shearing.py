"""Shear: at a constant rate in LAMMPS, and by quasistatic steps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from jamshape.checks import (
    require_one_of,
    require_path,
    require_path_for_lammps,
    require_stated,
)
from jamshape.flow import quasistatic_recording, recording
from jamshape.flow.quasistatic import QuasistaticShear
from jamshape.flow.recording import Recording
from jamshape.flow.shear import Shear
from jamshape.front.progress import place
from jamshape.front.recorded import record_flow, resume
from jamshape.front.run import QuasistaticShearFile, ShearFile
from jamshape.front.starts import start_of, told_of
from jamshape.landscape import Landscape, State
from jamshape.packing import Packing
from jamshape.protocols.approach import compressed_start
from jamshape.protocols.quasistatic import compressed_to
from jamshape.protocols.random_start import start_below
from jamshape.shapes.particles import Particles

if TYPE_CHECKING:
    from jamshape.front.packing import MeasuredPacking


def shear(
    particles: Particles | None = None,
    *,
    n: int = 256,
    dimension: int = 2,
    phi: float = 0.8,
    gdot: float = 1e-4,
    strain: float = 5.0,
    flow: str = "simple",
    seed: int = 1,
    start: Packing | str | Path | None = None,
    sides: int = 2,
    integrator: str | None = None,
    dt: float | None = None,
    tolerance: float = 1e-4,
    rows: int = 1000,
    frames: int = 20,
    file: str | Path | None = None,
    again: bool = False,
    progress: bool = True,
) -> ShearFile:
    """Shear particles at a constant rate and packing fraction in LAMMPS, as Marschall, Keta, Olsson & Teitel 2019.

    Parameters
    ----------
    particles : Particles
        Such as ``Spherocylinders(alpha=4)``; not needed where a start is given.
    n : int
        Number of particles.
    dimension : {2, 3}
    phi : float
        Packing fraction, to which a random packing is compressed fast.
    gdot : float, [1/time]
        Rate: dv_x/dy of simple shear, dv_x/dx = -dv_y/dy of pure shear.
    strain : float
        Strain to reach, the rate times the time.
    flow : {"simple", "pure"}
    seed : int
        Of the random start.
    start : Packing or path, optional
        What to begin with, at its own packing fraction; of a path, its last frame.
    sides : {1, 2}
        Bonds of a side-to-side contact of rods.
    integrator : {"rkc2", "heun/adaptive", "heun"}, optional
        As of `compress`.
    dt : float, [time], optional
        Time step of ``heun``; 0.05 when left out.
    tolerance : float
        Of the others: local error of a step over the typical overlap.
    rows, frames : int
        How many samples of stress and order and how many snapshots to keep.
    file : path, optional
        H5MD file of the run, as of `compress`: a finished run of these settings is loaded from it, and one
        that was cut off goes on.
    again : bool
        Begin anew, whatever the file holds.
    progress : bool
        Whether a bar on standard error says how far it is.

    Returns
    -------
    ShearFile

    Raises
    ------
    ValueError
        If a number is out of its range, the file holds another run, or neither particles nor a start
        is given.
    PluginError
        If there is no LAMMPS or no plugin for it.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Spherocylinders(alpha=0)
    >>> run = js.shear(discs, n=24, phi=0.8, gdot=1e-2, strain=4, file="sheared_discs.h5", progress=False)
    >>> found = run.steady()
    >>> found.startup < 2 and 0 < found["mu"].value < 1
    True
    """
    require_stated(n=n, phi=phi, gdot=gdot, strain=strain, seed=seed, tolerance=tolerance)
    require_stated(rows=rows, frames=frames)
    require_one_of("dimension", dimension, (2, 3))
    if dt is not None:
        require_stated(dt=dt)
    integrator = integrator or ("rkc2" if dt is None and sides == 2 else "heun")
    settings = Shear(
        gdot=gdot, strain_end=strain, flow=flow, dt=min(0.05, 0.01 / gdot) if dt is None else dt,
        sides=sides, integrator=integrator, tolerance=tolerance,
    )  # fmt: skip
    if settings.chooses_steps:
        settings = settings.in_steps(rows)
    at = place(file, "shear.h5")
    require_path_for_lammps(at.path)  # restart files lie beside it
    known = start_of(start) if start is not None else None
    numbers = _Numbers(n, phi, seed, dimension)
    made_from = _made_from(particles, numbers, known)
    to = Recording(at.path, rows, frames, made_from)
    if again or not at.path.exists():
        first = known or _flowing_start(particles, numbers)
        settings.all_steps(first)  # refuses what does not end
        record_flow(lambda session: recording.begin(session, settings, first, to), to, progress)
    else:
        recording.require_same(to, settings, known.dimension if known else dimension)
        resume(at.path, progress=progress)
    return ShearFile(*at)


def quasistatic_shear(
    particles: Particles | None = None,
    *,
    n: int = 256,
    dimension: int = 2,
    phi: float = 0.9,
    step: float = 1e-3,
    strain: float = 0.5,
    flow: str = "simple",
    pressure: float = 0.0,
    tolerance: float = 1e-8,
    seed: int = 1,
    start: Packing | str | Path | None = None,
    frames: int = 20,
    file: str | Path | None = None,
    again: bool = False,
    progress: bool = True,
) -> QuasistaticShearFile:
    """Shear particles by small steps of the strain, each followed by a minimisation (AQS); needs no LAMMPS.

    Parameters
    ----------
    particles : Particles
        Such as ``Spherocylinders(alpha=4)``; not needed where a start is given.
    n : int
        Number of particles.
    dimension : {2, 3}
    phi : float
        Packing fraction, to which a random packing is compressed by such steps, too.
    step, strain : float
        Strain of each step, and the one to reach.
    flow : {"simple", "pure"}
    pressure : float, [energy / length^D]
        To hold, in place of the volume.
    tolerance : float
        Largest net force and torque of a particle over the mean bond force.
    seed : int
        Of the random start.
    start : Packing or path, optional
        What to begin with, at its own packing fraction; of a path, its last frame.
    frames : int
        About how many snapshots to keep.
    file, again, progress
        As of `compress`.

    Returns
    -------
    QuasistaticShearFile

    Raises
    ------
    ValueError
        If a number is out of its range, the file holds another run, or neither particles nor a start
        is given.
    PressureError
        If the pressure cannot be held.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Spherocylinders(alpha=0)
    >>> packing = js.make_packing(discs, n=16, u0=1e-6, file="packed_discs.h5", progress=False)
    >>> run = js.quasistatic_shear(start=packing, step=2e-3, strain=0.1, progress=False)
    >>> run.strain.shape, bool((run.phi == run.phi[0]).all())
    ((51,), True)
    """
    require_stated(n=n, phi=phi, seed=seed, frames=frames, strain_step=step, strain_end=strain)
    require_stated(tolerance=tolerance, hold_pressure=pressure)
    require_one_of("dimension", dimension, (2, 3))
    how = QuasistaticShear(step, strain, flow, pressure, tolerance)
    at = place(file, "aqs.h5")
    require_path(at.path)
    known = start_of(start) if start is not None else None
    numbers = _Numbers(n, phi, seed, dimension)
    made_from = _made_from(particles, numbers, known) | {"frames": frames}
    if again or not at.path.exists():
        first = known or _still_start(particles, numbers)
        quasistatic_recording.begin(at.path, first, how, made_from)
    else:
        quasistatic_recording.require_same(at.path, how, made_from)
    resume(at.path, progress=progress)
    return QuasistaticShearFile(*at)


class _Numbers(NamedTuple):
    """What a start is made with."""

    n: int
    phi: float
    seed: int
    dimension: int

    def start(self, particles: Particles | None) -> Packing:
        """Make a random packing from which to compress to phi."""
        return start_below(self.phi, self.n, self.seed, particles, self.dimension)


def _made_from(
    particles: Particles | None, numbers: _Numbers, start: MeasuredPacking | None
) -> dict[str, Any]:
    """Tell what a run is of: a start, or particles with their numbers."""
    if start is not None:
        return told_of(start)
    if particles is None:
        msg = "there are neither particles nor a start, expected one of them"
        raise ValueError(msg)
    return dict(particles.told) | {
        "n": numbers.n,
        "phi_sheared": numbers.phi,
        "seed": numbers.seed,
    }


def _flowing_start(particles: Particles | None, numbers: _Numbers) -> Packing:
    """Compress a random packing at a rate."""
    random = numbers.start(particles)
    return compressed_start(random, numbers.phi) if random.phi < numbers.phi else random


def _still_start(particles: Particles | None, numbers: _Numbers) -> Packing:
    """Compress a random packing by minimisations."""
    random = numbers.start(particles)
    landscape = Landscape(random)
    return compressed_to(landscape, State.of(random), numbers.phi).packing(random)
