"""Figures of compressions, as their users run them, on small files made here."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pictures import image
from written import write_content

import jamshape as js
from jamshape.files.h5md import write_packing
from jamshape.measures.jamming import Jamming
from jamshape.measures.order import orientational_order
from jamshape.packing import Box, Packing

FOLDER = "marschall_2018"
ORDER, PRESSURE, SLOW, LINES, QUASISTATIC = (
    f"{FOLDER}/{name}.py"
    for name in (
        *("fig02_order", "fig04_pressure", "fig03_slow_compression"),
        *("pressure_lines", "quasistatic_pressure"),
    )
)
PHI_J = 0.866
SHIFTS = {1: 0.001, 2: 0.002, 3: 0.003}


def packing(angle=(0.0, 0.0, 0.0)):
    return Packing(
        position=np.array([[3.0, 7.8], [3.0, 0.75], [2.0, 4.0]]),
        orientation=np.array(angle),
        diameters=np.array([[4.0, 1.0, 1.0], [4.0, 1.0, 1.0], [2.8, 1.4, 1.4]]),
        species=np.array([1, 1, 2]),
        id=np.array([1, 2, 3]),
        box=Box(lo=np.zeros(2), edges=np.array([8.0, 8.0])),
    )


def compression(path, seed=1, shift=0.0, ends=(0.8, 0.9), slope=0.2, ordering=0.0, **attributes):
    """A run whose pressure is a line from PHI_J + shift on, of particles at random angles, whose order grows."""
    rng = np.random.default_rng(seed)
    first = packing(rng.uniform(0, 7, 3))
    known = {"alpha": 4.0, "n": 1024, "kappa": 1e-6, "size_ratio": 1.4, "k_e": 1.0, "sides": 2}
    known |= {"seed": seed, "kind": "compression", "finished": True} | attributes
    n = known["n"]
    S = {f"S_{k}": orientational_order(rng.uniform(0, 7, n), k).S_n for k in (2, 4)}
    phi, steps = np.linspace(*ends, 81), np.arange(81)
    rows = {"phi": phi, "pressure": slope * np.maximum(phi - PHI_J - shift, 0)}
    rows |= {name: value + ordering * (phi - phi[0]) for name, value in S.items()}
    values = [{name: column[k] for name, column in rows.items()} for k in steps]
    write_content(
        path, [first], known, zip(steps.tolist(), (steps / 3).tolist(), values, strict=True)
    )
    return path


@pytest.mark.parametrize("script", [ORDER, PRESSURE, SLOW, LINES, QUASISTATIC])
def test_help(help_of, script):
    said = help_of(script)
    assert "Marschall & Teitel, PRE 97, 012905" in said
    assert f"python analysis/{script}" in said
    assert "--out" in said


@pytest.mark.parametrize("script", [ORDER, PRESSURE, SLOW])
def test_user_errors_are_one_sentence(problem, tmp_path, script):
    out = tmp_path / "out.png"
    assert "No such file" in problem(script, tmp_path / "none.h5", "--out", out)
    text = tmp_path / "notes.txt"
    text.write_text("nothing of the kind\n")
    assert str(text) in problem(script, text, "--out", out)
    run_file = compression(tmp_path / "run.h5")
    assert "No such file" in problem(script, run_file, "--out", tmp_path / "none" / "out.png")
    assert "expected the name of a picture" in problem(
        script, run_file, "--out", tmp_path / "out.nonsense"
    )
    path = tmp_path / "packing.h5"
    write_packing(path, packing())
    assert "expected a run of compress.py" in problem(script, path, "--out", out)
    assert not out.exists()


def test_an_error_ends_the_process_without_traceback(tmp_path):
    script = Path(__file__).parents[2] / "analysis" / PRESSURE
    command = [sys.executable, "-W", "error", script, tmp_path / "none.h5"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
    assert done.stderr.startswith("fig04_pressure.py: ")


def test_pressure_of_one_run(report, tmp_path):
    run_file, out = compression(tmp_path / "run.h5"), tmp_path / "pressure.png"
    found = report(PRESSURE, run_file, "--out", out)
    assert found["out"] == str(out)
    assert (found["mean"], found["error"]) == (None, None)
    (fit,) = found["runs"]
    assert (fit["run"], fit["kappa"]) == (str(run_file), 1e-6)
    assert fit["phi_J(kappa)"] == pytest.approx(PHI_J, abs=1e-12)
    assert fit["slope"] == pytest.approx(0.2, rel=1e-9)
    assert 0 < fit["phi_J(kappa)_error"] < 1e-9
    image(out)


def test_pressure_of_samples(report, tmp_path):
    shifts = (-0.003, 0.0, 0.001)
    runs = [compression(tmp_path / f"{k}.h5", k, shift=s) for k, s in enumerate(shifts)]
    found = report(PRESSURE, *runs, "--out", tmp_path / "p.png")
    assert [fit["phi_J(kappa)"] for fit in found["runs"]] == pytest.approx(PHI_J + np.array(shifts))
    assert found["mean"] == pytest.approx(PHI_J + np.mean(shifts))
    assert found["error"] == pytest.approx(np.std(shifts, ddof=1) / np.sqrt(3))
    image(tmp_path / "p.png")


@pytest.mark.usefixtures("undrawn")
def test_pressure_of_other_ensembles_has_no_mean(report, tmp_path):
    runs = [compression(tmp_path / f"{alpha}.h5", alpha=alpha) for alpha in (1.0, 4.0)]
    assert report(PRESSURE, *runs, "--out", tmp_path / "p.png")["mean"] is None


def test_pressure_without_onset_is_drawn_and_said(problem, capsys, tmp_path):
    runs = [compression(tmp_path / "a.h5"), compression(tmp_path / "b.h5", ends=(0.7, 0.8))]
    said = problem(PRESSURE, *runs, "--out", tmp_path / "p.png")
    assert said.startswith(f"fig04_pressure.py: {runs[1]}: p has no onset of jamming")
    fits = json.loads(capsys.readouterr().out)["runs"]
    assert fits[0]["phi_J(kappa)"] == pytest.approx(PHI_J)
    assert fits[1]["phi_J(kappa)"] is None
    image(tmp_path / "p.png")


def test_order_of_samples(report, tmp_path):
    runs = [compression(tmp_path / f"{n}-{k}.h5", k, n=n) for n in (100, 400) for k in range(3)]
    found = report(ORDER, *runs, "--out", tmp_path / "order.png")
    assert found["random"] == pytest.approx(np.sqrt(np.pi) / 2)
    means = {e["n"]: e["sqrtN_S_2"] for e in found["ensembles"]}
    assert {n: mean["samples"] for n, mean in means.items()} == {100: 3, 400: 3}
    rng = [np.random.default_rng(k) for k in range(3)]
    for r in rng:
        r.uniform(0, 7, 3)
    S_2 = [orientational_order(r.uniform(0, 7, 400), 2).S_n for r in rng]
    assert means[400]["value"] == pytest.approx(20 * np.mean(S_2))
    assert means[400]["error"] == pytest.approx(20 * np.std(S_2, ddof=1) / np.sqrt(3))
    image(tmp_path / "order.png")


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("asked", "phi"), [((), 0.9), (("--rise-to", 0.83), 0.83)])
def test_rise_of_the_order(report, tmp_path, asked, phi):
    slopes = (0.1, 0.2, 0.6)
    runs = [compression(tmp_path / f"{k}.h5", k, ordering=s) for k, s in enumerate(slopes)]
    (found,) = report(ORDER, *runs, *asked, "--out", tmp_path / "order.png")["ensembles"]
    for name in ("rise_S_2", "rise_S_4"):
        assert found[name]["value"] == pytest.approx(32 * 0.3 * (phi - 0.8))
        error = np.std(slopes, ddof=1) / np.sqrt(3)
        assert found[name]["error"] == pytest.approx(32 * error * (phi - 0.8))


@pytest.mark.parametrize("phi", [0.79, 0.91])
def test_rise_beyond_the_runs_is_refused(problem, tmp_path, phi):
    one = compression(tmp_path / "one.h5")
    said = problem(ORDER, one, "--rise-to", phi, "--out", tmp_path / "o.png")
    assert f"--rise-to is {phi}, expected from 0.8 to 0.9, where all runs with N = 1024" in said


@pytest.mark.usefixtures("undrawn")
def test_order_of_one_run_and_of_runs_that_do_not_overlap(report, problem, tmp_path):
    one = compression(tmp_path / "one.h5")
    (found,) = report(ORDER, one, "--out", tmp_path / "order.png")["ensembles"]
    assert (found["sqrtN_S_4"]["samples"], found["alpha"], found["kappa"]) == (1, 4.0, 1e-6)
    low = compression(tmp_path / "low.h5", ends=(0.7, 0.8))
    assert "share no range of phi" in problem(ORDER, one, low, "--out", tmp_path / "o.png")


@pytest.fixture(scope="module")
def rates(tmp_path_factory):
    """Three samples at two rates, of which the slower one begins later; in one file each."""
    folder = tmp_path_factory.mktemp("rates")
    onsets = {1: 0.0, 2: 0.002, 3: 0.01}
    cost = {"flow_evaluations": 100, "flow_wall_seconds": 1.5}
    paths = []
    for seed, onset in onsets.items():
        of = {"seed": seed, "ends": (0.84, 0.9)}
        slow = compression(folder / f"slow{seed}.h5", shift=onset, kappa=1e-10, **of, **cost)
        shift = onset - SHIFTS[seed]
        fast = compression(folder / f"fast{seed}.h5", shift=shift, kappa=1e-8, slope=0.22, **of)
        paths += [slow, fast]
    return paths


def test_rates_are_compared_sample_by_sample(report, rates, tmp_path):
    fast, slow = report(SLOW, *rates, "--out", tmp_path / "slow.png")["rows"]
    assert (fast["kappa"], slow["kappa"]) == (1e-8, 1e-10)
    assert slow["phi_J(kappa)"]["value"] == pytest.approx(PHI_J + 0.004, abs=2e-4)
    assert slow["phi_J(kappa)"]["error"] == pytest.approx(
        np.std([0, 2, 10], ddof=1) / 1e3 / 3**0.5, rel=0.05
    )
    # Samples differ by more than the rates do, and that does not enter.
    assert fast["shift"]["value"] == pytest.approx(-0.002, abs=1e-4)
    assert fast["shift"]["error"] == pytest.approx(0.001 / np.sqrt(3), rel=0.1)
    assert fast["excess"]["value"] > 0.1
    assert slow["shift"] is slow["excess"] is None
    assert (slow["evaluations"], slow["seconds"], fast["evaluations"]) == (100, 1.5, None)
    strain = np.log(0.9 / 0.84) / 2
    assert slow["heun"] == pytest.approx(2 * strain / (1e-10 * 0.01) / 100)
    image(tmp_path / "slow.png")


@pytest.mark.usefixtures("undrawn")
def test_steps_of_heun_are_counted_at_the_rates_that_held(report, tmp_path):
    cost = {"flow_evaluations": 10, "flow_wall_seconds": 1.5}
    kappa = np.array([[0.0, 1e-6], [0.85, 1e-8]])
    one = compression(tmp_path / "run.h5", ends=(0.8, 0.9), kappa=kappa, **cost)
    [row] = report(SLOW, one, "--out", tmp_path / "slow.png")["rows"]
    time = np.log(0.85 / 0.8) / 2 / 1e-6 + np.log(0.9 / 0.85) / 2 / 1e-8
    assert row["heun"] == pytest.approx(2 * time / 0.01 / 10)


def test_one_sample_has_the_error_of_its_fit_and_packings_are_marked(here, capsys, rates, tmp_path):
    marked = tmp_path / "packing.h5"
    write_packing(marked, packing(), {"alpha": 4.0, "n": 1024, "phi_J": 0.867})
    asked = ("--packing", marked, rates[0], "--out", tmp_path / "slow.png")
    assert here(SLOW, rates[0], *asked) == 0
    lines = capsys.readouterr().out.splitlines()
    (row,) = json.loads(lines[-1])["rows"]
    assert row["phi_J(kappa)"]["samples"] == 1
    assert 0 < row["phi_J(kappa)"]["error"] < 1e-9
    table = lines[:3]
    assert {line.count("|") for line in table} == {12}
    image(tmp_path / "slow.png")


@pytest.mark.usefixtures("undrawn")
def test_phi_j_by_frames_is_between_the_last_that_unjams_and_the_first_that_stays(report, tmp_path):
    jams = ((0.860, 0.862), (0.864, 0.868))
    runs = [
        compression(tmp_path / f"{k}.h5", k, **Jamming(low, high, 3).attributes())
        for k, (low, high) in enumerate(jams)
    ]
    [row] = report(SLOW, *runs, "--out", tmp_path / "slow.png")["rows"]
    found = row["phi_J(frames)"]
    assert (found["value"], found["samples"]) == (pytest.approx(0.8635), 2)
    # Of samples, whose standard error is 0.0025, and of brackets 0.002 and 0.004 wide.
    assert found["error"] == pytest.approx(np.sqrt(0.0025**2 + (0.002**2 + 0.004**2) / 2 / 12))


@pytest.mark.usefixtures("undrawn")
def test_runs_without_a_bracket_tell_no_phi_j_by_frames(report, tmp_path):
    one_end = Jamming(0.86, np.nan, 3).attributes()
    runs = [compression(tmp_path / "0.h5", 0, **one_end), compression(tmp_path / "1.h5", 1)]
    [row] = report(SLOW, *runs, "--out", tmp_path / "slow.png")["rows"]
    assert (row["phi_J(frames)"]["value"], row["phi_J(frames)"]["samples"]) == (None, 0)


def test_zeros_of_lines_depend_on_their_pressures_only_where_the_curve_bends(report, tmp_path):
    shifts = (-0.002, 0.0, 0.004)
    runs = [compression(tmp_path / f"{k}.h5", k, shift=s) for k, s in enumerate(shifts)]
    found = report(LINES, *runs, "--out", tmp_path / "lines.png")
    assert found["packings"] == []
    for row in found["zeros"]:
        assert (row["alpha"], row["n"], row["kappa"]) == (4.0, 1024, 1e-6)
        assert row["phi_J"]["value"] == pytest.approx(PHI_J + np.mean(shifts))
        assert row["phi_J"]["error"] == pytest.approx(np.std(shifts, ddof=1) / np.sqrt(3))
    image(tmp_path / "lines.png")


@pytest.mark.usefixtures("undrawn")
def test_a_window_that_the_pressure_does_not_reach_has_no_line(report, problem, tmp_path):
    run_file = compression(tmp_path / "run.h5")
    asked = (LINES, run_file, "--out", tmp_path / "lines.png", "--windows")
    low, high = report(*asked, "1e-3,4e-3", "1,2")["zeros"]
    assert low["phi_J"]["value"] == pytest.approx(PHI_J)
    assert (high["phi_J"]["value"], high["phi_J"]["samples"]) == (None, 0)
    assert "--windows has '2,1', expected two pressures" in problem(*asked, "2,1")
    assert "expected RUN.h5 or --quasistatic" in problem(LINES, "--out", tmp_path / "x.png")


def test_a_packing_is_compressed_by_steps_and_opened_to_its_energy(report, problem, tmp_path):
    particles = js.Spherocylinders(alpha=1)
    for seed in (1, 2):
        place = tmp_path / f"{seed}.h5"
        js.make_packing(particles, n=16, u0=1e-10, seed=seed, progress=False, file=place)
    packings = [tmp_path / "1.h5", tmp_path / "2.h5"]
    first = [js.load(path).results["phi_J"] for path in packings]
    end = max(first) + 0.02
    asked = (QUASISTATIC, *packings, "--phi-end", end, "--out", tmp_path / "above")
    found = report(*asked)
    opened = [js.load(tmp_path / "above" / f"{seed}.h5") for seed in (1, 2)]
    assert [one.results["u"] for one in opened] == pytest.approx([1e-10] * 2, rel=1e-6)
    assert [row["phi_J"] for row in found["packings"]] == [one.results["phi_J"] for one in opened]
    table = np.genfromtxt(tmp_path / "above" / "1.csv", delimiter=",", names=True)
    assert (table["phi"][-1], table["u"][0]) == (pytest.approx(end), pytest.approx(1e-10))
    steps = np.diff(table["phi"])
    assert steps == pytest.approx(np.full(len(steps), steps[0]))
    assert steps[0] <= 1e-3 * (1 + 1e-9)
    # dU = -p dV between two rows, unless something rearranged.
    volume = 1 / table["phi"]
    work = -np.diff(table["u"] * volume) / np.diff(volume)
    mean = (table["pressure"][1:] + table["pressure"][:-1]) / 2
    assert np.median(work / mean) == pytest.approx(1, rel=0.02)
    assert report(*asked) == found  # nothing is made again
    lines = report(LINES, "--quasistatic", tmp_path / "above", "--out", tmp_path / "l.png")
    [row] = lines["packings"]
    assert row["first"]["value"] == pytest.approx(np.mean(first), abs=1e-9)
    assert row["opened"]["value"] == pytest.approx(np.mean([o.results["phi_J"] for o in opened]))
    assert {zero["kappa"] for zero in lines["zeros"]} == {0.0}
    said = problem(QUASISTATIC, *packings, "--phi-end", 0.5, "--out", tmp_path / "above")
    assert said.endswith("give a larger one")
