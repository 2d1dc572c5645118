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

from jamshape.command import report
from jamshape.commands.onset import add_onset_options, tell_onset
from jamshape.commands.signatures import called, given, parser_for
from jamshape.front.compressing import compress
from jamshape.front.recorded import resume
from jamshape.measures.runs import summary_of
from jamshape.old_names import add_old_flag
from jamshape.shapes.command_line import are_particles_given

GO_ON = "the same command resumes from the last checkpoint"


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_for(compress, __doc__)
    add_onset_options(parser)
    add_old_flag(parser, "--resume", "the same command resumes")
    return parser


def main(options: Namespace) -> None:
    """Begin or resume, and report; a finished run is left alone."""
    settings = given(compress, options).keys() - {"file", "again", "seconds"}
    if options.resume and not (settings or are_particles_given(options)):
        resume(options.out, seconds=options.seconds)
    else:
        called(compress, options)
    tell_onset(options)
    report(summary_of(options.out))
