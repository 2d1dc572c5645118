"""Cases of the stability battery: minimisers, energy targets, spectra, random starts."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import cache, partial

import numpy as np
from stability_cases import Case
from stability_contacts import EXPONENTS
from stability_scenes import (
    all_aspect_ratios,
    all_sizes,
    deep,
    jammed,
    jammed_spheroids,
    own_images,
    rods,
    scaled,
    scattered_superellipsoids,
    stack,
)

from jamshape.arrays import FloatArray
from jamshape.landscape import Landscape, State
from jamshape.minima import Minimum, Outcome, Stop, minimise
from jamshape.minima.target import Target, find
from jamshape.packing import Packing
from jamshape.protocols.random_start import Mixture, random_packing
from jamshape.vibration.hessian import DynamicalMatrix, dynamical_matrix
from jamshape.vibration.spectrum import Spectrum, spectrum

MINIMISER, TARGET, SPECTRUM, START = "minimisers", "energy target", "spectrum", "random start"

_METHODS = ("auto", "newton", "lbfgs")
# In doubles, and of first order: L-BFGS says that it stalls before 1e-8.
_STOPS = {"auto": Stop(), "newton": Stop(), "lbfgs": Stop(tolerance=1e-5)}
_ENDED = (Outcome.CONVERGED, Outcome.SLIDING, Outcome.UNJAMMED)


# --- minimisers ----------------------------------------------------------------------------------


def _relative(landscape: Landscape, found: Minimum) -> float:
    """Energy density in units of k_e and of the largest of the small lengths."""
    size = float(landscape.inner_radius.max()) ** found.state.dimension
    return found.energy_density * size / landscape.k_e


def minimised(scene: Callable[[], Packing], method: str, stop: Stop) -> float:
    """Residual where it ended; infinite if it gave up, or the energy rose."""
    packing = scene()
    landscape, start = Landscape(packing), State.of(packing)
    before = landscape.evaluate(start).energy
    found = minimise(landscape, start, method, stop)
    if not found.evaluation.energy <= before or not np.isfinite(found.residual.largest):
        return np.inf
    if found.outcome is Outcome.UNJAMMED:
        return 0.0
    return found.residual.largest if found.outcome in _ENDED else np.inf


def never_worse(scene: Callable[[], Packing], method: str) -> float:
    """Energy after 300 evaluations over that before, whatever the outcome; infinite if not finite."""
    packing = scene()
    landscape, start = Landscape(packing), State.of(packing)
    before = landscape.evaluate(start).energy
    found = minimise(landscape, start, method, Stop(evaluations=300))
    position = np.asarray(found.state.position, float)
    fine = np.isfinite(found.residual.largest) and np.isfinite(position).all()
    return found.evaluation.energy / before if fine else np.inf


def minimiser_in_units(method: str, length: float, k_e: float) -> float:
    """Change of the scaled energy at the minimum, and of the number of evaluations."""
    energies, counts = [], []
    for unit, energy in ((1.0, 1.0), (length, k_e)):
        packing = scaled(jammed(0.0), unit)
        landscape = Landscape(packing, energy)
        found = minimise(landscape, State.of(packing), method, _STOPS[method])
        if found.outcome is not Outcome.CONVERGED:
            return np.inf
        energies.append(_relative(landscape, found))
        counts.append(landscape.evaluations)
    # Twice the work is no longer the same path.
    change = abs(energies[1] / energies[0] - 1)
    return change if counts[1] <= 2 * counts[0] else np.inf


def faint_in_units(length: float, k_e: float) -> float:
    """Jammed at overlaps of 1e-9: called jammed in any unit, by the default `Stop`."""
    landscape, faint = led("discs", 1e-18)
    there = scaled(faint.state.packing(landscape.particles), length)
    found = minimise(Landscape(there, k_e), State.of(there), "newton", Stop(tolerance=1e-3))
    return found.residual.largest if found.outcome is Outcome.CONVERGED else np.inf


def unjams(length: float, k_e: float, method: str) -> float:
    """Count evaluations to part a few overlapping discs, in other units; infinite if not unjammed."""
    packing = scaled(
        rods([[0.0, 0.0], [0.9, 0.0], [0.4, 0.7]], 0.0, 0.0, 0.5, [20.0, 20.0]), length
    )
    landscape = Landscape(packing, k_e)
    found = minimise(landscape, State.of(packing), method, Stop(evaluations=2000))
    return float(landscape.evaluations) if found.outcome is Outcome.UNJAMMED else np.inf


def nothing_touches(method: str) -> float:
    """Count evaluations of a packing without contacts; infinite if that is not called unjammed."""
    packing = rods([[0.0, 0.0], [5.0, 0.0]], 0.0, 1.0, 0.5, [20.0, 20.0])
    landscape = Landscape(packing)
    found = minimise(landscape, State.of(packing), method)
    return float(landscape.evaluations) if found.outcome is Outcome.UNJAMMED else np.inf


def crossing_start(method: str) -> str:
    """Begin with crossing spines."""
    packing = rods([[0.0, 0.0], [0.1, 0.2]], [0.0, 1.5], 1.0, 0.5, [12.0, 12.0])
    minimise(Landscape(packing), State.of(packing), method)
    return "no sentence"


def minimiser_cases() -> list[Case]:
    """All methods that need no LAMMPS."""
    found = []
    scenes: dict[str, Callable[[], Packing]] = {
        "alpha 1e-6 to 100 in one box": partial(all_aspect_ratios, 2),
        "sizes 1 to 10": partial(all_sizes, 2),
        "overlaps of a third": partial(deep, 2),
        "3D, overlaps of a third": partial(deep, 3),
        "own images": partial(own_images, 2),
        "stack to 1e-6": partial(stack, 1e-6, 2),
        "stack to 1e-14": partial(stack, 1e-14, 2),
        "p 0.55 to 10 in one box": partial(scattered_superellipsoids, EXPONENTS, (1.0,)),
        "w 0.1 to 10 in one box": partial(scattered_superellipsoids, (1.0, 1.5), (0.1, 1.0, 10.0)),
    }
    for name, scene in scenes.items():
        for method in _METHODS:
            run = partial(never_worse, scene, method)
            what = "energy after 300 evaluations over that before"
            found.append(Case(MINIMISER, f"{name}, {method}", what, 1.0, run))
    for name in ("overlaps of a third", "own images"):
        run = partial(minimised, scenes[name], "auto", Stop())
        found.append(Case(MINIMISER, f"{name}, to the end", "residual", 1e-8, run))
    deep_discs = partial(deep, 2, 0.0)
    for method in _METHODS:
        stop = _STOPS[method]
        run = partial(minimised, deep_discs, method, stop)
        label = f"discs, overlaps of a third, {method}"
        found.append(Case(MINIMISER, label, "residual", stop.tolerance, run))
        for length, k_e in ((1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6)):
            run = partial(minimiser_in_units, method, length, k_e)
            label = f"{method}, length {length:g}, k_e {k_e:g}"
            what = "change of scaled energy, work at most twice"
            # Energies change by the square of the residual.
            limit = max(1e-12, _STOPS[method].tolerance ** 2 * 10)
            found.append(Case(MINIMISER, label, what, limit, run))
            run = partial(unjams, length, k_e, method)
            label = f"{method} parts discs, length {length:g}, k_e {k_e:g}"
            found.append(Case(MINIMISER, label, "evaluations", 500, run))
        run = partial(nothing_touches, method)
        found.append(Case(MINIMISER, f"{method}, nothing touches", "evaluations", 1, run))
        words = r"spines of particles \d+ and \d+ cross, expected .*; start from"
        run_there = partial(crossing_start, method)
        found.append(Case(MINIMISER, f"{method}, crossing spines", "sentence", words, run_there))
    for length, k_e in ((1.0, 1.0), (1e3, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6)):
        run = partial(faint_in_units, length, k_e)
        label = f"overlaps of 1e-9 are jammed, length {length:g}, k_e {k_e:g}"
        found.append(Case(MINIMISER, label, "residual", 1e-3, run))
    return found


# --- energy targets ------------------------------------------------------------------------------

_JAMMED = {"discs": (0.0, 0.77), "rods of alpha 0.01": (0.01, 0.77), "rods of alpha 1": (1.0, 0.86),
           "rods of alpha 4": (4.0, 0.8)}  # fmt: skip


def _start(name: str) -> Packing:
    if name == "spheroids":
        return jammed_spheroids()
    alpha, phi = _JAMMED[name]
    return jammed(alpha, 16, phi)


@cache
def led(
    name: str, u0: float, length: float = 1.0, k_e: float = 1.0, tolerance: float = 1e-8
) -> tuple[Landscape, Minimum]:
    """Lead a small packing to an energy density of u0 in units of the length 1 and k_e 1."""
    packing = scaled(_start(name), length)
    landscape = Landscape(packing, k_e)
    target = Target(u0 * k_e / length**packing.dimension, tolerance=tolerance)
    return landscape, find(landscape, State.of(packing), target)


def target_error(name: str, u0: float, length: float = 1.0, k_e: float = 1.0) -> float:
    """|u - u0| / u0 where forces balance; infinite where they do not."""
    landscape, found = led(name, u0, length, k_e)
    if found.outcome not in _ENDED[:2]:
        return np.inf
    wanted = u0 * k_e / length**landscape.particles.dimension
    return abs(found.energy_density / wanted - 1)


def out_of_reach(u0: float) -> str:
    """Ask for an energy that cannot be."""
    led("discs", u0)
    return "no sentence"


def target_cases() -> list[Case]:
    """List what the direct search must stand."""
    found, what = [], "error of u where forces balance"
    for name in _JAMMED:
        for u0 in (1e-4, 1e-8, 1e-15, 1e-18):
            run = partial(target_error, name, u0)
            heavy = not (name == "discs" or (name, u0) == ("rods of alpha 1", 1e-15))
            found.append(Case(TARGET, f"{name}, u0 {u0:g}", what, 1e-7, run, heavy))
    for name in ("discs", "rods of alpha 1", "spheroids"):
        for length, k_e in ((1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6)):
            run = partial(target_error, name, 1e-10, length, k_e)
            label = f"{name}, length {length:g}, k_e {k_e:g}"
            heavy = name != "discs" and length != 1e6
            found.append(Case(TARGET, label, what, 1e-7, run, heavy))
    for u0 in (1e-30, 1.0):
        words = r"u0 is .*, whose overlaps are about .* take another u0"
        found.append(Case(TARGET, f"u0 {u0:g}", "sentence", words, partial(out_of_reach, u0)))
    return found


# --- spectra -------------------------------------------------------------------------------------


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


def spectrum_in_units(name: str, length: float, k_e: float) -> float:
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


def finite_spectrum(scene: Callable[[], Packing]) -> float | str:
    """Modes of a state that is no minimum: finite and orthonormal, or a sentence."""
    packing = scene()
    matrix = dynamical_matrix(Landscape(packing), State.of(packing))
    found = spectrum(matrix)
    if not (np.isfinite(found.eigenvalues).all() and np.isfinite(found.bound).all()):
        return np.inf
    product = found.vectors.T @ found.vectors
    return float(np.abs(product - np.eye(len(product))).max())


def at_a_minimum(scene: Callable[[], Packing]) -> Callable[[], Packing]:
    """Find the minimum next to a scene."""

    def run() -> Packing:
        packing = scene()
        found = minimise(Landscape(packing), State.of(packing), "auto")
        return found.state.packing(packing)

    return run


def spectrum_cases() -> list[Case]:
    """All methods, of small packings."""
    found = []
    for name in ("discs", "rods of alpha 0.01", "rods of alpha 4"):
        for u0 in (1e-4, 1e-15, 1e-18):
            run = partial(wrong_bounds, name, u0, "projected")
            what = "bounds that do not hold, by exact inertia"
            heavy = (name, u0) != ("discs", 1e-15)
            found.append(Case(SPECTRUM, f"{name}, u0 {u0:g}", what, 0.0, run, heavy))
    run = partial(wrong_bounds, "rods of alpha 4", 1e-15, "refined")
    what = "bounds that do not hold, by exact inertia"
    found.append(Case(SPECTRUM, "rods of alpha 4, refined", what, 0.0, run, heavy=True))
    for name in ("discs", "rods of alpha 1"):
        for length, k_e in ((1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6)):
            run = partial(spectrum_in_units, name, length, k_e)
            label = f"{name}, length {length:g}, k_e {k_e:g}"
            heavy = name != "discs"
            found.append(Case(SPECTRUM, label, "change over both bounds", 1.0, run, heavy))
    for label, scene in (
        ("overlaps of a third", partial(deep, 2)),
        ("own images", partial(own_images, 2)),
        ("3D, overlaps of a third", partial(deep, 3)),
    ):
        run_there = partial(lambda s: finite_spectrum(at_a_minimum(s)), scene)
        found.append(Case(SPECTRUM, label, "departure from orthonormal", 1e-8, run_there))
    words = r"expected|minimis"
    run_there = partial(finite_spectrum, partial(deep, 2))
    found.append(Case(SPECTRUM, "no minimum", "sentence", words, run_there))
    return found


# --- starts --------------------------------------------------------------------------------------


def start_error(alpha: float, size_ratio: float, phi: float, dimension: int) -> float:
    """Energy of a random start, which must be 0, and the error of its packing fraction."""
    mixture = Mixture.bidisperse(alpha, size_ratio)
    packing = random_packing(12, phi, 1, mixture, dimension=dimension)
    energy = Landscape(packing).evaluate(State.of(packing)).energy
    return max(energy, abs(packing.phi / phi - 1))


def too_dense(alpha: float, phi: float) -> str:
    """Ask for what random insertion cannot reach."""
    random_packing(12, phi, 1, Mixture.bidisperse(alpha), max_attempts=20_000)
    return "no sentence"


def start_cases() -> list[Case]:
    """Random insertion."""
    found = []
    for alpha, ratio, phi, dimension in (
        (1e-6, 1.4, 0.4, 2), (1e-6, 10.0, 0.4, 2), (100.0, 1.4, 0.05, 2), (1.0, 10.0, 0.3, 3),
        (10.0, 1.4, 0.05, 3), (4.0, 1e6, 0.2, 2),
    ):  # fmt: skip
        run = partial(start_error, alpha, ratio, phi, dimension)
        label = f"{dimension}D, alpha {alpha:g}, size ratio {ratio:g}"
        found.append(Case(START, label, "energy; error of phi", 1e-14, run))
    for alpha, phi in ((0.0, 0.99), (4.0, 0.9), (100.0, 0.5)):
        words = r"(stalled at phi|no direction found).*start at phi"
        label = f"alpha {alpha:g} at phi {phi:g}"
        found.append(Case(START, label, "sentence", words, partial(too_dense, alpha, phi)))
    return found


def cases() -> list[Case]:
    """All of them."""
    return [*minimiser_cases(), *target_cases(), *spectrum_cases(), *start_cases()]
