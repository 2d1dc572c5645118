"""Tiny files of every kind, made by the command itself in this process, which saves the time of starting it."""

import pytest
from in_process import jamshape

FAST = ("--alpha", 1, "--n", 16)
RUN = (*FAST, "--kappa", 1e-3, "--phi-start", 0.5, "--phi-end", 0.88, "--rows", 20, "--frames", 4)
PACK = (*FAST, "--phi-start", 0.55, "--u0", 1e-6)
DYNAMICS = ("--protocol", "dynamics", "--kappa", 1e-5, "--p-end", 3e-3)
SLOW = ("--kappa", 1e-4, "--phi-end", 0.64)


@pytest.fixture(name="jamshape")
def jamshape_():
    return jamshape


def made(folder, commands):
    """Run commands that write files; return how they ended, by the names of these."""
    return {name: jamshape(*command, "--out", folder / name) for name, command in commands.items()}


@pytest.fixture(scope="session")
def start(tmp_path_factory):
    """Return a random start, for which no LAMMPS is needed."""
    folder = tmp_path_factory.mktemp("start")
    made(folder, {"start.h5": ("initial", *FAST, "--phi", 0.6)})
    return folder / "start.h5"


@pytest.fixture(scope="session")
def tiny(tmp_path_factory, start):
    """Return a folder with a file of every command, and how the commands ended, by the names of the files."""
    folder = tmp_path_factory.mktemp("tiny")
    said = made(
        folder,
        {
            "start.data": ("initial", *FAST),
            "run.h5": ("compress", *RUN),
            "packing.h5": ("pack", *PACK),
            "dynamics.h5": ("pack", *PACK, *DYNAMICS),
            "slow.h5": ("slow", *SLOW, "--start", start),
            "modes.h5": ("modes", folder / "packing.h5"),
            "packing.png": ("draw", folder / "packing.h5", "--dpi", 60),
            "sweep": ("sweep", "--alpha", 1, "--samples", 1, *PACK[2:]),
        },
    )
    return folder, said
