"""Monte Carlo of hard particles: the thermal part of protocol 2 of Yuan et al. (2019), Sec. 2.2.

Translations and rotations together, without any overlap. The size of moves is adapted to an acceptance between runs
of a few sweeps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from jamshape.landscape import Landscape
from jamshape.packing import Box, Packing, State

_ACCEPTANCE = 0.35  # target fraction of accepted moves
_CHANGE = 1.5  # largest change of their size between blocks

_SWEEPS = 10

# Increment by which a box is opened until no particles overlap.
_OPENING = 1e-6


@dataclass(eq=False)
class Thermal:
    """A simulation between two blocks of sweeps, with all that is needed to resume it.

    Parameters
    ----------
    packing
        State without overlaps.
    n_done
        Sweeps so far.
    size
        Size of moves: displacements in smallest radii, and rotations in radians.
    acceptance
        Acceptance of the last block.
    """

    packing: Packing
    n_done: int = 0
    size: float = 0.1
    acceptance: float = float("nan")


def equilibrate(thermal: Thermal, n_sweeps: int, seed: int) -> Iterator[Thermal]:
    """Run sweeps, of one move a particle each, up to a total number.

    Parameters
    ----------
    thermal : Thermal
        Initial or resumed state.
    n_sweeps : int
        N_s.
    seed : int
        The sequence depends only on it and on `n_done`.

    Yields
    ------
    Thermal
        The same object after each block.

    Raises
    ------
    ValueError
        If particles overlap at the start, the box is tilted or shorter than two of them, or moves do not have a
        positive size.
    """
    require(thermal)
    while thermal.n_done < n_sweeps:
        sweep(thermal, n_sweeps, seed)
        yield thermal


def sweep(thermal: Thermal, n_sweeps: int, seed: int) -> None:
    """Run a block of sweeps; parameters as `equilibrate`."""
    packing, n = thermal.packing, min(_SWEEPS, n_sweeps - thermal.n_done)
    block = np.random.SeedSequence([seed, thermal.n_done]).generate_state(1, np.uint64)[0]
    bodies = packing.compiled()
    # Moves longer than the box are redundant.
    longest = float(packing.box.edges.min())
    found = bodies.sweeps(
        packing.position - packing.box.lo,
        packing.orientation.reshape(packing.n, -1),
        packing.box.edges,
        min(thermal.size * float(bodies.inner_radius.min()), longest),
        min(thermal.size, 1.0),
        n,
        int(block),
    )
    orientation = found["orientation"]
    thermal.packing = packing.with_(
        position=found["position"] + packing.box.lo,
        orientation=orientation[:, 0] if packing.dimension == 2 else orientation,
    )
    thermal.n_done += n
    thermal.acceptance = found["accepted"] / found["tried"]
    change = np.clip(thermal.acceptance / _ACCEPTANCE, 1 / _CHANGE, _CHANGE)
    thermal.size = float(min(thermal.size * change, 2.0))


def require(thermal: Thermal) -> None:
    """Refuse a tilted box and moves without a size; raises ValueError."""
    if thermal.packing.box.is_tilted:
        msg = (
            f"the box has the tilt {thermal.packing.box.tilt.tolist()}, expected none for Monte Carlo;"
            " begin from an orthogonal one"
        )
        raise ValueError(msg)
    if not (math.isfinite(thermal.size) and thermal.size > 0):
        msg = f"size is {thermal.size}, expected a positive number of radii"
        raise ValueError(msg)


def without_overlaps(packing: Packing) -> Packing:
    """Open the box of a minimised packing until its last overlaps, of rounding size, vanish."""
    opening = _OPENING
    while True:
        factor = 1 + opening
        wider = packing.with_(
            position=packing.box.lo + factor * (packing.position - packing.box.lo),
            box=Box.of(packing.box.lo, factor * packing.box.matrix),
        )
        if not _overlaps(wider):
            return wider
        opening *= 2


def _overlaps(packing: Packing) -> bool:
    return Landscape(packing).evaluate(State.of(packing), extended=False).n_bonds > 0
