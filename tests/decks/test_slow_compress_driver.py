import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mixtures import bidisperse

from jamshape.files.h5md import read_attributes, read_observables, read_packing, write_packing
from jamshape.protocols.random_start import random_packing

DRIVER = Path(__file__).parents[2] / "pyscripts" / "slow_compress.py"
RATES = ("--kappa", "1e-6", "--phi-slow", "0.63", "--kappa-before", "1e-4")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("slow_compress")


@pytest.fixture(scope="module")
def start(folder):
    packing = random_packing(16, 0.6, 1, bidisperse(1.0))
    write_packing(folder / "start.h5", packing, {"alpha": 1.0})
    return folder / "start.h5"


def run(*options):
    command = [sys.executable, str(DRIVER), *map(str, options)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def made(folder, start):
    out = folder / "new" / "slow.h5"
    options = (*RATES, "--phi-end", "0.64", "--start", start, "--out", out)
    return out, options, run(*options)


def test_a_run_changes_its_rate_and_ends_where_it_was_told(made, start):
    out, _, finished = made
    assert finished.returncode == 0, finished.stderr
    said = json.loads(finished.stdout.splitlines()[-1])
    found, stored = read_observables(out), read_attributes(out)
    assert said["phi"] == pytest.approx(0.64, rel=1e-12)
    assert stored["alpha"] == 1.0
    assert stored["n"] == 16
    # The rate is the strain over the time of a step.
    strain, time = np.diff(found["strain"]), found["dt"][1:]
    early = found["phi"][1:] < 0.63 * (1 - 1e-9)
    assert early.any()
    assert strain[early] == pytest.approx(1e-4 * time[early], rel=1e-6)
    assert strain[~early][1:] == pytest.approx(1e-6 * time[~early][1:], rel=1e-6)
    assert read_packing(out, 0).phi == pytest.approx(read_packing(start).phi, rel=1e-15)


def test_a_finished_run_is_left_alone(made, run_here):
    out, options, finished = made
    before = out.read_bytes()
    again = run_here(DRIVER, *options)
    assert again.returncode == 0
    assert again.stdout.splitlines()[-1] == finished.stdout.splitlines()[-1]
    assert out.read_bytes() == before


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--kappa", "1e-7"), "kappa"),
        (("--integration-tolerance", "1e-2"), "--integration-tolerance 0.001, expected 0.01"),
    ],
)
def test_a_file_with_another_protocol_is_refused(made, options, sentence, run_here):
    out, before_options, _ = made
    before = out.read_bytes()
    found = run_here(DRIVER, *before_options, *options)
    assert found.returncode == 1
    assert found.stderr.startswith("slow_compress.py: ")
    assert sentence in found.stderr
    assert out.read_bytes() == before
