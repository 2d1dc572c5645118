"""Decks of LAMMPS, on states of one shape, and what running them tells."""

from __future__ import annotations

import hashlib
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from jamshape.files.h5md import read_attributes, read_packing
from jamshape.files.lammps_text import write_data
from jamshape.lammps.plugin import load_script_path
from jamshape.packing import Packing
from jamshape.shapes.shape import Interaction

ROOT = Path(__file__).resolve().parents[3]
SKIN = 0.3
_LONGEST = 80  # characters in the name of a file

_CHECKED, _KEPT = "delay 0 every 1 check yes", "delay 2000000000 every 1 check no"
MEASURES = {"force": _KEPT, "nve": _CHECKED, "step": _CHECKED, "memory": "delay 0 every 5 check no"}


class Style(NamedTuple):
    """A pair style of LAMMPS."""

    atoms: str
    """Atom style and what comes with it."""
    pair: Callable[[Packing], str]
    write: Callable[[Path, Packing], None]
    """Writes the data file."""
    nve: str
    """Fix that moves the particles without drag."""
    skin: float = SKIN
    is_ours: bool = False
    is_everywhere: bool = True
    """Whether all LAMMPS have it; those that do not are compared only if they are named."""
    instead: str = ""
    """Options of particles that take the place of the case's, at the same N and packing fraction."""


class Case(NamedTuple):
    """Particles, and the packing fractions at which they are looked at."""

    name: str
    particles: str
    """Options of compress.py."""
    phi: tuple[float, ...]


class Bench(NamedTuple):
    """Benchmark of one shape."""

    dimension: int
    cases: tuple[Case, ...]
    n: tuple[int, ...]
    compress: str
    """Options of compress.py that lead to a state."""
    step: str
    """The fix of a whole step."""
    most_steps: dict[str, int]
    """So many of a measure change the state by little."""
    styles: dict[str, Style]
    faster_than: dict[str, str]
    """Columns of how much faster a style is than one of LAMMPS's."""
    dearer_than: dict[str, str]
    tiles: tuple[int, ...]
    """Copies along each edge, of which the memory is looked at."""


class Run(NamedTuple):
    """Measurements of one run, from LAMMPS and the kernel."""

    n: float
    peak_bytes: int
    rate: float
    """Particles times steps, by seconds of a whole core."""
    core_share: float


def ours(sides: int, atoms: str, nve: str) -> Style:
    """Our pair style of the state's shape."""

    def pair(packing: Packing) -> str:
        return packing.shape.style(packing, Interaction(1.0, sides)).commands

    def write(path: Path, packing: Packing) -> None:
        types = packing.shape.style(packing, Interaction(1.0, sides)).types
        write_data(path, packing.with_(species=types))

    load = f'{atoms}\ninclude "{load_script_path()}"'
    return Style(load, pair, write, nve, is_ours=True)


def state(work: Path, bench: Bench, particles: str, phi: float, n: int) -> Packing:
    """Return a compressed state, made once, by a process of its own."""
    tag = re.sub(r"[^\w.]+", "_", particles).strip("_")
    if len(tag) > _LONGEST:
        tag = f"{tag[:_LONGEST]}_{hashlib.sha256(tag.encode()).hexdigest()[:8]}"
    path = work / f"{tag}_{phi:g}_{n}.h5"
    if not (path.exists() and read_attributes(path).get("finished")):
        told = f"{particles} {bench.compress} --dimension {bench.dimension} --n {n} --phi-end {phi}"
        command = [sys.executable, f"{ROOT}/pyscripts/compress.py", *shlex.split(told)]
        silent = subprocess.DEVNULL
        subprocess.run([*command, "--out", str(path)], check=True, stdout=silent)
    return read_packing(path)


def write_deck(path: Path, bench: Bench, style: Style, measure: str, packing: Packing) -> None:
    """Write a deck, which takes the variables `steps` and `tiles`, and its data file."""
    data = path.with_suffix(".data")
    style.write(data, packing)
    tiles = " ".join(["${tiles}"] * bench.dimension + ["1"] * (3 - bench.dimension))
    flow = bench.step if style.is_ours and measure in {"step", "memory"} else style.nve
    path.write_text(
        f"units lj\ndimension {bench.dimension}\n{style.atoms}\nread_data {data}\n"
        f"replicate {tiles}\n"
        f"{style.pair(packing)}\nneighbor {style.skin} bin\n"
        f"neigh_modify {MEASURES[measure]} one 10000 page 1000000\n"
        + (f"{flow}\n" if measure != "force" else "")
        + 'thermo 0\nrun ${steps}\nshell "grep VmHWM /proc/$PPID/status"\n'
    )


def run_deck(path: Path, plugin: Path, steps: int, tiles: int = 1) -> Run:
    """Run LAMMPS.

    Raises
    ------
    RuntimeError
        With its last words, if it fails.
    """
    variables = ["-var", "steps", str(steps), "-var", "tiles", str(tiles)]
    command = ["lmp", "-in", str(path), "-log", "none", "-nocite", *variables]
    environment = os.environ | {"JAMSHAPE_PLUGIN": str(plugin), "OMP_NUM_THREADS": "1"}
    lmp = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    loop = r"Loop time of (\S+) on 1 procs for (\d+) steps with (\d+) atoms.*?([\d.]+)% CPU"
    found, peak = re.search(loop, lmp.stdout, re.DOTALL), re.search(r"VmHWM:\s+(\d+)", lmp.stdout)
    if lmp.returncode or not found or not peak:
        msg = f"'{' '.join(command)}' failed, its last words:\n{(lmp.stdout + lmp.stderr)[-999:]}"
        raise RuntimeError(msg)
    seconds, done, n, percent = map(float, found.groups())
    return Run(n, 1024 * int(peak[1]), n * done / (seconds * percent / 100), percent / 100)
