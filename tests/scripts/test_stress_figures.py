"""Figures of packings at a pressure, from few small packings; fits from numbers that are known."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

from common.moduli_fit import fitted

ANALYSIS = Path(__file__).parents[2] / "analysis"
SMALL = ("--pressures", 1e-4, 1e-2, "--per-decade", 1)


def functions_of(script, monkeypatch):
    """Run a script without its main; return its functions."""
    monkeypatch.syspath_prepend((ANALYSIS / script).parent)
    return runpy.run_path(str(ANALYSIS / script))


def test_exponents_are_found():
    p = np.geomspace(1e-6, 1e-2, 9)
    for beta in (0.5, 0.85):
        found = fitted(p, 2e-3 + 0.7 * p**beta, 1e-4 * np.ones(9))
        assert abs(found.beta - beta) < 0.006  # the step of the search
        assert abs(found.G_0 / 2e-3 - 1) < 0.05
        assert abs(found.c / 0.7 - 1) < 0.05


def test_moduli_are_averaged_and_kept(report, tmp_path):
    runs = tmp_path / "runs"
    call = ("stress/moduli_scaling.py", "--n", 10, "--samples", 2, *SMALL, "--runs", runs)
    found = report(*call, "--out", tmp_path / "one.png")["systems"]
    assert [of["alpha"] for of in found] == [0, 1]
    assert all(of["samples"] == 2 and len(of["points"]) == 3 for of in found)
    files = sorted(runs.glob("*.json"))
    assert len(files) == 4
    discs = [json.loads(path.read_text()) for path in files if path.name.startswith("a0_")]
    G = [rows[0]["G"] for rows in discs]
    assert found[0]["points"][0]["G_all"] == pytest.approx(np.mean(G), rel=1e-12)
    times = [path.stat().st_mtime_ns for path in files]
    again = report(*call, "--out", tmp_path / "two.png")["systems"]
    assert again == found
    assert [path.stat().st_mtime_ns for path in files] == times
    assert (tmp_path / "two.png").stat().st_size > 1e4


def test_an_empty_folder_is_told(problem, tmp_path):
    call = (
        "stress/moduli_scaling.py",
        "--only-kept",
        "--runs",
        tmp_path,
        "--out",
        tmp_path / "p.png",
    )
    assert "no results" in problem(*call)


def test_least_contacts_and_stability(report, tmp_path):
    """At jamming 2 N - 1 contacts carry a pressure, which leaves boxes of fixed shape unstable; 2 N + 1 are stable to all strains."""
    found = report(
        "stress/shear_stability.py", "--n", 10, "--samples", 2, *SMALL,
        "--runs", tmp_path / "runs", "--out", tmp_path / "p.png",
    )  # fmt: skip
    (size,) = found["sizes"]
    assert size["least_excess"] == {"isotropic": 0, "free": 0}
    assert size["failed"] == size["undecided"] == size["still_unstable"] == 0
    first = size["points"][0]
    assert first["unstable"] == 1
    assert first["excess_free"] == first["excess_fixed"] == 0


def test_onsets_agree(report, tmp_path):
    found = report(
        "stress/jamming_from_pressure.py", "--shapes", "discs", "rods1", "--n", 12, "--samples", 1,
        "--runs", tmp_path / "runs", "--out", tmp_path / "p.png",
    )["shapes"]  # fmt: skip
    for name in ("discs", "rods1"):
        assert (
            found[name]["reached"] == found[name]["same_state"] == found[name]["within_errors"] == 1
        )
        assert found[name]["largest_difference"] < 1e-8


def test_errors_of_boxes_fall(report, tmp_path):
    found = report(
        "errors/box_error.py", "--n", 8, "--pressures", 1e-4, "--out", tmp_path / "p.png"
    )
    assert len(found["curves"]) == 3
    for curve in found["curves"]:
        assert curve["error"][-1] < 1e-8
        assert np.all(np.diff(curve["seconds"]) > 0)


def test_a_slow_box_lags_and_times_are_reported(report, tmp_path):
    found = report(
        "stress/box_time.py", "--n", 12, "--samples", 1, "--alphas", 1, "--pressures", 1e-2, 1e-3, "--gdot", 1e-3,
        "--strain", 2, "--factors", 1, 1000, "--runs", tmp_path / "runs", "--out", tmp_path / "p.png",
    )  # fmt: skip
    high, low = found["times"]
    assert low["expected"] == pytest.approx(10 * high["expected"])
    assert 0 < high["slowest"] < 10 * high["expected"]
    usual, slow = found["shears"]
    assert slow["t_box"] == pytest.approx(1000 * usual["t_box"])
    assert slow["spread_over_p"] > 0
    assert abs(usual["p_yy_over_p"] - 1) < 0.3
    assert (tmp_path / "p.png").stat().st_size > 1e4


def test_powers_follow_from_the_law(report, tmp_path):
    found = report(
        "stress/law_scaling.py", "--laws", "hertz", "power 3", "--n", 10, "--samples", 1, "--overlaps", 1e-5, 1e-3,
        "--points", 3, "--fit-contacts", 1e-5, 1e-2, "--runs", tmp_path / "runs", "--out", tmp_path / "p.png",
    )["systems"]  # fmt: skip
    assert [of["law"] for of in found] == ["hertz", "power 3"]
    for of, A in zip(found, (2.5, 3.0), strict=True):
        expected = {"pressure": A - 1, "omega": (A - 2) / 2, "bulk": A - 2}
        for name, power in expected.items():
            assert of["powers"][name]["expected"] == pytest.approx(power)
            assert of["powers"][name]["power"] == pytest.approx(power, abs=0.01)
        assert of["points"][0]["excess"] == pytest.approx(0, abs=1e-12)
    assert (tmp_path / "p.png").stat().st_size > 1e4
