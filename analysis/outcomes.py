"""Count the packings of rods whose forces balance, with and without the second attempt, and its cost.

    python analysis/outcomes.py --alpha 2 4 --n 64 --u0 1e-12 --samples 100 --out outcomes/

Makes a packing of each seed; where forces do not balance at first, it makes the packing without the second try, too. Started
again after a kill it goes on: packings that are there are not made again. Prints a table, a row for each aspect ratio and
sort, of how many packings reached their goal, z and phi_J with and without those that did not, and the median and the sum of
the processor's seconds; and what a step of the second try costs, in evaluations of all forces. The last line of standard output is
one JSON object.
"""

from __future__ import annotations

import json
import statistics
import time
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from common.averages import mean_over
from jamshape.command import parser_of, report, run
from jamshape.files.ensembles import PackingFile
from jamshape.files.h5md import read_packing
from jamshape.files.outcomes import is_reached
from jamshape.landscape import Landscape, State
from jamshape.measures.averages import Mean
from jamshape.minima.target import TargetError
from jamshape.protocols.defaults import recipe_for
from jamshape.protocols.make import make
from jamshape.recording.recorder import How
from jamshape.shapes.particles import Particles
from jamshape.vibration.sliding import Sliding

SORTS = {"before": False, "now": True}
"""Whether there is a second try."""

REPEATED = 20  # evaluations and steps whose time is measured
REACH = 0.05  # of these steps, over the smallest radius


class Sample(NamedTuple):
    """One packing."""

    file: Path
    seconds: float
    """Of the processor."""
    failure: str = ""
    """Why it is not there; empty if it is."""


def sample(alpha: float, seed: int, options: Namespace, sort: str) -> Sample:
    """Make one packing, unless it is there."""
    name = f"alpha{alpha:g}_seed{seed}"
    out = options.out / f"{name}{'' if SORTS[sort] else '_before'}.h5"
    told = out.with_suffix(".json")
    if not told.exists():
        recipe = recipe_for(
            Particles.of("spherocylinder", alpha=alpha),
            dimension=2,
            seed=seed,
            n=options.n,
            u0=options.u0,
        )
        began, failure = time.process_time(), ""
        try:
            make(recipe, out, How(again=True), retry=SORTS[sort])
        except TargetError as error:
            failure = str(error)
        seconds = time.process_time() - began
        told.write_text(json.dumps({"seconds": seconds, "failure": failure}) + "\n")
    return Sample(out, **json.loads(told.read_text()))


def samples(alpha: float, options: Namespace) -> dict[str, list[Sample]]:
    """Make all packings of an aspect ratio, of each sort; where there was no second try, both are the same."""
    found: dict[str, list[Sample]] = {sort: [] for sort in SORTS}
    for seed in tqdm(range(1, options.samples + 1), desc=f"alpha {alpha:g}", unit="packing"):
        now = sample(alpha, seed, options, "now")
        retried = not now.failure and "retry_of" in PackingFile.read(now.file).attributes
        found["now"].append(now)
        found["before"].append(sample(alpha, seed, options, "before") if retried else now)
    return found


def row_of(made: list[Sample]) -> dict[str, Any]:
    """Count and average."""
    files = [PackingFile.read(one.file) for one in made if not one.failure]
    seconds = [one.seconds for one in made]
    means = {n: mean_over(files, [f.number(n) for f in files]) for n in ("z", "phi_J")}
    counts: dict[str, Any] = {"samples": len(made), "reached": sum(file.reached for file in files)}
    counts |= {"not_made": len(made) - len(files)}
    found = [file.attributes for file in files]
    counts |= {"steps_of_cured": sorted(a["retry_steps"] for a in found if _is_cured(a))}
    return counts | means | {"median_seconds": statistics.median(seconds), "seconds": sum(seconds)}


def _is_cured(known: dict[str, Any]) -> bool:
    return "retry_of" in known and is_reached(known)


def price(file: Path) -> float:
    """Measure what a step along what slides costs, in evaluations."""
    packing = read_packing(file)
    landscape, state = Landscape(packing), State.of(packing)
    reach = REACH * 0.5 * landscape.length
    farthest = np.full(packing.n, reach)

    def step() -> None:
        Sliding.at(landscape, state, reach).step(farthest, landscape.turning_radius)

    return seconds_of(step) / seconds_of(lambda: landscape.evaluate(state))


def seconds_of(do: Callable[[], Any]) -> float:
    """Measure the processor's seconds, the first time left out."""
    do()
    began = time.process_time()
    for _ in range(REPEATED):
        do()
    return (time.process_time() - began) / REPEATED


def main(options: Namespace) -> None:
    """Make, count, report."""
    options.out.mkdir(parents=True, exist_ok=True)
    rows, steps = [], []
    for alpha in options.alpha:
        found = samples(alpha, options)
        rows += [{"alpha": alpha, "sort": sort, **row_of(made)} for sort, made in found.items()]
        steps.append(price(next(one.file for one in found["now"] if not one.failure)))
    for row in rows:
        z: Mean = row["z"]
        reached = f", {z.reached.text()} of those that did" if z.reached else ""
        print(
            f"alpha {row['alpha']:g} {row['sort']:6}: {row['reached']} of {row['samples']} reached,"
            f" z {z.text()}{reached}; median {row['median_seconds']:.2f} s, sum {row['seconds']:.1f} s"
        )
    report({"out": options.out, "outcomes": rows, "evaluations_of_a_step": steps})


if __name__ == "__main__":
    parser = parser_of(__doc__, "outcomes")
    parser.add_argument("--alpha", type=float, nargs="+", default=[2.0, 4.0], help="(2 4)")
    parser.add_argument("--n", type=int, default=64, help="particles (%(default)s)")
    parser.add_argument("--u0", type=float, default=1e-12, help="energy density (%(default)s)")
    parser.add_argument("--samples", type=int, default=100, help="seeds from 1 on (%(default)s)")
    run(parser, main)
