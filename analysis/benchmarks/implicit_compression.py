"""Core seconds of an implicit compression through jamming, starting from a state that was compressed faster.

    python analysis/benchmarks/implicit_compression.py --n 1024 --tolerances 1e-2 1e-3
    python analysis/benchmarks/implicit_compression.py --n 256 --alpha 0.01 --phi-start 0.834 --phi-end 0.85

    python analysis/benchmarks/implicit_compression.py --dimension 3 --n 256 --alpha 1 --phi-start 0.67 --phi-end 0.69 --explicit

The start is made once, and kept: a random packing is compressed in LAMMPS to 0.05 below it, and from there at a rate
of 1e-6. What is timed are the steps from it to the end, in one process with one thread, by the seconds in which the
processor was busy; what files and the minimisations of `jamshape slow` at its end take is not in them. With --explicit
a row of rkc2 in LAMMPS follows, from the same start. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import time
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

import jamshape as js
from jamshape.command import parser_of, report, run
from jamshape.files.h5md import read_packing
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.flow.implicit import METHODS, Flow, Protocol, compress
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape
from jamshape.packing import Packing, State

RATE_BEFORE, TOLERANCE_BEFORE = 1e-6, 1e-2
TOLERANCE_EXPLICIT, ROWS_EXPLICIT = 1e-4, 40
COUNTS = ("step", "rejected", "evaluations", "factorisations")


def parser() -> ArgumentParser:
    """Make the parser."""
    found = parser_of(__doc__)
    add = found.add_argument
    add("--alpha", type=float, default=4.0, help="length of the sides over the diameter (4)")
    add("--n", type=int, default=256, help="particles (256)")
    add("--kappa", type=float, default=1e-8, help="rate (1e-8)")
    add("--phi-start", type=float, default=0.85, help="packing fraction from where it holds (0.85)")
    add("--phi-end", type=float, default=0.87, help="packing fraction to reach (0.87)")
    add("--tolerances", type=float, nargs="+", default=[1e-3], help="of one run each (1e-3)")
    add("--dimension", type=int, choices=(2, 3), default=2)
    add("--explicit", action="store_true", help="also rkc2 in LAMMPS, at the tolerance 1e-4")
    add("--method", choices=METHODS, default="tr-bdf2")
    add("--seed", type=int, default=1, help="of the random start (1)")
    add("--out", type=Path, default=Path("runs/implicit_compression"), help="folder for the start")
    return found


def main(options: Namespace) -> None:
    """Run with each tolerance, print the table."""
    start = start_of(options)
    print("| tolerance | steps | rejected | evaluations | factorisations | core s | p at the end |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    rows = []
    for tolerance in options.tolerances:
        row = timed(start, options, tolerance)
        counts = " | ".join(str(row[name]) for name in COUNTS)
        told = f"| {tolerance:g} | {counts} | {row['core_seconds']:.3g} | {row['pressure']:.5g} |"
        print(told, flush=True)
        rows.append(row)
    if options.explicit:
        row = timed_explicit(start, options)
        print(f"| rkc2 | | | {row['evaluations']:.0f} | | {row['core_seconds']:.3g} | {row['pressure']:.5g} |")  # fmt: skip
        rows.append(row)
    of = {
        name: getattr(options, name)
        for name in ("alpha", "n", "dimension", "kappa", "phi_end", "seed")
    }
    report({**of, "phi_start": start.phi, "rows": rows})


def start_of(options: Namespace) -> Packing:
    """Make the state where the rate begins to hold, once."""
    options.out.mkdir(parents=True, exist_ok=True)
    rods, phi = js.Spherocylinders(alpha=options.alpha), options.phi_start
    space = "_3D" if options.dimension == 3 else ""
    name = f"start_{options.alpha:g}_{options.n}{space}_{phi:g}_{options.seed}.h5"
    js.slow_compress(
        rods,
        n=options.n,
        dimension=options.dimension,
        phi=(phi - 0.05, phi),
        kappa=RATE_BEFORE,
        integration_tolerance=TOLERANCE_BEFORE,
        seed=options.seed,
        file=options.out / name,
    )
    return read_packing(options.out / name)


def timed(start: Packing, options: Namespace, tolerance: float) -> dict[str, Any]:
    """Compress; what it counts, and seconds of a core."""
    protocol = Protocol(options.kappa, options.phi_end, tolerance=tolerance, method=options.method)
    began = time.process_time()
    end = list(compress(Landscape(start), Flow(State.of(start)), protocol))[-1]
    seconds = time.process_time() - began
    row = {name: getattr(end, name) for name in (*COUNTS, "pressure")}
    return {"tolerance": tolerance, **row, "core_seconds": seconds}


def timed_explicit(start: Packing, options: Namespace) -> dict[str, Any]:
    """Compress by rkc2; evaluations, the pressure at the end, and seconds of a core."""
    rkc2: dict[str, Any] = {"sides": 2, "integrator": "rkc2", "tolerance": TOLERANCE_EXPLICIT}
    settings = Compression(kappa=options.kappa, phi_end=options.phi_end, **rkc2)
    with Session() as session:
        began = time.process_time()
        steps = settings.in_steps(start.phi, ROWS_EXPLICIT, start.dimension)
        made = CompressionRun(session, steps, start)
        made.advance(made.last_step)
        found = made.measure()
        seconds = time.process_time() - began
    row = {name: found[name] for name in ("evaluations", "pressure")}
    return {"tolerance": TOLERANCE_EXPLICIT, **row, "core_seconds": seconds}


if __name__ == "__main__":
    run(parser(), main)
