"""What the compiled contacts say of pairs of a packing that are listed one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import BoolArray, IntArray
from jamshape.packing import Packing, State


def overlapping(packing: Packing, pairs: IntArray, shift: IntArray) -> BoolArray:
    """(M,) whether the particles overlap, as hard ones."""
    split = State.of(packing).split
    return np.asarray(packing.compiled().overlaps(*split, pairs, shift))


def contacts_of(packing: Packing, pairs: IntArray, shift: IntArray) -> dict[str, NDArray[Any]]:
    """Contacts of the (C,) pairs that are not apart, k_e = 1, and their errors."""
    found: dict[str, NDArray[Any]]
    found = packing.compiled().contacts(*State.of(packing).split, pairs, shift, False, True)
    return found
