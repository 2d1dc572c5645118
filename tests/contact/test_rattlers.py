"""Rattlers of networks small enough to see through."""

from __future__ import annotations

import numpy as np
import pytest

from jamshape._contact import find_rattlers

UP, DOWN, LEFT, RIGHT = (0, 1, 0), (0, -1, 0), (-1, 0, 0), (1, 0, 0)
TIPS, FLATS, FLAT_OF_I, FLAT_OF_J = (False, False), (True, True), (True, False), (False, True)


def rattlers(n, contacts, dimension=2):
    """contacts: (i, j, normal into i, on flat part of each)."""
    pairs = np.array([c[:2] for c in contacts], dtype=np.int64).reshape(-1, 2)
    normals = np.array([c[2] for c in contacts], dtype=float).reshape(-1, 3)
    flat = np.array([c[3] for c in contacts], dtype=bool).reshape(-1, 2)
    found = find_rattlers(n, dimension, pairs, normals, flat)
    # Whoever reads the network in another order, or from the other particle, sees the same.
    rng = np.random.default_rng(0)
    for _ in range(5):
        order = rng.permutation(len(pairs))
        turned = rng.uniform(size=len(pairs)) < 0.5
        i_and_j = np.where(turned[:, None], pairs[:, ::-1], pairs)
        into_i = np.where(turned[:, None], -normals, normals)
        flats = np.where(turned[:, None], flat[:, ::-1], flat)
        again = find_rattlers(n, dimension, i_and_j[order], into_i[order], flats[order])
        assert np.array_equal(found, again)
    return found.tolist()


def backbone(first):
    """Four particles, every two in contact: three contacts each, no rattler among them."""
    return [(first + a, first + b, UP, TIPS) for a in range(4) for b in range(a)]


def test_backbone_has_none():
    assert rattlers(4, backbone(0)) == [False] * 4


def test_without_contacts_everything_rattles():
    assert rattlers(3, []) == [True] * 3
    assert rattlers(0, []) == []


def test_isolated_and_singly_touched_particles():
    assert rattlers(6, [*backbone(0), (4, 0, UP, TIPS)]) == [False] * 4 + [True] * 2


def test_chain_unravels_from_its_loose_end():
    """4 - 5 - 6 - 7, hanging on the backbone by 4: 7 has one contact, then 6, then 5, then 4."""
    chain = [(5, 4, UP, TIPS), (6, 5, UP, TIPS), (7, 6, UP, TIPS)]
    assert rattlers(8, [*backbone(0), (4, 0, UP, TIPS), *chain]) == [False] * 4 + [True] * 4


def test_bridge_of_tips_falls_out():
    """5 touches 4 and 6 at tips: two contacts that hold nothing; then 4 and 6 have one."""
    bridge = [(4, 0, UP, TIPS), (5, 4, UP, TIPS), (6, 5, UP, TIPS), (1, 6, UP, TIPS)]
    assert rattlers(7, [*backbone(0), *bridge]) == [False] * 4 + [True] * 3


def test_triangle_of_discs_rattles():
    triangle = [(0, 1, LEFT, TIPS), (1, 2, UP, TIPS), (2, 0, RIGHT, TIPS)]
    assert rattlers(3, triangle) == [True] * 3


def test_triangle_held_at_a_third_contact_each_stays():
    triangle = [(4, 5, LEFT, TIPS), (5, 6, UP, TIPS), (6, 4, RIGHT, TIPS)]
    held = [(4, 0, UP, TIPS), (5, 1, UP, TIPS), (6, 2, UP, TIPS)]
    assert rattlers(7, [*backbone(0), *triangle, *held]) == [False] * 7
    # Without one of the three the triangle goes corner by corner.
    assert rattlers(7, [*backbone(0), *triangle, *held[:2]]) == [False] * 4 + [True] * 3


def squeezed(normal_above, normal_below, flats_above, flats_below, dimension=2):
    """A particle between 0 and 1 of a backbone: is it a rattler?"""
    held = backbone(0) if dimension == 2 else everyone()
    n = 4 if dimension == 2 else 5
    contacts = [*held, (n, 0, normal_above, flats_above), (n, 1, normal_below, flats_below)]
    *others, it = rattlers(n + 1, contacts, dimension)
    assert others == [False] * n
    return it


def everyone():
    """Five particles, every two in contact at tips: four contacts each."""
    return [(a, b, UP, TIPS) for a in range(5) for b in range(a)]


def test_rod_between_opposite_flats_stays():
    assert not squeezed(DOWN, UP, FLAT_OF_I, FLAT_OF_I)
    assert not squeezed(DOWN, UP, FLATS, FLATS)
    tilted = np.array([np.sin(0.3), np.cos(0.3), 0.0])
    assert not squeezed(-tilted, tilted * (1.0 - 1e-9), FLAT_OF_I, FLATS)


@pytest.mark.parametrize(
    "held",
    [
        (UP, UP, FLAT_OF_I, FLAT_OF_I),  # the same side twice
        (LEFT, RIGHT, TIPS, TIPS),  # at its two tips
        (DOWN, UP, TIPS, FLAT_OF_I),  # one on the flat part, one at a tip
        (DOWN, UP, FLAT_OF_J, FLAT_OF_J),  # on the flat parts of the others
    ],
)
def test_rod_that_two_contacts_do_not_hold_rattles(held):
    assert squeezed(*held)


def test_rod_between_flats_falls_with_what_holds_it():
    """4 lies between 0 and 5, and 5 holds on to nothing else."""
    held = [(4, 0, DOWN, FLATS), (4, 5, UP, FLATS)]
    assert rattlers(6, [*backbone(0), *held]) == [False] * 4 + [True] * 2


def test_stack_of_flats_around_the_periodic_box_stays():
    """0 under 1 under 2 under 0: every rod lies between two opposite flats."""
    stack = [(0, 1, DOWN, FLATS), (1, 2, DOWN, FLATS), (2, 0, DOWN, FLATS)]
    assert rattlers(3, stack) == [False] * 3


def test_own_periodic_image_holds_from_both_sides():
    assert rattlers(1, [(0, 0, UP, FLATS)]) == [False]
    assert rattlers(1, [(0, 0, UP, TIPS)]) == [True]
    # With its image and one more contact: three supports.
    assert rattlers(5, [*backbone(0), (4, 4, UP, TIPS), (4, 0, LEFT, TIPS)]) == [False] * 5


def test_in_space_fewer_than_four_contacts_rattle():
    assert rattlers(5, everyone(), dimension=3) == [False] * 5
    three_more = [(5, b, UP, FLATS) for b in range(3)]
    assert rattlers(6, [*everyone(), *three_more], dimension=3) == [False] * 5 + [True]
    four_more = [(5, b, UP, TIPS) for b in range(4)]
    assert rattlers(6, [*everyone(), *four_more], dimension=3) == [False] * 6
    # Three contacts each: all of them go, which in the plane stay.
    assert rattlers(4, backbone(0), dimension=3) == [True] * 4


def test_in_space_a_particle_between_two_faces_stays():
    assert not squeezed(DOWN, UP, FLAT_OF_I, FLATS, dimension=3)
    third = [(5, 2, LEFT, TIPS)]
    faces = [(5, 0, DOWN, FLATS), (5, 1, UP, FLAT_OF_I)]
    assert rattlers(6, [*everyone(), *faces, *third], dimension=3) == [False] * 6
    # The same with the faces of the others, or of one alone, holds nothing.
    loose = [(5, 0, DOWN, FLATS), (5, 1, UP, FLAT_OF_J)]
    assert rattlers(6, [*everyone(), *loose, *third], dimension=3) == [False] * 5 + [True]


@pytest.mark.parametrize(
    "held",
    [
        (UP, UP, FLATS, FLATS),
        (DOWN, UP, TIPS, TIPS),
        (DOWN, UP, TIPS, FLATS),
        (UP, LEFT, FLATS, FLATS),
    ],
)
def test_in_space_other_pairs_of_contacts_hold_nothing(held):
    assert squeezed(*held, dimension=3)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_stack_of_faces_around_the_box_stays_in_any_dimension(dimension):
    stack = [(0, 1, DOWN, FLATS), (1, 2, DOWN, FLATS), (2, 0, DOWN, FLATS)]
    assert rattlers(3, stack, dimension) == [False] * 3
    assert rattlers(1, [(0, 0, UP, FLATS)], dimension) == [False]


def test_particles_that_do_not_exist_are_refused():
    with pytest.raises(ValueError, match="does not exist"):
        find_rattlers(2, 2, np.array([[0, 2]]), np.zeros((1, 3)), np.zeros((1, 2), dtype=bool))
