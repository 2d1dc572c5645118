"""The table of one run, one packing and its modes beside the paper's numbers: beside_paper."""

import pytest
from jamming import write_jammed
from test_figures_of_runs import PHI_J, compression

import jamshape as js
from common import published
from jamshape.files.h5md import read_attributes
from jamshape.measures.jamming import Jamming
from jamshape.shapes.particles import Particles

BESIDE = "marschall_2018/beside_paper.py"


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    path = tmp_path_factory.mktemp("beside") / "packing.h5"
    write_jammed(path, Particles.of("spherocylinder", alpha=4), 24, 0.87, u0=1e-11)
    return path


def rows_of(found):
    return {row["quantity"]: (row["here"], row["paper"]) for row in found["rows"]}


def test_a_run(report, tmp_path):
    found = Jamming(0.86, 0.87, 2).attributes()
    run = compression(tmp_path / "run.h5", **found)
    found = report(BESIDE, "--run", run)
    assert found["n"] == [1024]
    rows = rows_of(found)
    onset, paper = rows["phi_J(kappa = 1e-06), p to 0"]
    assert (float(onset.split()[0]), paper) == (pytest.approx(PHI_J), "0.866")
    assert rows["phi_J between frames, minimised"] == ("0.86000 and 0.87000", "0.866")


def test_a_run_of_which_little_is_known(report, tmp_path):
    run = compression(tmp_path / "run.h5", ends=(0.7, 0.8), alpha=3.0)
    assert rows_of(report(BESIDE, "--run", run)) == {"phi_J(kappa = 1e-06), p to 0": ("none", "")}


def test_a_packing_and_its_modes(report, packing, tmp_path):
    modes = js.modes(packing)
    modes.save(tmp_path / "modes.h5")
    found = report(BESIDE, "--packing", packing, "--modes", tmp_path / "modes.h5")
    assert found["n"] == [24]
    rows, stored = rows_of(found), read_attributes(packing)
    assert float(rows["z of all bonds"][0]) == pytest.approx(stored["z"], abs=1e-3)
    bearing, paper = rows["z of bonds above 1e-6 of the mean"]
    assert (float(bearing), paper) == (
        pytest.approx(stored["z_bearing"], abs=1e-3),
        "5.640 +- 0.010",
    )
    assert float(rows["phi_J, u0 = 1e-11 to 0"][0]) == pytest.approx(stored["phi_J"], abs=1e-4)
    assert rows["phi - phi_J at u0 = 1e-11"][1] == "9.3e-06"
    assert rows["rattlers"][1] == "0.12 %"
    for band, part in published.BANDS[4.0].items():
        assert rows[f"modes in the {band} band"][1] == f"{part:.4f}"
    shares = [float(rows[f"modes in the {band} band"][0]) for band in published.BANDS[4.0]]
    assert sum(shares) == pytest.approx(1, abs=2.1 / 72)  # less two translations
    stopped = modes.table.attributes["n_grazing"] / modes.table.n_vibrational
    low, paper = rows["low band without bonds below 1e-6"]
    assert (float(low), paper) == (pytest.approx(shares[0] + stopped, abs=1e-3), "0.0638")


def test_files_are_asked_for(problem):
    assert "expected --run, --packing or --modes" in problem(BESIDE)


def test_bands_that_the_paper_counts_are_all_modes():
    for bands in published.BANDS.values():
        assert sum(bands.values()) == pytest.approx(1, abs=1e-3)
