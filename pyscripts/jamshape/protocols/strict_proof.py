"""What proves that a state is a strict minimum: its modes, and what kinks of the energy take of them.

A minimum may lie on a kink of the energy, where the tips of two rods are level (`vibration.kinks`). Second derivatives of one
side are then negative, and no step lowers the energy: such a state is a minimum if its energy rises to both sides of the kink
and no motion along the kink has a negative eigenvalue. What kinks take is counted apart, as in `Proof.n_kinked`.
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

# All modes are found up to so many coordinates, beyond only the softest.
_DENSE = 3000
_SOFTEST = 60


@dataclass(frozen=True)
class Proof:
    """What is known of the modes of a minimum.

    Parameters
    ----------
    n_negative
        Number of modes with an eigenvalue below zero by more than its numerical bound, of motions that cross no kink
        on which the minimum lies.
    lowest, bound
        The lowest eigenvalue of these but those of translations, and the bound of its error, [energy / length^2].
    n_kinked
        Number of negative eigenvalues that kinks take: the energy rises to both sides of them (`vibration.kinks`).
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
        """Return what a packing's file says of it."""
        return {
            "n_negative": self.n_negative,
            "lowest_eigenvalue": self.lowest,
            "lowest_eigenvalue_bound": self.bound,
            "n_kinked": self.n_kinked,
        }


@dataclass(frozen=True, eq=False)
class ModesOffKinks:
    """Modes of a state, of those motions that cross no kink on which it lies.

    Parameters
    ----------
    matrix : DynamicalMatrix
        With a stiff row across each kink.
    found : Spectrum
        Its modes: all, or of large packings the softest.
    n_falling
        Number of negative eigenvalues before kinks were held.
    """

    matrix: DynamicalMatrix
    found: Spectrum
    n_falling: int

    @classmethod
    def of(cls, landscape: Landscape, state: State) -> ModesOffKinks:
        """Find them; where modes have negative eigenvalues, and kinks take some, twice."""
        matrix = dynamical_matrix(landscape, state, Scope(force=True))
        found = _modes(matrix)
        is_falling = (found.sign < 0) & ~found.is_translation
        kinks = kinks_across(landscape, state, matrix, found.vectors[:, is_falling])
        if kinks.shape[1]:
            matrix = held_at(matrix, kinks)
            found = _modes(matrix)
        return cls(matrix, found, int(is_falling.sum()))

    def proof(self) -> Proof:
        """Tell what they prove."""
        first = self._lowest()
        n_negative = int((self.found.sign[~self.found.is_translation] < 0).sum())
        value, bound = float(self.found.eigenvalues[first]), float(self.found.bound[first])
        return Proof(n_negative, value, bound, self.n_falling - n_negative)

    def lowest_motion(self) -> tuple[FloatArray, FloatArray]:
        """Return the displacements and turns of the lowest mode but translations, its largest entry 1."""
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
