"""Run every deck for a moment under valgrind, and count what it finds where the plugin is on the stack.

    python tests/valgrind_decks.py

Wrong reads and writes, values that nobody has set, and memory that is lost. What LAMMPS, MPI and Python do by
themselves is left out. The exit code is 1 if anything is found.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

from jamshape.lammps.plugin import PLUGIN_NAME, decks_path, plugin_path

RODS = {"n": 16, "alpha": 1, "kappa": 1e-2, "dt": 0.1, "phi_end": 0.9, "rows": 20, "frames": 4}
BODIES = {"n": 12, "p": 1.5, "w2": 1.5, "kappa": 1e-2, "phi_end": 0.9, "rows": 20, "frames": 4}
# Decks by the names of the files that they write: a minimisation begins with what a compression has left.
RUNS = {
    "rods": ("compress_spherocylinder", RODS | {"sides": "two"}),
    "rkc2": ("compress_spherocylinder", RODS | {"integrator": "rkc2 tolerance 1e-3"}),
    "minimum": ("minimize_spherocylinder", {"restart": "rods", "maxiter": 20}),
    "bodies": ("compress_superellipsoid", BODIES),
    "minimum_of_bodies": ("minimize_superellipsoid", {"restart": "bodies", "maxiter": 20}),
}
SUPPRESSED = Path("/usr/share/openmpi/openmpi-valgrind.supp")
VALGRIND = (
    "valgrind",
    "--leak-check=full",
    "--show-leak-kinds=definite",
    "--num-callers=60",
    "--xml=yes",
)


def found_in(report: Path) -> tuple[list[str], int]:
    """Read what valgrind has found: errors with the plugin on the stack, in words, and how many there are of others."""
    ours, others = [], 0
    for error in ET.parse(report).iter("error"):
        frames = [frame for stack in error.findall("stack") for frame in stack.findall("frame")]
        if any((frame.findtext("obj") or "").endswith(PLUGIN_NAME) for frame in frames):
            what = error.findtext("what") or error.findtext("xwhat/text")
            places = [frame.findtext("fn") or frame.findtext("obj") or "?" for frame in frames]
            ours.append("\n    ".join([f"{error.findtext('kind')}: {what}", *places]))
        else:
            others += 1
    return ours, others


def run_under_valgrind(folder: Path, name: str) -> Path:
    """Run a deck in a folder, and return valgrind's report; the program ends where the deck does not."""
    deck, settings = RUNS[name]
    given = {
        key: folder / f"{value}.restart" if key == "restart" else value
        for key, value in settings.items()
    }
    words = [
        str(word)
        for pair in (given | {"out": folder / name, "jamshape": decks_path().parent}).items()
        for word in ("-var", *pair)
    ]
    report = folder / f"{name}.xml"
    silent = [f"--suppressions={SUPPRESSED}"] if SUPPRESSED.is_file() else []
    done = subprocess.run(
        [*VALGRIND, f"--xml-file={report}", *silent, "lmp", "-nocite", "-log", "none",
         "-in", decks_path() / f"{deck}.in", *words],
        env={**os.environ, "JAMSHAPE_PLUGIN": str(plugin_path())}, cwd=folder, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
    )  # fmt: skip
    if done.returncode:
        sys.exit(f"{deck}.in ended with {done.returncode} under valgrind:\n{done.stdout[-2000:]}")
    return report


def main() -> int:
    """Run all, tell what was found."""
    for program in ("valgrind", "lmp"):
        if not shutil.which(program):
            sys.exit(f"found no {program}, expected it: run 'apt-get install valgrind lammps'")
    total = 0
    with tempfile.TemporaryDirectory() as place:
        for name in RUNS:
            ours, others = found_in(run_under_valgrind(Path(place), name))
            total += len(ours)
            print(
                f"{name}: {len(ours)} in the plugin, {others} without it",
                *ours,
                sep="\n  ",
                flush=True,
            )
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())
