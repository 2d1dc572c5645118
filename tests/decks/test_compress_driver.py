import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from jamshape.files.h5md import read_attributes, read_observables, read_packing, read_report
from jamshape.files.restarts import RestartFiles

pytestmark = pytest.mark.lammps

DRIVER = Path(__file__).parents[2] / "pyscripts" / "compress.py"
SMALL = ("--n", "48", "--kappa", "3e-4", "--dt", "0.1", "--phi-end", "0.86", "--rows", "60")

# Last estimated since the process began: not properties of the state.
OF_THE_PROCESS = {"lambda_max", "dt_max", "step_error"}


def command(out, *options, settings=SMALL):
    return [sys.executable, str(DRIVER), *settings, "--out", str(out), *options]


def run(out, *options, **settings):
    return subprocess.run(
        command(out, *options, **settings), capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("driver") / "whole.h5"
    finished = run(out)
    assert finished.returncode == 0, finished.stderr
    return out, json.loads(finished.stdout.splitlines()[-1])


def test_a_run_reaches_its_end_and_reports_it(whole):
    out, report = whole
    assert report["phi"] == pytest.approx(0.86, abs=1e-4)
    assert report["kappa"] == read_attributes(out)["kappa"]
    assert report["left_out"].startswith("energy and virial of steps without output, the third")
    assert read_packing(out).phi == pytest.approx(report["phi"], rel=1e-12)
    observables, history = read_observables(out), read_report(out)
    assert 60 <= len(observables["pressure"]) <= 63
    assert np.all(np.diff(observables["phi"]) > 0)
    assert np.all(np.diff(history.wall_seconds) > 0)
    assert read_attributes(out)["finished"]


def test_integrators_that_choose_their_steps_take_rows_as_steps(tmp_path):
    out, tolerance = tmp_path / "rkc2.h5", 1e-3
    options = ("--sides", "2", "--integrator", "rkc2", "--integration-tolerance", str(tolerance))
    chosen = {"settings": [word for word in SMALL if word not in {"--dt", "0.1"}]}
    finished = run(out, *options, **chosen)
    assert finished.returncode == 0, finished.stderr
    observables, history = read_observables(out), read_report(out)
    assert len(observables["pressure"]) == 61
    assert observables["phi"][-1] == pytest.approx(0.86, rel=1e-12)
    assert (observables["local_error"] <= tolerance).all()
    np.testing.assert_array_equal(history.error, observables["local_error"][1:])
    assert np.all(np.diff(observables["substeps"]) >= 1)
    assert (observables["substep_shortest"] > 0).sum() >= 60
    assert observables["forced"][-1] == 0
    assert observables["evaluations"][-1] < 2 * read_attributes(out)["dt"] * 60 / 0.05
    again = run(out, *options, "--resume", **chosen)
    assert again.returncode == 0


@pytest.mark.parametrize("broken", [False, True])
def test_a_killed_run_goes_on_as_if_nothing_had_happened(broken, whole, tmp_path):
    out = tmp_path / "killed.h5"
    with subprocess.Popen(
        command(out), stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
    ) as going:
        deadline = time.monotonic() + 60
        while not Path(f"{out}.restart.b").exists() and time.monotonic() < deadline:
            time.sleep(0.005)
        going.send_signal(signal.SIGKILL)
    assert not read_attributes(out)["finished"]
    if broken:  # the newest restart file, as if it had been killed while it was written
        newest = RestartFiles(Path(f"{out}.restart")).newest()
        newest.write_bytes(newest.read_bytes()[:-5])
    resumed = run(out, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    for name, values in read_observables(whole[0]).items():
        if name in OF_THE_PROCESS:
            continue
        np.testing.assert_allclose(read_observables(out)[name], values, rtol=1e-9, atol=1e-10)
    one, other = read_packing(whole[0]), read_packing(out)
    np.testing.assert_allclose(other.position, one.position, rtol=0, atol=1e-10)
    np.testing.assert_allclose(other.orientation, one.orientation, rtol=0, atol=1e-10)
    assert [path.name for path in tmp_path.iterdir()] == ["killed.h5"]


def test_a_run_without_restart_files_begins_anew(whole, tmp_path):
    out = tmp_path / "killed.h5"
    with subprocess.Popen(
        command(out), stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
    ) as going:
        deadline = time.monotonic() + 60
        while not out.exists() and time.monotonic() < deadline:
            time.sleep(0.005)
        going.send_signal(signal.SIGKILL)
    RestartFiles(Path(f"{out}.restart")).forget()
    # Another order of atoms, another path, on which a frame may stay undecided; that is said, and no failure here.
    resumed = run(out, "--resume")
    assert resumed.returncode == 0 or "are ignored" in resumed.stderr
    expected = read_observables(whole[0])["phi"]
    np.testing.assert_allclose(read_observables(out)["phi"], expected, rtol=1e-12)


def test_a_finished_run_is_left_alone(whole):
    out, report = whole
    before = out.read_bytes()
    Path(f"{out}.restart.a").touch()  # as killed before it could remove them
    again = run(out, "--resume")
    assert again.returncode == 0
    assert json.loads(again.stdout.splitlines()[-1]) == report
    assert out.read_bytes() == before
    assert [path.name for path in out.parent.iterdir()] == [out.name]


def test_a_step_past_the_stability_limit_fails_with_a_sentence_and_a_readable_file(tmp_path):
    out = tmp_path / "unstable.h5"
    failed = run(out, "--dt", "1.7", "--kappa", "2e-3", "--phi-end", "0.95", "--rows", "20")
    assert failed.returncode != 0
    sentences = [line for line in failed.stderr.split("\n") if line.startswith("compress.py: ")]
    assert len(sentences) == 1
    assert "use a " in sentences[0]
    assert "timestep" in sentences[0]
    assert len(read_observables(out)["pressure"]) >= 1
    assert np.all(np.isfinite(read_packing(out).position))
    assert not read_attributes(out)["finished"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--alpha", "-1"), "alpha is -1.0"),
        (("--kappa", "nan"), "kappa is nan"),
        (("--phi-start", "0.7"), "stalled at phi"),
        (("--sides", "3"), "sides is 3"),
        (("--n", "0"), "0"),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_no_file(options, words, tmp_path, run_here):
    out = tmp_path / "none.h5"
    failed = run_here(DRIVER, *SMALL, "--out", out, *options)
    assert failed.returncode == 1
    assert failed.stderr.startswith("compress.py: ")
    assert len(failed.stderr.strip().splitlines()) == 1
    assert words in failed.stderr
    assert not out.exists()
