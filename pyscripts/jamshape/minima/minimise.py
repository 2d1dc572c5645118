"""Minimisers of the energy of a packing: one interface for all methods.

All work on the coordinates of a `Landscape` (positions and, scaled to lengths, rotations), start from a `State`
and return a `Minimum` with the outcome and the history of the residual.
"""

from __future__ import annotations

from collections.abc import Callable

from jamshape.landscape import Landscape
from jamshape.minima.cg_marschall import cg_marschall
from jamshape.minima.descent import Descent, History, Minimum, Outcome, Stop
from jamshape.minima.newton import auto, near, newton
from jamshape.packing import State

Method = Callable[[Descent], Outcome]


def minimise(
    landscape: Landscape,
    start: State,
    method: str | Method = "auto",
    stop: Stop | None = None,
    history: History | None = None,
) -> Minimum:
    """Minimise the energy at fixed box.

    Parameters
    ----------
    landscape : Landscape
    start : State
    method : str or callable
        One of `METHODS`: ``auto``, ``near``, ``newton``, ``cg_marschall``; or a function that moves a
        `Descent` along and returns how it ended.
    stop : Stop, optional
    history : History, optional
        History to append to.

    Returns
    -------
    Minimum
        Check its outcome; there is no warning, since many callers want no more than a few evaluations.

    Raises
    ------
    ValueError
        If the method is unknown.
    CrossingError
        If spines cross at the start.
    """
    if isinstance(method, str):
        if method not in METHODS:
            msg = f"the method is {method!r}, expected one of {', '.join(METHODS)}"
            raise ValueError(msg)
        method = METHODS[method]
    descent = Descent(landscape, start, stop or Stop(), history)
    return descent.minimum(method(descent))


METHODS: dict[str, Method] = {
    "auto": auto,
    "near": near,
    "newton": newton,
    "cg_marschall": cg_marschall,
}
