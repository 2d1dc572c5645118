"""Stability of a packing to shear: the bordered Hessian of the enthalpy by particles and box.

The box is deformed by 1 + e, an upper triangular matrix, at fixed orientations. With X the derivative of the gradient by e, the
second derivatives of the enthalpy are

    [[ M,   X   ],
     [ X^T, V B ]]

with B the affine tensor of `jamshape.vibration.tensors`, which contains + p V between different diagonal entries at a pressure
tensor p 1. Without those of zero modes, its negative eigenvalues are as many as those of M and of the relaxed B (Dagois-Bohy,
Tighe, Simon, Henkes and van Hecke, PRL 109, 095703 (2012)). Strains are scaled by N^(1/2) (V/N)^(1/D), N without rattlers,
so that they are comparable to displacements.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
import scipy  # loads its parts once they are used

from jamshape.arrays import FloatArray
from jamshape.landscape import Landscape, State
from jamshape.vibration.hessian import DynamicalMatrix, DynamicalMatrixOptions, dynamical_matrix
from jamshape.vibration.sparse_modes import ShiftedInverse, below_sliding, lowest, near
from jamshape.vibration.spectrum import Spectrum, spectrum
from jamshape.vibration.tensors import pressure_terms, strains_of

# Number of modes that are sought next to zero.
_FEW = 2

# The shift below zero is this many times a lower bound of all eigenvalues, with a multiple of known ones if M has negative ones.
_MARGIN = 1.01
_BEYOND = 4.0

# Up to this number of coordinates the whole spectrum is found instead.
_DENSE = 32


class Eigenvalue(NamedTuple):
    """An eigenvalue with the bound of its numerical error."""

    value: float
    bound: float

    @property
    def sign(self) -> int:
        """1 or -1 where the bound determines the sign, otherwise 0."""
        return int(np.sign(self.value)) if abs(self.value) > self.bound else 0


class Stability(NamedTuple):
    """Smallest eigenvalue of the bordered Hessian, and its eigenvector of unit length."""

    eigenvalue: Eigenvalue
    """[energy / length^2]; translations do not count."""
    strain: FloatArray
    """(D, D) strain of the box, upper triangular; the box is deformed by 1 + strain (`State.deformed`)."""
    motion: FloatArray
    """(n,) motion of the particles in coordinates of the landscape (`Landscape.displaced`), beside that strain."""

    @property
    def sign(self) -> int:
        """1 or -1 where the bound determines the sign of the eigenvalue, otherwise 0."""
        return self.eigenvalue.sign


@dataclass(frozen=True, eq=False, kw_only=True)
class BorderedMatrix(DynamicalMatrix):
    """The bordered Hessian as a dynamical matrix with d = D (D + 1) / 2 further coordinates, the scaled strains.

    Parameters
    ----------
    length : float
        Scale of the strains, [length].
    rounding : (n + d, n + d) scipy.sparse CSR matrix
        Bound of the error of its prestress by rounding of overlaps.
    inner : DynamicalMatrix
        M of the fixed box.
    """

    length: float
    rounding: Any
    inner: DynamicalMatrix

    @classmethod
    def of(cls, matrix: DynamicalMatrix) -> BorderedMatrix:
        """Border a dynamical matrix."""
        D, V, N = matrix.coordinates.dimension, matrix.volume, matrix.n_particles
        strains, terms = strains_of(D), pressure_terms(D).B
        length = math.sqrt(N) * (V / N) ** (1 / D)
        given, (sizes, lost) = matrix.strained(strains), matrix.strained_sizes(strains)

        def of_pressure(weights: FloatArray, tensor: FloatArray) -> FloatArray:
            return np.asarray(V * np.einsum("klab,ab->kl", weights, tensor))

        pressure, error = matrix.pressure_tensor, matrix.pressure_rounding
        corner = -np.asarray(given.affine, np.float64) - of_pressure(terms, pressure)
        size = np.asarray(sizes.affine, np.float64) + of_pressure(np.abs(terms), np.abs(pressure))
        of_overlaps = np.asarray(lost.affine, np.float64) + of_pressure(np.abs(terms), error)

        def bordered(block: Any, side: FloatArray, own: FloatArray) -> Any:
            blocks = [[block, side / length], [side.T / length, own / length**2]]
            return scipy.sparse.bmat(blocks, format="csr")

        known = {one.name: getattr(matrix, one.name) for one in fields(matrix)}
        known["compatibility"] = scipy.sparse.hstack(
            [matrix.compatibility, given.stretched / length], format="csr"
        )
        known["prestress"] = bordered(matrix.prestress, -given.pushed, 0.5 * (corner + corner.T))
        known["prestress_sizes"] = bordered(matrix.prestress_sizes, sizes.pushed, size)
        known["gradient"] = np.append(matrix.gradient, np.zeros(len(strains)))
        rounding = bordered(matrix.prestress_rounding, lost.pushed, of_overlaps)
        return cls(**known, length=length, rounding=rounding, inner=matrix)

    @property
    def size(self) -> int:
        """Number of coordinates, with the strains."""
        return self.coordinates.size + len(strains_of(self.coordinates.dimension))

    @property
    def prestress_rounding(self) -> Any:
        """Bound of the error of the prestress by rounding of overlaps."""
        return self.rounding

    @property
    def translations(self) -> FloatArray:
        """(n + d, D c) orthonormal null modes, without strain."""
        own = super().translations
        return np.vstack([own, np.zeros((self.size - len(own), own.shape[1]))])


class Softest(NamedTuple):
    """The smallest eigenvalue of a bordered matrix."""

    eigenvalue: Eigenvalue
    vector: FloatArray
    """(n + d,)"""


def softest_of(matrix: BorderedMatrix) -> Softest:
    """Find the smallest eigenvalue without translations.

    It is sought next to zero and, if some are further below, next to a lower bound of all. Where M itself has such
    eigenvalues, the bound is an estimate.
    """
    if matrix.size <= _DENSE:
        return _lowest_of(spectrum(matrix))
    found = [_lowest_of(lowest(matrix, _FEW))]
    if (least := _least(matrix)) < 0:
        least += _BEYOND * min(0.0, found[0].eigenvalue.value)
        found.append(_lowest_of(near(matrix, 1, _MARGIN * least)))
    return min(found, key=lambda one: one.eigenvalue.value)


def _least(matrix: BorderedMatrix) -> float:
    """Lower bound of all eigenvalues, if M has none below a shift next to zero; 0 if no other one is below it.

    With Q = V B - shift - X^T (M - shift)^-1 X, v.(H - shift) v >= e.Q e for any v = (x, e).
    """
    inner, shift = matrix.inner, below_sliding(matrix.inner)
    s, T = matrix.compatibility[:, inner.size :].toarray(), inner.translations
    S = matrix.prestress[:, inner.size :].toarray()
    X = inner.compatibility.T @ s - S[: inner.size]
    X = X - T @ (T.T @ X)
    Q = s.T @ s - S[inner.size :] - X.T @ ShiftedInverse(inner, shift).solve(X).v
    own = float(np.linalg.eigvalsh(0.5 * (Q + Q.T))[0]) - shift
    return min(0.0, own + shift) if own < 0 else 0.0


def stability_of(
    landscape: Landscape, state: State, options: DynamicalMatrixOptions | None = None
) -> Stability:
    """Find the smallest eigenvalue of the bordered Hessian of a minimum, and its direction.

    A packing at a pressure tensor p 1 is unstable in a box that can deform if it is negative. Along its
    direction, of either sign, the enthalpy decreases.

    Parameters
    ----------
    landscape : Landscape
    state : State
    options : DynamicalMatrixOptions, optional

    Returns
    -------
    Stability

    Raises
    ------
    NotAtMinimumError, ValueError
        As `dynamical_matrix`.

    Examples
    --------
    >>> import jamshape as js
    >>> from jamshape.landscape import Landscape, State
    >>> packing = js.make_packing(js.Spherocylinders(alpha=0), n=16, u0=1e-4, progress=False)
    >>> found = stability_of(Landscape(packing), State.of(packing))
    >>> found.sign in {1, -1}, found.strain.shape
    (True, (2, 2))
    """
    matrix = BorderedMatrix.of(dynamical_matrix(landscape, state, options))
    found, at = softest_of(matrix), matrix.coordinates
    strain = np.einsum(
        "k,kab->ab", found.vector[at.size :] / matrix.length, strains_of(at.dimension)
    )
    shift, turn = at.motion(found.vector[: at.size])
    components = np.column_stack([shift, turn * landscape.rotation_length[:, None]])
    return Stability(found.eigenvalue, strain, landscape.coordinates(components))


def _lowest_of(found: Spectrum) -> Softest:
    own = np.flatnonzero(~found.is_translation)
    k = own[np.argmin(found.eigenvalues[own])]
    eigenvalue = Eigenvalue(float(found.eigenvalues[k]), float(found.bound[k]))
    return Softest(eigenvalue, found.vectors[:, k])
