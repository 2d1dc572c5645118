"""Superellipsoids: |x/a|^2p + |y/b|^2p + |z/c|^2p = 1.

Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019). Contacts: `lammps_plugin/contact/superellipsoid/`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.checks import Range
from jamshape.shapes.mesh import SurfaceMesh, arc
from jamshape.shapes.roundness import asphericity, axes_from, perimeter, reduced_aspect_ratio
from jamshape.shapes.shape import ROUND, Parameter, Shape, in_name
from jamshape.shapes.solid import Superquadric
from jamshape.shapes.superellipsoid_surface import surface_mesh

# Self-dual ellipsoids have a beta this near to 1.
_DUAL = 0.02


class Superellipsoid(Shape):
    """Superellipsoids ``|x/a|^2p + |y/b|^2p + |z/c|^2p = 1`` (Yuan et al. 2019, Eqs. 1 and 2).

    Contacts have the energy epsilon/2 (eta^2 - 1)^2 (Eq. 3). p is 1 for ellipsoids, more towards boxes, less
    towards octahedra.
    """

    name = "superellipsoid"
    families = ("ellipses", "superellipses")
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
    stored = ("exponent",)

    def form_of_exponents(self, exponent: FloatArray) -> FloatArray:
        """See `Shape.form_of_exponents`."""
        return exponent[:, None]

    def check_form(self, form: FloatArray, dimension: int) -> None:
        """See `Shape.check_form`."""
        del dimension
        if form.shape[1] != 1:
            msg = (
                f"form has {form.shape[1]} columns, expected one for a {self.name}, the exponent p"
            )
            raise ValueError(msg)
        if not (form > 0.5).all():
            msg = f"exponents hold {form.min()}, expected p > 0.5, for which bodies are convex"
            raise ValueError(msg)

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
        exponent = np.full(len(size), parameters["exponent"])
        return size[:, None] * (2 * axes), exponent[:, None]

    def parameters_of(
        self, diameters: FloatArray, form: FloatArray
    ) -> tuple[dict[str, float], float]:
        """See `Shape.parameters_of`; in units of the shortest semi-axis a."""
        a, b, c = (float(axis) for axis in np.sort(diameters) / 2)
        return {"exponent": float(form[0]), "w1": a / b, "w2": c / b}, a

    def described(
        self, diameters: FloatArray, form: FloatArray, dimension: int
    ) -> dict[str, float]:
        """See `Shape.described`; in space asphericity and beta (Yuan et al. 2019, Eq. 2 and Sec. 2.1)."""
        found = super().described(diameters, form, dimension)
        if dimension == 2:
            return found
        axes = diameters[0] / 2
        return found | {
            "asphericity": float(asphericity(axes, form[0, 0])),
            "beta": float(reduced_aspect_ratio(axes)),
        }

    def perimeter(self, diameters: FloatArray, form: FloatArray) -> float:
        """See `Shape.perimeter`."""
        return perimeter(diameters[:2] / 2, float(form[0]))

    def family(self, parameters: Mapping[str, float], dimension: int) -> str:
        """See `Shape.family`; in space as in Yuan et al. (2019), Fig. 4."""
        p, w1, w2 = (parameters[one.name] for one in self.parameters)
        if dimension == 2:
            return self.families[p != 1] if w1 < 1 or p != 1 else ROUND[2]
        if p != 1:
            return "superballs" if w1 == w2 == 1 else f"$p={p:g}$"
        if w1 == 1 or w2 == 1:
            which = {(True, True): ROUND[3], (False, True): "oblate ellipsoids"}
            return which.get((w1 == 1, w2 == 1), "prolate ellipsoids")
        return "self-dual ellipsoids" if abs(w1 * w2 - 1) < _DUAL else "general ellipsoids"

    def stem(self, parameters: Mapping[str, float]) -> str:
        """See `Shape.stem`."""
        exponent, w1, w2 = (in_name(parameters[p.name]) for p in self.parameters)
        return f"p{exponent}_w{w1}_{w2}"

    def outline(self, diameters: FloatArray, form: FloatArray, points: int = 64) -> FloatArray:
        """See `Shape.outline`."""
        turn = arc(0, 2 * np.pi, points + 1)[:-1]
        scaled: FloatArray = np.sign(turn) * np.abs(turn) ** (1 / form[0]) * diameters[:2] / 2
        return scaled

    def surface(self, diameters: FloatArray, form: FloatArray, level: int = 3) -> SurfaceMesh:
        """See `Shape.surface`."""
        return surface_mesh(diameters / 2, form[0], level)

    def solid(self, diameters: FloatArray, form: FloatArray) -> Superquadric:
        """See `Shape.solid`."""
        return Superquadric(diameters / 2, 1 / form[0])
