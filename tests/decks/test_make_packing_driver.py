import json
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from jamshape.contacts import find_contacts
from jamshape.files.h5md import read_attributes, read_observables, read_packing, read_report
from jamshape.landscape import Landscape, State
from jamshape.minima import residual_of

pytestmark = pytest.mark.lammps

DRIVER = Path(__file__).parents[2] / "pyscripts" / "make_packing.py"
USUAL = ("--n", "16", "--alpha", "1", "--phi-start", "0.6", "--u0", "1e-9")
SMALL = (*USUAL, "--protocol", "dynamics", "--kappa", "1e-5", "--p-end", "1e-3")


def run(*options):
    command = [sys.executable, str(DRIVER), *map(str, options)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("make_packing") / "new" / "packing.h5"  # makes the folder
    finished = run(*SMALL, "--out", out)
    assert finished.returncode in {0, 1}, finished.stderr
    return out, finished


def test_help_names_every_option(run_here):
    found = run_here(DRIVER, "--help")
    assert found.returncode == 0
    for name in ("--alpha", "--n ", "--size-ratio", "--seed", "--u0", "--out", "--again"):
        assert name in found.stdout


def test_a_run_ends_with_one_json_line_and_says_whether_it_got_there(made):
    out, finished = made
    (line,) = finished.stdout.splitlines()
    report = json.loads(line, parse_constant=pytest.fail)  # no NaN
    assert report["out"] == str(out)
    assert (report["n"], report["alpha"], report["seed"]) == (16, 1.0, 1)
    assert report["reached"] is (finished.returncode == 0)
    assert report["reached"] is (report["outcome"] in {"converged", "kink"})
    assert report["u"] == pytest.approx(1e-9, rel=1e-7, abs=0)
    assert report["phi"] > report["phi_J"]


def test_the_file_is_a_packing_at_that_energy(made):
    out, finished = made
    report = json.loads(finished.stdout)
    packing = read_packing(out)
    landscape, state = Landscape(packing), State.of(packing)
    evaluation = landscape.evaluate(state)
    assert evaluation.energy / state.volume == pytest.approx(1e-9, rel=1e-7, abs=0)
    assert packing.phi == pytest.approx(report["phi"], rel=1e-14)
    stored = read_attributes(out)
    assert residual_of(landscape, evaluation).largest <= 2 * max(stored["residual"], 1e-8)
    if report["outcome"] == "converged":
        assert stored["residual"] <= 1e-8
    assert stored["kappa"] == 1e-5
    assert len(find_contacts(packing, 1.0, 2).pairs) == stored["n_contacts"]
    assert len(read_report(out).step) > 5


def test_the_compression_is_beside_it_and_nothing_else(made):
    out, _ = made
    run_file = out.with_name("packing.h5.run.h5")
    assert sorted(path.name for path in out.parent.iterdir()) == [out.name, run_file.name]
    assert read_attributes(run_file)["finished"]
    observables = read_observables(run_file)
    closing = observables["kappa"] > 0
    assert observables["phi"][closing].max() > 0.7
    assert np.all(np.diff(observables["phi"][closing]) > 0)
    assert np.all(np.diff(observables["phi"][~closing]) < 0)


def test_the_usual_way_leaves_the_packing_and_nothing_else(tmp_path, run_here):
    out = tmp_path / "packing.h5"
    finished = run_here(DRIVER, *USUAL, "--out", out)
    assert finished.returncode == 0, finished.stderr
    assert [path.name for path in tmp_path.iterdir()] == [out.name]
    report, stored = json.loads(finished.stdout), read_attributes(out)
    assert report["reached"] is True
    assert report["u"] == pytest.approx(1e-9, rel=1e-7, abs=0)
    assert stored["protocol"] == "quasistatic"
    assert not {"kappa", "way"} & stored.keys()
    for path in (out, tmp_path / "none.h5"):
        refused = run_here(DRIVER, *USUAL, "--kappa", "1e-5", "--out", path)
        assert refused.returncode == 1
        assert "kappa does not apply to the protocol quasistatic" in refused.stderr


def test_a_finished_file_is_left_alone(made, run_here):
    out, finished = made
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in out.parent.iterdir()}
    again = run_here(DRIVER, *SMALL, "--out", out)
    assert (again.returncode, again.stdout) == (finished.returncode, finished.stdout)
    after = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in out.parent.iterdir()}
    assert after == before


def assert_one_sentence(failed, words):
    assert failed.returncode == 1
    last = failed.stderr.strip().replace("\r", "\n").splitlines()[-1]  # below a bar of progress
    assert last.startswith("make_packing.py: ")
    assert words in last
    assert "Traceback" not in failed.stderr
    assert not failed.stdout


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--u0", "-1"), "u0 is -1.0, expected 0 or an energy density from 1e-20 to 0.01"),
        (
            ("--u0", "0"),
            "--u0 0 does not work with the protocol dynamics, expected a positive one",
        ),
        (("--u0", "nan"), "u0 is nan, expected 0 or an energy density"),
        (("--n", "0"), "n is 0, expected a whole number of particles from 1"),
        (("--n", "-5"), "n is -5, expected a whole number of particles from 1"),
        (("--alpha", "-1"), "alpha is -1.0"),
        (("--alpha", "nan"), "alpha is nan"),
        (
            ("--size-ratio", "-1.4"),
            "size_ratio is -1.4, expected big over small from 1 to 10",
        ),
        (
            ("--size-ratio", "inf"),
            "size_ratio is inf, expected big over small from 1 to 10",
        ),
        (("--kappa", "1e-2"), "kappa is 0.01, expected at most"),
        (
            ("--phi-start", "nan"),
            "phi_start is nan, expected a packing fraction from 1e-09 to 0.999",
        ),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_no_file(options, words, tmp_path, run_here):
    failed = run_here(DRIVER, *SMALL, *options, "--out", tmp_path / "none.h5")
    assert_one_sentence(failed, words)
    assert not list(tmp_path.iterdir())


def cut(path):
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])


def rename_shape(path):
    with h5py.File(path, "r+") as file:
        file["particles/all"].attrs["shape_style"] = "superellipsoid"


def lose_a_position(path):
    with h5py.File(path, "r+") as file:
        file["particles/all/position/value"][0, 3, 1] = np.nan


def forget_the_outcome(path):
    with h5py.File(path, "r+") as file:
        del file["parameters"].attrs["outcome"]


@pytest.mark.parametrize(
    ("damage", "options", "words"),
    [
        (cut, (), "is truncated or damaged, expected a complete HDF5 file; write it again"),
        (
            rename_shape,
            (),
            "of shape 'superellipsoid' in 2 dimensions, expected 16 of 'spherocylinder' in 2",
        ),
        (lose_a_position, (), "position holds NaN or infinity, expected finite numbers"),
        (forget_the_outcome, (), "holds no finished packing, expected one of make_packing.py"),
        (lambda _: None, ("--seed", "2"), "with seed = 1, expected 2; write to another file"),
        (lambda _: None, ("--u0", "1e-8"), "with u0 = 1e-09, expected 1e-08; write to another"),
        (Path.unlink, ("--alpha", "4"), "holds the compression of a packing with alpha = 1.0"),
    ],
)
def test_a_file_that_is_not_the_packing_is_told_and_kept(
    made, tmp_path, damage, options, words, run_here
):
    out = tmp_path / made[0].name
    for path in made[0].parent.iterdir():
        shutil.copy(path, tmp_path)
    damage(out)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert_one_sentence(run_here(DRIVER, *SMALL, *options, "--out", out), words)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
