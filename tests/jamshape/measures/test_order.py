import numpy as np
import pytest

from jamshape.measures.order import orientational_order


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_perfect_order_is_one(n):
    turns = 2 * np.pi / n * np.arange(-50, 50)
    order = orientational_order(0.3 + turns, n)
    assert order.S_n == pytest.approx(1, abs=1e-13)
    assert order.theta_n == pytest.approx(0.3, abs=1e-13)


def test_two_crossed_directions_are_tetratic_and_not_nematic():
    angles = 0.2 + np.pi / 2 * (np.arange(100) % 2)
    assert orientational_order(angles, 2).S_n == pytest.approx(0, abs=1e-14)
    assert orientational_order(angles, 4) == pytest.approx((1, 0.2), abs=1e-14)


def test_random_angles_have_the_mean_of_a_random_walk():
    rng = np.random.default_rng(1)
    N, samples = 256, 4000
    for n in (2, 4):
        angles = rng.uniform(-np.pi, np.pi, (samples, N))
        S = np.array([orientational_order(row, n).S_n for row in angles])
        # Rayleigh: mean sqrt(pi)/2, standard deviation sqrt(1 - pi/4), in units of 1/sqrt(N).
        error = np.sqrt((1 - np.pi / 4) / samples)
        assert np.sqrt(N) * S.mean() == pytest.approx(np.sqrt(np.pi) / 2, abs=4 * error)


def test_magnitude_is_the_maximum_over_directions():
    angles = np.random.default_rng(2).normal(0, 0.5, 30)
    order = orientational_order(angles, 2)
    directions = np.linspace(-np.pi / 2, np.pi / 2, 2001)
    along = np.cos(2 * (angles[:, None] - directions)).mean(axis=0)
    assert order.S_n == pytest.approx(along.max(), abs=1e-5)
    assert order.theta_n == pytest.approx(directions[along.argmax()], abs=2e-3)


def test_single_particle_is_ordered():
    assert orientational_order([1.0], 2) == pytest.approx((1, 1))


def test_refuses():
    with pytest.raises(ValueError, match=r"angles have shape \(0,\), expected \(N,\) with N > 0"):
        orientational_order([], 2)
    with pytest.raises(ValueError, match=r"angles have shape \(2, 2\), expected \(N,\)"):
        orientational_order(np.zeros((2, 2)), 2)
    with pytest.raises(ValueError, match="n is 0, expected a positive integer"):
        orientational_order([0.0], 0)
