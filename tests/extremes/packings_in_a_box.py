"""Makers of packings: from arrays, in other units, squeezed; and all images of their pairs."""

import itertools

import numpy as np
from every_shape import in_doubles

from jamshape.contacts import find_contacts
from jamshape.landscape import Landscape, State
from jamshape.minima import Stop, minimise
from jamshape.packing import Box, Packing
from jamshape.protocols.thermal import without_overlaps
from methods.lbfgs import lbfgs

EPS = float(np.finfo(np.float64).eps)
LONG_EPS = float(np.finfo(np.longdouble).eps)


def packing_of(position, orientation, diameters, edges, **fields):
    """Packing about the origin from arrays; one orientation or shape may stand for all."""
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


def scaled(packing, factor):
    """The same packing in another unit of length."""
    state, long = State.of(packing), np.longdouble(factor)
    larger = packing.with_(
        diameters=factor * packing.diameters,
        box=Box.of(factor * packing.box.lo, factor * packing.box.matrix),
    )
    orientation = state.orientation[:, 0] if packing.dimension == 2 else state.orientation
    return larger.with_poses(long * state.position, orientation, long * state.cell)


def widened(packing, strain):
    return in_doubles(State.of(packing).strained(strain).packing(packing))


def deepest(packing):
    """Largest overlap of a bond."""
    bonds = find_contacts(packing, sides=1).bonds
    return float((1 - bonds.distance / bonds.reach).max(initial=0.0))


def pressed(packing, overlap):
    """Positions and box shrunk, orientations kept, until the deepest overlap is close to a number."""
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


def squeezed_until(packing, strain, evaluations, enough):
    """Compress by steps of a strain, each roughly minimised, until `enough(minimum)`."""
    landscape, state = Landscape(packing), State.of(packing)
    rough = Stop(tolerance=1e-2, lowest=1e-10, evaluations=evaluations)
    for _ in range(200):
        found = minimise(landscape, state.strained(-strain), lbfgs, rough)
        if enough(found):
            return in_doubles(found.state.packing(packing))
        state = found.state
    raise AssertionError


def at_a_minimum(scene):
    packing = scene()
    found = minimise(Landscape(packing), State.of(packing), "auto")
    return found.state.packing(packing)


def hardened(packing, wider=0.0):
    """Without overlaps, in a box at least twice as wide as the particles are long."""
    longest = 2 * float(packing.outer_radius.max())
    strain = max(wider, 2.001 * longest / float(packing.box.edges.min()) - 1)
    return without_overlaps(widened(packing, strain))


def every_image(packing):
    """All pairs (M, 2) and shifts (M, D) whose bounding spheres may overlap, each once."""
    bound = np.linalg.norm(packing.diameters[:, : packing.dimension], axis=1) / 2
    x, edges = packing.position, packing.box.edges
    most = np.ceil((4 * bound.max() + np.ptp(x, axis=0)) / edges).astype(int)
    shifts = np.array(list(itertools.product(*(range(-m, m + 1) for m in most))))
    i, j = np.triu_indices(packing.n)
    # An image of the particle itself and the opposite one are the same pair.
    first = (shifts != 0).argmax(axis=1)
    leading = shifts[np.arange(len(shifts)), first] > 0
    pairs, shifts = (
        np.repeat(np.column_stack([i, j]), len(shifts), axis=0),
        np.tile(shifts, (len(i), 1)),
    )
    apart = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]] - shifts * edges, axis=1)
    keep = (pairs[:, 0] < pairs[:, 1]) | np.tile(leading, len(i))
    keep &= apart < 1.001 * bound[pairs].sum(axis=1)
    return pairs[keep], shifts[keep]


def contacts_of(packing, pairs, shift):
    """Contacts of the pairs that are not apart, k_e = 1, with their errors."""
    return packing.compiled().contacts(*State.of(packing).split, pairs, shift, False, True)
