"""How scripts parse, report and end.

A script's docstring is its help, the last line of its standard output one JSON object, and what it says of wrong
input one sentence on standard error after its name::

    def main(options: Namespace) -> None:
        report({"out": options.out, "phi_J": measured(options.files)})

    if __name__ == "__main__":
        run(parser_of(__doc__, "phi_j.png", "SWEEP"), main)
"""

from __future__ import annotations

import json
import math
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

# What wrong input, missing files and searches without an end raise, each with one sentence.
PROBLEMS = (OSError, ValueError, RuntimeError)


def parser_of(doc: str | None, out: str = "", files: str = "") -> ArgumentParser:
    """Make a parser whose help is a script's docstring, with --out and files if these are named.

    Parameters
    ----------
    doc : str or None
        Of the script, shown as it is.
    out : str
        What is written if nothing else is asked for.
    files : str
        What the files are that the script reads, one or more, called `files` among the options.
    """
    parser = ArgumentParser(description=doc, formatter_class=RawDescriptionHelpFormatter)
    if files:
        parser.add_argument("files", type=Path, nargs="+", metavar=files, help="folders or files")
    if out:
        parser.add_argument("--out", type=Path, default=Path(out), help="(%(default)s)")
    return parser


def report(found: Mapping[str, Any]) -> None:
    """Print one line of JSON with what `plain` makes of it."""
    print(json.dumps(plain(found), allow_nan=False))


def plain(value: Any) -> Any:
    """Turn a value into what JSON knows.

    NaN and infinity become null, named tuples objects, arrays and other tuples lists, paths text.
    """
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist())
    if hasattr(value, "_asdict"):
        return plain(value._asdict())
    if isinstance(value, Mapping):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, Path):
        return str(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def run(parser: ArgumentParser, main: Callable[[Namespace], int | None]) -> NoReturn:
    """Parse the command line, run a script and end with the exit code that it returns.

    After one of `PROBLEMS` its sentence is printed and the exit code is 1.
    """
    options = parser.parse_args()
    try:
        sys.exit(main(options))
    except PROBLEMS as error:
        sys.exit(f"{parser.prog}: {error}")
