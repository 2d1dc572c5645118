"""analysis/modes.py, as its users run it, on small packings made here."""

import json
import subprocess
import sys
from pathlib import Path
from subprocess import CompletedProcess

import h5py
import numpy as np
import pytest
from jamming import jam, write_jammed
from mixtures import bidisperse, superellipsoids

from jamshape.files.h5md import FileFormatError, read_packing, write_packing
from jamshape.protocols.random_start import random_packing
from jamshape.vibration.table import BANDS, read_modes

ANALYSIS = Path(__file__).parents[2] / "analysis"


def run_apart(*arguments):
    command = [sys.executable, "-W", "error", ANALYSIS / "modes.py", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.fixture
def run(here, capfd):
    """Run the script in this process; return how it ended, as `subprocess.run` does."""

    def ended(*arguments):
        capfd.readouterr()
        code = here("modes.py", *arguments)
        said = capfd.readouterr()
        if isinstance(code, str):
            return CompletedProcess(arguments, 1, said.out, f"{said.err}{code}\n")
        return CompletedProcess(arguments, code, said.out, said.err)

    return ended


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    path = tmp_path_factory.mktemp("modes") / "packing.h5"
    write_jammed(path, bidisperse(1), 16, 0.86)
    return path


@pytest.fixture(scope="module")
def analysed(packing):
    out = packing.with_name("modes.h5")
    plot = packing.with_name("modes.png")
    return out, plot, run_apart(packing, "--out", out, "--plot", plot, "--vectors")


def test_file_holds_every_mode_with_its_error(analysed, packing):
    out, plot, done = analysed
    assert (done.returncode, done.stderr) == (0, "")
    table = read_modes(out)
    n = table.attributes["n_modes"]
    assert table.vectors.shape == (n, n)
    assert table["eigenvalues"].shape == table.bound.shape == (n,)
    assert (np.diff(table["eigenvalues"]) >= 0).all()
    real = ~table["is_translation"].astype(bool)
    assert (table.bound[real] < 1e-6 * np.abs(table["eigenvalues"][real])).all()
    assert (np.sign(table["eigenvalues"]) == table["sign"])[real].all()
    assert np.isfinite(table["state_error"]).all()
    assert sum(len(table.in_band(name)) for name in BANDS.values()) == n
    kinds = sum(table[k] for k in ("parallel", "perpendicular", "rotation", "of_round"))
    np.testing.assert_allclose(kinds, 1, rtol=1e-10)
    assert table.attributes["packing_alpha"] == 1.0
    assert table.attributes["packing_shape"] == read_packing(packing).shape_style
    assert plot.read_bytes().startswith(b"\x89PNG")
    shift, _ = table.coordinates.motion(table.vectors[:, 0])
    assert shift.shape == (16, 2)


def test_summary_and_last_line(analysed):
    _, _, done = analysed
    lines = done.stdout.splitlines()
    report = json.loads(lines[-1], parse_constant=pytest.fail)  # no NaN
    assert report["rank"] == report["n_bonds"] - report["n_self_stress"]
    modes = sum(band["modes"] for band in report["bands"].values())
    assert modes + report["n_translations"] == report["n_modes"]
    assert report["method"] == "projected"
    text = "\n".join(lines[:-1])
    for words in ("rank of H", "N z / 2", "fraction", "bound", "bulk modulus"):
        assert words in text


@pytest.mark.parametrize("method", ["refined", "plain", "first_order"])
def test_other_methods(run, packing, tmp_path, analysed, method):
    done = run(packing, "--out", tmp_path / "m.h5", "--method", method)
    assert (done.returncode, done.stderr) == (0, "")
    one, other = read_modes(analysed[0]), read_modes(tmp_path / "m.h5")
    high = one.in_band("high")
    np.testing.assert_allclose(other["eigenvalues"][high], one["eigenvalues"][high], rtol=1e-8)
    assert other.vectors.shape == (len(one["eigenvalues"]), 0)


@pytest.mark.parametrize("omega", [None, 1.0])
def test_a_few_modes_alone(run, packing, tmp_path, analysed, omega):
    whole = read_modes(analysed[0])
    real = whole["eigenvalues"][~whole["is_translation"].astype(bool)]
    expected = np.sort(real[np.argsort(np.abs(real - (omega or 0.0) ** 2))[:4]])
    window = ("--method", "sparse", "--near", omega) if omega else ()
    done = run(packing, "--out", tmp_path / "few.h5", "--lowest", 4, *window)
    assert (done.returncode, done.stderr) == (0, "")
    few = read_modes(tmp_path / "few.h5")
    np.testing.assert_allclose(few["eigenvalues"][few.vibrational], expected, rtol=1e-9)
    # Translations come in addition, flagged as in the whole spectrum.
    translations = few["eigenvalues"][few["is_translation"]], few["band"][few["is_translation"]]
    np.testing.assert_array_equal(translations, [[0, 0], [-1, -1]])
    assert set(few["band"][few.vibrational]) == {3}
    json.loads(done.stdout.splitlines()[-1], parse_constant=pytest.fail)


def test_a_state_that_is_no_minimum_needs_force(run, packing, tmp_path):
    there = read_packing(packing)
    moved = there.with_(position=there.position + 1e-6 * np.sin(np.arange(32).reshape(16, 2)))
    path, out = tmp_path / "moved.h5", tmp_path / "m.h5"
    write_packing(path, moved)
    done = run(path, "--out", out)
    assert done.returncode == 1
    assert not out.exists()
    assert done.stderr.startswith(
        "modes.py: the state is not at a minimum: its largest net force is "
    )
    assert done.stderr.endswith("or use force (--force)\n")
    assert done.stderr.count("\n") == 1
    assert run(path, "--out", out, "--force").returncode == 0
    assert out.exists()


def test_problems_are_one_sentence(run, packing, tmp_path):
    wide = random_packing(8, 0.1, 1, bidisperse(1))
    write_packing(tmp_path / "wide.h5", wide)
    (tmp_path / "text.h5").write_text("no")
    for path, words in (
        (tmp_path / "wide.h5", "all 8 particles are rattlers"),
        (tmp_path / "text.h5", "expected a complete data file"),
        (tmp_path / "missing.h5", "No such file"),
    ):
        done = run(path, "--out", tmp_path / "m.h5")
        assert done.returncode == 1
        assert words in done.stderr
        assert done.stderr.count("\n") == 1
    done = run(packing, "--out", tmp_path / "m.h5", "--lowest", 1000)
    assert "1000 modes were requested" in done.stderr


def test_files_that_are_not_of_modes_are_refused(packing, tmp_path):
    with pytest.raises(FileFormatError, match="is not a complete file of modes"):
        read_modes(packing)
    with h5py.File(tmp_path / "empty.h5", "w"):
        pass
    with pytest.raises(FileFormatError, match="is not a complete file of modes"):
        read_modes(tmp_path / "empty.h5")


def test_modes_of_other_shapes_in_space(run, tmp_path):
    landscape, minimum = jam(superellipsoids(1.0, 0.7), 12, 0.6, 1e-10, dimension=3)
    path = tmp_path / "packing.h5"
    write_packing(path, minimum.state.packing(landscape.particles), {"exponent": 1.0, "w1": 0.7})
    done = run(path, "--out", tmp_path / "m.h5", "--plot", tmp_path / "m.png")
    assert (done.returncode, done.stderr) == (0, "")
    table = read_modes(tmp_path / "m.h5")
    # Spheroids do not spin about their axes.
    assert table.attributes["n_modes"] == 5 * table.attributes["n_backbone"]
    assert (tmp_path / "m.png").read_bytes().startswith(b"\x89PNG")
