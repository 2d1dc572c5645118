"""Moduli of small packings of discs by p N^2, continued from what is in the folder."""

SCRIPT = "elasticity/finite_size.py"


def test_moduli_by_size_and_pressure(report, tmp_path):
    options = ("--n", 16, "--u0", 1e-9, 1e-4, "--out", tmp_path)
    report(SCRIPT, *options, "--seeds", 2)
    first = {path: path.stat().st_mtime_ns for path in tmp_path.glob("16_*.json")}
    assert len(first) == 4
    low, high = report(SCRIPT, *options, "--seeds", 4)["points"]
    assert all(path.stat().st_mtime_ns == time for path, time in first.items())
    for point in (low, high):
        assert point["packings"] == point["used"] == 4
        assert point["bulk"] > 0
        assert 0 <= point["unstable"] <= 1
    assert low["pN2"] < 0.1
    assert high["pN2"] > 1
    assert low["unstable"] == 1.0
    assert high["unstable"] < 1.0
    assert len((tmp_path / "averages.csv").read_text().splitlines()) == 3
    assert (tmp_path / "finite_size.png").read_bytes().startswith(b"\x89PNG")
