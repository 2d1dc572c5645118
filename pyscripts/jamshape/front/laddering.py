"""Ladders: one packing at several energies, each state from the one before."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from jamshape.arguments import checked
from jamshape.checks import RANGES, ArgumentError, require_in, require_stated
from jamshape.front.progress import place
from jamshape.front.reading import Held
from jamshape.front.recorded import recorded
from jamshape.front.run import LadderFile
from jamshape.front.starts import start_of, told_of
from jamshape.landscape import Landscape
from jamshape.protocols.ladder import Ladder, plan

_ENERGY = RANGES["u0"]._replace(also=())
_MOST = 7000  # values, which are an attribute of the file


@checked
def ladder(
    packing: Held,
    *,
    u0: Sequence[float] | None = None,
    accuracy: float = 1e-7,
    tolerance: float = 1e-8,
    file: str | Path | None = None,
    again: bool = False,
    seconds: float | None = None,
    progress: bool = True,
) -> LadderFile:
    """Take a packing through energies, up or down; keep each state, and find which contacts open and close.

    Parameters
    ----------
    packing : Packing or path
        Packing, or a file that `load` reads, whose last frame to take.
    u0 : sequence of float, [energy / length^D]
        Energy densities, in the order in which to reach them.
    accuracy : float
        Largest abs(u - u0) / u0.
    tolerance : float
        Largest net force and torque of a particle over the mean bond force.
    file : path, optional
        H5MD file of the run, as in `compress`.
    again, seconds, progress
        See `compress`.

    Returns
    -------
    LadderFile
        A row and a frame for the start and each energy; ``run.contact_changes()`` lists contacts that change between.

    Raises
    ------
    ValueError
        If a number is out of its range or out of reach, or the file holds another run.

    Warns
    -----
    NotReachedWarning
        If no minimum with balanced forces was found at some energies; ``run.reached`` and ``run.at_rest`` say where.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Spherocylinders(alpha=0)
    >>> packing = js.make_packing(discs, n=16, u0=1e-4, file="dense.h5", progress=False)
    >>> run = js.ladder(packing, u0=[1e-5, 1e-6], progress=False)
    >>> run["u"].round(7).tolist()
    [0.0001, 1e-05, 1e-06]
    """
    require_stated(accuracy=accuracy, tolerance=tolerance)
    if not u0:
        said = "{u0:name} has no values, expected one energy density or more"
        raise ArgumentError(said, {"u0": u0})
    if len(u0) > _MOST:
        said = f"{{u0:name}} has {len(u0)} values, expected at most {_MOST}; divide them over several runs"
        raise ArgumentError(said, {"u0": u0})
    for value in u0:
        require_in("u0", value, _ENERGY)
    start = start_of(packing)
    how = Ladder("u0", tuple(u0), accuracy, tolerance)
    how.require_reachable(Landscape(start))
    at = place(file, "ladder.h5")
    recorded(
        at.path, plan(lambda: start, how, told_of(start)), again=again, seconds=seconds, progress=progress
    )  # fmt: skip
    return LadderFile(*at)
