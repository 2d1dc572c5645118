"""The figures of many shapes in the plane, as their users run them, on a small sweep made here."""

import pytest
from pictures import image

import jamshape as js

FOLDER = "vanderwerf_2018"
ASPHERICITY, CONSTRAINTS = (f"{FOLDER}/{name}.py" for name in ("asphericity", "constraints"))
SHAPES = {
    "discs": js.Spherocylinders(alpha=0.0),
    "spherocylinders": js.Spherocylinders(alpha=1.0),
    "ellipses": js.Superellipsoids(p=1, w1=0.7, w2=1, size_ratio=1.4),
    "asymmetric dimers": js.Clumps(discs=js.dimer_discs(0.5)),
    "dumbbells": js.Clumps(discs=js.dimer_discs(1.0, 1.3)),
    "rounded triangles": js.Spheropolygons(corners="0 0/1 0/0.4 0.7", rounding=0.3),
}


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """One packing of each shape."""
    folder = tmp_path_factory.mktemp("shapes")
    for k, shape in enumerate(SHAPES.values()):
        file = folder / f"{k}.h5"
        js.make_packing(shape, n=16, seed=1, dimension=2, u0=1e-15, file=file, progress=False)
    return folder


def test_density_and_contacts_against_asphericity(report, sweep, tmp_path):
    out = tmp_path / "a.png"
    rows = report(ASPHERICITY, sweep, "--out", out)["shapes"]
    image(out)
    by_family = {row["family"]: row for row in rows}
    assert by_family.keys() == SHAPES.keys()
    assert by_family["discs"]["asphericity"]["value"] == pytest.approx(1.0, abs=1e-12)
    # Two circles of diameters 1 and 1/2 that just touch: (3/2)^2 over 1 + 1/4.
    assert by_family["asymmetric dimers"]["asphericity"]["value"] == pytest.approx(1.8)
    assert all(row["phi_J"]["value"] < 1 for row in rows)


def test_missing_contacts_and_blocked_motions(report, sweep, tmp_path):
    out = tmp_path / "c.png"
    told = report(CONSTRAINTS, sweep, "--modes", tmp_path / "modes", "--out", out)
    image(out)
    assert told["packings"] == told["enough"] == len(SHAPES)
    rows = {row["family"]: row for row in told["counts"]}
    for row in rows.values():
        missing = row["n_isostatic"] - row["n_contacts"]
        assert row["is_matched"] == (missing == row["n_quartic"] + row["n_free"])
        assert row["n_quartic"] + row["n_free"] - row["n_redundant"] == missing
    assert rows["ellipses"]["n_quartic"] > 0
    assert rows["discs"]["n_quartic"] == rows["asymmetric dimers"]["n_quartic"] == 0
    assert len(list((tmp_path / "modes").glob("*.modes.h5"))) == len(SHAPES)
