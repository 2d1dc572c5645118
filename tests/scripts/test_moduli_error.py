"""Moduli and their bounds beside quasistatic shear, differences of forces and a dense solution."""

import pytest

SCRIPT = "errors/moduli_error.py"


def require_within(found, n):
    assert found["moduli"] == found["within"] == n
    assert found["median_bound_from_1e-10_on"] < 1e-6


def test_moduli_are_within_their_bounds(report, tmp_path, measured):
    found = report(SCRIPT, "--only", 6, 13, "--out", tmp_path)
    measured(bound=found["largest_bound_from_1e-10_on"])
    require_within(found, 6)
    assert 2 * 6 <= found["calculations"] <= 3 * 6
    shears = [row["moduli"]["simple_shear"] for row in found["packings"]]
    assert all(abs(row["shear"] / row["modulus"] - 1) < 1e-4 for row in shears)
    assert (tmp_path / "table.md").read_text().count("| yes |") == 2


@pytest.mark.validate
def test_all_moduli_are_within_their_bounds(report, tmp_path, measured):
    found = report(SCRIPT, "--out", tmp_path)
    measured(
        median=found["median_bound_from_1e-10_on"], largest=found["largest_bound_from_1e-10_on"]
    )
    require_within(found, 60)
    assert 170 <= found["calculations"] <= 3 * 60
    assert sum(row["n_floppy"] > 0 for row in found["packings"]) >= 5
    rods = [
        row for row in found["packings"] if (row["packing"], row["u0"]) == ("rods, alpha = 4", 1e-6)
    ]
    for row in rods:
        shear = row["moduli"]["simple_shear"]
        assert abs(shear["shear"] / shear["modulus"] - 1) < 1e-4
