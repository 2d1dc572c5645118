"""Report of compressions on their onset of jamming."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from jamshape.front.run import RunFile


def add_onset_options(parser: ArgumentParser) -> None:
    """Add the option that skips the report."""
    without = "do not minimise frames to find where they stay jammed"
    parser.add_argument("--no-minimising", action="store_true", help=without)


def tell_onset(options: Namespace) -> None:
    """Minimise frames of the run in --out, and compare with the onset of its pressure."""
    if options.no_minimising:
        return
    run = RunFile(options.out)
    print(run.jamming().verdict(run.onset(), run.kappa))
