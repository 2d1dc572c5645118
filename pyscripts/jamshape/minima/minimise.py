"""Minimisers of the energy of a packing: one interface, four methods and an automatic one.

All work on the coordinates of a `Landscape` (positions and, scaled to lengths, rotations), start from a `State`
and return a `Minimum` with the outcome and the history of the residual.
"""

from __future__ import annotations

from collections.abc import Callable

from jamshape.landscape import Landscape
from jamshape.minima.descent import Descent, History, Minimum, Outcome, Stop
from jamshape.minima.lbfgs import lbfgs
from jamshape.minima.newton import auto, near, newton
from jamshape.minima.paper import paper
from jamshape.packing import State


def minimise(
    landscape: Landscape,
    start: State,
    method: str = "auto",
    stop: Stop | None = None,
    history: History | None = None,
) -> Minimum:
    """Minimise the energy at fixed box.

    Parameters
    ----------
    landscape : Landscape
    start : State
    method : str
        One of `METHODS`: ``auto``, ``near``, ``newton``, ``lbfgs``, ``paper``, ``lammps``.
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
    if method not in METHODS:
        msg = f"the method is {method!r}, expected one of {', '.join(METHODS)}"
        raise ValueError(msg)
    descent = Descent(landscape, start, stop or Stop(), history)
    return descent.minimum(METHODS[method](descent))


def _lammps(descent: Descent) -> Outcome:
    """LAMMPS's conjugate gradients; LAMMPS is started only here."""
    from jamshape.minima.lammps_cg import descend  # noqa: PLC0415

    return descend(descent) or Outcome.STALLED


METHODS: dict[str, Callable[[Descent], Outcome]] = {
    "auto": auto,
    "near": near,
    "newton": newton,
    "lbfgs": lbfgs,
    "paper": paper,
    "lammps": _lammps,
}
