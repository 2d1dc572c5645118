"""Elastic moduli of twenty packings and their bounds, compared with quasistatic shear and a dense calculation.

    python analysis/errors/moduli_error.py --out runs/moduli_error

Rods, dimers, ellipses, superdisks, spheroids and superballs at u0 from 1e-12 to 1e-6, with floppy modes and without.
Each is compared with two calculations that use no second derivatives of contacts, and with one that does:

- shear: minimisations (tolerance 1e-13) at strains of +h and -h, the slope of the stress between them; the error is three
  times what changes with h/2 and 2h;
- differences of forces and stresses by all coordinates and strains, from which a dense matrix is formed, and its eigenvectors
  but the floppy ones; the error is three times what changes with h/2 and h/4. Contacts that hardly touch allow tiny h only;
- dense: Gaussian elimination in long double of the whole matrix, floppy modes held.

Calculations whose own error exceeds a tenth of the modulus, as those by differences where a contact hardly touches, are in the
table, but do not count.

Writes a table (Markdown) and the numbers (JSON); finished packings are kept and not repeated. The last line of standard
output is one JSON object.
"""

from __future__ import annotations

import warnings
from argparse import ArgumentParser, Namespace
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from studies.kept import kept, kept_packing
from studies.shown import markdown

import jamshape as js
from jamshape.arrays import FloatArray, LongArray
from jamshape.command import parser_of, report, run
from jamshape.landscape import Landscape, State
from jamshape.minima import Stop, minimise
from jamshape.packing import Packing
from jamshape.shapes.particles import Particles
from jamshape.vibration.hessian import DynamicalMatrix, dynamical_matrix, gradient_in
from jamshape.vibration.table import MODULI

STRAIN = 1e-4  # of shear, over the relative overlap
STEP, OF_WEAKEST = (
    1e-5,
    0.1,
)  # of differences, over the mean overlap and at most over the smallest one
TOLERANCE = 1e-13
NOISE = 3.0  # errors are largely rounding, of which other steps show the size
USEFUL = 0.1  # error, over the modulus, beyond which a calculation shows nothing
EPS = float(np.finfo(float).eps)
GOOD = 1e-8  # residual of packings that are taken
SEEDS = 20
HALF = np.longdouble(0.5)


class Case(NamedTuple):
    """One packing."""

    name: str
    particles: Particles
    n: int
    u0: float
    seed: int = 1
    dimension: int = 2
    floppy: bool = False
    """Whether it must have floppy modes."""


def cases() -> list[Case]:
    """List the packings."""
    long, short, dimers = js.Spherocylinders(alpha=4), js.Spherocylinders(alpha=1), js.Dimers()
    ellipses = js.Superellipsoids(w1=0.7, size_ratio=1.4)
    superdisks, superballs = js.Superellipsoids(p=1.5, size_ratio=1.4), js.Superellipsoids(p=1.5)
    spheroids = js.Superellipsoids(w1=0.7)
    return [
        # Seeds whose floppy modes do not couple to strains, so that moduli are defined.
        Case("rods, alpha = 4", long, 64, 1e-6, seed=5),
        Case("rods, alpha = 4", long, 64, 1e-6, seed=10, floppy=True),
        *(Case("rods, alpha = 4", long, 64, u0, floppy=True) for u0 in (1e-8, 1e-9, 1e-10, 1e-12)),
        *(Case("rods, alpha = 1", short, 32, u0) for u0 in (1e-6, 1e-9, 1e-12)),
        Case("rods, alpha = 1", short, 16, 1e-8, dimension=3),
        # Some bonds of seed 1 hardly overlap, and differences by steps through a gap are wrong.
        *(Case("dimers", dimers, 32, u0, seed=2) for u0 in (1e-6, 1e-9, 1e-12)),
        Case("dimers", dimers, 16, 1e-8, dimension=3, seed=2),
        *(Case("ellipses", ellipses, 32, u0) for u0 in (1e-6, 1e-10)),
        Case("superdisks", superdisks, 32, 1e-8),
        *(Case("spheroids", spheroids, 16, u0, dimension=3) for u0 in (1e-8, 1e-11)),
        Case("superballs", superballs, 16, 1e-8, dimension=3),
    ]


def made(case: Case) -> Packing:
    """Make the packing of the first seed, from that of the case on, that ends at a minimum: at no saddle, and as floppy as asked."""
    settings: dict[str, Any] = {"n": case.n, "u0": case.u0, "dimension": case.dimension}
    for seed in range(case.seed, case.seed + SEEDS):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", js.NotReachedWarning)  # the next seed is tried
            packing = js.make_packing(case.particles, seed=seed, progress=False, **settings)
        modes = js.modes(packing, force=True)
        is_floppy = modes.moduli.n_floppy > 0 or not case.floppy
        is_minimum = modes.table.attributes["residual"] < GOOD and (modes["sign"] >= 0).all()
        if is_minimum and is_floppy:
            return packing
    msg = f"{case.name}: none of {SEEDS} seeds ended at a minimum, expected one; try other seeds"
    raise ValueError(msg)


def deformed(state: State, change: LongArray) -> State:
    """Move particles and box by a linear map, an upper triangular matrix, at fixed orientations."""
    return replace(state, position=state.position @ change.T, cell=change @ state.cell)


def map_of(name: str, dimension: int, strain: float) -> LongArray:
    """Linear map of a strain."""
    g, change = np.longdouble(strain), np.eye(dimension, dtype=np.longdouble)
    if name == "bulk":
        return change * (1 + g)
    if name == "simple_shear":
        change[0, 1] = g
    else:
        change[0, 0], change[1, 1] = np.exp(HALF * g), np.exp(-HALF * g)
    return change


def slope(name: str, landscape: Landscape, state: State) -> float:
    """Differentiate the energy by a strain, or take the pressure for the bulk modulus."""
    contacts = landscape.derivatives(state, extended=True)
    virial = contacts["separation"].T @ contacts["force"]
    if name == "bulk":
        D = state.dimension
        return float(-np.trace(virial) / (D * state.volume))
    return -float(virial[1, 0] if name == "simple_shear" else 0.5 * (virial[0, 0] - virial[1, 1]))


def modulus_of(name: str, state: State, rise: float) -> float:
    """Modulus from the derivative of `slope` by the strain."""
    return rise / state.dimension if name == "bulk" else rise / state.volume


def by_shear(name: str, landscape: Landscape, state: State, h: float) -> float:
    """Modulus from minimisations at strains of +h and -h."""
    stop, slopes = Stop(tolerance=TOLERANCE, evaluations=2000), []
    for strain in (h, -h):
        start = deformed(state, map_of(name, state.dimension, strain))
        there = minimise(landscape, start, "newton", stop)
        slopes.append(slope(name, landscape, there.state))
    return modulus_of(name, state, (slopes[0] - slopes[1]) / (2 * h))


class Dense(NamedTuple):
    """Second derivatives by differences."""

    matrix: FloatArray
    """(n, n)"""
    pushed: FloatArray
    """(n, 3) change of the gradient by each strain."""
    affine: FloatArray
    """(3,) change of the slope by each strain, particles following it."""


def differences(landscape: Landscape, state: State, matrix: DynamicalMatrix, h: float) -> Dense:
    """Differentiate forces and stresses by coordinates and strains."""
    at, D = matrix.coordinates, state.dimension

    def gradient(there: State) -> FloatArray:
        return gradient_in(at, landscape, landscape.evaluate(there))

    def along(k: int, step: float) -> FloatArray:
        moved = np.zeros(at.size)
        moved[k] = step
        return gradient(state.displaced(*at.motion(moved)))

    matrix_ = np.array([(along(k, h) - along(k, -h)) / (2 * h) for k in range(at.size)])
    up, down = ([deformed(state, map_of(name, D, e)) for name in MODULI] for e in (h, -h))
    pushed = [(gradient(a) - gradient(b)) / (2 * h) for a, b in zip(up, down, strict=True)]
    slopes = [
        [slope(name, landscape, there) for name, there in zip(MODULI, of, strict=True)]
        for of in (up, down)
    ]
    affine = (np.array(slopes[0]) - slopes[1]) / (2 * h)
    return Dense(0.5 * (matrix_ + matrix_.T), np.array(pushed).T, affine)


def by_elimination(matrix: DynamicalMatrix, held: FloatArray, state: State) -> FloatArray:
    """Moduli from the dense matrix in long double, (n, l) modes held."""
    D, strains = state.dimension, np.zeros((3, state.dimension, state.dimension))
    strains[0] = np.eye(D)
    strains[1, 0, 0], strains[1, 1, 1], strains[2, 0, 1] = 0.5, -0.5, 1.0
    given = matrix.strained(strains)
    C, S, Z = (
        np.asarray(a, np.longdouble)
        for a in (matrix.compatibility.toarray(), matrix.prestress.toarray(), held)
    )
    pushed = C.T @ given.stretched + given.pushed
    right: LongArray = np.asarray(-(pushed - Z @ (Z.T @ pushed)), np.longdouble)
    x = eliminated(C.T @ C - S + Z @ Z.T, right)
    rise = (np.asarray(given.stretched, np.longdouble) ** 2).sum(axis=0) + np.diag(given.affine)
    rise += (x * pushed).sum(axis=0)
    virial = (matrix.contacts["separation"] * matrix.contacts["force"]).sum(axis=0) / state.volume
    # A strain is not what the slope is taken by: exp(g/2) has a second derivative, 1/V another first one.
    more = np.array([(D - 1) / D**2 * virial.sum(), -virial[:2].sum() / 4, 0.0])
    return np.asarray(rise / state.volume * [1 / D**2, 1, 1] + more, np.float64)


def eliminated(A: LongArray, B: LongArray) -> LongArray:
    """Solve A X = B by elimination with partial pivoting."""
    A, B = A.copy(), B.copy()
    for k in range(len(A)):
        pivot = k + int(np.abs(A[k:, k]).argmax())
        A[[k, pivot]], B[[k, pivot]] = A[[pivot, k]], B[[pivot, k]]
        factor = A[k + 1 :, k] / A[k, k]
        A[k + 1 :] -= factor[:, None] * A[k]
        B[k + 1 :] -= factor[:, None] * B[k]
    X = np.zeros_like(B)
    for k in reversed(range(len(A))):
        X[k] = (B[k] - A[k, k + 1 :] @ X[k + 1 :]) / A[k, k]
    return X


def by_differences(found: Dense, state: State, n_left_out: int) -> FloatArray:
    """Moduli from eigenvectors of the matrix, those of the smallest eigenvalues left out."""
    values, vectors = np.linalg.eigh(found.matrix)
    kept_ = np.argsort(np.abs(values))[n_left_out:]
    # The slope of the pressure by coordinates is that of the energy over -D V.
    weights = np.array([1 / (state.dimension * state.volume), 1.0, 1.0])
    inverse = (vectors[:, kept_] / values[kept_]) @ vectors[:, kept_].T
    relaxed = found.affine - np.einsum("nk,nm,mk->k", found.pushed * weights, inverse, found.pushed)
    return np.array([modulus_of(name, state, relaxed[k]) for k, name in enumerate(MODULI)])


def measure(case: Case, path: Path) -> dict[str, Any]:
    """Compare the moduli of one packing."""
    packing = kept_packing(path, partial(made, case))
    modes = js.modes(packing)
    landscape, state = Landscape(packing), State.of(packing)
    matrix = dynamical_matrix(landscape, state)
    overlap = matrix.bond_force / float(matrix.bonds.stiffness.mean())
    relative = overlap / float(np.linalg.norm(matrix.contacts["separation"], axis=1).mean())
    held = (modes["sign"] == 0) & ~modes["is_translation"]
    floppy = np.column_stack([matrix.translations, modes.vectors[:, held]])
    dense = by_elimination(matrix, floppy, state)
    forces = matrix.contacts["bond_force"]
    weakest = float(forces[forces > 0].min()) / matrix.bond_force
    step = min(STEP, OF_WEAKEST * weakest) * overlap
    differing = [
        by_differences(differences(landscape, state, matrix, step / f), state, floppy.shape[1])
        for f in (1, 2, 4)
    ]
    rows = {}
    for k, name in enumerate(MODULI):
        found = getattr(modes.moduli, name)
        sheared = [by_shear(name, landscape, state, f * STRAIN * relative) for f in (1, 0.5, 2)]
        rows[name] = {
            "modulus": found.relaxed,
            "rounding": found.rounding,
            "bound": found.bound,
            "shear": sheared[0],
            "shear_error": NOISE * max(abs(g - sheared[0]) for g in sheared[1:]),
            "differences": differing[0][k],
            "differences_error": NOISE * max(abs(g[k] - differing[0][k]) for g in differing[1:]),
            "dense": dense[k],
        }
    return {
        "packing": case.name,
        "dimension": case.dimension,
        "n": case.n,
        "u0": case.u0,
        "residual": matrix.residual.largest,
        "n_floppy": modes.moduli.n_floppy,
        "moduli": rows,
    }


def errors_of(row: dict[str, Any]) -> dict[str, float]:
    """Largest difference of a modulus from each calculation that shows something."""
    own = {
        "shear": (row["bound"], row["shear_error"]),
        "differences": (row["rounding"], row["differences_error"]),
        "dense": (row["rounding"], EPS * abs(row["modulus"])),
    }
    useful = USEFUL * abs(row["modulus"])
    return {name: bound + error for name, (bound, error) in own.items() if error <= useful}


def is_within(row: dict[str, Any]) -> bool:
    """Whether a modulus agrees with the calculations within its bound and their errors."""
    return all(abs(row["modulus"] - row[name]) <= most for name, most in errors_of(row).items())


def table_of(found: list[dict[str, Any]]) -> str:
    """Write a line for each packing with its largest numbers over three moduli, relative to these."""
    heads = (
        *(
            "packing",
            "D",
            "N",
            "u0",
            "floppy",
            "simple shear",
            "bound",
            "beside shear",
            "its error",
        ),
        *("beside differences", "their error", "beside dense", "within"),
    )

    def line(of: dict[str, Any]) -> list[str]:
        rows = of["moduli"].values()

        def largest(value: Any) -> str:
            return f"{max(value(row) / abs(row['modulus']) for row in rows):.1e}"

        return [
            *(
                of["packing"],
                str(of["dimension"]),
                str(of["n"]),
                f"{of['u0']:.0e}",
                str(of["n_floppy"]),
            ),
            f"{of['moduli']['simple_shear']['modulus']:.6e}",
            largest(lambda row: row["bound"]),
            largest(lambda row: abs(row["modulus"] - row["shear"])),
            largest(lambda row: row["shear_error"]),
            largest(lambda row: abs(row["modulus"] - row["differences"])),
            largest(lambda row: row["differences_error"]),
            largest(lambda row: abs(row["modulus"] - row["dense"])),
            "yes" if all(map(is_within, rows)) else "no",
        ]

    return markdown(heads, map(line, found))


def summary(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Count what is within its bounds, and take the median bound, relative to the modulus."""
    rows = [(of["u0"], row) for of in found for row in of["moduli"].values()]
    bounds = [row["bound"] / abs(row["modulus"]) for u0, row in rows if u0 >= 1e-10]
    return {
        "moduli": len(rows),
        "within": sum(is_within(row) for _, row in rows),
        "calculations": sum(len(errors_of(row)) for _, row in rows),
        "median_bound_from_1e-10_on": float(np.median(bounds)),
        "largest_bound_from_1e-10_on": max(bounds),
    }


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/moduli_error")
    found.add_argument(
        "--only", type=int, nargs="*", metavar="K", help="numbers of packings, from 0"
    )
    return found


def main(options: Namespace) -> None:
    """Measure, write, report."""
    options.out.mkdir(parents=True, exist_ok=True)
    found = []
    for number, case in enumerate(cases()):
        if options.only is not None and number not in options.only:
            continue
        path = options.out / f"{number:02}.h5"
        found.append(kept(path.with_suffix(".json"), measure, case, path))
        print(table_of(found[-1:]).splitlines()[-1], flush=True)
    (options.out / "table.md").write_text(table_of(found))
    report({"out": options.out, **summary(found), "packings": found})


if __name__ == "__main__":
    run(parser(), main)
