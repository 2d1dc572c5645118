"""Scripts of analysis/shear on small runs, and the study of errors under shear."""

import numpy as np
import pytest
from pictures import image

import jamshape as js
from common.flow_curves import fit_flow_curve, shear_onset

pytestmark = pytest.mark.lammps

FOLDER = "shear"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Rods at two packing fractions and rates, by explicit and by implicit steps."""
    folder, paths = tmp_path_factory.mktemp("shears"), []
    for phi in (0.85, 0.95):
        for gdot, how in (
            (1e-2, {"frames": 10}),
            (3e-3, {"integrator": "tr-bdf2", "integration_tolerance": 1e-1}),
        ):
            path = folder / f"phi{phi}_g{gdot}.h5"
            js.shear(js.Spherocylinders(alpha=2), n=12, phi=phi, gdot=gdot, strain=0.3, rows=60,
                     file=path, progress=False, **how)  # fmt: skip
            paths.append(path)
    return paths


def test_rheology(report, runs, tmp_path):
    out = tmp_path / "rheology.png"
    found = report(f"{FOLDER}/rheology.py", *runs, "--after", 0.1, "--out", out)
    assert [(row["phi"], row["gdot"]) for row in found["runs"]] == [
        (0.85, 1e-2), (0.85, 3e-3), (0.95, 1e-2), (0.95, 3e-3),
    ]  # fmt: skip
    assert found["short"] == []
    by_phi = [row["pressure"] for row in found["runs"]]
    assert by_phi[2] > by_phi[0]
    assert all(row["startup"] == pytest.approx(0.1, abs=0.02) for row in found["runs"])
    image(out)


def test_flow_curves_of_two_rates_have_no_law(report, runs, tmp_path):
    out = tmp_path / "curves.png"
    found = report(f"{FOLDER}/flow_curves.py", *runs, "--after", 0.1, "--out", out)
    assert [row["phi"] for row in found["curves"]] == [0.85, 0.95]
    assert found["phi_J"]["from_yield"]["value"] is None
    assert all(row["eta_p"] > 0 for row in found["curves"])
    image(out)


def test_runs_of_several_systems_have_no_flow_curve(problem, runs, tmp_path):
    other = tmp_path / "discs.h5"
    js.shear(js.Spherocylinders(alpha=0), n=12, phi=0.8, gdot=1e-2, strain=0.5, rows=60, file=other,
             progress=False)  # fmt: skip
    said = problem(f"{FOLDER}/flow_curves.py", *runs, other, "--out", tmp_path / "c.png")
    assert "runs of 2 systems" in said


def test_classes_of_contact_carry_all(report, runs, tmp_path):
    found = report(
        f"{FOLDER}/class_stress.py", *runs[:1], runs[2], "--after", 0.1, "--out", tmp_path / "c.png"
    )
    for row in found["runs"]:
        for name in ("pressure", "shear_stress"):
            assert sum(part["value"] for part in row[name]) == pytest.approx(1, rel=1e-9)
    image(tmp_path / "c.png")


def test_pictures_of_rotation_and_contact_angles(report, runs, tmp_path):
    found = report(f"{FOLDER}/rotation.py", runs[0], runs[3], "--out", tmp_path / "r.png")
    assert [row["gdot"] for row in found["frames"]] == [1e-2, 3e-3]
    assert all(row["spread"] > 0 for row in found["frames"])
    image(tmp_path / "r.png")
    [row] = report(
        f"{FOLDER}/contact_angles.py", runs[2], "--after", 0.1, "--out", tmp_path / "a.png"
    )["contact_angles"]
    assert row["frames"] >= 5
    assert 0 < row["on_flat"]["value"] < 1
    image(tmp_path / "a.png")


def test_viscous_number_makes_its_runs_once(report, tmp_path):
    words = ["--alphas", 0, "--rates", 1e-2, 3e-3, "--n", 16, "--strain", 1, "--pressure", 1e-2]
    where = ["--folder", tmp_path / "runs", "--out", tmp_path / "J.png"]
    found = report(f"{FOLDER}/viscous_number.py", *words, *where)
    fast, slow = found["points"]
    assert fast["J"] > slow["J"] > 0
    assert fast["friction"] > 0
    assert fast["phi"] < slow["phi"] + 0.1
    image(tmp_path / "J.png")
    assert report(f"{FOLDER}/viscous_number.py", *words, *where) == found


@pytest.mark.parametrize(
    "name", ["rheology", "flow_curves", "class_stress", "rotation", "contact_angles"]
)
def test_what_is_no_shear_is_refused(problem, tmp_path, name):
    path = tmp_path / "run.h5"
    js.compress(js.Spherocylinders(alpha=1), n=8, phi=(0.3, 0.32), kappa=1e-2, rows=4, frames=2,
                file=path, progress=False)  # fmt: skip
    assert "holds no shear" in problem(f"{FOLDER}/{name}.py", path, "--out", tmp_path / "x.png")


def test_the_law_and_the_onset_are_those_that_made_the_numbers():
    """Yield pressures from phi_J = 0.85 on, and viscosities that diverge there with the power 2."""
    rates, phi_J = np.array([1e-6, 1e-5, 1e-4]), 0.85
    above, below = [], []
    for phi in (0.855, 0.86, 0.87):
        p = 0.3 * (phi - phi_J) + 0.1 * rates**0.5
        above.append(fit_flow_curve(phi, rates, p, 1e-3 * p))
    for phi in (0.78, 0.80, 0.82, 0.83):
        p = 0.01 * (phi_J - phi) ** -2.0 * rates
        below.append(fit_flow_curve(phi, rates, p, 1e-3 * p))
    for curve in above:
        assert curve.yields == pytest.approx(0.3 * (curve.phi - phi_J), rel=1e-2)
        assert curve.power == pytest.approx(0.5, rel=5e-2)
    found = shear_onset([*below, *above])
    assert found.from_yield.value == pytest.approx(phi_J, abs=2e-4)
    assert found.from_viscosity.value == pytest.approx(phi_J, abs=1e-3)
    assert found.beta.value == pytest.approx(2, rel=0.05)


@pytest.mark.parametrize(
    "held",
    [pytest.param((), marks=pytest.mark.validate), ("--pressure", 0.02)],
    ids=["volume", "pressure"],
)
def test_errors_of_integrators_are_measured(held, report, tmp_path):
    found = report("errors/shear_error.py", "--quick", *held, "--out", tmp_path)
    largest = {(row["method"], row["tolerance"]): row["largest"] for row in found["rows"]}
    assert largest["rkc2", 1e-5] < 1e-4
    assert largest["tr-bdf2", 1e-3] < 1e-3
    assert largest["heun", None] < 1e-4
    image(tmp_path / "shear_error.png")
