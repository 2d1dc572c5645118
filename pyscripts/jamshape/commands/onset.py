"""What compressions say of their onset once they are done."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from jamshape.front.run import RunFile


def add_onset_options(parser: ArgumentParser) -> None:
    """Add the option that leaves it out."""
    without = "do not minimise frames to see from which packing fraction on they stay jammed"
    parser.add_argument("--no-minimising", action="store_true", help=without)


def tell_onset(options: Namespace) -> None:
    """Minimise frames of the run in --out, and say whether they bear out the onset of its pressure."""
    if options.no_minimising:
        return
    run = RunFile(options.out)
    print(run.jamming().verdict(run.onset(), run.kappa))
