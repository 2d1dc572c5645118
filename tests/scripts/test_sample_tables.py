"""Tables of the packings, modes and runs of a reproduced paper."""

import csv

import pytest

import jamshape as js
from jamshape.files.h5md import read_attributes
from jamshape.files.run_writer import RunWriter

SCRIPT = "sample_tables.py"


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
    for others in ("search", "path", "run"):
        (packing.parent / f"alpha4_seed2.h5.{others}.h5").write_bytes(b"half of a packing")
    (root / "runs").mkdir()
    for name, finished in (("slow1", True), ("slow2", False)):
        rates = [[0.8, 1e-6], [0.85, 1e-8]]  # from these packing fractions on
        known = {"alpha": 4.0, "kappa": rates, "phi_jams": 0.86, "finished": finished}
        RunWriter.create(root / "runs" / f"{name}.h5", js.load(packing), known).close()
    return root


def test_each_file_is_a_line(folder, report):
    out = folder / "samples"
    said = report(SCRIPT, folder, "--out", out)
    assert (said["packings"], said["modes"], said["runs"]) == (1, 1, 1)
    [packing] = table(out / "packings.csv")
    told = read_attributes(folder / packing["file"])
    for name in ("alpha", "n", "seed", "u0", "phi_J", "z", "n_rattlers", "residual_force"):
        assert float(packing[name]) == pytest.approx(float(told[name]), rel=1e-9)
    assert packing["outcome"] == told["outcome"]
    assert "w1" not in packing  # no file has one


def test_runs_that_were_not_finished_are_left_out(folder, report):
    report(SCRIPT, folder, "--out", folder / "samples")
    [run] = table(folder / "samples" / "runs.csv")
    assert (run["file"], run["kappa"], run["phi_jams"]) == ("runs/slow1.h5", "1e-08", "0.86")


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
