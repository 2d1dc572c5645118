"""Compress particles of any shape through jamming at any rate, however slow; record p(phi).

    jamshape slow --alpha 4 --n 256 --kappa 1e-9 --phi-end 0.88 --out slow.h5

Starts from the last frame of a file with particles (--start), or that of --frame, or compresses a random packing fast
in LAMMPS first. At the end frames are minimised, since p(phi) of a flow rises, too: its onset phi_J(kappa) is that of
jamming only if states there stay jammed without driving; --no-minimising skips this. The same command resumes an
interrupted run and leaves a finished one alone; it refuses a file with other settings, unless --again replaces it.
With --seconds it stops in time, before a queue ends it: the exit code is then 75. The last line of standard output is
one JSON object.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import Any

from jamshape.checks import RANGES, ArgumentError, require_in, require_no_effect, require_with
from jamshape.command import report
from jamshape.commands.onset import add_onset_options, tell_onset
from jamshape.commands.signatures import called, given, parser_for
from jamshape.front.compressing import KAPPA_SLOW, PHI_SLOW, slow_compress
from jamshape.measures.runs import summary_of

GO_ON = "the same command resumes from the last checkpoint"

_KAPPA_BEFORE = 1e-6


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_for(slow_compress, __doc__)
    applies = "packing fraction from which --kappa applies; before it --kappa-before"
    before = "compression rate up to --phi-slow"
    parser.add_argument("--phi-slow", type=float, help=applies)
    parser.add_argument("--kappa-before", type=float, help=f"{before} ({_KAPPA_BEFORE})")
    add_onset_options(parser)
    return parser


def _rates(options: Namespace) -> dict[str, Any]:
    """Read the packing fraction from which the rate applies, if given, and the rate before."""
    slow, before = options.phi_slow or None, options.kappa_before
    require_with("phi_slow", slow, kappa_before=before)
    if slow is None:
        return {}
    require_in("--phi-slow", slow, RANGES["phi"])
    before = _KAPPA_BEFORE if before is None else before
    require_in("--kappa-before", before, RANGES["kappa"])
    typed = given(slow_compress, options)
    if slow >= typed.get("phi", PHI_SLOW)[1]:
        said = "{phi_slow} is not below {phi_end:name}, so its rate has no effect, expected a smaller one"
        raise ArgumentError(said, {"phi_slow": slow, "phi_end": None})
    return {"kappa": ((0.0, before), (slow, typed.get("kappa", KAPPA_SLOW)))}


def main(options: Namespace) -> None:
    """Begin or resume; a finished run is left alone."""
    require_no_effect("start", options.start, phi_start=options.phi_start)
    called(slow_compress, options, **_rates(options))
    tell_onset(options)
    report(summary_of(options.out))
