"""How scripts and commands parse, report and end; the standard library is all that it needs.

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
import os
import signal
import sys
import warnings
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from jamshape.checks import NotReachedWarning, Sentence, require_options

# What wrong input, missing files and searches without an end raise, each with one sentence.
PROBLEMS = (OSError, ValueError, RuntimeError)

SET_UP = "run ./run setup in the repository, then use .venv/bin/python"
"""What to do where something that jamshape needs is not there."""

_INTERRUPTED = 130  # as shells tell that a program was ended by Ctrl-C
_BROKEN_PIPE = 141  # and that nobody reads what it writes


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


def add_numbers(parser: ArgumentParser, *rows: tuple[str, int | float, str]) -> None:
    """Add options that are numbers, each with its name, what it is where it is left out, and what it means.

    What is left out is None: the function that the command calls knows what is usual, and what was not typed cannot
    contradict anything.
    """
    for name, default, meaning in rows:
        parser.add_argument(name, type=type(default), help=f"{meaning} ({default})")


def typed(options: Namespace, *names: str) -> dict[str, Any]:
    """Pick the options of these names that were typed."""
    found = {name: getattr(options, name) for name in names}
    return {name: value for name, value in found.items() if value is not None}


def report(found: Mapping[str, Any]) -> None:
    """Print one line of JSON with what `plain` makes of it."""
    print(json.dumps(plain(found), allow_nan=False))


def plain(value: Any) -> Any:
    """Turn a value into what JSON knows.

    NaN and infinity become null, what has a method ``as_json`` what that returns, named tuples objects, arrays and other
    tuples lists, paths text.
    """
    if hasattr(value, "tolist"):  # arrays and numbers of numpy
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
    """Parse the command line, run a script and end with the exit code that it returns.

    Numbers are checked by their names before. Problems end as `sentences` tells.
    """
    options = parser.parse_args()
    with sentences(parser.prog):
        require_options(vars(options))
        sys.exit(main(options))


@contextmanager
def sentences(name: str, go_on: str = "it may be started again") -> Iterator[None]:
    """End the program with one sentence after its name where its body raises what users may meet; warn in one, too.

    The exit code is 1 after one of `PROBLEMS`, where a module is missing, and where a result did not reach its goal
    (`checks.NotReachedWarning`), and 130 after Ctrl-C.

    Parameters
    ----------
    name : str
        Of the program, as it was called.
    go_on : str
        How to go on after Ctrl-C.
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
    except BrokenPipeError:  # whoever reads has seen enough, as `head` has
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(_BROKEN_PIPE)
    except SystemExit as end:
        if short and not end.code:
            sys.exit(1)
        raise
    except PROBLEMS as error:
        sys.exit(f"{name}: {_typed(error)}")
    except ImportError as error:
        sys.exit(f"{name}: {what_is_missing(error)}")
    except KeyboardInterrupt:
        # Pressed again, it would cut the end of LAMMPS and MPI off, which takes a while on a busy machine.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        # Below a bar of progress.
        print(f"\n{name}: interrupted; {go_on}", file=sys.stderr)
        sys.exit(_INTERRUPTED)


def _typed(said: BaseException | str) -> str:
    """Write a sentence with the options of a command in place of the arguments of a function."""
    return said.with_options if isinstance(said, Sentence) else str(said)


def what_is_missing(error: ImportError) -> str:
    """Say in one sentence what could not be imported and what to do.

    Examples
    --------
    >>> what_is_missing(ModuleNotFoundError("No module named 'numpy'", name="numpy"))  # doctest: +ELLIPSIS
    "No module named 'numpy' in ..., expected a Python with all that jamshape needs; run ./run setup ..."
    """
    # Sentences of our own say what to do themselves.
    said = " ".join(str(error).split())
    if not (error.name or error.path):
        return said
    return f"{said} in {sys.executable}, expected a Python with all that jamshape needs; {SET_UP}"
