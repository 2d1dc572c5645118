"""Averages of series that remember: their errors, and where a steady state begins."""

import numpy as np
import pytest

from jamshape.measures.steady import block_average, steady_state

N_SAMPLES = 20_000


def remembering(memory, rng, n=N_SAMPLES):
    """A series whose autocorrelation is exp(-k / memory), of variance 1."""
    keep = np.exp(-1 / memory) if memory else 0.0
    noise = rng.normal(size=n) * np.sqrt(1 - keep**2)
    values = np.empty(n)
    values[0] = rng.normal()
    for k in range(1, n):
        values[k] = keep * values[k - 1] + noise[k]
    return values


@pytest.mark.parametrize("memory", [0, 3, 30])
def test_errors_are_those_of_series_with_this_memory(memory):
    """The means of many series scatter by their error estimates, and the estimate of an exact inefficiency is right."""
    rng = np.random.default_rng(7)
    found = [block_average(remembering(memory, rng, 4000)) for _ in range(60)]
    scatter = np.std([one.mean for one in found], ddof=1)
    exact = (1 + np.exp(-1 / memory)) / (1 - np.exp(-1 / memory)) if memory else 1.0
    assert np.median([one.error for one in found]) == pytest.approx(scatter, rel=0.35)
    assert np.median([one.inefficiency for one in found]) == pytest.approx(exact, rel=0.35)


def test_what_does_not_change_has_no_error():
    assert block_average(np.full(100, 3.0)) == (3.0, 0.0, 1.0)


def test_a_series_whose_first_values_alone_differ_has_an_error():
    """Blocks of an odd number leave out the first ones, and are all equal from then on."""
    values = np.zeros(750)
    values[3:11] = 3.4
    found = block_average(values)
    assert found.error > np.std(values) / np.sqrt(750)
    assert found.inefficiency > 1


def test_few_values_have_an_error_that_nobody_knows():
    found = block_average(np.arange(5.0))
    assert found.mean == 2
    assert np.isnan(found.error)


def sheared(startup, rng, n=4000):
    """Observables of a run whose stress decays from a start, and whose director is at 0.3."""
    strain = np.linspace(0, 20, n)
    decay = np.exp(-strain / startup) if startup else np.zeros(n)
    noise = [0.05 * remembering(5, rng, n) for _ in range(3)]
    x, y = 0.4 * np.cos(0.6) + noise[1], 0.4 * np.sin(0.6) + noise[2]
    observables = {
        "pressure": 1.0 + 3 * decay + noise[0], "p_xy": -0.3 - decay + 0.3 * noise[0],
        "normal_difference": np.full(n, 0.8), "z": np.full(n, 4.0),
        "S_2": np.hypot(x, y), "director": 0.5 * np.arctan2(y, x), "turned": -0.25 * strain,
    }  # fmt: skip
    return observables, strain


def test_the_start_up_is_left_out():
    rng = np.random.default_rng(3)
    with_start, without = (steady_state(*sheared(startup, rng)) for startup in (0.5, 0.0))
    assert 1 < with_start.startup < 10
    assert without.startup < with_start.startup
    for found in (with_start, without):
        for name, exact in {"pressure": 1.0, "shear_stress": 0.3, "sigma": 0.5, "mu": 0.5,
                            "S_2": 0.4, "rotation": 0.25, "z": 4.0}.items():  # fmt: skip
            one = found[name]
            assert abs(one.value - exact) < 5 * one.error + 1e-12, name
        assert found.director == pytest.approx(0.3, abs=0.02)


def test_an_average_from_a_strain_on_begins_there():
    found = steady_state(*sheared(0.5, np.random.default_rng(3)), after=15.0)
    assert found.startup == pytest.approx(15, abs=0.01)
    assert found["pressure"].independent < 1000


def test_a_strain_that_leaves_too_little_is_refused():
    with pytest.raises(ValueError, match="expected 8 or more; shear further"):
        steady_state(*sheared(0.5, np.random.default_rng(3)), after=20.0)


def test_mu_is_the_ratio_of_means_with_the_error_of_what_is_left():
    """Stress and pressure that rise and fall together have a ratio that is known far better than either."""
    observables, strain = sheared(0.0, np.random.default_rng(5))
    pressure = observables["pressure"]
    observables |= {"p_xy": -0.4 * pressure, "normal_difference": 0.6 * pressure}
    found = steady_state(observables, strain)
    assert found["mu"].value == pytest.approx(0.5, rel=1e-12)
    assert found["mu"].error < 1e-6 * found["sigma"].error


def test_steps_that_differ_count_by_their_strain():
    """A signal with means that are known, sampled densely where it is high."""
    observables, _ = sheared(0.0, np.random.default_rng(5))
    strain = np.sort(np.concatenate([np.linspace(0, 10, 3000), np.linspace(10, 20, 1000)[1:]]))
    values = np.where(strain <= 10, 1.0, 3.0)
    observables = {name: of[: len(strain)] for name, of in observables.items()}
    observables |= {"pressure": values, "turned": -0.25 * strain}
    found = steady_state(observables, strain, after=0.0)
    assert found["pressure"].value == pytest.approx(2, rel=1e-3)
    assert found["rotation"].value == pytest.approx(0.25, rel=1e-9)
