"""Shear moduli along geometrical families, of few small packings."""

import csv
import json
import runpy
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pictures import image

ANALYSIS = Path(__file__).parents[2] / "analysis"
FOLDER = "zhang_2021"
SMALL = ("--n", 16, "--samples", 2, "--pressures", 1e-6, 1e-3, "--per-decade", 2)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder as the workflow leaves it, with two packings of discs and two of rods."""
    folder = tmp_path_factory.mktemp("reproduced")
    (folder / "packings").mkdir()
    return folder


@pytest.fixture
def series(report, made):
    """The files of both systems, made once."""
    for alpha in (0, 1):
        call = (f"{FOLDER}/compress.py", "--alpha", alpha, *SMALL, "--runs", made / "series")
        assert report(*call)["made"] == 2
    return made / "series"


def test_slopes_are_those_between_pressures_with_the_same_contacts(series):
    """From one pressure to the next G changes by the mean slope, where bonds stay and slopes hardly change."""
    checked = 0
    for path in sorted(series.glob("*.json")):
        rows = json.loads(path.read_text())
        for low, high in pairwise(rows):
            known = [row.get("slope") for row in (low, high)]
            stay = low["n_bonds"] == high["n_bonds"]
            if None in known or not stay or abs(known[1] / known[0] - 1) > 0.01:
                continue
            step = high["pressure"] - low["pressure"]
            assert high["G"] - low["G"] == pytest.approx(sum(known) / 2 * step, rel=1e-3)
            assert max(row["slope_bound"] for row in (low, high)) < 1e-5 * abs(known[0])
            checked += 1
    assert checked >= 8


def test_families_of_discs_fall_and_both_parts_make_the_modulus(report, series, tmp_path):
    out = tmp_path / "f.png"
    found = report(f"{FOLDER}/families.py", "--alpha", 0, 1, *SMALL, "--runs", series, "--out", out)
    image(out)
    discs, rods = found["systems"]
    assert (discs["falling"], discs["rising"], discs["families"]) == (2, 0, 2)
    assert rods["families"] == 2
    for system in (discs, rods):
        assert system["points"][0]["G_r"] == 0
        for point in system["points"]:
            assert point["G"] == pytest.approx(point["G_f"] + point["G_r"], rel=1e-12)
    report("stress/moduli_scaling.py", *SMALL, "--runs", series, "--only-kept", "--out", out)


def test_integral_of_a_slope_that_grows_linearly(monkeypatch):
    monkeypatch.syspath_prepend(ANALYSIS / FOLDER)
    by_families = runpy.run_path(str(ANALYSIS / FOLDER / "families.py"))["by_families"]
    p = np.geomspace(1e-6, 1e-2, 5)
    G = 3.0 - 2 * p + 5 * p**2
    assert by_families(p, G, -2 + 10 * p) == pytest.approx(G, rel=1e-12)


@pytest.mark.usefixtures("series")
def test_the_table_has_a_line_for_each_packing(report, made):
    report("sample_tables.py", made, "--out", made / "samples")
    with (made / "samples" / "series.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert [(line["alpha"], line["seed"]) for line in lines] == [
        ("0", "1"), ("0", "2"), ("1", "1"), ("1", "2"),
    ]  # fmt: skip
    [first, *_] = json.loads((made / lines[2]["file"]).read_text())
    assert float(lines[2]["G at 1e-06"]) == pytest.approx(first["G"], rel=1e-9)
    assert float(lines[2]["slope at 1e-06"]) == pytest.approx(first["slope"], rel=1e-9)


def test_figures_from_a_table_are_those_from_its_packings(report, series, made, tmp_path):
    report("sample_tables.py", made, "--out", made / "samples")
    sources, out = (series, made / "samples" / "series.csv"), tmp_path / "f.png"
    for call in ((f"{FOLDER}/families.py", "--alpha", 0, 1), ("stress/moduli_scaling.py",)):
        drawn = [report(*call, *SMALL, "--runs", x, "--out", out)["systems"] for x in sources]
        for one, other in zip(*(flat(systems) for systems in drawn), strict=True):
            assert one == pytest.approx(other, rel=1e-6, abs=1e-9, nan_ok=True)


def flat(systems):
    """Numbers of each system, its pressures and its fits, without averages over directions, which tables do not have."""
    rows = [row for of in systems for row in (of, *of["points"])]
    fits = [
        fit for of in systems for name, fit in of.get("fits", {}).items() if name != "directions"
    ]
    keep = [{k: x for k, x in row.items() if "directions" not in k} for row in (*rows, *fits)]
    return [{k: x for k, x in row.items() if isinstance(x, int | float)} for row in keep]
