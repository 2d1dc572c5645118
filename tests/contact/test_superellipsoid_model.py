"""Volumes and moments, rejection of pairs that are apart, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from superellipsoid_pairs import (
    EXPONENTS,
    at_scale,
    contacts,
    gauge,
    matrix_of,
    random_bodies,
    random_pairs,
    scales,
)

from jamshape import _contact


def drag(diameters, exponent, dimension):
    found = _contact.Superellipsoids(diameters, exponent, dimension, 1.0, 1)
    return found.measure, found.moment


def integral(function):
    """Over [-1, 1], even; the root at 1 is taken out by x = 1 - u^4."""
    value, error = quad(
        lambda u: 8.0 * u**3 * function(1.0 - u**4), 0.0, 1.0, epsabs=0, epsrel=1e-12
    )
    assert error < 1e-9 * value
    return value


@pytest.mark.parametrize("p", EXPONENTS)
@pytest.mark.parametrize("axes", [(1.0, 1.0, 1.0), (0.1, 1.0, 3.0)])
def test_measure_and_moments_are_integrals_over_slices(p, axes, measured):
    """A slice at x = t a is the shape of one dimension less, smaller by (1 - t^2p)^(1/2p)."""

    def smaller(t):
        return (-np.expm1(2.0 * p * np.log(t)) if t > 0 else 1.0) ** (0.5 / p)

    a, b, c = axes
    length = integral(smaller)
    mean_sq_2d = integral(lambda t: t**2 * smaller(t)) / length
    area = 2.0 * a * b * length
    volume = 2.0 * a * b * c * length * integral(lambda t: smaller(t) ** 2)
    slices = integral(lambda t: smaller(t) ** 2)
    mean_sq_3d = integral(lambda t: t**2 * smaller(t) ** 2) / slices

    diameters, exponent = 2.0 * np.array([axes]), np.array([p])
    measure, moment = drag(diameters, exponent, 2)
    worst = abs(measure[0] / area - 1.0)
    np.testing.assert_allclose(measure[0], area, rtol=1e-10)
    squares = mean_sq_2d * np.array([b**2, a**2, a**2 + b**2])
    np.testing.assert_allclose(moment[0], squares, rtol=1e-9)
    measure, moment = drag(diameters, exponent, 3)
    measured(area=worst, volume=abs(measure[0] / volume - 1.0))
    np.testing.assert_allclose(measure[0], volume, rtol=1e-10)
    expected = mean_sq_3d * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    np.testing.assert_allclose(moment[0], expected, rtol=1e-9)


def test_ellipsoids_have_their_volume_and_moments():
    diameters = np.array([[2.0, 3.0, 5.0]])
    measure, moment = drag(diameters, np.ones(1), 3)
    assert measure[0] == pytest.approx(np.pi / 6.0 * 30.0, rel=1e-14)
    squares = (0.5 * diameters[0]) ** 2
    np.testing.assert_allclose(moment[0], (squares.sum() - squares) / 5.0, rtol=1e-14)
    measure, moment = drag(diameters, np.ones(1), 2)
    assert measure[0] == pytest.approx(np.pi / 4.0 * 6.0, rel=1e-14)
    assert moment[0, 2] == pytest.approx((1.0 + 2.25) / 4.0, rel=1e-14)


def gap_upper_bound(i, j, eta):
    """Points of the surfaces on the line of centres are this far apart: r (1 - 1/eta) at most."""
    return np.linalg.norm(i.centre - j.centre, axis=1) * (1.0 - 1.0 / eta)


@pytest.mark.parametrize("dimension", [2, 3])
def test_no_near_pair_is_rejected(dimension, measured):
    rng = np.random.default_rng(21)
    i, j = random_pairs(rng, 20000, dimension, *rng.choice(EXPONENTS, (2, 20000)))
    i = at_scale(i, j, rng.uniform(0.5, 2.0, 20000))
    eta = scales(i, j)["eta"]
    for margin in (0.0, 0.1):
        near = _contact.superellipsoid_near(i.rows, j.rows, margin)
        closer = (eta < 1.0 - 1e-12) | (gap_upper_bound(i, j, eta) < margin * (1.0 - 1e-12))
        assert np.all(near[closer])
        measured(**{f"kept_in_vain_{margin}": np.mean(near[~closer])})


def moved_a_little(rng, bodies, amplitude):
    """Shifted and turned at random by about these amounts."""
    centre = bodies.centre + amplitude[:, None] * rng.normal(size=bodies.centre.shape)
    turn = bodies.turn + amplitude[:, None] * rng.normal(size=bodies.turn.shape)
    if bodies.dimension == 3:
        turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    return bodies.replaced(centre=centre, turn=turn)


@pytest.mark.parametrize("dimension", [2, 3])
def test_no_point_of_a_body_moves_farther_than_its_bound(dimension, measured):
    rng = np.random.default_rng(31)
    n = 1000
    then = random_bodies(rng, n, dimension, rng.choice(EXPONENTS, n))
    now = moved_a_little(rng, then, 10.0 ** rng.uniform(-6, 0, n))
    bound = np.sqrt(_contact.superellipsoid_motion_sq(then.rows, now.rows))
    farthest = np.zeros(n)
    for _ in range(200):
        x = rng.normal(size=(n, dimension))
        x /= gauge(x, then.semi_axes[:, :dimension], then.p)[:, None]
        ends = [b.centre + np.einsum("nij,nj->ni", matrix_of(b.turn), x) for b in (then, now)]
        farthest = np.maximum(farthest, np.linalg.norm(ends[1] - ends[0], axis=1))
    ratio = farthest / bound
    measured(largest=ratio.max(), median=np.median(ratio))
    assert ratio.max() <= 1.0 + 1e-9
    assert np.median(ratio) > 0.3, "a bound this loose would cost rebuilds"


@pytest.mark.parametrize("dimension", [2, 3])
def test_pairs_left_out_do_not_touch_before_they_used_the_margin_up(dimension, measured):
    """The rule of the pair list: it is kept while both move by less than half the margin."""
    rng = np.random.default_rng(32)
    n, margin = 20000, 0.1
    i, j = random_pairs(rng, n, dimension, *rng.choice(EXPONENTS, (2, n)))
    i = at_scale(i, j, rng.uniform(1.0, 1.3, n))
    left_out = ~_contact.superellipsoid_near(i.rows, j.rows, margin)
    # Straight at each other, and turning.
    toward = (j.centre - i.centre) / np.linalg.norm(j.centre - i.centre, axis=1, keepdims=True)
    after = []
    for bodies, sign in ((i, 1), (j, -1)):
        turned = moved_a_little(rng, bodies, 10.0 ** rng.uniform(-4.0, -1.0, n))
        share = rng.uniform(0.0, 0.5 * margin, (n, 1))
        after.append(turned.replaced(centre=bodies.centre + sign * share * toward))
    moves = [
        np.sqrt(_contact.superellipsoid_motion_sq(then.rows, now.rows))
        for then, now in zip((i, j), after, strict=True)
    ]
    is_kept = 2.0 * np.maximum(*moves) < margin
    touching = contacts(*after)["status"] == 1
    measured(kept=(left_out & is_kept).mean(), touching_later=(left_out & touching).mean())
    assert (left_out & is_kept).sum() > 300
    assert not (left_out & is_kept & touching).any()
    assert (left_out & touching).any(), "some would be missed by a list kept too long"


@pytest.mark.parametrize("dimension", [2, 3])
def test_overlap_is_a_scale_below_one(dimension):
    rng = np.random.default_rng(22)
    i, j = random_pairs(rng, 20000, dimension, *rng.choice(EXPONENTS, (2, 20000)))
    offset = rng.choice([-1, 1], 20000) * 10.0 ** rng.uniform(-12, -0.2, 20000)
    i = at_scale(i, j, 1.0 + offset)
    np.testing.assert_array_equal(_contact.superellipsoid_overlap(i.rows, j.rows), offset < 0)
    np.testing.assert_array_equal(contacts(i, j)["status"] == 1, offset < 0)


def test_bad_input_is_refused_in_one_sentence():
    rng = np.random.default_rng(23)
    i, j = random_pairs(rng, 3, 3, 1.0)
    for field, value in (("p", 0.5), ("p", np.nan), ("semi_axes", 0.0), ("semi_axes", np.inf)):
        bad = j.replaced(**{field: np.full_like(getattr(j, field), value)})
        with pytest.raises(ValueError, match="body 0 is not a valid shape"):
            contacts(i, bad)
    with pytest.raises(ValueError, match="differ in shape"):
        _contact.superellipsoid_contacts(i.rows, j.rows[:2], 1.0)
    with pytest.raises(ValueError, match="5 columns, expected 6"):
        _contact.superellipsoid_contacts(*2 * [np.ascontiguousarray(i.rows[:, :5])], 1.0)
    with pytest.raises(ValueError, match="k_e is"):
        contacts(i, j, 0.0)
    with pytest.raises(ValueError, match="normals do not have the shape"):
        scales(i, j, np.zeros((3, 2)))
    diameters = np.ones((6, 3))
    with pytest.raises(ValueError, match="diameters and exponent do not have shapes"):
        _contact.Superellipsoids(diameters, np.ones(5), 3, 1.0, 1)
    with pytest.raises(ValueError, match="particle 4 is not a valid shape"):
        _contact.Superellipsoids(diameters, np.array([1, 1, 1, 1, 0.4, 1.0]), 3, 1.0, 1)
    with pytest.raises(ValueError, match="dimension is 4"):
        drag(diameters, np.ones(6), 4)
