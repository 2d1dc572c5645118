"""inputs/shear_spherocylinder.in, with the stock lmp, as its users run it."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from jamshape.contacts import network as contacts
from jamshape.files.lammps_text import read_dump
from jamshape.files.restarts import is_whole

sys.path.append(str(Path(__file__).parents[1] / "styles"))

from lammps_scenes import REPOSITORY, command_line, environment

pytestmark = pytest.mark.lammps

# To a strain of 0.7, with a flip at 0.5.
SETTINGS = {
    "n": 32,
    "alpha": 2,
    "gdot": 1e-3,
    "strain": 0.7,
    "phi_end": 0.9,
    "dt": 0.05,
    "sides": "two",
}


def command(out, **settings):
    variables = [word for name, value in {**SETTINGS, "rows": 14, "frames": 7, **settings, "out": out}.items()
                 for word in ("-var", name, value)]  # fmt: skip
    return command_line("-in", "inputs/shear_spherocylinder.in", *variables)


def run_deck(out, **settings):
    return subprocess.run(
        command(out, **settings), cwd=REPOSITORY, env=environment(), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300, check=False,
    )  # fmt: skip


def rows(out):
    """Rows of the log from the first with a strain on, by step, and the names of their columns."""
    names, found = [], {}
    for line in (out / "log.lammps").read_text().splitlines():
        words = line.split()
        if words[:2] == ["Step", "v_strained"]:
            names = words
        elif names and len(words) == len(names) and words[0].isdigit():
            found[int(words[0])] = dict(zip(names, map(float, words), strict=True))
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("shear") / "whole"
    done = run_deck(out)
    assert done.returncode == 0, done.stdout[-3000:]
    return out


def test_deck_shears_at_constant_density_to_its_strain(whole):
    found = rows(whole)
    strain = [row["v_strained"] for row in found.values()]
    np.testing.assert_allclose(strain, np.linspace(0, 0.7, 15), rtol=0, atol=1e-12)
    phi = [row["v_phi"] for row in found.values()]
    np.testing.assert_allclose(phi, phi[0], rtol=1e-12)
    assert phi[0] == pytest.approx(0.9, rel=1e-3)
    last = found[max(found)]
    assert last["v_mu"] == pytest.approx(last["v_sigma"] / last["v_p"], rel=1e-6)
    assert last["v_turned"] < 0  # with the vorticity
    assert sorted(path.name for path in whole.glob("*.restart*")) == ["final.restart"]


def test_frames_have_the_tilt_and_the_energy_of_their_row(whole):
    found, frames = rows(whole), read_dump(whole / "particles.dump", shape="spherocylinder")
    assert len(frames) == 8
    for frame in frames:
        row = found[frame.step]
        tilt = row["v_strained"] - (row["v_strained"] > 0.5)
        assert frame.box.tilt[0] / frame.box.edges[1] == pytest.approx(tilt, abs=1e-12)
        energy = contacts.find_contacts(frame, sides=2).energy.sum() / frame.box.volume
        assert energy == pytest.approx(row["v_u"], rel=1e-6)


def test_a_killed_run_goes_on_with_its_strain(whole, tmp_path):
    out = tmp_path / "killed"
    process = subprocess.Popen(
        command(out),
        cwd=REPOSITORY,
        env=environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    with process:
        deadline = time.monotonic() + 60
        while not is_whole(out / "restart.a"):
            assert process.poll() is None, "the run ended before it could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.002)
        process.kill()
    done = run_deck(out, restart=out)
    assert done.returncode == 0, done.stdout[-3000:]
    assert rows(out).keys() == rows(whole).keys()
    for frame, expected in zip(
        read_dump(out / "particles.dump", shape="spherocylinder"),
        read_dump(whole / "particles.dump", shape="spherocylinder"),
        strict=True,
    ):
        assert frame.step == expected.step
        np.testing.assert_array_equal(frame.box.matrix, expected.box.matrix)
        apart = np.linalg.solve(frame.box.matrix, (frame.position - expected.position).T)
        assert np.abs(apart - np.round(apart)).max() < 1e-9


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"gdot": 1}, "gdot is '1', expected a number from 1e-14 to 0.1."),
        ({"gdot": 1e-12}, "expected a larger rate or time step"),
        ({"shear": 1}, "The deck has no setting shear"),
    ],
)
def test_bad_settings_end_it_before_anything_runs(settings, sentence, tmp_path):
    done = run_deck(tmp_path / "none", **settings)
    assert done.returncode != 0
    assert sentence in done.stdout
    assert not (tmp_path / "none").exists()
