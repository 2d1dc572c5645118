"""pyscripts/sweep.smk on this machine; tests/cluster runs it on Slurm."""

import json
from importlib.util import find_spec
from pathlib import Path

import pytest
from snakemake_runs import run_snakemake

pytestmark = [
    pytest.mark.lammps,
    pytest.mark.skipif(not find_spec("snakemake"), reason="no snakemake"),
]

WORKFLOW = Path(__file__).parents[2] / "pyscripts" / "sweep.smk"
SMALL = "--n 16 --phi-start 0.3 --u0 1e-6"
NAMES = ["dimer_alpha1_seed1.h5", "mixture_seed1.h5", "p1_w0.6_1_seed1.h5"]
RODS = f"--alpha 1 --samples 3 {SMALL}"


def run(folder, options, *more, settings=("chunk=2",)):
    """Run the workflow in a folder; the packings go to a folder in it."""
    config = [f"sweep={options}", "out=of rods", *settings]
    words = ["--cores", "2", "--keep-going", "--rerun-incomplete", *more, "--config", *config]
    return run_snakemake(WORKFLOW, folder, *words)


def packings(folder):
    """Find packings, with when they were made."""
    return {path.name: path.stat().st_mtime_ns for path in (folder / "of rods").glob("*.h5")}


def reports(folder):
    paths = (folder / "of rods" / "reports").glob("*")
    return {path.name: json.loads(path.read_text()) for path in paths}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("my sweeps")
    return folder, run(folder, RODS)


def test_chunks_of_samples_are_made_and_reported(made):
    folder, done = made
    assert done.returncode == 0, done.stdout
    assert packings(folder).keys() == {f"alpha1_seed{seed}.h5" for seed in (1, 2, 3)}
    told = {name: report["made"] for name, report in reports(folder).items()}
    assert told == {"alpha1_seeds1to2.json": 2, "alpha1_seeds3to3.json": 1}


def test_what_is_there_is_not_made_again_whatever_snakemake_thinks(made):
    folder, _ = made
    before = packings(folder)
    assert "Nothing to be done" in run(folder, RODS).stdout
    # Snakemake removes what jobs declare, and runs all of them.
    done = run(folder, RODS, "--forceall")
    assert done.returncode == 0, done.stdout
    assert packings(folder) == before


def test_a_packing_that_was_removed_is_made_again_alone(made):
    folder, _ = made
    before = packings(folder)
    (folder / "of rods" / "alpha1_seed2.h5").unlink()
    assert run(folder, RODS).returncode == 0
    after = packings(folder)
    assert {name for name in before if after[name] != before[name]} == {"alpha1_seed2.h5"}


def test_other_options_are_refused_and_leave_what_is_there(made):
    folder, _ = made
    before = packings(folder)
    done = run(folder, RODS + " --size-ratio 1.5")
    assert done.returncode == 1
    assert "size_ratio = 1.4, expected 1.5" in done.stdout
    assert packings(folder) == before
    assert "Traceback" not in done.stdout


def test_every_shape_and_mixtures_are_made(tmp_path):
    shapes = "--superellipsoid 1 0.6 1 --dimer 1 --dimension 2 --kind alpha=0 --kind alpha=1"
    done = run(tmp_path, f"{shapes} --samples 1 {SMALL}")
    assert done.returncode == 0, done.stdout
    names = [path.name for path in (tmp_path / "of rods").glob("*.h5")]
    assert sorted(names) == NAMES


@pytest.mark.parametrize(
    ("options", "setting", "words"),
    [
        ("--alpha 1 --kapa 3", "chunk=2", "sweep.smk: error: unrecognized arguments: --kapa 3"),
        ("--alpha 1", "chunk=0", "sweep.smk: chunk is 0, expected a whole number of at least 1"),
        ("--alpha 1", "minutes=soon", "sweep.smk: minutes is soon, expected a whole number"),
        ("--alpha 1", "samples=6", "sweep.smk: the setting samples is not known, expected out,"),
    ],
)
def test_nonsense_is_refused_before_any_job(tmp_path, options, setting, words):
    done = run(tmp_path, options, settings=[setting])
    assert done.returncode != 0
    assert words in done.stdout
    assert not (tmp_path / "of rods").exists()
