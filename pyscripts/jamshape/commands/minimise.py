"""Minimise the energy of a state of one's own, at its box.

    jamshape minimise final.dump --out minimum.h5
    jamshape minimise mine.data --shape spherocylinder --strict --out minimum.h5

PACKING is any file with particles: H5MD, a LAMMPS dump or data file, GSD; the last frame, or that of --frame. Its law of
contacts (k_e, sides, power, exponents) is kept. The last line of standard output is one JSON object; the exit code is 0 only
if forces balance to --tolerance, which includes that none are left (unjammed). The same command resumes, with the file
beside the result.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from jamshape.checks import require_other_file
from jamshape.command import report
from jamshape.commands.signatures import called, parser_for
from jamshape.front.minimising import minimise
from jamshape.protocols.make import summary_of

GO_ON = "the same command resumes from the file beside the result"


def options_of() -> ArgumentParser:
    """Make the parser."""
    return parser_for(minimise, __doc__)


def main(options: Namespace) -> int:
    """Minimise the state unless that is done; return the exit code."""
    require_other_file(options.out, [options.packing])
    called(minimise, options)
    found = summary_of(options.out)
    report(found)
    return 0 if found["reached"] else 1  # a warning was issued
