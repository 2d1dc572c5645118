"""Dimers: two equal discs (spheres) of radius R joined rigidly, their centres A from the middle along x.

They overlap where A < R. Contacts: `lammps_plugin/contact/dimer/`.
"""

from __future__ import annotations

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.checks import Range
from jamshape.shapes.mesh import SurfaceMesh, arc, revolved
from jamshape.shapes.shape import ElongatedShape, Parameter
from jamshape.shapes.solid import Balls


class Dimer(ElongatedShape):
    """Dimers: two equal discs (spheres) of radius R joined rigidly, centres A from the middle.

    Every pair of discs has the harmonic law of the overlap 1 - r/d.
    """

    name = "dimer"
    families = ("dimers",)
    # Coinciding discs would count as four bonds with each neighbour.
    parameters = (
        Parameter(
            "alpha", 1.0, "A/R: 1 where the discs just touch", "alpha",
            Range(1e-6, 100.0, "A / R above 0, as a disc is a spherocylinder,"),
        ),
    )  # fmt: skip
    examples = ({"alpha": 1.0}, {"alpha": 0.4}, {"alpha": 1.3})

    def perimeter(self, diameters: FloatArray, form: FloatArray) -> float:
        """See `Shape.perimeter`."""
        del form
        radius, A = float(diameters[1]) / 2, self.spine(diameters)
        return 4 * radius * (np.pi - self._waist(radius, A))

    def outline(self, diameters: FloatArray, form: FloatArray, points: int = 64) -> FloatArray:
        """See `Shape.outline`."""
        del form
        radius, A = diameters[1] / 2, self.spine(diameters)
        waist = self._waist(radius, A)
        right = radius * arc(waist - np.pi, np.pi - waist, points // 2) + [A, 0.0]
        return np.concatenate([right, -right])

    def surface(self, diameters: FloatArray, form: FloatArray, level: int = 3) -> SurfaceMesh:
        """See `Shape.surface`."""
        del form
        radius, A = diameters[1] / 2, self.spine(diameters)
        part = arc(np.pi, self._waist(radius, A), 2 + 2 * 2**level)  # of the left sphere
        normal = np.concatenate([part, part[::-1] * [-1, 1]])
        centre = np.repeat([[-A, 0.0], [A, 0.0]], len(part), axis=0)
        return revolved(radius * normal + centre, normal, 8 * 2**level)

    def solid(self, diameters: FloatArray, form: FloatArray) -> Balls:
        """See `Shape.solid`."""
        del form
        A = self.spine(diameters)
        return Balls(np.array([[-A, 0.0, 0.0], [A, 0.0, 0.0]]), np.full(2, diameters[1] / 2))

    @staticmethod
    def _waist(radius: float, A: float) -> float:
        """Angle at a disc's centre between the line to the other disc and the point where they meet."""
        return float(np.arccos(min(A / radius, 1.0)))
