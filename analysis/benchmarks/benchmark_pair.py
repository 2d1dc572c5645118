"""Cost of jamshape's pair styles and of LAMMPS's own for similar particles, on the same states.

    python analysis/benchmarks/benchmark_pair.py --quick
    python analysis/benchmarks/benchmark_pair.py --shape superellipsoid --quick
    python analysis/benchmarks/benchmark_pair.py --only ours-one --phi 0.86 --n 1024 --measure force
                                                 --against AN_OLDER_jamshape_plugin.so

Rods: ours-one, ours-two: spherocylinder/harmonic; polygon: body/rounded/polygon with the same centres,
angles, spines and radii; wca: lj/cut discs with sigma = R_i + R_j at the same N and phi.
Dimers: ours and wca. Superellipsoids: ours; gayberne and resquared with the same centres, orientations and axes, and a cutoff
of the longest diameter, so that no contact is out of reach; granular, if it is named, with the same exponents as well:
granular/superellipsoid, for which LAMMPS must be of 30Mar2026 or newer, without friction and damping.

  force   `run M` without integrator: each step is one force evaluation on a kept neighbour list;
          a contact that is sought by iteration is found where it was
  nve     rods: under each atom style's fix nve, superellipsoids: flying on straight lines, about
          1e-3 a step; the list checked: LAMMPS's cost of any step
  step    the whole compression step, lists rebuilt as needed: two evaluations, box, drag, rotation;
          in turns with `force` on the same state, so that a step is told in evaluations
  memory  slope of the peak resident set against N (a state replicated along its edges), integrator
          and rebuilt lists included; program, libraries and Python are in the intercept

Larger systems are copies of a state side by side: --n 1024 --tiles 8 is 65536 particles.

Each run is a process of the stock `lmp`, one rank; its deck stays under --work, to be profiled. A
second is one of the loop time, times the share of a core that it got. Styles take turns, ratios are
medians over rounds. Writes a table and JSON; the last line of output is that JSON object.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pair_styles.decks import MEASURES, Bench, Case, Run, run_deck, state, write_deck
from pair_styles.table import BENCHES
from tqdm import tqdm

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, plain, report, run
from jamshape.lammps.plugin import plugin_path

Row = dict[str, Any]

CALIBRATION = 50
LIGHT = "bytes each"
ALONE = "evaluation of {}"


class At(NamedTuple):
    """Conditions under which styles are compared."""

    measure: str
    case: Case
    phi: float
    n: int
    tiles: int = 1
    """Copies along each edge that these particles are; not of the memory, which has its own."""

    @property
    def row(self) -> Row:
        """First columns of a row of the table."""
        return {"measure": self.measure, "case": self.case.name, "phi": self.phi, "N": self.n}


def runs_of(options: Namespace, bench: Bench, at: At) -> dict[str, Callable[..., Run]]:
    """Make what can be run on one state."""
    found: dict[str, Callable[..., Run]] = {}
    for name, style in bench.styles.items():
        if name not in options.only or (at.measure == "step" and not style.is_ours):
            continue
        particles = style.instead or at.case.particles
        n = at.n // at.tiles**bench.dimension
        packing = state(options.work, bench, particles, at.phi, n)
        for measure in ("step", "force") if at.measure == "step" else (at.measure,):
            tag = re.sub(r"[^\w.]+", "_", f"{name}_{measure}_{at.case.name}_{at.phi:g}_{n}")
            deck = options.work / f"{tag}.lmp"
            write_deck(deck, bench, style, measure, packing)
            called = name if measure == at.measure else ALONE.format(name)
            found[called] = partial(run_deck, deck, plugin_path(), tiles=at.tiles)
            if style.is_ours and options.against:
                found[f"{called} before"] = partial(run_deck, deck, options.against, tiles=at.tiles)
    return found


def rates(options: Namespace, bench: Bench, at: At) -> Iterator[Row]:
    """Time the styles in turn on one state."""
    runs, steps = runs_of(options, bench, at), {}
    for name, go in runs.items():
        wanted = int(options.seconds * go(CALIBRATION).rate / at.n) + 1
        steps[name] = min(wanted, bench.most_steps.get(at.measure, wanted))
    turns = tqdm(list(runs) * options.rounds, desc=" ".join(map(str, at.row.values())))
    found = [(name, runs[name](steps[name])) for name in turns]
    rate = {name: np.array([go.rate for who, go in found if who == name]) for name in runs}
    for name in runs:
        share = np.median([go.core_share for who, go in found if who == name])
        row = {**at.row, "style": name, "steps": steps[name], "core share": share}
        row["particle-steps/s"] = np.median(rate[name])
        yield row | compared(bench, rate, name)


def compared(bench: Bench, rate: dict[str, FloatArray], name: str) -> Row:
    """Give a style's speed over those of others, and its cost."""
    found: Row = {}
    for column, other in bench.faster_than.items():
        if other in rate:
            found[column] = np.median(rate[name] / rate[other])
    for column, other in bench.dearer_than.items():
        if other in rate:
            found[column] = np.median(rate[other] / rate[name])
    if ALONE.format(name) in rate:
        found["in evaluations"] = np.median(rate[ALONE.format(name)] / rate[name])
    if f"{name} before" in rate:
        found["speed over before"] = np.median(rate[name] / rate[f"{name} before"])
    return found


def memory(options: Namespace, bench: Bench, at: At) -> Iterator[Row]:
    """Fit bytes a particle; `+-` is the largest distance from the line over the range of N."""
    for name, go in tqdm(runs_of(options, bench, at).items(), desc="memory"):
        N, peak = np.array([go(20, tiles=k)[:2] for k in bench.tiles]).T
        line = np.polyfit(N, peak, 1)
        off = np.abs(np.polyval(line, N) - peak).max() / np.ptp(N)
        row = at.row | {"N": f"{N[0]:.0f} to {N[-1]:.0f}", "style": name}
        yield row | {LIGHT: line[0], "+-": off}


def markdown(rows: list[Row]) -> str:
    """Draw a table."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    cells = [[row.get(name, "") for name in names] for row in rows]
    text = [[f"{c:.3g}" if isinstance(c, float) else str(c) for c in line] for line in cells]
    return "".join(f"| {' | '.join(line)} |\n" for line in [names, ["---"] * len(names), *text])


def about() -> Row:
    """Machine, version, date and command."""
    cpu = re.search(r"model name\s*: (.+)", Path("/proc/cpuinfo").read_text())
    text = subprocess.run(["lmp", "-h"], capture_output=True, text=True, check=True).stdout
    version, date = re.search(r"Simulator - (.+)", text), time.strftime("%Y-%m-%d %H:%M %z")
    found = {"machine": cpu and cpu[1], "LAMMPS": version and version[1], "date": date}
    return found | {"command": " ".join(["python", *sys.argv])}


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__)
    add, work = found.add_argument, Path("runs/benchmark")
    styles = {name: style for bench in BENCHES.values() for name, style in bench.styles.items()}
    usual = [name for name, style in styles.items() if style.is_everywhere]
    add("--shape", choices=BENCHES, default=next(iter(BENCHES)), help="(%(default)s)")
    add("--quick", action="store_true", help="the first half of the cases, and one size")
    add("--only", nargs="+", choices=styles, default=usual, help="styles (all but granular)")
    add("--measure", nargs="+", choices=MEASURES, default=list(MEASURES), help="(all)")
    add("--phi", nargs="+", type=float, help="packing fractions (those of the shape's cases)")
    add("--n", nargs="+", type=int, help="particles (usual for the shape)")
    add("--tiles", type=int, default=1, help="copies of each state along each edge (1)")
    add("--rounds", type=int, default=5, help="(5)")
    add("--seconds", type=float, default=1.5, help="of each run (1.5)")
    add("--against", type=Path, help="an older plugin to compare with")
    add("--work", type=Path, default=work, help="folder of states and decks (runs/benchmark)")
    add("--out", type=Path, help="table (runs/benchmark/SHAPE.md)")
    return found


def places(options: Namespace, bench: Bench) -> list[At]:
    """List where styles are compared; memory at the densest of the first size."""
    cases = bench.cases[: -(-len(bench.cases) // 2)] if options.quick else bench.cases
    sizes = options.n or (bench.n[:1] if options.quick else bench.n)
    found = [
        At(measure, case, phi, n * options.tiles**bench.dimension, options.tiles)
        for case in cases
        for phi in options.phi or case.phi
        for n in sizes
        for measure in options.measure
        if measure != "memory"
    ]
    if "memory" in options.measure:
        found += [At("memory", c, (options.phi or c.phi)[-1], sizes[0]) for c in cases]
    return found


def main(options: Namespace) -> None:
    """Measure, and write what was found."""
    bench, out = BENCHES[options.shape], options.out or options.work / f"{options.shape}.md"
    for folder in (options.work, out.parent):
        folder.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    for at in places(options, bench):
        rows += (memory if at.measure == "memory" else rates)(options, bench, at)
    found = about() | {"shape": options.shape, "rows": rows}
    head = "".join(f"{key}: {value}  \n" for key, value in about().items())
    out.write_text(f"{head}\n{markdown(rows)}")
    out.with_suffix(".json").write_text(json.dumps(plain(found)) + "\n")
    print(out.read_text())
    report(found)


if __name__ == "__main__":
    run(parser(), main)
