"""Superellipsoids: (|x/a|^n2 + |y/b|^n2)^(n1/n2) + |z/c|^n1 = 1, usually with n1 = n2 = 2p.

Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019). Contacts: `lammps_plugin/contact/superellipsoid/`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

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

TWO_EXPONENTS = 2
"""Columns of forms with n1 and n2."""

# Bounds of the exponents by the number of columns, and their names.
_LEAST = {1: (0.5, "p"), TWO_EXPONENTS: (1.0, "n1 and n2")}


def halves(form: FloatArray) -> tuple[float, float]:
    """Return n1/2 and n2/2, both p, of the (K,) form of a body."""
    if len(form) == TWO_EXPONENTS:
        return float(form[0] / 2), float(form[1] / 2)
    return float(form[0]), float(form[0])


class Superellipsoid(Shape):
    """Superellipsoids ``|x/a|^2p + |y/b|^2p + |z/c|^2p = 1`` (Yuan et al. 2019, Eqs. 1 and 2).

    Contacts have the energy epsilon/2 (eta^2 - 1)^2 (Eq. 3). p is 1 for ellipsoids, more towards boxes, less
    towards octahedra. In place of p there may be the two exponents of LAMMPS and OVITO, those of
    ``(|x/a|^n2 + |y/b|^n2)^(n1/n2) + |z/c|^n1 = 1``; n1 = n2 = 2p is the same body, n1 = 20 and n2 = 2 nearly a
    cylinder. In the plane n2 alone counts.
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
        Parameter("n1", None, "exponent along z; n1 and n2 replace p", "n1", Range(1.1, 20.0, "an exponent")),
        Parameter("n2", None, "exponent of sections across z", "n2", Range(1.1, 20.0, "an exponent")),
    )  # fmt: skip
    unit = "a"
    dimension = 3
    examples = (
        {"exponent": 1.5, "w1": 0.8, "w2": 1.3},
        {"exponent": 0.75, "w1": 0.8, "w2": 1.3},
        {"exponent": 1.0, "w1": 0.7, "w2": 1.4},
        {"exponent": 1.0, "w1": 1.0, "w2": 1.0},
        {"w1": 0.8, "w2": 1.3, "n1": 5.0, "n2": 1.6},
    )
    has_exponent = True
    stored = ("exponent",)

    def form_of_exponents(self, exponent: FloatArray) -> FloatArray:
        """See `Shape.form_of_exponents`; also of (N, 2), n1 and n2."""
        return exponent.reshape(len(exponent), -1)

    def check_form(self, form: FloatArray, dimension: int) -> None:
        """See `Shape.check_form`."""
        del dimension
        columns = form.shape[1]
        if columns not in _LEAST:
            msg = f"form has {columns} columns, expected one for a {self.name}, the exponent p, or two, n1 and n2"
            raise ValueError(msg)
        least, names = _LEAST[columns]
        if not (form > least).all():
            msg = f"exponents hold {form.min()}, expected {names} > {least:g}, for which bodies are convex"
            raise ValueError(msg)

    @staticmethod
    def widened(form: FloatArray, columns: int) -> FloatArray:
        """See `Shape.widened`: bodies with p beside others with n1 and n2 have n1 = n2 = 2p."""
        if (form.shape[1], columns) == (1, TWO_EXPONENTS):
            return np.repeat(2 * form, 2, axis=1)
        return Shape.widened(form, columns)

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
        names = ("n1", "n2") if "n1" in parameters else ("exponent",)
        form = [np.full(len(size), parameters[name]) for name in names]
        return size[:, None] * (2 * axes), np.column_stack(form)

    def reduced(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """See `Shape.reduced`: n1 and n2 replace p."""
        given = [name for name in ("n1", "n2") if name in parameters]
        if not given:
            return dict(parameters)
        if len(given) < TWO_EXPONENTS:
            other = "n2" if given == ["n1"] else "n1"
            msg = f"{given[0]} is given without {other}, expected both, or p alone"
            raise ValueError(msg)
        if np.any(np.not_equal(parameters.get("exponent", 1.0), 1.0)):
            msg = "p is given beside n1 and n2, which replace it, expected one or the other; leave p out"
            raise ValueError(msg)
        return {name: value for name, value in parameters.items() if name != "exponent"}

    def parameters_of(
        self, diameters: FloatArray, form: FloatArray
    ) -> tuple[dict[str, float], float]:
        """See `Shape.parameters_of`; in units of the shortest semi-axis, or of that along x if n1 and n2 differ."""
        p, p_across = halves(form)
        if p != p_across:
            a, b, c = (float(axis) for axis in diameters / 2)
            return {"w1": a / b, "w2": c / b, "n1": float(form[0]), "n2": float(form[1])}, a
        a, b, c = (float(axis) for axis in np.sort(diameters) / 2)
        return {"exponent": p, "w1": a / b, "w2": c / b}, a

    def described(
        self, diameters: FloatArray, form: FloatArray, dimension: int
    ) -> dict[str, float]:
        """See `Shape.described`; in space asphericity and beta (Yuan et al. 2019, Eq. 2 and Sec. 2.1)."""
        found = super().described(diameters, form, dimension)
        if dimension == 2:
            return found
        axes = diameters[0] / 2
        return found | {
            "asphericity": float(asphericity(axes, *halves(form[0]))),
            "beta": float(reduced_aspect_ratio(axes)),
        }

    def perimeter(self, diameters: FloatArray, form: FloatArray) -> float:
        """See `Shape.perimeter`."""
        return perimeter(diameters[:2] / 2, halves(form)[1])

    def family(self, parameters: Mapping[str, float], dimension: int) -> str:
        """See `Shape.family`; in space as in Yuan et al. (2019), Fig. 4."""
        w1, w2 = parameters["w1"], parameters["w2"]
        if "n1" in parameters and dimension == 3:
            return f"$n={parameters['n1']:g}, {parameters['n2']:g}$"
        p = parameters["n2"] / 2 if "n1" in parameters else parameters["exponent"]
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
        known = {name: in_name(number) for name, number in parameters.items()}
        beginning = "n{n1}_{n2}" if "n1" in known else "p{exponent}"
        return (beginning + "_w{w1}_{w2}").format(**known)

    def outline(self, diameters: FloatArray, form: FloatArray, points: int = 64) -> FloatArray:
        """See `Shape.outline`."""
        turn = arc(0, 2 * np.pi, points + 1)[:-1]
        power = 1 / halves(form)[1]
        scaled: FloatArray = np.sign(turn) * np.abs(turn) ** power * diameters[:2] / 2
        return scaled

    def surface(self, diameters: FloatArray, form: FloatArray, level: int = 3) -> SurfaceMesh:
        """See `Shape.surface`."""
        p, p_across = halves(form)
        return surface_mesh(diameters / 2, p, level, p_across)

    def solid(self, diameters: FloatArray, form: FloatArray) -> Superquadric:
        """See `Shape.solid`."""
        p, p_across = halves(form)
        return Superquadric(diameters / 2, (1 / p, 1 / p_across))
