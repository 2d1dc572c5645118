"""Parsing, reporting and exit of scripts and commands; needs only the standard library.

A script's docstring is its help, the last line of its standard output one JSON object, and an error
one sentence on standard error after its name::

    def main(options: Namespace) -> None:
        report({"out": options.out, "phi_J": measured(options.files)})

    if __name__ == "__main__":
        run(parser_of(__doc__, "phi_j.png", "SWEEP"), main)
"""

from __future__ import annotations

import json
import math
import os
import re
import signal
import sys
import warnings
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from jamshape.checks import (
    TIME_IS_UP,
    NotReachedWarning,
    Sentence,
    TimeLimitError,
    require_options,
)

# Exceptions for wrong input, missing files and failed searches, each with one sentence.
PROBLEMS = (OSError, ValueError, RuntimeError)

SET_UP = "run ./run setup in the repository, then use .venv/bin/python"
"""Advice if a requirement of jamshape is missing."""

_INTERRUPTED = 130  # the shell's exit code after Ctrl-C
_BROKEN_PIPE = 141  # and for a closed output pipe


class Parser(ArgumentParser):
    """A parser that shows texts as they are, and that takes -1e-6 for a number as well as -0.1."""

    def __init__(self, **how: Any) -> None:
        super().__init__(**{"formatter_class": RawDescriptionHelpFormatter, **how})
        # Python before 3.14 takes numbers with an exponent for options.
        self._negative_number_matcher = _NEGATIVE


_NEGATIVE = re.compile(r"-(?:\d+(?:_\d+)*\.?\d*|\.\d+)(?:e[-+]?\d+)?$|-(?:inf|nan)$", re.IGNORECASE)


def parser_of(doc: str | None, out: str = "", files: str = "") -> ArgumentParser:
    """Make a parser whose help is a script's docstring, optionally with --out and files.

    Parameters
    ----------
    doc : str or None
        Docstring of the script, shown as it is.
    out : str
        Default output.
    files : str
        Metavar of the input files, one or more, stored as `files`.
    """
    parser = Parser(description=doc)
    if files:
        parser.add_argument("files", type=Path, nargs="+", metavar=files, help="folders or files")
    if out:
        parser.add_argument("--out", type=Path, default=Path(out), help="(%(default)s)")
    return parser


def typed(options: Namespace, *names: str) -> dict[str, Any]:
    """Return the options of these names that were typed."""
    found = {name: getattr(options, name) for name in names}
    return {name: value for name, value in found.items() if value is not None}


def report(found: Mapping[str, Any]) -> None:
    """Print one line of JSON, converted by `plain`."""
    print(json.dumps(plain(found), allow_nan=False))


def plain(value: Any) -> Any:
    """Convert a value for JSON.

    NaN and infinity become null, objects with ``as_json`` its result, named tuples objects, arrays and other
    tuples lists, paths text.
    """
    if hasattr(value, "tolist"):  # NumPy arrays and scalars
        return plain(value.tolist())
    if hasattr(value, "as_json"):
        return plain(value.as_json())
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
    """Parse the command line, run a script and exit with the code that it returns.

    Numbers are checked by their names first. Errors exit as in `sentences`.
    """
    options = parser.parse_args()
    with sentences(parser.prog):
        require_options(vars(options))
        sys.exit(main(options))


@contextmanager
def sentences(name: str, go_on: str = "it may be started again") -> Iterator[None]:
    """Turn expected errors of the body into one sentence after the program's name, and exit; likewise warnings.

    The exit code is 1 after one of `PROBLEMS`, a missing module, or a result that did not reach its goal
    (`checks.NotReachedWarning`), 75 if the time was up before the end, and 130 after Ctrl-C.

    Parameters
    ----------
    name : str
        Program, as it was called.
    go_on : str
        Advice after Ctrl-C.
    """
    short: list[Warning | str] = []

    def show(said: Warning | str, *_: Any, **__: Any) -> None:
        print(f"{name}: warning: {_typed(said)}", file=sys.stderr)
        short.extend([said] * isinstance(said, NotReachedWarning))

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", NotReachedWarning)
            warnings.showwarning = show  # type: ignore[assignment]
            try:
                yield
            finally:
                sys.stdout.flush()
    except BrokenPipeError:  # the reader has closed the pipe, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(_BROKEN_PIPE)
    except SystemExit as end:
        if short and not end.code:
            sys.exit(1)
        raise
    except TimeLimitError as stop:
        print(f"{name}: {stop}", file=sys.stderr)
        sys.exit(TIME_IS_UP)
    except PROBLEMS as error:
        sys.exit(f"{name}: {_typed(error)}")
    except ImportError as error:
        sys.exit(f"{name}: {what_is_missing(error)}")
    except KeyboardInterrupt:
        # A second Ctrl-C would interrupt the shutdown of LAMMPS and MPI, which takes a while on a busy machine.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        # Below a progress bar.
        print(f"\n{name}: interrupted; {go_on}", file=sys.stderr)
        sys.exit(_INTERRUPTED)


def _typed(said: BaseException | str) -> str:
    """Format a message with the options of a command in place of the arguments of a function."""
    return said.with_options if isinstance(said, Sentence) else str(said)


def what_is_missing(error: ImportError) -> str:
    """Describe in one sentence which import failed and what to do.

    Examples
    --------
    >>> what_is_missing(ModuleNotFoundError("No module named 'numpy'", name="numpy"))  # doctest: +ELLIPSIS
    "No module named 'numpy' in ..., expected a Python with the requirements of jamshape; run ./run setup ..."
    """
    # Our own messages contain advice.
    said = " ".join(str(error).split())
    if not (error.name or error.path):
        return said
    return (
        f"{said} in {sys.executable}, expected a Python with the requirements of jamshape; {SET_UP}"
    )
