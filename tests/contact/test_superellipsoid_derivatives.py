"""Forces, torques and second derivatives of superellipsoid pairs; their symmetries and sums."""

from __future__ import annotations

import numpy as np
import pytest
from superellipsoid_pairs import (
    EXPONENTS,
    at_scale,
    contacts,
    packed,
    quaternion_product,
    random_pairs,
    shapes_of,
)

STEP = 1e-6
PAIRS = 300
# Second derivatives of sharp corners and edges change within a step: where they do, differences
# tell little. Quantiles of the relative error must still be small.
TYPICAL, WORST = 1e-8, 2e-4


def pairs_of(seed, dimension, p_i, p_j=None):
    rng = np.random.default_rng(seed)
    i, j = random_pairs(rng, PAIRS, dimension, p_i, p_j, size_range=1.5)
    return at_scale(i, j, rng.uniform(0.6, 0.99, PAIRS)), j


def cross(a, b):
    if a.shape[1] == 2:
        return (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[:, None]
    return np.cross(a, b)


def differences(function, i, j):
    """Differences by r and by rotations of i and j, last axis."""
    rotations = 1 if i.dimension == 2 else 3
    columns = []
    for k in range(i.dimension):
        forth, back = i.shifted(k, STEP), i.shifted(k, -STEP)
        columns.append((function(forth, j) - function(back, j)) / (2.0 * STEP))
    for k in range(rotations):
        forth, back = i.turned(k, STEP), i.turned(k, -STEP)
        columns.append((function(forth, j) - function(back, j)) / (2.0 * STEP))
    for k in range(rotations):
        forth, back = j.turned(k, STEP), j.turned(k, -STEP)
        columns.append((function(i, forth) - function(i, back)) / (2.0 * STEP))
    return np.stack(columns, -1)


def energy(i, j):
    return contacts(i, j)["energy"]


def generalised_force(i, j):
    found = contacts(i, j)
    return np.hstack([found["force"], found["torque_i"], found["torque_j"]])


def relative(error, size):
    axes = tuple(range(1, error.ndim))
    return np.sort(np.abs(error).max(axes) / np.abs(size).max(axes))


def check(error, measured):
    measured(median=np.median(error), worst=error[-1])
    assert np.median(error) < TYPICAL
    assert error[-1] < WORST


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("p", EXPONENTS)
def test_force_and_torques_are_derivatives_of_the_energy(p, dimension, measured):
    i, j = pairs_of(1, dimension, p)
    force = generalised_force(i, j)
    check(relative(force + differences(energy, i, j), force), measured)


@pytest.mark.parametrize("extended", [False, True])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("p", [*EXPONENTS, None])
def test_second_derivatives_are_derivatives_of_the_forces(p, dimension, extended, measured):
    unequal = np.random.default_rng(2).choice(EXPONENTS, (2, PAIRS))
    i, j = pairs_of(3, dimension, *(unequal if p is None else (p, p)))
    found = shapes_of(i, j).derivatives(*packed(i, j), extended)
    assert np.array_equal(found["pair"], np.arange(PAIRS))
    gradient = found["gradient"][:, 0]
    along = found["stiffness"][:, 0, None, None] * gradient[:, :, None] * gradient[:, None, :]
    hessian = along + found["curvature"]
    by_differences = -differences(generalised_force, i, j)
    by_differences = 0.5 * (by_differences + by_differences.transpose(0, 2, 1))
    check(relative(hessian - by_differences, hessian), measured)


@pytest.mark.parametrize("dimension", [2, 3])
def test_double_and_extended_agree(dimension, measured):
    """The whole error of doubles: what they round, amplified by how sharp the bodies are."""
    rng = np.random.default_rng(4)
    i, j = pairs_of(5, dimension, *rng.choice(EXPONENTS, (2, PAIRS)))
    short, long = (shapes_of(i, j).derivatives(*packed(i, j), e) for e in (False, True))
    for name, tolerance in (("energy", 1e-12), ("force", 1e-10), ("curvature", 1e-7)):
        size = np.abs(long[name]).reshape(PAIRS, -1).max(1)
        error = np.abs(short[name] - long[name]).reshape(PAIRS, -1).max(1) / size
        measured(**{name: error.max()})
        assert error.max() < tolerance


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_bond_carries_the_gradient_and_the_overlap(dimension):
    rng = np.random.default_rng(6)
    i, j = pairs_of(7, dimension, *rng.choice(EXPONENTS, (2, PAIRS)))
    found = contacts(i, j, 3.0)
    bond = {name: values[:, 0] for name, values in found.items() if name.startswith("bond_")}
    overlap = 1.0 - bond["bond_distance"] / bond["bond_reach"]
    np.testing.assert_allclose(found["energy"], 1.5 * overlap**2, rtol=1e-10)
    force = (3.0 * overlap / bond["bond_reach"])[:, None] * bond["bond_normal"]
    np.testing.assert_allclose(found["force"], force, rtol=1e-10, atol=1e-14)
    np.testing.assert_allclose(bond["bond_stiffness"], 3.0 / bond["bond_reach"] ** 2, rtol=1e-12)
    torque = cross(bond["bond_arm_i"], found["force"])
    np.testing.assert_allclose(found["torque_i"], torque, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("dimension", [2, 3])
def test_torques_and_force_balance(dimension):
    """A rotation of the whole pair changes nothing: torque_i + torque_j + r x force = 0."""
    rng = np.random.default_rng(8)
    i, j = pairs_of(9, dimension, *rng.choice(EXPONENTS, (2, PAIRS)))
    found = contacts(i, j)
    whole = found["torque_i"] + found["torque_j"] + cross(i.centre - j.centre, found["force"])
    size = np.abs(found["torque_i"]).max() + np.abs(found["force"]).max()
    assert np.abs(whole).max() < 1e-13 * size


@pytest.mark.parametrize("dimension", [2, 3])
def test_exchange_of_i_and_j(dimension):
    rng = np.random.default_rng(10)
    i, j = pairs_of(11, dimension, *rng.choice(EXPONENTS, (2, PAIRS)))
    one, other = contacts(i, j), contacts(j, i)
    np.testing.assert_allclose(one["energy"], other["energy"], rtol=1e-11)
    for a, b, sign in (("force", "force", -1), ("torque_i", "torque_j", 1)):
        size = np.abs(one[a]).max(1, keepdims=True)
        np.testing.assert_allclose(one[a] / size, sign * other[b] / size, atol=1e-9)


def test_rotation_of_the_whole_pair():
    rng = np.random.default_rng(12)
    i, j = pairs_of(13, 3, *rng.choice(EXPONENTS, (2, PAIRS)))
    by = np.array([[0.5, 0.1, -0.7, 0.5]])
    by /= np.linalg.norm(by)
    matrix = _matrix(by)

    def turned(b):
        turn = quaternion_product(np.repeat(by, len(b), 0), b.turn)
        return b.replaced(centre=b.centre @ matrix.T, turn=turn)

    still, moved = contacts(i, j), contacts(turned(i), turned(j))
    np.testing.assert_allclose(moved["energy"], still["energy"], rtol=1e-10)
    for name in ("force", "torque_i", "torque_j"):
        size = np.abs(still[name]).max(1, keepdims=True) + 1e-12
        np.testing.assert_allclose(moved[name] / size, still[name] @ matrix.T / size, atol=1e-8)


def _matrix(by):
    from superellipsoid_pairs import matrix_of  # noqa: PLC0415

    return matrix_of(by)[0]


@pytest.mark.parametrize("extended", [False, True])
@pytest.mark.parametrize("dimension", [2, 3])
def test_sums_are_those_of_the_contacts(dimension, extended):
    rng = np.random.default_rng(14)
    i, j = pairs_of(15, dimension, *rng.choice(EXPONENTS, (2, PAIRS)))
    found = contacts(i, j, 2.0)
    sums = shapes_of(i, j, 2.0).sums(*packed(i, j), extended)
    assert sums["energy"] == pytest.approx(found["energy"].sum(), rel=1e-12)
    assert sums["n_bonds"] == PAIRS
    assert sums["crossing"] == -1
    size = np.abs(found["force"]).max()
    np.testing.assert_allclose(sums["force"][::2], found["force"], atol=1e-11 * size)
    np.testing.assert_allclose(sums["force"][1::2], -found["force"], atol=1e-11 * size)
    np.testing.assert_allclose(sums["torque"][1::2], found["torque_j"], atol=1e-10 * size)
    # U is a function of eta, of degree 1 in r: r.force = 2 eps eta^2 (1 - eta^2), pair by pair.
    overlap = 1.0 - (found["bond_distance"] / found["bond_reach"])[:, 0]
    expected = (2.0 * 2.0 * (1.0 - overlap) * overlap).sum()
    assert np.trace(sums["virial"]) == pytest.approx(expected, rel=1e-10)
