"""Decks on a disk that is full before they begin, or fills on the way: one sentence, and what was written stays."""

from __future__ import annotations

import os
import subprocess

import pytest
from lammps_scenes import REPOSITORY, command_line, complaints_of, environment

from jamshape.files.lammps_text import read_dump

pytestmark = pytest.mark.lammps

COMPRESSIONS = {
    "compress_spherocylinder": {"n": 64, "alpha": 4, "kappa": 1e-3, "dt": 0.1, "phi_end": 0.9},
    "compress_superellipsoid": {"n": 64, "kappa": 1e-3, "phi_end": 0.8},
}
ADVICE = "make room, or name another folder with -var out; a compression goes on with -var restart."


@pytest.fixture
def disk(tmp_path):
    """Folder, where the machine lets us make one, of a disk whose size is told later."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(folder)]
    if os.getuid() or subprocess.run(command, check=False, capture_output=True).returncode:
        pytest.skip("this user may mount no small disk")
    yield folder
    # On a busy machine the Python beside a deck that has ended is still on its way out of the folder.
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


def resize(disk, size):
    subprocess.run(["mount", "-o", f"remount,size={size}", str(disk)], check=True)


def run_deck(name, out, **settings):
    words = [x for pair in {**settings, "out": out}.items() for x in ("-var", *map(str, pair))]
    return subprocess.run(
        command_line("-in", REPOSITORY / "inputs" / f"{name}.in", *words), env=environment(),
        cwd=out.parent, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=120, check=False,
    )  # fmt: skip


def sentence_of(done):
    assert done.returncode == 1, done.stdout[-2000:]
    [sentence] = complaints_of(done)
    return sentence


@pytest.mark.parametrize("name", COMPRESSIONS)
@pytest.mark.parametrize("size", ["12k", "100k"])
def test_a_disk_that_is_too_small_is_refused_before_the_run(name, size, disk):
    resize(disk, size)
    sentence = sentence_of(run_deck(name, disk / "out", **COMPRESSIONS[name]))
    assert sentence.startswith(f"ERROR: {disk}/out has room for ")
    assert sentence.endswith(ADVICE)


@pytest.mark.parametrize("name", COMPRESSIONS)
def test_a_disk_that_fills_on_the_way_ends_a_run_that_goes_on_later(name, disk, tmp_path):
    settings = COMPRESSIONS[name]
    resize(disk, "400k")
    sentence = sentence_of(run_deck(name, disk / "out", **settings))
    assert sentence.startswith(f"ERROR: {disk}/out has ")
    assert sentence.endswith("-var restart.")
    assert not (disk / "out" / "final.restart").exists()
    assert (disk / "out" / "log.lammps").stat().st_size > 0
    resize(disk, "2m")
    again = run_deck(name, disk / "out", **settings, restart=disk / "out")
    assert again.returncode == 0, again.stdout[-2000:]
    assert run_deck(name, tmp_path / "whole", **settings).returncode == 0
    dumps = [out / "particles.dump" for out in (tmp_path / "whole", disk / "out")]
    one, other = (read_dump(dump, shape=name.split("_")[1]) for dump in dumps)
    assert [frame.step for frame in other] == [frame.step for frame in one]


@pytest.mark.parametrize("shape", ["spherocylinder", "superellipsoid"])
def test_a_minimisation_is_refused_on_a_full_disk(shape, disk, tmp_path):
    settings = COMPRESSIONS[f"compress_{shape}"] | {"phi_end": 0.5}
    assert run_deck(f"compress_{shape}", tmp_path / "start", **settings).returncode == 0
    resize(disk, "16k")
    state = tmp_path / "start" / "final.restart"
    done = run_deck(f"minimize_{shape}", disk / "out", restart=state, maxiter=10)
    assert sentence_of(done).endswith(ADVICE)
