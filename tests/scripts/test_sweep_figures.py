"""The figures of a sweep, as their users run them, on a folder of small packings made here."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from mixtures import bidisperse
from pictures import image, is_color

from common.contact_angles import contact_angles
from common.contact_classes import class_fractions, flat_fraction
from jamshape.contacts import find_contacts
from jamshape.files.h5md import read_packing, write_packing
from jamshape.measures.averages import Mean
from jamshape.packing import Box
from jamshape.protocols.random_start import random_packing

ANALYSIS = Path(__file__).parents[2] / "analysis"
FOLDER = "marschall_2018"
PHI_J, SNAPSHOTS, NUMBER, CLASSES, ANGLES, RESIDUALS = SCRIPTS = [
    f"{FOLDER}/{name}.py"
    for name in (
        *("fig05_phi_j", "fig07_snapshots", "fig08_contact_number", "fig09_contact_classes"),
        *("fig10_contact_angles", "fig21_residuals"),
    )
]
N = 20


def squeezed(alpha, seed):
    """A random packing squeezed until there are about as many contacts as particles."""
    packing = random_packing(N, 0.45, seed, bidisperse(alpha))
    while len(find_contacts(packing, sides=2).pairs) <= N:
        box = Box(packing.box.lo, 0.99 * packing.box.edges)
        packing = packing.with_(position=0.99 * packing.position, box=box)
    return packing


def z_of(alpha):
    return 4 + (0.31 + 2.7 * alpha**0.68) * (alpha > 0)


def made_up(alpha, seed=1, **changes):
    """Attributes as those of pyscripts/make_packing.py."""
    z = z_of(alpha)
    attributes = {"alpha": float(alpha), "n": N, "seed": seed, "size_ratio": 1.4, "u0": 1e-15}
    attributes |= {"phi_J": 0.84 + 0.04 * min(alpha, 1) + 0.001 * seed, "outcome": "converged"}
    attributes |= {"phi_J_compression": np.nan, "phi_J_compression_error": np.nan}
    attributes |= {"z": z, "z_single": 3.5 + z / 8, "n_rattlers": 1, "rounding_floor": 1e-9}
    return attributes | changes


def write(folder, alpha, seed=1, **changes):
    """Write a packing with one rattler, the particle with ID 3."""
    rng, packing = np.random.default_rng(seed), squeezed(alpha, seed)
    residuals = np.where(packing.id == 3, np.nan, 10.0 ** rng.uniform(-12, -8, (2, N)))
    if alpha == 0:
        residuals[1] = np.nan  # discs have no torques
    observables = {"rattler_ids": np.array([3])}
    observables |= dict(zip(("net_force", "net_torque"), residuals, strict=True))
    path = folder / f"{alpha}_{seed}.h5"
    write_packing(path, packing, made_up(alpha, seed, **changes), observables)
    return path


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """Discs, the smallest alpha that fits need and a long one; one alpha with two samples."""
    folder = tmp_path_factory.mktemp("sweep")
    for alpha in (0.0, 0.01, 0.03, 0.1, 0.2, 1.0):
        write(folder, alpha)
    write(folder, 1.0, 2, phi_J_compression=0.885, outcome="sliding")
    write(folder, 0.1, 2, outcome="stalled")
    write_packing(folder / "still.run.h5", squeezed(1.0, 1), {"outcome": "none yet"})
    write_packing(folder / "start.h5", squeezed(1.0, 1))
    (folder / "notes.txt").write_text("left out\n")
    return folder


@pytest.mark.parametrize("script", SCRIPTS)
def test_help(help_of, script):
    said = help_of(script)
    assert "of Marschall & Teitel, PRE 97, 012905" in said
    assert f"python analysis/{script}" in said
    assert "--out" in said


@pytest.mark.parametrize("script", SCRIPTS)
def test_user_errors_are_one_sentence(problem, tmp_path, script):
    out = tmp_path / "out.png"
    assert "No such file" in problem(script, tmp_path / "none", "--out", out)
    (tmp_path / "empty").mkdir()
    assert "empty: no finished packing" in problem(script, tmp_path / "empty", "--out", out)
    plain = tmp_path / "plain.h5"
    write_packing(plain, squeezed(1.0, 1))
    assert "no attribute 'outcome'" in problem(script, plain, "--out", out)
    assert not out.exists()


def test_files_that_do_not_belong_together_or_lack_numbers(problem, tmp_path):
    out = ("--out", tmp_path / "out.png")
    paths = [tmp_path / f"{k}.h5" for k in range(4)]
    for path, changes in zip(paths, ({}, {"n": 30}, {"outcome": "stalled"}, {}), strict=True):
        write_packing(path, squeezed(1.0, 1), made_up(1.0, **changes))
    assert "n is 20 and 30, expected one ensemble" in problem(PHI_J, *paths[:2], *out)
    assert "has no observable 'net_force'" in problem(RESIDUALS, paths[0], *out)
    assert "no packing has alpha = 7" in problem(ANGLES, paths[0], "--alpha", 7, *out)
    attributes = made_up(1.0)
    del attributes["z"]
    write_packing(paths[3], squeezed(1.0, 1), attributes)
    assert "has no number 'z'" in problem(NUMBER, paths[3], *out)
    write_packing(paths[3], squeezed(1.0, 1), made_up(1.0, phi_J=np.nan))
    assert "phi_J is not known" in problem(PHI_J, paths[3], *out)


def test_phi_j_of_a_sweep(report, sweep, tmp_path):
    found = report(PHI_J, sweep, "--out", tmp_path / "a.png")
    image(tmp_path / "a.png")
    rows = found["phi_J"]
    assert [row["alpha"] for row in rows] == [0.0, 0.01, 0.03, 0.1, 0.2, 1.0]
    assert [row["paper"] for row in rows] == [0.8412, None, None, None, None, 0.8875]
    assert rows[0]["phi_J"] == {"value": pytest.approx(0.841), "error": None, "samples": 1}
    one = rows[-1]
    assert one["phi_J"]["value"] == pytest.approx(0.88 + 0.0015)
    assert one["phi_J"]["error"] == pytest.approx(0.0005)
    assert one["phi_J"]["samples"] == 2
    reached = one["phi_J"]["reached"]  # but for the one that slides
    assert reached == {"value": pytest.approx(0.881), "error": None, "samples": 1}
    assert one["phi_J_compression"]["value"] == 0.885
    assert one["phi_J_compression"]["reached"]["samples"] == 0
    assert found["conditions"]["not_reached"] == 2


def test_contact_number_of_a_sweep_and_its_fit(report, sweep, tmp_path):
    found = report(NUMBER, sweep, "--out", tmp_path / "a.png")
    image(tmp_path / "a.png")
    rows = {row["alpha"]: row for row in found["contact_numbers"]}
    assert rows[0.01]["z"]["value"] == pytest.approx(z_of(0.01))
    assert rows[0.01]["paper_rattlers"] == 34
    rattlers = {"value": 1, "error": 0, "samples": 2}
    assert rows[1.0]["rattlers"] == rattlers | {
        "reached": {"value": 1, "error": None, "samples": 1}
    }
    assert "reached" not in rows[0.2]["rattlers"]
    (fits,) = found["fits"]
    law = fits["z"]["fit"]
    assert (law["a"], law["b"], law["x"]) == pytest.approx((0.31, 2.7, 0.68), rel=1e-4)
    assert fits["z"]["paper"]["a"] == 0.31
    few = report(NUMBER, sweep, "--out", tmp_path / "a.png", "--largest", 0.15)
    (fits,) = few["fits"]
    assert fits["z"]["fit"] is None
    assert "expected 4" in fits["z"]["why_not"]


def test_a_single_sample_has_the_error_of_one_in_a_fit():
    errors_of = runpy.run_path(str(ANALYSIS / NUMBER))["errors_of"]
    nan = float("nan")
    many, one = Mean(4.4, 0.01, 9), Mean(4.5, nan, 1)  # samples deviate by 0.03
    assert errors_of([many, one, many]) == pytest.approx([0.01, 0.03, 0.01])
    assert errors_of([one, one]) is None
    assert errors_of([many, Mean(4.4, 0.0, 2)]) is None  # nobody knows how those deviate


def test_contact_classes_of_a_sweep(report, sweep, tmp_path):
    found = report(CLASSES, sweep, "--out", tmp_path / "a.png")
    image(tmp_path / "a.png")
    rows = {row["alpha"]: row for row in found["contact_classes"]}
    for row in rows.values():
        fractions = [row[name]["value"] for name in ("tip_to_tip", "tip_to_side", "side_to_side")]
        assert sum(fractions) == pytest.approx(1)
    packings = [read_packing(sweep / f"1.0_{seed}.h5") for seed in (1, 2)]
    networks = [find_contacts(packing, sides=2) for packing in packings]
    known = [(n, p.id == 3) for n, p in zip(networks, packings, strict=True)]
    sides = [class_fractions(*args).side_to_side for args in known]
    assert rows[1.0]["side_to_side"]["value"] == pytest.approx(np.mean(sides))
    assert rows[1.0]["side_to_side"]["error"] == pytest.approx(abs(sides[0] - sides[1]) / 2)
    flat = [flat_fraction(*args).of_backbone for args in known]
    assert rows[1.0]["flat_of_backbone"]["value"] == pytest.approx(np.mean(flat))
    assert rows[0.01]["paper_flat"] == 0.963
    assert rows[0.01]["flat_perimeter"] == pytest.approx(0.0063, abs=5e-5)


def test_contact_angles_of_a_sweep(report, sweep, tmp_path):
    found = report(ANGLES, sweep, "--out", tmp_path / "a.png")
    image(tmp_path / "a.png")
    rows = {row["alpha"]: row for row in found["contact_angles"]}
    assert list(rows) == [0.01, 1.0]
    packings = [read_packing(sweep / f"1.0_{seed}.h5") for seed in (1, 2)]
    angles = [contact_angles(p, find_contacts(p, sides=2), p.id == 3) for p in packings]
    assert rows[1.0]["contacts"] == sum(map(len, angles)) / 2
    on_flat = np.mean([np.mean(a > np.pi / 4) for a in angles])
    assert rows[1.0]["on_flat"]["value"] == pytest.approx(on_flat)
    asked = report(ANGLES, sweep, "--alpha", 0, 0.2, "--out", tmp_path / "a.png")
    assert [row["alpha"] for row in asked["contact_angles"]] == [0.0, 0.2]


def test_snapshots_of_a_sweep(report, sweep, tmp_path):
    found = report(SNAPSHOTS, sweep, "--alpha", 0.01, 1, "--out", tmp_path / "a.png")["snapshots"]
    assert [(row["alpha"], row["n"], row["rattlers"], row["seed"]) for row in found] == [
        (0.01, N, 1, 1),
        (1.0, N, 1, 1),
    ]
    pixels = image(tmp_path / "a.png")
    assert pixels.shape[1] / pixels.shape[0] == pytest.approx(1.8, abs=0.15)
    grey = is_color(pixels, np.full(3, 0.812), 0.01).mean()
    assert 0.01 < grey < 0.2, "one rattler in each"
    one = report(SNAPSHOTS, sweep / "1.0_2.h5", "--out", tmp_path / "a.png", "--dpi", 150)
    assert [row["seed"] for row in one["snapshots"]] == [2]


def test_residuals_of_a_sweep(report, sweep, tmp_path):
    asked = ("--alpha", 0, 0.1, 1)
    found = report(RESIDUALS, sweep, *asked, "--out", tmp_path / "a.png")["residuals"]
    image(tmp_path / "a.png")
    assert [(row["samples"], row["not_reached"]) for row in found] == [(1, 0), (2, 1), (2, 1)]
    assert found[0]["net_torque"] == {"median": None, "percentile_99": None, "largest": None}
    for row in found[1:]:
        for name in ("net_force", "net_torque"):
            assert 1e-12 < row[name]["median"] < row[name]["largest"] < 1e-8


def test_curves_of_several_systems(report, problem, sweep, tmp_path):
    """Rods in the plane, and in space, which the paper did not study."""
    for alpha in (0.5, 1.0):
        start = random_packing(N, 0.1, 1, bidisperse(alpha), 3)
        write_packing(tmp_path / f"{alpha}.h5", start, made_up(alpha, z=9.5, phi_J=0.6))
    out = ("--out", tmp_path / "a.png")
    rows = report(PHI_J, sweep, tmp_path, *out)["phi_J"]
    found = {(row["dimension"], row["alpha"]): row for row in rows}
    assert len(found) == 8
    assert (found[2, 1.0]["paper"], found[3, 1.0]["paper"]) == (0.8875, None)
    image(tmp_path / "a.png")
    fits = report(NUMBER, sweep, tmp_path, *out)["fits"]
    assert [(row["dimension"], row["z"]["fit"] is None) for row in fits] == [(2, False), (3, True)]
    image(tmp_path / "a.png")
    shown = report(SNAPSHOTS, sweep, tmp_path, "--alpha", 1, "--dpi", 90, *out)["snapshots"]
    assert [row["dimension"] for row in shown] == [2, 3]
    image(tmp_path / "a.png")
    said = problem(CLASSES, sweep, tmp_path, *out)
    assert "expected systems that differ in alpha only" in said


def test_distance_from_jamming_is_that_of_the_root_of_the_energy(report, tmp_path):
    # u = k (phi - phi_J)^2 / phi has the pressure phi du/dphi - u.
    k, apart = 0.1, {1: 1e-7, 2: 3e-7}
    for seed, distance in apart.items():
        phi = 0.86 + distance
        u = k * distance**2 / phi
        pressure = 2 * k * distance - 2 * u
        told = made_up(4, seed, phi=phi, u=u, pressure=pressure)
        write_packing(tmp_path / f"{seed}.h5", squeezed(4, seed), told)
    [row] = report(PHI_J, tmp_path, "--out", tmp_path / "a.png")["phi_J"]
    assert row["distance"]["value"] == pytest.approx(2e-7, rel=1e-5)
    assert row["distance"]["error"] == pytest.approx(1e-7, rel=1e-5)
