"""The scripts that draw, as their users run them, on small files made here."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from jamshape.files.h5md import write_packing
from jamshape.files.lammps_text import write_data
from jamshape.files.run_writer import RunWriter
from jamshape.measures.order import orientational_order
from jamshape.packing import Box, Packing

ANALYSIS = Path(__file__).parents[2] / "analysis"
PHI_J = 0.866


def run(script, *arguments):
    command = [sys.executable, "-W", "error", ANALYSIS / script, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def report(script, *arguments):
    done = run(script, *arguments)
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(done.stdout.splitlines()[-1])


def problem(script, *arguments):
    done = run(script, *arguments)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1, "one sentence and no traceback"
    assert done.stderr.startswith(f"{script}: ")
    return done.stderr


def image(path):
    """(height, width, 3 or 4) values from 0 to 1, after a look at whether anything is drawn."""
    from matplotlib.image import imread  # noqa: PLC0415 - the other helpers need none

    pixels = imread(path)
    assert min(pixels.shape[:2]) > 300
    assert pixels[..., :3].std() > 0.02
    return pixels


def packing(angle=(0.0, 0.0, 0.0), **changes):
    """Two rods side to side across the upper edge of the box, which touch, and a third alone."""
    fields = {
        "position": np.array([[3.0, 7.8], [3.0, 0.75], [2.0, 4.0]]),
        "orientation": np.array(angle),
        "diameters": np.array([[4.0, 1.0, 1.0], [4.0, 1.0, 1.0], [2.8, 1.4, 1.4]]),
        "species": np.array([1, 1, 2]),
        "id": np.array([1, 2, 3]),
        "box": Box(lo=np.zeros(2), edges=np.array([8.0, 8.0])),
    }
    return Packing(**(fields | changes))


def compression(path, seed=1, n=1024, shift=0.0, ends=(0.8, 0.9), **attributes):
    """A run whose pressure is a line from PHI_J + shift on, of particles at random angles."""
    rng = np.random.default_rng(seed)
    first = packing(rng.uniform(0, 7, 3))
    known = {"alpha": 4.0, "n": n, "kappa": 1e-6, "size_ratio": 1.4, "k_e": 1.0, "sides": 2}
    writer = RunWriter.create(path, first, known | attributes | {"finished": True})
    S = {f"S_{k}": orientational_order(rng.uniform(0, 7, n), k).S_n for k in (2, 4)}
    for step, phi in enumerate(np.linspace(*ends, 40)):
        p = 0.2 * max(phi - PHI_J - shift, 0)
        writer.append_observables(step, step / 3, {"phi": phi, "p": p, **S})
    return path


@pytest.mark.parametrize("script", ["draw.py", "fig_order.py", "fig_pressure.py"])
def test_help(script):
    done = run(script, "--help")
    assert done.returncode == 0
    assert "Marschall & Teitel" in done.stdout
    assert "--out" in done.stdout


@pytest.mark.parametrize("script", ["draw.py", "fig_order.py", "fig_pressure.py"])
def test_user_errors_are_one_sentence(tmp_path, script):
    out = tmp_path / "out.png"
    assert "No such file" in problem(script, tmp_path / "none.h5", "--out", out)
    text = tmp_path / "notes.txt"
    text.write_text("nothing of the kind\n")
    assert str(text) in problem(script, text, "--out", out)
    run_file = compression(tmp_path / "run.h5")
    assert "No such file" in problem(script, run_file, "--out", tmp_path / "none" / "out.png")
    assert "not supported" in problem(script, run_file, "--out", tmp_path / "out.nonsense")
    assert not out.exists()


@pytest.mark.parametrize("script", ["fig_order.py", "fig_pressure.py"])
def test_figures_of_runs_refuse_a_packing(tmp_path, script):
    path = tmp_path / "packing.h5"
    write_packing(path, packing())
    assert "expected a run of compress.py" in problem(script, path, "--out", tmp_path / "a.png")


def test_pressure_of_one_run(tmp_path):
    run_file, out = compression(tmp_path / "run.h5"), tmp_path / "pressure.png"
    found = report("fig_pressure.py", run_file, "--out", out)
    assert found["out"] == str(out)
    assert (found["mean"], found["error"]) == (None, None)
    (fit,) = found["runs"]
    assert fit["run"] == str(run_file)
    assert fit["phi_J"] == pytest.approx(PHI_J, abs=1e-12)
    assert fit["slope"] == pytest.approx(0.2, rel=1e-9)
    assert 0 < fit["phi_J_error"] < 1e-9
    image(out)


def test_pressure_of_samples(tmp_path):
    shifts = (-0.003, 0.0, 0.001)
    runs = [compression(tmp_path / f"{k}.h5", k, shift=s) for k, s in enumerate(shifts)]
    found = report("fig_pressure.py", *runs, "--out", tmp_path / "p.png")
    assert [fit["phi_J"] for fit in found["runs"]] == pytest.approx(PHI_J + np.array(shifts))
    assert found["mean"] == pytest.approx(PHI_J + np.mean(shifts))
    assert found["error"] == pytest.approx(np.std(shifts, ddof=1) / np.sqrt(3))
    image(tmp_path / "p.png")


def test_pressure_of_other_ensembles_has_no_mean(tmp_path):
    runs = [compression(tmp_path / f"{alpha}.h5", alpha=alpha) for alpha in (1.0, 4.0)]
    assert report("fig_pressure.py", *runs, "--out", tmp_path / "p.png")["mean"] is None


def test_pressure_without_onset_is_drawn_and_said(tmp_path):
    runs = [compression(tmp_path / "a.h5"), compression(tmp_path / "b.h5", ends=(0.7, 0.8))]
    done = run("fig_pressure.py", *runs, "--out", tmp_path / "p.png")
    assert done.returncode == 1
    assert done.stderr.startswith(f"fig_pressure.py: {runs[1]}: p has no onset of jamming")
    fits = json.loads(done.stdout)["runs"]
    assert fits[0]["phi_J"] == pytest.approx(PHI_J)
    assert fits[1]["phi_J"] is None
    image(tmp_path / "p.png")


def test_order_of_samples(tmp_path):
    runs = [compression(tmp_path / f"{n}-{k}.h5", k, n=n) for n in (100, 400) for k in range(3)]
    found = report("fig_order.py", *runs, "--out", tmp_path / "order.png")
    assert found["random"] == pytest.approx(np.sqrt(np.pi) / 2)
    assert [(e["n"], e["samples"]) for e in found["ensembles"]] == [(100, 3), (400, 3)]
    rng = [np.random.default_rng(k) for k in range(3)]
    for r in rng:
        r.uniform(0, 7, 3)
    S_2 = [orientational_order(r.uniform(0, 7, 400), 2).S_n for r in rng]
    assert found["ensembles"][1]["sqrtN_S_2"] == pytest.approx(20 * np.mean(S_2))
    image(tmp_path / "order.png")


def test_order_of_one_run_and_of_runs_that_do_not_overlap(tmp_path):
    one = compression(tmp_path / "one.h5")
    (found,) = report("fig_order.py", one, "--out", tmp_path / "order.png")["ensembles"]
    assert (found["samples"], found["alpha"]) == (1, 4.0)
    low = compression(tmp_path / "low.h5", ends=(0.7, 0.8))
    assert "share no range of phi" in problem("fig_order.py", one, low, "--out", tmp_path / "o.png")


def test_draw_counts_and_colors(tmp_path):
    write_packing(tmp_path / "packing.h5", packing(), {"sides": 2, "k_e": 1.0})
    out = tmp_path / "packing.png"
    found = report("draw.py", tmp_path / "packing.h5", "--out", out)
    assert found["out"] == str(out)
    assert (found["n"], found["rattlers"], found["contacts"]) == (3, 3, 1)
    assert found["phi"] == pytest.approx(packing().phi)
    assert found["u"] > 0
    pixels = image(out)[..., :3]
    height, width = pixels.shape[:2]
    assert height / width == pytest.approx(1, abs=0.1)
    red = (np.abs(pixels - [0.843, 0.098, 0.110]) < 0.02).all(axis=2)
    rows = np.flatnonzero(red.any(axis=1)) / height
    # The rods touch at y = 0.27 of 8: both points near the lower edge.
    assert rows.min() > 0.9
    columns = np.flatnonzero(red.any(axis=0)) / width
    assert np.ptp(columns) > 0.3, "two points of a side-to-side contact"


@pytest.mark.parametrize(("sides", "points"), [("1", 1), ("2", 2)])
def test_draw_shows_the_bonds_asked_for(tmp_path, sides, points):
    write_data(tmp_path / "packing.data", packing())
    report("draw.py", tmp_path / "packing.data", "--sides", sides, "--out", tmp_path / "p.png")
    pixels = image(tmp_path / "p.png")[..., :3]
    red = (np.abs(pixels - [0.843, 0.098, 0.110]) < 0.02).all(axis=2).any(axis=0)
    assert np.count_nonzero(np.diff(red.astype(int)) == 1) == points


@pytest.mark.parametrize("A", [0.0, 1e-3, 6.0])
def test_draw_discs_and_particles_longer_than_the_box(tmp_path, A):
    one = np.array([1])
    lone = packing(
        [0.3],
        position=np.array([[-20.0, 31.0]]),
        diameters=np.array([[2 * A + 1, 1.0, 1.0]]),
        species=one,
        id=one,
        box=Box(lo=np.array([-1.0, 2.0]), edges=np.array([4.0, 7.0])),
    )
    write_packing(tmp_path / "lone.h5", lone)
    found = report("draw.py", tmp_path / "lone.h5", "--out", tmp_path / "lone.png")
    assert (found["n"], found["contacts"]) == (1, 0)
    height, width = image(tmp_path / "lone.png").shape[:2]
    assert height / width == pytest.approx(7 / 4, rel=0.1)


def test_draw_a_frame_of_a_run(tmp_path):
    writer = RunWriter.create(tmp_path / "run.h5", packing())
    apart = np.array([[3.0, 7.8], [3.0, 1.5], [2.0, 4.0]])
    writer.append(packing(step=10, position=apart))
    counts = [
        report("draw.py", tmp_path / "run.h5", "--frame", k, "--out", tmp_path / "p.png")[
            "contacts"
        ]
        for k in (0, -1)
    ]
    assert counts == [1, 0]
    message = problem("draw.py", tmp_path / "run.h5", "--frame", 2, "--out", tmp_path / "p.png")
    assert "expected frame 2" in message


def test_draw_refuses_what_it_cannot_draw(tmp_path):
    one = np.array([1])
    quaternion = np.array([[1.0, 0.0, 0.0, 0.0]])
    box = Box(lo=np.zeros(3), edges=np.full(3, 9.0))
    fields = {"position": np.zeros((1, 3)), "orientation": quaternion, "box": box}
    fields |= {"diameters": np.array([[3.0, 1.0, 1.0]]), "species": one, "id": one}
    write_packing(tmp_path / "3d.h5", Packing(**fields))
    assert "expected two dimensions" in problem("draw.py", tmp_path / "3d.h5")
    write_packing(tmp_path / "super.h5", packing(shape_style="superellipsoid"))
    assert "expected 'spherocylinder'" in problem("draw.py", tmp_path / "super.h5")


def test_draw_ten_thousand_in_seconds(tmp_path):
    rng, side = np.random.default_rng(1), 100
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    R = rng.uniform(0.5, 1.5, side**2)
    many = packing(
        rng.uniform(0, 7, side**2),
        position=2.5 * grid + rng.normal(0, 0.1, (side**2, 2)),
        diameters=np.column_stack([2.5 * R, 2 * R, 2 * R]),
        species=np.ones(side**2, dtype=int),
        id=np.arange(1, side**2 + 1),
        box=Box(lo=np.zeros(2), edges=np.full(2, 2.5 * side)),
    )
    write_packing(tmp_path / "many.h5", many)
    found = report("draw.py", tmp_path / "many.h5", "--out", tmp_path / "many.png")
    assert found["n"] == side**2
    image(tmp_path / "many.png")
