"""Contacts of dimers: against plain sums over their discs, and against differences."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from dimer_pairs import (
    clear_of_edges,
    dimer_packing,
    dimer_pairs,
    energy,
    forces,
    overlaps,
)
from spherocylinder_pairs import APART, CROSSING, EPS, TIP_TO_TIP, TOUCHING, row_dot

from jamshape import _contact

K_E = 1.7
IN_BOTH = pytest.mark.parametrize("dimension", [2, 3])


def pairs_in(dimension, n=400, seed=1, **keywords):
    """A packing of pairs, and the same pairs in long double."""
    rng = np.random.default_rng([seed, dimension])
    packing = dimer_packing(rng, dimer_pairs(rng, n, dimension, **keywords))
    kept = clear_of_edges(packing.plain())
    assert len(kept) > n / 2
    packing = dimer_packing(rng, kept)
    return packing, packing.plain()


def contacts_of(packing):
    found = packing.compiled(1, K_E).contacts(*packing.arguments())
    assert np.array_equal(found["pair"], np.arange(len(packing)))
    assert (found["status"] == TOUCHING).all()
    return found


# --- energy, forces, bonds -----------------------------------------------------------------------


@IN_BOTH
def test_a_contact_is_the_sum_over_its_discs(dimension, measured):
    packing, pairs = pairs_in(dimension)
    found = contacts_of(packing)
    force, torque_i, torque_j = forces(pairs, K_E)
    unit = EPS * pairs.extent / pairs.d  # what an overlap rounds
    total = np.maximum(overlaps(pairs), 0).sum(axis=1)
    errors = {
        "energy": (found["energy"] - energy(pairs, K_E)) / (K_E * total),
        "force": np.abs(found["force"] - force).max(axis=1) / (K_E / pairs.d),
        "torque_i": np.abs(found["torque_i"] - torque_i).max(axis=1) / (K_E * pairs.A_i / pairs.d),
        "torque_j": np.abs(found["torque_j"] - torque_j).max(axis=1) / (K_E * pairs.A_j / pairs.d),
    }
    in_units = {name: float((np.abs(error) / unit).max()) for name, error in errors.items()}
    measured(**in_units)
    assert max(in_units.values()) < 8
    assert np.array_equal(found["n_bonds"], (overlaps(pairs) > 0).sum(axis=1))
    assert set(found["n_bonds"]) == {1, 2, 3, 4}
    assert (found["kind"] == TIP_TO_TIP).all()
    assert not found["bond_on_side"].any()
    assert not found["bond_on_face"].any()


@IN_BOTH
def test_the_energy_is_right_to_fifty_digits(dimension, measured):
    """The sum as mpmath takes it, from the doubles that the class was given."""
    packing, _ = pairs_in(dimension, n=40)
    found = contacts_of(packing)
    short = packing.plain()
    worst = 0.0
    with mpmath.workdps(50):
        for m in range(len(packing)):
            exact = [mpmath.mpf(str(v)) for v in (*short.r[m], *short.u_i[m], *short.u_j[m])]
            r, u, v = (exact[k * dimension : (k + 1) * dimension] for k in range(3))
            A, B, d = (mpmath.mpf(float(x[m])) for x in (short.A_i, short.A_j, short.d))
            total = mpmath.mpf(0)
            for a in (A, -A):
                for b in (B, -B):
                    apart = mpmath.norm(
                        [x + a * y - b * z for x, y, z in zip(r, u, v, strict=True)]
                    )
                    total += K_E / 2 * max(1 - apart / d, 0) ** 2
            worst = max(worst, abs(float(found["energy"][m] / total - 1)))
    measured(worst=worst)
    assert worst < 1e-11


@IN_BOTH
def test_bonds_sit_between_the_discs_and_add_up(dimension):
    packing, pairs = pairs_in(dimension)
    found = contacts_of(packing)
    np.testing.assert_allclose(found["bond_energy"].sum(axis=1), found["energy"], rtol=1e-14)
    force = found["bond_force"].sum(axis=1)
    np.testing.assert_allclose(force, found["force"], atol=1e-14 * np.abs(force).max())
    for b in range(4):
        has = found["n_bonds"] > b
        bond = {name: found[f"bond_{name}"][has, b] for name in ("normal", "arm_i", "distance")}
        np.testing.assert_allclose(row_dot(bond["normal"], bond["normal"]), 1, rtol=1e-14)
        np.testing.assert_allclose(
            found["bond_reach"][has, b], pairs.d[has].astype(float), rtol=1e-14
        )
        # From the centre of i's disc the point lies at R_i r / d along the normal.
        depth = (pairs.R_i / pairs.d)[has].astype(float) * bond["distance"]
        centre = bond["arm_i"] + depth[:, None] * bond["normal"]
        np.testing.assert_allclose(
            np.abs(row_dot(centre, pairs.u_i[has].astype(float))), pairs.A_i[has], rtol=1e-12
        )
        np.testing.assert_allclose(
            found["bond_stiffness"][has, b], K_E / found["bond_reach"][has, b] ** 2, rtol=1e-14
        )


@IN_BOTH
def test_discs_on_each_other_are_four_times_one(dimension):
    rng = np.random.default_rng([5, dimension])
    pairs = dimer_pairs(rng, 100, dimension)
    pairs = pairs.replaced(A_i=0 * pairs.A_i, A_j=0 * pairs.A_j)
    pairs.r *= (rng.uniform(0.7, 0.99, 100) * pairs.d / np.linalg.norm(pairs.r, axis=1))[:, None]
    packing = dimer_packing(rng, pairs)
    found = contacts_of(packing)
    disc = _contact.Spherocylinders(packing.diameters, np.ones(200), dimension, K_E, 1)
    one = disc.contacts(*packing.arguments())
    assert (found["n_bonds"] == 4).all()
    np.testing.assert_allclose(found["energy"], 4 * one["energy"], rtol=1e-14)
    np.testing.assert_allclose(found["force"], 4 * one["force"], rtol=1e-14)
    assert not found["torque_i"].any()
    shape = packing.compiled(1, K_E)
    assert not shape.rotation_length.any()
    assert (shape.symmetry_axis == -1).all()
    np.testing.assert_allclose(shape.measure, disc.measure, rtol=1e-14)
    np.testing.assert_allclose(shape.moment, disc.moment, rtol=1e-14)


# --- what has no contact -------------------------------------------------------------------------


def two(dimension, distance, diameters=(3.0, 1.0, 1.0)):
    """Parallel dimers, A = 1 and R = 1/2, the second this far along x from the first."""
    position, cell = np.zeros((2, 2, dimension)), np.zeros((2, dimension, dimension))
    position[0, 1, 0], cell[0] = distance, 20.0 * np.eye(dimension)
    orientation = np.zeros((2, 2, 1 if dimension == 2 else 4))
    orientation[0, :, 0] = dimension == 3
    shape = _contact.Dimers(np.tile(diameters, (2, 1)), np.ones(2), dimension, K_E, 1)
    pairs, shift = np.array([[0, 1]]), np.zeros((1, dimension), np.int64)
    return shape, (position, orientation, cell, pairs, shift)


@pytest.mark.parametrize("extended", [False, True])
@IN_BOTH
def test_discs_that_coincide_cross(dimension, extended):
    for distance in (0.0, 2.0, 2.0 + 1e-15):
        shape, arguments = two(dimension, distance)
        assert shape.sums(*arguments, extended)["crossing"] == 0
        assert shape.contacts(*arguments)["status"].tolist() == [CROSSING]
        assert len(shape.derivatives(*arguments, extended)["pair"]) == 0
    shape, arguments = two(dimension, 2.0 - 1e-3)
    assert shape.sums(*arguments, extended)["crossing"] == -1


@IN_BOTH
def test_whole_dimers_side_by_side_and_apart(dimension):
    """Two bonds of one normal where they lie side by side; none where they are apart."""
    shape, arguments = two(dimension, 0.0)
    arguments[0][0, 1, :2] = 0.0, 0.9
    found = shape.contacts(*arguments)
    assert found["n_bonds"].tolist() == [2]
    np.testing.assert_allclose(found["energy"], K_E * 0.1**2)
    for distance in (3.0, 8.0):
        shape, arguments = two(dimension, distance)
        assert len(shape.contacts(*arguments)["pair"]) == 0
        assert shape.sums(*arguments, True)["energy"] == 0.0
    assert APART == 0


@IN_BOTH
def test_near_and_overlapping_are_gaps_of_discs(dimension):
    rng = np.random.default_rng([6, dimension])
    pairs = dimer_pairs(rng, 2000, dimension, alpha=(0.05, 3.0))
    pairs.r *= rng.uniform(0.8, 1.6, (2000, 1))
    packing = dimer_packing(rng, pairs)
    gap = (-overlaps(packing.plain()).max(axis=1) * pairs.d).astype(float)
    shape, arguments = packing.compiled(1, K_E), packing.arguments()
    clear = np.abs(gap) > 1e-12
    assert np.array_equal(shape.overlaps(*arguments)[clear], (gap < 0)[clear])
    for margin in (0.0, 0.3):
        clear = np.abs(gap - margin) > 1e-12
        assert np.array_equal(shape.near(*arguments, margin)[clear], (gap < margin)[clear])
    assert 0.2 < (gap < 0).mean() < 0.8


@pytest.mark.parametrize(
    "diameters",
    [(1.0, 3.0, 3.0), (3.0, 1.0, 2.0), (3.0, 0.0, 0.0), (np.inf, 1.0, 1.0), (1, -1, -1)],
)
def test_other_shapes_are_refused(diameters):
    every = np.array([[3.0, 1.0, 1.0], diameters])
    with pytest.raises(ValueError, match="particle 1 is not a valid shape: a dimer has diameters"):
        _contact.Dimers(every, np.ones(2), 2, 1.0, 1)
