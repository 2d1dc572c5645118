"""Make one mechanically stable packing of any shape: compress, find its energy, measure, store as H5MD.

    jamshape pack --shape spherocylinder --alpha 4 --n 256 --seed 1 --u0 1e-15 --out packing.h5
    jamshape pack --shape superellipsoid --p 1.5 --w1 1 --w2 1 --protocol yuan-2019-1 --seed 1 --out packing.h5
    jamshape pack --alpha 4 --n 256 --protocol marschall-2018 --out packing.h5
    jamshape pack --protocol marschall-2018 --start slow.h5 --search bisection --out packing.h5
    jamshape pack --kind alpha=0,share=0.5 --kind alpha=4,size=1.4,share=0.5 --n 256 --out mixture.h5

Compresses quasistatically, in steps that are large far from jamming, to the first jammed packing, then relaxes it at
the energy density u0. --protocol selects slow compression in LAMMPS or equal steps instead, or follows a
paper, with its values as defaults: marschall-2018 with a compression at one rate and the energy of Sec. III C, yuan-2019-1
and yuan-2019-2 with the steps of Sec. 2.2.

The last line of standard output is one JSON object; the exit code is 0 only if forces balance to --tolerance. Until
the packing is done, files beside the result hold its state, from which the same command resumes.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from jamshape.command import report
from jamshape.commands.signatures import called, parser_for
from jamshape.front.making import make_packing
from jamshape.protocols.make import summary_of

GO_ON = "the same command resumes from the files beside the result"


def options_of() -> ArgumentParser:
    """Make the parser."""
    return parser_for(make_packing, __doc__)


def main(options: Namespace) -> int:
    """Make the packing unless it exists; return the exit code."""
    called(make_packing, options)
    found = summary_of(options.out)
    report(found)
    return 0 if found["reached"] else 1  # a warning was issued
