"""inputs/compress_spherocylinder.in, with the stock lmp, as its users run it."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from jamshape.contacts import network as contacts
from jamshape.files.lammps_text import read_any, read_data, read_dump
from jamshape.files.restarts import is_whole

sys.path.append(str(Path(__file__).parents[1] / "styles"))

from lammps_scenes import REPOSITORY, command_line, environment, nearest_image

pytestmark = pytest.mark.lammps

SETTINGS = {"n": 32, "alpha": 2, "kappa": 1e-3, "dt": 0.1, "phi_end": 0.95}


def command(out, ranks=1, **settings):
    variables = [word for name, value in {**SETTINGS, **settings, "out": out}.items()
                 for word in ("-var", name, value)]  # fmt: skip
    return command_line("-in", "inputs/compress_spherocylinder.in", *variables, ranks=ranks)


def run_deck(out, ranks=1, **settings):
    done = subprocess.run(
        command(out, ranks, **settings), cwd=REPOSITORY, env=environment(), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:]
    warnings = [line for line in done.stdout.splitlines() if "WARNING" in line]
    assert all("Restart file used different # of processors" in line for line in warnings)


def thermo_rows(out):
    """Columns of the thermo output of a log, by name; of rows that stand twice the last."""
    names, rows = [], {}
    for line in (Path(out) / "log.lammps").read_text().splitlines():
        words = line.split()
        if words[:1] == ["Step"]:
            names = words
        elif names and len(words) == len(names) and words[0].isdigit():
            with contextlib.suppress(ValueError):  # a line that a kill cut short
                rows[int(words[0])] = [float(word) for word in words]
        else:
            names = []
    table = np.array([rows[step] for step in sorted(rows)])
    return dict(
        zip(
            [
                "step",
                "phi",
                "p",
                "u",
                "z",
                "S_2",
                "S_4",
                "fmax",
                "frms",
                "dt_max",
                "evaluations",
                "substep",
                "error",
            ],
            table.T,
            strict=True,
        )
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Folder of one complete run."""
    out = tmp_path_factory.mktemp("whole") / "new" / "folder"
    run_deck(out)
    return out


def test_deck_runs_bare_to_the_end(whole):
    rows = thermo_rows(whole)
    step_phi = np.exp(2 * SETTINGS["kappa"] * SETTINGS["dt"])
    assert rows["phi"][0] == 0.4
    assert 0.95 * (1 - 1e-6) < rows["phi"][-1] < 0.95 * step_phi
    np.testing.assert_allclose(rows["phi"], 0.4 * step_phi ** rows["step"], rtol=1e-7)
    assert 150 < len(rows["step"]) < 250
    assert rows["p"][0] == 0
    assert rows["p"][-1] > 1e-2
    assert rows["z"][-1] > 4
    assert np.isfinite([column for name, column in rows.items() if name != "dt_max"]).all()
    left = {"initial.data", "log.lammps", "particles.dump", "contacts.dump", "final.restart"}
    assert {path.name for path in whole.iterdir()} == left


def test_dumps_hold_the_states_that_the_log_tells_of(whole):
    rows, frames = thermo_rows(whole), read_dump(whole / "particles.dump", shape="spherocylinder")
    assert 15 < len(frames) < 25
    assert read_any(whole / "particles.dump", shape="spherocylinder").step == frames[-1].step
    last_tables = (whole / "contacts.dump").read_text().split("ITEM: TIMESTEP\n")[1:]
    assert len(last_tables) == len(frames)
    for frame, text in zip(frames, last_tables, strict=True):
        found = contacts.forces(frame, k_e=1.0, sides=1)
        (row,) = np.flatnonzero(rows["step"] == frame.step)
        np.testing.assert_allclose(rows["p"][row], found.pressure, rtol=1e-6)
        np.testing.assert_allclose(rows["u"][row] * frame.box.volume, found.energy, rtol=1e-6)
        network = contacts.find_contacts(frame, sides=1)
        assert int(text.split()[0]) == frame.step
        table = text.split("ITEM: ENTRIES ")[1].splitlines()
        assert table[0].split() == [f"c_contact[{k + 1}]" for k in range(14)]
        pairs = sorted(tuple(map(int, line.split()[:2])) for line in table[1:])
        assert pairs == sorted(tuple(sorted(frame.id[pair])) for pair in network.pairs)


def test_names_of_columns_are_those_that_ovito_maps(whole):
    titles = [line for line in (whole / "particles.dump").read_text().splitlines()
              if line.startswith("ITEM: ATOMS")]  # fmt: skip
    assert {title.strip() for title in titles} == {
        "ITEM: ATOMS id type x y z quatw quati quatj quatk shapex shapey shapez ix iy iz"
    }


def test_second_run_into_a_folder_starts_afresh(whole):
    before = (whole / "particles.dump").read_bytes()
    run_deck(whole)
    assert (whole / "particles.dump").read_bytes() == before


def test_two_ranks_agree_until_rounding_has_grown(whole, tmp_path):
    run_deck(tmp_path, ranks=2, data=whole / "initial.data")
    one, two = thermo_rows(whole), thermo_rows(tmp_path)
    np.testing.assert_array_equal(two["step"], one["step"])
    np.testing.assert_allclose(two["phi"], one["phi"], rtol=1e-7)
    early = one["phi"] < 0.8
    assert (one["p"][early] > 0).sum() > 20
    np.testing.assert_allclose(two["p"][early], one["p"][early], rtol=1e-6)


def dump_steps(path):
    """Steps of the frames of a dump."""
    lines = path.read_text().splitlines()
    return [int(lines[k + 1]) for k, line in enumerate(lines) if line == "ITEM: TIMESTEP"]


# --- kill and go on ------------------------------------------------------------------------------


def wait_for(condition, process):
    deadline = time.monotonic() + 60
    while not condition():
        assert process.poll() is None, "the run ended before it could be killed"
        assert time.monotonic() < deadline
        time.sleep(0.002)


@pytest.mark.parametrize("ranks_after", [1, 2])
def test_run_goes_on_after_a_kill(ranks_after, tmp_path):
    slow = {"n": 64, "kappa": 2e-4, "phi_end": 0.9, "sides": "two"}
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    run_deck(whole, **slow)
    process = subprocess.Popen(
        command(killed, data=whole / "initial.data", **slow), cwd=REPOSITORY, env=environment(),
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    with process:
        # restart.b is there from the beginning, restart.a from the first frame on.
        wait_for(lambda: is_whole(killed / "restart.a"), process)
        process.kill()
    assert not (killed / "final.restart").exists()
    halfway = read_any(
        killed / "particles.dump", shape="spherocylinder"
    )  # readable before the run has ended

    newest = max(killed.glob("restart.?"), key=lambda path: path.stat().st_mtime_ns)
    if ranks_after == 1:  # as killed while it wrote
        newest.write_bytes(newest.read_bytes()[:-3])
        for name, rest in (("particles", "ITEM: TIM"), ("contacts", "ITEM: TIMESTEP\n99999999")):
            with (killed / f"{name}.dump").open("a") as file:
                file.write(rest)
        newest = killed
    run_deck(killed, ranks_after, restart=newest, data=whole / "initial.data", **slow)
    for name in ("particles.dump", "contacts.dump"):
        steps = [dump_steps(folder / name) for folder in (killed, whole)]
        assert steps[0] == steps[1]
    expected = {
        frame.step: frame for frame in read_dump(whole / "particles.dump", shape="spherocylinder")
    }
    frames = read_dump(killed / "particles.dump", shape="spherocylinder")
    assert {frame.step for frame in frames} == expected.keys()
    assert halfway.step < max(expected)
    for frame in frames:
        whole_frame = expected[frame.step]
        np.testing.assert_array_equal(frame.box.edges, whole_frame.box.edges)
        apart = nearest_image(frame.position - whole_frame.position, frame.box)
        assert np.abs(apart).max() < 1e-10 * frame.box.edges.max()
        turn = frame.orientation - whole_frame.orientation
        assert np.abs(np.sin(turn / 2)).max() < 1e-10
    one, two = thermo_rows(whole), thermo_rows(killed)
    np.testing.assert_array_equal(one["step"], two["step"])
    np.testing.assert_allclose(two["p"], one["p"], rtol=1e-6, atol=1e-12)
    # Each process begins with some evaluations, from which it estimates the largest time step.
    assert np.all(np.diff(two["evaluations"]) > 0)
    np.testing.assert_allclose(two["evaluations"], one["evaluations"], rtol=0, atol=40)


def test_deck_takes_data_of_your_own(whole, tmp_path):
    packing = read_data(whole / "initial.data")
    run_deck(tmp_path, data=whole / "initial.data", kappa=1e-2, phi_end=0.5)
    first = read_dump(tmp_path / "particles.dump", shape="spherocylinder")[0]
    np.testing.assert_array_equal(first.position, packing.sorted_by_id().position)
