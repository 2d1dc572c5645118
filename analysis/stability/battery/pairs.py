"""Pairs of bodies one by one, of any shape, and what is judged alike of them all."""

from __future__ import annotations

from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import BoolArray, FloatArray

TOUCHING, CROSSING = 1, 2  # ContactStatus of contact/contact.hpp

OVERLAPS = (1e-14, 1e-11, 1e-8, 1e-4, 1 / 3)


class Pairs(Protocol):
    """M pairs of bodies."""

    def contacts(self, k_e: float = 1.0, sides: int = 1) -> dict[str, NDArray[Any]]:
        """Evaluate them."""

    def in_unit(self, length: float) -> Self:
        """Give the same pairs with all lengths times a factor."""

    @property
    def arms(self) -> FloatArray:
        """(M,) the longest lever that a force may have."""


def in_other_units(pairs: Pairs, sides: int, length: float, energy: float) -> float:
    """Energies scale with k_e alone, forces with k_e over the length: change over the sizes of each pair."""
    small, large = pairs.contacts(1.0, sides), pairs.in_unit(length).contacts(energy, sides)
    if (small["status"] != large["status"]).any():
        return np.inf
    force, worst = np.linalg.norm(small["force"], axis=1), 0.0
    for name, unit, size in (
        ("energy", energy, small["energy"]),
        ("force", energy / length, force),
        ("torque_i", energy, pairs.arms * force),
    ):
        value = small[name].reshape(len(size), -1)
        change = np.abs(large[name].reshape(value.shape) / unit - value).max(axis=1)
        worst = max(worst, float((change / size).max()))
    return worst


def unnamed(pairs: Pairs, sides: int, *, must_cross: bool) -> float:
    """Share of pairs that are neither named as crossing nor, unless they must, have finite forces."""
    found = pairs.contacts(1.0, sides)
    right: BoolArray = found["status"] == CROSSING
    if not must_cross:
        finite = np.isfinite(found["force"]).all(axis=1) & (found["status"] == TOUCHING)
        right = right | (finite & (np.linalg.norm(found["force"], axis=1) > 0))
    return float(1 - right.mean())
