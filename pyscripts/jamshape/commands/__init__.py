"""The command ``jamshape``: one module for each subcommand, loaded on demand.

Each module has ``options_of()``, which makes the parser, ``main(options)``, which returns the exit code, and may
have ``GO_ON``, advice after Ctrl-C. This file needs only the standard library and
avoids recent syntax, so that ``jamshape --help`` is quick and an old or bare Python
gets advice.
"""

from __future__ import annotations

import difflib
import importlib
import importlib.metadata
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, NoReturn

from jamshape.command import SET_UP, sentences

if TYPE_CHECKING:
    from argparse import ArgumentParser

COMMANDS = {
    "compress": "compress particles through jamming; record p(phi) and snapshots",
    "pack": "make one mechanically stable packing at a chosen energy",
    "minimise": "minimise the energy of a state of your own",
    "slow": "compress at any rate, however slow; record p(phi)",
    "shear": "shear at a constant rate; record stress, order and snapshots",
    "cycle": "shear to and fro; record stress, and displacements from cycle to cycle",
    "aqs": "shear by small steps with a minimisation after each; record stress and its drops",
    "ladder": "take a packing through energies; record which contacts open and close",
    "sweep": "make many packings on all cores",
    "reproduce": "make all data and figures of a paper, with its numbers beside ours",
    "modes": "compute vibrational modes and elastic moduli of a packing",
    "draw": "draw packings",
    "info": "describe a file: its kind, its content, and how to continue it",
    "export": "export packings to other programs, such as OVITO and MDAnalysis",
    "convert": "convert files of jamshape 0.1.0 to the present format",
    "initial": "make a random start without overlaps, for a deck or for Python",
    "doctor": "list what this installation can do, and what to install for the rest",
    "plugin": "locate the LAMMPS plugin, and show how a deck loads it",
}
"""Subcommands, each a module of this package, with their descriptions."""

OLDEST_PYTHON = (3, 11)

_NAME = "jamshape"
_WRONG_USE = 2  # as in argparse

_HELP = """\
usage: {name} COMMAND [OPTIONS]

Jamming of soft, frictionless, athermal particles that are not round.

commands:
{commands}

options:
  -h, --help  show this text
  --version   show the version

{name} COMMAND --help explains the options of a command, with examples. The last line that most commands print is one
JSON object; interrupted long commands continue when started again."""


class _Called(NamedTuple):
    """Invocation of a subcommand."""

    name: str
    """Prefix of its messages."""
    words: str
    """Words in the examples of its help."""


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line ``jamshape COMMAND ...`` and end with its exit code."""
    given = sys.argv[1:] if arguments is None else arguments
    first = given[0] if given else ""
    if first in COMMANDS:
        called = f"{_NAME} {first}"
        _run(first, given[1:], _Called(called, called))
    if first in {"-h", "--help", "--version"}:
        with sentences(_NAME):
            print(_version() if first == "--version" else _help())
        sys.exit(0)
    print(f"{_NAME}: {_unknown(first)}" if first else _help(), file=sys.stderr)
    sys.exit(_WRONG_USE)


def start(command: str) -> NoReturn:
    """Run a script that is a subcommand with its own name."""
    script = sys.argv[0]
    _run(command, sys.argv[1:], _Called(Path(script).name, f"python {script}"))


def options_of(command: str) -> ArgumentParser:
    """Make the parser of a subcommand; its help is what ``jamshape COMMAND --help`` prints."""
    parser: ArgumentParser = importlib.import_module(f"{__name__}.{command}").options_of()
    parser.prog = f"{_NAME} {command}"
    return parser


def _run(command: str, arguments: list[str], called: _Called) -> NoReturn:
    with sentences(called.name):
        _require_python()
        module = importlib.import_module(f"{__name__}.{command}")
        # Decks run `initial` on one rank; all other commands refuse several ranks.
        if hasattr(module, "GO_ON"):
            importlib.import_module("jamshape.checks").require_one_process()
    parser = options_of(command)
    parser.prog = called.name
    parser.description = (parser.description or "").replace(
        f"{_NAME} {command} ", f"{called.words} "
    )
    options = parser.parse_args(arguments)
    with sentences(called.name, *([module.GO_ON] if hasattr(module, "GO_ON") else [])):
        sys.exit(module.main(options))


def _require_python() -> None:
    """Refuse a Python that is too old."""
    if sys.version_info < OLDEST_PYTHON:
        found, least = (".".join(map(str, v[:2])) for v in (sys.version_info, OLDEST_PYTHON))
        msg = f"{sys.executable} is Python {found}, expected {least} or newer; {SET_UP}"
        raise RuntimeError(msg)


def _help() -> str:
    width = max(map(len, COMMANDS))
    rows = [f"  {name:{width}}  {does}" for name, does in COMMANDS.items()]
    return _HELP.format(name=_NAME, commands="\n".join(rows))


def _version() -> str:
    try:
        return f"{_NAME} {importlib.metadata.version(_NAME)}"
    except importlib.metadata.PackageNotFoundError:
        return f"{_NAME}, which is not installed: {SET_UP}"


def _unknown(command: str) -> str:
    """Describe an unknown command, with similar ones."""
    close = difflib.get_close_matches(command, COMMANDS) or list(COMMANDS)
    return f"there is no command {command!r}, expected {' or '.join(close)}; see {_NAME} --help"
