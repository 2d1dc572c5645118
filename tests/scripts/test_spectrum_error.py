"""analysis/errors/spectrum_error.py, as its users run it."""

from jamming import write_jammed
from mixtures import bidisperse


def test_errors_of_all_methods_against_run_time(report, tmp_path):
    packing, out = tmp_path / "packing.h5", tmp_path / "errors.png"
    write_jammed(packing, bidisperse(1), 16, 0.86)
    found = report("errors/spectrum_error.py", packing, "--tiles", 2, "--out", out)
    (row,) = found["packings"]
    largest = {m: row["methods"][m]["bands"]["high"]["largest"] for m in row["methods"]}
    assert largest["projected"] < 1e-13
    assert largest["projected"] < largest["first_order"]
    assert found["tiles"][0]["n"] == 64
    assert found["tiles"][0]["relative_bound"] < 1e-6
    assert out.read_bytes().startswith(b"\x89PNG")
