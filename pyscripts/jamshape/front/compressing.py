"""Compression at a finite rate: explicit in LAMMPS, or implicit and arbitrarily slow."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from jamshape.arguments import checked
from jamshape.checks import (
    RANGES,
    ArgumentError,
    require_given,
    require_in,
    require_no_effect,
    require_one_of,
    require_rising,
    require_stated,
)
from jamshape.flow import implicit_driver, lammps_driver
from jamshape.flow.compression import Compression
from jamshape.flow.implicit import Protocol
from jamshape.flow.lammps_driver import Sizes
from jamshape.front.packing import public
from jamshape.front.progress import place
from jamshape.front.reading import Held
from jamshape.front.recorded import recorded
from jamshape.front.run import RunFile
from jamshape.front.starts import Asked, Start, require_known_kinks
from jamshape.old_names import accepts_old
from jamshape.packing import Packing
from jamshape.protocols.approach import compressed_start
from jamshape.protocols.random_start import compression_start
from jamshape.shapes.particles import Particles

PHI = (0.4, 0.9)
"""Default packing fractions of the random start and of the end of a compression."""

PHI_SLOW = (None, 0.9)
"""Default packing fractions of the start and of the end of a slow compression; None for 0.8, 0.5 in 3D, or that of a
start."""

KAPPA_SLOW = 1e-8
"""Default rate of a slow compression."""

_PHI_HANDED_OVER = {2: 0.8, 3: 0.5}
_SAME = 1e-9  # of packing fractions, up to rounding
_DT, _ERROR = 0.05, 1e-4


@accepts_old(tolerance="integration_tolerance")
@checked
def compress(
    particles: Particles,
    *,
    n: int = 256,
    dimension: int = 2,
    phi: tuple[float, float] = PHI,
    kappa: float = 1e-5,
    p_end: float = math.inf,
    seed: int = 1,
    sides: int = 2,
    integrator: str | None = None,
    dt: float | None = None,
    integration_tolerance: float | None = None,
    rows: int = 400,
    frames: int = 20,
    file: str | Path | None = None,
    again: bool = False,
    seconds: float | None = None,
    progress: bool = True,
) -> RunFile:
    """Compress particles through jamming in LAMMPS, as Marschall & Teitel 2018, Sec. II.

    Parameters
    ----------
    particles : Particles
        Such as ``Spherocylinders(alpha=4)``.
    n : int
        Number of particles.
    dimension : int
        2 or 3.
    phi : (float, float)
        Packing fraction of the random start, and final packing fraction.
    kappa : float, [1/time]
        Compression rate: the box shrinks with dL/dt = -kappa L.
    p_end : float, [energy / length^D]
        Final pressure: stop also at the first of the `rows` at which it is reached.
    seed : int
        Random seed of the start.
    sides : int
        Bonds of a side-to-side contact of rods, 1 or 2. The paper's dynamics has one, on which parallel rods
        chatter, which needs small steps; with two they come to rest, as in minima and modes.
    integrator : str, optional
        ``rkc2``, ``heun/adaptive``, or ``heun``, the paper's, with equal time steps; the others choose their own.
        ``rkc2``, the fastest, by default, and ``heun`` where there is one bond or `dt` is given.
    dt : float, [time], optional
        Time step of ``heun``; 0.05 by default.
    integration_tolerance : float, optional
        Local error of a step over the typical overlap, for the other integrators; 1e-4 by default.
    rows : int
        Number of samples of p(phi) to keep.
    frames : int
        Number of snapshots to keep.
    file : path, optional
        H5MD file of the run. A finished run with the same settings is loaded, an interrupted one resumed, and one
        with other settings refused. Without a file, the run is deleted together with its result.
    again : bool
        Start over, whatever the file holds.
    seconds : float, optional
        Time after which the run stops at its next checkpoint, before a queue ends it; the same call resumes it.
    progress : bool
        Whether to show progress on standard error.

    Returns
    -------
    RunFile

    Raises
    ------
    ValueError
        If a number is out of its range or has no effect, or the file holds another run.
    PluginError
        If there is no LAMMPS or no plugin for it.
    TimeLimitError
        If `seconds` are over before the end.

    Warns
    -----
    NotReachedWarning
        If `p_end` is given and not reached.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=4)
    >>> run = js.compress(rods, n=24, phi=(0.4, 0.95), kappa=1e-3, file="run.h5", progress=False)
    >>> run
    <Run of 24 spherocylinders in 2D at kappa = 0.001: 21 frames to phi = 0.95, pressure = 0.0547, in run.h5>
    """
    require_rising(*phi)
    require_stated(n=n, seed=seed, kappa=kappa, rows=rows, frames=frames)
    require_one_of("dimension", dimension, (2, 3))
    aim = None if p_end == math.inf else p_end
    require_given(p_end=aim, dt=dt, integration_tolerance=integration_tolerance)
    integrator = integrator or ("rkc2" if dt is None and sides == 2 else "heun")
    settings = Compression(
        kappa=kappa, phi_end=phi[1], p_end=aim, dt=_DT if dt is None else dt,
        sides=sides, integrator=integrator,
        tolerance=_ERROR if integration_tolerance is None else integration_tolerance,
    )  # fmt: skip
    if settings.chooses_steps:
        require_no_effect("integrator", integrator, dt=dt)
        settings = settings.in_steps(phi[0], rows, dimension)
    else:
        require_no_effect("integrator", integrator, integration_tolerance=integration_tolerance)
    settings.steps(phi[0], dimension)  # refuses what does not end
    at = place(file, "run.h5")
    made_from = particles.identity | {"n": n, "phi_start": phi[0], "seed": seed}
    plan = lammps_driver.plan(
        lambda: compression_start(n, phi[0], seed, particles, dimension),
        settings, Sizes(rows, frames), made_from | {"dimension": dimension},
    )  # fmt: skip
    recorded(at.path, plan, again=again, seconds=seconds, progress=progress)
    return RunFile(*at)


@accepts_old(tolerance="integration_tolerance")
@checked
def slow_compress(
    particles: Particles | None = None,
    *,
    n: int | None = None,
    dimension: int | None = None,
    phi: tuple[float | None, float] | None = PHI_SLOW,
    kappa: float | Sequence[tuple[float, float]] = KAPPA_SLOW,
    p_end: float = math.inf,
    seed: int | None = None,
    start: Held | None = None,
    method: str = "tr-bdf2",
    integration_tolerance: float = 1e-3,
    largest_drop: float = math.inf,
    sides: int = 2,
    file: str | Path | None = None,
    again: bool = False,
    seconds: float | None = None,
    progress: bool = True,
) -> RunFile:
    """Compress particles through jamming at any rate, however slow, with implicit time steps.

    Parameters
    ----------
    particles : Particles
        Such as ``Spherocylinders(alpha=4)``; omit with a start.
    n : int, optional
        Number of particles; 256 by default, or those of the start.
    dimension : int, optional
        2 or 3; 2 by default, or that of the start.
    phi : (float, float), optional
        Packing fraction at the end of a fast compression in LAMMPS, by default 0.8, in 3D 0.5, or that of the start, and
        final packing fraction.
    kappa : float, [1/time], or sequence of (float, float)
        Compression rate: the box shrinks with dL/dt = -kappa L. In Python also pairs of a packing fraction and the
        rate used from there on, ascending.
    p_end : float, [energy / length^D]
        Final pressure: stop also when it is reached.
    seed : int, optional
        Random seed of the start; 1 by default.
    start : Packing, run or path, optional
        Initial packing, or a file that `load` reads, whose last frame to start from.
    method : {"tr-bdf2", "sdirk2"}
        Method of the implicit steps.
    integration_tolerance : float
        Local error of a step over the typical overlap.
    largest_drop : float
        Fraction of the elastic energy that one step may lose, so that plastic events are resolved in time.
    sides : int
        Bonds of a side-to-side contact of rods, 1 or 2; one in 2D only.
    file, again, seconds, progress
        See `compress`.

    Returns
    -------
    RunFile

    Raises
    ------
    ValueError
        If a number is out of its range or has no effect, the file holds another run, or neither particles nor a start
        is given.
    PluginError
        If the fast compression finds no LAMMPS or no plugin for it.

    Warns
    -----
    NotReachedWarning
        If `p_end` is given and not reached.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> run = js.slow_compress(rods, n=16, phi=(0.7, 0.72), kappa=1e-6, progress=False)
    >>> round(float(run.phi[-1]), 6)
    0.72
    """
    require_no_effect("start", start, particles=particles, n=n, dimension=dimension, seed=seed)
    phi_start, phi_end = phi or PHI_SLOW
    require_stated(
        phi_end=phi_end, integration_tolerance=integration_tolerance, largest_drop=largest_drop
    )
    if p_end != math.inf:
        require_stated(p_end=p_end)
    rates = tuple(kappa) if isinstance(kappa, Iterable) else float(kappa)
    protocol = Protocol(
        rates, phi_end, p_end, integration_tolerance, largest_drop=largest_drop, method=method
    )
    for _, rate in protocol.rates:
        require_stated(kappa=rate)
    at = place(file, "slow.h5")
    sizes = {"n": n, "seed": seed, "dimension": dimension}
    of = _start_of(particles, start, phi=(phi_start, phi_end), sides=sides, **sizes)

    def first() -> Packing:
        packing = of.known or compressed_start(of.random(), of.phi)
        _require_end_ahead(packing, protocol)
        return packing

    plan = implicit_driver.plan(first, protocol, of.made_from | {"dimension": of.dimension}, sides)
    recorded(at.path, plan, again=again, seconds=seconds, progress=progress)
    return RunFile(*at)


def _start_of(
    particles: Particles | None,
    start: Held | None,
    phi: tuple[float | None, float],
    sides: int,
    **sizes: int | None,
) -> Start:
    """Return the start of a slow compression; refuse a packing fraction that differs from that of a given one."""
    phi_start, phi_end = phi
    if start is None:
        dimension = 2 if sizes["dimension"] is None else sizes["dimension"]
        require_one_of("dimension", dimension, (2, 3))
        phi_start = _PHI_HANDED_OVER[dimension] if phi_start is None else phi_start
        require_in("phi_start", phi_start, RANGES["phi_start"])
        require_rising(phi_start, phi_end)
        require_known_kinks(sides, dimension)
        return Start.of(particles, Asked(phi=phi_start, **sizes), None, usual_phi=phi_start)
    of = Start.of(particles, Asked(phi=None, **sizes), start, usual_phi=phi_end, sides=sides)
    if (
        of.known
        and phi_start is not None
        and not math.isclose(phi_start, of.known.phi, rel_tol=_SAME)
    ):
        said = f"{{phi_start}} differs from that of the start, {of.known.phi:.6g}, expected no value beside a start; leave it out"
        raise ArgumentError(said, {"phi_start": phi_start})
    require_known_kinks(sides, of.dimension)
    return of


def _require_end_ahead(first: Packing, protocol: Protocol) -> None:
    """Refuse a start beyond the final packing fraction or pressure."""
    if not first.phi < protocol.phi_end:
        msg = f"the start has phi = {first.phi:.6g}, expected less than phi_end = {protocol.phi_end:g}"
        raise ValueError(msg)
    pressure = public(first).pressure
    if pressure >= protocol.p_end:
        said = f"{{p_end}} is not above the pressure of the start, {pressure:.4g}, expected a larger one"
        raise ArgumentError(said, {"p_end": protocol.p_end})
