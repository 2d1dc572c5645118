"""The amplitude up to which cycles are elastic."""

import numpy as np
import pytest
from pictures import image

import jamshape as js
from common.elastic_limit import elastic_limit, is_elastic

SCRIPT = "shear/elastic_limit.py"


def test_cycles_below_the_limit_are_elastic_and_cycles_beyond_are_not():
    packing = js.make_packing(js.Spherocylinders(alpha=0), n=12, u0=1e-4, progress=False)
    found = elastic_limit(packing, accuracy=0.1, steps=12)
    assert 0 < found.low < found.high <= 1.1 * found.low
    assert found.error < 0.05 * found.value
    for amplitude, expected in ((0.3 * found.low, True), (1.5 * found.high, False)):
        assert is_elastic(packing, amplitude, steps=12) == expected


def test_a_limit_outside_the_range_of_amplitudes_is_open():
    """Far below jamming nothing touches, and nothing is lost."""
    loose = js.make_packing(js.Spherocylinders(alpha=0), n=8, u0=1e-4, progress=False)
    box = js.Box(lo=loose.box.lo, edges=3 * loose.box.edges)
    dilute = loose.with_(position=3 * (loose.position - box.lo) + box.lo, box=box)
    assert elastic_limit(dilute, steps=2)[:2] == (pytest.approx(0.256), np.inf)


def test_the_script_finds_limits_once(report, tmp_path):
    words = (
        "--alpha",
        0,
        "--n",
        12,
        "--samples",
        2,
        "--accuracy",
        0.5,
        "--steps",
        5,
        "--out",
        tmp_path,
    )
    found = report(SCRIPT, *words)
    (row,) = found["elastic_limits"]
    low, high = np.array([[one["low"], one["high"]] for one in row["limits"]]).T
    assert (high <= 1.5 * low).all()
    assert row["amplitude"]["value"] == pytest.approx(((low + high) / 2).mean())
    image(found["out"])
    times = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*_seed*")}
    assert report(SCRIPT, *words) == found
    assert {path: path.stat().st_mtime_ns for path in times} == times


def test_packings_without_a_limit_have_no_average(report, tmp_path):
    open_above = '{"low": 0.256, "high": null, "cycles": 2}'
    (tmp_path / "alpha0_n12_u1e-06_seed1_0.5_5.json").write_text(open_above)
    words = ("--n", 12, "--u0", 1e-6, "--samples", 1, "--accuracy", 0.5, "--steps", 5)
    (row,) = report(SCRIPT, "--alpha", 0, *words, "--out", tmp_path)["elastic_limits"]
    assert (row["amplitude"]["value"], row["median"]) == (None, None)
