"""Make many packings on all cores, several samples of every shape.

    python pyscripts/sweep.py --alpha 0 0.01 1 4 --samples 6 --n 256 --out sweep/
    python pyscripts/sweep.py --superellipsoid 1 0.6 1 --superellipsoid 1.5 1 1 --samples 5 --n 400 --out sweep3d/

Each sample is one run of make_packing.py in a process of its own, one a core. Started again after a kill it
goes on: packings that are there are not made again, those under way go on from their own files, and those of
other parameters are refused. A sample that fails is listed, the others go on. The last line of standard output is one JSON object; the exit code
is 0 only if all samples are there. For clusters see pyscripts/sweep.smk.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from tqdm import tqdm

MAKE_PACKING = Path(__file__).with_name("make_packing.py")

# One core a process: threads of BLAS would only wait for each other.
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def parse() -> argparse.Namespace:
    """Read the command line; what it does not know goes to make_packing.py."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="Other options (--n, --u0, --kappa ...) are those of make_packing.py.",
    )
    shapes = parser.add_mutually_exclusive_group(required=True)
    shapes.add_argument("--alpha", type=float, nargs="+", default=[], help="aspect ratios A/R")
    shapes.add_argument(
        "--superellipsoid",
        type=float,
        nargs=3,
        action="append",
        default=[],
        metavar=("P", "W1", "W2"),
        help="exponent, a/b and c/b; may be given several times",
    )
    parser.add_argument("--samples", type=int, default=6, help="seeds 1 to this (6)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes (all cores)")
    parser.add_argument("--out", type=Path, required=True, help="folder")
    options, extra = parser.parse_known_args()
    options.extra = extra
    return options


class Particle(NamedTuple):
    """A shape: how its files are called, and the options of make_packing.py that tell it."""

    name: str
    arguments: list[str]


def particles(options: argparse.Namespace) -> list[Particle]:
    """List the shapes that are asked for."""
    rods = [Particle(f"alpha{a:g}", ["--alpha", repr(a)]) for a in options.alpha]
    for p, w1, w2 in options.superellipsoid:
        told = ["--shape", "superellipsoid", "--p", repr(p), "--w1", repr(w1), "--w2", repr(w2)]
        rods.append(Particle(f"p{p:g}_w{w1:g}_{w2:g}", told))
    return rods


def make(particle: Particle, seed: int, options: argparse.Namespace) -> str | None:
    """Make one sample; return its complaint if it fails."""
    out = options.out / f"{particle.name}_seed{seed}.h5"
    arguments = [*particle.arguments, "--seed", str(seed), "--out", str(out), *options.extra]
    log = out.with_suffix(".log")
    with log.open("a") as errors:
        done = subprocess.run(
            [sys.executable, MAKE_PACKING, *arguments],
            check=False,
            stdout=subprocess.PIPE,
            stderr=errors,
            env=os.environ | _ONE_THREAD,
        )
    if done.stdout.strip():  # a finished packing, which says itself whether it is in equilibrium
        return None
    last = log.read_text().strip().replace("\r", "\n").splitlines()
    return f"{out.name}: {last[-1] if last else f'exit code {done.returncode}'}"


def main(options: argparse.Namespace) -> int:
    """Run all samples; return the exit code."""
    options.out.mkdir(parents=True, exist_ok=True)
    samples = [(p, s) for s in range(1, options.samples + 1) for p in particles(options)]
    failures = []
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        runs = [pool.submit(make, particle, seed, options) for particle, seed in samples]
        for run in tqdm(concurrent.futures.as_completed(runs), total=len(runs), unit="packing"):
            if complaint := run.result():
                failures.append(complaint)
                tqdm.write(complaint, file=sys.stderr)
    done = len(samples) - len(failures)
    print(json.dumps({"out": str(options.out), "made": done, "failed": failures}))
    return 1 if failures else 0


if __name__ == "__main__":
    try:
        sys.exit(main(parse()))
    except (ValueError, OSError) as error:
        sys.exit(f"sweep.py: {error}")
