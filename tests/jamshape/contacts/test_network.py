import itertools

import numpy as np
import pytest
from mixtures import monodisperse
from scenes import PRESSED, assert_same_forces, make, moved, pressed_named, scaled, turned

from jamshape import _contact
from jamshape.contacts import (
    ContactKind,
    coordination,
    find_contacts,
    find_rattlers,
    forces,
    sum_forces,
)
from jamshape.packing import Box
from jamshape.protocols.random_start import random_packing


@pytest.fixture(params=PRESSED)
def packing(request):
    return pressed_named(request.param)


SIDES = [1, 2]


def slope(energy_of, h=1e-6):
    return (energy_of(h) - energy_of(-h)) / (2 * h)


@pytest.mark.parametrize("sides", SIDES)
def test_forces_and_torques_are_slopes_of_the_energy(packing, sides):
    found = forces(packing, 2.5, sides)
    assert found.energy > 0
    expected_force, expected_torque = np.zeros_like(found.force), np.zeros_like(found.torque)
    for particle, axis in itertools.product(range(packing.n), range(packing.dimension)):
        expected_force[particle, axis] = -slope(
            lambda h, p=particle, a=axis: forces(moved(packing, p, a, h), 2.5, sides).energy
        )
    torques = expected_torque.reshape(packing.n, -1)
    for particle, axis in itertools.product(range(packing.n), range(torques.shape[1])):
        torques[particle, axis] = -slope(
            lambda h, p=particle, a=axis: forces(turned(packing, p, a, h), 2.5, sides).energy
        )
    largest = np.linalg.norm(find_contacts(packing, 2.5, sides).force, axis=1).max()
    np.testing.assert_allclose(found.force, expected_force, rtol=0, atol=1e-6 * largest)
    np.testing.assert_allclose(found.torque, expected_torque, rtol=0, atol=1e-5 * largest)


@pytest.mark.parametrize("sides", SIDES)
def test_virial_and_pressure_are_slopes_of_the_energy(packing, sides):
    found, D = forces(packing, 1.0, sides), packing.dimension
    for axis in range(D):
        along = np.eye(D)[axis]
        expected = -slope(lambda h, e=along: forces(scaled(packing, 1 + h * e), 1.0, sides).energy)
        assert found.virial[axis, axis] == pytest.approx(expected, rel=1e-5)
    per_volume = D * packing.box.volume
    expected = -slope(lambda h: forces(scaled(packing, 1 + h), 1.0, sides).energy) / per_volume
    assert found.pressure == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("sides", SIDES)
def test_contacts_are_those_of_all_pairs_and_images(packing, sides):
    network = find_contacts(packing, 1.0, sides)
    A, R, edges, D = packing.half_length, packing.radius, packing.box.edges, packing.dimension
    turns = [int(np.ceil(2 * (A + R).max() / edge)) + 1 for edge in edges]
    rows = np.column_stack([packing.position, packing.axes, A, R])
    expected = set()
    for shift in itertools.product(*(range(-m, m + 1) for m in turns)):
        for i, j in itertools.combinations_with_replacement(range(packing.n), 2):
            image = rows[j].copy()
            image[:D] += shift * edges
            near = _contact.spine_distances(rows[[i]], image[None])[0] < R[i] + R[j]
            if near and (i < j or shift > (0,) * D):
                expected.add((i, j, *shift))
    contacts = np.column_stack([network.pairs, network.shift]).tolist()
    assert contacts == sorted(map(list, expected))
    i, j = network.pairs.T
    separation = packing.position[i] - packing.position[j] - network.shift * edges
    np.testing.assert_allclose(network.separation, separation, rtol=0, atol=1e-13)


def test_tiny_box_has_own_images_and_several_images_of_a_neighbour():
    pairs = find_contacts(pressed_named("rods in a tiny box")).pairs.tolist()
    assert pairs.count([0, 0]) == pairs.count([1, 1]) == 1
    assert pairs.count([0, 1]) > 2
    assert find_contacts(pressed_named("rod alone")).pairs[0].tolist() == [0, 0]


@pytest.mark.parametrize("sides", SIDES)
def test_bonds_make_up_the_contacts(packing, sides):
    network = find_contacts(packing, 1.0, sides)
    bonds, M = network.bonds, len(network.pairs)
    np.testing.assert_array_equal(np.bincount(bonds.contact, minlength=M), network.n_bonds)
    assert network.n_bonds.max() <= sides
    force, energy = np.zeros_like(network.force), np.zeros(M)
    np.add.at(force, bonds.contact, bonds.force)
    np.add.at(energy, bonds.contact, bonds.energy)
    np.testing.assert_allclose(force, network.force, rtol=0, atol=1e-15)
    np.testing.assert_allclose(energy, network.energy, rtol=0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(bonds.normal, axis=1), 1, rtol=1e-14)
    R = packing.radius[network.pairs[bonds.contact]]
    np.testing.assert_array_equal(bonds.reach, R.sum(axis=1))
    assert np.all(bonds.distance < bonds.reach)


def test_point_of_contact_gives_the_torques(packing):
    network = find_contacts(packing, sides=1)  # one bond, whose force acts along its normal
    i, j = network.pairs.T
    point, force = network.bonds.point, network.force
    arm_i = point - packing.position[i]
    arm_j = point - packing.position[j] - network.shift * packing.box.edges

    def torque(arm, force):
        if packing.dimension == 2:
            return arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]
        return np.cross(arm, force)

    np.testing.assert_allclose(torque(arm_i, force), network.torque_i, rtol=0, atol=1e-13)
    np.testing.assert_allclose(torque(arm_j, -force), network.torque_j, rtol=0, atol=1e-13)


@pytest.mark.parametrize("sides", SIDES)
def test_translation_and_wrapping_change_nothing(packing, sides):
    expected = forces(packing, 1.0, sides)
    rng = np.random.default_rng(1)
    turns = rng.integers(-3, 4, packing.position.shape)
    for position in (
        packing.position + turns * packing.box.edges,
        packing.position + rng.normal(size=packing.dimension),
    ):
        assert_same_forces(forces(packing.with_(position=position), 1.0, sides), expected)


@pytest.mark.parametrize("sides", SIDES)
def test_order_of_particles_changes_nothing(packing, sides):
    order = np.random.default_rng(2).permutation(packing.n)
    names = ("position", "orientation", "diameters", "species", "id")
    mixed = forces(
        packing.with_(**{name: getattr(packing, name)[order] for name in names}), 1.0, sides
    )
    expected = forces(packing, 1.0, sides)
    np.testing.assert_allclose(mixed.force, expected.force[order], rtol=0, atol=1e-13)
    np.testing.assert_allclose(mixed.torque, expected.torque[order], rtol=0, atol=1e-13)


@pytest.mark.parametrize("sides", SIDES)
def test_torques_keep_their_sign_when_turned_and_change_it_when_mirrored(sides):
    packing = pressed_named("rods")
    expected = forces(packing, 1.0, sides)
    x, y = packing.position.T
    quarter = packing.with_(
        position=np.column_stack([-y, x]), orientation=packing.orientation + np.pi / 2
    )
    mirrored = packing.with_(position=np.column_stack([x, -y]), orientation=-packing.orientation)
    for found, force, torque in (
        (forces(quarter, 1.0, sides), expected.force[:, ::-1] * [-1, 1], expected.torque),
        (forces(mirrored, 1.0, sides), expected.force * [1, -1], -expected.torque),
    ):
        np.testing.assert_allclose(found.force, force, rtol=0, atol=1e-13)
        np.testing.assert_allclose(found.torque, torque, rtol=0, atol=1e-13)


def test_push_on_the_right_tip_turns_counterclockwise():
    # The disc presses from below on the right end of a rod along x.
    packing = make([[5, 5], [5.9, 4.1]], 0.0, half_length=np.array([1.0, 0.0]))
    found = forces(packing)
    np.testing.assert_allclose(found.force, [[0, 0.1], [0, -0.1]], rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.torque, [0.09, 0], rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("position", "angle", "kind"),
    [
        ([[5, 5], [7.9, 5]], [0, 0], ContactKind.TIP_TO_TIP),
        ([[5, 5], [5.2, 6.9]], [0, np.pi / 2], ContactKind.TIP_TO_SIDE),
        ([[5, 5], [5.4, 5.9]], [0, np.pi], ContactKind.SIDE_TO_SIDE),
    ],
)
@pytest.mark.parametrize("sides", SIDES)
def test_kinds(position, angle, kind, sides):
    network = find_contacts(make(position, angle), 1.0, sides)
    assert network.kind == [kind]
    assert network.n_bonds == [sides if kind == ContactKind.SIDE_TO_SIDE else 1]
    np.testing.assert_allclose(network.bonds.distance, 0.9, rtol=1e-14)
    sign = np.sign(network.bonds.normal @ (np.array(position[0]) - position[1]))
    assert np.all(sign == 1)  # into the first


def test_disc_that_touches_its_own_images():
    packing = make([[0.3, 0.3]], 0.0, half_length=0.0, edges=(0.9, 0.8))
    network = find_contacts(packing, 3.0)
    assert network.pairs.tolist() == [[0, 0], [0, 0]]
    assert network.shift.tolist() == [[0, 1], [1, 0]]
    found = sum_forces(packing, network)
    assert found.energy == pytest.approx(1.5 * (0.2**2 + 0.1**2))
    np.testing.assert_allclose(found.force, 0, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.virial, np.diag([0.9 * 0.3, 0.8 * 0.6]), rtol=1e-13, atol=0)
    assert not find_rattlers(packing, network)[0]
    assert coordination(packing, network) == (4, 4, 0, 2, 2)


def test_two_images_of_one_neighbour():
    network = find_contacts(make([[0.5, 0.5], [1.4, 0.5]], 0.0, 0.0, edges=(1.8, 9)))
    assert network.pairs.tolist() == [[0, 1], [0, 1]]
    assert network.shift.tolist() == [[-1, 0], [0, 0]]
    np.testing.assert_allclose(network.energy, 0.5 * 0.1**2, rtol=1e-13)


@pytest.mark.parametrize("sides", SIDES)
def test_side_to_side_counts_as_two_bonds(sides):
    rods = [[0.5, 5], [1.4, 5]]  # a rod between its neighbour's two flat sides
    packing = make([*rods, [1, 10], [1, 10.95]], np.pi / 2, edges=(1.8, 20.0))
    disc_pair = np.array([1.0, 1.0, 0.0, 0.0])
    packing = packing.with_(diameters=np.column_stack([2 * disc_pair + 1, np.ones(4), np.ones(4)]))
    network = find_contacts(packing, 1.0, sides)
    assert find_rattlers(packing, network).tolist() == [False, False, True, True]
    found = coordination(packing, network)
    assert found == (4, 2, 2, 4, 2)
    assert found.n_bonds == 2 * found.n_contacts


def test_rods_that_are_pressed_by_tips_on_one_side_are_rattlers():
    packing = make([[5, 5], [4.51, 6.9], [5.5, 6.9]], [0, np.pi / 2, np.pi / 2])
    network = find_contacts(packing)
    assert len(network.pairs) == 3
    assert find_rattlers(packing, network).all()


def test_cubic_crystal_of_one_sphere():
    unit = random_packing(1, 0.1, 1, monodisperse(0), dimension=3)
    packing = unit.with_(box=Box(lo=np.zeros(3), edges=np.full(3, 0.9)))
    network = find_contacts(packing)
    assert coordination(packing, network) == (6, 6, 0, 3, 3)
    assert sum_forces(packing, network).pressure == pytest.approx(0.1 / 0.9**2)


@pytest.mark.parametrize("dimension", [2, 3])
def test_without_contacts(dimension):
    packing = random_packing(10, 0.1, 1, dimension=dimension)
    network = find_contacts(packing, 1.0, 2)
    assert len(network.pairs) == len(network.bonds.contact) == 0
    found = sum_forces(packing, network)
    assert (found.energy, found.pressure) == (0, 0)
    assert not found.force.any()
    assert not found.torque.any()
    assert find_rattlers(packing, network).all()
    assert coordination(packing, network) == (0, 0, 10, 0, 0)


def test_refuses():
    crossing = make([[5, 5], [5.1, 5.1], [9, 9]], [0, np.pi / 2, 0], id=np.array([7, 3, 5]))
    with pytest.raises(
        ValueError, match="the spines of particles 7 and 3 cross, expected overlaps"
    ):
        find_contacts(crossing)
    own = make([[1, 1]], 0, half_length=4.0, edges=(2.2, 9))
    with pytest.raises(ValueError, match="spines of particles 1 and 1 cross"):
        find_contacts(own)
    apart = make([[5, 5]], 0.0)
    with pytest.raises(ValueError, match="sides is 3, expected 1 or 2"):
        find_contacts(apart, 1.0, 3)
    with pytest.raises(ValueError, match="k_e is -1"):
        find_contacts(apart, -1.0)
