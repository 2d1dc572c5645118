"""Elastic tensors in Voigt notation: their strains, the terms of the pressure, and averages over directions.

The components are xx, yy, xy in 2D and xx, yy, zz, yz, xz, xy in 3D. Strains are those of the box, upper
triangular: x is displaced by gamma y, so that gamma is twice the symmetric strain. With A the second derivative of the energy by
them over the volume, and P the pressure tensor (d is the unit tensor; Wallace, Solid State Phys. 25, 301 (1970)),

    C_ijkl = A_ijkl + d_ik P_jl
    B_ijkl = C_ijkl - (P_ik d_jl + P_il d_jk + P_jk d_il + P_jl d_ik) / 2 + (P_ij d_kl + P_kl d_ij) / 2
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from jamshape.arrays import FloatArray, IntArray
from jamshape.checks import require_one_of
from jamshape.packing.box import COMPONENTS

_Function = Callable[[FloatArray], float]


class PressureTerms(NamedTuple):
    """(d, d, D, D) weights of the pressure tensor, which turn A into these tensors."""

    B: FloatArray
    C: FloatArray


class Modulus(NamedTuple):
    """An elastic modulus with bounds of its error, [energy / length^D] each."""

    relaxed: float
    """The modulus, with forces balanced; NaN if undefined."""
    affine: float
    """The modulus if particles followed the strain."""
    rounding: float
    """Bound of the numerical error, for the state as it is."""
    of_state: float
    """Estimated bound of the change up to the minimum; inf if unknown."""
    reason: str = ""
    """One sentence on why the modulus is undefined, or its bound unknown."""

    @property
    def bound(self) -> float:
        """Bound of the error; inf if unknown."""
        return self.rounding + self.of_state


@dataclass(frozen=True, eq=False)
class ElasticTensor:
    """An elastic tensor as a symmetric matrix over d = D (D + 1) / 2 components, [energy / length^D].

    Parameters
    ----------
    relaxed : (d, d) array of float64
        With forces balanced; NaN where undefined.
    affine : (d, d) array of float64
        If particles followed the strain of the box, at fixed orientations.
    rounding : (d, d) array of float64
        Bound of the error of each entry due to rounding, as of a `Modulus`.
    of_state : (d, d) array of float64
        Bound of the error of each entry due to the residual forces of the state.
    reasons : tuple of str
        For each component, why its entries are undefined or their bounds unknown; otherwise empty.

    Notes
    -----
    Eigenvalues are those of the map of symmetric strains to stresses, 2 G for a shear modulus G, which do not depend on the
    axes. The error of each is at most the spectral norm of the matrix of bounds.
    """

    relaxed: FloatArray
    affine: FloatArray
    rounding: FloatArray
    of_state: FloatArray
    reasons: tuple[str, ...]

    @classmethod
    def of(cls, arrays: Iterable[FloatArray], reasons: tuple[str, ...]) -> ElasticTensor:
        """Make a tensor of its four arrays."""
        relaxed, affine, rounding, of_state = arrays
        return cls(relaxed, affine, rounding, of_state, reasons)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ElasticTensor):
            return NotImplemented
        pairs = zip(self._arrays, other._arrays, strict=True)
        return self.reasons == other.reasons and all(
            np.array_equal(one, two, equal_nan=True) for one, two in pairs
        )

    __hash__ = None  # type: ignore[assignment]

    def __getitem__(self, name: str) -> Modulus:
        """Return an entry by its name, such as ``xxyy``."""
        known = {
            one + two: (k, m)
            for k, one in enumerate(self.components)
            for m, two in enumerate(self.components)
        }
        require_one_of("the entry", name, known)
        k, m = known[name]
        relaxed, affine, rounding, of_state = (float(array[k, m]) for array in self._arrays)
        return Modulus(relaxed, affine, rounding, of_state, self.reasons[k] or self.reasons[m])

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the rows and columns."""
        return COMPONENTS[2 if len(self.reasons) == len(COMPONENTS[2]) else 3]

    @property
    def bound(self) -> FloatArray:
        """(d, d) bound of the error of each entry; inf if unknown."""
        return self.rounding + self.of_state

    @property
    def smallest(self) -> Modulus:
        """Smallest eigenvalue."""
        return self._read(np.eye(len(self.reasons)), lambda m: np.linalg.eigvalsh(m)[0], 1.0)

    @property
    def G_dc(self) -> Modulus:
        """Mean shear modulus over directions.

        In 2D over all angles, in 3D over all orientations of the plane and of the direction of shear: the trace over
        shear strains, over twice their number (Goodrich, Liu and Sethna, PRE 90, 022138 (2014)).
        """
        return self._of_shear(lambda m: np.trace(m) / len(m))

    @property
    def G_min(self) -> Modulus:
        """Smallest shear modulus over directions; in 3D over all strains without change of volume."""
        return self._of_shear(lambda m: np.linalg.eigvalsh(m)[0])

    @property
    def G_max(self) -> Modulus:
        """Largest shear modulus over directions; in 3D over all strains without change of volume."""
        return self._of_shear(lambda m: np.linalg.eigvalsh(m)[-1])

    @property
    def G_ac(self) -> Modulus:
        """Anisotropy, the standard deviation of the shear modulus over directions.

        In 3D over all strains without change of volume and of one magnitude.
        """

        def spread(m: FloatArray) -> float:
            n = len(m)
            return math.sqrt(2 / (n * (n + 2))) * float(
                np.linalg.norm(m - np.trace(m) / n * np.eye(n))
            )

        return self._of_shear(spread)

    @property
    def _arrays(self) -> tuple[FloatArray, ...]:
        return self.relaxed, self.affine, self.rounding, self.of_state

    def _of_shear(self, value: _Function) -> Modulus:
        return self._read(_shears(len(self.reasons)), value, 0.5)

    def _read(self, onto: FloatArray, value: _Function, scale: float) -> Modulus:
        """Evaluate a function of the matrix over (d, q) strains that changes by no more than the spectral norm."""
        unit = np.where([name[0] == name[1] for name in self.components], 1.0, math.sqrt(2))

        def evaluated(entries: FloatArray) -> float:
            if not np.isfinite(entries).all():
                return math.nan
            return float(value(scale * onto.T @ (unit[:, None] * unit * entries) @ onto))

        def bounded(entries: FloatArray) -> float:
            if not np.isfinite(entries).all():
                return math.inf
            return scale * float(np.linalg.norm(unit[:, None] * unit * entries, 2))

        return Modulus(
            relaxed=evaluated(self.relaxed),
            affine=evaluated(self.affine),
            rounding=bounded(self.rounding),
            of_state=bounded(self.of_state),
            reason=next(filter(None, self.reasons), ""),
        )


def strains_of(dimension: int) -> FloatArray:
    """(d, D, D) strains of the components: the box is deformed by 1 + e, an upper triangular matrix."""
    rows, columns = _axes(dimension)
    strains = np.zeros((len(rows), dimension, dimension))
    strains[np.arange(len(rows)), rows, columns] = 1.0
    return strains


@cache
def pressure_terms(dimension: int) -> PressureTerms:
    """Weights of the pressure in B and C; see the formulas above."""
    unit = np.eye(dimension)

    def term(pressure: str, one: str) -> FloatArray:
        """P of two of the indices i j k l times the unit tensor of the others."""
        return np.asarray(
            np.einsum(f"{pressure[0]}a,{pressure[1]}b,{one}->ijklab", unit, unit, unit)
        )

    C = term("jl", "ik")
    B = C - 0.5 * (term("ik", "jl") + term("il", "jk") + term("jk", "il") + term("jl", "ik"))
    B = B + 0.5 * (term("ij", "kl") + term("kl", "ij"))
    i, j = _axes(dimension)
    at = i[:, None], j[:, None], i, j
    return PressureTerms(B[at], C[at])


def _axes(dimension: int) -> tuple[IntArray, IntArray]:
    """(d,) row and column of each component."""
    pairs = np.array([["xyz".index(a) for a in name] for name in COMPONENTS[dimension]])
    return pairs[:, 0], pairs[:, 1]


@cache
def _shears(d: int) -> FloatArray:
    """(d, d - 1) orthonormal strains without change of volume; off-diagonal components count twice."""
    D = 2 if d == len(COMPONENTS[2]) else 3
    normal = np.linalg.svd(np.ones((1, D)))[2][1:].T
    found = np.zeros((d, d - 1))
    found[:D, : D - 1] = normal
    found[D:, D - 1 :] = np.eye(d - D)
    return found
