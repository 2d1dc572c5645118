"""Shear in LAMMPS, recorded in a file: what it holds, starts, isolated particles."""

import numpy as np
import pytest

import jamshape as js
from jamshape.files.h5md import read_attributes
from jamshape.measures.shears import read_shear, shear_report

pytestmark = pytest.mark.lammps

RODS = js.Spherocylinders(alpha=4)
QUIET = {"n": 16, "progress": False}


@pytest.fixture(scope="module")
def sheared(tmp_path_factory):
    file = tmp_path_factory.mktemp("shear") / "shear.h5"
    return js.shear(RODS, phi=0.7, gdot=1e-2, strain=4, file=file, rows=200, frames=4, **QUIET)


def test_the_packing_fraction_stays_what_was_asked_for(sheared):
    np.testing.assert_allclose(sheared.phi, 0.7, rtol=1e-13)
    assert sheared.strain[-1] == pytest.approx(4, rel=1e-12)
    assert len(sheared.strain) == 201
    assert len(sheared) == 5


def test_cells_of_frames_tilt_with_the_strain(sheared):
    """The tilt over the height is the strain, but for whole cells that were taken off."""
    for frame, strain in zip(sheared, sheared.strain[::50], strict=True):
        (xy,), (lx, ly) = frame.box.tilt, frame.box.edges
        assert abs(xy) <= 0.5 * lx * (1 + 1e-9)
        cells = (strain * ly - xy) / lx
        assert cells == pytest.approx(round(cells), abs=1e-9)


def test_stress_of_the_last_frame_is_that_of_the_last_row(sheared):
    contacts = js.load(sheared.file, -1)
    assert contacts.pressure == pytest.approx(sheared.pressure[-1], rel=1e-9)


def test_a_lonely_rod_turns_as_the_closed_form_says(tmp_path):
    """PHYSICS C: the period is 2 pi / (gdot sqrt(1 - c^2)); over whole periods S_2 is (1 - sqrt(1 - c^2)) / c."""
    rod = js.Spherocylinders(alpha=1)
    one = js.shear(
        rod, n=1, phi=1e-3, gdot=1e-2, strain=0.1, rows=4, file=tmp_path / "a.h5", progress=False
    )
    body = one.packing(0)
    a, r = (
        float(x)
        for x in (body.diameters[0, 0] / 2 - body.diameters[0, 1] / 2, body.diameters[0, 1] / 2)
    )
    # Second moments of a rectangle 2a by 2r with half discs at its ends.
    along = 4 * a**3 * r / 3 + np.pi * r**4 / 4 + a**2 * np.pi * r**2 + 8 * a * r**3 / 3
    across = 4 * a * r**3 / 3 + np.pi * r**4 / 4
    c = (along - across) / (along + across)
    root = np.sqrt(1 - c**2)
    period = 2 * np.pi / root
    run = js.shear(rod, n=1, phi=1e-3, gdot=1e-2, strain=4 * period, rows=4000, file=tmp_path / "b.h5",
                   integration_tolerance=1e-8, progress=False)  # fmt: skip
    found = run.steady(after=0.0)
    assert found["rotation"].value == pytest.approx(root / 2, rel=1e-6)
    # S_2 of one rod is 1 at every moment; that of the mean tensor is the one of the closed form.
    assert found["S_2"].value == pytest.approx((1 - root) / c, rel=1e-5)
    assert found.director == pytest.approx(0, abs=1e-6)
    assert found["pressure"].value == 0


def test_a_run_begins_with_a_packing_and_says_so(sheared, tmp_path):
    start = js.load(sheared.file, -1)
    run = js.shear(start=start, gdot=1e-2, strain=0.5, flow="pure", rows=20, file=tmp_path / "b.h5",
                   progress=False)  # fmt: skip
    assert run.strain[-1] == pytest.approx(0.5, rel=1e-12)
    np.testing.assert_allclose(run.phi, 0.7, rtol=1e-12)
    edges = run.packing(-1).box.edges / run.packing(0).box.edges
    np.testing.assert_allclose(edges, np.exp([0.5, -0.5]), rtol=1e-12)
    stored = read_attributes(run.file)
    assert (stored["alpha"], stored["n"], stored["start"]) == (4.0, 16, str(sheared.file))


def test_another_run_in_the_file_is_refused(sheared):
    for other in ({"gdot": 1e-3}, {"phi": 0.71}, {"strain": 3}, {"flow": "pure", "strain": 2}):
        asked = {"phi": 0.7, "gdot": 1e-2, "strain": 4, "rows": 200, "frames": 4} | other
        with pytest.raises(ValueError, match="expected"):
            js.shear(RODS, file=sheared.file, **QUIET, **asked)
    with pytest.raises(ValueError, match="expected"):
        js.compress(RODS, n=16, file=sheared.file, progress=False)


def test_it_is_loaded_resumed_and_shown_as_what_it_is(sheared):
    assert isinstance(js.load(sheared.file), js.ShearFile)
    assert js.resume(sheared.file, progress=False).gdot == 0.01
    assert "shear of" in sheared._repr_html_().lower()
    axes = sheared.plot()
    assert "simple shear" in axes.get_title()


def test_averages_of_a_file_are_reported(sheared, tmp_path):
    told = shear_report(sheared.file, 1.0)
    found = sheared.steady(1.0)
    assert told["pressure"] == found["pressure"].value
    assert told["S_2_error"] == found["S_2"].error
    short = js.shear(RODS, gdot=1e-2, strain=0.01, rows=4, file=tmp_path / "c.h5", **QUIET)
    assert "shear further" in shear_report(short.file)["steady"]
    assert read_shear(short.file).steady is None


def test_spheroids_shear_in_space(tmp_path):
    bodies = js.Superellipsoids(w1=0.6)
    run = js.shear(bodies, n=12, dimension=3, phi=0.5, gdot=1e-2, strain=0.6, rows=30, file=tmp_path / "d.h5",
                   progress=False)  # fmt: skip
    np.testing.assert_allclose(run.phi, 0.5, rtol=1e-12)
    assert run.steady(0.1)["pressure"].value > 0


# alpha, n, phi, gdot, strain: boxes of two rods are shorter than the longer one.
EXTREMES = {
    "fast, nearly discs": (1e-6, 16, 0.84, 1e-1, 1.0),
    "slow, nearly discs": (1e-6, 16, 0.86, 1e-8, 0.02),
    "fast, a box shorter than a rod": (4.0, 2, 0.6, 1e-1, 2.0),
    "slow, a box shorter than a rod": (4.0, 2, 0.9, 1e-8, 0.02),
    "long rods": (50.0, 4, 0.3, 1e-4, 0.1),
    "long rods, slow": (50.0, 4, 0.3, 1e-8, 0.1),
}


@pytest.mark.filterwarnings("ignore:gdot = 0.1 drags particles")
@pytest.mark.parametrize("case", EXTREMES)
def test_extremes_are_sheared_and_stay_what_they_were(case, tmp_path, measured):
    alpha, n, phi, gdot, strain = EXTREMES[case]
    run = js.shear(js.Spherocylinders(alpha=alpha), n=n, phi=phi, gdot=gdot, strain=strain, rows=20,
                   file=tmp_path / "a.h5", progress=False)  # fmt: skip
    measured(pressure=run.pressure.max(), evaluations=float(run["evaluations"][-1]))
    assert run.strain[-1] == pytest.approx(strain, rel=1e-12)
    np.testing.assert_allclose(run.phi, phi, rtol=1e-12)
    assert np.isfinite([*run.pressure, *run["p_xy"], *run["turned"]]).all()
    assert 0 <= run.pressure.min() <= run.pressure.max() < 0.2


def test_a_rate_that_contacts_do_not_bear_is_told_before_the_run(tmp_path):
    def sheared(gdot):
        js.shear(js.Spherocylinders(alpha=4), n=2, phi=0.3, gdot=gdot, strain=0.05, rows=5, again=True,
                 file=tmp_path / "a.h5", progress=False)  # fmt: skip

    with pytest.warns(UserWarning, match="so that long ones may cross") as said:
        sheared(0.1)
    bearable = float(str(said[0].message).split()[-1])
    # Area (4 alpha + pi) R^2 and outer radius (alpha + 1) R of the large rods, R = 0.7; contacts of theirs bear 1/(2R).
    assert bearable == pytest.approx(0.5 / ((16 + np.pi) * 0.7**2 * 5 * 0.7 * 1.4), rel=0.02)
    sheared(0.9 * bearable)


@pytest.mark.parametrize("phi", [0.3, 0.4, 0.4 * (1 + 1e-12), 0.45])
def test_a_packing_fraction_that_a_random_start_has_needs_no_compression(phi, tmp_path):
    run = js.shear(js.Spherocylinders(alpha=1), n=16, phi=phi, gdot=1e-2, strain=0.1, rows=5,
                   file=tmp_path / "a.h5", progress=False)  # fmt: skip
    np.testing.assert_allclose(run.phi, phi, rtol=1e-9)


def test_nearly_sharp_corners_are_not_passed_in_one_step():
    """Their contacts are a fiftieth of a square long; a longer step passes from one side of them to the other."""
    corners = [(0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5)]
    squares = js.Spheropolygons(corners=corners, rounding=0.02)
    run = js.shear(squares, n=16, phi=0.6, gdot=1e-4, strain=0.05, rows=5, progress=False)
    assert run.strain[-1] == pytest.approx(0.05)
