"""Elastic moduli of a packing from its dynamical matrix: affine strain and nonaffine relaxation.

A strain e moves r_i - r_j of each contact by e (r_i - r_j), at fixed orientations, and then forces balance
again. With s the strain's change of bond lengths (times square roots of their stiffness) and f the change of
the forces through the prestress, twice the energy is to second order

    E(x) = |C x + s|^2 - x.S x + 2 x.f + (prestress term of the affine strain)

for a motion x of the particles, and the modulus is the stationary value of E over the volume. The error
of x enters it squared, over the eigenvalues. All moduli are entries and sums of E as a bilinear form of strains.

A floppy mode, with an eigenvalue below its bound, is left out if it does not couple to the
strain. If one couples, E has no stationary value: the modulus is undefined. Modes along which the state has
not settled are left out as well; if one couples, the bound is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jamshape.arrays import BoolArray, FloatArray, IntArray, LongArray
from jamshape.landscape import Landscape, State
from jamshape.vibration.extended import SparseRows
from jamshape.vibration.hessian import LARGEST_RESIDUAL, ROUNDINGS, DynamicalMatrix, Strains
from jamshape.vibration.quotients import EPS
from jamshape.vibration.sparse_modes import ShiftedInverse, softest
from jamshape.vibration.spectrum import Spectrum, is_unsettled, nearer_minimum
from jamshape.vibration.stability import BorderedMatrix, Eigenvalue, softest_of
from jamshape.vibration.tensors import ElasticTensor, Modulus, pressure_terms, strains_of

# Iterative refinements of a solution.
_REFINEMENTS = 3

# Safety factor for the estimated change on the way to the minimum.
_SAFETY = 2.0


class Moduli(NamedTuple):
    """Elastic moduli of a packing, and its stability to shear.

    The first three are second derivatives of the energy over the volume. `B` and `C` have all moduli; they differ from these, and
    from each other, by terms of the pressure (see `jamshape.vibration.tensors`).
    """

    bulk: Modulus
    """-V dp/dV."""
    pure_shear: Modulus
    """Modulus for gamma, with x and y stretched by exp(gamma / 2) and exp(-gamma / 2)."""
    simple_shear: Modulus
    """Modulus for gamma, with x moved by gamma y."""
    pressure: float
    """[energy / length^D], in the same state."""
    B: ElasticTensor
    """Change of the stress by strain, the second derivatives of the enthalpy, with mean and extremal shear moduli."""
    C: ElasticTensor
    """Second derivatives of the energy by Green's strain."""
    bordered: Eigenvalue
    """Smallest eigenvalue of the bordered Hessian (`jamshape.vibration.stability`), [energy / length^2]."""
    n_floppy: int = 0
    """Number of floppy modes, with eigenvalues below their bounds. They are left out of the moduli."""
    n_unsettled: int = 0
    """Number of further modes left out, along which the minimum is farther away than the mean overlap."""
    n_negative: int = 0
    """Number of negative eigenvalues among known modes; at a saddle the moduli differ from those that shear measures."""

    @property
    def is_stable_to_shear(self) -> bool | None:
        """Whether this is a minimum also in a box that can deform; None if the bounds leave it undecided.

        True if the smallest eigenvalue of B is positive and that of the bordered Hessian not negative, False if one of them is
        negative, each beyond its bound.
        """
        smallest = self.B.smallest
        if self.bordered.sign < 0 or smallest.relaxed < -smallest.bound:
            return False
        return True if smallest.relaxed > smallest.bound else None


def moduli(
    matrix: DynamicalMatrix, soft: Spectrum | None = None, at: tuple[Landscape, State] | None = None
) -> Moduli:
    """Compute elastic moduli with error bounds.

    Parameters
    ----------
    matrix : DynamicalMatrix
        Dynamical matrix of a minimum.
    soft : Spectrum, optional
        Known modes. The softest ones, including all floppy ones, are computed if missing.
    at : Landscape and State, optional
        State of the matrix. Without it the effect of the residual, and so the bound, is unknown.

    Returns
    -------
    Moduli
    """
    D = matrix.coordinates.dimension
    response, table = Response.of(matrix, _strains(D), softest(matrix, soft)), _Table.of(D)
    here = table.values(matrix, response.here.value)
    affine = table.values(matrix, _point(matrix, response.strains, 0 * response.motion).value)
    rounding = table.bounds(matrix, response.rounding())
    drift, of_state, unknown = None, np.full(len(here), np.inf), ""
    if at is not None:
        near = nearer_minimum(*at, matrix, response.solved(-matrix.gradient))
        unknown = _changed(matrix, near.matrix)
    if at is not None and not unknown:
        there = _point(near.matrix, response.strains, response.motion)
        change = np.abs(table.values(near.matrix, there.value) - here) / near.part
        drift = (there.left - response.here.left).astype(np.float64) / near.part
        further = table.picked(response.squared(response.along(drift))) / matrix.volume
        of_state = _SAFETY * (change + further)
    verdicts = response.verdicts(drift)
    here[~table.both([one.is_defined for one in verdicts])] = np.nan
    of_state[~table.both([not one.reason for one in verdicts])] = np.inf
    columns = np.stack([here, affine, rounding, of_state])
    reasons = tuple(one.reason or unknown for one in verdicts)
    known, pressure = response.soft, float(np.trace(matrix.pressure_tensor)) / D
    bulk, pure_shear, simple_shear = (table.modulus(k, columns, reasons) for k in range(3))
    return Moduli(
        bulk,
        pure_shear,
        simple_shear,
        pressure,
        *table.tensors(columns, reasons),
        _bordered(matrix),
        n_floppy=int(known.is_floppy.sum()),
        n_unsettled=int((response.is_unsettled & ~known.is_floppy).sum()),
        n_negative=int((known.sign[known.is_firm] < 0).sum()),
    )


def _bordered(matrix: DynamicalMatrix) -> Eigenvalue:
    """Find the smallest eigenvalue of the bordered Hessian; NaN in a state that is not at a minimum."""
    if matrix.residual.largest > LARGEST_RESIDUAL:
        return Eigenvalue(np.nan, np.inf)
    return softest_of(BorderedMatrix.of(matrix)).eigenvalue


def _strains(D: int) -> FloatArray:
    """(d + 2, D, D) strains: those of the components of a tensor, dilation and pure shear."""
    pure_shear = np.zeros((D, D))
    pure_shear[0, 0], pure_shear[1, 1] = 0.5, -0.5
    return np.concatenate([strains_of(D), [np.eye(D), pure_shear]])


class _Table(NamedTuple):
    """Linear combinations of E over the volume and of the pressure: bulk, pure and simple shear, B and C; q in all."""

    strains: IntArray
    """(2, q) rows of `_strains`."""
    scale: FloatArray
    """(q,)"""
    weights: FloatArray
    """(q, D, D) of the pressure tensor."""

    @classmethod
    def of(cls, D: int) -> _Table:
        """List them."""
        d, terms = len(strains_of(D)), pressure_terms(D)
        own = np.array([d, d + 1, d - 1])
        entries = np.indices((d, d)).reshape(2, -1)
        weights = np.zeros((3, D, D))
        weights[0], weights[1, [0, 1], [0, 1]] = (D - 1) / D**2 * np.eye(D), -0.25
        return cls(
            strains=np.hstack([[own, own], entries, entries]),
            scale=np.concatenate([[1 / D**2], np.ones(2 + 2 * d * d)]),
            weights=np.concatenate([weights, *(w.reshape(-1, D, D) for w in terms)]),
        )

    def picked(self, second: LongArray | FloatArray) -> FloatArray:
        """(q,) entries of a (k, k) matrix over the strains."""
        return np.asarray(second[tuple(self.strains)] * self.scale, np.float64)

    def values(self, matrix: DynamicalMatrix, second: LongArray) -> FloatArray:
        """(q,) values."""
        pressures = np.einsum("qab,ab->q", self.weights, matrix.pressure_tensor)
        return np.asarray(self.picked(second) / matrix.volume + pressures)

    def bounds(self, matrix: DynamicalMatrix, second: FloatArray) -> FloatArray:
        """(q,) bounds of their errors by rounding, from those of E."""
        pressures = np.einsum("qab,ab->q", np.abs(self.weights), matrix.pressure_rounding)
        return np.asarray(self.picked(second) / matrix.volume + pressures)

    def both(self, holds: list[bool]) -> BoolArray:
        """(q,) whether something holds of both strains."""
        return np.asarray(np.all(np.asarray(holds)[self.strains], axis=0))

    def modulus(self, k: int, columns: FloatArray, reasons: tuple[str, ...]) -> Modulus:
        """Entry k of (4, q) numbers of a `Modulus`."""
        relaxed, affine, rounding, of_state = columns[:, k].tolist()
        return Modulus(relaxed, affine, rounding, of_state, reasons[self.strains[0, k]])

    def tensors(
        self, columns: FloatArray, reasons: tuple[str, ...]
    ) -> tuple[ElasticTensor, ElasticTensor]:
        """B and C."""
        d = len(reasons) - 2
        B, C = columns[:, 3:].reshape(4, 2, d, d).swapaxes(0, 1)
        return ElasticTensor.of(B, reasons[:d]), ElasticTensor.of(C, reasons[:d])


def _changed(matrix: DynamicalMatrix, nearer: DynamicalMatrix) -> str:
    """Report contacts that change towards the minimum; an empty text if there are none."""
    here, there = (np.column_stack([m.bonds.particles, m.bonds.slot]) for m in (matrix, nearer))
    if sorted(here.tolist()) == sorted(there.tolist()):
        return ""
    return (
        "the bound is unknown, as contacts open or close on the way to the minimum; the residual is"
        f" {matrix.residual.largest:.2g}, minimise further or choose another u0"
    )


class _Point(NamedTuple):
    """E of k strains at some motions, as a bilinear form."""

    value: LongArray
    """(k, k) E."""
    left: LongArray
    """(n, k) half the slope of E."""
    stretched: LongArray
    """(m, k) C x + s."""


@dataclass(frozen=True, eq=False)
class Response:
    """Relaxation of the particles of a packing after k affine strains.

    Parameters
    ----------
    matrix : DynamicalMatrix
    strains : (k, D, D) array of float64
    soft : Spectrum
        All floppy and unsettled modes, and others.
    is_unsettled : (l,) array of bool
        Flags of the unsettled modes among them.
    inverse : ShiftedInverse
    motion : (n, k) array of float64
        Without translations and modes that are left out.
    here : _Point
    errors : Strains
        Bounds of rounding errors.
    """

    matrix: DynamicalMatrix
    strains: FloatArray
    soft: Spectrum
    is_unsettled: BoolArray
    inverse: ShiftedInverse
    motion: FloatArray
    here: _Point
    errors: Strains

    @classmethod
    def of(cls, matrix: DynamicalMatrix, strains: FloatArray, soft: Spectrum) -> Response:
        """Relax a packing after strains."""
        unsettled = is_unsettled(matrix, soft)
        inverse = ShiftedInverse(matrix, 0.0, soft.vectors[:, soft.is_floppy | unsettled])
        given = matrix.strained(strains)
        s, f = given.stretched, given.pushed
        held = _onto(inverse.held, matrix.compatibility.T @ s + f)
        x = inverse.solve_both(held - f, -s).v
        for _ in range(_REFINEMENTS):
            x = x - _onto(inverse.held, x)
            left = _point(matrix, strains, x).left.astype(np.float64)
            x = x - inverse.solve(left - _onto(inverse.held, left)).v
        x = np.asarray(x - _onto(inverse.held, x))
        here = _point(matrix, strains, x)
        errors = _errors_of(matrix, strains)
        return cls(matrix, strains, soft, unsettled, inverse, x, here, errors)

    @property
    def _is_left_out(self) -> BoolArray:
        return self.soft.is_floppy | self.is_unsettled

    @property
    def _is_in(self) -> BoolArray:
        return self.soft.is_firm & ~self.is_unsettled

    def solved(self, push: FloatArray) -> FloatArray:
        """(n,) motion under forces, without translations and modes that are left out."""
        found = self.inverse.solve(push - _onto(self.inverse.held, push)).v
        return np.asarray(found - _onto(self.inverse.held, found))

    def along(self, left: FloatArray) -> FloatArray:
        """(l + 1, k) magnitudes of (n, k) columns along the l included modes, and of the remainder."""
        modes = self.soft.vectors[:, self._is_in]
        parts = modes.T @ left
        beside = left - modes @ parts - _onto(self.inverse.held, left)
        return np.asarray(np.abs(np.vstack([parts, np.linalg.norm(beside, axis=0)])))

    def squared(self, along: FloatArray) -> FloatArray:
        """(k, k) bound of the change of E by such a remaining slope."""
        values, bound = (np.abs(self.soft.eigenvalues[self._is_in]), self.soft.bound[self._is_in])
        # All unknown modes are stiffer than the known ones; a whole spectrum has no unknown modes.
        beside = 0.5 * values.max(initial=0.0) if values.size else np.inf
        stiffness = np.append(values - bound, beside)
        return np.asarray(along.T @ (along / stiffness[:, None]))

    def rounding(self) -> FloatArray:
        """(k, k) bound of the error of E by rounding of C, S, s and f, and of the motion."""
        x, y = np.abs(self.motion), np.abs(self.here.stretched).astype(np.float64)
        by_C, by_S = self._changes()
        first = 2 * y.T @ by_C + x.T @ by_S + 2 * x.T @ self.errors.pushed + self.errors.affine
        left = self.here.left.astype(np.float64)
        along = self.along(left)
        along[:-1] += np.abs(self.soft.vectors[:, self._is_in]).T @ self._left_error()
        along[-1] += np.linalg.norm(self._left_error(), axis=0)
        return np.asarray(0.5 * (first + first.T) + by_C.T @ by_C + self.squared(along))

    def verdicts(self, drift: FloatArray | None) -> list[_Verdict]:
        """Decide for each strain whether the modulus is defined, or why not."""
        largest = self.matrix.residual.largest
        if largest > LARGEST_RESIDUAL:
            why = (
                f"the state is not at a minimum: its largest net force is {largest:.2g} of the mean"
                f" bond force, expected at most {LARGEST_RESIDUAL:g}"
            )
            return [_Verdict(False, why)] * len(self.strains)
        out = self._is_left_out
        Z, unsettled = self.soft.vectors[:, out], (self.is_unsettled & ~self.soft.is_floppy)[out]
        coupling = np.abs(Z.T @ self.here.left.astype(np.float64))
        error = np.abs(Z).T @ self._left_error()
        if drift is not None:
            error += _SAFETY * np.abs(Z.T @ drift)
        if drift is None or unsettled.any():  # direct effect of net forces on a stress
            net = self.matrix.compatibility.T @ self.matrix.bonds.pull
            error[~unsettled] += _SAFETY * np.linalg.norm(net)
        return [
            _verdict(coupling[:, k], error[:, k], unsettled, largest)
            for k in range(len(self.strains))
        ]

    def _changes(self) -> tuple[FloatArray, FloatArray]:
        """(m, k) and (n, k) bounds of rounding errors of C x + s and S x."""
        x, M = np.abs(self.motion), self.matrix
        by_C = ROUNDINGS * EPS * (abs(M.compatibility) @ x) + self.errors.stretched
        by_S = ROUNDINGS * EPS * (M.prestress_sizes @ x) + M.prestress_rounding @ x
        return np.asarray(by_C), np.asarray(by_S)

    def _left_error(self) -> FloatArray:
        """(n, k) bound of the rounding error of the slope."""
        C, y = abs(self.matrix.compatibility), np.abs(self.here.stretched).astype(np.float64)
        by_C, by_S = self._changes()
        return np.asarray(C.T @ (by_C + ROUNDINGS * EPS * y) + by_S + self.errors.pushed)


class _Verdict(NamedTuple):
    is_defined: bool
    reason: str
    """Reason why there is no modulus, or no bound; an empty text if there are both."""


def _verdict(
    coupling: FloatArray, error: FloatArray, is_unsettled: BoolArray, residual: float
) -> _Verdict:
    """Judge by the couplings of the modes that are left out."""
    couples = coupling > error

    def by(which: BoolArray) -> str:
        worst = int(np.argmax(np.where(which, coupling, 0.0)))
        return f"to this strain (by {coupling[worst]:.2g} with an error of {error[worst]:.1g})"

    if (floppy := couples & ~is_unsettled).any():
        why = f"a floppy mode couples {by(floppy)}, so nothing resists it"
        return _Verdict(False, why)
    if couples.any():
        why = (
            f"the bound is unknown, as the packing has not settled along a mode that couples {by(couples)};"
            f" the residual is {residual:.2g}, minimise further or choose another u0"
        )
        return _Verdict(True, why)
    return _Verdict(True, "")


def _onto(held: FloatArray, columns: FloatArray) -> FloatArray:
    return np.asarray(held @ (held.T @ columns))


def _point(matrix: DynamicalMatrix, strains: FloatArray, x: FloatArray) -> _Point:
    """Evaluate E in long double."""
    given, long = matrix.strained(strains), np.asarray(x, np.longdouble)
    stretched = SparseRows(matrix.compatibility) @ long + given.stretched
    pushed = SparseRows(matrix.prestress) @ long
    value = stretched.T @ stretched - long.T @ pushed + given.affine
    value += long.T @ given.pushed + given.pushed.T @ long
    left = SparseRows(matrix.compatibility.T) @ stretched - pushed + given.pushed
    return _Point(0.5 * (value + value.T), np.asarray(left, np.longdouble), stretched)


def _errors_of(matrix: DynamicalMatrix, strains: FloatArray) -> Strains:
    """Bound rounding errors of the response to strains."""
    sizes, lost = matrix.strained_sizes(strains)
    return Strains(
        stretched=ROUNDINGS * EPS * sizes.stretched + lost.stretched,
        pushed=ROUNDINGS * EPS * sizes.pushed + lost.pushed,
        affine=ROUNDINGS * EPS * sizes.affine + lost.affine,
    )
