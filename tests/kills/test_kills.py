"""Every driver, the sweep and the deck, killed at random moments: what they leave and where they get to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from killing import deck, differences, forked, killed, require_whole, uninterrupted
from lammps_scenes import REPOSITORY, nearest_image

from jamshape.files.lammps_text import read_dump

pytestmark = pytest.mark.lammps

RODS = ("--alpha", 1, "--n", 16)
PACK = (*RODS, "--phi-start", 0.55, "--u0", 1e-6)
DYNAMICS = (*PACK, "--kappa", 1e-5, "--p-end", 3e-4)
STEPS = (*PACK, "--way", "steps", "--delta-phi", 2e-3)


@dataclass(frozen=True)
class Case:
    """What is killed."""

    words: tuple
    results: tuple[str, ...]
    """Files that are as if nothing had happened."""
    resume: tuple = ()
    """Beside the words, where there is something to go on from."""
    patches: tuple = ()
    """Constants that are other than usual."""

    def require_same(self, expected, found):
        for result in self.results:
            assert not differences(expected / result, found / result)

    def start(self, folder):
        out = folder / (self.results[0] if len(self.results) == 1 else "")
        resume = self.resume if out.is_file() else ()
        return forked([*self.words, *resume, "--out", out], folder / "said.log", self.patches)


CASES = {
    "compress": Case(
        ("compress", *RODS, "--kappa", 2e-4, "--phi-start", 0.5, "--phi-end", 0.86),
        ("run.h5",),
        ("--resume",),
    ),
    "pack by dynamics": Case(("pack", *DYNAMICS), ("packing.h5",)),
    "pack by steps": Case(
        ("pack", *STEPS),
        ("packing.h5",),
        patches=(("jamshape.protocols.by_steps._STORE_SECONDS", 0.0),),
    ),
    "pack as published": Case(
        ("pack", *PACK, "--protocol", "marschall-2018", "--kappa", 1e-4, "--search", "halving"),
        ("packing.h5",),
    ),
    "slow": Case(
        ("slow", *RODS, "--kappa", 1e-6, "--phi-start", 0.78, "--phi-end", 0.86),
        ("slow.h5",),
        patches=(("jamshape.flow.slow_recording.STEPS_PER_FRAME", 20),),
    ),
    "sweep": Case(
        ("sweep", "--alpha", 0, 1, *DYNAMICS[2:], "--samples", 1, "--jobs", 2),
        tuple(f"alpha{alpha}_seed1.h5" for alpha in (0, 1)),
    ),
}


@dataclass(frozen=True)
class Deck:
    """A deck of LAMMPS that is killed."""

    settings: tuple

    def start(self, folder):
        out = folder / "out"
        begun = any(out.glob("restart.[ab]"))
        variables = [("out", out), *self.settings, *([("restart", out)] if begun else [])]
        words = [word for name, value in variables for word in ("-var", name, value)]
        return deck(["-in", DECK, *words], folder / "said.log")

    def require_same(self, expected, found):
        """Frames are the same to a bound: after a restart LAMMPS sums in another order."""
        one, other = (read_dump(folder / "out" / "particles.dump") for folder in (expected, found))
        assert [frame.step for frame in other] == [frame.step for frame in one]
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a.box.edges, b.box.edges)
            assert np.abs(nearest_image(b.position - a.position, a.box)).max() < 1e-10
            assert np.abs(np.sin((b.orientation - a.orientation) / 2)).max() < 1e-10
        left = [{path.name for path in (f / "out").iterdir()} for f in (expected, found)]
        assert left[0] == left[1]


DECK = REPOSITORY / "inputs" / "compress_spherocylinder.in"
CASES["deck"] = Deck((("n", 24), ("alpha", 1), ("kappa", 2e-4), ("phi_end", 0.86), ("dt", 0.1)))


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


@pytest.mark.parametrize("name", CASES)
def test_a_run_that_is_killed_ends_as_if_nothing_had_happened(whole, tmp_path, name, measured):
    measured(kills=kill_and_compare(whole, tmp_path, name, kills=2, seed=1))


# 300 in all.
KILLS = dict.fromkeys(CASES, 54) | {"sweep": 30}


@pytest.mark.validate
@pytest.mark.parametrize("name", CASES)
def test_hundreds_of_kills(whole, tmp_path, name, measured):
    """No file is damaged, no sample lost or repeated: three kills a run until there are enough."""
    count = runs = 0
    while count < KILLS[name]:
        runs += 1
        (tmp_path / str(runs)).mkdir()
        count += kill_and_compare(whole, tmp_path / str(runs), name, kills=3, seed=runs)
        assert runs < KILLS[name], "hardly any run is killed before it ends"
    measured(kills=count, runs=runs)
