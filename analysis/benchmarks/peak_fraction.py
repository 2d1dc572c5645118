"""Fraction of a core's peak arithmetic and memory bandwidth that force evaluations reach.

    python analysis/benchmarks/peak_fraction.py
    python analysis/benchmarks/peak_fraction.py --shape spherocylinder --phi 0.86 --tiles 8

Operations are counted, not sampled: the deck of `benchmark_pair.py --measure force` runs under valgrind, twice with
different numbers of evaluations, and the difference is what evaluations do. Its tool lackey counts arithmetic and
logical operations on doubles, one for each lane of a pack, comparisons and selections too; its tool cachegrind
counts lines of 64 bytes that the last cache, simulated as that of this machine, has to fetch. Seconds are those of the same
deck without valgrind. What a core can do is measured by NumPy: a product of two matrices by BLAS, and a copy of
an array that is larger than the caches, which reads and writes. The last line of output is one JSON object.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pair_styles.decks import Bench, run_deck, state, write_deck
from pair_styles.table import BENCHES

from jamshape.command import parser_of, report, run
from jamshape.lammps.plugin import plugin_path

# Lanes of doubles by the types of valgrind.
_LANES = {"F64": 1, "V128": 2, "V256": 4}
_LINE = 64
_SHORT, _LONG = 2, 12
_SECONDS = 1.0


class Work(NamedTuple):
    """Work of evaluations."""

    operations: float
    """On doubles."""
    bytes_of_memory: float


class Machine(NamedTuple):
    """Peak performance of one core."""

    operations: float
    """A second."""
    bytes_of_memory: float
    """A second, read and written."""


def machine() -> Machine:
    """Measure what a core can do."""
    n, m = 1500, 30_000_000
    a, b = np.ones((n, n)), np.ones((n, n))
    source, copy = np.ones(m), np.ones(m)
    product = _fastest(lambda: a @ b)
    copied = _fastest(lambda: np.copyto(copy, source))
    return Machine(2.0 * n**3 / product, 16.0 * m / copied)


def _fastest(does: Callable[[], object]) -> float:
    """Return the seconds of the fastest of several calls."""
    found = []
    for _ in range(7):
        began = time.perf_counter()
        does()
        found.append(time.perf_counter() - began)
    return min(found)


def counted(deck: Path, tiles: int) -> Work:
    """Count what one evaluation needs, of all particles."""
    less, more = (_total(deck, steps, tiles) for steps in (_SHORT, _LONG))
    each = (np.array(more) - np.array(less)) / (_LONG - _SHORT)
    return Work(*map(float, each))


def _total(deck: Path, steps: int, tiles: int) -> Work:
    operations = 0
    for kind, alu in re.findall(
        r"(\w+) +[\d,]+ +[\d,]+ +([\d,]+)$", _under("lackey", deck, steps, tiles), re.MULTILINE
    ):
        operations += _LANES.get(kind, 0) * _number(alu)
    missed = re.search(r"LLd misses: +([\d,]+)", _under("cachegrind", deck, steps, tiles))
    if not operations or not missed:
        msg = f"valgrind counted no operations of {deck}, expected lackey's and cachegrind's tables"
        raise RuntimeError(msg)
    return Work(operations, _LINE * _number(missed[1]))


def _number(text: str) -> int:
    return int(text.replace(",", ""))


def _under(tool: str, deck: Path, steps: int, tiles: int) -> str:
    """Run a deck under a tool of valgrind and return what that says."""
    options = {
        "lackey": ["--detailed-counts=yes"],
        "cachegrind": ["--cache-sim=yes", "--cachegrind-out-file=/dev/null"],
    }
    said = deck.with_suffix(f".{tool}.txt")
    command = ["valgrind", f"--tool={tool}", *options[tool], f"--log-file={said}"]
    command += ["lmp", "-in", str(deck), "-log", "none", "-nocite"]
    command += ["-var", "steps", str(steps), "-var", "tiles", str(tiles)]
    environment = os.environ | {"JAMSHAPE_PLUGIN": str(plugin_path()), "OMP_NUM_THREADS": "1"}
    subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=True)
    return said.read_text()


def measured(options: Namespace, bench: Bench, phi: float, name: str) -> dict[str, float | str]:
    """Count and time one of our styles on one state."""
    n = options.n or bench.n[0]
    packing = state(options.work, bench, bench.cases[0].particles, phi, n)
    deck = options.work / f"peak_{name}_{phi:g}_{n}.lmp"
    write_deck(deck, bench, bench.styles[name], "force", packing)
    work = counted(deck, options.tiles)
    n *= options.tiles**bench.dimension
    timed = partial(run_deck, deck, plugin_path(), tiles=options.tiles)
    steps = int(_SECONDS * timed(50).rate / n) + 1
    seconds = float(np.median([n / timed(steps).rate for _ in range(5)]))
    can: Machine = options.machine
    return {
        "style": name,
        "phi": phi,
        "N": n,
        "operations a particle": work.operations / n,
        "bytes of memory a particle": work.bytes_of_memory / n,
        "microseconds": 1e6 * seconds,
        "of the peak": work.operations / seconds / can.operations,
        "of the bandwidth": work.bytes_of_memory / seconds / can.bytes_of_memory,
    }


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__)
    add = found.add_argument
    add("--shape", choices=BENCHES, default=next(iter(BENCHES)), help="(%(default)s)")
    add("--phi", nargs="+", type=float, help="packing fractions (the densest of the shape's)")
    add("--n", type=int, help="particles (usual for the shape)")
    add("--tiles", type=int, default=1, help="copies of the state along each edge (1)")
    add(
        "--work",
        type=Path,
        default=Path("runs/peak"),
        help="folder of states and decks (%(default)s)",
    )
    return found


def main(options: Namespace) -> None:
    """Measure, and print a table."""
    if shutil.which("valgrind") is None:
        msg = "valgrind was not found, expected it on the path; install the package valgrind"
        raise FileNotFoundError(msg)
    options.work.mkdir(parents=True, exist_ok=True)
    can = options.machine = machine()
    print(
        f"a core: {can.operations:.3g} operations, {can.bytes_of_memory:.3g} bytes of memory a second"
    )
    bench = BENCHES[options.shape]
    ours = [name for name, style in bench.styles.items() if style.is_ours]
    densest = bench.cases[0].phi[-1:]
    found = [measured(options, bench, phi, name) for phi in options.phi or densest for name in ours]
    print("| " + " | ".join(found[0]) + " |\n" + "| --- " * len(found[0]) + "|")
    for row in found:
        cells = (f"{v:.3g}" if isinstance(v, float) else str(v) for v in row.values())
        print("| " + " | ".join(cells) + " |")
    report({"machine": can._asdict(), "rows": found})


if __name__ == "__main__":
    run(parser(), main)
