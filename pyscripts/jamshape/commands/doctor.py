"""List what this installation can do, and what to install for the rest.

    jamshape doctor

Looks for the compiled modules, LAMMPS with the plugin, MPI, and the programs that some commands use. Each line reports
one of these and, if it is missing, its purpose and how to install it. The last line of standard output is one JSON object for reports of errors; the
exit code is 0 if packings can be made and LAMMPS loads the plugin.
"""

from __future__ import annotations

import importlib
import platform
import shutil
import sys
from argparse import ArgumentParser, Namespace
from importlib import metadata
from typing import Any, NamedTuple

from jamshape.command import parser_of, report
from jamshape.commands.plugin import version_of_lmp, version_of_module
from jamshape.lammps.plugin import PluginError, built_for, newest_tested, plugin_path
from jamshape.recording.workers import cores

NEEDED = ("numpy", "scipy", "h5py", "matplotlib", "tqdm", "lazy-loader")
"""Packages that are always there."""

OPTIONAL = {
    "mpi4py": "Python on several ranks",
    "gsd": "files of HOOMD-blue",
    "freud-analysis": "analysis with freud",
    "MDAnalysis": "analysis with MDAnalysis",
    "ovito": "pictures by OVITO",
    "pandas": "tables of ensembles as data frames",
    "snakemake": "jamshape reproduce",
}
"""Packages of PyPI and what needs them."""

PROGRAMS = {
    "ffmpeg": "movies as MP4; without it they are GIF",
    "mpirun": "LAMMPS on several ranks",
}


class Found(NamedTuple):
    """A part of the installation."""

    name: str
    version: str | None
    """None if it is missing or does not work."""
    advice: str = ""
    """Advice if it is missing."""
    is_needed: bool = False


def options_of() -> ArgumentParser:
    """Make the parser."""
    return parser_of(__doc__)


def main(_: Namespace) -> int:
    """Look, print, report; return the exit code."""
    parts = [*here(), *packages(), *lammps(), *programs()]
    width = max(len(part.name) for part in parts)
    for part in parts:
        mark = "ok" if part.version else "--" if not part.is_needed else "NO"
        print(f"{mark}  {part.name:{width}}  {part.version or part.advice}")
    works = all(part.version for part in parts if part.is_needed)
    print("\nAll that is needed works." if works else "\nLines with NO give the remedy.")
    report({"works": works} | {part.name: part.version for part in parts})
    return 0 if works else 1


def here() -> list[Found]:
    """Describe the machine, its Python and the compiled module."""
    system = f"{platform.system()} {platform.release()} on {platform.machine()}, {cores()} cores"
    found = [
        Found("jamshape", metadata.version("jamshape")),
        Found("Python", f"{platform.python_version()} at {sys.executable}"),
        Found("system", system),
    ]
    try:
        contact: Any = importlib.import_module("jamshape._contact")
    except ImportError as error:
        advice = f"it does not load ({error}): install jamshape again with this Python"
        return [*found, Found("compiled module", None, advice, is_needed=True)]
    sets = ", ".join(contact.instruction_sets())
    return [*found, Found("compiled module", f"instruction sets {sets}", is_needed=True)]


def packages() -> list[Found]:
    """List Python packages, needed and optional ones."""
    found = [Found(name, _version(name), f"pip install {name}", is_needed=True) for name in NEEDED]
    found += [
        Found(name, _version(name), f"for {use}: pip install {name}")
        for name, use in OPTIONAL.items()
    ]
    return found


def lammps() -> list[Found]:
    """Find the plugin, and the LAMMPS that loads it."""
    try:
        path, version = plugin_path(), built_for()
    except PluginError as error:
        return [Found("plugin", None, str(error), is_needed=True)]
    tested = newest_tested()
    newer = f", newer than {tested}, the newest tested" if version > tested else ""
    found = [Found("plugin", f"for LAMMPS {version}{newer} at {path}", is_needed=True)]
    for name, other in (("Python module lammps", version_of_module()), ("lmp", version_of_lmp())):
        is_it = other == version
        told = f"is LAMMPS {other}" if other else "is not there"
        advice = (
            f"{told}, expected {version}, for which the plugin was built: install that version, or jamshape "
            "again beside this one"
        )
        found.append(Found(name, f"LAMMPS {other}" if is_it else None, advice, is_needed=True))
    return found


def programs() -> list[Found]:
    """Look for programs in PATH."""
    return [
        Found(name, shutil.which(name), f"for {use}: install {name}")
        for name, use in PROGRAMS.items()
    ]


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
