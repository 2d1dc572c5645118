"""Compress particles of any shape in the plane through jamming at any rate, however slow; record p(phi).

    jamshape slow --alpha 4 --n 256 --kappa 1e-9 --phi-end 0.88 --out slow.h5

Starts from the last frame of a run or packing file (--start), or compresses a random packing fast in
LAMMPS first. At the end frames are minimised, since p(phi) of a flow rises, too: its onset phi_J(kappa) is that of
jamming only if states there stay jammed without driving; --no-minimising skips this. The same command resumes an
interrupted run and leaves a finished one alone; it refuses a file with other settings, unless --again replaces it.
With --seconds it stops in time, before a queue ends it: the exit code is then 75. The last line of standard output is
one JSON object.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from jamshape.checks import RANGES, ArgumentError, require_in, require_no_effect, require_with
from jamshape.command import add_numbers, parser_of, report, typed
from jamshape.commands.onset import add_onset_options, tell_onset
from jamshape.commands.recording import add_recording_options
from jamshape.flow.implicit import METHODS
from jamshape.front.compressing import slow_compress
from jamshape.measures.runs import summary_of
from jamshape.old_names import add_old_option
from jamshape.shapes.command_line import add_particle_options, particles_beside

GO_ON = "the same command resumes from the last checkpoint"


_PHI_END, _KAPPA, _KAPPA_BEFORE = 0.9, 1e-8, 1e-6  # defaults


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_of(__doc__)
    add_particle_options(parser)
    add_numbers(
        parser,
        ("--n", 256, "particles"),
        ("--kappa", _KAPPA, "compression rate"),
        ("--phi-start", 0.8, "packing fraction at the end of the fast compression"),
        (
            "--phi-slow",
            0.0,
            "packing fraction from which --kappa applies; before it --kappa-before",
        ),
        ("--kappa-before", _KAPPA_BEFORE, "compression rate up to --phi-slow"),
        ("--phi-end", _PHI_END, "final packing fraction"),
        ("--p-end", math.inf, "final pressure"),
        ("--seed", 1, "random seed of the start"),
        ("--integration-tolerance", 1e-3, "local error of a step over the typical overlap"),
        (
            "--largest-drop",
            math.inf,
            "fraction of the energy that a step may lose (plastic events)",
        ),
    )
    add_old_option(parser, "--tolerance", "--integration-tolerance", type=float)
    parser.add_argument("--method", choices=METHODS, default="tr-bdf2")
    add_onset_options(parser)
    parser.add_argument("--start", type=Path, help="H5MD file whose last frame to start from")
    add_recording_options(parser)
    return parser


def _rates(options: Namespace) -> dict[str, Any]:
    """Read the rate, or the packing fraction from which it applies and the rate before."""
    slow, before = options.phi_slow or None, options.kappa_before
    require_with("phi_slow", slow, kappa_before=before)
    if slow is None:
        return typed(options, "kappa")
    require_in("--phi-slow", slow, RANGES["phi"])
    kappa = _KAPPA if options.kappa is None else options.kappa
    before = _KAPPA_BEFORE if before is None else before
    require_in("--kappa-before", before, RANGES["kappa"])
    if slow >= (_PHI_END if options.phi_end is None else options.phi_end):
        said = "{phi_slow} is not below {phi_end:name}, so its rate has no effect, expected a smaller one"
        raise ArgumentError(said, {"phi_slow": slow, "phi_end": None})
    return {"kappa": ((0.0, before), (slow, kappa))}


def main(options: Namespace) -> None:
    """Begin or resume; a finished run is left alone."""
    require_no_effect("start", options.start, phi_start=options.phi_start)
    names = ("n", "p_end", "seed", "start", "method", "integration_tolerance", "largest_drop",
             "again", "seconds")  # fmt: skip
    given = typed(options, *names) | _rates(options)
    phi_end = _PHI_END if options.phi_end is None else options.phi_end
    phi = (options.phi_start, phi_end)
    slow_compress(particles_beside(options), phi=phi, **given, file=options.out)
    tell_onset(options)
    report(summary_of(options.out))
