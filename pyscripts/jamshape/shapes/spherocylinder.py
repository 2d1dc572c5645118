"""Spherocylinders: segments of length 2A thickened by R; discs (spheres) where A is 0.

Marschall & Teitel, Phys. Rev. E 97, 012905 (2018). Contacts: `lammps_plugin/contact/spherocylinder/`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.shapes.mesh import SurfaceMesh, arc, revolved
from jamshape.shapes.shape import ElongatedShape, Interaction, Style, in_name
from jamshape.shapes.solid import RoundedSegment


class Spherocylinder(ElongatedShape):
    """Spherocylinders: segments of length 2A thickened by the radius R (Marschall & Teitel 2018).

    Contacts have the harmonic law of the overlap 1 - r/d (Eqs. 3 and 22).
    """

    name = "spherocylinder"
    examples = ({"alpha": 4.0}, {"alpha": 0.01}, {"alpha": 0.0})

    def style(self, packing: Any, law: Interaction) -> Style:
        """See `Shape.style`; `sides` is the number of bonds of a side-to-side contact."""
        sides = ("one", "two")[law.sides - 1]
        style = f"{self.name}/harmonic sides {sides}"
        return Style(packing.species, self.styled(packing, law, style))

    def stem(self, parameters: Mapping[str, float]) -> str:
        """See `Shape.stem`."""
        return "alpha" + in_name(parameters["alpha"])

    def outline(self, diameters: FloatArray, exponent: float, points: int = 64) -> FloatArray:
        """See `Shape.outline`."""
        del exponent
        radius, A = diameters[1] / 2, self.spine(diameters)
        right = radius * arc(-np.pi / 2, np.pi / 2, points // 2) + [A, 0.0]
        return np.concatenate([right, -right])

    def surface(self, diameters: FloatArray, exponent: float, level: int = 3) -> SurfaceMesh:
        """See `Shape.surface`."""
        del exponent
        radius, A = diameters[1] / 2, self.spine(diameters)
        cap = arc(0, np.pi / 2, 2 + 2**level)
        normal = np.concatenate([cap * [-1, 1], cap[::-1]])
        ends = np.repeat([[-A, 0.0], [A, 0.0]], len(cap), axis=0)
        return revolved(radius * normal + ends, normal, 8 * 2**level)

    def solid(self, diameters: FloatArray, exponent: float) -> RoundedSegment:
        """See `Shape.solid`."""
        del exponent
        return RoundedSegment(self.spine(diameters), float(diameters[1]) / 2)
