"""Price of an iteration of the minimiser beside an evaluation of the pair style, on the same states near jamming.

    OPENBLAS_NUM_THREADS=1 python analysis/benchmarks/iteration_cost.py --cases discs rods-1 spheres
    OPENBLAS_NUM_THREADS=1 python analysis/benchmarks/iteration_cost.py --against AN_OLDER/bin/python

Particles at random places are compressed, in steps with a short minimisation each and a longer one at the end, to a state just
beyond the onset of jamming, kept under --work. On it are timed, in nanoseconds of the processor per particle: the pair style in LAMMPS, on a kept
neighbour list; energy and gradient of the compiled local energy model; an iteration of L-BFGS, of 150 from that state,
with everything that belongs to them: pairs, second derivatives and factors from time to time; second derivatives alone, and with
factors; and a solution with those factors. Each round is a process of its own. With --against, an older
version, the Python of another environment, takes turns. Tables give medians over rounds; the iteration is also told in
evaluations of the pair style. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

import jamshape as js
from jamshape.command import parser_of, report, run
from jamshape.files.h5md import read_packing
from jamshape.landscape import Landscape
from jamshape.landscape.local_energy_model import DescentStop, LocalEnergyModel
from jamshape.landscape.newton import LONGEST_STEP, WIDEST_TURN
from jamshape.minima import Stop, minimise
from jamshape.packing import Packing, State
from jamshape.protocols.defaults import recipe_for

ITERATIONS = 150
# Steps of the compression, evaluations of each and of the last minimisation.
STEPS, EVALUATIONS, LAST = 40, 200, 1500


class Case(NamedTuple):
    """Particles, their number, and the packing fraction of the state."""

    particles: str
    n: int
    phi: float


CASES = {
    "discs": Case("js.Spherocylinders(alpha=0)", 1024, 0.842),
    "rods-1": Case("js.Spherocylinders(alpha=1)", 1024, 0.892),
    "rods-4": Case("js.Spherocylinders(alpha=4)", 1024, 0.858),
    "spheres": Case("js.Superellipsoids(p=1, w1=1, w2=1)", 1000, 0.636),
    "spheroids": Case("js.Superellipsoids(p=1, w1=0.6, w2=1)", 400, 0.702),
}

PAIR, EVALUATION, ITERATION = "pair style", "evaluation", "iteration"
DERIVATIVES, FACTORS, SOLUTION = "second derivatives", "with factors", "solution"
WHAT = (PAIR, EVALUATION, ITERATION, DERIVATIVES, FACTORS, SOLUTION)


def parser() -> ArgumentParser:
    """Make the parser."""
    found = parser_of(__doc__)
    add = found.add_argument
    add("--cases", nargs="*", default=list(CASES), choices=list(CASES), help="(all)")
    add("--n", type=int, help="particles (those of each case)")
    add("--rounds", type=int, default=5, help="(5)")
    add("--against", type=Path, help="Python of an older version, which takes turns")
    add("--work", type=Path, default=Path("runs/iteration_cost"), help="folder of states")
    add("--one", type=Path, help="measure this state once and write only JSON")
    return found


def main(options: Namespace) -> None:
    """Measure, and print the table."""
    if options.one:
        print(json.dumps(measured(read_packing(options.one))))
        return
    options.work.mkdir(parents=True, exist_ok=True)
    pythons = {"": Path(sys.executable)} | ({"before": options.against} if options.against else {})
    found = {}
    print(f"| | N | | {' | '.join(WHAT)} | in evaluations of the pair style |")
    print("| --- " * (len(WHAT) + 4) + "|")
    for name in options.cases:
        path = near_jamming(name, options)
        rounds: dict[str, list[dict[str, float]]] = {who: [] for who in pythons}
        for _ in tqdm(range(options.rounds), desc=name):
            for who, python in pythons.items():
                rounds[who].append(by(python, path))
        for who, rows in rounds.items():
            row = {what: float(np.median([one[what] for one in rows])) for what in WHAT}
            times = float(np.median([one[ITERATION] / one[PAIR] for one in rows]))
            cells = " | ".join(f"{row[what]:.3g}" for what in WHAT)
            n = options.n or CASES[name].n
            print(f"| {name} | {n} | {who} | {cells} | {times:.2f} |", flush=True)
            found[f"{name} {who}".strip()] = row | {"iteration over pair style": times}
    report(found)


def near_jamming(name: str, options: Namespace) -> Path:
    """Return the file of a state, made once."""
    case = CASES[name]
    n = options.n or case.n
    path: Path = options.work / f"{name}_{n}.h5"
    if not path.exists():
        packing = recipe_for(eval(case.particles, {"js": js}), n=n, seed=1).start()
        landscape, state = Landscape(packing), State.of(packing)
        for phi in np.linspace(packing.phi, case.phi, STEPS):
            now = state.packing(packing).phi
            state = state.strained(float((now / phi) ** (1 / packing.dimension)) - 1)
            state = minimise(landscape, state, "auto", Stop(evaluations=EVALUATIONS)).state
        state = minimise(landscape, state, "auto", Stop(tolerance=1e-2, evaluations=LAST)).state
        js.save(path, state.packing(packing))
    return path


def by(python: Path, path: Path) -> dict[str, float]:
    """Measure a state once with an interpreter."""
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS")}
    command = [str(python), __file__, "--one", str(path)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=True, env=os.environ | threads
    )
    row: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return row


def measured(packing: Packing) -> dict[str, float]:
    """Nanoseconds per particle of each of `WHAT`."""
    landscape, state = Landscape(packing), State.of(packing)
    local_model = LocalEnergyModel(landscape, state)
    compiled, size = local_model._compiled, landscape.size
    x, none = 1e-6 * np.random.default_rng(1).normal(size=size), np.zeros(size)
    ones, endless = np.ones(size), np.full(size, np.inf)

    def differentiate() -> None:
        with suppress(ValueError):  # such a diagonal ends it before the factors
            compiled.factorise(none, 0.0, endless)

    factors = compiled.factorise(none, 0.0, ones)
    seconds = {
        PAIR: of_pair_style(packing),
        EVALUATION: each(lambda: compiled.evaluate(x, 0.0, False), 400),
        DERIVATIVES: each(differentiate, 40),
        FACTORS: each(lambda: compiled.factorise(none, 0.0, ones), 20),
        SOLUTION: each(lambda: factors.solve(x[None]), 400),
        ITERATION: of_iteration(packing, state),
    }
    return {what: 1e9 * seconds[what] / packing.n for what in WHAT}


def each(work: Callable[[], object], times: int) -> float:
    """Give the median over parts of the seconds of the processor of one call."""
    parts = []
    for _ in range(8):
        began = time.process_time()
        for _ in range(times // 8):
            work()
        parts.append((time.process_time() - began) / (times // 8))
    return float(np.median(parts))


def of_pair_style(packing: Packing, steps: int = 200) -> float:
    """Seconds of an evaluation in LAMMPS."""
    with js.Session() as session:
        session.load(packing)
        session.interact(packing.law)
        session.commands(session.neighbours())
        session.commands("neigh_modify delay 2000000000 every 1 check no\nthermo 0\nrun 0")
        return each(lambda: session.commands(f"run {steps} pre no post no"), 8) / steps


def of_iteration(packing: Packing, state: State) -> float:
    """Seconds of an iteration of L-BFGS, one evaluation each."""
    landscape = Landscape(packing)
    stop = DescentStop(
        tolerance=0.0, lowest=0.0, evaluations=ITERATIONS, seconds=np.inf, rounding=0.0,
        patience=ITERATIONS, newton_below=0.0, is_near=False, longest_step=LONGEST_STEP * 0.5 * landscape.length,
        widest_turn=WIDEST_TURN,
    )  # fmt: skip
    times = []
    for _ in range(5):
        began, before = time.process_time(), landscape.evaluations
        local_model = LocalEnergyModel(landscape, state)
        local_model.descend(stop, 1e-6)
        done = landscape.evaluations - before
        times.append((time.process_time() - began) / done)
    return float(np.median(times))


if __name__ == "__main__":
    run(parser(), main)
