"""The energy landscape about one state, compiled: what an integrator asks for thousands of times.

The same energy as `Landscape`, as a function of displacements from a base and of a strain; evaluations
and factors of the Hessian cost a fifth of those there. In two dimensions.
"""

from __future__ import annotations

from typing import Any

from jamshape.landscape import Evaluation, Landscape, Pairs, State
from jamshape.newton import LEAST_SHIFT, Factorisation
from jamshape.packing import FloatArray
from jamshape.shapes import Extent, PairArrays


class Vicinity:
    """Energy, gradient and Hessian of a landscape about a base that moves along.

    Parameters
    ----------
    landscape : Landscape
        Whose pairs it uses and whose evaluations it counts.
    base : State
        From where coordinates count.
    """

    def __init__(self, landscape: Landscape, base: State) -> None:
        self.landscape = landscape
        self._pairs: Pairs | None = None
        self._compiled: Any = None
        self.move_to(base)

    def move_to(self, base: State) -> None:
        """Count coordinates from another state."""
        self.base = base
        self._take(self.landscape.pairs_at(base))
        self._compiled.move_to(*base.split)

    def at(self, x: FloatArray, strain: float) -> State:
        """Move along (n,) coordinates, then strain box and positions."""
        return self.landscape.displaced(self.base, x).strained(strain)

    def evaluate(self, x: FloatArray, strain: float, *, extended: bool) -> Evaluation:
        """Evaluate as `Landscape.evaluate` does at `at(x, strain)`, with its errors."""
        self.landscape.evaluations += 1
        found = self._compiled.evaluate(x, strain, extended)
        if found is None:
            self.landscape.forget_pairs()
            self._take(self.landscape.pairs_at(self.at(x, strain)))
            self._compiled.move_to(*self.base.split)
            found = self._compiled.evaluate(x, strain, extended)
        energy, gradient, strain_gradient, bond_force, n_bonds, crossing, unconverged = found
        assert self._pairs is not None
        self.landscape.refuse(self._pairs, crossing, unconverged)
        bond_force /= max(n_bonds, 1)
        return Evaluation(energy, gradient, strain_gradient, bond_force, n_bonds)

    def factorise(self, x: FloatArray, strain: float, diagonal: FloatArray) -> Factorisation:
        """Factorise the Hessian by x plus a diagonal; with a shift if it is not positive definite.

        For an x where it was evaluated.
        """
        self._compiled.linearise(x, strain, diagonal)
        shift = 0.0
        while True:
            factors = self._compiled.factorised(shift)
            if factors is not None:
                found = Factorisation(factors)
                if found.n_negative == 0:
                    return found
            least = LEAST_SHIFT * self._compiled.largest_diagonal
            shift = max(10 * shift, least, float(diagonal.min()))

    def _take(self, pairs: Pairs) -> None:
        if pairs is self._pairs:
            return
        landscape = self.landscape
        arrays = PairArrays(*pairs.then.split, pairs.particles, pairs.shift)
        extent = Extent(
            landscape.column, landscape.rotation_length, landscape.shape.turning_radius,
            pairs.skin, pairs.reach,
        )  # fmt: skip
        self._pairs, self._compiled = pairs, landscape.shape.vicinity(arrays, extent)
