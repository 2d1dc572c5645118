"""Proof that a state is a strict minimum, from its modes and from kinks of the energy.

A minimum may lie on a kink of the energy, where the tips of two rods are level (`vibration.kinks`). Second
derivatives on one side are then negative although no step lowers the energy: such a state is a minimum if its energy
rises on both sides and no motion along the kink has a negative eigenvalue. See `Proof.n_kinked` for the count.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.landscape import Landscape
from jamshape.packing import State
from jamshape.vibration.hessian import DynamicalMatrix, Scope, dynamical_matrix
from jamshape.vibration.kinks import held_at, kinks_across
from jamshape.vibration.sparse_modes import lowest
from jamshape.vibration.spectrum import Spectrum, spectrum

_DENSE = 3000  # coordinates up to which all modes are found
_SOFTEST = 60  # modes found beyond that


@dataclass(frozen=True)
class Proof:
    """Summary of the modes of a minimum.

    Parameters
    ----------
    n_negative
        Number of modes with an eigenvalue below minus its numerical bound, for motions that cross no kink
        of the minimum.
    lowest, bound
        Lowest of these eigenvalues, without translations, and its error bound, [energy / length^2].
    n_kinked
        Number of negative eigenvalues removed by kinks, where the energy rises on both sides (`vibration.kinks`).
    """

    n_negative: int
    lowest: float
    bound: float
    n_kinked: int

    @classmethod
    def of(cls, landscape: Landscape, state: State) -> Proof:
        """Find the modes of a state, by `vibration.spectrum` of relative accuracy."""
        return ModesOffKinks.of(landscape, state).proof()

    def attributes(self) -> dict[str, Any]:
        """Return its numbers as attributes."""
        return {
            "n_negative": self.n_negative,
            "lowest_eigenvalue": self.lowest,
            "lowest_eigenvalue_bound": self.bound,
            "n_kinked": self.n_kinked,
        }


@dataclass(frozen=True, eq=False)
class ModesOffKinks:
    """Modes of a state for motions that cross none of its kinks.

    Parameters
    ----------
    matrix : DynamicalMatrix
        Dynamical matrix with a stiff row across each kink.
    found : Spectrum
        All its modes, or the softest ones of large packings.
    n_falling
        Number of negative eigenvalues before kinks were constrained.
    """

    matrix: DynamicalMatrix
    found: Spectrum
    n_falling: int

    @classmethod
    def of(cls, landscape: Landscape, state: State) -> ModesOffKinks:
        """Find the modes; twice, if modes have negative eigenvalues and kinks remove some."""
        matrix = dynamical_matrix(landscape, state, Scope(force=True))
        found = _modes(matrix)
        is_falling = (found.sign < 0) & ~found.is_translation
        kinks = kinks_across(landscape, state, matrix, found.vectors[:, is_falling])
        if kinks.shape[1]:
            matrix = held_at(matrix, kinks)
            found = _modes(matrix)
        return cls(matrix, found, int(is_falling.sum()))

    def proof(self) -> Proof:
        """Return the proof."""
        first = self._lowest()
        n_negative = int((self.found.sign[~self.found.is_translation] < 0).sum())
        value, bound = float(self.found.eigenvalues[first]), float(self.found.bound[first])
        return Proof(n_negative, value, bound, self.n_falling - n_negative)

    def lowest_motion(self) -> tuple[FloatArray, FloatArray]:
        """Return displacements and rotations of the lowest nontranslational mode, with largest entry 1."""
        mode = self.found.vectors[:, self._lowest()]
        return self.matrix.coordinates.motion(mode / np.abs(mode).max())

    def _lowest(self) -> int:
        own = np.flatnonzero(~self.found.is_translation)
        return int(own[np.argmin(self.found.eigenvalues[own])])


def _modes(matrix: DynamicalMatrix) -> Spectrum:
    most = matrix.size - matrix.translations.shape[1] - 2
    if matrix.size <= _DENSE or most <= _SOFTEST:
        return spectrum(matrix)
    return lowest(matrix, _SOFTEST)
