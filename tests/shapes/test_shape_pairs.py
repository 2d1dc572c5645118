"""Pairs of particles of every shape that may touch, with all periodic images."""

import itertools

import numpy as np
from every_shape import (
    ROUNDING,
    SIDES,
    as_vectors,
    close_to,
    replicated,
    size_of,
)

from jamshape.contacts import (
    PairArrays,
    forces,
)
from jamshape.contacts.near import NearPairs, near_particles, near_spheres
from jamshape.packing import State
from jamshape.shapes.shape import Interaction


def test_boxes_side_by_side_are_one_packing(packing, network):
    times = 2
    one, many = forces(packing, sides=SIDES), forces(replicated(packing, times), sides=SIDES)
    copies = times**packing.dimension
    assert many.energy == close_to(copies * one.energy, 10 * ROUNDING)
    force, torque = size_of(network)
    size = 10 * ROUNDING * max(force, torque)
    np.testing.assert_allclose(many.force, np.tile(one.force, (copies, 1)), rtol=0, atol=size)
    alone = np.isin(np.arange(packing.n), network.pairs[network.pairs[:, 0] == network.pairs[:, 1]])
    # Images of the particle itself are at the kink of a bond that fades.
    other = np.tile(~alone, copies)
    expected = np.tile(as_vectors(one.torque), (copies, 1))
    np.testing.assert_allclose(as_vectors(many.torque)[other], expected[other], rtol=0, atol=size)
    np.testing.assert_allclose(many.pressure, one.pressure, rtol=10 * ROUNDING)


def every_pair(packing, margin=0.0):
    """All pairs with all images whose bounding spheres are closer than a margin."""
    return near_spheres(packing.position, packing.outer_radius + margin, packing.box)


def rows_of(near):
    return set(map(tuple, np.column_stack([near.first, near.second, near.shift]).tolist()))


def all_images(packing):
    """Pairs and images near enough for bounding spheres to touch, found by trying all."""
    box, reach = packing.box, packing.outer_radius
    apart_by = packing.position[:, None] - packing.position
    whole = np.rint(box.fractions(apart_by))
    found = set()
    # Across the box, where it is narrowest, and half of it along each edge.
    most = np.ceil(2 * reach.max() / box.spacings + 0.5).astype(int)
    for turn in itertools.product(*(range(-m, m + 1) for m in most)):
        shift = whole + turn
        distance = np.linalg.norm(apart_by - shift @ box.matrix.T, axis=2)
        i, j = np.nonzero(distance < reach[:, None] + reach)
        found |= set(map(tuple, np.column_stack([i, j, shift[i, j].astype(int)]).tolist()))
    zero = (0,) * packing.dimension
    return {row for row in found if row[0] < row[1] or (row[0] == row[1] and row[2:] > zero)}


def test_pairs_of_bounding_spheres_are_those_of_all_images(packing):
    assert rows_of(every_pair(packing)) == all_images(packing)


def contacts_among(packing, near):
    bodies, state = packing.compiled(Interaction(1.0, SIDES)), State.of(packing)
    return near.take(bodies.contacts(*PairArrays.of(state, near), False)["pair"])


def test_contacts_are_those_of_all_pairs_and_hard_particles_overlap_there(packing, network):
    near = every_pair(packing)
    expected = rows_of(NearPairs(*network.pairs.T, network.shift))
    assert rows_of(contacts_among(packing, near)) == expected
    bodies, state = packing.compiled(), State.of(packing)
    overlaps = bodies.overlaps(*PairArrays.of(state, near))
    assert rows_of(near.take(overlaps)) == expected
    assert len(expected) >= packing.n


def test_every_contact_is_near(packing):
    bodies = packing.compiled()
    expected = rows_of(contacts_among(packing, every_pair(packing)))
    for margin in (0.0, 0.3 * bodies.inner_radius.min()):
        assert expected <= rows_of(near_particles(State.of(packing), bodies, margin))


def test_pairs_that_are_not_near_do_not_touch_when_moved_by_the_margin(packing):
    bodies, rng = packing.compiled(Interaction(1.0, SIDES)), np.random.default_rng(7)
    margin = 0.3 * float(bodies.inner_radius.min())
    near = rows_of(near_particles(State.of(packing), bodies, margin))
    every = every_pair(packing, margin)
    rows = np.column_stack([every.first, every.second, every.shift]).tolist()
    far = every.take(np.array([tuple(row) not in near for row in rows], bool))
    position, orientation, cell = State.of(packing).split
    apart_by = packing.position[far.first] - packing.position[far.second]
    apart_by -= far.shift @ packing.box.matrix.T
    for _ in range(20):
        step = apart_by / np.linalg.norm(apart_by, axis=1, keepdims=True)
        step += rng.normal(size=step.shape)
        step *= 0.999 * margin / np.linalg.norm(step, axis=1, keepdims=True)
        for k in range(len(step)):
            moved = position.copy()
            moved[0, far.second[k]] += step[k]
            if far.first[k] == far.second[k]:
                continue
            arrays = PairArrays.of(State.joined(moved, orientation, cell), far.take(np.array([k])))
            assert not len(bodies.contacts(*arrays, False)["pair"])
