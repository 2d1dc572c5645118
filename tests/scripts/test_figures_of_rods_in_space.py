"""Density and contacts of rods in space, on a small sweep made here and on numbers that are known."""

import csv
import runpy
from pathlib import Path

import pytest
from pictures import image

import jamshape as js

ANALYSIS = Path(__file__).parents[2] / "analysis"
SCRIPT = "heussinger_2020/end_contacts.py"
ALPHAS = (0.0, 0.5, 10.0)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """Two packings of spheres and of rods of each aspect ratio."""
    folder = tmp_path_factory.mktemp("rods_in_space")
    for alpha in ALPHAS:
        for seed in (1, 2):
            file = folder / f"{alpha}_{seed}.h5"
            shape = js.Spherocylinders(alpha=alpha, size_ratio=1)
            js.make_packing(
                shape, n=16, seed=seed, dimension=3, u0=1e-15, file=file, progress=False
            )
    return folder


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(ANALYSIS / Path(SCRIPT).parent)
    return runpy.run_path(str(ANALYSIS / SCRIPT))


def test_density_and_contacts_against_aspect_ratio(report, sweep, tmp_path):
    out, modes = tmp_path / "e.png", tmp_path / "modes"
    modes.mkdir()
    for file in sorted(sweep.glob("10.0_*.h5")):
        js.modes(js.load(file)).save(modes / f"{file.stem}.modes.h5")
    found = report(SCRIPT, sweep, "--modes", modes, "--out", out)
    assert (found["with_modes"], found["as_many"]) == (2, 2)
    image(out)
    spheres, short, long = found["rods"]
    assert [row["alpha"] for row in found["rods"]] == list(ALPHAS)
    assert "at_both" not in spheres
    assert found["packings"] == 2
    assert found["isostatic"] in {0, 1, 2}
    for row in (short, long):
        assert row["at_one"]["value"] == 0
        assert row["at_neither"]["value"] + row["at_both"]["value"] == pytest.approx(1)
        parts = sum(
            row[f"{name}"]["value"] for name in ("side_to_side", "end_to_side", "end_to_end")
        )
        assert parts == pytest.approx(1)
        missing = row["z_blocked"]["value"] - row["z"]["value"]
        assert row["z_missing"]["value"] == pytest.approx(missing)
    assert long["side_to_side"]["value"] > short["side_to_side"]["value"]
    assert found["peak"]["alpha"] == 0.5
    assert found["peak"]["alpha_error"] == pytest.approx(2.5)


def test_the_peak_is_between_its_neighbours(script):
    mean = script["Mean"]
    phi_J = {0.0: mean(0.63), 0.2: mean(0.69), 0.5: mean(0.7), 0.6: mean(0.68)}
    found = script["peak_of"](phi_J)
    assert (found["alpha"], found["phi_J"].value) == (0.5, 0.7)
    assert found["alpha_error"] == pytest.approx(0.1)


def test_the_published_maximum_is_that_of_the_table(script):
    [(alpha, phi_J)] = script["MAXIMUM"].items()
    with (ANALYSIS / "heussinger_2020" / "paper.csv").open(newline="") as file:
        rows = {row["result"]: row for row in csv.DictReader(file)}
    assert float(rows["end_contacts/peak/alpha"]["value"]) == alpha
    row = rows["end_contacts/peak/phi_J"]
    assert (float(row["value"]), float(row["error"])) == phi_J[:2]
