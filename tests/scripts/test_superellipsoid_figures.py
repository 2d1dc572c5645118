"""The figures of superellipsoids, as their users run them, on a small sweep made here."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jamshape.files.h5md import read_attributes, read_packing, write_packing
from jamshape.minima.target import Target
from jamshape.packing import Box, Packing
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.protocols.superellipsoid_jammed import Sample, make

ANALYSIS = Path(__file__).parents[2] / "analysis"
OF_SWEEPS = (
    *("phi_j_shapes", "global_order", "asphericity", "shape_map", "order_density"),
    *("shape_plane", "local_order", "curvature", "eigenvalues", "quartic_modes", "quartic_energy"),
)
SCRIPTS = (*(f"fig_{name}.py" for name in OF_SWEEPS), "draw_superellipsoids.py")
N = 20
SHAPES = [(1.0, 1.0, 1.0), (1.0, 0.6, 1.0), (1.0, 1.0, 2.0), (1.0, 0.8, 1.25), (1.5, 1.0, 1.0)]


@pytest.fixture
def report(here, capsys, tmp_path):
    """Run a script and read its last line; look at whether anything is drawn."""

    def reported(script, *arguments):
        out = tmp_path / "out.png"
        assert here(script, *arguments, "--out", out) == 0
        last = json.loads(capsys.readouterr().out.splitlines()[-1], parse_constant=pytest.fail)
        assert last["out"] == str(out)
        look_at(out)
        return last

    return reported


@pytest.fixture
def problem(here, tmp_path):
    """Run a script that must end with one sentence."""

    def sentence(script, *arguments):
        said = here(script, *arguments, "--out", tmp_path / "none.png")
        assert isinstance(said, str)
        assert "\n" not in said
        assert said.startswith(f"{script}: ")
        assert not (tmp_path / "none.png").exists()
        return said

    return sentence


def look_at(path):
    from matplotlib.image import imread  # noqa: PLC0415 - the other helpers need none

    pixels = imread(path)
    assert min(pixels.shape[:2]) > 350
    assert max(pixels.shape[:2]) < 3000
    assert pixels[..., :3].std() > 0.02


def made(path, **changes):
    sample = Sample(n=N, phi_start=0.4, quasistatic=Quasistatic(step=0.01), target=Target(1e-12))
    for _ in make(replace(sample, **changes), path):
        pass
    return path


@pytest.fixture(scope="session")
def sweep(tmp_path_factory):
    """Five shapes, one with two samples; what is no packing is left out."""
    folder = tmp_path_factory.mktemp("sweep3d")
    for p, w1, w2 in SHAPES:
        made(folder / f"p{p:g}_w{w1:g}_{w2:g}_seed1.h5", p=p, w1=w1, w2=w2)
    made(folder / "p1_w0.6_1_seed2.h5", w1=0.6, seed=2)
    (folder / "p1_w1_3_seed1.h5.path.h5").write_text("still written\n")
    return folder


@pytest.fixture(scope="session")
def thermal(tmp_path_factory):
    """One packing of protocol 2."""
    folder = tmp_path_factory.mktemp("sweep3d_thermal")
    made(folder / "a.h5", p=1.5, protocol=2, n_sweeps=50, phi_thermal=0.45)
    return folder


@pytest.fixture(scope="session")
def modes(tmp_path_factory):
    return tmp_path_factory.mktemp("modes3d")


def rows_by_shape(rows):
    return {(row["p"], row["w1"], row["w2"], row["protocol"]): row for row in rows}


@pytest.mark.parametrize("script", SCRIPTS)
def test_help(here, capsys, script):
    assert here(script, "--help") == 0
    said = capsys.readouterr().out
    assert "Yuan, VanderWerf, Shattuck & O'Hern" in said
    assert "--out" in said


@pytest.mark.parametrize("script", [f"fig_{name}.py" for name in OF_SWEEPS])
def test_bad_input_is_one_sentence(problem, tmp_path, script):
    assert "No such file" in problem(script, tmp_path / "none")
    (tmp_path / "empty").mkdir()
    assert "empty: no finished packing" in problem(script, tmp_path / "empty")
    rods = tmp_path / "rods.h5"
    packing = Packing(
        position=np.array([[1.0, 1.0]]),
        orientation=np.zeros(1),
        diameters=np.ones((1, 3)),
        species=np.ones(1, int),
        id=np.ones(1, int),
        box=Box(np.zeros(2), np.full(2, 3.0)),
    )
    known = {"outcome": "converged", "alpha": 0.0, "n": 1, "seed": 1}
    write_packing(rods, packing, known)
    assert "has no number 'p'" in problem(script, rods)
    sizes = [tmp_path / f"{n}.h5" for n in (1, 2)]
    for n, path in zip((1, 2), sizes, strict=True):
        write_packing(path, packing, known | {"n": n, "p": 1.0, "w1": 1.0, "w2": 1.0})
    assert "n is 1 and 2, expected one ensemble" in problem(script, *sizes)


def test_phi_j_of_spheroids_and_superballs(report, problem, sweep):
    rows = rows_by_shape(report("fig_phi_j_shapes.py", sweep)["phi_J"])
    assert (1.0, 0.8, 1.25, 1) not in rows
    stored = [read_attributes(sweep / f"p1_w0.6_1_seed{seed}.h5")["phi_J"] for seed in (1, 2)]
    phi = rows[1.0, 0.6, 1.0, 1]["phi_J"]
    assert phi["value"] == pytest.approx(np.mean(stored))
    assert phi["error"] == pytest.approx(abs(stored[0] - stored[1]) / 2)
    assert rows[1.0, 1.0, 1.0, 1]["phi_J"] == {
        "value": pytest.approx(0.66, abs=0.08),
        "error": None,
        "samples": 1,
    }
    said = problem("fig_phi_j_shapes.py", sweep / "p1_w0.8_1.25_seed1.h5")
    assert "expected one" in said


def test_global_order(report, sweep, thermal):
    found = report("fig_global_order.py", sweep, thermal)
    assert found["one_over_sqrt_n"] == pytest.approx(1 / np.sqrt(N))
    assert found["random"]["S2"] == pytest.approx(0.19, abs=0.04)
    assert len(found["order"]) == 6
    assert {row["protocol"] for row in found["order"]} == {1, 2}


@pytest.mark.parametrize("quantity", ["phi_J", "z"])
def test_asphericity(report, sweep, quantity):
    rows = rows_by_shape(report("fig_asphericity.py", sweep, "--quantity", quantity)["shapes"])
    assert rows[1.0, 1.0, 1.0, 1]["asphericity"]["value"] == pytest.approx(0, abs=1e-12)
    assert rows[1.0, 1.0, 2.0, 1]["z_iso"]["value"] == 10
    assert rows[1.5, 1.0, 1.0, 1]["z_iso"]["value"] == 12
    assert rows[1.0, 0.6, 1.0, 1][quantity]["samples"] == 2


def test_shape_map_and_plane(report, problem, sweep, thermal):
    found = report("fig_shape_map.py", sweep)
    assert (found["contours"], len(found["shapes"])) == (False, 5)
    assert "no packing is of protocol 2" in problem("fig_shape_map.py", sweep, "--protocol", 2)
    assert len(report("fig_shape_map.py", sweep, thermal, "--protocol", 2)["shapes"]) == 1
    rows = rows_by_shape(report("fig_shape_plane.py", sweep)["shapes"])
    assert rows[1.0, 0.8, 1.25, 1]["beta"]["value"] == pytest.approx(1)


def test_order_and_density_of_both_protocols(report, sweep, thermal):
    found = report("fig_order_density.py", sweep, thermal)
    assert {(row["p"], row["protocol"]) for row in found["shapes"]} == {(1.5, 1), (1.5, 2)}
    (gain,) = found["gains"]
    of = [
        read_attributes(path)["phi_J"] for path in (sweep / "p1.5_w1_1_seed1.h5", thermal / "a.h5")
    ]
    assert gain["phi_J"] == pytest.approx(of[1] - of[0])
    alone = report("fig_order_density.py", sweep)
    assert (len(alone["shapes"]), alone["gains"]) == (5, [])


def test_local_order_and_curvature(report, sweep):
    rows = rows_by_shape(report("fig_local_order.py", sweep)["order"])
    assert 0 < rows[1.5, 1.0, 1.0, 1]["local_C4"]["value"] < 1
    assert rows[1.0, 1.0, 1.0, 1]["random_S2"]["value"] > 0.2
    found = report("fig_curvature.py", sweep)
    assert found["with_z"]["shapes"] == 4
    rows = rows_by_shape(found["curvature"])
    assert rows[1.0, 1.0, 1.0, 1]["quantiles"]["0.5"] == pytest.approx(1)
    assert rows[1.5, 1.0, 1.0, 1]["quantiles"]["0.05"] < 0.5
    network = 2 * read_attributes(sweep / "p1.5_w1_1_seed1.h5")["n_contacts"]
    assert rows[1.5, 1.0, 1.0, 1]["sides"] >= network


def test_eigenvalues(report, problem, sweep, modes):
    asked = ("--modes", modes)
    rows = rows_by_shape(report("fig_eigenvalues.py", sweep, *asked)["spectra"])
    assert rows[1.0, 1.0, 1.0, 1]["regimes"][:2] == [0, 0], "spheres do not turn"
    quartic, turning, moving = rows[1.5, 1.0, 1.0, 1]["regimes"]
    assert min(quartic, turning, moving) > 0
    kept = sorted(modes.glob("*.modes.h5"))
    assert len(kept) == 5
    before = kept[0].stat().st_mtime_ns
    shape = ("--shape", 1.5, 1, 1)
    assert len(report("fig_eigenvalues.py", sweep, *asked, *shape)["spectra"]) == 1
    assert kept[0].stat().st_mtime_ns == before, "not found again"
    assert "expected a shape of the sweep" in problem(
        "fig_eigenvalues.py", sweep, "--shape", 3, 1, 1
    )


def test_contacts_and_quartic_modes_are_on_the_unit_line(report, sweep, modes):
    found = report("fig_quartic_modes.py", sweep, "--modes", modes)
    spheres = [row for row in found["counts"] if (row["p"], row["w1"], row["w2"]) == (1, 1, 1)]
    assert (found["packings"], len(spheres)) == (6, 1)
    # So few spheres crystallise, with contacts to spare.
    for row in found["counts"]:
        assert row["on_line"] or row in spheres
        assert row["n_quartic"] == row["n_quartic_by_rank"]
        assert row["n_contacts"] == read_attributes(row["packing"])["n_contacts"]


def test_modes_below_the_gap_are_quartic_and_others_are_not(report, sweep, modes):
    one = sweep / "p1.5_w1_1_seed1.h5"
    (row,) = report("fig_quartic_modes.py", one, "--modes", modes, "--follow", 2)["counts"]
    assert (row["followed_below"], row["quartic_below"]) == (2, 2)
    assert (row["followed_above"], row["quartic_above"]) == (2, 0)


def test_crossovers_fall_as_the_root_of_the_pressure(here, report, capsys, sweep, tmp_path):
    one, ladder = sweep / "p1.5_w1_1_seed1.h5", tmp_path / "ladder"
    assert here("energy_ladder.py", one, "--u0", 1e-14, "--out", ladder) == 0
    capsys.readouterr()
    (rung,) = ladder.glob("*.h5")
    assert read_attributes(rung)["z_iso"] == 12
    assert read_packing(rung).phi < read_packing(one).phi
    found = report("fig_quartic_energy.py", one, ladder, "--modes", 2)
    assert len(found["packings"]) == 2
    quartic = [m for row in found["packings"] for m in row["modes"] if m["quartic"]]
    assert len(quartic) == 4
    assert all(mode["crossover"] > 0 for mode in quartic)
    (slope,) = found["delta_of_pressure"]
    assert slope["exponent"] == slope["exponent_of_lowest"] == pytest.approx(0.5, abs=0.05)


def test_pictures(report, problem, sweep, tmp_path):
    paths = [sweep / f"p{p:g}_w{w1:g}_{w2:g}_seed1.h5" for p, w1, w2 in SHAPES[1:3]]
    for color in ("S2", "C4", "orientation"):
        found = report("draw_superellipsoids.py", *paths, "--color", color, "--level", 2)
        assert [row["n"] for row in found["packings"]] == [N, N]
        assert ("mean_local" in found["packings"][0]) == (color != "orientation")
    assert found["packings"][0]["S2"] == pytest.approx(read_attributes(paths[0])["S2"])
    assert "No such file" in problem("draw_superellipsoids.py", tmp_path / "none.h5")
    flat = read_packing(paths[0])
    rods = Packing(
        position=np.zeros((1, 3)),
        orientation=np.array([[1.0, 0, 0, 0]]),
        diameters=np.array([[3.0, 1.0, 1.0]]),
        species=np.ones(1, int),
        id=np.ones(1, int),
        box=flat.box,
    )
    write_packing(tmp_path / "rods.h5", rods)
    said = problem("draw_superellipsoids.py", tmp_path / "rods.h5")
    assert "expected 3D and of superellipsoids" in said


def test_near_bodies_hide_far_ones(monkeypatch):
    """Two spheres behind each other: where they meet on the screen, the nearer one is painted last."""
    monkeypatch.syspath_prepend(ANALYSIS)
    from shading import faces_of, painted, view  # noqa: PLC0415 - not on the path before

    eye = view(20, 30)
    center = np.full(3, 5.0)
    packing = Packing(
        position=np.array([center + 1.01 * eye.eye, center - 1.01 * eye.eye]),
        orientation=np.tile([1.0, 0, 0, 0], (2, 1)),
        diameters=np.full((2, 3), 2.0),
        species=np.ones(2, int),
        id=np.arange(1, 3),
        box=Box(np.zeros(3), np.full(3, 10.0)),
        shape_style="superellipsoid",
        exponent=np.ones(2),
    )
    colors = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    polygons, shades = painted(faces_of(packing, 2, eye), colors, eye)
    middle = np.abs(polygons.mean(axis=1) - eye.flat(center)).max(axis=1) < 0.3
    assert (shades[middle][-1] * [1, 0, -1]).sum() > 0, "red is last"
    far = np.flatnonzero(shades[:, 2] > shades[:, 0])
    assert far.max() < np.flatnonzero(middle & (shades[:, 0] > shades[:, 2])).min()
