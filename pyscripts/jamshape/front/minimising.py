"""Minimisation of a state of one's own."""

from __future__ import annotations

from pathlib import Path

from jamshape.arguments import checked
from jamshape.checks import RANGES, require_stated
from jamshape.front.making import made_or_kept
from jamshape.front.packing import Packing
from jamshape.front.reading import Held, packing_of
from jamshape.front.starts import told_of
from jamshape.minima.target import FixedBox
from jamshape.protocols.recipe import Given, Recipe
from jamshape.shapes.particles import Particles


@checked
def minimise(
    packing: Held,
    *,
    tolerance: float = 1e-8,
    minimiser: str = "auto",
    evaluations: int = 200_000,
    strict: bool = False,
    threads: int = 1,
    file: str | Path | None = None,
    again: bool = False,
    seconds: float | None = None,
    progress: bool = True,
) -> Packing:
    """Minimise the energy of a packing at its box, under its own law.

    Parameters
    ----------
    packing : Packing or path
        Any state, or a file that `load` reads, of which the last frame is taken.
    tolerance : float
        Largest net force and torque on a particle over the mean force of a bond; torques are divided by the length A or a.
    minimiser : {"auto", "near", "newton", "cg_marschall"}
        L-BFGS followed by Newton's method (auto), Newton's method first, for a state near its minimum (near), or alone
        (newton), or the conjugate gradients in appendix A of Marschall & Teitel 2018.
    evaluations : int
        Largest number of evaluations of all forces.
    strict : bool
        Continue at the same box, along floppy modes, until no mode has an eigenvalue below minus its error bound;
        ``n_negative`` of the results counts those that do.
    threads : int
        Number of threads, as in `make_packing`.
    file : path, optional
        H5MD file of the result. The same call loads it, or resumes an interrupted one from a file beside it.
    again, seconds, progress
        See `compress`.

    Returns
    -------
    Packing
        ``results["outcome"]`` is ``converged``, ``kink`` (at rest on a kink of the energy), ``unjammed`` (no forces are
        left), ``sliding``, ``stalled`` or ``exhausted``; ``reached`` is true for the first three.

    Raises
    ------
    ValueError
        If a number is out of its range, or the file holds something else.
    CrossingError
        If the cores of two particles cross, where their energy is undefined.
    TimeLimitError
        If `seconds` are over before the end.

    Warns
    -----
    NotReachedWarning
        If forces do not balance to the tolerance.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Packing.of(
    ...     "spherocylinder", position=[[0.2, 0.3], [1.0, 0.2], [0.6, 1.1]], box=[2, 2], alpha=0
    ... )
    >>> rested = js.minimise(discs, progress=False)
    >>> rested.results["outcome"], discs.u > 0, rested.u
    ('unjammed', True, 0.0)
    """
    require_stated(tolerance=tolerance, evaluations=evaluations)
    state = packing_of(packing)
    recipe = _recipe(
        state,
        Given(state, _made_from(state), FixedBox(tolerance, minimiser), evaluations),
        strict=strict,
    )
    return made_or_kept(
        recipe, file, threads=threads, again=again, seconds=seconds, progress=progress
    )


def _made_from(state: Packing) -> dict[str, object]:
    """Describe the state, and tell it from others, wherever its file lies."""
    name = state.file.name if state.file else "packing"
    return told_of(state) | {"start": name}


def _recipe(state: Packing, way: Given, *, strict: bool) -> Recipe:
    particles = Particles.given(state.shape, state.diameters, state.exponent, state.species)
    low, high = RANGES["phi_start"].low, RANGES["phi_start"].high
    phi = min(max(state.phi, low), high)
    return Recipe(particles, state.n, state.dimension, 1, phi, way, target=None, strict=strict)
