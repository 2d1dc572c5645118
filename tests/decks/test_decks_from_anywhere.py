"""Decks started from another folder, by paths with spaces, without an environment; a deck of one's own."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import jamshape
from jamshape.files.h5md import read_packing
from jamshape.lammps.plugin import plugin_path
from jamshape.lammps.session import Session

sys.path.append(str(Path(__file__).parents[1] / "styles"))

from deck_settings import LEFT, SMALL
from lammps_scenes import ENVIRONMENT, MPIRUN, REPOSITORY, complaints_of

pytestmark = pytest.mark.lammps

PAGE = REPOSITORY / "docs" / "how-to" / "decks.md"
NOT_FOUND = (
    "ERROR: Found no jamshape_plugin.so, expected the plugin of jamshape: run './run setup' in its "
    "folder, or set JAMSHAPE_PLUGIN to the path of the plugin."
)

FROM_HERE = "give its path from this folder."
ANOTHER = "expected one to write to: name another with -var out."


def bare_environment(**more):
    """Without anything that leads to jamshape."""
    hints = ("JAMSHAPE_PLUGIN", "VIRTUAL_ENV", "CONDA_PREFIX", "PYTHONPATH")
    kept = {k: v for k, v in os.environ.items() if k not in hints}
    here = str(Path(sys.executable).parent)  # LAMMPS's Python looks for its packages along PATH
    path = os.pathsep.join(x for x in kept["PATH"].split(os.pathsep) if x != here)
    return kept | {"PATH": path} | ENVIRONMENT | more


def lmp(cwd, *arguments, ranks=1, **more):
    several = [*MPIRUN, "-np", str(ranks)] if ranks > 1 else []
    return subprocess.run(
        [*several, "lmp", *map(str, arguments)], cwd=cwd, env=bare_environment(**more), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300, check=False,
    )  # fmt: skip


def variables(**settings):
    return [word for name, value in settings.items() for word in ("-var", name, value)]


def site_packages(place):
    return place / ".venv" / "lib" / "python3.11" / "site-packages"


@pytest.fixture(scope="module")
def clone(tmp_path_factory):
    """Folder like a clone that was set up, in a path with spaces, one of them double."""
    place = tmp_path_factory.mktemp("any where") / "my  clone"
    package, python = site_packages(place) / "jamshape", place / ".venv" / "bin" / "python"
    package.mkdir(parents=True)
    (package / "jamshape_plugin.so").symlink_to(plugin_path())
    python.parent.mkdir()
    packages = shlex.quote(str(Path(jamshape.__file__).parents[1]))
    python.write_text(f'#!/bin/sh\nPYTHONPATH={packages} exec {shlex.quote(sys.executable)} "$@"\n')
    python.chmod(0o755)
    for path in (REPOSITORY / "inputs").iterdir():
        (place / "inputs").mkdir(exist_ok=True)
        (place / "inputs" / path.name).write_bytes(path.read_bytes())
    return place


@pytest.fixture
def elsewhere(tmp_path):
    folder = tmp_path / "else where"
    folder.mkdir()
    return folder


def names_in(folder):
    return {path.name for path in folder.iterdir()}


def run_deck(name, inputs, cwd, ranks=1, **settings):
    words = variables(**(SMALL[name] | settings))
    done = lmp(cwd, "-in", inputs / f"{name}.in", *words, ranks=ranks)
    assert done.returncode == 0, done.stdout[-3000:]


@pytest.mark.parametrize("shape", ["spherocylinder", "superellipsoid"])
@pytest.mark.parametrize("ranks", [1, 2])
def test_decks_run_from_another_folder_and_leave_nothing_there(shape, ranks, clone, elsewhere):
    inputs = Path(os.path.relpath(clone / "inputs", elsewhere)) if ranks == 1 else clone / "inputs"
    compress, minimize = f"compress_{shape}", f"minimize_{shape}"
    run_deck(compress, inputs, elsewhere, ranks, out="my runs/jammed")
    start = "my runs/jammed/final.restart"
    run_deck(minimize, inputs, elsewhere, ranks, out="my runs/minimum", restart=start)
    assert names_in(elsewhere) == {"my runs"}
    for name, folder in ((compress, "jammed"), (minimize, "minimum")):
        left = names_in(elsewhere / "my runs" / folder)
        assert left == LEFT[name] | {"log.lammps", "final.restart"}


def test_a_deck_takes_relative_data_and_writes_where_it_was_started(clone, elsewhere):
    run_deck("compress_spherocylinder", clone / "inputs", elsewhere, out=".")
    assert names_in(elsewhere) == LEFT["compress_spherocylinder"] | {
        "log.lammps",
        "final.restart",
    }
    run_deck(
        "compress_spherocylinder", clone / "inputs", elsewhere, data="initial.data", out="again"
    )
    dumps = [elsewhere / name / "particles.dump" for name in (".", "again")]
    assert dumps[0].read_bytes() == dumps[1].read_bytes()


def test_a_deck_can_be_read_from_standard_input(clone, elsewhere):
    deck = clone / "inputs" / "compress_superellipsoid.in"
    with deck.open() as file:
        done = subprocess.run(
            ["lmp", *map(str, variables(**SMALL[deck.stem], out="new"))], cwd=elsewhere, stdin=file,
            env=bare_environment(), text=True, capture_output=True, timeout=300, check=False,
        )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:]
    assert names_in(elsewhere) == {"new"}


@pytest.mark.parametrize(
    ("deck", "settings", "sentence"),
    [
        (
            "minimize_spherocylinder",
            {},
            "ERROR: Found no state to minimise, expected -var restart FILE or -var data FILE.",
        ),
        (
            "minimize_superellipsoid",
            {"data": "my start.data"},
            "ERROR: Found no file my start.data, expected the one that -var data names: "
            + FROM_HERE,
        ),
        (
            "compress_spherocylinder",
            {"restart": "none"},
            "ERROR: Found no file none, expected the one that -var restart names: " + FROM_HERE,
        ),
        (
            "compress_superellipsoid",
            {"out": "/dev/null/runs"},
            f"ERROR: Cannot make the folder /dev/null/runs (Not a directory), {ANOTHER}",
        ),
    ],
)
def test_what_is_missing_is_one_sentence(deck, settings, sentence, clone, elsewhere):
    done = lmp(elsewhere, "-in", clone / "inputs" / f"{deck}.in", *variables(**settings))
    assert done.returncode == 1
    assert complaints_of(done) == [sentence]


# --- where the plugin is looked for ---------------------------------------------------------------


def search(deck, cwd, ranks=1, **more):
    """Plugin that a deck finds; what it says when it finds none."""
    deck.write_text(deck.read_text() + 'print "found ${jamshape_plugin}"\n')
    done = lmp(cwd, "-in", deck, ranks=ranks, **more)
    found = re.findall("^(?:found|ERROR).*$", done.stdout, re.MULTILINE)
    assert done.returncode == ("ERROR" in found[0])
    assert "Traceback" not in done.stdout
    return found


def own_deck(folder, loader):
    deck = folder / "own.in"
    deck.write_text(f'include "{loader}"\n')
    return deck


def installed(environment):
    """Plugin in an environment, with the file that loads it."""
    package = environment / "lib" / "python3.11" / "site-packages" / "jamshape"
    (package / "inputs").mkdir(parents=True)
    (package / "jamshape_plugin.so").symlink_to(plugin_path())
    loader = package / "inputs" / "load_plugin.lmp"
    loader.write_bytes((REPOSITORY / "inputs" / loader.name).read_bytes())
    return package / "jamshape_plugin.so", loader


@pytest.mark.parametrize("ranks", [1, 2])
def test_an_installed_plugin_is_found_beside_its_loader(ranks, tmp_path, elsewhere):
    plugin, loader = installed(tmp_path / "an environment")
    other, _ = installed(tmp_path / "active")
    deck = own_deck(elsewhere, loader)
    found = search(deck, elsewhere, ranks, VIRTUAL_ENV=str(other.parents[4]))
    assert found == [f"found {plugin}"]


def test_places_are_searched_in_the_order_of_the_page(tmp_path, elsewhere):
    lone = tmp_path / "load_plugin.lmp"
    lone.write_bytes((REPOSITORY / "inputs" / lone.name).read_bytes())
    named, active, below, working = tmp_path / "named.so", tmp_path / "a", elsewhere, tmp_path / "w"
    named.symlink_to(plugin_path())
    plugins = [named, *(installed(p)[0] for p in (below / ".venv", active, working / ".venv"))]
    hints = {"JAMSHAPE_PLUGIN": str(named), "VIRTUAL_ENV": str(active)}
    found = []
    for plugin in plugins:
        found += search(own_deck(elsewhere, lone), working, **hints)
        hints.pop({named: "JAMSHAPE_PLUGIN", plugins[2]: "VIRTUAL_ENV"}.get(plugin, ""), None)
        plugin.unlink()
    assert found == [f"found {plugin}" for plugin in plugins]


def test_a_plugin_that_python_imports_is_found_last(tmp_path, elsewhere):
    plugin, loader = installed(tmp_path / "somewhere")
    (plugin.parent / "__init__.py").touch()
    alone = tmp_path / loader.name
    alone.write_bytes(loader.read_bytes())
    found = search(own_deck(elsewhere, alone), elsewhere, PYTHONPATH=str(plugin.parents[1]))
    assert found == [f"found {plugin}"]


@pytest.mark.parametrize("ranks", [1, 2])
def test_no_plugin_is_one_sentence_of_all_ranks(ranks, tmp_path, elsewhere):
    alone = tmp_path / "load_plugin.lmp"
    alone.write_bytes((REPOSITORY / "inputs" / alone.name).read_bytes())
    assert search(own_deck(elsewhere, alone), elsewhere, ranks) == [NOT_FOUND]


def test_a_wrong_jamshape_plugin_is_refused(tmp_path, elsewhere):
    _, loader = installed(tmp_path / "environment")
    [sentence] = search(own_deck(elsewhere, loader), elsewhere, JAMSHAPE_PLUGIN="/no/where.so")
    assert sentence.startswith("ERROR: Found no file /no/where.so, which JAMSHAPE_PLUGIN names,")
    text = tmp_path / "text.so"
    text.write_text("text")
    [sentence] = search(own_deck(elsewhere, loader), elsewhere, JAMSHAPE_PLUGIN=str(text))
    assert sentence.startswith("ERROR: Found a plugin that this LAMMPS cannot load (")


# --- a deck of one's own --------------------------------------------------------------------------


def own_deck_of_the_page():
    """Deck and start of the page, word for word but for the path of the clone."""
    text = PAGE.read_text(encoding="utf-8")
    [deck] = [block for block in text.split("```") if "pair_style" in block]
    [start] = re.findall(r"^    jamshape (initial .*)$", text, re.MULTILINE)
    return deck, start.split()


@pytest.mark.parametrize("ranks", [1, 2])
def test_the_deck_of_ones_own_runs_word_for_word(ranks, clone, elsewhere):
    deck, start = own_deck_of_the_page()
    assert deck.count("/home/you/jamshape/") == 1
    (elsewhere / "rods.in").write_text(deck.replace("/home/you/jamshape/", f"{clone}/"))
    python = clone / ".venv" / "bin" / "python"
    subprocess.run([python, "-m", "jamshape", *start], cwd=elsewhere, check=True)
    done = lmp(elsewhere, "-in", "rods.in", ranks=ranks)
    assert done.returncode == 0, done.stdout[-3000:]
    title, first, last = re.search(
        r"^ *(Step .*)\n(.*)\n(.*)\nLoop time", done.stdout, re.MULTILINE
    ).groups()
    column = {name: k for k, name in enumerate(title.split())}
    before, after = (np.array(row.split(), float) for row in (first, last))
    assert before[column["Press"]] == 0
    assert after[column["Press"]] > 1e-2
    shrunk = np.exp(-2 * 1e-3 * 4000 * 0.1)
    assert after[column["Volume"]] == pytest.approx(before[column["Volume"]] * shrunk, rel=1e-7)


def test_sessions_keep_restart_files_in_folders_with_spaces(tmp_path):
    """The drivers' files, which LAMMPS reads and writes."""
    folder = tmp_path / "my runs"
    folder.mkdir()
    python = [sys.executable, REPOSITORY / "pyscripts" / "compress.py"]
    run = [
        "--n",
        "16",
        "--kappa",
        "1e-2",
        "--dt",
        "0.1",
        "--phi-end",
        "0.6",
        "--out",
        folder / "a.h5",
    ]
    subprocess.run([*python, *run], cwd=folder, check=True, capture_output=True)
    assert names_in(folder) == {"a.h5"}
    with Session() as session:
        session.load(read_packing(folder / "a.h5"))
        session.commands(f'write_restart "{folder}/b"')
    with Session() as session:
        session.load_restart(folder / "b")
        assert session.packing().n == 16
