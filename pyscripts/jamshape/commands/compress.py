"""Compress particles of any shape through jamming; record p(phi) and snapshots in one H5MD file.

    jamshape compress --alpha 4 --n 1024 --kappa 1e-6 --phi-start 0.4 --phi-end 0.9 --out run.h5

At the end frames are minimised, since p(phi) of a flow rises, too: its onset phi_J(kappa) is that of jamming only
if states there stay jammed without driving; --no-minimising skips this. A sentence reports the result, and the last
line of standard output is one JSON object. The same command resumes an interrupted run and leaves a finished one
alone; it refuses a file with other settings, unless --again replaces it. With --seconds it stops in time, before a
queue ends it: the exit code is then 75.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from jamshape.command import add_numbers, parser_of, report, typed
from jamshape.commands.onset import add_onset_options, tell_onset
from jamshape.commands.recording import add_recording_options
from jamshape.front.compressing import PHI, compress
from jamshape.front.recorded import resume
from jamshape.measures.runs import summary_of
from jamshape.old_names import add_old_flag, add_old_option
from jamshape.shapes.command_line import add_particle_options, are_particles_given, particles_of

GO_ON = "the same command resumes from the last checkpoint"

_SETTINGS = (
    "n",
    "dimension",
    "kappa",
    "seed",
    "integrator",
    "dt",
    "integration_tolerance",
    "sides",
    "rows",
    "frames",
)


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_of(__doc__)
    add_particle_options(parser)
    add_numbers(
        parser,
        ("--n", 256, "particles"),
        ("--dimension", 2, "2 or 3"),
        ("--kappa", 1e-5, "compression rate"),
        ("--phi-start", 0.4, "packing fraction of the random start"),
        ("--phi-end", 0.9, "final packing fraction"),
        ("--sides", 2, "bonds of a side-to-side contact; 1 in the dynamics of Marschall & Teitel"),
        (
            "--integration-tolerance",
            1e-4,
            "local error over the typical overlap, of rkc2 and heun/adaptive",
        ),
        ("--seed", 1, "random seed of the start"),
        ("--rows", 400, "samples of p(phi)"),
        ("--frames", 20, "snapshots"),
    )
    add_old_option(parser, "--tolerance", "--integration-tolerance", type=float)
    usual = "rkc2; heun with --dt or --sides 1"
    parser.add_argument("--integrator", help=f"heun, heun/adaptive or rkc2 ({usual})")
    parser.add_argument("--dt", type=float, help="time step of heun (0.05)")
    add_onset_options(parser)
    add_recording_options(parser)
    add_old_flag(parser, "--resume", "the same command resumes")
    return parser


def main(options: Namespace) -> None:
    """Begin or resume, and report; a finished run is left alone."""
    given, phi = typed(options, *_SETTINGS), typed(options, "phi_start", "phi_end")
    if options.resume and not (given or phi or are_particles_given(options)):
        resume(options.out, seconds=options.seconds)
    else:
        usual = {"phi_start": PHI[0], "phi_end": PHI[1]} | phi
        how = {"file": options.out, "again": options.again, "seconds": options.seconds}
        compress(particles_of(options), phi=tuple(usual.values()), **given, **how)
    tell_onset(options)
    report(summary_of(options.out))
