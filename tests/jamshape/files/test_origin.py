"""Files say what their last bits depend on."""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import jamshape as js
from jamshape.files.h5md import read_attributes, read_origin
from jamshape.files.origin import origin

PRINT = "from jamshape.files.origin import origin; print(origin())"


def elsewhere(**environment):
    done = subprocess.run(
        [sys.executable, "-c", PRINT], env=os.environ | environment, capture_output=True, text=True, check=True
    )  # fmt: skip
    return done.stdout.strip()


def test_it_names_libraries_and_what_they_make_of_fixed_numbers():
    digest = "[0-9a-f]{8}"
    expected = (
        f"{platform.machine()}; .*, sin to pow {digest}; NumPy {re.escape(np.__version__)}, "
        f"{digest}; SciPy .*; eigenvalues {digest}"
    )
    assert re.fullmatch(expected, origin())


def test_it_is_that_of_the_machine_in_every_process():
    assert elsewhere() == origin()


CPU = Path("/proc/cpuinfo")


@pytest.mark.skipif(
    platform.libc_ver()[0] != "glibc" or " fma " not in CPU.read_text(encoding="utf-8"),
    reason="no processor with FMA under glibc",
)
def test_a_processor_without_fused_multiply_add_is_another_one():
    """The C library selects its code by the processor."""
    found = elsewhere(GLIBC_TUNABLES="glibc.cpu.hwcaps=-FMA,-AVX2")
    ours = dict(
        zip(("machine", "libc", "numpy", "scipy", "lapack"), origin().split("; "), strict=True)
    )
    theirs = dict(zip(ours, found.split("; "), strict=True))
    assert ours["libc"] != theirs["libc"]
    assert ours["scipy"] == theirs["scipy"]


def test_files_hold_it(tmp_path):
    js.make_packing(
        js.Spherocylinders(alpha=1), n=8, u0=1e-8, file=tmp_path / "a.h5", progress=False
    )
    assert read_origin(tmp_path / "a.h5") == origin()
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        del file["h5md/creator"].attrs["origin"]
    assert read_origin(tmp_path / "a.h5") == ""


@pytest.mark.lammps
def test_runs_in_lammps_hold_its_version(tmp_path):
    rods = js.Spherocylinders(alpha=1)
    how = {"phi": (0.3, 0.31), "kappa": 1e-2, "rows": 2, "frames": 2, "progress": False}
    js.compress(rods, n=8, file=tmp_path / "run.h5", **how)
    assert read_attributes(tmp_path / "run.h5")["lammps_version"] > 20200000
