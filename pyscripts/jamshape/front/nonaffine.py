"""Non-affine displacements between two states."""

from __future__ import annotations

from jamshape.arguments import checked
from jamshape.checks import Range, require_in
from jamshape.front.reading import Held, packing_of
from jamshape.measures.nonaffine import Nonaffine, nonaffine_motion

_NEIGHBOURS = Range(1e-12, 1e12, "a distance")


@checked
def nonaffine(first: Held, second: Held, *, neighbours: float | None = None) -> Nonaffine:
    """Measure displacements beside the affine map of the box, and D2_min (Falk & Langer 1998).

    Parameters
    ----------
    first : Packing, run or path
        Reference state. Of a file that `jamshape.load` reads, the last frame is taken.
    second : Packing, run or path
        Another state of the same particles, matched by their IDs, with any box and tilt. The map of the box is the
        smaller one where tilts may have flipped, so that tilts should change by less than half an edge.
    neighbours : float, [length], optional
        Distance of centres up to which particles are neighbours in the first state; by default 1.5 times the largest
        distance of touching particles.

    Returns
    -------
    Nonaffine
        The displacements use image counts if there are any; otherwise they are to the nearest image.
        D2_min does not depend on image counts: two neighbours are assumed to move, beside the map of the box, by less
        than half a box relative to each other.

    Raises
    ------
    ValueError
        If IDs or dimensions differ, or a file holds no packing.

    Examples
    --------
    >>> import jamshape as js
    >>> packing = js.make_packing(js.Spherocylinders(alpha=1), n=16, u0=1e-8, progress=False)
    >>> position = packing.position.copy()
    >>> position[3, 0] += 0.1
    >>> moved = js.nonaffine(packing, packing.with_(position=position))
    >>> int(moved.D2_min.argmax()), moved.displacement[3].round(12).tolist()
    (3, [0.1, 0.0])
    """
    if neighbours is not None:
        require_in("neighbours", neighbours, _NEIGHBOURS)
    return nonaffine_motion(packing_of(first), packing_of(second), neighbours)
