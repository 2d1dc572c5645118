"""How extreme packings are made: of arrays, in other units, squeezed; and all their images."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray, IntArray
from jamshape.contacts import find_contacts
from jamshape.landscape import Landscape, State
from jamshape.minima import Minimum, Stop, minimise
from jamshape.packing import Box, Packing
from jamshape.protocols.thermal import without_overlaps
from methods.lbfgs import lbfgs

EPS = float(np.finfo(np.float64).eps)
LONG_EPS = float(np.finfo(np.longdouble).eps)

Scene = Callable[[], Packing]


def packing_of(
    position: ArrayLike,
    orientation: ArrayLike,
    diameters: ArrayLike,
    edges: ArrayLike,
    **fields: Any,
) -> Packing:
    """Make a packing from arrays; one orientation or shape may stand for all."""
    x, edges = np.asarray(position, float), np.asarray(edges, float)
    n, D = x.shape
    turn = np.broadcast_to(np.asarray(orientation, float), (n,) if D == 2 else (n, 4))
    return Packing(
        position=x,
        orientation=turn if D == 2 else turn / np.linalg.norm(turn, axis=1, keepdims=True),
        diameters=np.broadcast_to(np.asarray(diameters, float), (n, 3)),
        species=np.ones(n, np.int64),
        id=np.arange(1, n + 1),
        box=Box(-edges / 2, edges),
        **fields,
    )


def scaled(packing: Packing, factor: float) -> Packing:
    """All lengths times a factor: the same packing in another unit."""
    state = State.of(packing)
    factor_long = np.longdouble(factor)
    larger = packing.with_(
        diameters=factor * packing.diameters,
        box=Box.of(factor * packing.box.lo, factor * packing.box.matrix),
    )
    orientation = state.orientation[:, 0] if packing.dimension == 2 else state.orientation
    return larger.with_poses(factor_long * state.position, orientation, factor_long * state.cell)


def in_doubles(packing: Packing) -> Packing:
    """Forget the small rests of all coordinates."""
    return packing.with_(
        position=packing.position, orientation=packing.orientation, box=packing.box
    )


def widened(packing: Packing, strain: float) -> Packing:
    """Scale box and positions by 1 + strain."""
    return in_doubles(State.of(packing).strained(strain).packing(packing))


# --- squeezed ------------------------------------------------------------------------------------


def deepest(packing: Packing) -> float:
    """Largest overlap; 0 without contacts."""
    bonds = find_contacts(packing, sides=1).bonds
    return float((1 - bonds.distance / bonds.reach).max(initial=0.0))


def pressed(packing: Packing, overlap: float) -> Packing:
    """Shrink positions and box, orientations kept, until the deepest overlap is close to a number."""
    state, step = State.of(packing), 0.02
    while step > 1e-9:
        closer = state.strained(-step)
        try:
            found = deepest(closer.packing(packing))
        except ValueError:  # spines cross
            found = np.inf
        if found > overlap:
            step /= 2
            continue
        state = closer
        if found > 0.9 * overlap:
            break
    return state.packing(packing)


def squeezed(
    packing: Packing, strain: float, evaluations: int, enough: Callable[[Minimum], bool]
) -> Packing:
    """Compress by steps of a strain, roughly minimised after each, until it is enough.

    Raises
    ------
    ValueError
        If it is not after 200 steps.
    """
    landscape, state = Landscape(packing), State.of(packing)
    rough = Stop(tolerance=1e-2, lowest=1e-10, evaluations=evaluations)
    for _ in range(200):
        found = minimise(landscape, state.strained(-strain), lbfgs, rough)
        if enough(found):
            return in_doubles(found.state.packing(packing))
        state = found.state
    msg = "200 steps of compression are not enough, expected a jammed packing"
    raise ValueError(msg)


def squeezed_to(packing: Packing, phi: float) -> Packing:
    """Compress to a packing fraction, roughly minimised on the way."""
    landscape, state = Landscape(packing), State.of(packing)
    rough = Stop(tolerance=1e-2, lowest=1e-10, evaluations=200)
    while (now := state.packing(packing).phi) < phi * (1 - 1e-12):
        strain = max(-0.01, (now / phi) ** (1 / packing.dimension) - 1)
        state = minimise(landscape, state.strained(strain), lbfgs, rough).state
    return in_doubles(state.packing(packing))


def at_a_minimum(scene: Scene) -> Packing:
    """Find the minimum next to a scene."""
    packing = scene()
    found = minimise(Landscape(packing), State.of(packing), "auto")
    return found.state.packing(packing)


def hardened(packing: Packing, wider: float = 0.0) -> Packing:
    """Open a box until no particles overlap, and it is twice as wide as they are long."""
    longest = 2 * float(packing.outer_radius.max())
    strain = max(wider, 2.001 * longest / float(packing.box.edges.min()) - 1)
    return without_overlaps(widened(packing, strain))


# --- images --------------------------------------------------------------------------------------


def every_image(packing: Packing) -> tuple[IntArray, IntArray]:
    """All pairs (M, 2) and shifts (M, D) whose bounding spheres may overlap, each once."""
    bound = np.linalg.norm(packing.diameters[:, : packing.dimension], axis=1) / 2
    pairs, shifts = _all_images(packing, 4 * float(bound.max()))
    x = packing.position
    apart = x[pairs[:, 0]] - x[pairs[:, 1]] - shifts * packing.box.edges
    near = np.linalg.norm(apart, axis=1) < 1.001 * (bound[pairs[:, 0]] + bound[pairs[:, 1]])
    return pairs[near], shifts[near]


def _all_images(packing: Packing, reach: float) -> tuple[IntArray, IntArray]:
    """Pairs and shifts of all images, of a pair and its opposite one of both."""
    most = np.ceil((reach + np.ptp(packing.position, axis=0)) / packing.box.edges).astype(int)
    shifts = np.array(list(itertools.product(*(range(-m, m + 1) for m in most))))
    i, j = np.triu_indices(packing.n)
    first = (shifts != 0).argmax(axis=1)
    leading = shifts[np.arange(len(shifts)), first] > 0
    pairs = np.repeat(np.column_stack([i, j]), len(shifts), axis=0)
    keep = (pairs[:, 0] < pairs[:, 1]) | np.tile(leading, len(i))
    return pairs[keep], np.tile(shifts, (len(i), 1))[keep]


def wrapped(shift: FloatArray, edges: FloatArray) -> FloatArray:
    """Shortest of all images of displacements."""
    return np.asarray(shift - edges * np.round(shift / edges))
