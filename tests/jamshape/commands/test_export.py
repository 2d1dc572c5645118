"""``jamshape export``: what others read, read back."""

import h5py
import numpy as np
import pytest

from jamshape.commands.export import FORMATS
from jamshape.files.h5md import count_frames, read_packing
from jamshape.files.lammps_text import read_data
from jamshape.front.files import load

pytestmark = pytest.mark.lammps

MODULES = {"gsd": "gsd.hoomd", "ovito": "ovito"}


@pytest.mark.parametrize("name", FORMATS)
def test_the_end_of_a_name_tells_the_format(jamshape, tiny, tmp_path, name):
    pytest.importorskip(MODULES.get(name, "h5py"))
    out = tmp_path / "new" / f"out{FORMATS[name].end}"
    ended = jamshape("export", tiny[0] / "run.h5", "--out", out)
    assert not ended.code, ended
    frames = count_frames(tiny[0] / "run.h5") if FORMATS[name].holds_many else 1
    assert (ended.report["to"], ended.report["frames"]) == (name, frames)
    last = read_packing(tiny[0] / "run.h5")
    assert ended.report["phi"] == last.phi
    assert out.stat().st_size > 1000


def test_all_frames_and_one_of_them(jamshape, tiny, tmp_path):
    run = tiny[0] / "run.h5"
    jamshape("export", run, "--out", tmp_path / "all.h5")
    assert count_frames(tmp_path / "all.h5") == count_frames(run) > 2
    for frame in (0, 1, -1):
        out = tmp_path / f"{frame}.data"
        jamshape("export", run, "--frame", frame, "--out", out)
        np.testing.assert_array_equal(read_data(out).position, read_packing(run, frame).position)
    # Frames alone are no run, which has p(phi).
    assert load(tmp_path / "all.h5").n == 16


def test_a_packing_keeps_its_results(jamshape, tiny, tmp_path):
    jamshape("export", tiny[0] / "packing.h5", "--out", tmp_path / "copy.h5")
    assert load(tmp_path / "copy.h5").results["outcome"] == "converged"


def test_gsd_holds_every_frame_and_is_read_back(jamshape, tiny, tmp_path):
    gsd = pytest.importorskip("gsd.hoomd")
    run, out = tiny[0] / "run.h5", tmp_path / "run.gsd"
    jamshape("export", run, "--out", out)
    with gsd.open(str(out), "r") as file:
        assert len(file) == count_frames(run)
    jamshape("export", out, "--frame", 1, "--out", tmp_path / "one.data")
    there = read_data(tmp_path / "one.data")
    np.testing.assert_array_equal(there.position, read_packing(run, 1).position)


def test_mdanalysis_finds_a_box_of_three_edges(jamshape, tiny, tmp_path):
    out = tmp_path / "run.h5md"
    jamshape("export", tiny[0] / "run.h5", "--out", out)
    with h5py.File(out) as file:
        assert (
            file["particles"].visititems(
                lambda name, item: item.attrs.get("dimension") if name.endswith("box") else None
            )
            == 3
        )


@pytest.mark.parametrize(
    ("source", "options", "words"),
    [
        ("run.h5", ("--out", "a.png"), "use jamshape draw for pictures"),
        ("run.h5", ("--out", "a.xyz"), "or give --to"),
        ("run.h5", ("--out", "a.data", "--frame", 99), "expected frame 99 to be one of them"),
        ("modes.h5", ("--out", "a.data"), "holds modes, expected a packing or a run"),
        ("none.h5", ("--out", "a.data"), "No such file"),
    ],
)
def test_problems_are_one_sentence(jamshape, tiny, tmp_path, monkeypatch, source, options, words):
    monkeypatch.chdir(tmp_path)
    said = jamshape("export", tiny[0] / source, *options).code
    assert said.startswith("jamshape export: ")
    assert words in said
    assert "\n" not in said
    assert not list(tmp_path.iterdir())


def test_the_format_may_be_told(jamshape, tiny, tmp_path):
    out = tmp_path / "start"
    assert (
        jamshape("export", tiny[0] / "run.h5", "--to", "data", "--out", out).report["to"] == "data"
    )
    assert read_data(out).n == 16
