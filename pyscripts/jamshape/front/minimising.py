"""Minimisation of a state of one's own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from jamshape.arguments import checked
from jamshape.checks import RANGES, require_in, require_no_effect, require_stated, require_with
from jamshape.front.making import made_or_kept
from jamshape.front.packing import Packing
from jamshape.front.reading import Held, packing_of
from jamshape.front.starts import told_of
from jamshape.minima.boxes import FIXED, FREE
from jamshape.minima.target import FixedBox, Target
from jamshape.protocols.defaults import aim_of
from jamshape.protocols.recipe import Aim, Given, Recipe
from jamshape.shapes.particles import Particles
from jamshape.shapes.shape import Interaction

_EVALUATIONS = 200_000


@checked
def minimise(
    packing: Held,
    *,
    u0: float | None = None,
    pressure: float | None = None,
    phi: float | None = None,
    box: str | None = None,
    accuracy: float | None = None,
    tolerance: float = 1e-8,
    minimiser: str | None = None,
    evaluations: int | None = None,
    strict: bool = False,
    stable_to_shear: bool = False,
    threads: int = 1,
    file: str | Path | None = None,
    again: bool = False,
    seconds: float | None = None,
    progress: bool = True,
) -> Packing:
    """Minimise the energy of a packing in its box, or at a given pressure, energy or packing fraction.

    Parameters
    ----------
    packing : Packing, run or path
        Any state, or a file that `load` reads, of which the last frame is taken.
    u0, pressure, phi, box, accuracy
        Target, and how the box yields, as in `make_packing`; without a target the box is "fixed".
    tolerance : float
        Largest net force and torque on a particle over the mean force of a bond; torques are divided by the length A or a.
    minimiser : {"auto", "near", "newton", "cg_marschall"}, optional
        At a fixed box: L-BFGS followed by Newton's method (auto), Newton's method first, for a state near its minimum (near), or alone
        (newton), or the conjugate gradients in appendix A of Marschall & Teitel 2018.
    evaluations : int, optional
        Largest number of evaluations of all forces at a fixed box; 200000 by default.
    strict : bool
        Continue at the same box, along floppy modes, until no mode has an eigenvalue below minus its error bound;
        ``n_negative`` of the results counts those that do.
    stable_to_shear : bool
        As in `make_packing`.
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
    most = _EVALUATIONS if evaluations is None else evaluations
    require_stated(tolerance=tolerance, evaluations=most)
    state = packing_of(packing)
    goal: FixedBox | Aim = FixedBox(tolerance, minimiser or "auto")
    targets = {"u0": u0, "pressure": pressure, "phi": phi}
    box = FREE if stable_to_shear and box is None else box
    if box not in {None, FIXED} or any(value is not None for value in targets.values()):
        goal = _aim(targets, box, accuracy, tolerance, state.law)
        named = next(name for name, value in targets.items() if value is not None)
        require_no_effect(named, targets[named], minimiser=minimiser, evaluations=evaluations)
    elif accuracy is not None:
        require_with("u0", None, accuracy=accuracy)
    recipe = _recipe(state, Given(state, _made_from(state), goal, most), strict, stable_to_shear)
    return made_or_kept(
        recipe, file, threads=threads, again=again, seconds=seconds, progress=progress
    )


def _aim(
    targets: Mapping[str, float | None],
    box: str | None,
    accuracy: float | None,
    tolerance: float,
    law: Interaction,
) -> Aim:
    """Return the target, with the box that yields to it."""
    u0 = targets["u0"]
    if u0 is not None:
        require_in("u0", u0, law.range_of("u0")._replace(also=()))
    get = {"u0": u0, "tolerance": tolerance, "power": law.power}
    given = {"u0": u0, "accuracy": accuracy}
    aim = aim_of(get, given, pressure=targets["pressure"], phi=targets["phi"], box=box)
    if aim is not None:
        return aim
    assert u0 is not None
    return Target(u0, 1e-7 if accuracy is None else accuracy, tolerance)


def _made_from(state: Packing) -> dict[str, object]:
    """Describe the state, and distinguish it from others, wherever its file is."""
    name = state.file.name if state.file else "packing"
    return told_of(state) | {"start": name}


def _recipe(state: Packing, way: Given, strict: bool, stable_to_shear: bool) -> Recipe:
    particles = Particles.given(state.shape, state.diameters, state.form, state.species)
    low, high = RANGES["phi_start"].low, RANGES["phi_start"].high
    phi = min(max(state.phi, low), high)
    numbers = (state.n, state.dimension, 1, phi)
    return Recipe(particles, *numbers, way, None, strict=strict, stable_to_shear=stable_to_shear)
