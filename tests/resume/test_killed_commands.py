"""Commands that are no single run, killed at random moments: what they leave and where they get to.

Drivers of runs are killed in `test_drivers.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from drivers import EVERY
from killing import (
    GIVEN,
    command,
    differences,
    forked,
    killed,
    require_whole,
    uninterrupted,
)
from lattices import discs
from scenes import pressed
from superellipsoid_packings import pressed_superellipsoids
from thinned import quick

from jamshape.files.h5md import write_frames, write_packing
from jamshape.protocols.random_start import random_packing

pytestmark = pytest.mark.lammps

RODS = ("--alpha", 1, "--n", 16)
PACK = (*RODS, "--phi-start", 0.55, "--u0", 1e-6)
DYNAMICS = (*PACK, "--protocol", "dynamics", "--kappa", 1e-5, "--p-end", 3e-3)
STEPS = (*PACK, "--protocol", "steps", "--delta-phi", 5e-3)
# From the 1.6e-6 of its first jammed frame the search takes tens of steps, not hundreds.
PUBLISHED = (*RODS, "--phi-start", 0.55, "--u0", 1.5e-6, "--protocol", "marschall-2018")

Given = Mapping[str, Callable[[Path], None]]
"""Functions that write the input files of a run, by name."""

# --- what is given --------------------------------------------------------------------------------


@cache
def rods():
    return pressed(n=100)


@cache
def bodies():
    return pressed_superellipsoids(np.tile([1.0, 1.0, 1.5], (64, 1)), np.full(64, 1.5))


def jammed_discs(path):
    rows, columns = np.divmod(np.arange(16), 4)
    position = 0.98 * np.column_stack([columns + rows % 2 / 2, rows * np.sqrt(3) / 2])
    write_packing(path, discs(position, 0.98 * 4 * np.array([1, np.sqrt(3) / 2])), {"k_e": 1.0})


def one_of_rods(path):
    write_packing(path, rods())


def one_of_bodies(path):
    write_packing(path, bodies())


def many_frames(path):
    start = random_packing(100, 0.3, 1)
    write_frames(path, [start.with_(position=start.position + k / 300) for k in range(300)])


# --- commands -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """A command that is killed."""

    words: tuple
    results: tuple[str, ...]
    """Files that are as if nothing had happened; the first is where to write, or else the folder of all."""
    patches: tuple = ()
    """Constants that are other than usual."""
    given: Given = field(default_factory=dict)
    beside: tuple = ()
    """Options and the results that they name."""

    def require_same(self, expected, found):
        for result in self.results:
            assert not differences(expected / result, found / result)
        left = [{path.name for path in folder.iterdir()} for folder in (expected, found)]
        assert left[0] == left[1]

    def start(self, folder):
        out = folder / (self.results[0] if len(self.results) == 1 or self.beside else "")
        read = [folder / GIVEN / name for name in self.given]
        beside = [word if word.startswith("-") else folder / word for word in self.beside]
        words = [*self.words, *read, *beside, "--out", out]
        return forked(command, (words,), folder / "said.log", self.patches)


CASES = {
    "pack": Case(
        ("pack", *PACK),
        ("packing.h5",),
        patches=EVERY,
    ),
    "pack by dynamics": Case(("pack", *DYNAMICS), ("packing.h5",), patches=EVERY),
    "pack by steps": Case(
        ("pack", *STEPS),
        ("packing.h5",),
        patches=EVERY,
    ),
    "pack as published": Case(
        ("pack", *PUBLISHED, "--kappa", 1e-4, "--search", "bisection"),
        ("packing.h5",),
        patches=EVERY,
    ),
    "minimise": Case(
        ("minimise",),
        ("minimum.h5",),
        patches=(*EVERY, ("jamshape.protocols.stages.EVALUATIONS", 30)),
        given={"packing.h5": one_of_rods},
    ),
    "sweep": Case(
        ("sweep", "--alpha", 0, 1, *PACK[2:], "--samples", 1, "--jobs", 2),
        tuple(f"alpha{alpha}_seed1.h5" for alpha in (0, 1)),
    ),
    # These write at their end, or begin anew.
    "initial": Case(("initial", "--n", 400, "--phi", 0.45), ("start.data",)),
    "initial, H5MD": Case(("initial", "--n", 400, "--phi", 0.45, "--again"), ("start.h5",)),
    "modes": Case(
        ("modes", "--force", "--vectors"),
        ("modes.h5", "modes.png"),
        given={"packing.h5": jammed_discs},
        beside=("--plot", "modes.png"),
    ),
    "draw": Case(("draw",), ("packing.png",), given={"packing.h5": one_of_rods}),
    "draw in space": Case(
        ("draw", "--dpi", 60, "--level", 2), ("packing.png",), given={"packing.h5": one_of_bodies}
    ),
    "export": Case(("export", "--again"), ("again.h5",), given={"run.h5": many_frames}),
    "export for MDAnalysis": Case(("export",), ("run.h5md",), given={"run.h5": many_frames}),
    "export for HOOMD": Case(("export",), ("run.gsd",), given={"run.h5": many_frames}),
}


# --- kills ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Folders of runs that were let be, and how long these took."""
    made = {}

    def of(name):
        if name not in made:
            folder = tmp_path_factory.mktemp("whole") / "out"
            made[name] = folder, uninterrupted(CASES[name], folder)
        return made[name]

    return of


def kill_and_compare(whole, tmp_path, name, kills, seed):
    expected, seconds = whole(name)
    case, folder = CASES[name], tmp_path / "killed"
    count = killed(case, folder, seconds, kills, seed)
    require_whole(folder)
    case.require_same(expected, folder)
    return count


# Pictures are written by "modes" as by "draw", and files anew by "initial, H5MD" as by "export".
QUICK = {"pack", "sweep", "initial, H5MD", "modes"}


@pytest.mark.parametrize("name", quick(CASES, QUICK))
def test_a_run_that_is_killed_ends_as_if_nothing_had_happened(whole, tmp_path, name, measured):
    measured(kills=kill_and_compare(whole, tmp_path, name, kills=2, seed=1))


# With those of drivers, 300 in all.
KILLS = dict.fromkeys(CASES, 9) | {"sweep": 12}


@pytest.mark.validate
@pytest.mark.parametrize("name", CASES)
def test_hundreds_of_kills(whole, tmp_path, name, measured):
    """No file is damaged, no sample lost or repeated: three kills a run until there are enough."""
    count = runs = 0
    while count < KILLS[name]:
        runs += 1
        (tmp_path / str(runs)).mkdir()
        count += kill_and_compare(whole, tmp_path / str(runs), name, kills=3, seed=runs)
        assert runs < 3 * KILLS[name], "hardly any run is killed before it ends"
    measured(kills=count, runs=runs)
