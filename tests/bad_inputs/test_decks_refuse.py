"""Decks with settings that are none: one sentence of all ranks, exit code 1, nothing run, nothing written."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from itertools import product
from pathlib import Path

import pytest

from jamshape import checks
from jamshape.lammps.deck.settings import RANGES, WHOLE
from jamshape.lammps.plugin import PluginError, built_for, include_line, plugin_path
from jamshape.shapes.table import SHAPES

sys.path.append(str(Path(__file__).parents[1] / "styles"))

from lammps_scenes import ENVIRONMENT, MPIRUN, REPOSITORY, complaints_of

pytestmark = pytest.mark.lammps

INPUTS = REPOSITORY / "inputs"
RODS, BODIES = "compress_spherocylinder", "compress_superellipsoid"
RELAXED = "minimize_spherocylinder"

CASES = [
    (RODS, ["kapa", "1e-6"], "no setting kapa, expected kappa"),
    (RODS, ["epsilon", "1"], "no setting epsilon"),
    (RODS, ["kappa", "0"], "kappa is '0', expected"),
    (RODS, ["kappa", "nan"], "kappa is 'nan'"),
    (RODS, ["alpha", "4;touch X"], "alpha is '4;touch X'"),
    (RODS, ["alpha", "$(touch X)"], r"alpha is '\?\(touch X\)'"),
    (RODS, ["alpha", "1e5"], "alpha is '1e5', expected 0 or a number from 1e-06 to 100"),
    (RODS, ["n", "0"], "n is '0', expected a whole number"),
    (RODS, ["n", "16\nshell touch X"], "n is '16.nshell touch X'"),
    (RODS, ["rows", "0"], "rows is '0'"),
    (RODS, ["frames", "0"], "frames is '0'"),
    (RODS, ["dt", "1e-300"], "dt is '1e-300'"),
    (RODS, ["seed", "-1"], "seed is '-1'"),
    (RODS, ["sides", "three"], "sides is 'three', expected one or two"),
    (RODS, ["integrator", "heun\nshell touch X"], "integrator is"),
    (RODS, ["phi_end", "0.4"], "phi_start is 0.4 and phi_end 0.4, expected an end above the start"),
    (RODS, ["phi_start", "0.8"], "stalled at phi"),
    (RODS, ["data", "none;touch X"], "Found no file none;touch X"),
    (RODS, ["out", ""], "out is ''"),
    (BODIES, ["p", "0.5"], "p is '0.5', expected a number from 0.55 to 10"),
    (BODIES, ["w1", "1.5"], "w1 is '1.5'"),
    (BODIES, ["w2", "`touch X`"], "w2 is '`touch X`'"),
    (RELAXED, ["maxiter", "-5"], "maxiter is '-5'"),
]  # fmt: skip
AT_ONCE = ["phi_start", "0.8"]


def lmp(folder, deck, *words, ranks=1, inputs=INPUTS):
    several = [*MPIRUN, "-np", str(ranks)] if ranks > 1 else []
    return subprocess.run(
        [*several, "lmp", "-in", inputs / f"{deck}.in", *words], cwd=folder,
        env=os.environ | ENVIRONMENT | {"JAMSHAPE_PLUGIN": str(plugin_path())},
        text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60, check=False,
    )  # fmt: skip


def variables(*pairs):
    return [word for name, value in pairs for word in ("-var", name, value)]


@pytest.mark.parametrize(("deck", "given", "words"), CASES, ids=str)
def test_a_deck_refuses(deck, given, words, tmp_path):
    state = [("restart", __file__)] if deck == RELAXED else []
    ranks = 2 if given[0] in {"alpha", "phi_start"} else 1
    done = lmp(tmp_path, deck, *variables(given, *state), ranks=ranks)
    [sentence] = complaints_of(done)
    assert sentence.startswith("ERROR: ")
    assert re.search(words, sentence)
    assert done.returncode == 1
    # Whether rods find room is known only where they are put.
    left = {path.name for path in tmp_path.iterdir()}
    assert left <= ({"runs"} if given == AT_ONCE else set())


STRANGE = "x;touch X $(touch X) `touch X` \"q\" 'r' [a] *b* é#&%"


def test_a_folder_of_any_name_works(tmp_path):
    settings = [("n", "16"), ("kappa", "1e-2"), ("dt", "0.1"), ("phi_end", "0.6")]
    done = lmp(tmp_path, RODS, *variables(*settings, ("out", STRANGE)))
    assert done.returncode == 0, done.stdout[-3000:]
    assert [path.name for path in tmp_path.iterdir()] == [STRANGE]
    assert (tmp_path / STRANGE / "final.restart").is_file()
    for path in (tmp_path / STRANGE).iterdir():
        assert path.name != "X"


@pytest.mark.parametrize("ranks", [1, 2])
def test_decks_of_a_repository_of_any_name_work(ranks, tmp_path):
    inputs = tmp_path / STRANGE / "${HOME} $n" / "inputs"
    shutil.copytree(INPUTS, inputs)
    settings = [("n", "16"), ("kappa", "1e-2"), ("dt", "0.1"), ("phi_end", "0.6"), ("out", "run")]
    done = lmp(tmp_path, RODS, *variables(*settings), ranks=ranks, inputs=inputs)
    assert done.returncode == 0, done.stdout[-3000:]
    assert {path.name for path in tmp_path.iterdir()} == {STRANGE, "run"}


OF_DEBIAN_12 = 20210929
READ_BY_ALL = ["a b", 'a "q"', "[*]#&;`touch X`"]
READ_ONCE = ["$(touch X)${HOME}$n", "it's"]


@pytest.mark.parametrize("name", READ_BY_ALL + READ_ONCE)
def test_the_line_that_a_deck_needs_can_be_read(name, tmp_path):
    if name in READ_ONCE and built_for() > OF_DEBIAN_12:
        pytest.skip("this LAMMPS reads paths twice, and such ones are refused: see below")
    script = tmp_path / name / "load_plugin.lmp"
    script.parent.mkdir()
    script.write_bytes((INPUTS / script.name).read_bytes())
    (tmp_path / "own.in").write_text(f"{include_line(script)}\n")
    done = lmp(tmp_path, "own", inputs=tmp_path)
    assert done.returncode == 0, done.stdout[-3000:]
    assert {path.name for path in tmp_path.iterdir()} == {name, "own.in", "log.lammps"}


@pytest.mark.parametrize(
    ("name", "version"),
    [
        *product(["é", 'it\'s "q"'], [OF_DEBIAN_12, 20250204]),
        *product(READ_ONCE, [20250204, 20250722]),
    ],
)
def test_a_path_that_lammps_cannot_read_in_a_deck_is_refused(name, version):
    with pytest.raises(
        PluginError, match="LAMMPS cannot read in a deck, expected a path of ASCII letters"
    ):
        include_line(Path("/home") / name / "load_plugin.lmp", version)


def test_decks_have_the_ranges_of_the_library():
    parameters = [
        p for name in ("spherocylinder", "superellipsoid") for p in SHAPES[name].parameters
    ]
    stated = checks.RANGES | {p.option: p.allowed for p in parameters}
    shared = (WHOLE.keys() | RANGES.keys()) & stated.keys()
    assert {"n", "alpha", "p", "w1", "w2", "kappa", "dt", "phi_start", "phi_end"} <= shared
    for name in shared - {"seed"}:  # LAMMPS's are shorter
        allowed = stated[name]
        assert (WHOLE | RANGES)[name] == (allowed.low, allowed.high, *allowed.also)


def test_every_setting_of_a_deck_is_checked():
    for deck in INPUTS.glob("*.in"):
        own = set(re.findall(r"^variable +(\w+) +index", deck.read_text(), re.MULTILINE))
        assert own <= WHOLE.keys() | RANGES.keys() | {"integrator", "sides", "out"}
