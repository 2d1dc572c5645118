"""Shear particles of any shape to and fro between two strains; record stress and snapshots in one H5MD file.

    jamshape cycle --alpha 4 --n 256 --phi 0.8 --amplitude 0.05 --period 2000 --cycles 20 --out cycles.h5

The strain is a triangle wave, from 0 to the amplitude, to minus the amplitude, and back to 0, at the constant rate
4 amplitude / period. Starts from a random packing compressed fast to --phi, or from the last frame of a file
with particles (--start), or that of --frame. With --pressure the height of the box yields to that normal pressure. The last line of standard output is one JSON object with the state at the end, and of the first and
the last cycle the mean squared displacement of particles between its ends (displacement) and the dissipated energy
over the volume (dissipated). per_cycle lists of each cycle the work of the stress, the energy lost, the storage and the
loss modulus, how far particles are from where it began over the smallest inner radius (rms, largest), the number of
contacts that changed, and whether no particle is farther than 1e-3 (is_reversible). The same command resumes an interrupted run and reports a finished one; it refuses a file
with other settings, unless --again replaces it. With --seconds it stops in time, before a queue ends it: the exit
code is then 75.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from jamshape.command import report
from jamshape.commands.signatures import called, parser_for
from jamshape.front.shearing import cyclic_shear

GO_ON = "the same command resumes from the last checkpoint"


def options_of() -> ArgumentParser:
    """Make the parser."""
    return parser_for(cyclic_shear, __doc__)


def main(options: Namespace) -> None:
    """Begin or resume; a finished run is left alone."""
    run = called(cyclic_shear, options)
    found = {name: float(run[name][-1]) for name in ("cycle", "phi", "pressure", "u", "z")}
    moved, lost = run.displacement, run.dissipated
    found |= {"displacement_first": moved[0], "displacement": moved[-1]}
    found |= {"dissipated_first": lost[0], "dissipated": lost[-1]}
    report({"out": options.out, "gdot": run.gdot, **found, "per_cycle": run.cycles()})
