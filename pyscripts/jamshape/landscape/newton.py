"""Sparse Newton steps on an energy landscape: factorisation, regularisation, step control."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse

from jamshape import _contact
from jamshape.arrays import FloatArray
from jamshape.landscape.landscape import Evaluation, Landscape

# A Newton step moves no particle by more than this fraction of the smallest radius, and turns none
# by more than this angle.
LONGEST_STEP = 0.1
WIDEST_TURN = 0.2

# The smallest shift, over the largest diagonal element.
LEAST_SHIFT: float = _contact.LEAST_SHIFT

# The first one, in units of k_e and `Landscape.length`.
FIRST_SHIFT = 1e-6

_GROWTH = 10.0
_DECAY = 3.0

# A step that needed more evaluations to find its length was in a wrong direction.
_FAR_OFF = 6


def add_to_diagonal(matrix: Any, values: float | FloatArray) -> Any:
    """Add (n,) values to the diagonal of an (n, n) CSC matrix; a new matrix.

    Takes a tenth of the time that the sum of two sparse matrices takes, if the whole diagonal is stored.
    """
    column = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
    on_diagonal = matrix.indices == column
    if on_diagonal.sum() < matrix.shape[1]:
        values = np.broadcast_to(values, matrix.shape[1])
        return (matrix + scipy.sparse.diags(values)).tocsc()
    added = matrix.copy()
    added.data[on_diagonal] += values
    return added


class Factorisation:
    """Factors L D L^T of a sparse symmetric matrix.

    Without pivoting, so that the signs of the pivots are those of the eigenvalues (Sylvester's law of
    inertia).

    Parameters
    ----------
    factors : jamshape._contact.SymmetricFactors or BlockFactors
        By Eigen, or by blocks of particles.
    """

    def __init__(self, factors: Any) -> None:
        self.compiled = factors
        self.n_negative: int = factors.n_negative
        """Pivots that are not positive."""

    @classmethod
    def of(cls, matrix: Any, shift: float) -> Factorisation:
        """Factorise an (n, n) CSC matrix with a shift of its diagonal.

        Raises
        ------
        RuntimeError
            If it is singular.
        """
        shifted = add_to_diagonal(matrix, shift)
        start, row = shifted.indptr.astype(np.int32), shifted.indices.astype(np.int32)
        return cls(_contact.SymmetricFactors(start, row, shifted.data))

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, k) right-hand sides."""
        if right.ndim == 1:
            solution: FloatArray = self.compiled.solve(right[None])[0]
            return solution
        columns: FloatArray = self.compiled.solve(np.ascontiguousarray(right.T)).T
        return columns


@dataclass
class Regularised:
    """Keeps the shift that makes a Hessian positive definite, from one step to the next."""

    shift: float = FIRST_SHIFT

    @classmethod
    def of(cls, landscape: Landscape) -> Regularised:
        """Begin with the same shift in all units."""
        return cls(FIRST_SHIFT * landscape.k_e / landscape.length**2)

    def factorise(self, matrix: Any) -> Factorisation:
        """Factorise with the least shift, by powers of ten, that leaves no negative pivot."""
        scale = float(np.abs(matrix.diagonal()).max(initial=0.0)) or 1.0
        self.shift = max(self.shift, LEAST_SHIFT * scale)
        while True:
            try:
                factors = Factorisation.of(matrix, self.shift)
            except RuntimeError:  # exactly singular
                factors = None
            if factors is not None and factors.n_negative == 0:
                return factors
            self.shift *= _GROWTH

    def learn(self, tries: int) -> None:
        """Shift less after a step that was right at once, more after one that was far off."""
        if tries == 1:
            self.shift /= _DECAY
        elif tries > _FAR_OFF:
            self.shift *= _GROWTH


def least_shift(landscape: Landscape, evaluation: Evaluation) -> float:
    """Give the shift of a Hessian's diagonal that forces as large as these ask for, [energy / length^2].

    It falls with the forces, as the Levenberg-Marquardt method has it, so that Newton's method converges
    faster than linearly, and is no larger than the first one.
    """
    force = float(np.abs(evaluation.gradient).max(initial=0.0))
    first = FIRST_SHIFT * landscape.k_e / landscape.length**2
    return max(min(first, force / landscape.length), 1e-300)
