"""Count the packings of rods whose forces balance, and their cost.

    python analysis/outcomes.py --alpha 2 4 8 --n 64 --u0 1e-12 --samples 100 --out outcomes/

Makes a packing of each seed; started again after a kill, it makes only those that are missing. Prints a row for each
aspect ratio: how many packings reached their goal, z and phi_J with and without those that did not, and the median and
the sum of the CPU seconds. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import json
import statistics
import time
from argparse import Namespace
from pathlib import Path
from typing import Any, NamedTuple

from tqdm import tqdm

from common.averages import mean_over
from jamshape.command import parser_of, report, run
from jamshape.files.ensembles import PackingFile
from jamshape.measures.averages import Mean
from jamshape.minima.target import TargetError
from jamshape.protocols.defaults import recipe_for
from jamshape.protocols.make import make
from jamshape.recording.recorder import How
from jamshape.shapes.particles import Particles


class Sample(NamedTuple):
    """One packing."""

    file: Path
    seconds: float
    """CPU seconds."""
    failure: str = ""
    """Why there is none; empty otherwise."""


def sample(alpha: float, seed: int, options: Namespace) -> Sample:
    """Make one packing, unless it is there."""
    out = options.out / f"alpha{alpha:g}_seed{seed}.h5"
    told = out.with_suffix(".json")
    if not told.exists():
        particles = Particles.of("spherocylinder", alpha=alpha)
        recipe = recipe_for(particles, dimension=2, seed=seed, n=options.n, u0=options.u0)
        began, failure = time.process_time(), ""
        try:
            make(recipe, out, How(again=True))
        except TargetError as error:
            failure = str(error)
        seconds = time.process_time() - began
        told.write_text(json.dumps({"seconds": seconds, "failure": failure}) + "\n")
    return Sample(out, **json.loads(told.read_text()))


def row_of(made: list[Sample]) -> dict[str, Any]:
    """Count and average."""
    files = [PackingFile.read(one.file) for one in made if not one.failure]
    seconds = [one.seconds for one in made]
    means = {n: mean_over(files, [f.number(n) for f in files]) for n in ("z", "phi_J")}
    counts: dict[str, Any] = {"samples": len(made), "reached": sum(file.reached for file in files)}
    counts |= {"not_made": len(made) - len(files)}
    return counts | means | {"median_seconds": statistics.median(seconds), "seconds": sum(seconds)}


def main(options: Namespace) -> None:
    """Make, count, report."""
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for alpha in options.alpha:
        seeds = tqdm(range(1, options.samples + 1), desc=f"alpha {alpha:g}", unit="packing")
        row = {"alpha": alpha} | row_of([sample(alpha, seed, options) for seed in seeds])
        z: Mean = row["z"]
        reached = f", {z.reached.text()} of those that did" if z.reached else ""
        print(
            f"alpha {alpha:g}: {row['reached']} of {row['samples']} reached, z {z.text()}{reached};"
            f" median {row['median_seconds']:.2f} s, sum {row['seconds']:.1f} s"
        )
        rows.append(row)
    report({"out": options.out, "outcomes": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "outcomes")
    parser.add_argument("--alpha", type=float, nargs="+", default=[2.0, 4.0, 8.0], help="(2 4 8)")
    parser.add_argument("--n", type=int, default=64, help="particles (%(default)s)")
    parser.add_argument("--u0", type=float, default=1e-12, help="energy density (%(default)s)")
    parser.add_argument("--samples", type=int, default=100, help="seeds from 1 on (%(default)s)")
    run(parser, main)
