import numpy as np
import pytest
from mixtures import bidisperse
from rods_at import rods

from common.contact_angles import angle_density, angle_edges, contact_angles
from common.contact_classes import class_fractions, flat_contacts, flat_fraction
from common.offset_power_law import fit_offset_power_law
from jamshape.contacts import find_contacts, sum_forces
from jamshape.measures.contact_statistics import (
    ContactScale,
    contact_scale,
    held_contacts,
    residuals,
)
from jamshape.packing import Box
from jamshape.protocols.random_start import random_packing

R_SPINE = 0.99  # distance of touching spines; the surfaces would touch at 1
FORCE = 0.01  # of one bond at that distance, with k_e = 1
SURFACE = R_SPINE / 2  # where the point of contact is, from the spine


# Each a pair: the tip of a rod on the side of another, 0.4 off its middle; two tips; two sides, one
# 0.6 further along. The second one is across the edge of the box.
ON_SIDE = [[[10, 10], [10.4, 11 + R_SPINE]], [0, np.pi / 2]]
TIPS = [[[59.5, 30], [1.5 + R_SPINE, 30]], [0, np.pi]]
SIDES = [[[30, 50], [30.6, 50 - R_SPINE]], [0, np.pi]]


def of(*pairs):
    return rods(*(np.concatenate(values) for values in zip(*pairs, strict=True)))


def none(packing):
    return np.zeros(packing.n, bool)


def squeezed(alpha, n=40, seed=7):
    """A random packing squeezed until there are more contacts than particles, with all classes."""
    packing = random_packing(n, 0.45, seed, bidisperse(alpha))
    while len(find_contacts(packing, sides=2).pairs) <= n:
        box = Box(packing.box.lo, 0.99 * packing.box.edges)
        packing = packing.with_(position=0.99 * packing.position, box=box)
    return packing


@pytest.fixture(scope="module", params=[0.3, 1.0, 2.0])
def packing(request):
    return squeezed(request.param)


def some(packing):
    """A few particles that may pass for rattlers, as these are the caller's to choose."""
    return packing.id % 7 == 0


@pytest.mark.parametrize("sides", [1, 2])
def test_classes_count_bonds_and_a_side_twice(sides):
    packing = of(ON_SIDE, TIPS, SIDES)
    network = find_contacts(packing, sides=sides)
    assert class_fractions(network, none(packing)) == (0.25, 0.25, 0.5)
    on_side = np.array([True, True, False, False, False, False])
    assert class_fractions(network, on_side) == pytest.approx((1 / 3, 0, 2 / 3))


def test_flat_contacts_of_backbone_and_of_all():
    packing = of(ON_SIDE, TIPS, SIDES)
    network, nothing = find_contacts(packing, sides=2), none(packing)
    assert flat_contacts(network, nothing).tolist() == [True, False, False, False, True, True]
    assert flat_fraction(network, nothing) == pytest.approx((3 / 6, 3 / 6))
    one_tip = nothing | (np.arange(6) == 1)  # then the first rod has no contact that is held
    assert flat_fraction(network, one_tip) == pytest.approx((2 / 5, 2 / 6))


@pytest.mark.parametrize("sides", [1, 2])
def test_angles_of_known_contacts(sides):
    packing = of(ON_SIDE, TIPS, SIDES)
    angles = contact_angles(packing, find_contacts(packing, sides=sides), none(packing))
    first, second = angles.reshape(2, 3)
    middle = np.arctan2(SURFACE, 0.3)
    np.testing.assert_allclose(first, [np.arctan2(SURFACE, 0.4), 0, middle], atol=1e-12)
    np.testing.assert_allclose(second, [0, 0, middle], atol=1e-12)


def test_angles_of_contacts_with_own_images():
    lone = rods([[1, 1]], [0]).with_(box=Box(lo=np.zeros(2), edges=np.array([9.0, R_SPINE])))
    angles = contact_angles(lone, find_contacts(lone, sides=2), none(lone))
    np.testing.assert_allclose(angles, [np.pi / 2] * 2, atol=1e-12)


def test_scale_is_the_mean_over_bonds_and_over_their_ends():
    packing = of(ON_SIDE)
    scale = contact_scale(packing, find_contacts(packing, sides=2), none(packing))
    assert scale == pytest.approx((FORCE, FORCE * (0.4 + 0) / 2))
    packing = of(SIDES)  # bonds 0.4 and 1 off the middle of either
    scale = contact_scale(packing, find_contacts(packing, sides=2), none(packing))
    assert scale == pytest.approx((FORCE, FORCE * (0.4 + 1) / 2))
    both = of(ON_SIDE, SIDES)
    scale = contact_scale(both, find_contacts(both, sides=2), none(both))
    assert scale == pytest.approx((FORCE, FORCE * (2 * 1.4 + 0.4) / 6))


def test_scale_of_single_bonds_is_that_of_forces_and_torques_of_contacts(packing):
    network, rattlers = find_contacts(packing, sides=1), some(packing)
    held = ~rattlers[network.pairs].any(axis=1)
    zN = 2 * np.count_nonzero(held)
    torques = np.abs(network.torque_i[held]).sum() + np.abs(network.torque_j[held]).sum()
    scale = contact_scale(packing, network, rattlers)
    assert scale.force == pytest.approx(2 / zN * np.linalg.norm(network.force[held], axis=1).sum())
    assert scale.torque == pytest.approx(torques / zN, rel=1e-9)


def test_residuals_are_over_the_scale_and_unknown_for_rattlers():
    packing = of(ON_SIDE)
    network = find_contacts(packing, sides=2)
    scale, net = contact_scale(packing, network, none(packing)), sum_forces(packing, network)
    found = residuals(net.force, net.torque, scale, none(packing))
    np.testing.assert_allclose(found.force, [1, 1])
    np.testing.assert_allclose(found.torque, [2, 0], atol=1e-12)
    found = residuals(net.force, net.torque, scale, np.array([False, True]))
    np.testing.assert_array_equal(np.isnan(found), [[False, True]] * 2)
    with pytest.raises(ValueError, match=r"expected \(2, 2\) and \(2,\)"):
        residuals(net.force[:, 0], net.torque, scale, none(packing))


def test_discs_have_tips_and_no_torques():
    discs = rods([[1, 1], [1 + R_SPINE, 1], [1, 1 + R_SPINE]], [0.3, 2, 1], half_length=0)
    network, nothing = find_contacts(discs, sides=2), none(discs)
    assert class_fractions(network, nothing) == (1, 0, 0)
    assert flat_fraction(network, nothing) == (0, 0)
    scale = contact_scale(discs, network, nothing)
    assert scale == (pytest.approx(FORCE), 0)
    net = sum_forces(discs, network)
    found = residuals(net.force, net.torque, scale, nothing)
    assert np.isnan(found.torque).all()
    np.testing.assert_allclose(found.force, [np.sqrt(2), 1, 1])


def changed(packing):
    """The same packing told differently, and the order of its particles in it."""
    rng = np.random.default_rng(5)
    order = rng.permutation(packing.n)
    shift = rng.uniform(-9, 9, 2)
    images = rng.integers(-2, 3, (packing.n, 2)) * packing.box.edges
    heads = packing.orientation + np.pi * rng.integers(0, 2, packing.n)
    mirror = np.array([1, -1])
    names = ("orientation", "position", "diameters", "species", "id")
    told = {
        "moved": packing.with_(position=packing.position + shift),
        "images": packing.with_(position=packing.position + images),
        "heads": packing.with_(orientation=heads),
        "mirrored": packing.with_(
            position=packing.position * mirror, orientation=-packing.orientation
        ),
        "relabelled": packing.with_(**{name: getattr(packing, name)[order] for name in names}),
    }
    return {
        name: (other, order if name == "relabelled" else np.arange(packing.n))
        for name, other in told.items()
    }


@pytest.mark.parametrize("how", ["moved", "images", "heads", "mirrored", "relabelled"])
def test_statistics_do_not_depend_on_how_a_packing_is_told(packing, how):
    other, order = changed(packing)[how]
    networks = [find_contacts(p, sides=2) for p in (packing, other)]
    rattlers = some(packing)
    known = list(zip((packing, other), networks, (rattlers, rattlers[order]), strict=True))
    one, two = (class_fractions(network, r) for _, network, r in known)
    assert one == two
    assert sum(one) == pytest.approx(1)
    assert min(one) > 0
    one, two = (flat_contacts(network, r) for _, network, r in known)
    np.testing.assert_array_equal(one[order], two)
    one, two = (np.sort(contact_angles(*args)) for args in known)
    np.testing.assert_allclose(one, two, atol=1e-9)
    assert len(one) == 2 * np.count_nonzero(held_contacts(networks[0], rattlers))
    one, two = (contact_scale(*args) for args in known)
    assert one == pytest.approx(two, rel=1e-9)


def test_density_is_symmetric_and_integrates_to_1(packing):
    network = find_contacts(packing, sides=2)
    angles = contact_angles(packing, network, some(packing))
    edges, density = angle_density(angles, angle_edges(angles))
    assert (edges[0], edges[-1]) == (0, pytest.approx(np.pi))
    assert (np.diff(edges) > 0).all()
    assert (density * np.diff(edges)).sum() == pytest.approx(1, rel=1e-12)
    np.testing.assert_array_equal(density, density[::-1])
    np.testing.assert_allclose(edges, np.pi - edges[::-1], atol=1e-15)


def test_density_of_equally_likely_angles_is_flat():
    angles = np.random.default_rng(1).uniform(0, np.pi / 2, 200_000)
    density = angle_density(angles, angle_edges(angles)).density
    assert len(density) == 60, "no bin is cut in two by chance"
    np.testing.assert_allclose(density, 1 / np.pi, rtol=0.06)


def test_density_resolves_a_narrow_peak_and_keeps_wide_bins_elsewhere():
    rng, width = np.random.default_rng(2), np.radians(0.3)
    peak = np.pi / 2 - rng.uniform(0, width, 8000)
    angles = np.concatenate([rng.uniform(0, np.pi / 2, 12_000), peak])
    edges, density = angle_density(angles, angle_edges(angles))
    bins = np.diff(edges)
    height = 0.4 / (2 * width) + 0.6 / np.pi
    assert density.max() == pytest.approx(height, rel=0.1)
    assert bins.min() < width / 3
    assert np.median(bins[edges[1:] < 1.4]) == pytest.approx(np.radians(3))
    exact = np.sort(np.append(angles, np.pi / 2))  # the edge itself belongs to the last bin
    assert angle_density(exact, edges[: len(edges) // 2 + 1]).density[-1] > 0


def test_density_of_all_contacts_at_one_angle():
    edges = angle_edges(np.full(100, np.pi / 2))
    density = angle_density(np.full(100, np.pi / 2), edges).density
    assert np.degrees(np.diff(edges).min()) == pytest.approx(3 / 2**6)
    assert np.count_nonzero(density) == 2
    with pytest.raises(ValueError, match="expected at least one"):
        angle_edges(np.empty(0))
    with pytest.raises(ValueError, match="expected all"):
        angle_density(np.array([2.0]), edges)


def test_fit_recovers_the_law():
    alpha = np.array([0.003, 0.01, 0.03, 0.1])
    law = fit_offset_power_law(alpha, 0.31 + 2.7 * alpha**0.68)
    assert law[:3] == pytest.approx((0.31, 2.7, 0.68), rel=1e-5)
    assert max(law[3:]) < 1e-3
    np.testing.assert_allclose(law.at(alpha), 0.31 + 2.7 * alpha**0.68)
    assert np.isnan(fit_offset_power_law(alpha[:3], law.at(alpha[:3]))[3:]).all()


def test_errors_of_the_fit_are_those_of_repeated_fits():
    rng, alpha = np.random.default_rng(4), np.array([0.003, 0.01, 0.03, 0.1])
    sigma = np.full(4, 0.005)
    laws = [
        fit_offset_power_law(alpha, 0.31 + 2.7 * alpha**0.68 + sigma * rng.normal(size=4), sigma)
        for _ in range(60)
    ]
    spread, told = np.std(laws, axis=0)[:3], np.mean(laws, axis=0)[3:]
    np.testing.assert_allclose(spread, told, rtol=0.35)


def test_what_cannot_be_fitted_is_said():
    alpha = np.array([0.003, 0.01, 0.03, 0.1])
    with pytest.raises(ValueError, match="2 different alpha, expected"):
        fit_offset_power_law([0.1, 0.1, 0.2], [1, 2, 3])
    with pytest.raises(ValueError, match="out of range"):
        fit_offset_power_law([0.0, 0.1, 0.2], [1, 2, 3])
    with pytest.raises(ValueError, match="out of range"):
        fit_offset_power_law(alpha, np.ones(4), np.zeros(4))
    for values in (np.log(alpha), np.exp(150 * alpha)):
        with pytest.raises(ValueError, match="no exponent"):
            fit_offset_power_law(alpha, values)


def test_packings_that_do_not_touch_and_space_are_refused():
    packing = of(ON_SIDE)
    network, everything = find_contacts(packing, sides=2), np.ones(2, bool)
    for count in (class_fractions, flat_contacts, flat_fraction):
        with pytest.raises(ValueError, match="expected a jammed packing"):
            count(network, everything)
    space = random_packing(2, 0.1, 1, dimension=3)
    network, nothing = find_contacts(space), none(space)
    with pytest.raises(ValueError, match="in 3 dimensions, expected 2"):
        class_fractions(network, nothing)
    for count in (contact_angles, contact_scale):
        with pytest.raises(ValueError, match="in 3 dimensions, expected 2"):
            count(space, network, nothing)


def test_residuals_of_nothing_are_nothing():
    found = residuals(np.zeros((3, 2)), np.zeros(3), ContactScale(1.0, 1.0), np.zeros(3, bool))
    assert not np.any(found)
