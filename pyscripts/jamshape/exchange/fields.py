"""All that a packing holds as arrays under names, and as programs with a box around 0 see it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.packing import Box, Packing

PARTICLES = ("position", "orientation", "diameters", "exponent", "species", "id", "image")
PARTICLE_RESTS = ("position_rest", "orientation_rest")

Fields = dict[str, NDArray[Any]]

_INT32 = np.iinfo(np.int32)


def particle_fields(packing: Packing, *, rests: bool) -> Fields:
    """Give arrays with a row for each particle."""
    return {name: getattr(packing, name) for name in PARTICLES + PARTICLE_RESTS * rests}


def box_fields(packing: Packing, *, rests: bool) -> Fields:
    """Give the arrays (D,) of the box."""
    fields = {"lo": packing.box.lo, "edges": packing.box.edges}
    return fields | ({"edges_rest": packing.edges_rest} if rests else {})


def packing_of(fields: Mapping[str, Any], shape_style: str, step: int, time: float) -> Packing:
    """Put a packing together from the fields of particles and box; errors as `Packing`."""
    known = dict(fields)
    box = Box(lo=known.pop("lo"), edges=known.pop("edges"))
    return Packing(box=box, shape_style=shape_style, step=step, time=time, **known)


class Centered(NamedTuple):
    """Particles in a box whose centre is the origin, always with three components."""

    position: FloatArray
    """(N, 3), [length], each from minus half an edge to half an edge."""
    image: IntArray
    """(N, 3) box edges that lead from there to where the particle has come."""
    edges: FloatArray
    """(3,), [length]; 0 along z in 2D."""


def centered(packing: Packing) -> Centered:
    """Move a packing into a box around 0."""
    edges = packing.box.edges
    offset = packing.position - (packing.box.lo + edges / 2)
    turns = np.rint(offset / edges)
    image = np.clip(packing.image + turns, _INT32.min, _INT32.max).astype(np.int64)
    return Centered(in_space(offset - turns * edges), in_space(image), in_space(edges))


def in_space(vectors: NDArray[Any]) -> NDArray[Any]:
    """Append zeros to (..., D) so that there are three components."""
    missing = 3 - vectors.shape[-1]
    return np.pad(vectors, [(0, 0)] * (vectors.ndim - 1) + [(0, missing)])


class Alike(NamedTuple):
    """Particles that are alike."""

    first: IntArray
    """(K,) a row of each."""
    of: IntArray
    """(N,) from 0 to K - 1."""


def alike(packing: Packing, *more: NDArray[Any]) -> Alike:
    """Tell which particles have the same diameters, exponent and whatever else (N,) counts."""
    rows = np.column_stack([*more, packing.diameters, packing.exponent])
    _, first, of = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return Alike(first, of.ravel())
