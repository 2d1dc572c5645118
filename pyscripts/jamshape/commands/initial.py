"""Make a random initial state without overlaps, of particles of any shape, for LAMMPS or Python.

    jamshape initial --alpha 4 --n 256 --phi 0.4 --out start.data

The last line of standard output is one JSON object.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from pathlib import Path

from jamshape.checks import require_free
from jamshape.command import parser_of, report
from jamshape.files.h5md import write_packing
from jamshape.files.lammps_text import write_data
from jamshape.packing import Packing
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.command_line import add_particle_options, particles_of

WRITERS: dict[str, Callable[[Path, Packing], None]] = {".data": write_data, ".h5": write_packing}


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_of(__doc__)
    add_particle_options(parser)
    parser.add_argument("--n", type=int, default=256, help="number of particles (256)")
    parser.add_argument("--phi", type=float, default=0.4, help="packing fraction (0.4)")
    parser.add_argument("--seed", type=int, default=1, help="random seed (1)")
    parser.add_argument("--dimension", type=int, choices=(2, 3), default=2, help="(2)")
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        help=".data for a LAMMPS data file, .h5 for an H5MD packing",
    )
    parser.add_argument("--again", action="store_true", help="replace an existing H5MD file")
    return parser


def main(options: Namespace) -> None:
    """Make the packing and write it."""
    writer = WRITERS.get(options.out.suffix)
    if writer is None:
        msg = f"--out is {options.out}, expected a suffix .data or .h5"
        raise ValueError(msg)
    # A data file is quickly made again; a packing in H5MD may be the work of hours.
    require_free(options.out, again=options.again or options.out.suffix == ".data")
    particles, dimension = particles_of(options), options.dimension
    packing = random_packing(options.n, options.phi, options.seed, particles, dimension)
    writer(options.out, packing)
    edges = packing.box.edges.tolist()
    report({"out": options.out, "n": packing.n, "phi": packing.phi, "box": edges})
