"""The figures of superellipsoids, as their users run them, on a small sweep made here."""

import numpy as np
import pytest
from mixtures import bidisperse, superellipsoids
from pictures import image

from jamshape.files.h5md import read_attributes, read_packing, write_packing
from jamshape.files.vocabulary import ATHERMAL, THERMAL
from jamshape.minima.target import Target
from jamshape.protocols.make import Recipe, Steps, Thermalisation, make
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.protocols.random_start import random_packing

FOLDER = "yuan_2019"
PHI_J, ORDER, ASPHERICITY, MAP, DENSITY, PLANE, LOCAL, CURVATURE, EIGENVALUES, MODES, ENERGY = (
    SCRIPTS
) = [
    f"{FOLDER}/{name}.py"
    for name in (
        *("fig03_phi_j", "fig04_global_order", "fig05_asphericity", "fig07_shape_map"),
        *("fig08_order_density", "fig12_shape_plane", "fig13_local_order", "fig14_curvature"),
        *("fig09a_eigenvalues", "fig09b_quartic_modes", "fig10_quartic_energy"),
    )
]

# What rods have no numbers for.
NEED_AXES = (PHI_J, ORDER, ASPHERICITY, MAP, PLANE, CURVATURE)
N = 20
SHAPES = [(1.0, 1.0, 1.0), (1.0, 0.6, 1.0), (1.0, 1.0, 2.0), (1.0, 0.8, 1.25), (1.5, 1.0, 1.0)]


@pytest.fixture
def drawn(report, tmp_path):
    """Run a script and read its last line; look at whether anything is drawn."""

    def reported(script, *arguments):
        out = tmp_path / "out.png"
        last = report(script, *arguments, "--out", out)
        assert last["out"] == str(out)
        image(out)
        return last

    return reported


@pytest.fixture
def wrong(problem, tmp_path):
    """Run a script that must end with one sentence and draw nothing."""

    def sentence(script, *arguments):
        said = problem(script, *arguments, "--out", tmp_path / "none.png")
        assert not (tmp_path / "none.png").exists()
        return said

    return sentence


def made(path, shape=(1.0, 1.0, 1.0), thermal=None, seed=1):
    recipe = Recipe(
        particles=superellipsoids(*shape),
        n=N,
        dimension=3,
        seed=seed,
        phi_start=0.4,
        way=Steps(Quasistatic(step=0.01), thermal),
        target=Target(1e-12),
    )
    make(recipe, path)
    return path


@pytest.fixture(scope="session")
def sweep(tmp_path_factory):
    """Five shapes, one with two samples; what is no packing is left out."""
    folder = tmp_path_factory.mktemp("sweep3d")
    for p, w1, w2 in SHAPES:
        made(folder / f"p{p:g}_w{w1:g}_{w2:g}_seed1.h5", (p, w1, w2))
    made(folder / "p1_w0.6_1_seed2.h5", (1.0, 0.6, 1.0), seed=2)
    (folder / "p1_w1_3_seed1.h5.path.h5").write_text("still written\n")
    return folder


@pytest.fixture(scope="session")
def thermal(tmp_path_factory):
    """One packing of protocol 2."""
    folder = tmp_path_factory.mktemp("sweep3d_thermal")
    made(folder / "a.h5", (1.5, 1.0, 1.0), Thermalisation(phi=0.45, n_sweeps=50))
    return folder


@pytest.fixture(scope="session")
def modes(tmp_path_factory):
    return tmp_path_factory.mktemp("modes3d")


def rows_by_shape(rows):
    return {(row["exponent"], row["w1"], row["w2"], row["protocol"]): row for row in rows}


@pytest.mark.parametrize("script", SCRIPTS)
def test_help(help_of, script):
    said = help_of(script)
    assert "Yuan, VanderWerf, Shattuck & O'Hern" in said
    assert f"python analysis/{script}" in said
    assert "--out" in said


@pytest.mark.parametrize("script", SCRIPTS)
def test_bad_input_is_one_sentence(wrong, tmp_path, script):
    assert "No such file" in wrong(script, tmp_path / "none")
    (tmp_path / "empty").mkdir()
    assert "empty: no finished packing" in wrong(script, tmp_path / "empty")
    packing = random_packing(2, 0.3, 1, bidisperse(0))
    known = {"outcome": "converged", "alpha": 0.0, "seed": 1}
    known |= dict.fromkeys(("S2", "C4", "z", "phi_J", "asphericity", "beta", "z_iso"), 0.5)
    known |= {"n_rattlers": 0, "pressure": 0.0}
    sizes = [tmp_path / f"{n}.h5" for n in (1, 2)]
    for n, path in zip((1, 2), sizes, strict=True):
        write_packing(path, packing, known | {"n": n, "exponent": 1.0, "w1": 1.0, "w2": 1.0})
    assert "n is 1 and 2, expected one ensemble" in wrong(script, *sizes)


@pytest.mark.parametrize("script", NEED_AXES)
def test_shapes_without_three_axes_are_refused(wrong, tmp_path, script):
    rods = tmp_path / "rods.h5"
    known = {"outcome": "converged", "alpha": 0.0, "n": 2, "seed": 1}
    write_packing(rods, random_packing(2, 0.3, 1, bidisperse(0)), known)
    assert "has no number 'exponent'" in wrong(script, rods)


def test_phi_j_of_spheroids_and_superballs(drawn, wrong, sweep):
    rows = rows_by_shape(drawn(PHI_J, sweep)["phi_J"])
    assert (1.0, 0.8, 1.25, ATHERMAL) not in rows
    stored = [read_attributes(sweep / f"p1_w0.6_1_seed{seed}.h5")["phi_J"] for seed in (1, 2)]
    phi = rows[1.0, 0.6, 1.0, ATHERMAL]["phi_J"]
    assert phi["value"] == pytest.approx(np.mean(stored))
    assert phi["error"] == pytest.approx(abs(stored[0] - stored[1]) / 2)
    assert rows[1.0, 1.0, 1.0, ATHERMAL]["phi_J"] == {
        "value": pytest.approx(0.66, abs=0.08),
        "error": None,
        "samples": 1,
    }
    said = wrong(PHI_J, sweep / "p1_w0.8_1.25_seed1.h5")
    assert "expected one" in said


def test_global_order(drawn, sweep, thermal):
    found = drawn(ORDER, sweep, thermal)
    assert found["one_over_sqrt_n"] == pytest.approx(1 / np.sqrt(N))
    assert found["random"]["S2"] == pytest.approx(0.19, abs=0.04)
    assert len(found["order"]) == 6
    assert {row["protocol"] for row in found["order"]} == {ATHERMAL, THERMAL}


@pytest.mark.parametrize("quantity", ["phi_J", "z"])
def test_asphericity(drawn, sweep, quantity):
    rows = rows_by_shape(drawn(ASPHERICITY, sweep, "--quantity", quantity)["shapes"])
    assert rows[1.0, 1.0, 1.0, ATHERMAL]["asphericity"]["value"] == pytest.approx(0, abs=1e-12)
    assert rows[1.0, 1.0, 2.0, ATHERMAL]["z_iso"]["value"] == 10
    assert rows[1.5, 1.0, 1.0, ATHERMAL]["z_iso"]["value"] == 12
    assert rows[1.0, 0.6, 1.0, ATHERMAL][quantity]["samples"] == 2


def test_shape_map_and_plane(drawn, wrong, sweep, thermal):
    found = drawn(MAP, sweep)
    assert (found["contours"], len(found["shapes"])) == (False, 5)
    assert found["shapes"] == drawn(MAP, sweep, thermal)["shapes"]  # without those of Monte Carlo
    assert "no packing is of the protocol yuan-2019-2" in wrong(MAP, sweep, "--protocol", 2)
    assert "no packing is made without Monte Carlo" in wrong(MAP, thermal)
    assert len(drawn(MAP, sweep, thermal, "--protocol", 2)["shapes"]) == 1
    rows = rows_by_shape(drawn(PLANE, sweep)["shapes"])
    assert rows[1.0, 0.8, 1.25, ATHERMAL]["beta"]["value"] == pytest.approx(1)


def test_order_and_density_of_both_protocols(drawn, sweep, thermal):
    found = drawn(DENSITY, sweep, thermal)
    assert {(row["exponent"], row["protocol"]) for row in found["shapes"]} == {
        (1.5, ATHERMAL),
        (1.5, THERMAL),
    }
    (gain,) = found["gains"]
    of = [
        read_attributes(path)["phi_J"] for path in (sweep / "p1.5_w1_1_seed1.h5", thermal / "a.h5")
    ]
    assert gain["phi_J"] == pytest.approx(of[1] - of[0])
    alone = drawn(DENSITY, sweep)
    assert (len(alone["shapes"]), alone["gains"]) == (5, [])


def test_local_order_and_curvature(drawn, sweep):
    rows = rows_by_shape(drawn(LOCAL, sweep)["order"])
    assert 0 < rows[1.5, 1.0, 1.0, ATHERMAL]["local_C4"]["value"] < 1
    assert rows[1.0, 1.0, 1.0, ATHERMAL]["random_S2"]["value"] > 0.2
    found = drawn(CURVATURE, sweep)
    assert found["with_z"]["shapes"] == 4
    rows = rows_by_shape(found["curvature"])
    assert rows[1.0, 1.0, 1.0, ATHERMAL]["quantiles"]["0.5"] == pytest.approx(1)
    assert rows[1.5, 1.0, 1.0, ATHERMAL]["quantiles"]["0.05"] < 0.5
    network = 2 * read_attributes(sweep / "p1.5_w1_1_seed1.h5")["n_contacts"]
    assert rows[1.5, 1.0, 1.0, ATHERMAL]["sides"] >= network


def test_eigenvalues(drawn, wrong, sweep, modes):
    asked = ("--modes", modes)
    rows = rows_by_shape(drawn(EIGENVALUES, sweep, *asked)["spectra"])
    assert rows[1.0, 1.0, 1.0, ATHERMAL]["regimes"][:2] == [0, 0], "spheres do not turn"
    quartic, turning, moving = rows[1.5, 1.0, 1.0, ATHERMAL]["regimes"]
    assert min(quartic, turning, moving) > 0
    kept = sorted(modes.glob("*.modes.h5"))
    assert len(kept) == 5
    before = kept[0].stat().st_mtime_ns
    shape = ("--shape", 1.5, 1, 1)
    assert len(drawn(EIGENVALUES, sweep, *asked, *shape)["spectra"]) == 1
    assert kept[0].stat().st_mtime_ns == before, "not found again"
    assert "expected a shape of the sweep" in wrong(EIGENVALUES, sweep, "--shape", 3, 1, 1)


def test_contacts_and_quartic_modes_are_on_the_unit_line(drawn, sweep, modes):
    found = drawn(MODES, sweep, "--modes", modes)
    spheres = [
        row for row in found["counts"] if (row["exponent"], row["w1"], row["w2"]) == (1, 1, 1)
    ]
    assert (found["packings"], len(spheres)) == (6, 1)
    # So few spheres crystallise, with contacts to spare.
    for row in found["counts"]:
        assert row["on_line"] or row in spheres
        assert row["n_quartic"] == row["n_quartic_by_rank"]
        assert row["n_contacts"] == read_attributes(row["packing"])["n_contacts"]


def test_modes_below_the_gap_are_quartic_and_others_are_not(drawn, sweep, modes):
    one = sweep / "p1.5_w1_1_seed1.h5"
    (row,) = drawn(MODES, one, "--modes", modes, "--follow", 1)["counts"]
    assert (row["followed_below"], row["quartic_below"]) == (1, 1)
    assert (row["followed_above"], row["quartic_above"]) == (1, 0)


def test_crossovers_fall_as_the_root_of_the_pressure(report, drawn, sweep, tmp_path):
    one, ladder = sweep / "p1.5_w1_1_seed1.h5", tmp_path / "ladder"
    report("energy_ladder.py", one, "--u0", 1e-14, "--out", ladder)
    (rung,) = ladder.glob("*.h5")
    assert read_attributes(rung)["z_iso"] == 12
    assert read_packing(rung).phi < read_packing(one).phi
    found = drawn(ENERGY, one, ladder, "--modes", 1)
    assert len(found["packings"]) == 2
    quartic = [m for row in found["packings"] for m in row["modes"] if m["quartic"]]
    assert len(quartic) == 2
    assert all(mode["crossover"] > 0 for mode in quartic)
    (slope,) = found["delta_of_pressure"]
    assert slope["exponent"] == slope["exponent_of_lowest"] == pytest.approx(0.5, abs=0.05)
