"""Shear: at a finite rate, in LAMMPS or by implicit steps, or by quasistatic steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jamshape.arguments import checked
from jamshape.checks import (
    RANGES,
    ArgumentError,
    described,
    require_given,
    require_no_effect,
    require_stated,
    require_with,
)
from jamshape.flow import cyclic_driver, implicit_driver, lammps_driver, quasistatic_driver
from jamshape.flow.cyclic_shear import QUARTERS, CyclicShear, dividing, longest_step
from jamshape.flow.implicit import METHODS
from jamshape.flow.lammps_driver import Sizes
from jamshape.flow.quasistatic import QuasistaticShear
from jamshape.flow.shear import Shear
from jamshape.flow.slow_shear import SlowShear
from jamshape.front.progress import place
from jamshape.front.reading import Held
from jamshape.front.recorded import recorded
from jamshape.front.run import CyclicShearFile, QuasistaticShearFile, ShearFile
from jamshape.front.starts import Asked, Start, require_known_kinks
from jamshape.landscape import Landscape, State
from jamshape.old_names import accepts_old
from jamshape.packing import Packing
from jamshape.protocols.approach import compressed_start
from jamshape.protocols.quasistatic import compressed_to
from jamshape.shapes.particles import Particles

_SLOW = {2: 3e-7, 3: 1e-7}  # rates below which implicit steps are faster than explicit ones
_ERROR, _IMPLICIT_ERROR = 1e-4, 1e-3  # default tolerances

_FRAMES = 20
_PHI_NAME = "phi_sheared"  # of the start, in files


@accepts_old(tolerance="integration_tolerance")
@checked
def shear(
    particles: Particles | None = None,
    *,
    n: int | None = None,
    dimension: int | None = None,
    phi: float | None = None,
    gdot: float = 1e-4,
    strain: float = 5.0,
    flow: str = "simple",
    pressure: float = 0.0,
    t_box: float | None = None,
    seed: int | None = None,
    start: Held | None = None,
    sides: int = 2,
    integrator: str | None = None,
    dt: float | None = None,
    integration_tolerance: float | None = None,
    rows: int = 1000,
    frames: int | None = None,
    file: str | Path | None = None,
    again: bool = False,
    seconds: float | None = None,
    progress: bool = True,
) -> ShearFile:
    """Shear particles at a constant rate and packing fraction, as in Marschall, Keta, Olsson & Teitel 2019, or pressure.

    Parameters
    ----------
    particles : Particles
        Such as ``Spherocylinders(alpha=4)``; omit with a start.
    n : int, optional
        Number of particles; 256 by default, or those of the start.
    dimension : int, optional
        2 or 3; 2 by default, or that of the start.
    phi : float, optional
        Packing fraction, reached by fast compression of a random packing; 0.8 by default, or that of the start.
    gdot : float, [1/time]
        Shear rate: dv_x/dy of simple shear, dv_x/dx = -dv_y/dy of pure shear.
    strain : float
        Final strain, the rate times the time.
    flow : {"simple", "pure"}
        Simple or pure shear.
    pressure : float, [energy / length^D]
        Normal pressure p_yy to hold in simple shear, to which the height of the box yields; 0 holds the volume.
    t_box : float, [time], optional
        Time in which the height of the box relaxes, with a pressure. By default the height follows as fast as a packing at
        this pressure relaxes, in about k_d d^2 / p.
    seed : int, optional
        Random seed of the start; 1 by default.
    start : Packing, run or path, optional
        Initial packing, or a file that `load` reads, whose last frame to start from, at its own packing fraction.
    sides : int
        Bonds of a side-to-side contact of rods, 1 or 2.
    integrator : str, optional
        ``rkc2``, ``heun/adaptive`` or ``heun`` in LAMMPS, as in `compress`; or ``tr-bdf2`` or ``sdirk2``, which take
        implicit steps, without LAMMPS, at a cost that hardly grows as the rate falls. By default ``heun`` with one bond or with `dt`, else ``tr-bdf2``
        at rates of 3e-7, in 3D 1e-7, and below, and else ``rkc2``.
    dt : float, [time], optional
        Time step of ``heun``; 0.05 by default.
    integration_tolerance : float, optional
        Local error of a step over the typical overlap, for the others; by default 1e-4 in LAMMPS and 1e-3 with implicit
        steps.
    rows : int
        Number of samples of stress and order to keep; at least that many with implicit steps.
    frames : int, optional
        Number of snapshots to keep; 20 by default. Implicit runs keep one of every 100 steps.
    file : path, optional
        H5MD file of the run, as in `compress`.
    again, seconds, progress
        See `compress`.

    Returns
    -------
    ShearFile

    Raises
    ------
    ValueError
        If a number is out of its range or has no effect, the file holds another run, or neither particles nor a start
        is given.
    PluginError
        If there is no LAMMPS or no plugin for it.

    Warns
    -----
    UserWarning
        If the rate is so large that long particles may pass through each other, which ends the run.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Spherocylinders(alpha=0)
    >>> run = js.shear(discs, n=24, phi=0.8, gdot=1e-2, strain=4, file="sheared_discs.h5", progress=False)
    >>> found = run.steady()
    >>> found.startup < 2 and 0 < found["mu"].value < 1
    True
    """
    require_stated(gdot=gdot, strain=strain, rows=rows, hold_pressure=pressure)
    require_given(t_box=t_box, dt=dt, integration_tolerance=integration_tolerance, frames=frames)
    asked = Asked(n, phi, seed, dimension)
    of = Start.of(particles, asked, start, usual_phi=0.8, sides=sides, phi_name=_PHI_NAME)
    at = place(file, "shear.h5")
    whole = dt is None and sides == 2
    integrator = integrator or _usual(gdot, of.dimension, whole=whole)
    held = _held(pressure, t_box, flow)
    if integrator in METHODS:
        require_no_effect("integrator", integrator, dt=dt, frames=frames)
        most = min(SlowShear.largest_strain, strain / rows)
        error = integration_tolerance or _IMPLICIT_ERROR
        slow = SlowShear(gdot, strain, flow, error, largest_strain=most, method=integrator, **held)
        require_known_kinks(sides, of.dimension)
        made_from = of.made_from | {"rows": rows, "dimension": of.dimension}
        plan = implicit_driver.plan(lambda: _flowing(of), slow, made_from, sides)
    else:
        settings = Shear(
            gdot=gdot, strain_end=strain, flow=flow, dt=min(0.05, 0.01 / gdot) if dt is None else dt,
            sides=sides, k_e=of.k_e, integrator=integrator, tolerance=integration_tolerance or _ERROR, **held,
        )  # fmt: skip
        settings = _in_rows(settings, rows, dt=dt, integration_tolerance=integration_tolerance)
        sizes = Sizes(rows, _FRAMES if frames is None else frames)
        made_from = of.made_from | {"dimension": of.dimension}
        plan = lammps_driver.plan(lambda: _flowing(of), settings, sizes, made_from)
    recorded(at.path, plan, again=again, seconds=seconds, progress=progress)
    return ShearFile(*at)


@checked
def cyclic_shear(
    particles: Particles | None = None,
    *,
    n: int | None = None,
    dimension: int | None = None,
    phi: float | None = None,
    amplitude: float = 0.05,
    period: float = 2000.0,
    cycles: int = 20,
    flow: str = "simple",
    pressure: float = 0.0,
    t_box: float | None = None,
    seed: int | None = None,
    start: Held | None = None,
    sides: int = 2,
    integrator: str | None = None,
    dt: float | None = None,
    integration_tolerance: float | None = None,
    rows: int = 100,
    frames: int | None = None,
    file: str | Path | None = None,
    again: bool = False,
    seconds: float | None = None,
    progress: bool = True,
) -> CyclicShearFile:
    """Shear particles to and fro between two strains, at a constant packing fraction or normal pressure, in LAMMPS.

    The strain is a triangle wave: from 0 to the amplitude, to minus the amplitude, and back to 0, at the constant rate 4
    amplitude / period.

    Parameters
    ----------
    particles : Particles
        Such as ``Spherocylinders(alpha=4)``; omit with a start.
    n : int, optional
        Number of particles; 256 by default, or those of the start.
    dimension : int, optional
        2 or 3; 2 by default, or that of the start.
    phi : float, optional
        Packing fraction, reached by fast compression of a random packing; 0.8 by default, or that of the start.
    amplitude : float
        Largest strain.
    period : float, [time]
        Time of a cycle.
    cycles : int
        Number of cycles.
    flow : {"simple", "pure"}
    pressure : float, [energy / length^D]
        Normal pressure p_yy to hold in simple shear, to which the height of the box yields; 0 holds the volume.
    t_box : float, [time], optional
        Time in which the height of the box relaxes, with a pressure, as in `shear`.
    seed : int, optional
        Random seed of the start; 1 by default.
    start : Packing, run or path, optional
        Initial packing, at its own packing fraction; the last frame of a file.
    sides : int
        Bonds of a side-to-side contact of rods, 1 or 2.
    integrator : str, optional
        ``rkc2``, ``heun/adaptive`` or ``heun``, as in `compress`; by default ``heun`` with one bond or with `dt`, else ``rkc2``.
    dt : float, [time], optional
        Largest time step of ``heun``, 0.05 by default; the next smaller one that divides the interval of rows is used.
    integration_tolerance : float, optional
        Local error of a step over the typical overlap, for the other integrators; 1e-4 by default.
    rows : int
        Number of samples in a cycle, a multiple of 4.
    frames : int, optional
        Least number of snapshots to keep, at ends of cycles; by default one for each cycle.
    file : path, optional
        H5MD file of the run, as in `compress`.
    again, seconds, progress
        See `compress`.

    Returns
    -------
    CyclicShearFile

    Raises
    ------
    ValueError
        If a number is out of its range or has no effect, the file holds another run, or neither particles nor a start
        is given.
    PluginError
        If there is no LAMMPS or no plugin for it.

    Warns
    -----
    UserWarning
        If the rate is so large that long particles may pass through each other, which ends the run.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Spherocylinders(alpha=0)
    >>> run = js.cyclic_shear(discs, n=24, phi=0.7, amplitude=0.02, period=100, cycles=4, rows=20, progress=False)
    >>> bool(run.displacement[-1] < run.displacement[0])
    True
    """
    require_stated(
        amplitude=amplitude, period=period, cycles=cycles, rows=rows, hold_pressure=pressure
    )
    require_given(t_box=t_box, dt=dt, integration_tolerance=integration_tolerance, frames=frames)
    _require_cycle(amplitude, period, rows)
    of = Start.of(particles, Asked(n, phi, seed, dimension), start, usual_phi=0.8, sides=sides, phi_name=_PHI_NAME)  # fmt: skip
    at = place(file, "cycles.h5")
    integrator = integrator or ("heun" if dt is not None or sides == 1 else "rkc2")
    held = _held(pressure, t_box, flow)
    longest = longest_step(amplitude, period)
    if integrator == "heun":
        require_no_effect("integrator", integrator, integration_tolerance=integration_tolerance)
        longest = min(longest, 0.05 if dt is None else dt)
    else:
        require_no_effect("integrator", integrator, dt=dt)
    settings = CyclicShear(
        amplitude=amplitude, period=period, cycles=cycles, flow=flow,
        dt=dividing(period, rows, longest), sides=sides, k_e=of.k_e, integrator=integrator,
        tolerance=integration_tolerance or _ERROR, **held,
    )  # fmt: skip
    sizes = Sizes(rows, cycles if frames is None else frames)
    made_from = of.made_from | {"dimension": of.dimension}
    plan = cyclic_driver.plan(lambda: _flowing(of), settings, sizes, made_from)
    recorded(at.path, plan, again=again, seconds=seconds, progress=progress)
    return CyclicShearFile(*at)


@checked
def quasistatic_shear(
    particles: Particles | None = None,
    *,
    n: int | None = None,
    dimension: int | None = None,
    phi: float | None = None,
    step: float = 1e-3,
    strain: float | None = None,
    amplitude: float | None = None,
    cycles: int | None = None,
    flow: str = "simple",
    pressure: float = 0.0,
    box: str = "isotropic",
    stress_step: float | None = None,
    tolerance: float = 1e-8,
    seed: int | None = None,
    start: Held | None = None,
    frames: int = 20,
    file: str | Path | None = None,
    again: bool = False,
    seconds: float | None = None,
    progress: bool = True,
) -> QuasistaticShearFile:
    """Shear particles in small strain steps, each followed by minimisation (AQS); needs no LAMMPS.

    Parameters
    ----------
    particles : Particles
        Such as ``Spherocylinders(alpha=4)``; omit with a start.
    n : int, optional
        Number of particles; 256 by default, or those of the start.
    dimension : int, optional
        2 or 3; 2 by default, or that of the start.
    phi : float, optional
        Packing fraction, reached by quasistatic compression of a random packing; 0.9 by default, or that of the start.
    step : float
        Strain of each step, without its sign.
    strain : float, optional
        Final strain, negative to shear the other way; 0.5 by default.
    amplitude : float, optional
        Largest strain of cyclic shear, instead of `strain`: a triangle wave, from 0 to the amplitude, to minus the
        amplitude, and back to 0, in equal steps of at most `step`.
    cycles : int, optional
        Number of cycles; 1 by default with `amplitude`.
    flow : {"simple", "pure"}
        Simple or pure shear.
    pressure : float, [energy / length^D]
        Pressure to hold; 0 holds the volume.
    box : str
        How the box yields to the pressure: "isotropic", or components of normal stresses to hold, such as "yy".
    stress_step : float, [energy / length^D], optional
        Raise the shear stress by this in each step, instead of the strain, until the box shears to `strain`, where the
        packing counts as flowing; ``run.yield_stress`` is then known. With a pressure all normal stresses are held, or
        those of `box`.
    tolerance : float
        Largest net force and torque of a particle over the mean bond force.
    seed : int, optional
        Random seed of the start; 1 by default.
    start : Packing, run or path, optional
        Initial packing, or a file that `load` reads, whose last frame to start from, at its own packing fraction and in its own
        box, also a tilted one, where the strain is 0.
    frames : int
        Approximate number of snapshots to keep; those at the strains 0 and +-amplitude of cycles are added.
    file, again, seconds, progress
        See `compress`.

    Returns
    -------
    QuasistaticShearFile

    Raises
    ------
    ValueError
        If a number is out of its range or has no effect, the file holds another run, or neither particles nor a start
        is given.
    TargetError
        If the pressure cannot be held.

    Warns
    -----
    NotReachedWarning
        If forces do not balance to the tolerance after some steps; ``run.at_rest`` says where they do.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Spherocylinders(alpha=0)
    >>> packing = js.make_packing(discs, n=16, u0=1e-6, file="packed_discs.h5", progress=False)
    >>> run = js.quasistatic_shear(start=packing, step=2e-3, strain=0.1, progress=False)
    >>> run.strain.shape, bool((run.phi == run.phi[0]).all())
    ((51,), True)
    """
    require_no_effect("amplitude", amplitude, strain=strain)
    require_with("amplitude", amplitude, cycles=cycles)
    require_stated(frames=frames, strain_step=step, tolerance=tolerance, hold_pressure=pressure)
    require_given(
        strain_end=None if strain is None else abs(strain), amplitude=amplitude, cycles=cycles, stress_step=stress_step
    )  # fmt: skip
    asked = Asked(n, phi, seed, dimension)
    of = Start.of(particles, asked, start, usual_phi=0.9, phi_name=_PHI_NAME)
    require_no_effect("stress_step", stress_step, amplitude=amplitude)
    end = 0.5 if strain is None else strain
    number = 0 if amplitude is None else 1 if cycles is None else cycles
    how = QuasistaticShear(
        step, end, flow, pressure, tolerance, amplitude or 0.0, number, box, stress_step or 0.0
    )
    at = place(file, "aqs.h5")
    plan = quasistatic_driver.plan(lambda: _still(of), how, frames, of.made_from)
    recorded(at.path, plan, again=again, seconds=seconds, progress=progress)
    return QuasistaticShearFile(*at)


def _flowing(of: Start) -> Packing:
    """Return the start, compressed at a finite rate."""
    return of.known or compressed_start(of.random(), of.phi)


def _still(of: Start) -> Packing:
    """Return the start, compressed quasistatically."""
    if of.known:
        return of.known
    random = of.random()
    return compressed_to(Landscape(random), State.of(random), of.phi).packing(random)


def _in_rows(settings: Shear, rows: int, **given: float | None) -> Shear:
    """Refuse options without an effect, and return settings whose steps end at rows, if the integrator is adaptive."""
    without = "dt" if settings.chooses_steps else "integration_tolerance"
    require_no_effect("integrator", settings.integrator, **{without: given[without]})
    return settings.in_steps(rows) if settings.chooses_steps else settings


def _usual(gdot: float, dimension: int, *, whole: bool) -> str:
    """Choose the default integrator."""
    if not whole:
        return "heun"
    return "tr-bdf2" if gdot <= _SLOW[dimension] else "rkc2"


def _held(pressure: float, t_box: float | None, flow: str) -> dict[str, Any]:
    """Return the settings of a pressure to hold, none without one, and refuse what does not go with it."""
    if not pressure:
        require_no_effect("pressure", pressure, t_box=t_box)
        return {}
    if flow != "simple":
        said = "{flow} shear drives the height of the box, expected simple shear with a pressure"
        raise ArgumentError(said, {"flow": flow})
    return {"hold_pressure": pressure, "t_box": t_box}


def _require_cycle(amplitude: float, period: float, rows: int) -> None:
    """Refuse a rate out of range, and rows that miss the ends of the strain."""
    rate, allowed = QUARTERS * amplitude / period, RANGES["gdot"]
    if not allowed.low <= rate <= allowed.high:
        expected = described(allowed)
        said = f"{{amplitude}} and {{period}} make a rate of {rate:g}, expected {expected}"
        raise ArgumentError(said, {"amplitude": amplitude, "period": period})
    if rows % QUARTERS:
        said = "{rows} samples in a cycle miss the largest strain, expected a multiple of 4"
        raise ArgumentError(said, {"rows": rows})
