"""Spherocylinders: segments of length 2A thickened by R; discs (spheres) where A is 0.

Marschall & Teitel, Phys. Rev. E 97, 012905 (2018). Contacts: `lammps_plugin/contact/spherocylinder/`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.shapes.mesh import SurfaceMesh, arc, revolved
from jamshape.shapes.shape import ROUND, ElongatedShape, Interaction, in_name
from jamshape.shapes.solid import RoundedSegment


class Spherocylinder(ElongatedShape):
    """Spherocylinders: segments of length 2A thickened by the radius R (Marschall & Teitel 2018).

    Contacts have the harmonic law of the overlap 1 - r/d (Eqs. 3 and 22).
    """

    name = "spherocylinder"
    families = ("spherocylinders",)
    examples = ({"alpha": 4.0}, {"alpha": 0.01}, {"alpha": 0.0})

    def style_name(self, law: Interaction) -> str:
        """See `Shape.style_name`; each law of two rods side by side is a setting."""
        return f"{self.name}/harmonic sides {('one', 'two')[law.sides - 1]}"

    def family(self, parameters: Mapping[str, float], dimension: int) -> str:
        """See `Shape.family`."""
        return (
            super().family(parameters, dimension) if parameters["alpha"] > 0 else ROUND[dimension]
        )

    def stem(self, parameters: Mapping[str, float]) -> str:
        """See `Shape.stem`."""
        return "alpha" + in_name(parameters["alpha"])

    def perimeter(self, diameters: FloatArray, form: FloatArray) -> float:
        """See `Shape.perimeter`."""
        del form
        radius = float(diameters[1]) / 2
        return 4 * self.spine(diameters) + 2 * np.pi * radius

    def outline(self, diameters: FloatArray, form: FloatArray, points: int = 64) -> FloatArray:
        """See `Shape.outline`."""
        del form
        radius, A = diameters[1] / 2, self.spine(diameters)
        right = radius * arc(-np.pi / 2, np.pi / 2, points // 2) + [A, 0.0]
        return np.concatenate([right, -right])

    def surface(self, diameters: FloatArray, form: FloatArray, level: int = 3) -> SurfaceMesh:
        """See `Shape.surface`."""
        del form
        radius, A = diameters[1] / 2, self.spine(diameters)
        cap = arc(0, np.pi / 2, 2 + 2**level)
        normal = np.concatenate([cap * [-1, 1], cap[::-1]])
        ends = np.repeat([[-A, 0.0], [A, 0.0]], len(cap), axis=0)
        return revolved(radius * normal + ends, normal, 8 * 2**level)

    def solid(self, diameters: FloatArray, form: FloatArray) -> RoundedSegment:
        """See `Shape.solid`."""
        del form
        return RoundedSegment(self.spine(diameters), float(diameters[1]) / 2)
