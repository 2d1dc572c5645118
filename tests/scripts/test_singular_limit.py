"""The check of the singular limit, as its users run it, on few discs."""

import numpy as np
import pytest
from jamming import write_jammed
from mixtures import bidisperse

from jamshape.files.h5md import read_attributes, read_packing, write_packing
from jamshape.landscape import Landscape, State
from jamshape.protocols.random_start import random_packing

SCRIPT = "marschall_2018/singular_limit.py"
N, U0 = 16, 1e-14


def write(path, alpha, seed):
    """A packing as make_packing.py writes it, without its compression in LAMMPS."""
    write_jammed(path, bidisperse(alpha), N, 0.8, seed, u0=U0)
    return path


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    for seed in (1, 2):
        write(folder / f"alpha0_seed{seed}.h5", 0, seed)
    write(folder / "alpha0.01_seed1.h5", 0.01, 1)
    return folder


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("out") / "new"


@pytest.fixture(scope="module")
def reports():
    """What the script told when it was run in `made`."""
    return []


@pytest.fixture
def made(report, sweep, out, reports):
    """Packings of rods, made by the first test that asks."""
    if not reports:
        reports.append(report(SCRIPT, sweep, "--out", out))
    return out, *reports


def test_help(help_of):
    said = help_of(SCRIPT)
    for words in ("Marschall & Teitel", "SWEEP", "--alpha", "--seed", "--out", SCRIPT):
        assert words in said


def test_discs_become_jammed_rods_of_the_same_radii(sweep, made):
    out, _ = made
    packings = sorted(out.glob("*.h5"))
    assert [p.name for p in packings] == [f"alpha0.01_from_alpha0_seed{k}.h5" for k in (1, 2)]
    for seed, path in enumerate(packings, 1):
        discs, rods = read_packing(sweep / f"alpha0_seed{seed}.h5"), read_packing(path)
        np.testing.assert_array_equal(rods.radius, discs.radius)
        np.testing.assert_allclose(rods.aspect_ratio, 0.01, rtol=1e-12)
        assert abs(rods.phi - discs.phi) < 0.03
        evaluation = Landscape(rods).evaluate(State.of(rods))
        assert evaluation.energy / rods.box.volume == pytest.approx(U0, rel=1e-7, abs=0)
        stored = read_attributes(path)
        assert stored["outcome"] in {"converged", "sliding"}
        assert (stored["n"], stored["seed"], stored["alpha"]) == (N, seed, 0.01)
        second_harmonic = np.exp(2j * rods.orientation).mean()
        assert abs(second_harmonic) < 3 / np.sqrt(N)  # directions are random


def test_spines_find_the_contacts(made):
    """Nearly all particles touch with their flat sides, 0.63 % of the perimeter."""
    out, found = made
    for name, samples in (("from_discs", 2), ("compressed", 1)):
        row = found[name]
        assert row["samples"] == samples
        assert row["flat_of_backbone"]["value"] > 0.7
        assert row["angles_on_flat"]["value"] > 0.1
        assert row["peak"] > 3
        assert 4 <= row["z"]["value"] < 6
        assert row["overlap_over_limit"]["value"] < 0.1
    assert 0 < found["kolmogorov_distance"] < 0.4
    assert found["paper"]["flat"] == 0.963
    assert found["failed"] == []
    assert found["out"] == str(out / "singular_limit.png")
    assert (out / "singular_limit.png").stat().st_size > 10_000


def test_packings_that_are_there_are_taken(report, sweep, made):
    out, found = made
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in out.glob("*.h5")}
    assert report(SCRIPT, sweep, "--out", out) == found
    after = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in out.glob("*.h5")}
    assert after == before
    one = report(SCRIPT, sweep / "alpha0_seed1.h5", "--out", out)
    assert "compressed" not in one
    assert one["from_discs"]["samples"] == 1


def test_packings_of_other_directions_or_discs_are_not_taken(problem, sweep, made, tmp_path):
    out, _ = made
    before = {path: path.read_bytes() for path in out.iterdir()}
    assert "with spine_seed = 1, expected 2" in problem(SCRIPT, sweep, "--seed", 2, "--out", out)
    other = write(tmp_path / "alpha0_seed1.h5", 0, 5)
    assert "with seed = 1, expected 5" in problem(SCRIPT, other, "--out", out)
    assert {path: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.lammps
def test_discs_are_made_where_none_are_given(report, problem, tmp_path):
    small = ("--n", 12, "--samples", 1, "--kappa", 1e-5, "--u0", 1e-12, "--out", tmp_path)
    found = report(SCRIPT, *small)
    assert found["from_discs"]["samples"] == 1
    discs = read_packing(tmp_path / "discs" / "alpha0_seed1.h5")
    assert not discs.half_length.any()
    assert "with approach_kappa = 1e-05, expected" in problem(SCRIPT, *small, "--kappa", 2e-5)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--alpha", 0), "alpha is 0.0, expected A / R above 0"),
        (("--alpha", "nan"), "alpha is nan, expected a number"),
        (("--seed", -1), "seed is -1, expected a seed from 0"),
        (("--samples", 0), "samples is 0, expected a whole number of samples from 1"),
        (("none",), "No such file"),
    ],
)
def test_user_errors_are_one_sentence(problem, tmp_path, arguments, words):
    assert words in problem(SCRIPT, *arguments, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_rods_that_are_called_discs_are_refused(problem, tmp_path):
    path = tmp_path / "rods.h5"
    known = {"alpha": 0.0, "n": 4, "size_ratio": 1.4, "seed": 1, "u0": U0}
    known |= {"outcome": "converged", "phi": 0.3}
    write_packing(path, random_packing(4, 0.3, 1, bidisperse(1.0)), known)
    assert "half lengths up to 0.7, expected discs" in problem(
        SCRIPT, path, "--out", tmp_path / "out"
    )
