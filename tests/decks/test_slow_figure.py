import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "analysis"))

from fig_slow_compression import Cost, Ensemble, Run, draw, row, table

from jamshape.measures.onset import fit_onset

ONSETS = {1: 0.85, 2: 0.852, 3: 0.86}
SHIFTS = {1: 0.001, 2: 0.002, 3: 0.003}


def run(seed, kappa, onset, slope=0.3):
    """A pressure that is linear above an onset."""
    phi = np.linspace(0.84, 0.88, 401)
    p = slope * np.maximum(phi - onset, 0) + 1e-9
    fit = fit_onset(phi, p)
    return Run(Path(f"{seed}.h5"), 4.0, 64, seed, kappa, phi, p, fit, Cost(100.0 * seed, 5.0, 1.0))


@pytest.fixture(scope="module")
def ensembles():
    slow = [run(seed, 1e-10, onset) for seed, onset in ONSETS.items()]
    fast = [run(seed, 1e-8, onset - SHIFTS[seed], 0.33) for seed, onset in ONSETS.items()]
    return Ensemble.all_of([slow[0], *fast, *slow[1:]])


def test_rates_are_compared_sample_by_sample(ensembles):
    assert [of.kappa for of in ensembles] == [1e-8, 1e-10]
    fast, slow = (row(of, ensembles) for of in ensembles)
    onsets = np.array(list(ONSETS.values()))
    assert slow["phi_J"].value == pytest.approx(onsets.mean(), abs=2e-4)
    assert slow["phi_J"].error == pytest.approx(onsets.std(ddof=1) / np.sqrt(3), rel=0.05)
    # Samples differ by more than the rates do, and that does not enter.
    assert fast["shift"].value == pytest.approx(-0.002, abs=1e-4)
    assert fast["shift"].error == pytest.approx(0.001 / np.sqrt(3), rel=0.1)
    assert fast["excess"].value > 0.1
    assert slow["shift"] is slow["excess"] is None
    assert fast["evaluations"] == 200


def test_one_sample_has_the_error_of_its_fit():
    (only,) = Ensemble.all_of([run(1, 1e-9, 0.85)])
    found = row(only, [only])
    assert found["phi_J"].samples == 1
    assert found["phi_J"].value == pytest.approx(0.85, abs=2e-4)
    assert found["phi_J"].error == only.runs[0].fit.phi_J_error


def test_table_and_picture(ensembles, tmp_path):
    rows = [row(of, ensembles) for of in ensembles]
    lines = table(rows).splitlines()
    assert len(lines) == 4
    assert {line.count("|") for line in lines} == {11}
    packing = {"alpha": 4.0, "n": 64, "phi_J": 0.855}
    draw(ensembles, [packing], tmp_path / "slow.png")
    assert (tmp_path / "slow.png").stat().st_size > 10000
