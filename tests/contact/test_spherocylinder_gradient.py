"""Force and torques are the derivatives of the energy, in every class of contact."""

from __future__ import annotations

import numpy as np
import pytest
from differences import (
    central_differences,
    one_sided_differences,
    outside,
    rounding_of_differences,
)
from reference_energy import (
    ENERGIES,
    Approach,
    complex_step_gradient,
    fade_length,
)
from spherocylinder_pairs import (
    EPS,
    EVERY_CLASS,
    SHALLOW,
    SIDE_TO_SIDE,
    contacts,
    force_scale,
    overlaps,
    parallel,
    relative_errors,
    touching,
)
from thinned import in_turn

K_E = 1.7
N = 10_000


@pytest.mark.parametrize("n", [2000, pytest.param(N, marks=pytest.mark.validate)])
@pytest.mark.parametrize(("dimension", "sides", "kind"), EVERY_CLASS)
def test_force_and_torques_are_central_differences_of_the_energy(
    dimension, sides, kind, n, measured
):
    pairs = touching(dimension, sides, kind)
    # Where the second bond of a nearly round rod fades over a length that the doubles of its pair
    # resolve too coarsely, differences show nothing; the complex step below has no such limit.
    resolved = rounding_of_differences(pairs, sides) < 3e-7
    pairs = pairs[resolved][:n]
    assert len(pairs) == n
    result = contacts(pairs, sides, K_E)
    errors = relative_errors(pairs, result, central_differences(pairs, sides, K_E), K_E)

    kinked = errors > 1e-6
    measured(worst=errors[~kinked].max(), median=np.median(errors), kinked=kinked.sum(),
             resolved=resolved.mean())  # fmt: skip
    if kind == SIDE_TO_SIDE and sides == 2:
        # The far end of a rod may change within the steps.
        assert kinked.mean() < 0.01
        beyond, jump = one_sided_comparison(pairs[kinked], sides)
        assert np.all(beyond < 1e-6)
        assert np.all(jump > 1e-6)
    else:
        assert not kinked.any()


def one_sided_comparison(pairs, sides):
    """Distance of the answer from the one-sided derivatives, and the distance between these."""
    result = contacts(pairs, sides, K_E)
    left, right = one_sided_differences(pairs, sides, K_E)
    answer = -result["force"], -result["torque_i"], -result["torque_j"]
    force = force_scale(pairs, result, K_E)[:, None]
    levers = 1.0, (pairs.A_i + pairs.R_i)[:, None], (pairs.A_j + pairs.R_j)[:, None]
    beyond, jump = np.zeros(len(pairs)), np.zeros(len(pairs))
    for x, a, b, lever in zip(answer, left, right, levers, strict=True):
        beyond = np.maximum(beyond, (outside(x, a, b) / (force * lever)).max(axis=1))
        jump = np.maximum(jump, (np.abs(a - b) / (force * lever)).max(axis=1))
    return beyond, jump


@pytest.mark.parametrize(("contact", "power"), in_turn(EVERY_CLASS, [2.0, 2.5, 3.0]))
def test_force_and_torques_are_derivatives_of_the_energy_written_a_second_time(
    contact, power, measured
):
    dimension, sides, kind = contact
    pairs = touching(dimension, sides, kind)[:N]
    assert len(pairs) == N
    result = contacts(pairs, sides, K_E, power)
    energy = ENERGIES[sides](pairs, power)
    rounding = energy_rounding(pairs, sides, energy, power)
    energy_errors = np.abs(result["energy"] / K_E - energy) / rounding
    gradient = complex_step_gradient(pairs, lambda stepped: K_E * ENERGIES[sides](stepped, power))
    errors = relative_errors(pairs, result, gradient, K_E, power)
    measured(worst=errors.max(), median=np.median(errors), pairs=len(pairs),
             energy_in_roundings=energy_errors.max())  # fmt: skip
    assert energy_errors.max() < 4.0
    assert errors.max() < 1e-8
    assert np.median(errors) < 1e-14


def energy_rounding(pairs, sides, energy, power=2.0):
    """Uncertainty of the energy at k_e = 1 due to rounding of coordinates."""
    rounding = EPS * pairs.extent
    result = (power * energy) ** (1.0 - 1.0 / power) * rounding / pairs.d
    if sides == 2:
        fading = Approach(pairs).by_steps < 1.0
        result[fading] += (4.0 * energy * rounding / fade_length(pairs))[fading]
    return result


@pytest.mark.parametrize("dimension", [2, 3])
def test_bonds_that_fade_and_bonds_that_become_one_are_among_the_pairs(dimension):
    x = Approach(touching(dimension, 2, SIDE_TO_SIDE))
    w, parts = x.exponent, x.shares[:, 1]

    def is_between(number):
        return x.has_two & (number > 0.01) & (number < 0.99)

    shallow, deep = x.depth < SHALLOW, x.depth > 1.0
    for least, among in (
        (500, is_between(x.by_steps) & shallow),
        (1000, is_between(x.by_steps) & deep),
        (1000 * (dimension - 2), is_between(x.steps[1]) | (dimension == 2)),
        (1000, is_between(w) & (x.by_steps > 1.0)),
        (1000, is_between(parts)),
        (1000, x.has_two & (w == 1.0)),
    ):
        assert np.sum(among) > least


@pytest.mark.parametrize("dimension", [2, 3])
def test_parallel_rods_with_one_bond_sit_in_the_middle_of_their_kink(dimension, measured):
    """The torques lie between the one-sided derivatives, at their mean; the force has no kink."""
    rng = np.random.default_rng([2, dimension])
    pairs, half_overlap = parallel(rng, N, dimension, overlaps(rng, N))
    result = contacts(pairs, 1, K_E)
    assert np.all(result["kind"] == SIDE_TO_SIDE)
    left, right = one_sided_differences(pairs, 1, K_E)
    mean = [0.5 * (a + b) for a, b in zip(left, right, strict=True)]
    errors = relative_errors(pairs, result, mean, K_E)
    beyond, _ = one_sided_comparison(pairs, 1)

    # The kink is there: the torque jumps by the force times the overlap of the spines.
    long = half_overlap > 0.1 * pairs.d
    jump = np.abs(right[1] - left[1]).max(axis=1) / force_scale(pairs, result, K_E)
    measured(worst=errors.max(), median=np.median(errors), outside=beyond.max(), long=long.sum())
    assert errors.max() < 1e-6
    assert beyond.max() < 1e-6
    assert long.sum() > 500
    if dimension == 2:
        np.testing.assert_allclose(jump[long], 2.0 * half_overlap[long], rtol=1e-4)
