"""Make a random initial state of spherocylinders without overlaps, for LAMMPS or for Python."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path

from jamshape.files.h5md import write_packing
from jamshape.files.lammps_text import write_data
from jamshape.packing import Packing
from jamshape.protocols.random_start import Mixture, random_packing


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("--alpha", type=float, default=4.0, help="half length over radius, A / R")
    parser.add_argument("--n", type=int, default=256, help="number of particles")
    parser.add_argument("--phi", type=float, default=0.4, help="packing fraction")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers")
    parser.add_argument("--size-ratio", type=float, default=1.4, help="big over small, mixed 1:1")
    parser.add_argument("--dimension", type=int, choices=(2, 3), default=2)
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        help=".data for a LAMMPS data file, .h5 for an H5MD packing",
    )
    return parser.parse_args()


def make(options: argparse.Namespace) -> Packing:
    """Make the packing and write it."""
    writers: dict[str, Callable[[Path, Packing], None]] = {
        ".data": write_data,
        ".h5": write_packing,
    }
    writer = writers.get(options.out.suffix)
    if writer is None:
        msg = f"--out is {options.out}, expected a name that ends in .data or .h5"
        raise ValueError(msg)
    mixture = Mixture.bidisperse(options.alpha, options.size_ratio)
    packing = random_packing(
        options.n, options.phi, options.seed, mixture, dimension=options.dimension
    )
    writer(options.out, packing)
    return packing


def main() -> int:
    """Run the driver and return its exit code."""
    options = parse()
    try:
        packing = make(options)
    except (ValueError, OSError) as error:
        print(f"make_initial.py: {error}", file=sys.stderr)
        return 1
    result = {
        "out": str(options.out),
        "n": packing.n,
        "phi": packing.phi,
        "box": packing.box.edges.tolist(),
    }
    print(json.dumps(result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
