"""Monte Carlo of hard particles: the thermal part of protocol 2 of Yuan et al. (2019), Sec. 2.2.

Translations and rotations together, no overlap ever. The moves' sizes are led to an acceptance between runs
of a few sweeps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from jamshape.landscape import Landscape
from jamshape.packing import Box, Packing, State

# Share of the moves that are accepted, and what a block of sweeps changes of their size at most.
_ACCEPTANCE = 0.35
_CHANGE = 1.5

_SWEEPS = 10

# A box is opened by so little at a time until no particles overlap.
_OPENING = 1e-6


@dataclass(eq=False)
class Thermal:
    """A simulation between two blocks of sweeps: all that is needed to go on from here.

    Parameters
    ----------
    packing
        Without overlaps.
    n_done
        Sweeps so far.
    size
        Of the moves: a shift of so many smallest radii, and a turn by so many radians.
    acceptance
        Of the last block.
    """

    packing: Packing
    n_done: int = 0
    size: float = 0.1
    acceptance: float = float("nan")


def equilibrate(thermal: Thermal, n_sweeps: int, seed: int) -> Iterator[Thermal]:
    """Run sweeps, of one move a particle each, to a number of them.

    Parameters
    ----------
    thermal : Thermal
        Where to begin, or to go on.
    n_sweeps : int
        N_s.
    seed : int
        The sequence depends on it and on `n_done` alone.

    Yields
    ------
    Thermal
        The same object after each block.

    Raises
    ------
    ValueError
        If particles overlap at the start, the box is tilted or shorter than two of them, or moves have no
        positive size.
    """
    _check(thermal)
    while thermal.n_done < n_sweeps:
        packing, n = thermal.packing, min(_SWEEPS, n_sweeps - thermal.n_done)
        block = np.random.SeedSequence([seed, thermal.n_done]).generate_state(1, np.uint64)[0]
        bodies = packing.compiled()
        # Moves that are longer than the box lead nowhere else.
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
        yield thermal


def _check(thermal: Thermal) -> None:
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
    """Open the box of a minimised packing until its last overlaps, of rounding size, are gone."""
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
