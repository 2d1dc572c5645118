"""Energies, forces and pairs of every shape, without LAMMPS."""

import itertools
from functools import partial

import numpy as np
import pytest
from every_shape import (
    ALL,
    EPS,
    MIXTURES,
    SIDES,
    TYPICAL,
    apart,
    examples,
    in_a_small_box,
    kicked,
    laws,
    pressed,
    replicated,
    scattered,
    taken,
    turned_as_a_whole,
)
from slopes import assert_is_slope

from jamshape.contacts import (
    CrossingError,
    PairArrays,
    find_contacts,
    forces,
    near_pairs,
    sum_forces,
)
from jamshape.contacts.near import NearPairs, Spheres, each_once, near_particles
from jamshape.landscape import Landscape
from jamshape.packing import State
from jamshape.shapes.shape import Interaction

# Of the largest force and torque of a contact: a few hundred roundings.
ROUNDING = 1e-13

SCENES = [
    *(pytest.param((pressed, case), id=str(case)) for case in ALL),
    *(pytest.param((in_a_small_box, case), id=f"{case}-small") for case in (*TYPICAL, *MIXTURES)),
]


@pytest.fixture(scope="module", params=SCENES)
def packing(request):
    make, case = request.param
    return make(case)


@pytest.fixture
def network(packing):
    return find_contacts(packing, sides=SIDES)


def size_of(network):
    """Largest force and torque of a contact."""
    torques = np.abs([network.torque_i, network.torque_j]).max()
    return np.abs(network.force).max(), torques


def as_vectors(torque):
    return torque.reshape(len(torque), -1)


def directions(landscape, number=3, seed=5):
    """Of unit length in the largest coordinate."""
    vectors = np.random.default_rng(seed).normal(size=(number, landscape.size))
    return vectors / np.abs(vectors).max(axis=1, keepdims=True)


def step_of(landscape):
    """Of differences: so little of the smallest length on which energies depend."""
    turning = landscape.rotation_length[landscape.rotation_length > 0]
    return 2e-6 * float(np.min([landscape.inner_radius.min(), *turning]))


# --- slopes --------------------------------------------------------------------------------------


def test_the_gradient_is_the_slope_of_the_energy(packing, measured):
    landscape, state = Landscape(packing), State.of(packing)
    short, long = (landscape.evaluate(state, extended=extended) for extended in (False, True))
    h, size = step_of(landscape), np.abs(packing.position).max()

    def energy(s, direction):
        return landscape.evaluate(landscape.displaced(state, s * direction)).energy

    off = []
    for d in directions(landscape):
        scale = np.linalg.norm(d) * long.bond_force
        for here in (short, long):
            at = partial(energy, direction=d)
            off.append(assert_is_slope(here.gradient @ d, at, h, scale, size))
    measured(off=max(off), bonds=long.n_bonds)
    assert np.abs(long.gradient).max() > 1e-2 * long.bond_force
    assert long.n_bonds >= 3


def test_the_hessian_is_the_slope_of_the_gradient(packing, measured):
    landscape, state = Landscape(packing), State.of(packing)
    hessian, h = landscape.curvature(state, extended=True).hessian, step_of(landscape)
    scale, size = np.abs(hessian).max(), np.abs(packing.position).max()

    def gradient(s, direction):
        return landscape.evaluate(landscape.displaced(state, s * direction)).gradient

    def along(s, direction):
        return gradient(s, direction) @ direction

    off = []
    for d in directions(landscape):
        # Rotations in space do not commute: a slope along the direction itself does not see that.
        found, length = d @ hessian @ d, d @ d
        off.append(assert_is_slope(found, partial(along, direction=d), h, length * scale, size))
        shift = landscape.components(d)
        shift[:, packing.dimension :] = 0.0
        shift = landscape.coordinates(shift)
        vectors = partial(gradient, direction=shift)
        off.append(assert_is_slope(hessian @ shift, vectors, h, np.abs(shift).sum() * scale, size))
    measured(off=max(off))
    assert abs(hessian - hessian.T).max() <= ROUNDING * scale


def test_strain_derivatives_are_slopes(packing):
    landscape, state = Landscape(packing), State.of(packing)
    here, curvature, h = landscape.evaluate(state), landscape.curvature(state), 1e-6

    def at(s):
        return landscape.evaluate(state.strained(s))

    scale = abs(here.strain_gradient)
    assert_is_slope(here.strain_gradient, lambda s: at(s).energy, h, scale)
    stiff = abs(curvature.strain_hessian)
    assert_is_slope(curvature.strain_hessian, lambda s: at(s).strain_gradient / (1 + s), h, stiff)
    scale = np.abs(curvature.coupling).max()
    assert_is_slope(curvature.coupling, lambda s: at(s).gradient, h, scale)


def test_the_virial_is_the_slope_of_the_energy_along_each_axis(packing):
    landscape, state = Landscape(packing), State.of(packing)
    found = forces(packing, sides=SIDES)
    scale = np.abs(found.virial).max()
    assert np.trace(found.virial) / (packing.dimension * packing.box.volume) == pytest.approx(
        found.pressure, rel=4 * EPS
    )
    for axis in range(packing.dimension):

        def energy(s, axis=axis):
            factor = np.ones(packing.dimension, np.longdouble)
            factor[axis] += np.longdouble(s)
            there = State(factor * state.position, state.orientation, factor * state.edges)
            return landscape.evaluate(there).energy

        assert_is_slope(-found.virial[axis, axis], energy, 1e-6, scale)


# --- sums ----------------------------------------------------------------------------------------


def test_the_landscape_is_the_sum_of_the_contacts(packing, network):
    landscape, found = Landscape(packing), sum_forces(packing, network)
    here = landscape.evaluate(State.of(packing))
    components, D = landscape.components(here.gradient), packing.dimension
    force, torque = size_of(network)
    np.testing.assert_allclose(components[:, :D], -found.force, rtol=0, atol=ROUNDING * force)
    turned = components[:, D:] * landscape.rotation_length[:, None]
    turns = landscape.rotation_length > 0
    expected = -as_vectors(found.torque)[turns]
    np.testing.assert_allclose(turned[turns], expected, rtol=0, atol=ROUNDING * max(torque, force))
    assert here.energy == pytest.approx(found.energy, rel=ROUNDING)
    assert here.strain_gradient == pytest.approx(-np.trace(found.virial), rel=ROUNDING)
    assert here.n_bonds == network.n_bonds.sum()
    bond_force = np.linalg.norm(network.bonds.force, axis=1).mean()
    assert here.bond_force == pytest.approx(bond_force, rel=ROUNDING)


def test_long_doubles_agree_with_doubles(packing):
    landscape, state = Landscape(packing), State.of(packing)
    short, long = (landscape.evaluate(state, extended=extended) for extended in (False, True))
    assert short.energy == pytest.approx(long.energy, rel=ROUNDING)
    assert np.abs(short.gradient - long.gradient).max() <= ROUNDING * long.bond_force
    assert not np.array_equal(short.gradient, long.gradient)
    short, long = (landscape.curvature(state, extended=extended) for extended in (False, True))
    # Curvatures of contacts divide by the distance of the surfaces' feet, or by radii of curvature.
    scale = np.abs(long.hessian).max()
    assert abs(short.hessian - long.hessian).max() <= 10 * ROUNDING * scale


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
        assert network.n_bonds.max() <= packing.compiled().most_bonds
        force, torque = size_of(network)
        size = ROUNDING * max(force, torque)

        found = summed(bonds.force, bonds)
        np.testing.assert_allclose(found, network.force, rtol=0, atol=size)
        np.testing.assert_allclose(summed(bonds.energy, bonds), network.energy, rtol=ROUNDING)
        assert (network.energy > 0).all()
        assert (1 - bonds.distance / bonds.reach > 0).all()
        np.testing.assert_allclose(np.linalg.norm(bonds.normal, axis=1), 1, rtol=8 * EPS)
        assert ((bonds.force * bonds.normal).sum(axis=1) > 0).all()
        if sides != laws(packing)[0]:  # bonds that fade turn particles by more than their forces do
            continue
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
    network = find_contacts(packing, sides=SIDES)
    expected, found = sum_forces(packing, network), forces(changed, sides=SIDES)
    matrix = np.eye(packing.dimension) if matrix is None else matrix
    of_torque = matrix if packing.dimension == 3 else np.ones((1, 1))
    force, torque = size_of(network)
    # Positions are rounded to the size of the box; forces are stiff as k_e over lengths squared.
    away = np.abs(changed.position - packing.box.lo).max() / packing.compiled().inner_radius.min()
    size = ROUNDING * (1 + away) * max(force, torque)
    assert found.energy == pytest.approx(expected.energy, rel=ROUNDING * (1 + away))
    np.testing.assert_allclose(found.force, expected.force[rows] @ matrix.T, rtol=0, atol=size)
    wanted = as_vectors(expected.torque[rows]) @ of_torque.T
    np.testing.assert_allclose(as_vectors(found.torque), wanted, rtol=0, atol=size)
    return expected, found


def test_neither_order_nor_names_nor_places_in_the_box_matter(packing):
    rng = np.random.default_rng(1)
    rows = rng.permutation(packing.n)
    mixed = taken(packing, rows).with_(id=1 + 3 * rng.permutation(packing.n))
    assert_same_but_for_rounding(packing, mixed, rows)
    turns = rng.integers(-2, 3, packing.position.shape)
    wrapped = packing.with_(position=packing.position + turns * packing.box.edges)
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
    assert other.energy == pytest.approx(one.energy, rel=ROUNDING)
    D, size = packing.dimension, 10 * ROUNDING * one.bond_force
    gradients = [landscape.components(x.gradient)[:, :D] for x in (one, other)]
    np.testing.assert_allclose(*gradients, rtol=0, atol=size)


# --- pairs and periodic images -------------------------------------------------------------------


def test_boxes_side_by_side_are_one_packing(packing, network):
    times = 2
    one, many = forces(packing, sides=SIDES), forces(replicated(packing, times), sides=SIDES)
    copies = times**packing.dimension
    assert many.energy == pytest.approx(copies * one.energy, rel=10 * ROUNDING)
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
    around = Spheres(packing.position, packing.outer_radius + margin)
    return each_once(near_pairs(around, around, packing.box))


def rows_of(near):
    return set(map(tuple, np.column_stack([near.first, near.second, near.shift]).tolist()))


def all_images(packing):
    """Pairs and images near enough for bounding spheres to touch, found by trying all."""
    edges, reach = packing.box.edges, packing.outer_radius
    apart_by = packing.position[:, None] - packing.position
    whole = np.rint(apart_by / edges)
    found = set()
    most = np.ceil(2 * reach.max() / edges + 0.5).astype(int)
    for turn in itertools.product(*(range(-m, m + 1) for m in most)):
        shift = whole + turn
        distance = np.linalg.norm(apart_by - shift * edges, axis=2)
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


def test_every_contact_is_near(packing, network):
    bodies = packing.compiled()
    expected = rows_of(NearPairs(*network.pairs.T, network.shift))
    for margin in (0.0, 0.3 * bodies.inner_radius.min()):
        assert expected <= rows_of(near_particles(packing, bodies, margin))


def test_pairs_that_are_not_near_do_not_touch_when_moved_by_the_margin(packing):
    bodies, rng = packing.compiled(Interaction(1.0, SIDES)), np.random.default_rng(7)
    margin = 0.3 * float(bodies.inner_radius.min())
    near = rows_of(near_particles(packing, bodies, margin))
    every = every_pair(packing, margin)
    rows = np.column_stack([every.first, every.second, every.shift]).tolist()
    far = every.take(np.array([tuple(row) not in near for row in rows], bool))
    position, orientation, edges = State.of(packing).split
    apart_by = packing.position[far.first] - packing.position[far.second]
    apart_by -= far.shift * packing.box.edges
    for _ in range(20):
        step = apart_by / np.linalg.norm(apart_by, axis=1, keepdims=True)
        step += rng.normal(size=step.shape)
        step *= 0.999 * margin / np.linalg.norm(step, axis=1, keepdims=True)
        for k in range(len(step)):
            moved = position.copy()
            moved[0, far.second[k]] += step[k]
            if far.first[k] == far.second[k]:
                continue
            arrays = PairArrays.of(State.joined(moved, orientation, edges), far.take(np.array([k])))
            assert not len(bodies.contacts(*arrays, False)["pair"])


# --- what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize("case", TYPICAL, ids=str)
def test_particles_at_one_place_are_named(case):
    packing = scattered(case, 4)
    position = packing.position.copy()
    position[2] = position[0]
    names = ("orientation", "diameters", "exponent")
    alike = {name: np.repeat(getattr(packing, name)[:1], 4, axis=0) for name in names}
    packing = packing.with_(position=position, id=np.array([7, 1, 3, 2]), **alike)
    sentence = f"the {packing.compiled().core} of particles 7 and 3 cross"
    with pytest.raises(CrossingError, match=sentence):
        find_contacts(packing)
    with pytest.raises(CrossingError, match=sentence):
        Landscape(packing).evaluate(State.of(packing))


def test_there_are_examples_of_round_particles_or_none_at_all():
    """What scenes there are is told by the shapes: at least one each."""
    assert {case.shape for case in ALL} == {case.shape for case in TYPICAL}
    assert all(len(examples(case.shape)) for case in TYPICAL)
