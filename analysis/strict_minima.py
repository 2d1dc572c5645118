"""Compare packings with strict minima of the same recipe: contacts, density, bands of modes, forces.

    jamshape pack --alpha 4 --n 128 --seed 1 --out RUNS/plain_1.h5
    jamshape pack --alpha 4 --n 128 --seed 1 --strict --out RUNS/strict_1.h5
    python analysis/strict_minima.py RUNS/*.h5

Packings of the same particles, N, u0 and seed are compared where there is one of each sort. Prints a row of each, and
as its last line one JSON object: means over pairs with standard errors, of packings, of strict minima and of the
changes from one to the other.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from common.averages import mean
from common.ensembles import finished
from jamshape.command import parser_of, report, run
from jamshape.files.sets import PackingFile
from jamshape.landscape import Landscape, State
from jamshape.minima import Stop, minimise
from jamshape.vibration.hessian import DynamicalMatrix, Scope, dynamical_matrix
from jamshape.vibration.sets import TOLD
from jamshape.vibration.spectrum import Spectrum, spectrum
from jamshape.vibration.statistics import bands, why_no_bands

# Forces below this part of the mean stop what slides; they are of second order in the overlap.
WEAK = 1e-4

# Modes are followed so far, over the smallest radius, and what is stiff is relaxed there to such a residual.
FAR, RELAXED = 1e-5, 1e-6

NUMBERS = (
    *("z", "z_without_weak", "phi_J", "n_negative", "n_falling", "low", "middle", "high"),
    *(
        "low_without_weak",
        "weak_forces",
        "median_weak",
        "largest_weak",
        "least_other",
        "force_spread",
        "wall_seconds",
    ),
)


class Pair(NamedTuple):
    """The numbers of a packing, and of the strict minimum of the same recipe."""

    plain: dict[str, float]
    strict: dict[str, float]


def parser() -> ArgumentParser:
    """Describe the command line."""
    found = parser_of(__doc__)
    found.add_argument("packings", type=Path, nargs="+", metavar="PACKING", help="H5MD files")
    return found


def parts_of(matrix: DynamicalMatrix, found: Spectrum) -> dict[str, float]:
    """Give the fraction of all modes but translations that is in each band; NaN where bands are not apart."""
    n, nothing = (
        int((~found.is_translation).sum()),
        math.nan if why_no_bands(matrix, found) else 0.0,
    )
    return dict.fromkeys(TOLD, nothing) | {b.name: b.n_modes / n for b in bands(matrix, found)}


def n_falling(landscape: Landscape, state: State, matrix: DynamicalMatrix, found: Spectrum) -> int:
    """Count the modes of negative eigenvalues along which the energy does fall, on one side at least.

    At a corner of the energy it rises on both, whatever second derivatives say.
    """
    energy, count = landscape.evaluate(state).energy, 0
    for vector in found.vectors[:, (found.sign < 0) & ~found.is_translation].T:
        shift, turn = matrix.coordinates.motion(vector)
        size = max(np.abs(shift).max(), np.abs(turn * landscape.turning_radius[:, None]).max())
        way = FAR * landscape.inner_radius.min() / size
        there = (state.displaced(sign * way * shift, sign * way * turn) for sign in (1, -1))
        stop = Stop(RELAXED, evaluations=400)
        relaxed = [minimise(landscape, at, "newton", stop).evaluation.energy for at in there]
        count += min(relaxed) < energy
    return count


def numbers_of(file: PackingFile) -> dict[str, float]:
    """Measure one packing; fractions are of all modes but translations, and of all bonds."""
    packing = file.packing()
    landscape, state = Landscape(packing), State.of(packing)
    matrix = dynamical_matrix(landscape, state, Scope(force=True))
    strong = dynamical_matrix(landscape, state, Scope(force=True, least_force=WEAK))
    found = spectrum(matrix)
    own = ~found.is_translation
    force = matrix.contacts["bond_force"]
    force = force[force > 0] / matrix.bond_force
    weak = force < WEAK
    part = parts_of(matrix, found)
    return {
        "z": matrix.z,
        "z_without_weak": 2 * float((~weak).sum()) / matrix.n_particles,
        "phi_J": file.number("phi_J"),
        "n_negative": float((found.sign[own] < 0).sum()),
        **part,
        "low_without_weak": parts_of(strong, spectrum(strong))["low"],
        "n_falling": float(n_falling(landscape, state, matrix, found)),
        "weak_forces": float(weak.mean()),
        "median_weak": float(np.median(force[weak])) if weak.any() else 0.0,
        "largest_weak": float(force[weak].max(initial=0.0)),
        "least_other": float(force[~weak].min()),
        "force_spread": float(force[~weak].std() / force[~weak].mean()),
        "wall_seconds": file.number("wall_seconds"),
    }


def pairs_of(files: list[PackingFile]) -> dict[tuple[Any, ...], Pair]:
    """Measure those that there are of both sorts."""
    known: dict[tuple[Any, ...], dict[bool, PackingFile]] = {}
    for file in files:
        key = (file.system(), *(file.number(name) for name in ("n", "u0", "seed")))
        known.setdefault(key, {})[bool(file.attributes.get("strict", False))] = file
    both = {key: found for key, found in known.items() if len(found) == 2}
    if not both:
        msg = (
            f"{len(files)} packings, none of which is there with --strict and without, expected so"
        )
        raise ValueError(msg)
    return {
        key: Pair(numbers_of(found[False]), numbers_of(found[True])) for key, found in both.items()
    }


def main(options: Namespace) -> int:
    """Compare; return the exit code."""
    pairs = pairs_of(finished(options.packings))
    for (_, n, u0, seed), pair in sorted(pairs.items(), key=lambda item: item[0][1:]):
        for sort, numbers in pair._asdict().items():
            told = ", ".join(f"{name} {numbers[name]:.6g}" for name in NUMBERS)
            print(f"N {n:g}, u0 {u0:g}, seed {seed:g}, {sort}: {told}")
    told_of: dict[str, Any] = {"n_pairs": len(pairs)}
    for name in NUMBERS:
        plain, strict = (np.array([pair[k][name] for pair in pairs.values()]) for k in (0, 1))
        rows = {"plain": plain, "strict": strict, "change": strict - plain}
        told_of[name] = {sort: mean(row)._asdict() for sort, row in rows.items()}
    report(told_of)
    return 0


if __name__ == "__main__":
    run(parser(), main)
