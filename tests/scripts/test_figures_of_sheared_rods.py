"""Onsets, order and rotation of sheared rods, from small runs and from numbers that are known."""

import csv
import runpy
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from pictures import image

import jamshape as js
from common.sheared import at_phi, exceeds
from jamshape.measures.averages import Mean

pytestmark = pytest.mark.lammps

ANALYSIS = Path(__file__).parents[2] / "analysis"
FOLDER = "marschall_shear"


# Aspect ratios with their packing fractions and rates: one has enough of them for fits.
GRID = {
    0.0: ((0.9, 1.0), (3e-3,)),
    0.5: ((0.9, 0.95, 1.0), (3e-2, 1e-2, 3e-3)),
    2.0: ((0.9, 1.0), (3e-3,)),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Rods of three aspect ratios at several packing fractions and rates, as the workflow leaves them."""
    root = tmp_path_factory.mktemp("reproduced")
    (root / "packings").mkdir()
    (root / "shears").mkdir()
    for alpha, (densities, rates) in GRID.items():
        for phi, gdot in product(densities, rates):
            file = root / "shears" / f"alpha{alpha:g}_phi{phi}_gdot{gdot}.h5"
            js.shear(js.Spherocylinders(alpha=alpha), n=16, phi=phi, gdot=gdot, strain=1.0, rows=50, frames=2,
                     integrator="rkc2", file=file, progress=False)  # fmt: skip
    return root


@pytest.fixture
def runs(folder):
    return sorted((folder / "shears").glob("*.h5"))


def test_onsets_by_aspect_ratio(report, runs, tmp_path):
    packings = tmp_path / "rods"
    packings.mkdir()
    for alpha in (0.0, 0.5):
        file = packings / f"alpha{alpha:g}.h5"
        js.make_packing(
            js.Spherocylinders(alpha=alpha), n=16, seed=1, u0=1e-8, file=file, progress=False
        )
    out = tmp_path / "o.png"
    found = report(f"{FOLDER}/onsets.py", *runs, "--packings", packings, "--out", out)
    image(out)
    assert [row["alpha"] for row in found["onsets"]] == [0, 0.5, 2]
    assert [row["alpha"] for row in found["compressed"]] == [0, 0.5]
    assert 0 <= found["hypostatic"] <= found["rods"] <= 2


def test_order_and_rotation_by_aspect_ratio(report, runs, tmp_path):
    found = report(f"{FOLDER}/order.py", *runs, "--out", tmp_path / "o.png")
    image(tmp_path / "o.png")
    assert found["rods"] == 2  # discs have no order
    for row in found["courses"]:
        assert row["gdot"] == 3e-3
        assert row["phi"] == [0.9, 1.0]
        assert row["S_2"]["extreme"]["value"] >= row["S_2"]["last"]["value"]
        assert row["rotation"]["extreme"]["value"] <= row["rotation"]["first"]["value"]


def test_discs_alone_have_no_order(problem, folder, tmp_path):
    discs = sorted((folder / "shears").glob("alpha0_*.h5"))
    assert "all runs are of discs" in problem(
        f"{FOLDER}/order.py", *discs, "--out", tmp_path / "x.png"
    )


def test_the_table_has_a_line_for_each_run(report, runs, folder):
    report("sample_tables.py", folder, "--out", folder / "samples")
    with (folder / "samples" / "shears.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == len(runs) == 13
    assert {line["gdot"] for line in lines} == {"0.03", "0.01", "0.003"}
    assert all(float(line["pressure_error"]) > 0 for line in lines)


def test_a_course_has_an_extreme_only_beyond_errors(monkeypatch):
    monkeypatch.syspath_prepend(ANALYSIS / FOLDER)
    course_of = runpy.run_path(str(ANALYSIS / FOLDER / "order.py"))["course_of"]
    means = {phi: Mean(v, 0.01, 1) for phi, v in ((0.1, 0.5), (0.5, 0.6), (0.9, 0.4))}
    peak = course_of(means, is_peak=True)
    assert (peak.extreme.value, peak.has_extreme) == (0.6, True)
    assert not course_of(means, is_peak=False).has_extreme  # the smallest value is at the end
    rough = {phi: mean._replace(error=0.1) for phi, mean in means.items()}
    assert not course_of(rough, is_peak=True).has_extreme


def test_values_between_packing_fractions():
    means = {0.8: Mean(3.0, 0.1, 1), 0.9: Mean(5.0, 0.3, 1)}
    assert at_phi(means, 0.85)[:2] == pytest.approx((4.0, 0.2))
    assert np.isnan(at_phi(means, 0.95).value)
    assert exceeds(means[0.9], means[0.8])
    assert not exceeds(means[0.8], means[0.9])
