"""What README shows is run as it stands there."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import jamshape as js

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
DECKS = (ROOT / "docs" / "how-to" / "decks.md").read_text(encoding="utf-8")


def block(page, begins):
    [found] = [b for b in re.findall(r"```\w*\n(.*?)```", page, re.DOTALL) if begins in b]
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the lines of Python were run, as a script of their own."""
    path = tmp_path_factory.mktemp("read me")
    (path / "door.py").write_text(block(README, "import jamshape as js"))
    done = subprocess.run(
        [sys.executable, "-W", "error", "door.py"],
        cwd=path,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"MPLBACKEND": "agg"},
    )
    (path / "said.txt").write_text(done.stdout)
    assert done.returncode == 0, done.stderr
    return path


def test_it_is_a_screen_and_a_half():
    assert len(README.splitlines()) <= 120


@pytest.mark.lammps
def test_ten_lines_of_python_make_a_packing_and_pictures(folder):
    numbers = [
        float(x) for x in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", (folder / "said.txt").read_text())
    ]
    phi_J, phi, pressure, z = numbers[:4]
    assert 0.7 < phi_J < 0.9
    assert 0.7 < phi < 0.9
    assert 0 < pressure < 1e-5
    assert 5 < z < 6.5
    assert js.load(folder / "packing.h5").results["outcome"] in {"converged", "sliding"}
    assert all((folder / name).stat().st_size > 10_000 for name in ("pressure.png", "packing.png"))


@pytest.mark.lammps
def test_what_was_saved_for_other_tools_is_the_packing(folder):
    pytest.importorskip("gsd")
    packing, again = js.load(folder / "packing.h5"), js.load(folder / "rods.gsd")
    assert (again.position == packing.position).all()
    assert (again.orientation == packing.orientation).all()


def test_the_deck_is_the_one_that_is_tested_from_everywhere():
    assert block(README, "read_data") == block(DECKS, "read_data")
