"""Options of commands that record a run."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path

from jamshape.checks import TIME_IS_UP


def add_recording_options(parser: ArgumentParser) -> None:
    """Add the file of a run, and options to start over and to stop in time."""
    parser.add_argument("--out", type=Path, required=True, help="H5MD file to write")
    parser.add_argument("--again", action="store_true", help="start over if --out exists")
    stop = f"stop at the first checkpoint after this time [s], with exit code {TIME_IS_UP}; the same command resumes"
    parser.add_argument("--seconds", type=float, help=stop)
