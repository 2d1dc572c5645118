"""Cases of the stability battery: modes of small packings."""

from __future__ import annotations

from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np

from battery.case import Case
from battery.parts.landscape import UNITS
from battery.parts.targets import led
from battery.scenes.making import Scene, at_a_minimum, scaled
from battery.shapes.table import SHAPES
from jamshape.arrays import FloatArray
from jamshape.landscape import Landscape, State
from jamshape.vibration.hessian import DynamicalMatrix, dynamical_matrix
from jamshape.vibration.spectrum import Spectrum, spectrum

PART = "spectrum"


def _exact_inertia(matrix: DynamicalMatrix, shift: Fraction) -> int:
    """Count eigenvalues below a shift, exactly: signs of pivots in rational arithmetic."""
    C = [[Fraction(x) for x in row] for row in matrix.compatibility.toarray().tolist()]
    S = [[Fraction(x) for x in row] for row in matrix.prestress.toarray().tolist()]
    n = len(S)
    rows = [
        [sum((c[i] * c[j] for c in C if c[i] and c[j]), Fraction(0)) - S[i][j] for j in range(n)]
        for i in range(n)
    ]
    for i in range(n):
        rows[i][i] -= shift
    below = 0
    for k in range(n):
        pivot = rows[k][k]
        below += pivot < 0
        for i in range(k + 1, n):
            if rows[i][k]:
                factor = rows[i][k] / pivot
                # Rounded to 300 bits: far beyond what is asked for, and short enough.
                rows[i][k + 1 :] = [
                    _short(a - factor * b)
                    for a, b in zip(rows[i][k + 1 :], rows[k][k + 1 :], strict=True)
                ]
    return below


def _short(value: Fraction, bits: int = 300) -> Fraction:
    if value == 0:
        return value
    excess = value.denominator.bit_length() - value.numerator.bit_length() + bits
    unit = Fraction(1, 2**excess) if excess > 0 else Fraction(2**-excess)
    return Fraction(round(value / unit)) * unit


def wrong_bounds(name: str, u0: float, method: str) -> float:
    """Eigenvalues whose bounds do not hold, by counting exactly what lies below each end of them.

    Looked at are the three lowest intervals, the highest, and two between.
    """
    landscape, minimum = led(name, u0)
    matrix = dynamical_matrix(landscape, minimum.state)
    found = spectrum(matrix, method)
    inside = np.flatnonzero(~found.is_translation)
    chosen = inside[np.unique([0, 1, 2, len(inside) // 3, len(inside) // 2, len(inside) - 1])]
    wrong = 0
    for k in chosen:
        value, error = Fraction(float(found.eigenvalues[k])), Fraction(float(found.solver_error[k]))
        low, high = _exact_inertia(matrix, value - error), _exact_inertia(matrix, value + error)
        wrong += high <= low
    return float(wrong)


def in_units(name: str, length: float, k_e: float) -> float:
    """Change of scaled eigenvalues that are larger than their bounds, over the bounds or rounding."""
    landscape, minimum = led(name, 1e-12)
    there = scaled(minimum.state.packing(landscape.particles), length)
    a = spectrum(dynamical_matrix(landscape, minimum.state))
    b = spectrum(dynamical_matrix(Landscape(there, k_e), State.of(there)))
    unit = k_e / length**2
    if len(a.eigenvalues) != len(b.eigenvalues):
        return np.inf
    change = np.abs(b.eigenvalues / unit - a.eigenvalues)
    allowed = a.bound + b.bound / unit + _of_state(a)
    return float((change / allowed).max())


def _of_state(found: Spectrum) -> FloatArray:
    """Allow for what rounding of coordinates in long double does to the prestress and to low modes."""
    return np.asarray(1e-16 + 1e-13 * np.abs(found.eigenvalues))


def finite(scene: Scene) -> float | str:
    """Modes of a state: finite and orthonormal, or a sentence if it is no minimum."""
    packing = scene()
    matrix = dynamical_matrix(Landscape(packing), State.of(packing))
    found = spectrum(matrix)
    if not (np.isfinite(found.eigenvalues).all() and np.isfinite(found.bound).all()):
        return np.inf
    product = found.vectors.T @ found.vectors
    return float(np.abs(product - np.eye(len(product))).max())


def cases() -> list[Case]:
    """All of them."""
    found, what = [], "bounds that do not hold, by exact inertia"
    run: Any
    for shape in SHAPES:
        own = shape.solvers
        for name in own.spectra:
            for u0 in (1e-4, 1e-15, 1e-18):
                run, heavy = (
                    partial(wrong_bounds, name, u0, "projected"),
                    (name, u0) != ("discs", 1e-15),
                )
                found.append(Case(PART, f"{name}, u0 {u0:g}", what, 0.0, run, heavy))
        for name in own.modes_in_units:
            for length, k_e in UNITS:
                run, label = (
                    partial(in_units, name, length, k_e),
                    f"{name}, length {length:g}, k_e {k_e:g}",
                )
                found.append(
                    Case(PART, label, "change over both bounds", 1.0, run, name != "discs")
                )
        for name in own.to_the_end:
            run = partial(finite, partial(at_a_minimum, own.minimised[name]))
            found.append(Case(PART, name, "departure from orthonormal", 1e-8, run))
    run = partial(wrong_bounds, "rods of alpha 4", 1e-15, "refined")
    found.append(Case(PART, "rods of alpha 4, refined", what, 0.0, run, heavy=True))
    run = partial(finite, SHAPES[0].solvers.minimised["overlaps of a third"])
    found.append(Case(PART, "no minimum", "sentence", r"expected|minimis", run))
    return found
