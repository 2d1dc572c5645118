"""A folder with files of every kind to go wrong with, and a look at what a case leaves in it."""

from __future__ import annotations

import shutil

import h5py
import numpy as np
import pytest

import jamshape as js
from jamshape.files.h5md import write_packing
from jamshape.files.lammps_text import write_data
from jamshape.protocols.random_start import random_packing


@pytest.fixture(scope="session")
def stored(tmp_path_factory):
    """Files that no case may change."""
    folder = tmp_path_factory.mktemp("stored")
    rods, start = js.Spherocylinders(alpha=1), random_packing(8, 0.3, 1)
    write_packing(folder / "start.h5", start)
    write_data(folder / "start.data", start)
    write_packing(folder / "dense.h5", js.make_packing(rods, n=8, u0=1e-4, progress=False))
    js.compress(rods, n=8, kappa=1e-2, dt=0.1, phi=(0.3, 0.32), rows=4, frames=2,
                file=folder / "run.h5", progress=False)  # fmt: skip
    with h5py.File(folder / "other.h5", "w") as file:
        file["numbers"] = np.arange(3)
    (folder / "empty.h5").touch()
    (folder / "text.h5").write_text("no numbers")
    (folder / "cut.h5").write_bytes((folder / "start.h5").read_bytes()[:3000])
    (folder / "text.data").write_text("no numbers\n")
    (folder / "cut.dump").write_text("ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n")
    (folder / "a folder").mkdir()
    for name, (attribute, value) in HOSTILE.items():
        shutil.copy(folder / "run.h5", folder / name)
        spoil(folder / name, attribute, value)
    return folder


# Runs that claim not to be finished and whose settings are not what they may be.
HOSTILE = {
    "newline.h5": ("integrator", "heun\nshell touch X"),
    "euler.h5": ("integrator", "euler"),
    "backwards.h5": ("kappa", np.nan),
    "sides.h5": ("sides", 7),
    "no_rows.h5": ("rows", 0),
    "no_frames.h5": ("frames", -3),
    "words.h5": ("dt", "0.1\nshell touch X"),
    "stiff.h5": ("k_e", "1 # "),
}


def spoil(path, attribute, value):
    with h5py.File(path, "r+") as file:
        for group in holding(file, attribute):
            group.attrs[attribute] = value
        for group in holding(file, "finished"):
            group.attrs["finished"] = False


def holding(file, attribute):
    found = [file] if attribute in file.attrs else []
    file.visititems(lambda _, item: found.append(item) if attribute in item.attrs else None)
    return found


@pytest.fixture
def place(stored, monkeypatch):
    """The folder to work in; nothing in it may be made or changed."""
    monkeypatch.chdir(stored)
    before = contents(stored)
    yield stored
    after = contents(stored)
    for path in after.keys() - before.keys():  # a case that fails is not to fail others
        path.unlink() if path.is_file() else shutil.rmtree(path)
    assert after == before


def contents(folder):
    return {path: path.is_file() and path.read_bytes() for path in folder.rglob("*")}
