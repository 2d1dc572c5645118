"""Compress particles of any shape through jamming; record p(phi) and snapshots in one H5MD file.

    jamshape compress --alpha 4 --n 1024 --kappa 1e-6 --phi-start 0.4 --phi-end 0.9 --out run.h5

At the end frames are minimised, since p(phi) of a flow rises, too: its onset phi_J(kappa) is that of jamming only
if states there stay jammed without driving; --no-minimising skips this. A sentence reports the result, and the last
line of standard output is one JSON object. With --resume an interrupted run continues from its last restart
file, with its own settings, and a finished one is left alone; other settings are refused. An existing file is
replaced only with --again.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from pathlib import Path

from jamshape.checks import ArgumentError, require_free
from jamshape.command import add_numbers, parser_of, report, typed
from jamshape.commands.onset import add_onset_options, tell_onset
from jamshape.files.h5md import read_attributes, read_style
from jamshape.flow.recording import summary_of
from jamshape.front.compressing import PHI, compress
from jamshape.front.recorded import resume
from jamshape.shapes.command_line import add_particle_options, are_particles_given, particles_of

GO_ON = "the same command with --resume resumes from the last restart file"

_SETTINGS = (
    "n",
    "dimension",
    "kappa",
    "seed",
    "integrator",
    "dt",
    "tolerance",
    "sides",
    "rows",
    "frames",
)

_SAME = 1e-6  # relative rounding of the packing fraction of a start


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
        ("--tolerance", 1e-4, "local error over the typical overlap, of rkc2 and heun/adaptive"),
        ("--seed", 1, "random seed of the start"),
        ("--rows", 400, "samples of p(phi)"),
        ("--frames", 20, "snapshots"),
    )
    usual = "rkc2; heun with --dt or --sides 1"
    parser.add_argument("--integrator", help=f"heun, heun/adaptive or rkc2 ({usual})")
    parser.add_argument("--dt", type=float, help="time step of heun (0.05)")
    add_onset_options(parser)
    parser.add_argument("--out", type=Path, required=True, help="H5MD file to write")
    begin = parser.add_mutually_exclusive_group()
    begin.add_argument("--resume", action="store_true", help="continue an interrupted run")
    begin.add_argument("--again", action="store_true", help="start over if --out exists")
    return parser


def main(options: Namespace) -> None:
    """Compress, or resume, and report."""
    if options.resume:
        _require_same(options)
        resume(options.out)
    else:
        require_free(options.out, again=options.again, go_on="--resume to continue it, ")
        usual = {"phi_start": PHI[0], "phi_end": PHI[1]} | typed(options, "phi_start", "phi_end")
        phi = (usual["phi_start"], usual["phi_end"])
        given = typed(options, *_SETTINGS)
        compress(particles_of(options), phi=phi, **given, file=options.out, again=options.again)
    tell_onset(options)
    report(summary_of(options.out))


def _require_same(options: Namespace) -> None:
    """Refuse to resume a missing run, or with other settings.

    Raises
    ------
    ArgumentError
    """
    if not options.out.exists():
        said = "{file} does not exist, expected the file of a run; leave {resume} out to begin one"
        raise ArgumentError(said, {"file": options.out, "resume": True})
    stored = read_attributes(options.out)
    asked = typed(options, *_SETTINGS, "phi_start", "phi_end")
    if are_particles_given(options):
        asked |= particles_of(options).told
    for name, value in asked.items():
        own = read_style(options.out)[1] if name == "dimension" else stored.get(name, value)
        same = math.isclose(own, value, rel_tol=_SAME) if isinstance(value, float) else own == value
        if not same:
            said = f"{{{name}}} differs from that of the run in {{file}}, {own}, expected the same; leave it out"
            raise ArgumentError(said, {name: value, "file": options.out})
