"""Compress packings of rods to rising pressures; measure their shear modulus, and how it changes while contacts stay the same.

    python analysis/zhang_2021/compress.py --alpha 1 --n 64 --first-seed 1 --samples 20 --runs series

Each packing is made at the lowest pressure, in a box that changes its volume only, and brought to one pressure after the other
(`analysis/stress/moduli_scaling.py`). At each of them it is also brought to a pressure that is higher by 1e-3 of it: where that
opens and closes no contact, both moduli give dG/dp along the geometrical family. Writes a file (JSON) for each seed to
--runs; the same command resumes after a kill. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from jamshape.command import parser_of, report, run

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.stressed import FOLLOWED, Series, add_options, found_of, pressures_of


def main(options: Namespace) -> None:
    """Make what is missing, report."""
    seeds = range(options.first_seed, options.first_seed + options.samples)
    pressures = pressures_of(options)
    every = [Series(options.alpha, options.n, "isotropic", seed, pressures) for seed in seeds]
    found_of(options.runs, every, options.jobs, FOLLOWED)
    report({"runs": options.runs, "made": len(every)})


if __name__ == "__main__":
    parser = parser_of(__doc__)
    parser.add_argument("--alpha", type=float, default=1.0)
    parser.add_argument("--n", type=int, default=64)
    parser.add_argument("--first-seed", type=int, default=1, help="(%(default)s)")
    add_options(parser, samples=20)
    run(parser, main)
