"""Contents of a packing as named arrays, also for programs with a box around 0."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.packing import Box, Packing

PARTICLES = ("position", "orientation", "diameters", "species", "id", "image")
PARTICLE_RESTS = ("position_rest", "orientation_rest")

Fields = dict[str, NDArray[Any]]

_INT32 = np.iinfo(np.int32)


def particle_fields(packing: Packing, *, rests: bool) -> Fields:
    """Return arrays with a row for each particle."""
    form = "form" if packing.form.shape[1] > 1 else "exponent"
    return {name: getattr(packing, name) for name in (*PARTICLES, form, *PARTICLE_RESTS * rests)}


def box_fields(packing: Packing, *, rests: bool, tilted: bool) -> Fields:
    """Return the arrays of the box; without tilt if no box is tilted."""
    fields = {"lo": packing.box.lo, "edges": packing.box.edges}
    fields |= {"tilt": packing.box.tilt} if tilted else {}
    fields |= {"edges_rest": packing.edges_rest} if rests else {}
    return fields | ({"tilt_rest": packing.tilt_rest} if rests and tilted else {})


def packing_of(fields: Mapping[str, Any], shape_style: str, step: int, time: float) -> Packing:
    """Build a packing from the fields of particles and box; errors as `Packing`."""
    known = dict(fields)
    box = Box(known.pop("lo"), known.pop("edges"), known.pop("tilt", np.empty(0)))
    return Packing(box=box, shape_style=shape_style, step=step, time=time, **known)


class Centered(NamedTuple):
    """Particles in a box whose centre is the origin, always with three components."""

    position: FloatArray
    """(N, 3), [length], each from minus half a cell vector to half a cell vector."""
    image: IntArray
    """(N, 3) cell vectors from there to the unwrapped position."""
    box: FloatArray
    """(6,) edges, [length], and tilt factors xy, xz, yz; 0 along z in 2D."""


def centered(packing: Packing) -> Centered:
    """Move a packing into a box around 0."""
    box = packing.box
    offset = packing.position - box.center
    turns = np.rint(box.fractions(offset))
    image = np.clip(packing.image + turns, _INT32.min, _INT32.max).astype(np.int64)
    sizes = np.concatenate([in_space(box.edges), in_space(box.tilt_factors)])
    return Centered(in_space(offset - box.vectors(turns)), in_space(image), sizes)


def in_space(vectors: NDArray[Any]) -> NDArray[Any]:
    """Append zeros to (..., D) so that there are three components."""
    missing = 3 - vectors.shape[-1]
    return np.pad(vectors, [(0, 0)] * (vectors.ndim - 1) + [(0, missing)])


class Alike(NamedTuple):
    """Groups of equal particles."""

    first: IntArray
    """(K,) a row of each group."""
    of: IntArray
    """(N,) group, from 0 to K - 1."""


def alike(packing: Packing, *more: NDArray[Any]) -> Alike:
    """Group particles with equal diameters, form and further (N,) values."""
    rows = np.column_stack([*more, packing.diameters, packing.form])
    _, first, of = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return Alike(first, of.ravel())
