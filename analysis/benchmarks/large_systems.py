"""Seconds and peak memory of large systems: the random start, 100 steps on one rank and on two, a restart.

    python analysis/benchmarks/large_systems.py --rods 100000 1000000 --superellipsoids 10000 100000
    python analysis/benchmarks/large_systems.py --rods 10000 --superellipsoids

Rods have alpha = 4 and phi = 0.4 in the plane, superellipsoids p = 1.5 and phi = 0.2 in space. The start is
one call of `jamshape initial`, its data file included. Steps are those of fix overdamped/affine with heun, while
the box shrinks; the process of the stock `lmp` is timed as a whole, with the reading of the state and the
writing of a restart file, from which the last process goes on for 100 steps more. Memory is the peak
resident set of a process, with two ranks that of the larger one.

Beside the seconds of a clock stand those in which processors were busy, which other work on the machine changes
less. Writes a table; the last line of standard output is one JSON object.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from jamshape.command import parser_of, report, run
from jamshape.lammps.plugin import load_script_path, plugin_path
from jamshape.protocols.random_start import dilute_packing
from jamshape.shapes.particles import Particles
from jamshape.shapes.shape import Interaction

STEPS = 100
# A process counts the memory of the one that it was forked from: this one is small. What it waits for, such as
# the ranks of mpirun, is counted, too, in kB.
LAUNCHER = """
import os, sys
_, status, usage = os.wait4(os.posix_spawnp(sys.argv[1], sys.argv[1:], os.environ), 0)
print(usage.ru_utime + usage.ru_stime, usage.ru_maxrss)
sys.exit(os.waitstatus_to_exitcode(status) != 0)
"""
ROOT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}


class System(NamedTuple):
    """Particles of a kind."""

    name: str
    dimension: int
    particles: Particles
    options: str
    """Options of the command that makes the start, without the number of particles."""
    dt: float


SYSTEMS = (
    System("rods", 2, Particles.of(alpha=4.0), "--alpha 4 --phi 0.4", 0.05),
    System(
        "superellipsoids",
        3,
        Particles.of("superellipsoid", exponent=1.5),
        "--shape superellipsoid --p 1.5 --w1 1 --w2 1 --phi 0.2",
        0.05,
    ),
)


class Cost(NamedTuple):
    """Cost of one process."""

    seconds: float
    busy: float
    """Seconds of a processor, those in which a rank waits for the other one included."""
    megabytes: float


class Row(NamedTuple):
    """One line of the table."""

    system: str
    n: int
    part: str
    seconds: float
    busy: float
    megabytes: float


def cost_of(command: list[str], log: Path) -> Cost:
    """Run a command to its end.

    Raises
    ------
    RuntimeError
        With its last words, if it fails.
    """
    more = {"OMP_NUM_THREADS": "1", "JAMSHAPE_PLUGIN": str(plugin_path())}
    environment = os.environ | ROOT | more
    began = time.perf_counter()
    with log.open("w") as file:
        launched = [sys.executable, "-I", "-S", "-c", LAUNCHER, *command]
        code = subprocess.run(launched, env=environment, stdout=file, stderr=file, check=False)
    seconds, said = time.perf_counter() - began, log.read_text()
    if code.returncode:
        msg = f"'{' '.join(command)}' failed, its last words:\n{said[-999:]}"
        raise RuntimeError(msg)
    busy, kilobytes = map(float, said.split()[-2:])
    return Cost(seconds, busy, kilobytes / 1e3)


def write_deck(path: Path, system: System, data: Path, *, restart: Path | None = None) -> None:
    """Write a deck that goes from a data file, or from a restart file, so many steps."""
    two = dilute_packing(2, 0.1, 1, system.particles, system.dimension)
    pair = two.shape.style(two, Interaction(1.0, 1)).commands
    begin = f"units lj\ndimension {system.dimension}\natom_style ellipsoid\n"
    state = f'read_restart "{restart}"' if restart else f'{begin}read_data "{data}"'
    path.write_text(
        f'include "{load_script_path()}"\n{state}\n{pair}\nneighbor 0.3 bin\n'
        "neigh_modify every 1 delay 0 check yes one 10000 page 1000000\n"
        "fix flow all overdamped/affine drag 1 compress 1e-4 integrator heun\n"
        f"timestep {system.dt}\nthermo {STEPS}\nrun {STEPS}\n"
        + ("" if restart else f'write_restart "{data.with_suffix(".restart")}"\n')
    )


def measured(system: System, n: int, work: Path) -> Iterator[Row]:
    """Go through all parts of one system."""
    data = work / f"{system.name}_{n}.data"
    told = [*system.options.split(), "--n", str(n), "--dimension", str(system.dimension)]
    initial = [sys.executable, "-m", "jamshape", "initial", *told, "--out", str(data)]
    yield Row(system.name, n, "start", *cost_of(initial, data.with_suffix(".log")))
    deck, on = data.with_suffix(".in"), data.with_suffix(".on.in")
    write_deck(deck, system, data)
    write_deck(on, system, data, restart=data.with_suffix(".restart"))
    two = ["mpirun", "--oversubscribe", "-np", "2"]
    for part, before, path in (
        (f"{STEPS} steps", [], deck),
        (f"{STEPS} steps, two ranks", two, deck),
        (f"restart, {STEPS} steps", [], on),
    ):
        lmp = [*before, "lmp", "-nocite", "-log", "none", "-in", str(path)]
        yield Row(system.name, n, part, *cost_of(lmp, data.with_suffix(".log")))


def markdown(rows: list[Row]) -> str:
    """Draw a table, a line for each system."""
    parts = list(dict.fromkeys(row.part for row in rows))
    text = f"| | {' | '.join(f'{part}: s (CPU), GB' for part in parts)} |\n{'| --- ' * (1 + len(parts))}|\n"
    for name, n in dict.fromkeys((row.system, row.n) for row in rows):
        cells = [
            f"{row.seconds:.3g} ({row.busy:.3g}), {row.megabytes / 1e3:.2g}"
            for row in rows
            if (row.system, row.n) == (name, n)
        ]
        text += f"| {n:.0e} {name} | {' | '.join(cells)} |\n".replace("e+0", "e")
    return text


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/large_systems")
    found.add_argument("--rods", type=int, nargs="*", default=[100_000], help="(1e5)")
    found.add_argument("--superellipsoids", type=int, nargs="*", default=[10_000], help="(1e4)")
    return found


def main(options: Namespace) -> None:
    """Measure, and write the table."""
    options.out.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    for system in SYSTEMS:
        for n in getattr(options, system.name):
            for row in measured(system, n, options.out.resolve()):
                print(*row, file=sys.stderr, flush=True)
                rows.append(row)
    (options.out / "large_systems.md").write_text(markdown(rows))
    print(markdown(rows))
    report({"out": options.out, "rows": rows})


if __name__ == "__main__":
    run(parser(), main)
