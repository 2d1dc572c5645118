"""What the compiled contacts say of pairs of a packing that are listed one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from battery.scenes.superellipsoids import rows_of
from jamshape.arrays import BoolArray, IntArray
from jamshape.packing import Packing
from jamshape.shapes.single_pairs import superellipsoid_contacts, superellipsoid_overlap


def _rows(packing: Packing, pairs: IntArray, shift: IntArray) -> tuple[Any, Any]:
    rows, D = rows_of(packing), packing.dimension
    j = rows[pairs[:, 1]].copy()
    j[:, :D] += shift * packing.box.edges
    return np.ascontiguousarray(rows[pairs[:, 0]]), j


def overlapping(packing: Packing, pairs: IntArray, shift: IntArray) -> BoolArray:
    """(M,) whether the particles overlap, as hard ones."""
    return superellipsoid_overlap(*_rows(packing, pairs, shift))


def contacts_of(packing: Packing, pairs: IntArray, shift: IntArray) -> dict[str, NDArray[Any]]:
    """Contacts of the (C,) pairs that are not apart, k_e = 1."""
    found = superellipsoid_contacts(*_rows(packing, pairs, shift), 1.0)
    touching = np.flatnonzero(found["status"] > 0)
    return {"pair": touching} | {name: value[touching] for name, value in found.items()}
