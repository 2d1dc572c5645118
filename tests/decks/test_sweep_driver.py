import json
import subprocess
import sys
from pathlib import Path

import pytest

from jamshape.files.h5md import read_attributes, read_packing

pytestmark = pytest.mark.lammps

DRIVER = Path(__file__).parents[2] / "pyscripts" / "sweep.py"
FAST = ("--n", "16", "--kappa", "1e-5", "--p-end", "3e-4", "--phi-start", "0.55", "--u0", "1e-6")
IMPOSSIBLE = "1e6"  # so long that it meets its own images in any direction


def run(out, *options):
    command = [sys.executable, str(DRIVER), *options, *FAST, "--jobs", "2", "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done, json.loads(done.stdout.splitlines()[-1]) if done.stdout else None


def times(folder):
    return {path.name: path.stat().st_mtime_ns for path in folder.glob("*.h5")}


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """Two samples of two aspect ratios, and two samples of one that cannot be made."""
    out = tmp_path_factory.mktemp("sweep") / "new"
    return out, *run(out, "--alpha", "0", IMPOSSIBLE, "1", "--samples", "2")


def test_samples_of_every_aspect_ratio_are_made(swept):
    out, _, report = swept
    assert report["out"] == str(out)
    assert report["made"] == 4
    packings = {path.name for path in out.glob("alpha*_seed?.h5")}
    assert packings == {f"alpha{a}_seed{s}.h5" for a in (0, 1) for s in (1, 2)}
    starts = set()
    for name in packings:
        stored = read_attributes(out / name)
        assert f"alpha{stored['alpha']:g}_seed{stored['seed']}.h5" == name
        assert stored["n"] == 16
        assert stored["u"] == pytest.approx(1e-6, rel=1e-7, abs=0)
        starts.add(read_packing(out / name).position.tobytes())
    assert len(starts) == 4


def test_samples_that_fail_are_listed_and_do_not_stop_the_others(swept):
    _, done, report = swept
    assert done.returncode == 1
    assert len(report["failed"]) == 2
    for seed in (1, 2):
        (complaint,) = (c for c in report["failed"] if f"_seed{seed}.h5" in c)
        assert complaint.startswith("alpha1e+06_seed")
        assert "alpha is 1000000.0, expected" in complaint
        assert complaint in done.stderr
    assert "Traceback" not in done.stderr


def test_a_second_call_makes_nothing_anew(swept):
    out, *_ = swept
    before = times(out)
    done, report = run(out, "--alpha", "0", "1", "--samples", "2")
    assert (done.returncode, report["made"], report["failed"]) == (0, 4, [])
    assert times(out) == before


def test_packings_of_other_parameters_are_refused_and_kept(swept):
    out, *_ = swept
    before = times(out)
    done, report = run(out, "--alpha", "0", "--samples", "1", "--size-ratio", "1.5")
    assert (done.returncode, report["made"]) == (1, 0)
    (complaint,) = report["failed"]
    assert "size_ratio = 1.4, expected 1.5" in complaint
    assert times(out) == before


def test_a_damaged_file_is_listed_and_does_not_stop_the_others(tmp_path):
    (tmp_path / "alpha0_seed1.h5").write_text("not HDF5")
    done, report = run(tmp_path, "--alpha", "0", IMPOSSIBLE, "--samples", "1")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert report is not None, done.stderr
    assert report["made"] == 0
    assert {c.split("_")[0] for c in report["failed"]} == {"alpha0", "alpha1e+06"}
