"""Mechanically stable packings at a chosen energy."""

from __future__ import annotations

from pathlib import Path

from jamshape.arguments import checked
from jamshape.checks import require_path, require_stated
from jamshape.files.outcomes import warn_unless_reached
from jamshape.front.packing import MeasuredPacking
from jamshape.front.progress import Told, follow, place
from jamshape.landscape.threads import sharing
from jamshape.protocols.defaults import recipe_for
from jamshape.protocols.make import Progress, is_done, make, require_same, tidy
from jamshape.shapes.particles import Particles


@checked
def make_packing(
    particles: Particles | None = None,
    *,
    n: int | None = None,
    dimension: int | None = None,
    seed: int | None = None,
    u0: float | None = None,
    accuracy: float | None = None,
    tolerance: float | None = None,
    way: str | None = None,
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
    threads: int = 1,
    file: str | Path | None = None,
    again: bool = False,
    progress: bool = True,
) -> MeasuredPacking:
    """Make one mechanically stable packing: compress, lead it to an energy, measure.

    Parameters
    ----------
    particles : Particles, optional
        Such as ``Spherocylinders(alpha=4)``; not needed where a start is given, which has its own.
    n : int, optional
        Number of particles; 256 in 2D, 400 in 3D when left out, or that of the protocol.
    dimension : {2, 3}, optional
        That of the shape's paper when left out.
    seed : int, optional
        Of all that is random; 1 when left out.
    u0 : float, [energy / length^D], optional
        Elastic energy over the box's area (volume) to lead the packing to, which says how far above
        jamming it is; 1e-15 in 2D and 1e-12 in 3D when left out. 0, usual for equal steps, is the first
        jammed packing as it is.
    accuracy : float, optional
        Of the energy, (u - u0) / u0; 1e-7 when left out.
    tolerance : float, optional
        Largest net force and torque on a particle over the mean force of a bond; 1e-8 when left out, or
        1e-4 for equal steps.
    way : {"quasistatic", "dynamics", "steps"}, optional
        To jamming: by quasistatic steps that are large far from it, the fastest way and the usual one, by
        slow compression in LAMMPS (Marschall & Teitel 2018, Sec. III B), or by equal quasistatic steps
        (Yuan et al. 2019, Sec. 2.2).
    phi_start : float, optional
        Packing fraction of the random start; 0.4 in 2D, 0.1 in 3D when left out.
    kappa : float, [1/time], optional
        Of the way by dynamics the slowest compression rate, 4e-7 when left out; of marschall-2018 the
        only one, 1e-6 when left out.
    p_end : float, [energy / length^D], optional
        Of the way by dynamics: the pressure to compress to at that rate; 1e-3 when left out.
    phi_end : float, optional
        Of marschall-2018: the packing fraction to compress to, beyond jamming; 0.95 in 2D, 0.8 in 3D when
        left out.
    protocol : {"marschall-2018", "yuan-2019-1", "yuan-2019-2"}, optional
        In place of a way: as published, with the paper's numbers for what is left out (Marschall & Teitel
        2018, Sec. II and III B-C; Yuan et al. 2019, Sec. 2.2, where 2 has Monte Carlo of hard particles on
        the way, which orders them). 1 and 2 are short for the last two.
    phi_thermal, n_sweeps : float, int, optional
        Of yuan-2019-2: packing fraction and sweeps of the Monte Carlo; 0.55 and 100000 when left out.
    delta_phi : float, optional
        The step of the packing fraction near jamming, 2e-3 when left out, or of equal steps, 1e-3.
    start : path, optional
        Of marschall-2018: a file of `compress` or `slow_compress` in place of the compression. The search
        begins at its first frame that stays jammed when it is minimised; particles, n and seed are its own.
    search : {"direct", "halving"}, optional
        Of marschall-2018: how u0 is found; by ours, which leads box and particles at once (usual), or by
        the paper's steps of the box, 1e-6 at first and halved where u crosses u0 (Sec. III C, Eq. 20).
    minimiser : {"auto", "near", "newton", "cg_marschall"}, optional
        Of the halving search: "cg_marschall" is the conjugate gradients of its App. A; "auto" when left out.
    strict : bool
        Go on at the energy, along what slides, until no mode has an eigenvalue below zero by more than its
        bound; ``results["n_negative"]`` says how many have. Rods of alpha = 4 end at saddles otherwise.
    threads : int
        By which the contacts of a large packing are evaluated, thousands of particles on cores that are free.
        Last bits depend on it, and with them which of many minima is found; a packing that was
        cut off goes on with any number. Many packings take less time one beside the other, each in a process.
    file : path, optional
        H5MD file of the packing. One of this recipe is loaded from it, one that was cut off goes on from
        files beside it, and one of another recipe is refused. Without it nothing is kept but the result.
    again : bool
        Make it anew, whatever is there.
    progress : bool
        Whether a bar on standard error says how far it is.

    Returns
    -------
    MeasuredPacking
        Its ``reached`` says whether forces balance to the tolerance, and ``results["outcome"]`` how it ended.

    Raises
    ------
    ValueError
        If a number is out of its range or none of the way, or the file holds another packing.
    TargetError
        If the energy is not reached.
    PluginError
        If the way by dynamics finds no LAMMPS or no plugin for it.

    Warns
    -----
    NotReachedWarning
        If forces do not balance to the tolerance, after a second try as long as the first one.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> packing = js.make_packing(rods, n=16, u0=1e-8, file="packing.h5", progress=False)
    >>> abs(packing.u / 1e-8 - 1) < 1e-6
    True
    """
    recipe = recipe_for(
        particles, dimension, way, seed, n=n, u0=u0, accuracy=accuracy, tolerance=tolerance,
        protocol=protocol, phi_start=phi_start, kappa=kappa, p_end=p_end, phi_end=phi_end,
        phi_thermal=phi_thermal, n_sweeps=n_sweeps, delta_phi=delta_phi, start=start,
        search=search, minimiser=minimiser, strict=strict,
    )  # fmt: skip
    require_stated(threads=threads)
    at = place(file, "packing.h5")
    require_path(at.path)
    if again or not is_done(at.path):
        steps = make(recipe, at.path, again=again)
        with sharing(threads):
            follow(steps, _told, shown=progress)
    else:
        require_same(at.path, recipe)
        tidy(recipe, at.path)
    packing = MeasuredPacking.read(at.path)
    warn_unless_reached(packing.results)
    # A file that goes with its folder is nothing to name.
    return packing if at.folder is None else MeasuredPacking.of(packing, packing.results)


def _told(at: Progress) -> Told:
    return Told(at.phase, f"phi {at.phi:.6f}, {at.text}", at.part)
