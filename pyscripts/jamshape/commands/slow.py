"""Compress particles of any shape in the plane through jamming at any rate, however slow; record p(phi).

    jamshape slow --alpha 4 --n 256 --kappa 1e-9 --phi-end 0.88 --out slow.h5

Starts from the last frame of a run or packing file (--start), or compresses a random packing fast in
LAMMPS first. At the end frames are minimised: p(phi) of a flow rises, too, and its onset phi_J(kappa) is that of
jamming only where states stay jammed when nothing drives them; --no-minimising leaves that out. Run again after a
kill, it goes on; a finished run is left alone. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from pathlib import Path

from jamshape.checks import RANGES, Range, require_in
from jamshape.command import add_numbers, parser_of, report
from jamshape.commands.onset import add_onset_options, tell_onset
from jamshape.flow.implicit import METHODS
from jamshape.flow.slow_recording import summary_of
from jamshape.front.compressing import slow_compress
from jamshape.shapes.command_line import add_particle_options, particles_of

GO_ON = "the same command goes on from the last frame"


_PHI_SLOW = Range(1e-6, 2.0, "a packing fraction", also=(0.0,))


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_of(__doc__)
    add_particle_options(parser)
    add_numbers(
        parser,
        ("--n", 256, "particles"),
        ("--kappa", 1e-8, "compression rate"),
        ("--phi-start", 0.8, "packing fraction where the fast compression ends"),
        ("--phi-slow", 0.0, "packing fraction from which --kappa holds; before it --kappa-before"),
        ("--kappa-before", 1e-6, "compression rate up to --phi-slow"),
        ("--phi-end", 0.9, "packing fraction to reach"),
        ("--p-end", math.inf, "pressure to reach"),
        ("--seed", 1, "of the random start"),
        ("--tolerance", 1e-3, "local error of a step over the typical overlap"),
        ("--largest-drop", math.inf, "part of the energy that a step may lose (plastic events)"),
    )
    parser.add_argument("--method", choices=METHODS, default="tr-bdf2")
    add_onset_options(parser)
    parser.add_argument("--start", type=Path, help="H5MD file whose last frame to start from")
    parser.add_argument("--out", type=Path, required=True, help="H5MD file to write")
    return parser


def main(options: Namespace) -> None:
    """Begin, or go on; a finished run is left alone."""
    require_in("--phi-slow", options.phi_slow, _PHI_SLOW)
    require_in("--kappa-before", options.kappa_before, RANGES["kappa"])
    names = ("n", "p_end", "seed", "start", "method", "tolerance", "largest_drop")
    given = {name: getattr(options, name) for name in names}
    slowly = (options.phi_slow, options.kappa)
    kappa = ((0.0, options.kappa_before), slowly) if options.phi_slow else options.kappa
    phi = (options.phi_start, options.phi_end)
    slow_compress(particles_of(options), phi=phi, kappa=kappa, **given, file=options.out)
    tell_onset(options)
    report(summary_of(options.out))
