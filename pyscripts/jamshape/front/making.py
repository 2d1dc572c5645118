"""Mechanically stable packings at a chosen energy."""

from __future__ import annotations

from pathlib import Path

from jamshape.arguments import checked
from jamshape.checks import require_given, require_path, require_stated
from jamshape.files.outcomes import warn_unless_reached
from jamshape.front.packing import Packing, public
from jamshape.front.progress import display, place
from jamshape.landscape.threads import sharing
from jamshape.old_names import accepts_old
from jamshape.protocols.defaults import recipe_for
from jamshape.protocols.make import is_done, made, make, require_same, tidy
from jamshape.protocols.recipe import Recipe
from jamshape.recording.recorder import How
from jamshape.shapes.particles import Particles


@accepts_old(way="protocol")
@checked
def make_packing(
    particles: Particles | None = None,
    *,
    n: int | None = None,
    dimension: int | None = None,
    seed: int | None = None,
    u0: float | None = None,
    pressure: float | None = None,
    phi: float | None = None,
    box: str | None = None,
    accuracy: float | None = None,
    tolerance: float | None = None,
    phi_start: float | None = None,
    kappa: float | None = None,
    p_end: float | None = None,
    phi_end: float | None = None,
    protocol: int | str | None = None,
    phi_thermal: float | None = None,
    n_sweeps: int | None = None,
    delta_phi: float | None = None,
    start: str | Path | None = None,
    search: str | None = None,
    minimiser: str | None = None,
    strict: bool = False,
    stable_to_shear: bool = False,
    threads: int = 1,
    file: str | Path | None = None,
    again: bool = False,
    seconds: float | None = None,
    progress: bool = True,
) -> Packing:
    """Make one mechanically stable packing: compress, relax to a target energy, measure.

    Parameters
    ----------
    particles : Particles, optional
        Such as ``Spherocylinders(alpha=4)``; omit with a start.
    n : int, optional
        Number of particles; by default 256 in 2D, 400 in 3D, and 1024 for marschall-2018.
    dimension : {2, 3}, optional
        By default that of the shape's paper.
    seed : int, optional
        Random seed; 1 by default.
    u0 : float, [energy / length^D], optional
        Target elastic energy over the area (volume) of the box, a measure of the distance to jamming;
        1e-15 in 2D and 1e-12 in 3D by default. 0, the default of equal steps, keeps the first jammed
        packing as it is.
    pressure : float, [energy / length^D], optional
        Target pressure, instead of u0: the packing is a minimum of the enthalpy U + p V.
    phi : float, optional
        Target packing fraction, instead of u0; the packing jams first and is then strained there, and below jamming
        nothing touches.
    box : str, optional
        How the box yields: "isotropic" (default), "free", or components such as "xx yy xy". In components that yield the
        pressure tensor becomes p 1, with no shear stress (Dagois-Bohy et al., Phys. Rev. Lett. 109, 095703 (2012)).
    accuracy : float, optional
        Relative error of the energy, (u - u0) / u0; 1e-7 by default. With a pressure or a box that yields otherwise, also
        that of the pressure tensor, 1e-8.
    tolerance : float, optional
        Largest net force and torque on a particle over the mean force of a bond; 1e-8 by default, or
        1e-4 for equal steps.
    phi_start : float, optional
        Packing fraction of the random start; 0.4 in 2D, 0.1 in 3D by default, and less for particles of more than 11 (21)
        times their width, which would jam or find no room.
    kappa : float, [1/time], optional
        Slowest compression rate of ``dynamics``, 4e-7 by default, or the only rate of marschall-2018,
        1e-6 by default.
    p_end : float, [energy / length^D], optional
        Pressure at which compression at that rate ends, for ``dynamics``; 1e-3 by default.
    phi_end : float, optional
        Final packing fraction of marschall-2018, beyond jamming; 0.95 in 2D, 0.8 in 3D by default.
    protocol : {"quasistatic", "dynamics", "steps", "marschall-2018", "yuan-2019-1", "yuan-2019-2", 1, 2}, optional
        Route to jamming: quasistatic steps that are large far from jamming (default, fastest), slow compression in
        LAMMPS (Marschall & Teitel 2018, Sec. III B), equal quasistatic steps (Yuan et al. 2019, Sec. 2.2), or a
        published protocol, with the paper's values as defaults (Marschall & Teitel 2018, Sec. II and III B-C; Yuan et
        al. 2019, Sec. 2.2, where 2 adds Monte Carlo of hard particles, which orders them). 1 and 2 are short for the
        last two.
    phi_thermal : float, optional
        Packing fraction of the Monte Carlo of yuan-2019-2; 0.55 by default.
    n_sweeps : int, optional
        Sweeps of the Monte Carlo of yuan-2019-2; 100000 by default.
    delta_phi : float, optional
        Step of the packing fraction near jamming, 2e-3 by default, or of equal steps, 1e-3.
    start : path, optional
        H5MD file of a compression through jamming that replaces the one of marschall-2018. The search begins at
        its first frame that stays jammed when minimised; particles, `n` and `seed` are those of the file.
    search : {"extrapolation", "bisection"}, optional
        Search for u0 in marschall-2018: extrapolation of box and particles together (default), or the paper's
        steps of the box, 1e-6 at first and halved where u crosses u0 (Sec. III C, Eq. 20).
    minimiser : {"auto", "near", "newton", "cg_marschall"}, optional
        Minimiser of bisection: "cg_marschall" is the conjugate gradients of its App. A; "auto" by default.
    strict : bool
        Continue at fixed u, along floppy modes, until no mode has an eigenvalue below minus its error bound;
        ``n_negative`` of the results counts those that do. Rods of alpha = 4 end at saddles otherwise.
    stable_to_shear : bool
        Continue until no motion of particles and box lowers the enthalpy (Dagois-Bohy et al. 2012), in a box that is
        "free", the default then. ``tries`` of the results counts packings at the target up to the stable one.
    threads : int
        Number of threads; worth it from thousands of particles on. The last bits depend on it, and with them
        which of many minima is found; an interrupted packing resumes with any number. Many packings take less
        time in separate processes.
    file : path, optional
        H5MD file of the packing. A packing of this recipe is loaded from it, an interrupted one resumed from
        files beside it, and one of another recipe refused. Without a file only the result is kept.
    again : bool
        Start over, whatever the file holds, but for a compression in LAMMPS that serves this packing.
    seconds : float, optional
        Time after which the work stops at its next checkpoint, before a queue ends it; the same call resumes it.
    progress : bool
        Whether to show progress on standard error.

    Returns
    -------
    Packing
        ``reached`` is true if forces balance to the tolerance; ``results["outcome"]`` says how it ended.

    Raises
    ------
    ValueError
        If a number is out of its range or does not belong to the protocol, or the file holds another packing.
    TargetError
        If the energy is not reached.
    PluginError
        If ``dynamics`` finds no LAMMPS or no plugin for it.

    Warns
    -----
    NotReachedWarning
        If forces do not balance to the tolerance.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> packing = js.make_packing(rods, n=16, u0=1e-8, file="packing.h5", progress=False)
    >>> abs(packing.u / 1e-8 - 1) < 1e-6
    True
    """
    recipe = recipe_for(
        particles, dimension, seed, n=n, u0=u0, pressure=pressure, phi=phi, box=box, accuracy=accuracy, tolerance=tolerance,
        protocol=protocol, phi_start=phi_start, kappa=kappa, p_end=p_end, phi_end=phi_end,
        phi_thermal=phi_thermal, n_sweeps=n_sweeps, delta_phi=delta_phi, start=start,
        search=search, minimiser=minimiser, strict=strict,
        stable_to_shear=stable_to_shear,
    )  # fmt: skip
    return made_or_kept(
        recipe, file, threads=threads, again=again, seconds=seconds, progress=progress
    )


def made_or_kept(
    recipe: Recipe,
    file: str | Path | None,
    *,
    threads: int,
    again: bool,
    seconds: float | None,
    progress: bool,
) -> Packing:
    """Make a packing, or load it from its file; arguments, errors and warnings as of `make_packing`."""
    require_stated(threads=threads)
    require_given(seconds=seconds)
    with sharing(threads), display(shown=progress) as tell:
        how = How(again, seconds, lambda row: tell(row.told))
        packing = public(made(recipe, how)) if file is None else _kept(file, recipe, how)
    warn_unless_reached(packing.results, stacklevel=4)
    return packing


def _kept(file: str | Path, recipe: Recipe, how: How) -> Packing:
    """Make a packing in a file, unless it is there, and read it."""
    path = place(file, "packing.h5").path
    require_path(path)
    if how.again or not is_done(path):
        make(recipe, path, how)
    else:
        require_same(path, recipe)
        tidy(path)
    return Packing.read(path)
