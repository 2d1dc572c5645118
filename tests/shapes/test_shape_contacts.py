"""Contacts of every shape: bonds, and what changes neither energy nor forces."""

import numpy as np
import pytest
from every_shape import (
    EPS,
    PURE,
    ROUNDING,
    SIDES,
    TYPICAL,
    apart,
    as_vectors,
    close_to,
    kicked,
    laws,
    replicated,
    scattered,
    size_of,
    taken,
    turned_as_a_whole,
)

from jamshape.contacts import (
    CrossingError,
    PairArrays,
    coordination,
    find_contacts,
    find_rattlers,
    forces,
    sum_forces,
)
from jamshape.contacts.near import NearPairs
from jamshape.landscape import Landscape
from jamshape.packing import State
from jamshape.shapes.shape import Interaction


@pytest.mark.parametrize("k_e", [2.5, 1e-7])
def test_all_is_in_proportion_to_the_stiffness(packing, k_e):
    for sides in laws(packing):
        one, other = (find_contacts(packing, k, sides) for k in (1.0, k_e))
        for name in ("energy", "force", "torque_i", "torque_j"):
            size = max(size_of(one)) * 8 * EPS * k_e
            np.testing.assert_allclose(getattr(other, name), k_e * getattr(one, name), 0, size)


def test_bonds_make_up_their_contacts(packing):
    for sides in laws(packing):
        network = find_contacts(packing, 1.7, sides)
        bonds, i = network.bonds, network.pairs[:, 0]
        assert (network.n_bonds >= 1).all()
        assert (np.bincount(bonds.contact, minlength=len(i)) == network.n_bonds).all()
        assert network.n_bonds.max() <= (
            sides if packing.compiled().has_sides else packing.compiled().most_bonds
        )
        shift = packing.box.vectors(network.shift)
        separation = packing.position[i] - packing.position[network.pairs[:, 1]] - shift
        size_of_box = 8 * EPS * np.abs(packing.position).max()
        np.testing.assert_allclose(network.separation, separation, rtol=0, atol=size_of_box)
        force, torque = size_of(network)
        size = ROUNDING * max(force, torque)

        found = summed(bonds.force, bonds)
        np.testing.assert_allclose(found, network.force, rtol=0, atol=size)
        np.testing.assert_allclose(summed(bonds.energy, bonds), network.energy, rtol=ROUNDING)
        assert (network.energy > 0).all()
        assert (1 - bonds.distance / bonds.reach > 0).all()
        np.testing.assert_allclose(np.linalg.norm(bonds.normal, axis=1), 1, rtol=8 * EPS)
        along = (bonds.force * bonds.normal).sum(axis=1)
        assert (along >= 0).all()
        if (
            sides != laws(packing)[0]
        ):  # bonds that fade turn particles by more than their forces do, and end at none
            continue
        assert (along > 0).all()
        overlap = 1 - bonds.distance / bonds.reach
        np.testing.assert_allclose(bonds.energy, 0.5 * 1.7 * overlap**2, rtol=0, atol=ROUNDING)
        arm_i = bonds.point - packing.position[i[bonds.contact]]
        arm_j = arm_i + network.separation[bonds.contact]
        for arm, sign, expected in ((arm_i, 1, network.torque_i), (arm_j, -1, network.torque_j)):
            torques = summed(crossed(arm, sign * bonds.force), bonds)
            np.testing.assert_allclose(torques, as_vectors(expected), rtol=0, atol=size)


def summed(values, bonds):
    """By contacts, each of which has a bond."""
    total = np.zeros((bonds.contact[-1] + 1, *values.shape[1:]))
    np.add.at(total, bonds.contact, values)
    return total


def crossed(arm, force):
    if arm.shape[1] == 3:
        return np.cross(arm, force)
    return (arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0])[:, None]


def test_round_particles_are_pushed_along_the_line_between_centres(packing, network):
    force, _ = size_of(network)
    size = ROUNDING * force * packing.outer_radius.max()
    i, j = network.pairs.T
    assert np.abs(network.torque_i[packing.is_round[i]]).max(initial=0.0) <= size
    assert np.abs(network.torque_j[packing.is_round[j]]).max(initial=0.0) <= size
    both = packing.is_round[i] & packing.is_round[j]
    across = crossed(network.separation[both], network.force[both])
    assert np.abs(across).max(initial=0.0) <= size
    along = (network.separation[both] * network.force[both]).sum(axis=1)
    assert (along > 0).all()


# --- what changes nothing ------------------------------------------------------------------------


def test_exchange_of_both_particles_turns_the_force_about(packing, network):
    bodies, state = packing.compiled(Interaction(1.0, SIDES)), State.of(packing)
    (i, j), shift = network.pairs.T, network.shift
    ahead, back = (
        bodies.contacts(*PairArrays.of(state, NearPairs(*near)), False)
        for near in ((i, j, shift), (j, i, -shift))
    )
    np.testing.assert_array_equal(ahead["pair"], back["pair"])
    # An image of the particle itself is parallel to it, exactly at the kink of a bond that fades.
    other = (i != j)[ahead["pair"]]
    force, torque = size_of(network)
    for name, expected, size in (
        ("energy", back["energy"], force),
        ("force", -back["force"], force),
        ("n_bonds", back["n_bonds"], 0),
        ("kind", back["kind"], 0),
    ):
        np.testing.assert_allclose(ahead[name], expected, 0, ROUNDING * size, err_msg=name)
    for name, expected in (("torque_i", "torque_j"), ("torque_j", "torque_i")):
        one, two = ahead[name][other], back[expected][other]
        np.testing.assert_allclose(one, two, 0, ROUNDING * max(torque, force), err_msg=name)


def assert_same_but_for_rounding(packing, changed, rows=slice(None), matrix=None):
    """Energy, forces, torques and pressure, those of the second one in its frame."""
    for sides in laws(packing):
        assert_same_by_one_law(packing, changed, rows, matrix, sides)
    network = find_contacts(packing, sides=SIDES)
    return sum_forces(packing, network), forces(changed, sides=SIDES)


def assert_same_by_one_law(packing, changed, rows, matrix, sides):
    network = find_contacts(packing, sides=sides)
    expected, found = sum_forces(packing, network), forces(changed, sides=sides)
    matrix = np.eye(packing.dimension) if matrix is None else matrix
    of_torque = matrix if packing.dimension == 3 else np.ones((1, 1))
    force, torque = size_of(network)
    # Positions are rounded to the size of the box; forces are stiff as k_e over lengths squared.
    away = np.abs(changed.position - packing.box.lo).max() / packing.compiled().inner_radius.min()
    size = ROUNDING * (1 + away) * max(force, torque)
    assert found.energy == close_to(expected.energy, ROUNDING * (1 + away))
    np.testing.assert_allclose(found.force, expected.force[rows] @ matrix.T, rtol=0, atol=size)
    wanted = as_vectors(expected.torque[rows]) @ of_torque.T
    np.testing.assert_allclose(as_vectors(found.torque), wanted, rtol=0, atol=size)


def test_neither_order_nor_names_nor_places_in_the_box_matter(packing):
    rng = np.random.default_rng(1)
    rows = rng.permutation(packing.n)
    mixed = taken(packing, rows).with_(id=1 + 3 * rng.permutation(packing.n))
    assert_same_but_for_rounding(packing, mixed, rows)
    turns = rng.integers(-2, 3, packing.position.shape)
    wrapped = packing.with_(position=packing.position + packing.box.vectors(turns))
    assert_same_but_for_rounding(packing, wrapped)
    moved = packing.with_(position=packing.position + 0.3 * packing.box.edges)
    assert_same_but_for_rounding(packing, moved)


def test_a_cluster_may_turn_as_a_whole(packing):
    cluster = kicked(apart(replicated(packing, 2)), 1e-3)  # no two of them are parallel
    turned, matrix = turned_as_a_whole(cluster)
    expected, found = assert_same_but_for_rounding(cluster, turned, matrix=matrix)
    virial = matrix @ expected.virial @ matrix.T
    np.testing.assert_allclose(found.virial, virial, rtol=0, atol=1e-11 * np.abs(virial).max())
    assert np.abs(found.force - expected.force).max() > 0.1 * np.abs(found.force).max()


def test_particles_may_turn_about_their_axes_of_symmetry(packing):
    landscape, state = Landscape(packing), State.of(packing)
    turn, rng = np.zeros((packing.n, 3)), np.random.default_rng(6)
    for k in range(3):
        own = (packing.symmetry_axis == k) & ~packing.is_round
        if packing.dimension == 3:
            turn[own] = packing.body_axes(k)[own] * rng.uniform(1, 2, (own.sum(), 1))
    turn[packing.is_round] = rng.uniform(1, 2, (packing.is_round.sum(), 3))
    turned = state.displaced(
        np.zeros_like(packing.position),
        turn if packing.dimension == 3 else turn[:, 2:],
    )
    one, other = landscape.evaluate(state), Landscape(packing).evaluate(turned)
    assert other.energy == close_to(one.energy, ROUNDING)
    D, size = packing.dimension, 10 * ROUNDING * one.bond_force
    gradients = [landscape.components(x.gradient)[:, :D] for x in (one, other)]
    np.testing.assert_allclose(*gradients, rtol=0, atol=size)


# --- what holds a particle -----------------------------------------------------------------------


def are_in_touch(packing):
    """Whether any two particles are, or are so close that no force is defined."""
    try:
        return len(find_contacts(packing, sides=SIDES).pairs) > 0
    except CrossingError:
        return True


@pytest.mark.parametrize("case", PURE, ids=str)
def test_two_particles_that_barely_touch_hold_neither(case):
    packing = scattered(case, 2, phi=0.01)
    towards = packing.position[0] - packing.position[1]
    far, near = 1.0, 0.0  # of their distance
    for _ in range(60):
        middle = 0.5 * (far + near)
        position = np.array([packing.position[1] + middle * towards, packing.position[1]])
        closer = packing.with_(position=position)
        far, near = (far, middle) if are_in_touch(closer) else (middle, near)
    position[0] = packing.position[1] + (near - 1e-6) * towards
    closer = packing.with_(position=position)
    network = find_contacts(closer, sides=SIDES)
    assert len(network.pairs) == 1
    assert network.n_bonds[0] <= 2
    assert find_rattlers(closer, network).all()
    assert coordination(closer, network) == (0.0, 0.0, 0.0, 2, 0, 0, 0)


# --- what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize("case", TYPICAL, ids=str)
def test_particles_at_one_place_are_named(case):
    packing = scattered(case, 4)
    position = packing.position.copy()
    position[2] = position[0]
    names = ("orientation", "diameters", "form")
    alike = {name: np.repeat(getattr(packing, name)[:1], 4, axis=0) for name in names}
    packing = packing.with_(position=position, id=np.array([7, 1, 3, 2]), **alike)
    sentence = f"the {packing.compiled().core} of particles 7 and 3 cross"
    with pytest.raises(CrossingError, match=sentence):
        find_contacts(packing)
    with pytest.raises(CrossingError, match=sentence):
        Landscape(packing).evaluate(State.of(packing))
