"""Replacements of programs on pages: calls in this process, or a check of their words."""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import io
import re
import runpy
import shlex
import sys
import tomllib
from pathlib import Path
from unittest import mock

from code_blocks import ROOT
from lammps_runs import MPIRUN, run_program
from sessions import make_clone, make_programs

from jamshape.checks import require_options
from jamshape.commands import COMMANDS, main, options_of

OURS = ("analysis/", "docs/", "inputs/", "pyscripts/", "tests/")
"""Folders of the clone: what a command line names in them is there."""

SCRIPTS = ("analysis/", "pyscripts/")
"""Folders of scripts that a test may run; others change the machine."""

NEEDED = {".gsd": "gsd", ".ovito": "ovito", ".h5md": "MDAnalysis"}
"""Modules required to write files with this suffix."""


# --- to run them ----------------------------------------------------------------------------------


def run(place, program, words):
    """Run a program as it is; return its exit code."""
    if program == "jamshape":
        return run_jamshape(place, words)
    if program.startswith("python") and words[0].startswith(SCRIPTS):
        return run_script(place, words)
    if program in {"lmp", "mpirun"}:
        return run_lammps(place, program, words)
    msg = f"{program} {shlex.join(words)}: expected a program that tests can run; name the block in NOT_RUN"
    raise AssertionError(msg)


def run_jamshape(place, words):
    out = next((words[k + 1] for k, word in enumerate(words) if word == "--out"), "")
    needs = "snakemake" if words[0] == "reproduce" else NEEDED.get(Path(out).suffix, "jamshape")
    if not importlib.util.find_spec(needs):
        check_jamshape(words)
        return 0
    with contextlib.chdir(place), contextlib.redirect_stdout(io.StringIO()):
        code = ended(lambda: main(words))
        assert code or not out or "--dry-run" in words or Path(out).exists(), shlex.join(words)
    return code


def run_script(place, words):
    with contextlib.chdir(place), contextlib.redirect_stdout(io.StringIO()):
        return ended(lambda: start_script(place / words[0], words[1:]))


def run_lammps(place, program, words):
    line = [*MPIRUN, *words] if program == "mpirun" else [program, *words]
    done = run_program(line, place)
    assert done.returncode == 0, done.stdout[-3000:]
    return 0


def start_script(path, words):
    before = sys.path[:]
    try:
        with mock.patch.object(sys, "argv", [str(path), *words]):
            sys.path.insert(0, str(path.resolve().parent))
            runpy.run_path(str(path), run_name="__main__")
    finally:
        sys.path[:] = before


def ended(call):
    """Call what may end Python; return the exit code, or the sentence that it ends with."""
    try:
        call()
    except SystemExit as end:
        return end.code or 0
    return 0


# --- to look at their words -----------------------------------------------------------------------


def check(place, program, words):
    """Refuse words that the program would refuse, and files of ours that are not there."""
    missing = [w for w in words if w.startswith(OURS) and not (ROOT / w).exists() and "*" not in w]
    assert missing == [], f"{program} {shlex.join(words)}: no such files"
    if program == "jamshape":
        check_jamshape(words)
    elif program.startswith("python"):
        check_python(place, words)
    elif program == "mpirun":
        check(place, words[2], words[3:])
    elif program in CHECKS:
        CHECKS[program](place, words)


def check_jamshape(words):
    if words and words[0] not in {"--help", "--version"}:
        assert words[0] in COMMANDS, f"no command {words[0]}"
        parsed(lambda: options_of(words[0]).parse_args(words[1:]), words)


def check_python(place, words):
    if words[0] == "-m" and words[1] == "venv":
        make_programs(place / words[2] / "bin")
    elif words[0] == "-m":
        assert words[1] in {"pip", "jamshape", "pytest"}
        if words[1] == "pytest":  # its folders are there, see `check`
            return
        CHECKS.get(words[1], lambda _, rest: check_jamshape(rest))(place, words[2:])
    elif not words[0].startswith("tests/"):  # those set up machines
        check_script(tuple(words))


@functools.cache
def check_script(words):
    """Start a script until its command line is parsed, and numbers are in their ranges."""
    with (
        mock.patch(
            "jamshape.command.run", lambda parser, _: require_options(vars(parser.parse_args()))
        ),
        mock.patch("jamshape.commands.start", lambda name: check_jamshape([name, *words[1:]])),
    ):
        parsed(lambda: start_script(ROOT / words[0], words[1:]), words)


def parsed(call, words):
    with contextlib.redirect_stderr(io.StringIO()) as said, contextlib.redirect_stdout(said):
        code = ended(call)
    assert code == 0 or "--help" in words, f"{shlex.join(words)}: {said.getvalue()}"


def check_pip(_, words):
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text())["dependency-groups"]
    assert {words[k + 1] for k, word in enumerate(words) if word == "--group"} <= set(groups)


def check_git(place, words):
    if words[0] == "clone":
        make_clone(place / words[-1])


def check_lmp(place, words):
    if "-in" not in words:
        return
    deck = place / words[words.index("-in") + 1]
    if deck.is_file():  # else a reader's own
        text = deck.read_text(encoding="utf-8") + (deck.parent / "run.lmp").read_text(
            encoding="utf-8"
        )
        known = {"data", "restart", *re.findall(r"^variable +(\w+) +index", text, re.MULTILINE)}
        assert {words[k + 1] for k, word in enumerate(words) if word == "-var"} <= known


def check_snakemake(_, words):
    path = ROOT / words[words.index("-s") + 1]
    rules = path.read_text(encoding="utf-8")
    for include in re.findall(r'^include: "(.*)"', rules, re.MULTILINE):
        rules += (path.parent / include).read_text(encoding="utf-8")
    for word in words[words.index("--config") + 1 :]:
        name, equal, value = word.partition("=")
        if not equal or word.startswith("--"):
            break
        assert f'"{name}"' in rules, f"no setting {name}"
        if name == "sweep":
            check_jamshape(["sweep", *shlex.split(value), "--out", "out"])


def check_run(_, words):
    parts = re.findall(r"^#   \./run (\w+)", (ROOT / "run").read_text(), re.MULTILINE)
    assert words[0] in parts, f"./run has no part {words[0]}"


CHECKS = {
    "git": check_git, "lmp": check_lmp, "pip": check_pip, "run": check_run, "snakemake": check_snakemake,
}  # fmt: skip
