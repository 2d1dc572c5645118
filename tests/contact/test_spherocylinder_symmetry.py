"""Contacts against closed forms, and what must not change when a pair is seen another way."""

from __future__ import annotations

import numpy as np
import pytest
from reference_energy import Approach, fade_length
from spherocylinder_pairs import (
    APART,
    CROSSING,
    EPS,
    EVERY_CLASS,
    SHALLOW,
    SIDE_TO_SIDE,
    TIP_TO_SIDE,
    TIP_TO_TIP,
    TOUCHING,
    Pairs,
    concatenated,
    contacts,
    cross,
    disc_to_disc,
    disc_to_rod,
    force_scale,
    growth_of,
    least_whole_of,
    log_uniform,
    nearly_parallel,
    overlaps,
    parallel,
    placed,
    random_directions,
    random_perpendicular,
    row_dot,
    scaled,
    skew,
    tip_to_side,
    tip_to_tip,
    touching,
)

from jamshape import _contact

K_E = 1.7


# --- closed forms ------------------------------------------------------------------------------


def builders(dimension):
    """Contacts whose feet, normal and overlap are known, and what rounding may do to feet and normal."""
    n, low = 6000, 1e-14
    rng = np.random.default_rng([11, dimension])
    well_known = [
        (TIP_TO_TIP, tip_to_tip(rng, n, dimension, overlaps(rng, n, low))),
        (TIP_TO_SIDE, tip_to_side(rng, n, dimension, overlaps(rng, n, low))),
        # Tilted by more than |sin| = 1e-8, whatever their length.
        (TIP_TO_SIDE, nearly_parallel(rng, n, dimension, overlaps(rng, n, 1e-4), least_tilt=0.1)),
        (TIP_TO_TIP, disc_to_rod(rng, n, dimension, overlaps(rng, n, low), at_side=False)),
        (TIP_TO_SIDE, disc_to_rod(rng, n, dimension, overlaps(rng, n, low), at_side=True)),
        (TIP_TO_TIP, disc_to_disc(rng, n, dimension, overlaps(rng, n, low))),
        (SIDE_TO_SIDE, parallel(rng, n, dimension, overlaps(rng, n, low))[0]),
    ]
    for kind, pairs in well_known:
        yield kind, pairs, EPS * pairs.extent, EPS * pairs.extent / pairs.d
    if dimension == 3:
        sine = log_uniform(rng, 1e-6, 1.0, n)
        pairs = skew(rng, n, overlaps(rng, n, low), np.arcsin(sine))
        foot_rounding = EPS * (pairs.extent / sine + pairs.d / sine**2)
        yield SIDE_TO_SIDE, pairs, foot_rounding, EPS * (pairs.extent / pairs.d + 1.0 / sine)


@pytest.mark.parametrize("dimension", [2, 3])
def test_one_bond_is_the_contact_that_was_built(dimension, measured):
    """Overlaps from 1e-14: recovered to the rounding of the coordinates, and all that follows."""
    largest = {}
    for kind, every, *roundings in builders(dimension):
        rounding = EPS * every.extent / every.d
        result = contacts(every, 1, K_E)
        overlap = np.sqrt(2.0 * result["energy"] / K_E)
        worst = {"overlap": np.max(np.abs(overlap - every.overlap) / rounding)}
        touched = result["status"] == TOUCHING
        assert np.all(touched | (result["status"] == APART))
        assert np.all(touched[every.overlap > 4.0 * rounding])
        assert np.array_equal(result["n_bonds"], touched)

        # Feet that rounding may move over an end of a spine say nothing.
        shorter = np.minimum(every.A_i, every.A_j)
        known = touched & ((shorter == 0.0) | (roundings[0] < 1e-4 * shorter))
        pairs, foot_rounding, normal_rounding = every[known], *(x[known] for x in roundings)
        result = {name: x[known] for name, x in result.items()}
        assert len(pairs) > 1500
        assert np.mean(result["kind"] == kind) > 0.999

        size = np.linalg.norm(result["force"], axis=1)
        worst["force"] = np.max(np.abs(size * pairs.d / (K_E * overlap[known]) - 1.0) / EPS)
        direction = scaled(1.0 / size, result["force"])
        worst["normal"] = np.max(np.linalg.norm(direction - pairs.normal, axis=1) / normal_rounding)
        for name, foot, u, sign in (
            ("i", pairs.s, pairs.u_i, 1.0),
            ("j", pairs.t, pairs.u_j, -1.0),
        ):
            arm = scaled(1.0 / size, result[f"torque_{name}"])
            built = scaled(sign * foot, cross(u, pairs.normal))
            error = np.linalg.norm(arm - built, axis=1)
            worst[f"arm_{name}"] = np.max(error / (foot_rounding + np.abs(foot) * normal_rounding))
        for name, x in worst.items():
            largest[name] = max(x, largest.get(name, 0.0))
        assert max(worst.values()) < 4.0, (kind, worst)
    measured(**largest)


@pytest.mark.parametrize("dimension", [2, 3])
def test_parallel_rods_with_two_bonds_carry_the_same_at_both_ends(dimension, measured):
    rng = np.random.default_rng([12, dimension])
    pairs, half = parallel(rng, 12_000, dimension, overlaps(rng, 12_000, 1e-14), depth=SHALLOW)
    rounding = EPS * pairs.extent / pairs.d
    clear = (2.0 * half > 1.001 * least_whole_of(pairs)) & (pairs.overlap > 10.0 * rounding)
    pairs, half, rounding = pairs[clear], half[clear], rounding[clear]
    result = contacts(pairs, 2, K_E)
    assert len(pairs) > 6000
    assert np.all(result["kind"] == SIDE_TO_SIDE)
    assert np.all(result["n_bonds"] == 2)
    apart = np.linalg.norm(result["bond_arm_i"][:, 0] - result["bond_arm_i"][:, 1], axis=1)
    size = K_E * pairs.overlap / pairs.d
    force = np.linalg.norm(result["force"] - scaled(2.0 * size, pairs.normal), axis=1)
    arm = np.linalg.norm(result["torque_i"] - scaled(2.0 * size * pairs.s,
                                                     cross(pairs.u_i, pairs.normal)), axis=1)  # fmt: skip
    unit = 2.0 * K_E * rounding / pairs.d
    worst = {
        "energy": np.max(np.abs(np.sqrt(result["energy"] / K_E) - pairs.overlap) / rounding),
        "force": np.max(force / unit),
        "torque": np.max(arm / (unit * pairs.extent)),
        "length": np.max(np.abs(apart - 2.0 * half) / (EPS * pairs.extent)),
    }
    measured(**worst)
    assert max(worst.values()) < 4.0


@pytest.mark.parametrize("sides", [1, 2])
@pytest.mark.parametrize("dimension", [2, 3])
def test_discs_are_discs_to_the_last_bits(dimension, sides):
    rng = np.random.default_rng([13, dimension])
    pairs = disc_to_disc(rng, 10_000, dimension, overlaps(rng, 10_000, 1e-12))
    result = contacts(pairs, sides, K_E)
    distance = np.sqrt(row_dot(pairs.r, pairs.r))
    overlap = (pairs.d - distance) / pairs.d
    recovered = np.sqrt(2.0 * result["energy"] / K_E)
    np.testing.assert_allclose(recovered, overlap, rtol=4 * EPS, atol=2 * EPS)
    force = scaled(K_E * recovered / pairs.d / distance, pairs.r)
    np.testing.assert_allclose(result["force"], force, rtol=8 * EPS)
    assert not np.any(result["torque_i"])
    assert not np.any(result["torque_j"])
    # Their axes mean nothing.
    turned = pairs.replaced(u_i=random_directions(rng, len(pairs), dimension))
    assert np.array_equal(contacts(turned, sides, K_E)["force"], result["force"])


@pytest.mark.parametrize("dimension", [2, 3])
def test_rods_become_discs_continuously(dimension):
    """The spines are no further from the centres than A, so overlaps move by (A_i + A_j) / d.

    Two bonds are no more than 2^w of the larger, w falling with the overlaps in units of (A_min / d)^2:
    those of discs are one.
    """
    rng = np.random.default_rng([14, dimension])
    discs = disc_to_disc(rng, 4000, dimension, overlaps(rng, 4000))
    discs.u_i[::2] = discs.u_j[::2]
    as_discs = contacts(discs, 1, K_E)
    for alpha in (1e-2, 1e-4, 1e-6, 1e-9, 1e-300, 5e-324):
        rods = discs.replaced(A_i=alpha * discs.R_i, A_j=alpha * discs.R_j)
        result = contacts(rods, 1, K_E)
        change = np.sqrt(2.0 / K_E) * (np.sqrt(result["energy"]) - np.sqrt(as_discs["energy"]))
        assert np.all(np.abs(change) <= alpha * (1.0 + 1e-9) + 8.0 * EPS)
        torque = np.linalg.norm(result["torque_i"], axis=1)
        force = np.linalg.norm(result["force"], axis=1)
        assert np.all(torque <= force * rods.A_i * (1.0 + 1e-9))
        two = contacts(rods, 2, K_E)
        overlap = np.sqrt(2.0 / K_E * result["energy"])
        least_mean = np.maximum(overlap - alpha, 0.0)
        shorter = np.minimum(rods.A_i, rods.A_j)
        with np.errstate(divide="ignore", over="ignore"):
            growth = growth_of(np.minimum(least_mean / (shorter / rods.d) ** 2, 1e30))
        assert np.mean(growth > 16.0) > 0.5
        most = 2.0 ** (1.0 / np.sqrt(1.0 + growth**2)) * result["energy"]
        assert np.all(two["energy"] <= most * (1.0 + 4.0 * EPS))
        assert np.all(two["energy"] >= result["energy"] * (1.0 - 4.0 * EPS))
        assert all(np.all(np.isfinite(x)) for x in two.values())


def test_bonds_sum_to_the_contact_and_sit_where_the_surfaces_interpenetrate():
    for dimension, sides, kind in EVERY_CLASS:
        pairs = touching(dimension, sides, kind)
        result = contacts(pairs, sides, K_E)
        scale = force_scale(pairs, result, K_E)
        np.testing.assert_allclose(result["bond_energy"].sum(axis=1), result["energy"], rtol=1e-14)
        error = np.abs(result["bond_force"].sum(axis=1) - result["force"]).max(axis=1)
        assert np.all(error <= 4.0 * EPS * scale)
        second = result["n_bonds"] == 2
        assert not np.any(result["bond_energy"][~second, 1])

        one = ~second  # a fading bond carries torque besides its lever arm
        force, arm_i = result["force"][one], result["bond_arm_i"][one, 0]
        unit = (EPS * np.linalg.norm(force, axis=1) * pairs.extent[one])[:, None]
        assert np.all(np.abs(cross(arm_i, force) - result["torque_i"][one]) <= 8.0 * unit)
        arm_j = pairs.r[one] + arm_i
        assert np.all(np.abs(-cross(arm_j, force) - result["torque_j"][one]) <= 8.0 * unit)
        # R_i / d of the way from spine i to spine j.
        depth = pairs.R_i * result["bond_distance"][:, 0] / pairs.d
        on_spine = arm_i + scaled(depth[one], result["bond_normal"][one, 0])
        across = np.linalg.norm(cross(on_spine, pairs.u_i[one]), axis=1)
        assert np.all(across <= 16.0 * EPS * pairs.extent[one])


# --- symmetries --------------------------------------------------------------------------------


def every_pair(dimension, sides):
    classes = [c for c in EVERY_CLASS if c[:2] == (dimension, sides)]
    parts = [touching(*c)[:8000] for c in classes]
    rng = np.random.default_rng([15, dimension, sides])
    if sides == 1:
        parts.append(parallel(rng, 4000, dimension, overlaps(rng, 4000))[0])
    return concatenated(*parts)


def relative_rounding(pairs, sides, result):
    """Rounding of the force due to coordinates: in the overlap, and in the fade factor of a bond."""
    rounding = EPS * pairs.extent
    unit = rounding / (pairs.d * pairs.overlap)
    if sides == 2:
        length = fade_length(pairs)
        x = Approach(pairs)
        length = np.where(x.has_two & (x.by_steps < 1.0), length, np.inf)
        # The force of a fading bond is of order V_b / length, its derivative of V_b / length^2.
        unknown = 6.0 * result["energy"] * rounding / length**2
        # Within w of a, the two bonds change shares.
        shares = np.where(x.has_two & (x.exponent < 1.0), x.exponent, 1.0)
        unit = unit / shares + rounding / length + unknown / force_scale(pairs, result, K_E)
    return unit


def disagreement(pairs, sides, result, other):
    """Largest difference in energy, force and torques, in units of the rounding of each pair."""
    force = force_scale(pairs, result, K_E)
    differences = [
        np.abs(result["energy"] - other["energy"]) / result["energy"],
        np.linalg.norm(result["force"] - other["force"], axis=1) / force,
    ]
    for name in ("torque_i", "torque_j"):
        lever = pairs.extent + pairs.d
        differences.append(np.linalg.norm(result[name] - other[name], axis=1) / (force * lever))
    return np.max(np.max(differences, axis=0) / relative_rounding(pairs, sides, result))


EVERY_LAW = pytest.mark.parametrize(("dimension", "sides"), [(2, 1), (2, 2), (3, 1), (3, 2)])


@EVERY_LAW
def test_forces_and_torques_balance(dimension, sides, measured):
    """j carries the opposite force; both forces and torques leave no net torque on the pair."""
    pairs = every_pair(dimension, sides)
    result = contacts(pairs, sides, K_E)
    net = cross(pairs.r, result["force"]) + result["torque_i"] + result["torque_j"]
    force = np.linalg.norm(result["force"], axis=1)
    torque = np.linalg.norm(result["torque_i"], axis=1) + np.linalg.norm(result["torque_j"], axis=1)
    worst = np.linalg.norm(net, axis=1) / (EPS * (force * (pairs.extent + pairs.d) + torque))
    measured(net_torque_in_roundings=worst.max())
    assert worst.max() < 8.0


@EVERY_LAW
def test_exchanging_i_and_j(dimension, sides, measured):
    pairs = every_pair(dimension, sides)
    result, other = contacts(pairs, sides, K_E), contacts(pairs.swapped(), sides, K_E)
    assert np.array_equal(result["n_bonds"], other["n_bonds"])
    seen = {"energy": other["energy"], "force": -other["force"],
            "torque_i": other["torque_j"], "torque_j": other["torque_i"]}  # fmt: skip
    worst = disagreement(pairs, sides, result, seen)
    measured(in_roundings=worst)
    assert worst < 16.0


@EVERY_LAW
def test_rods_have_no_head(dimension, sides, measured):
    pairs = every_pair(dimension, sides)
    result = contacts(pairs, sides, K_E)
    for flipped in (
        {"u_i": -pairs.u_i},
        {"u_j": -pairs.u_j},
        {"u_i": -pairs.u_i, "u_j": -pairs.u_j},
    ):
        worst = disagreement(pairs, sides, result, contacts(pairs.replaced(**flipped), sides, K_E))
        measured(in_roundings=worst)
        assert worst < 16.0


@EVERY_LAW
def test_rotation_and_reflection_of_the_whole(dimension, sides, measured):
    pairs = every_pair(dimension, sides)
    result = contacts(pairs, sides, K_E)
    rng = np.random.default_rng([16, dimension])
    rotation, _ = np.linalg.qr(rng.normal(size=(dimension, dimension)))
    for Q in (rotation, -rotation if dimension == 3 else rotation @ np.diag([1.0, -1.0])):
        seen = contacts(
            pairs.replaced(r=pairs.r @ Q.T, u_i=pairs.u_i @ Q.T, u_j=pairs.u_j @ Q.T), sides, K_E
        )
        spin = np.linalg.det(Q) * (Q if dimension == 3 else np.eye(1))  # torques are axial
        back = {"energy": seen["energy"], "force": seen["force"] @ Q,
                "torque_i": seen["torque_i"] @ spin, "torque_j": seen["torque_j"] @ spin}  # fmt: skip
        worst = disagreement(pairs, sides, result, back)
        measured(**{"rotated" if np.linalg.det(Q) > 0 else "reflected": worst})
        assert worst < 32.0


@EVERY_LAW
def test_translation_and_unit_of_length(dimension, sides, measured):
    pairs = every_pair(dimension, sides)
    result = contacts(pairs, sides, K_E)
    # Where the coordinates of i and j are far larger than their difference, that is what rounds.
    centre_j = np.round(40.0 * random_directions(np.random.default_rng(17), len(pairs), dimension))
    shifted = pairs.replaced(r=(centre_j + pairs.r) - centre_j)
    moved = _contact.spherocylinder_contacts(*shifted.bodies(centre_j), K_E, sides)
    for name, x in contacts(shifted, sides, K_E).items():
        assert np.array_equal(moved[name], x), name

    unit = 3.0
    scaled_up = Pairs(unit * pairs.r, pairs.u_i, pairs.u_j, unit * pairs.A_i, unit * pairs.A_j,
                      unit * pairs.R_i, unit * pairs.R_j)  # fmt: skip
    other = contacts(scaled_up, sides, K_E)
    worst = disagreement(pairs, sides, result, other | {"force": unit * other["force"]})
    measured(unit_in_roundings=worst)
    assert worst < 16.0


@pytest.mark.parametrize("sides", [1, 2])
def test_the_plane_in_space_is_the_plane(sides, measured):
    pairs = every_pair(2, sides)
    flat = {name: np.column_stack([x, np.zeros(len(pairs))])
            for name, x in (("r", pairs.r), ("u_i", pairs.u_i), ("u_j", pairs.u_j))}  # fmt: skip
    result, space = contacts(pairs, sides, K_E), contacts(pairs.replaced(**flat), sides, K_E)
    assert not np.any(space["force"][:, 2])
    for name in ("torque_i", "torque_j"):
        assert not np.any(space[name][:, :2])
    assert np.array_equal(result["kind"], space["kind"])
    seen = {"energy": space["energy"], "force": space["force"][:, :2],
            "torque_i": space["torque_i"][:, 2:], "torque_j": space["torque_j"][:, 2:]}  # fmt: skip
    worst = disagreement(pairs, sides, result, seen)
    measured(in_roundings=worst)
    assert worst < 16.0


# --- states without a contact ------------------------------------------------------------------


@pytest.mark.parametrize("sides", [1, 2])
def test_spines_that_cross_are_reported_however_far_their_tips(sides):
    rng = np.random.default_rng(18)
    n = 5000
    u_j = random_directions(rng, n, 2)
    angle = rng.uniform(0.01, np.pi - 0.01, n)
    u_i = scaled(np.cos(angle), u_j) + scaled(np.sin(angle), random_perpendicular(rng, u_j))
    R_i, R_j = rng.uniform(0.5, 5.0, n), rng.uniform(0.5, 5.0, n)
    A_i, A_j = R_i * log_uniform(rng, 0.01, 100.0, n), R_j * log_uniform(rng, 0.01, 100.0, n)
    s, t = 0.99 * A_i * rng.uniform(-1.0, 1.0, n), 0.99 * A_j * rng.uniform(-1.0, 1.0, n)
    pairs = placed((A_i, A_j, R_i, R_j), u_i, u_j, s, t, np.zeros((n, 2)), np.ones(n))
    result = contacts(pairs, sides)
    assert np.all(result["status"] == CROSSING)
    assert not any(np.any(x) for name, x in result.items() if name != "status")
    assert not np.any(_contact.spine_distances(*pairs.bodies()))


@pytest.mark.parametrize("dimension", [2, 3])
def test_coincident_feet_have_no_normal_and_are_reported(dimension):
    u = np.eye(dimension)[:1]
    one, zero = np.ones(1), np.zeros(1)
    discs = Pairs(np.zeros((1, dimension)), u, u, zero, zero, one, one)
    assert contacts(discs, 1)["status"] == CROSSING
    on_the_spine = Pairs(0.5 * u, u, u, zero, one, one, one)
    assert contacts(on_the_spine, 2)["status"] == CROSSING


@pytest.mark.parametrize("dimension", [2, 3])
def test_surfaces_just_apart_do_not_touch(dimension):
    rng = np.random.default_rng([19, dimension])
    gap = -log_uniform(rng, 1e-9, 1.0, 4000)
    for build in (tip_to_tip, tip_to_side):
        pairs = build(rng, 4000, dimension, gap)
        for sides in (1, 2):
            result = contacts(pairs, sides)
            assert np.all(result["status"] == APART)
            assert not any(np.any(x) for x in result.values())
