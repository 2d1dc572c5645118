"""Packings at an energy, and their modes."""

from fractions import Fraction
from functools import partial

import numpy as np
from energy_targets import ENDED, led
from extreme import case, extreme
from extreme_shapes import RODS, SHAPES
from packings_in_a_box import at_a_minimum, scaled
from test_extreme_landscape import UNITS

from jamshape.landscape import Landscape, State
from jamshape.vibration.hessian import dynamical_matrix
from jamshape.vibration.spectrum import spectrum

TARGET, PART = "energy target", "spectrum"


# --- energies ------------------------------------------------------------------------------------


def targets():
    for shape in SHAPES:
        for name in shape.jammed:
            for u0 in (1e-4, 1e-8, 1e-15, 1e-18):
                quick = name == "discs" or (u0 == 1e-15 and name in shape.quick_targets)
                yield case(f"{TARGET}: {name}, u0 {u0:g}", name, u0, heavy=not quick)
        for name in shape.targets_in_units:
            for length, k_e in UNITS:
                heavy = name != "discs" and length != 1e6
                label = f"{TARGET}: {name}, length {length:g}, k_e {k_e:g}"
                yield case(label, name, 1e-10, length, k_e, heavy=heavy)


@extreme("error of u where forces balance", targets(), 1e-7)
def test_energy(name, u0, length=1.0, k_e=1.0):
    """|u - u0| / u0; infinite where forces do not balance."""
    landscape, found = led(name, u0, length, k_e)
    if found.outcome not in ENDED[:2]:
        return np.inf
    wanted = u0 * k_e / length**landscape.particles.dimension
    return abs(found.energy_density / wanted - 1)


@extreme("", [case(f"{TARGET}: u0 {u0:g}", u0) for u0 in (1e-30, 1.0)],
         r"u0 is .*, whose overlaps are about .* take another u0")  # fmt: skip
def test_out_of_reach(u0):
    led("discs", u0)


# --- bounds of eigenvalues -----------------------------------------------------------------------


def exact_inertia(matrix, shift):
    """Number of eigenvalues below a shift, exactly: signs of pivots in rational arithmetic."""
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
                    rounded(a - factor * b)
                    for a, b in zip(rows[i][k + 1 :], rows[k][k + 1 :], strict=True)
                ]
    return below


def rounded(value, bits=300):
    if value == 0:
        return value
    excess = value.denominator.bit_length() - value.numerator.bit_length() + bits
    unit = Fraction(1, 2**excess) if excess > 0 else Fraction(2**-excess)
    return Fraction(round(value / unit)) * unit


@extreme("bounds that do not hold, by exact inertia", [
    *(case(f"{PART}: {name}, u0 {u0:g}", name, u0, "projected", heavy=(name, u0) != ("discs", 1e-15))
      for shape in SHAPES for name in shape.spectra for u0 in (1e-4, 1e-15, 1e-18)),
    case(f"{PART}: rods of alpha 4, refined", "rods of alpha 4", 1e-15, "refined", heavy=True),
], 0.0)  # fmt: skip
def test_bounds(name, u0, method):
    """The three lowest intervals, the highest, and two between."""
    landscape, minimum = led(name, u0)
    matrix = dynamical_matrix(landscape, minimum.state)
    found = spectrum(matrix, method)
    inside = np.flatnonzero(~found.is_translation)
    chosen = inside[np.unique([0, 1, 2, len(inside) // 3, len(inside) // 2, len(inside) - 1])]
    wrong = 0
    for k in chosen:
        value, error = Fraction(float(found.eigenvalues[k])), Fraction(float(found.solver_error[k]))
        wrong += exact_inertia(matrix, value + error) <= exact_inertia(matrix, value - error)
    return wrong


@extreme("change over both bounds", [
    case(f"{PART}: {name}, length {length:g}, k_e {k_e:g}", name, length, k_e, heavy=name != "discs")
    for shape in SHAPES for name in shape.modes_in_units for length, k_e in UNITS
], 1.0)  # fmt: skip
def test_units(name, length, k_e):
    landscape, minimum = led(name, 1e-12)
    there = scaled(minimum.state.packing(landscape.particles), length)
    a = spectrum(dynamical_matrix(landscape, minimum.state))
    b = spectrum(dynamical_matrix(Landscape(there, k_e), State.of(there)))
    unit = k_e / length**2
    if len(a.eigenvalues) != len(b.eigenvalues):
        return np.inf
    change = np.abs(b.eigenvalues / unit - a.eigenvalues)
    # Rounding of coordinates in long double changes the prestress and low modes.
    of_state = 1e-16 + 1e-13 * np.abs(a.eigenvalues)
    return (change / (a.bound + b.bound / unit + of_state)).max()


THIRD = RODS.minimised["overlaps of a third"]


@extreme("departure from orthonormal", [
    *(case(f"{PART}: {name}", partial(at_a_minimum, shape.minimised[name]))
      for shape in SHAPES for name in shape.to_the_end),
    case(f"{PART}: no minimum", THIRD, expected=r"expected|minimis"),
], 1e-8)  # fmt: skip
def test_modes_are_orthonormal(scene):
    packing = scene()
    found = spectrum(dynamical_matrix(Landscape(packing), State.of(packing)))
    if not (np.isfinite(found.eigenvalues).all() and np.isfinite(found.bound).all()):
        return np.inf
    product = found.vectors.T @ found.vectors
    return np.abs(product - np.eye(len(product))).max()
