"""Ladders: one packing at several energies or pressures, each state from the one before."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from jamshape.arguments import checked
from jamshape.checks import ArgumentError, require_in, require_no_effect, require_stated
from jamshape.front.progress import place
from jamshape.front.reading import Held
from jamshape.front.recorded import recorded
from jamshape.front.run import LadderFile
from jamshape.front.starts import start_of, told_of
from jamshape.landscape import Landscape
from jamshape.protocols.ladder import Ladder, plan

_MOST = 7000  # values, which are an attribute of the file


@checked
def ladder(
    packing: Held,
    *,
    u0: Sequence[float] | None = None,
    pressure: Sequence[float] | None = None,
    box: str = "isotropic",
    accuracy: float = 1e-7,
    tolerance: float = 1e-8,
    file: str | Path | None = None,
    again: bool = False,
    seconds: float | None = None,
    progress: bool = True,
) -> LadderFile:
    """Take a packing through energies or pressures, up or down; keep each state, and find which contacts open and close.

    Parameters
    ----------
    packing : Packing, run or path
        Packing, or a file that `load` reads, whose last frame to take.
    u0 : sequence of float, [energy / length^D], optional
        Energy densities, in the order in which to reach them.
    pressure : sequence of float, [energy / length^D], optional
        Pressures, in the order in which to reach them, instead of `u0`.
    box : str
        How the box yields, as in `make_packing`.
    accuracy : float
        Largest abs(u - u0) / u0, or relative error of the pressure tensor.
    tolerance : float
        Largest net force and torque of a particle over the mean bond force.
    file : path, optional
        H5MD file of the run, as in `compress`.
    again, seconds, progress
        See `compress`.

    Returns
    -------
    LadderFile
        A row and a frame for the start and each value; ``run.contact_changes()`` lists contacts that change between.

    Raises
    ------
    ValueError
        If a number is out of its range or out of reach, or the file holds another run.

    Warns
    -----
    NotReachedWarning
        If no minimum with balanced forces was found at some values; ``run.reached`` and ``run.at_rest`` say where.

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
    require_no_effect("pressure", pressure, u0=u0)
    name, values = ("u0", u0) if pressure is None else ("pressure", pressure)
    if not values:
        said = f"{{{name}:name}} has no values, expected one or more"
        raise ArgumentError(said, {name: values})
    if len(values) > _MOST:
        said = f"{{{name}:name}} has {len(values)} values, expected at most {_MOST}; divide them over several runs"
        raise ArgumentError(said, {name: values})
    start = start_of(packing)
    for value in values:
        require_in(name, value, start.law.range_of(name)._replace(also=()))
    how = Ladder(name, tuple(values), accuracy, tolerance, box)
    how.require_reachable(Landscape(start))
    at = place(file, "ladder.h5")
    recorded(
        at.path, plan(lambda: start, how, told_of(start)), again=again, seconds=seconds, progress=progress
    )  # fmt: skip
    return LadderFile(*at)
