"""Compress 2D spherocylinders through jamming at any rate, however slow; record p(phi) in an H5MD file.

    python pyscripts/slow_compress.py --alpha 4 --n 256 --kappa 1e-9 --phi-end 0.88 --out slow.h5

Starts from the last frame of a run or packing file (--start), or compresses a random packing fast in
LAMMPS first. Run again after a kill, it goes on; a finished run is left alone. The last line of
standard output is one JSON object.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path

from tqdm import tqdm

from jamshape.files.h5md import read_attributes, read_packing
from jamshape.flow.implicit import METHODS, Protocol
from jamshape.flow.slow_run import begin, is_finished, make_start, record, require_same, summary


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, default, meaning in (
        ("--alpha", 4.0, "aspect ratio A/R"),
        ("--n", 256, "particles"),
        ("--kappa", 1e-8, "compression rate"),
        ("--phi-start", 0.8, "packing fraction where the fast compression ends"),
        (
            "--phi-slow",
            0.0,
            "packing fraction from which --kappa holds; up to there --kappa-before",
        ),
        ("--kappa-before", 1e-6, "compression rate up to --phi-slow"),
        ("--phi-end", 0.9, "packing fraction to reach"),
        ("--p-end", math.inf, "pressure to reach"),
        ("--seed", 1, "of the random start"),
        ("--tolerance", 1e-3, "local error of a step over the typical overlap"),
        (
            "--largest-drop",
            math.inf,
            "part of the energy that a step may lose, such as 0.1 to resolve plastic events",
        ),
    ):
        parser.add_argument(
            name, type=type(default), default=default, help=f"{meaning} ({default})"
        )
    parser.add_argument("--method", choices=METHODS, default="tr-bdf2")
    parser.add_argument("--start", type=Path, help="H5MD file whose last frame to start from")
    parser.add_argument("--out", type=Path, required=True, help="H5MD file to write")
    return parser.parse_args()


def run(options: argparse.Namespace) -> None:
    """Begin, or go on; a finished run is left alone."""
    slowly = (options.phi_slow, options.kappa)
    kappa = ((0.0, options.kappa_before), slowly) if options.phi_slow else options.kappa
    protocol = Protocol(kappa, options.phi_end, options.p_end, options.tolerance,
                        largest_drop=options.largest_drop, method=options.method)  # fmt: skip
    if options.out.exists():
        require_same(options.out, protocol)
        if is_finished(options.out):
            return
    else:
        made_from = {key: getattr(options, key) for key in ("alpha", "n", "seed")}
        if options.start:
            start, stored = read_packing(options.start), read_attributes(options.start)
            made_from = {key: stored.get(key, made_from[key]) for key in made_from}
            made_from |= {"n": start.n, "start": str(options.start)}
        else:
            start = make_start(options.alpha, options.n, options.seed, options.phi_start)
        options.out.parent.mkdir(parents=True, exist_ok=True)
        begin(options.out, start, protocol, {"size_ratio": 1.4} | made_from)
    with tqdm(total=round(1e6 * options.phi_end), unit="1e-6 phi", mininterval=1) as bar:
        for step in record(options.out):
            bar.set_postfix_str(f"phi {step.phi:.6f} p {step.p:.3e}", refresh=False)
            bar.update(round(1e6 * step.phi) - bar.n)


if __name__ == "__main__":
    arguments = parse()
    try:
        run(arguments)
        print(json.dumps(summary(arguments.out)))
    except (ValueError, OSError, RuntimeError) as error:
        sys.exit(f"slow_compress.py: {error}")
