"""Shear particles of any shape at a constant rate and packing fraction; record stress and snapshots in one H5MD file.

    jamshape shear --alpha 4 --n 256 --phi 0.8 --gdot 1e-4 --strain 5 --out shear.h5

Starts from a random packing compressed fast to --phi, or from the last frame of a run or packing file
(--start). The last line of standard output is one JSON object with averages over the steady state, each with its
error and its correlation strain (memory); they exclude the start-up, which the file
includes. --after sets the strain at which averaging begins. The same command resumes an interrupted run and reports
a finished one; it refuses a file with other settings, unless --again replaces it. With --seconds it stops in time,
before a queue ends it: the exit code is then 75.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from jamshape.checks import RANGES, require_in
from jamshape.command import add_numbers, parser_of, report, typed
from jamshape.commands.recording import add_recording_options
from jamshape.flow.implicit import METHODS
from jamshape.flow.motion import INTEGRATORS
from jamshape.flow.shear import FLOWS
from jamshape.front.shearing import shear
from jamshape.measures.shears import shear_report
from jamshape.old_names import add_old_option
from jamshape.shapes.command_line import add_particle_options, particles_beside

GO_ON = "the same command resumes from the last checkpoint"


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_of(__doc__)
    add_particle_options(parser)
    add_numbers(
        parser,
        ("--n", 256, "particles"),
        ("--dimension", 2, "2 or 3"),
        ("--phi", 0.8, "packing fraction"),
        ("--gdot", 1e-4, "shear rate"),
        ("--strain", 5.0, "final strain"),
        ("--sides", 2, "bonds of a side-to-side contact"),
        ("--seed", 1, "random seed of the start"),
        ("--rows", 1000, "samples of stress and order"),
        ("--frames", 20, "snapshots"),
    )
    parser.add_argument("--flow", choices=FLOWS, default=FLOWS[0], help="(%(default)s)")
    usual = "heun with --dt or --sides 1, tr-bdf2 in the plane up to --gdot 3e-7, else rkc2"
    names = f"{', '.join(INTEGRATORS)}; implicit: {', '.join(METHODS)}"
    parser.add_argument("--integrator", help=f"{names} ({usual})")
    error = "local error over the typical overlap, except heun (1e-4; implicit steps 1e-3)"
    parser.add_argument("--integration-tolerance", type=float, help=error)
    add_old_option(parser, "--tolerance", "--integration-tolerance", type=float)
    parser.add_argument("--dt", type=float, help="time step of heun (0.05)")
    parser.add_argument("--after", type=float, help="strain at which averaging begins (automatic)")
    parser.add_argument("--start", type=Path, help="H5MD file whose last frame to start from")
    add_recording_options(parser)
    return parser


def main(options: Namespace) -> None:
    """Begin or resume; a finished run is left alone."""
    if options.after is not None:
        require_in("--after", options.after, RANGES["strain"]._replace(also=(0.0,)))
    names = ("n", "dimension", "phi", "gdot", "strain", "flow", "seed", "start", "sides",
             "integrator", "dt", "integration_tolerance", "rows", "frames", "again", "seconds")  # fmt: skip
    given = typed(options, *names)
    shear(particles_beside(options), **given, file=options.out)
    report(shear_report(options.out, options.after))
