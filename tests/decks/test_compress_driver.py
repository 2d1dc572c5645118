import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from jamshape.files.h5md import read_attributes, read_observables, read_packing, read_report

pytestmark = pytest.mark.lammps

DRIVER = Path(__file__).parents[2] / "pyscripts" / "compress.py"
SMALL = ("--n", "48", "--kappa", "3e-4", "--dt", "0.1", "--phi-end", "0.86", "--rows", "60")


def run(out, *options):
    command = [sys.executable, str(DRIVER), *SMALL, "--out", str(out), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


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


def test_integrators_that_choose_their_steps_take_rows_as_steps(tmp_path, run_here):
    out, tolerance = tmp_path / "rkc2.h5", 1e-3
    options = ("--sides", "2", "--integrator", "rkc2", "--integration-tolerance", str(tolerance))
    settings = [word for word in SMALL if word not in {"--dt", "0.1"}]
    call = (DRIVER, *settings, "--out", out, *options)
    finished = run_here(*call)
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
    assert run_here(*call).returncode == 0


def test_resume_is_accepted_for_one_release(whole, run_here):
    """With the settings, or with none, which takes those of the file."""
    out, report = whole
    for settings in (SMALL, ()):
        again = run_here(DRIVER, *settings, "--out", out, "--resume")
        assert json.loads(again.stdout.splitlines()[-1]) == report
        assert again.stderr.startswith(
            "compress.py: warning: the same command resumes without --resume, which goes with the next release\n"
        )


def test_a_finished_run_is_left_alone(whole, run_here):
    out, report = whole
    before = out.read_bytes()
    again = run_here(DRIVER, *SMALL, "--out", out)
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
