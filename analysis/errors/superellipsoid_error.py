"""Errors of contacts of superellipsoids with touching faces, edges or tips, against a solution in 33 digits.

    python analysis/errors/superellipsoid_error.py --n 1000000 --out runs/superellipsoid_error

Targeted pairs, in the plane and in space: a face, an edge or a tip of one on one of the other, tilted and twisted by
nothing or by 1e-13 to 1e-2, centres shifted along each other by nothing, a little or much, overlaps of 1e-10 to 1e-2,
exponents of 0.55 to 10, equal or not, and equal or unequal semi-axes. `errors/reference/superellipsoids.cpp`, which
is compiled with g++, solves each of them from the same bits in 33 digits; `--judged` of them are solved once more by
mpmath in 60 digits, as what they are in another formulation: the normal that minimises the sum of the widths.

Counts the pairs whose energy, force or torque is off by more than the error that is stated for it, in doubles and in long
doubles (there must be none), and those that are off by more than 1e-12 and state less. A torque counts over force and
largest semi-axis. Work is done in blocks that are kept: the same command goes on where it was ended; `--seconds` ends it.
Writes a table (Markdown) and the numbers (JSON). The last line of standard output is one JSON object.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from studies.shown import markdown
from studies.touching import Couples, targeted_pairs
from tqdm import tqdm

from jamshape.arrays import FloatArray, LongArray
from jamshape.command import parser_of, report, run
from jamshape.shapes.single_pairs import superellipsoid_contacts

HERE = Path(__file__).parent
SOURCES = HERE.parents[1] / "lammps_plugin"
BLOCK = 5000
_COLUMNS_OF_P = 11  # in 3D
SAID = 1e-12
NAMES = ("energy", "force", "torque")
PRECISIONS = {"double": False, "long double": True}
HEADS = ("evaluated in", "pairs", "of", "median error", "99.9 %", "largest", "largest stated",
         "largest error over stated", "median stated over error", "beyond stated",
         "beyond 1e-12 unsaid")  # fmt: skip


def compiled(folder: Path) -> Path:
    """Compile the reference there.

    Raises
    ------
    FileNotFoundError
        If there is no g++.
    """
    compiler = shutil.which("g++")
    if compiler is None:
        msg = "no g++ was found, which compiles the reference; install it"
        raise FileNotFoundError(msg)
    program = folder / "superellipsoids"
    options = ["-std=gnu++17", "-O1", "-fext-numeric-literals", f"-I{SOURCES}"]
    source = HERE / "reference" / "superellipsoids.cpp"
    subprocess.run([compiler, *options, source, "-o", program, "-lquadmath"], check=True)
    return program


@dataclass(frozen=True)
class Contacts:
    """Energy (M,), force (M, D) and both torques (M, 2, 1 or 3) of M pairs, and errors (M, 3) of these."""

    energy: LongArray
    force: LongArray
    torque: LongArray
    errors: FloatArray

    def units(self, couples: Couples) -> FloatArray:
        """(M, 3) energies, forces and torques that count as 1."""
        force = np.sqrt((self.force**2).sum(axis=1))
        columns = [self.energy, force, force * couples.largest_axis]
        return np.asarray(np.stack(columns, 1), float)

    def off(self, other: Contacts) -> FloatArray:
        """(M, 3) how far energy, force and torque are from others."""
        torque = np.sqrt(((self.torque - other.torque) ** 2).sum(axis=2)).max(axis=1)
        force = np.sqrt(((self.force - other.force) ** 2).sum(axis=1))
        columns = [np.abs(self.energy - other.energy), force, torque]
        return np.asarray(np.stack(columns, 1), float)


def contacts_of(couples: Couples, *, extended: bool) -> tuple[Contacts, FloatArray]:
    """Evaluate pairs by the library; also (M, 2 D) the normals and points that it found.

    Raises
    ------
    ValueError
        If a pair does not touch.
    """
    found = superellipsoid_contacts(couples.i, couples.j, 1.0, extended, errors=True)
    if (found["status"] != 1).any():
        msg = "a pair was found not to touch, expected overlaps above 1e-10; report this as a bug"
        raise ValueError(msg)
    torque = np.stack([found["torque_i"], found["torque_j"]], 1)
    errors = np.stack([found[f"{name}_error"] for name in NAMES], 1)
    energy, force, torques = (
        np.asarray(x, np.longdouble) for x in (found["energy"], found["force"], torque)
    )
    begin = np.hstack([found["bond_normal"][:, 0], found["bond_arm_i"][:, 0]])
    return Contacts(energy, force, torques, errors), begin


def reference(program: Path, couples: Couples, begin: FloatArray) -> Contacts:
    """Solve pairs in 33 digits, from normals and points beside the solution."""
    D = couples.dimension
    rows = [_with_two_exponents(rows) for rows in (couples.i, couples.j)]
    pairs = np.ascontiguousarray(np.hstack([*rows, begin]))
    done = subprocess.run(
        [program, str(D)], input=pairs.tobytes(), stdout=subprocess.PIPE, check=True
    )
    numbers = np.frombuffer(done.stdout).reshape(len(pairs), -1)
    split = numbers[:, :-3].reshape(len(pairs), -1, 2).astype(np.longdouble).sum(axis=2)
    force, torque = split[:, 1 : 1 + D], split[:, 1 + D :].reshape(len(pairs), 2, -1)
    return Contacts(split[:, 0], force, torque, numbers[:, -3:])


def _with_two_exponents(rows: FloatArray) -> FloatArray:
    """Rows of bodies in 3D with n1 = n2 = 2p in place of p."""
    if rows.shape[1] != _COLUMNS_OF_P:
        return rows
    return np.hstack([rows[:, :-1], np.repeat(2 * rows[:, -1:], 2, axis=1)])


@dataclass(frozen=True)
class Measured:
    """Errors (M, 3) of contacts over their units, those that they state, and those of the reference."""

    error: FloatArray
    stated: FloatArray
    doubt: FloatArray

    @property
    def beyond(self) -> Any:
        """(M, 3) whether an error is larger than stated."""
        return self.error > self.stated + self.doubt

    @property
    def unsaid(self) -> Any:
        """(M, 3) whether an error is above 1e-12 and larger than stated."""
        return self.beyond & (self.error - self.doubt > SAID)


def measured(program: Path, couples: Couples) -> dict[str, Measured]:
    """Evaluate pairs in both precisions and hold them against the reference."""
    found = {name: contacts_of(couples, extended=wide) for name, wide in PRECISIONS.items()}
    exact = reference(program, couples, found["long double"][1])
    units = exact.units(couples)
    return {
        name: Measured(of.off(exact) / units, of.errors / units, exact.errors / units)
        for name, (of, _) in found.items()
    }


def blocks(options: Namespace) -> Iterator[tuple[Path, int]]:
    """List the file of each block that is not done, and its number."""
    for k in range(-(-options.n // BLOCK)):
        kept = options.out / f"block{k}.npz"
        if not kept.exists():
            yield kept, k


def work(options: Namespace) -> None:
    """Do the blocks that are missing, until the time is over."""
    began = time.monotonic()
    program = compiled(options.out)
    for kept, k in tqdm(list(blocks(options)), unit="block"):
        if time.monotonic() - began > options.seconds:
            break
        couples = targeted_pairs(np.random.default_rng([options.seed, k]), BLOCK, 2 + k % 2)
        arrays = {
            f"{name} {of}": getattr(m, of).astype(np.float32)
            for name, m in measured(program, couples).items()
            for of in ("error", "stated", "doubt", "beyond", "unsaid")
        }
        partial = kept.with_suffix(".part.npz")
        np.savez(partial, **arrays)
        partial.rename(kept)


def rows(options: Namespace) -> list[dict[str, Any]]:
    """Sum up what is done."""
    done = [np.load(path) for path in sorted(options.out.glob("block*[0-9].npz"))]
    found = []
    for name in PRECISIONS:
        of = {
            key: np.concatenate([block[f"{name} {key}"] for block in done])
            for key in ("error", "stated", "doubt", "beyond", "unsaid")
        }
        for k, quantity in enumerate(NAMES):
            error, stated = of["error"][:, k], of["stated"][:, k]
            decided = of["doubt"][:, k] < 0.1 * stated
            found.append(
                {
                    "precision": name,
                    "pairs": len(error),
                    "quantity": quantity,
                    "median": float(np.median(error)),
                    "of_1000": float(np.quantile(error, 0.999)),
                    "largest": float(error.max()),
                    "largest_stated": float(stated.max()),
                    "largest_ratio": float((error / stated)[decided].max()),
                    "median_ratio": float(np.median(stated / np.maximum(error, 1e-30))),
                    "undecided": int((~decided).sum()),
                    "beyond": int(of["beyond"][:, k].sum()),
                    "unsaid": int(of["unsaid"][:, k].sum()),
                }
            )
    return found


def table(found: list[dict[str, Any]]) -> str:
    """Write the rows as Markdown."""
    cells = [
        (r["precision"], str(r["pairs"]), r["quantity"], f"{r['median']:.1e}",
         f"{r['of_1000']:.1e}", f"{r['largest']:.1e}", f"{r['largest_stated']:.1e}",
         f"{r['largest_ratio']:.2f}", f"{r['median_ratio']:.2f}", str(r["beyond"]),
         str(r["unsaid"]))
        for r in found
    ]  # fmt: skip
    return markdown(HEADS, cells)


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/superellipsoid_error")
    found.add_argument("--n", type=int, default=1_000_000, help="pairs, in blocks of 5000")
    found.add_argument("--seconds", type=float, default=1e9, help="begin no block after these")
    found.add_argument("--judged", type=int, default=200, help="pairs that mpmath solves as well")
    found.add_argument("--seed", type=int, default=1)
    return found


def main(options: Namespace) -> None:
    """Measure, judge the reference, report."""
    from studies.judge import judged  # noqa: PLC0415 - mpmath takes a while

    options.out.mkdir(parents=True, exist_ok=True)
    work(options)
    found = rows(options)
    text = table(found)
    program = options.out / "superellipsoids"
    rng = np.random.default_rng([options.seed, 2**20])
    judgement = {}
    for D in (2, 3):
        couples = targeted_pairs(rng, options.judged // 2, D)
        exact = reference(program, couples, contacts_of(couples, extended=True)[1])
        judgement[f"{D}D"] = judged(couples, exact)
    (options.out / "superellipsoid_error.md").write_text(text)
    (options.out / "superellipsoid_error.json").write_text(
        json.dumps({"rows": found, "judged": judgement}, indent=1)
    )
    print(text)
    print(judgement)
    report(
        {
            "out": options.out,
            "pairs": found[0]["pairs"],
            "beyond": sum(r["beyond"] for r in found),
            "unsaid": sum(r["unsaid"] for r in found),
            "judged": judgement,
        }
    )


if __name__ == "__main__":
    run(parser(), main)
