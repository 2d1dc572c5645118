"""Newton steps on an energy landscape: factors, shifts, and how far a step may go."""

from __future__ import annotations

from typing import Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.landscape.landscape import Evaluation, Landscape

# A Newton step moves no particle by more than this fraction of the smallest radius, and turns none
# by more than this angle.
LONGEST_STEP = 0.1
WIDEST_TURN = 0.2

# The first shift of a Hessian's diagonal, in units of k_e and `Landscape.length`.
_FIRST_SHIFT = 1e-6


class Factorisation:
    """Factors L D L^T of a positive definite matrix in the coordinates of a landscape.

    Parameters
    ----------
    factors : jamshape._contact.Factors
        By blocks of particles.
    """

    def __init__(self, factors: Any) -> None:
        self.compiled = factors

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, k) right-hand sides."""
        if right.ndim == 1:
            solution: FloatArray = self.compiled.solve(right[None])[0]
            return solution
        columns: FloatArray = self.compiled.solve(np.ascontiguousarray(right.T)).T
        return columns


def least_shift(landscape: Landscape, evaluation: Evaluation) -> float:
    """Return the shift of a Hessian's diagonal that forces as large as these ask for, [energy / length^2].

    It falls with the forces, as the Levenberg-Marquardt method has it, so that Newton's method converges
    faster than linearly, and is no larger than the first one.
    """
    force = float(np.abs(evaluation.gradient).max(initial=0.0))
    first = _FIRST_SHIFT * landscape.k_e / landscape.length**2
    return max(min(first, force / landscape.length), 1e-300)
