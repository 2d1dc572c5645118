"""Superellipsoids: |x/a|^2p + |y/b|^2p + |z/c|^2p = 1.

Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019). Contacts: `lammps_plugin/contact/superellipsoid/`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.checks import Range
from jamshape.shapes.mesh import SurfaceMesh, arc
from jamshape.shapes.roundness import asphericity, axes_from, reduced_aspect_ratio
from jamshape.shapes.shape import (
    Interaction,
    Parameter,
    Shape,
    Style,
    in_name,
    pair_coefficients,
)
from jamshape.shapes.solid import Superquadric
from jamshape.shapes.superellipsoid_surface import surface_mesh


class Superellipsoid(Shape):
    """Superellipsoids ``|x/a|^2p + |y/b|^2p + |z/c|^2p = 1`` (Yuan et al. 2019, Eqs. 1 and 2).

    Contacts have the energy epsilon/2 (eta^2 - 1)^2 (Eq. 3). p is 1 for ellipsoids, more towards boxes, less
    towards octahedra.
    """

    name = "superellipsoid"
    parameters = (
        Parameter(
            "exponent", 1.0, "exponent p of the surface (Yuan et al. 2019, Eq. 1)", "p",
            Range(0.55, 10.0, "an exponent"),
        ),
        Parameter("w1", 1.0, "a/b <= 1", "w1", Range(0.1, 1.0, "a/b")),
        Parameter("w2", 1.0, "c/b >= 1", "w2", Range(1.0, 10.0, "c/b")),
    )  # fmt: skip
    unit = "a"
    dimension = 3
    examples = (
        {"exponent": 1.5, "w1": 0.8, "w2": 1.3},
        {"exponent": 0.75, "w1": 0.8, "w2": 1.3},
        {"exponent": 1.0, "w1": 0.7, "w2": 1.4},
        {"exponent": 1.0, "w1": 1.0, "w2": 1.0},
    )
    has_exponent = True

    def fits(self, diameters: FloatArray) -> bool:
        """See `Shape.fits`."""
        return bool((diameters > 0).all())

    def rule(self) -> str:
        """See `Shape.rule`."""
        return "(2a, 2b, 2c), all positive"

    def sizes(
        self, parameters: Mapping[str, float | FloatArray], size: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """See `Shape.sizes`."""
        axes = axes_from(parameters["w1"], parameters["w2"])
        return size[:, None] * (2 * axes), np.full(len(size), parameters["exponent"])

    def parameters_of(
        self, diameters: FloatArray, exponent: float
    ) -> tuple[dict[str, float], float]:
        """See `Shape.parameters_of`; in units of the shortest semi-axis a."""
        a, b, c = (float(axis) for axis in np.sort(diameters) / 2)
        return {"exponent": float(exponent), "w1": a / b, "w2": c / b}, a

    def style(self, packing: Any, law: Interaction) -> Style:
        """See `Shape.style`; exponents are per type in LAMMPS."""
        types = packing.species
        kinds = np.arange(1, types.max() + 1)
        exponents = {int(k): packing.exponent[types == k] for k in np.unique(types)}
        if any((own != own[0]).any() for own in exponents.values()):
            # A species may hold several exponents: each exponent of a species gets a type.
            both = np.column_stack([packing.exponent, packing.species])
            rows, numbers = np.unique(both, axis=0, return_inverse=True)
            types, kinds = 1 + numbers.reshape(-1).astype(np.int64), rows[:, 1].astype(np.int64)
            exponents = {int(k): packing.exponent[types == k] for k in np.unique(types)}
        lines = [f"pair_style {self.name}/harmonic", *pair_coefficients(law.k_e, kinds)]
        for k, p in exponents.items():
            row = kinds[k - 1] - 1
            own = law.k_e[row][row] if isinstance(law.k_e, tuple) else law.k_e
            lines.append(f"pair_coeff {k} {k} {own!r} {float(p[0])!r}")
        return Style(types, "\n".join(lines))

    def described(self, diameters: FloatArray, exponent: FloatArray) -> dict[str, float]:
        """Asphericity and beta (Yuan et al. 2019, Eq. 2 and Sec. 2.1)."""
        axes = diameters[0] / 2
        return {
            "asphericity": float(asphericity(axes, exponent[0])),
            "beta": float(reduced_aspect_ratio(axes)),
        }

    def stem(self, parameters: Mapping[str, float]) -> str:
        """See `Shape.stem`."""
        exponent, w1, w2 = (in_name(parameters[p.name]) for p in self.parameters)
        return f"p{exponent}_w{w1}_{w2}"

    def outline(self, diameters: FloatArray, exponent: float, points: int = 64) -> FloatArray:
        """See `Shape.outline`."""
        turn = arc(0, 2 * np.pi, points + 1)[:-1]
        scaled: FloatArray = np.sign(turn) * np.abs(turn) ** (1 / exponent) * diameters[:2] / 2
        return scaled

    def surface(self, diameters: FloatArray, exponent: float, level: int = 3) -> SurfaceMesh:
        """See `Shape.surface`."""
        return surface_mesh(diameters / 2, exponent, level)

    def solid(self, diameters: FloatArray, exponent: float) -> Superquadric:
        """See `Shape.solid`."""
        return Superquadric(diameters / 2, 1 / exponent)
