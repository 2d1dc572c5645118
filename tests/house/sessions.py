"""Bash that runs what a page shows, with every program but its own left to this process.

A program is a shim: it hands its words over through a pipe, waits for the exit code and ends with it. So variables,
loops, folders and globs are those of bash, and commands of jamshape take no time to start.
"""

from __future__ import annotations

import os
import signal
import subprocess
import threading
from contextlib import suppress
from pathlib import Path

from code_blocks import ROOT

BLOCK = "block"
"""The program that says which block of the page begins."""

PROGRAMS = (
    "auditwheel", "git", "jamshape", "lmp", "mpirun", "pip", "pipx", "python", "python3", "run", "sbatch", "snakemake",
)  # fmt: skip

OF_BASH = ("basename", "mkdir")
"""All else that a page may call: nothing that changes the machine."""

SHIM = """#!/bin/bash
printf '%s\\0' "$PWD" "${0##*/}" "$@" >"$SESSION/asked"
read -r code <"$SESSION/answered"
exit "$code"
"""


# Of the clone, to read from.
LINKS = ("analysis", "inputs", "pyscripts", "tests", "pyproject.toml", "docs/results/tables")


def make_programs(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for name in (*PROGRAMS, BLOCK):
        path = folder / name
        path.write_text(SHIM)
        path.chmod(0o755)
    for name in OF_BASH:
        if not (folder / name).exists():
            (folder / name).symlink_to(f"/usr/bin/{name}")


def make_clone(folder):
    """Make what looks like a clone that was set up: its folders to read from, and programs."""
    make_programs(folder / ".venv" / "bin")
    (folder / "docs" / "results").mkdir(parents=True)
    for name in LINKS:
        (folder / name).symlink_to(ROOT / name)
    (folder / "run").symlink_to(folder / ".venv" / "bin" / "run")


def run_in_bash(script, folder, carry_out):
    """Run a script in a clone; `carry_out` takes folder, program and words of each call in its turn."""
    pipes = folder.parent / f"{folder.name}.session"
    pipes.mkdir()
    asked, answered = pipes / "asked", pipes / "answered"
    for pipe in (asked, answered):
        os.mkfifo(pipe)
    with (pipes / "errors").open("w") as errors:
        bash = subprocess.Popen(
            ["/bin/bash", "-eu", "-o", "pipefail", "-c", script], cwd=folder, start_new_session=True,
            env={"PATH": str(folder / ".venv" / "bin"), "HOME": str(folder), "SESSION": str(pipes)},
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=errors,
        )  # fmt: skip

    def tell_end():
        bash.wait()
        asked.write_bytes(b"")

    end = threading.Thread(target=tell_end)
    end.start()
    over = False
    try:
        while call := asked.read_bytes():
            place, program, *words = call.decode().split("\0")[:-1]
            answered.write_text(f"{carry_out(Path(place), program, words)}\n")
        over = True
    finally:
        if not over:
            with suppress(ProcessLookupError):
                os.killpg(bash.pid, signal.SIGKILL)
            asked.read_bytes()
        end.join()
    assert bash.returncode == 0, (pipes / "errors").read_text()
