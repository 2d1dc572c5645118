"""Speed-up of one large packing by threads: seconds of an evaluation and of a factorisation.

    OPENBLAS_NUM_THREADS=1 python analysis/benchmarks/packing_threads.py --n 4096
    OPENBLAS_NUM_THREADS=1 python analysis/benchmarks/packing_threads.py --superellipsoid 1 1 1 --n 2000 --threads 2 4

Particles at random places are squeezed until they overlap and minimised a little. Then energy and forces are evaluated, and the
Hessian is taken and factorised, by one thread and by others in turns. Told are medians of their times over that of one thread: by
the clock, and of the processor time of the thread that asks, which is what a clock would tell where cores are free. The last
line of standard output is one JSON object.
"""

from __future__ import annotations

import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from typing import Any

import numpy as np

import jamshape as js
from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.landscape import Landscape
from jamshape.landscape.local_energy_model import LocalEnergyModel
from jamshape.landscape.threads import sharing
from jamshape.minima import Stop, minimise
from jamshape.packing import Packing, State
from jamshape.protocols.defaults import recipe_for
from jamshape.shapes.particles import Particles

# Packing fractions of the state, in the plane and in space, and how far it is minimised.
PHI, EVALUATIONS = {2: 0.86, 3: 0.68}, 100
STEPS = 10


def parser() -> ArgumentParser:
    """Make the parser."""
    found = parser_of(__doc__)
    add = found.add_argument
    add("--superellipsoid", type=float, nargs=3, metavar=("P", "W1", "W2"),
        help="in space, in place of discs")  # fmt: skip
    add("--n", type=int, default=4096, help="particles (4096)")
    add("--seed", type=int, default=1, help="(1)")
    add("--threads", type=int, nargs="+", default=[2], help="beside one (2)")
    add("--rounds", type=int, default=20, help="(20)")
    return found


def main(options: Namespace) -> None:
    """Measure and print the table."""
    packing, state = squeezed(particles_of(options), options)
    numbers = [1, *options.threads]
    vicinities = [local_model_of(packing, state, number) for number in numbers]
    size = vicinities[0].landscape.size
    x = 1e-4 * np.random.default_rng(options.seed).normal(size=size)
    works: dict[str, Callable[[LocalEnergyModel], Any]] = {
        "evaluation": lambda about: [about.evaluate(x, 0.0, extended=False) for _ in range(10)],
        "factorisation": lambda about: about.factorise(0.0 * x, 0.0, np.ones(size)),
    }
    found: dict[str, Any] = {"n": options.n, "threads": numbers}
    print("| | threads | ms by the clock | over one thread | of the asking thread |")
    print("| --- | --- | --- | --- | --- |")
    for name, work in works.items():
        times = timed(work, vicinities, options.rounds)
        ratios = np.median(times / times[:, :1], axis=0)
        for number, ratio, clock in zip(numbers, ratios, np.median(times[:, :, 0], 0), strict=True):
            calls = 10 if name == "evaluation" else 1
            told = f"{1e3 * clock / calls:.3g} | {ratio[0]:.2f} | {ratio[1]:.2f}"
            print(f"| {name} | {number} | {told} |")
        found[name] = {"by_clock": ratios[:, 0].tolist(), "asking": ratios[:, 1].tolist()}
    report(found)


def particles_of(options: Namespace) -> Particles:
    """Take the shape that was asked for."""
    if options.superellipsoid:
        p, w1, w2 = options.superellipsoid
        return js.Superellipsoids(p=p, w1=w1, w2=w2)
    return js.Spherocylinders(alpha=0.0)


def squeezed(particles: Particles, options: Namespace) -> tuple[Packing, State]:
    """Press a random start together, in steps, and minimise it a little."""
    packing = recipe_for(particles, n=options.n, seed=options.seed).start()
    landscape, state = Landscape(packing), State.of(packing)
    for phi in np.linspace(packing.phi, PHI[packing.dimension], STEPS):
        now = state.packing(packing).phi
        state = state.strained(float((now / phi) ** (1 / packing.dimension)) - 1)
        state = minimise(landscape, state, "auto", Stop(evaluations=EVALUATIONS)).state
    return packing, state


def local_model_of(packing: Packing, state: State, threads: int) -> LocalEnergyModel:
    """Make a local energy model of its own for so many threads."""
    with sharing(threads):
        return LocalEnergyModel(Landscape(packing), state)


def timed(
    work: Callable[[LocalEnergyModel], Any], vicinities: list[LocalEnergyModel], rounds: int
) -> FloatArray:
    """Give seconds (rounds, vicinities, 2) of each in turns: by the clock, of the asking thread."""
    found = np.zeros((rounds, len(vicinities), 2))
    for about in vicinities:
        work(about)
    for turn in range(rounds):
        for k, about in enumerate(vicinities):
            clock, busy = time.perf_counter(), time.thread_time()
            work(about)
            found[turn, k] = time.perf_counter() - clock, time.thread_time() - busy
    return found


if __name__ == "__main__":
    run(parser(), main)
