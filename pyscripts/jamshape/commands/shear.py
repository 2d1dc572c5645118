"""Shear particles of any shape at a constant rate and packing fraction; record stress and snapshots in one H5MD file.

    jamshape shear --alpha 4 --n 256 --phi 0.8 --gdot 1e-4 --strain 5 --out shear.h5

Starts from a random packing compressed fast to --phi, or from the last frame of a file with particles
(--start), or that of --frame. The last line of standard output is one JSON object with averages over the steady state, each with its
error and its correlation strain (memory); they exclude the start-up, which the file
includes. --after sets the strain at which averaging begins. The same command resumes an interrupted run and reports
a finished one; it refuses a file with other settings, unless --again replaces it. With --seconds it stops in time,
before a queue ends it: the exit code is then 75.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from jamshape.checks import RANGES, require_in
from jamshape.command import report
from jamshape.commands.signatures import called, parser_for
from jamshape.front.shearing import shear
from jamshape.measures.shears import shear_report

GO_ON = "the same command resumes from the last checkpoint"


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_for(shear, __doc__)
    parser.add_argument("--after", type=float, help="strain at which averaging begins (automatic)")
    return parser


def main(options: Namespace) -> None:
    """Begin or resume; a finished run is left alone."""
    if options.after is not None:
        require_in("--after", options.after, RANGES["strain"]._replace(also=(0.0,)))
    called(shear, options)
    report(shear_report(options.out, options.after))
