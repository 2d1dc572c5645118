"""Pairs and contacts of superellipsoids in packings; derivatives are in test_landscape and test_hessian."""

import itertools

import numpy as np
import pytest
from body_rows import superellipsoid_rows
from scenes import assert_same_forces, moved, turned
from superellipsoid_packings import (
    ellipsoids,
    octahedra_and_boxes,
    pressed_superellipsoids,
    scattered,
    superellipses,
)

from jamshape import _contact
from jamshape.contacts import find_contacts, forces
from jamshape.contacts.near import near_particles
from jamshape.landscape import CrossingError, Landscape, State
from jamshape.shapes.roundness import volume


def two_in_a_tiny_box():
    """Longer than the box: they touch their own images, and each other from several sides."""
    packing = scattered(np.array([[0.5, 0.6, 3.0]] * 2), np.array([1.0, 1.5]), 0.2)
    state = State.of(packing)
    for _ in range(100):
        state = state.strained(-0.01)
        packing = state.packing(packing)
        shift = find_contacts(packing).shift
        if (shift != 0).any() and packing.box.edges[0] < 2.0:
            return packing.with_(position=np.asarray(packing.position))
    raise AssertionError


MADE = {
    "ellipsoids": ellipsoids,
    "octahedra and boxes": octahedra_and_boxes,
    "superellipses": superellipses,
    "two in a tiny box": two_in_a_tiny_box,
}


@pytest.fixture(params=MADE)
def packing(request):
    return MADE[request.param]()


def every_pair(packing):
    """Rows of all pairs and images that bounding spheres could let touch, and their labels."""
    D, rows, edges = packing.dimension, superellipsoid_rows(packing), packing.box.edges
    reach = 2 * packing.diameters.max() * D**0.5
    turns = [range(-m, m + 1) for m in np.ceil(reach / edges).astype(int)]
    labels, first, second = [], [], []
    for shift in itertools.product(*turns):
        for i, j in itertools.combinations_with_replacement(range(packing.n), 2):
            if i < j or shift > (0,) * D:
                image = rows[j].copy()
                image[:D] += shift * edges
                labels.append((i, j, *shift))
                first.append(rows[i])
                second.append(image)
    return np.array(labels), np.array(first), np.array(second)


def test_contacts_are_those_of_all_pairs_and_images(packing):
    labels, first, second = every_pair(packing)
    expected = labels[_contact.superellipsoid_overlap(first, second)].tolist()
    network = find_contacts(packing)
    assert np.column_stack([network.pairs, network.shift]).tolist() == sorted(expected)
    assert len(expected) >= packing.n / 2


def test_pairs_within_a_margin_are_all_found(packing):
    labels, first, second = every_pair(packing)
    larger = second.copy()
    near = near_particles(packing, packing.compiled(), 0.1)
    found = set(map(tuple, np.column_stack([near.first, near.second, near.shift]).tolist()))
    # Grown by 0.04 each, they overlap only if their surfaces are closer than 0.1.
    D = packing.dimension
    axes = slice(-1 - D, -1)
    first, larger = first.copy(), larger.copy()
    for rows in (first, larger):
        rows[:, axes] *= 1 + 0.04 / rows[:, axes].max(axis=1, keepdims=True)
    close = labels[_contact.superellipsoid_overlap(first, larger)]
    assert set(map(tuple, close.tolist())) <= found


def test_forces_and_torques_are_slopes_of_the_energy(packing):
    found, h = forces(packing, 2.5), 1e-6
    largest = np.linalg.norm(find_contacts(packing, 2.5).force, axis=1).max()
    torque = found.torque.reshape(packing.n, -1)
    for particle in range(0, packing.n, 3):
        for change, values in ((moved, found.force), (turned, torque)):
            for axis in range(values.shape[1]):
                ahead, behind = (
                    forces(change(packing, particle, axis, step), 2.5).energy for step in (h, -h)
                )
                slope = (behind - ahead) / (2 * h)
                assert values[particle, axis] == pytest.approx(slope, abs=1e-6 * largest)


def test_points_of_contact_give_the_torques(packing):
    network = find_contacts(packing)
    i, j = network.pairs.T
    arm_i = network.bonds.point - packing.position[i]
    arm_j = network.bonds.point - packing.position[j] - network.shift * packing.box.edges

    def torque(arm, force):
        if packing.dimension == 2:
            return arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]
        return np.cross(arm, force)

    np.testing.assert_allclose(torque(arm_i, network.force), network.torque_i, rtol=0, atol=1e-12)
    np.testing.assert_allclose(torque(arm_j, -network.force), network.torque_j, rtol=0, atol=1e-12)


def test_the_virial_is_that_of_the_scales(packing):
    # p V = (2 / D) sum eta^2 (1 - eta^2), since eta is of first degree in r.
    network = find_contacts(packing)
    overlap = 1 - network.bonds.distance / network.bonds.reach
    expected = 2 * (overlap * (1 - overlap)).sum() / (packing.dimension * packing.box.volume)
    assert forces(packing).pressure == pytest.approx(expected, rel=1e-10)


def test_translation_wrapping_and_order_change_nothing(packing):
    expected = forces(packing)
    rng = np.random.default_rng(1)
    turns = rng.integers(-3, 4, packing.position.shape)
    wrapped = packing.with_(position=packing.position + turns * packing.box.edges)
    assert_same_forces(forces(wrapped), expected)
    order = rng.permutation(packing.n)
    names = ("position", "orientation", "diameters", "exponent", "species", "id")
    mixed = forces(packing.with_(**{name: getattr(packing, name)[order] for name in names}))
    np.testing.assert_allclose(mixed.force, expected.force[order], rtol=0, atol=1e-12)


def test_packing_fraction_is_that_of_the_volumes():
    packing = octahedra_and_boxes()
    expected = volume(packing.diameters / 2, packing.exponent).sum() / packing.box.volume
    assert packing.phi == pytest.approx(expected, rel=1e-13)


def test_body_axes_are_those_of_the_quaternions():
    packing = ellipsoids()
    axes = np.stack([packing.body_axes(k) for k in range(3)], axis=1)
    np.testing.assert_allclose(
        axes @ axes.transpose(0, 2, 1), np.tile(np.eye(3), (12, 1, 1)), atol=1e-14
    )
    np.testing.assert_allclose(packing.body_axes(0), packing.axes, atol=1e-14)
    np.testing.assert_allclose(np.cross(axes[:, 0], axes[:, 1]), axes[:, 2], atol=1e-14)
    flat = superellipses()
    np.testing.assert_allclose((flat.body_axes(0) * flat.body_axes(1)).sum(axis=1), 0, atol=1e-15)


def test_spheroids_have_an_axis_that_nothing_turns_them_about():
    diameters = np.array([[1.0, 1, 3], [1, 2, 2], [2, 1, 2], [1, 2, 3], [1, 1, 1], [1, 1, 3]])
    packing = scattered(diameters, np.array([1.0, 1, 1, 1, 1, 2]), 0.1)
    assert packing.symmetry_axis.tolist()[:4] == [2, 0, 1, -1]
    assert packing.symmetry_axis[5] == -1  # its section is no circle
    assert packing.is_round.tolist() == [False] * 4 + [True, False]
    axes = packing.turning_axes
    assert (axes != 0).any(axis=2).sum(axis=1).tolist() == [2, 2, 2, 3, 2, 3]
    own = np.stack([packing.body_axes(k)[m] for m, k in enumerate((2, 0, 1))])
    np.testing.assert_allclose(np.einsum("nrt,nt->nr", axes[:3], own), 0, atol=1e-14)


def test_concentric_particles_are_named():
    packing = scattered(np.full((2, 3), [1.0, 1, 2]), np.ones(2), 0.05)
    packing = packing.with_(position=np.zeros((2, 3)), id=np.array([7, 3]))
    with pytest.raises(CrossingError, match="centres of particles 7 and 3 cross"):
        Landscape(packing).evaluate(State.of(packing))
    with pytest.raises(ValueError, match="centres of particles 7 and 3 cross"):
        find_contacts(packing)


def test_exponents_below_a_half_are_refused():
    with pytest.raises(ValueError, match=r"exponents hold 0.5, expected p > 0.5"):
        scattered(np.ones((2, 3)), np.array([1.0, 0.5]), 0.1)


def test_deep_overlaps_and_extreme_shapes_give_finite_forces():
    for p in (0.55, 10.0):
        diameters = np.array([[0.1, 1.0, 1.0], [1.0, 1.0, 10.0], [1.0, 1.0, 1.0]] * 4)
        packing = pressed_superellipsoids(diameters, np.full(12, p), 0.1)
        squeezed = State.of(packing).strained(-0.1).packing(packing)
        found = forces(squeezed)
        assert np.isfinite(found.force).all()
        assert np.isfinite(found.torque).all()
        assert found.energy > forces(packing).energy
