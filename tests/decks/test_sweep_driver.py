import contextlib
import fcntl
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from in_process import jamshape
from matplotlib.image import imread

from jamshape.commands import sweep
from jamshape.drawing.sweep import sweep_figure
from jamshape.files.ensembles import PackingFile
from jamshape.files.h5md import read_attributes, read_packing

pytestmark = pytest.mark.lammps

DRIVER = Path(__file__).parents[2] / "pyscripts" / "sweep.py"
FAST = ("--n", "16", "--phi-start", "0.55", "--u0", "1e-6")
DYNAMICS = ("--protocol", "dynamics", "--kappa", "1e-5", "--p-end", "1e-3")  # takes seconds
IMPOSSIBLE = "1e6"  # so long that it meets its own images in any direction


def command(out, *options):
    return [sys.executable, str(DRIVER), *options, *FAST, "--jobs", "2", "--out", str(out)]


def run(out, *options):
    done = subprocess.run(command(out, *options), capture_output=True, text=True, check=False)
    return done, json.loads(done.stdout.splitlines()[-1]) if done.stdout else None


def swept_here(out, *options):
    """Run the command in this process, with one other process for the samples; return its exit code and its report."""
    ended = jamshape("sweep", *options, *FAST, "--jobs", 1, "--out", out)
    return ended.code, ended.report


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
    code, report = swept_here(out, "--alpha", "0", "1", "--samples", "2")
    assert (code, report["made"], report["failed"]) == (0, 4, [])
    assert times(out) == before


def test_packings_of_other_parameters_are_refused_and_kept(swept):
    out, *_ = swept
    before = times(out)
    code, report = swept_here(out, "--alpha", "0", "--samples", "1", "--size-ratio", "1.5")
    assert (code, report["made"]) == (1, 0)
    (complaint,) = report["failed"]
    assert "size_ratio = 1.4, expected 1.5" in complaint
    assert times(out) == before


def test_a_damaged_file_is_listed_and_does_not_stop_the_others(tmp_path, capfd):
    (tmp_path / "alpha0_seed1.h5").write_text("not HDF5")
    code, report = swept_here(tmp_path, "--alpha", "0", IMPOSSIBLE, "--samples", "1")
    assert code == 1
    assert "Traceback" not in capfd.readouterr().err
    assert report["made"] == 0
    assert {c.split("_")[0] for c in report["failed"]} == {"alpha0", "alpha1e+06"}


def processes_that_name(folder):
    """Numbers of the processes whose command lines hold a path in the folder."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            if str(folder).encode() in path.read_bytes():
                found.append(int(path.parent.name))
    return set(found)


def wait_until(condition, seconds):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="needs /proc")
@pytest.mark.parametrize(
    "ending", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.validate)]
)
def test_a_sweep_that_is_killed_alone_leaves_no_process_and_goes_on(tmp_path, ending, measured):
    samples = ("--alpha", "0", "--samples", "3", *DYNAMICS)
    with subprocess.Popen(
        command(tmp_path, *samples),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as sweep:
        # One sample is done, others are under way.
        wait_until(lambda: len(list(tmp_path.glob("alpha*_seed?.h5"))) >= 1, 60)
        wait_until(lambda: len(processes_that_name(tmp_path)) >= 2, 60)
        os.kill(sweep.pid, ending)
        killed = time.monotonic()
    wait_until(lambda: not processes_that_name(tmp_path), 5)
    measured(seconds_until_all_have_ended=time.monotonic() - killed)
    finished = {name: at for name, at in times(tmp_path).items() if name.count(".") == 1}
    done, report = run(tmp_path, *samples)
    assert (done.returncode, report["made"], report["failed"]) == (0, 3, []), done.stderr
    after = times(tmp_path)
    assert {name: after[name] for name in finished} == finished
    assert not list(tmp_path.glob("*.making.h5"))


def test_a_sweep_stops_in_time_and_goes_on(tmp_path):
    asked = ("--alpha", "1", "--samples", "2")
    done, report = run(tmp_path, *asked, "--seconds", "0")
    assert done.returncode == 75
    assert report["made"] == 0
    assert sorted(report["failed"]) == [
        f"alpha1_seed{seed}.h5: not begun in time" for seed in (1, 2)
    ]
    code, report = swept_here(tmp_path, *asked, "--seconds", "300")
    assert (code, report["made"], report["failed"]) == (0, 2, [])


def test_phi_j_and_z_are_drawn_against_what_is_swept(swept, tmp_path):
    out, *_ = swept
    picture = tmp_path / "sweep.png"
    code, report = swept_here(out, "--alpha", "0", "1", "--samples", "2", "--plot", picture)
    assert (code, report["made"]) == (0, 4)
    files = [PackingFile.read(path) for path in sorted(out.glob("alpha[01]_seed[12].h5"))]
    above, below = sweep_figure(files).axes
    assert below.get_xlabel() == r"$\alpha$"
    for axes, name in ((above, "phi_J"), (below, "z")):
        drawn = sorted(
            tuple(point)
            for line in axes.lines
            for point in line.get_xydata()
            if line.get_marker() == "."
        )
        assert drawn == sorted((f.number("alpha"), f.number(name)) for f in files)
    assert imread(picture).std() > 0


def test_names_of_files_keep_all_digits_and_options_given_twice_add_up(tmp_path, capfd):
    _, report = swept_here(
        tmp_path, *("--alpha", "1", "1.0000001", "1e0", "--alpha", "1e6", "--samples", "1")
    )
    assert report["made"] == 2
    assert {c.split(":")[0] for c in report["failed"]} == {"alpha1e+06_seed1.h5"}
    found = {p.name: read_attributes(p)["alpha"] for p in tmp_path.glob("alpha*_seed1.h5")}
    assert found == {"alpha1_seed1.h5": 1.0, "alpha1.0000001_seed1.h5": 1.0000001}
    said = capfd.readouterr().err
    assert "packings: 100.0 %" in said
    assert "3 of 3, 1 failed" in said


def test_seeds_begin_where_they_are_asked_to(swept, tmp_path):
    out, *_ = swept
    code, report = swept_here(tmp_path, "--alpha", "0", "--first-seed", "2", "--samples", "2")
    assert (code, report["made"]) == (0, 2)
    names = {path.name for path in tmp_path.glob("*.h5") if path.name.count(".") == 1}
    assert names == {"alpha0_seed2.h5", "alpha0_seed3.h5"}
    same = [read_packing(folder / "alpha0_seed2.h5").position for folder in (out, tmp_path)]
    assert (same[0] == same[1]).all()


def test_a_sample_that_another_process_makes_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep, "_PATIENCE", 0.1)
    file, log = tmp_path / "alpha0_seed1.h5", tmp_path / "alpha0_seed1.log"
    words = ["--alpha", "0", *FAST, "--out", str(file)]
    with log.open("a") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        complaint = sweep.sample(words, file, None)
    assert complaint == sweep.Complaint(
        "alpha0_seed1.h5: another process is making it, expected none; wait until it ends"
    )
    assert {path.name for path in tmp_path.iterdir()} == {log.name}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--samples", "0"), "--samples is 0, expected at least 1"),
        (("--samples", "-2"), "--samples is -2, expected at least 1"),
        (("--samples", "1", "--jobs", "0"), "--jobs is 0, expected at least 1"),
        (("--first-seed", "-1"), "--first-seed is -1, expected at least 0"),
        (
            ("--seed", "3"),
            "--seed is 3, which has no effect on a sweep: its samples have the seeds",
        ),
        (("--see", "1"), "--seed is 1, which has no effect on a sweep"),
        (("--no-such", "1"), "unrecognized arguments: --no-such 1"),
    ],
)
def test_what_means_nothing_is_refused_before_anything_is_made(tmp_path, options, words, run_here):
    done = run_here(DRIVER, "--alpha", "1", *options, "--out", tmp_path / "none")
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr.splitlines()[-1]
    assert not list(tmp_path.iterdir())
