"""Shear particles of any shape to and fro between two strains; record stress and snapshots in one H5MD file.

    jamshape cycle --alpha 4 --n 256 --phi 0.8 --amplitude 0.05 --period 2000 --cycles 20 --out cycles.h5

The strain is a triangle wave, from 0 to the amplitude, to minus the amplitude, and back to 0, at the constant rate
4 amplitude / period. Starts from a random packing compressed fast to --phi, or from the last frame of a run or packing
file (--start). The last line of standard output is one JSON object with the state at the end, and of the first and
the last cycle the mean squared displacement of particles between its ends (displacement) and the dissipated energy
over the volume (dissipated). The same command resumes an interrupted run and reports a finished one; it refuses a file
with other settings, unless --again replaces it. With --seconds it stops in time, before a queue ends it: the exit
code is then 75.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from jamshape.command import add_numbers, parser_of, report, typed
from jamshape.commands.recording import add_recording_options
from jamshape.flow.motion import INTEGRATORS
from jamshape.flow.shear import FLOWS
from jamshape.front.shearing import cyclic_shear
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
        ("--amplitude", 0.05, "largest strain"),
        ("--period", 2000.0, "time of a cycle"),
        ("--cycles", 20, "number of cycles"),
        ("--sides", 2, "bonds of a side-to-side contact"),
        ("--seed", 1, "random seed of the start"),
        ("--rows", 100, "samples in a cycle, a multiple of 4"),
    )
    parser.add_argument("--frames", type=int, help="snapshots (one for each cycle)")
    parser.add_argument("--flow", choices=FLOWS, default=FLOWS[0], help="(%(default)s)")
    usual = "heun with --dt or --sides 1, else rkc2"
    parser.add_argument("--integrator", help=f"{', '.join(INTEGRATORS)} ({usual})")
    error = "local error over the typical overlap, except heun (1e-4)"
    parser.add_argument("--integration-tolerance", type=float, help=error)
    parser.add_argument("--dt", type=float, help="largest time step of heun (0.05)")
    parser.add_argument("--start", type=Path, help="H5MD file whose last frame to start from")
    add_recording_options(parser)
    return parser


def main(options: Namespace) -> None:
    """Begin or resume; a finished run is left alone."""
    names = ("n", "dimension", "phi", "amplitude", "period", "cycles", "flow", "seed", "start", "sides",
             "integrator", "dt", "integration_tolerance", "rows", "frames", "again", "seconds")  # fmt: skip
    given = typed(options, *names)
    run = cyclic_shear(particles_beside(options), **given, file=options.out)
    found = {name: float(run[name][-1]) for name in ("cycle", "phi", "pressure", "u", "z")}
    moved, lost = run.displacement, run.dissipated
    found |= {"displacement_first": moved[0], "displacement": moved[-1]}
    found |= {"dissipated_first": lost[0], "dissipated": lost[-1]}
    report({"out": options.out, "gdot": run.gdot, **found})
