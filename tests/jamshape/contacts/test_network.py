import numpy as np
import pytest
from mixtures import monodisperse
from scenes import make, pressed, tiny_box

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

SIDES = [1, 2]


def test_tiny_box_has_own_images_and_several_images_of_a_neighbour():
    pairs = find_contacts(tiny_box()).pairs.tolist()
    assert pairs.count([0, 0]) == pairs.count([1, 1]) == 1
    assert pairs.count([0, 1]) > 2
    assert find_contacts(pressed(n=1, mixture=monodisperse(20), phi=0.3)).pairs[0].tolist() == [
        0,
        0,
    ]


@pytest.mark.parametrize("sides", SIDES)
def test_torques_keep_their_sign_when_turned_and_change_it_when_mirrored(sides):
    packing = pressed()
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
    np.testing.assert_array_equal(network.bonds.reach, 1.0)
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
    assert coordination(packing, network) == (4, 4, 4, 0, 2, 2, 0)


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
    assert found == (4, 2, 4, 2, 4, 2, 0)
    assert found.n_bonds == 2 * found.n_contacts


@pytest.mark.parametrize("sides", SIDES)
def test_bonds_that_bear_next_to_nothing_graze(sides):
    rods = make(
        [[0.5, 5], [1.3, 5]], np.pi / 2, edges=(1.8 - 1e-8, 20.0)
    )  # 0.8 apart, and nearly 1
    found = coordination(rods, find_contacts(rods, 1.0, sides))
    assert (found.z, found.z_bearing, found.n_bonds, found.n_grazing) == (4, 2, 4, 2)
    disc = make([[0.3, 0.3]], 0.0, half_length=0.0, edges=(0.9, 1 - 1e-5))
    assert coordination(disc, find_contacts(disc, 1.0, sides)).n_grazing == 0


def test_rods_that_are_pressed_by_tips_on_one_side_are_rattlers():
    packing = make([[5, 5], [4.51, 6.9], [5.5, 6.9]], [0, np.pi / 2, np.pi / 2])
    network = find_contacts(packing)
    assert len(network.pairs) == 3
    assert find_rattlers(packing, network).all()


def test_cubic_crystal_of_one_sphere():
    unit = random_packing(1, 0.1, 1, monodisperse(0), dimension=3)
    packing = unit.with_(box=Box(lo=np.zeros(3), edges=np.full(3, 0.9)))
    network = find_contacts(packing)
    assert coordination(packing, network) == (6, 6, 6, 0, 3, 3, 0)
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
    assert coordination(packing, network) == (0, 0, 0, 10, 0, 0, 0)


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
