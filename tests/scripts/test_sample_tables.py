"""Tables of the packings, modes and runs of a reproduced paper."""

import csv

import numpy as np
import pytest
from written import write_columns

import jamshape as js
from common.ensembles import read_groups
from jamshape.files.h5md import read_attributes

SCRIPT = "sample_tables.py"

PHI_J = 0.857
PHI = np.linspace(0.8, 0.9, 81)
RISING = {"phi": PHI, "pressure": 0.2 * np.maximum(PHI - PHI_J, 0)}


def table(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A packing, its modes and a search that was not finished, as the workflow leaves them."""
    root = tmp_path_factory.mktemp("reproduced")
    for name in ("packings/rods", "modes/modes"):
        (root / name).mkdir(parents=True)
    packing = root / "packings" / "rods" / "alpha4_seed1.h5"
    js.make_packing(
        js.Spherocylinders(alpha=4), n=16, seed=1, u0=1e-12, file=packing, progress=False
    )
    js.modes(packing).save(root / "modes" / "modes" / "alpha4_seed1.modes.h5")
    for others in ("making", "run"):
        (packing.parent / f"alpha4_seed2.h5.{others}.h5").write_bytes(b"half of a packing")
    (root / "runs").mkdir()
    for name, finished in (("slow1", True), ("slow2", False)):
        rates = [[0.8, 1e-6], [0.85, 1e-8]]  # from these packing fractions on
        known = {"alpha": 4.0, "kappa": rates, "finished": finished}
        known |= {
            "phi_unjams": 0.85,
            "phi_jams": 0.86,
            "frames_minimised": 2,
            "frames_undecided": 0,
        }
        write_columns(root / "runs" / f"{name}.h5", js.load(packing), known, RISING)
    return root


def test_each_file_is_a_line(folder, report):
    out = folder / "samples"
    said = report(SCRIPT, folder, "--out", out)
    assert (said["rods"], said["modes"], said["runs"]) == (1, 1, 1)
    [packing] = table(out / "rods.csv")
    told = read_attributes(folder / packing["file"])
    for name in ("alpha", "n", "seed", "u0", "phi_J", "z", "n_rattlers", "residual_force"):
        assert float(packing[name]) == pytest.approx(float(told[name]), rel=1e-9)
    assert packing["outcome"] == told["outcome"]
    assert "w1" not in packing  # no file has one


def test_the_order_of_discs_is_nan_and_their_shape_is_told(report, tmp_path):
    file = tmp_path / "packings" / "discs" / "alpha0_seed1.h5"
    file.parent.mkdir(parents=True)
    js.make_packing(js.Spherocylinders(alpha=0), n=12, u0=1e-6, file=file, progress=False)
    report(SCRIPT, tmp_path, "--out", tmp_path)
    [discs] = table(tmp_path / "discs.csv")
    assert (discs["S2"], discs["aspect_ratio"], discs["asphericity"]) == ("nan", "1", "1")
    [(_, [row])] = read_groups([tmp_path / "discs.csv"], needs=("S2",)).items()
    assert np.isnan(row.number("S2"))


def test_runs_that_were_not_finished_are_left_out(folder, report):
    report(SCRIPT, folder, "--out", folder / "samples")
    [run] = table(folder / "samples" / "runs.csv")
    assert (run["file"], run["kappa"], run["phi_jams"]) == ("runs/slow1.h5", "1e-08", "0.86")
    assert float(run["phi_J(kappa)"]) == pytest.approx(PHI_J, abs=1e-9)
    assert 0 <= float(run["phi_J(kappa)_error"]) < 1e-9


def test_modes_are_counted_by_band_beside_their_packing(folder, report):
    report(SCRIPT, folder, "--out", folder / "samples")
    [modes] = table(folder / "samples" / "modes.csv")
    whole = sum(int(modes[band]) for band in ("low", "middle", "high"))
    assert whole == int(modes["n_modes"]) - 2  # but for translations
    assert (float(modes["alpha"]), int(modes["seed"])) == (4.0, 1)
    assert int(modes["n"]) == 16


def test_what_is_no_folder_of_a_reproduction_is_refused(tmp_path, problem):
    said = problem(SCRIPT, tmp_path, "--out", tmp_path / "samples")
    assert "has no folder packings, expected one that jamshape reproduce made" in said


def test_groups_of_a_table_are_those_of_its_files(folder, report):
    report(SCRIPT, folder, "--out", folder / "samples")
    [(of_table, [row])] = read_groups([folder / "samples" / "rods.csv"]).items()
    [(of_file, [file])] = read_groups([folder / "packings" / "rods"]).items()
    assert of_table == of_file
    for name in ("alpha", "n", "seed", "phi_J", "z"):
        assert row.number(name) == pytest.approx(file.number(name), rel=1e-9)
    assert row.path.name == file.path.name


def test_a_figure_of_a_table_has_the_numbers_of_the_packings(folder, report, tmp_path):
    report(SCRIPT, folder, "--out", folder / "samples")
    places = {"table": folder / "samples" / "rods.csv", "files": folder / "packings" / "rods"}
    said = {
        name: report("marschall_2018/fig05_phi_j.py", place, "--out", tmp_path / f"{name}.png")
        for name, place in places.items()
    }
    [of_table], [of_files] = (said[name]["phi_J"] for name in places)
    assert of_table["phi_J"]["value"] == pytest.approx(of_files["phi_J"]["value"], rel=1e-9)
    assert of_table["alpha"] == of_files["alpha"]


def test_particles_of_a_table_are_in_its_files_only(folder, report, problem, tmp_path):
    report(SCRIPT, folder, "--out", tmp_path / "elsewhere")
    table_alone = tmp_path / "elsewhere" / "rods.csv"
    said = problem(
        "marschall_2018/fig09_contact_classes.py", table_alone, "--out", tmp_path / "a.png"
    )
    assert "alpha4_seed1.h5" in said


@pytest.mark.parametrize("column", ["file", "shape", "dimension", "outcome"])
def test_a_table_that_lacks_a_column_is_refused(folder, report, problem, tmp_path, column):
    report(SCRIPT, folder, "--out", folder / "samples")
    lines = table(folder / "samples" / "rods.csv")
    with (tmp_path / "short.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, [n for n in lines[0] if n != column], extrasaction="ignore")
        writer.writeheader()
        writer.writerows(lines)
    said = problem(
        "marschall_2018/fig05_phi_j.py", tmp_path / "short.csv", "--out", tmp_path / "a.png"
    )
    assert f"line 2: has no {column}, expected a table of sample_tables.py" in said


def test_lines_of_earlier_tables_are_kept_but_for_files_that_are_here(folder, report, tmp_path):
    report(SCRIPT, folder, "--out", tmp_path / "earlier")
    [line] = table(tmp_path / "earlier" / "rods.csv")
    others = [line | {"z": "0"}, line | {"file": "packings/rods/alpha4_seed9.h5", "seed": "9"}]
    with (tmp_path / "earlier" / "rods.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, line)
        writer.writeheader()
        writer.writerows(others)
    report(SCRIPT, folder, "--known", tmp_path / "earlier", "--out", tmp_path / "both")
    assert table(tmp_path / "both" / "rods.csv") == [line, others[1]]
    assert len(table(tmp_path / "both" / "modes.csv")) == 1
