"""Newton steps on an energy landscape: factorisation, shift, and trust radius."""

from __future__ import annotations

from typing import Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.landscape.landscape import Evaluation, Landscape

# Trust radius of a Newton step.
LONGEST_STEP = 0.1  # displacement over the smallest radius
WIDEST_TURN = 0.2  # rotation angle

# Initial shift of a Hessian's diagonal, in units of k_e and `Landscape.length`.
_FIRST_SHIFT = 1e-6


class Factorisation:
    """Factors L D L^T of a positive definite matrix in the coordinates of a landscape.

    Parameters
    ----------
    factors : jamshape._contact.Factors
        Block-sparse, by particles.
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
    """Return the shift of a Hessian's diagonal appropriate for forces this large, [energy / length^2].

    It falls with the forces, as in the Levenberg-Marquardt method, so that Newton's method converges
    superlinearly, and never exceeds the initial one.
    """
    force = float(np.abs(evaluation.gradient).max(initial=0.0))
    first = _FIRST_SHIFT * landscape.stiffness / landscape.length**2
    return max(min(first, force / landscape.length), 1e-300)
