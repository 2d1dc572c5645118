"""Second derivatives of each contact: against differences, closed forms and what is invariant."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from pair_packings import LONG, PairPacking
from reference_energy import (
    ENERGIES,
    LEAST_EXPONENT,
    Approach,
    branches,
    complex_step_gradient,
    fade_length,
    least_fade_length,
)
from spherocylinder_pairs import (
    EPS,
    SHALLOW,
    SIDE_TO_SIDE,
    SMALL_SINE,
    TIP_TO_SIDE,
    TIP_TO_TIP,
    Pairs,
    concatenated,
    cross,
    deep,
    disc_to_disc,
    disc_to_rod,
    least_whole,
    least_whole_of,
    nearly_parallel,
    overlaps,
    parallel,
    random_directions,
    scaled,
    skew,
    tip_to_side,
    tip_to_tip,
)
from thinned import in_turn

K_E = 1.7
ALPHA = 1e-3, 100.0
N = 200


# --- classes -----------------------------------------------------------------------------------


def tips(rng, dimension):
    return tip_to_tip(rng, N, dimension, overlaps(rng, N, 1e-4), ALPHA)


def tip_on_side(rng, dimension):
    return tip_to_side(rng, N, dimension, overlaps(rng, N, 1e-4), ALPHA)


def discs(rng, dimension):
    return disc_to_disc(rng, N, dimension, overlaps(rng, N, 1e-4))


def discs_and_rods(rng, dimension):
    overlap = overlaps(rng, N, 1e-4)
    return concatenated(*(disc_to_rod(rng, N, dimension, overlap, side) for side in (False, True)))


def crossed(rng, dimension):
    assert dimension == 3
    return skew(rng, N, overlaps(rng, N, 1e-4), rng.uniform(0.3, 0.5 * np.pi, N), ALPHA)


def two_bonds(rng, dimension):
    """Whole and fading by length, both nearly parallel."""
    overlap = overlaps(rng, 2 * N, 1e-4)
    return nearly_parallel(rng, 2 * N, dimension, overlap, (0.1, 100.0), depth=0.4)


def at_an_angle(rng, dimension):
    """Short rods whose second bond fades by the cosine."""
    return nearly_parallel(rng, 2 * N, dimension, overlaps(rng, 2 * N, 0.1), (0.3, 2.0), depth=2.0)


def parallel_in_the_plane(rng, dimension):
    """Pairs of all depths; in space the second derivatives by a twist have two sides."""
    assert dimension == 2
    pairs, half = parallel(rng, 2 * N, 2, overlaps(rng, 2 * N, 1e-4), (0.01, 100.0))
    return pairs[2.0 * half > 1.01 * least_whole_of(pairs)]


def becoming_one(rng, dimension):
    return deep(rng, 3 * N, dimension, overlaps(rng, 3 * N), depth=(0.5, 40.0))


def one_of_two(rng, dimension):
    return deep(rng, 2 * N, dimension, overlaps(rng, 2 * N), depth=(17.0, 1e4))


ONE_BOND = [tips, tip_on_side, discs, discs_and_rods, crossed]
TWO_BONDS = [two_bonds, at_an_angle, parallel_in_the_plane, becoming_one, one_of_two]
ONLY_IN = {crossed: 3, parallel_in_the_plane: 2}
CASES = [
    (case, dimension, sides)
    for case in ONE_BOND + TWO_BONDS
    for dimension in (2, 3)
    for sides in (1, 2)
    if ONLY_IN.get(case, dimension) == dimension and (case, sides) != (parallel_in_the_plane, 1)
]
EVERY_CASE = pytest.mark.parametrize(
    ("case", "dimension", "sides"), CASES, ids=[f"{c.__name__}-{d}-{s}" for c, d, s in CASES]
)


@cache
def packing_of(case, dimension):
    seed = [41, dimension, (ONE_BOND + TWO_BONDS).index(case)]
    rng = np.random.default_rng(seed)
    return PairPacking.of(rng, case(rng, dimension))


@cache
def found_in(case, dimension, sides, extended=True):
    packing = packing_of(case, dimension)
    found = packing.derivatives(sides, K_E, extended=extended)
    assert np.array_equal(found["pair"], np.arange(len(packing)))
    return found


def hessian(found):
    g = found["gradient"]
    coupled = np.einsum("cb,cbi->ci", found["coupling"], g)
    own = np.einsum("cb,cbi,cbj->cij", found["stiffness"], g, g)
    return own + coupled[:, :, None] * coupled[:, None, :] + found["curvature"]


# --- differences -------------------------------------------------------------------------------

MULTIPLES = np.array([1, 2, 3])
WEIGHTS = np.array([45, -9, 1]) / LONG(60)  # of the three pairs of a difference of sixth order
FRACTION = 3e-3  # of the least length or angle over which anything changes


def steps(packing, sides):
    """(n, M) by variable."""
    pairs = packing.plain()
    x = Approach(pairs)
    shorter = np.minimum(pairs.A_i, pairs.A_j)
    length = np.minimum(x.overlap * pairs.d, np.where(shorter > 0.0, shorter, pairs.d))
    if sides == 2:
        fading = (x.opposite > 0.0) & (x.by_steps < 1.0)
        length = np.where(fading, np.minimum(length, least_fade_length(pairs)), length)
        deep = x.has_two & (x.depth > SHALLOW)
        length = np.where(deep, np.minimum(length, SHALLOW * shorter**2 / pairs.d), length)
        # Within w of the overlaps the bonds change shares.
        least = x.exponent * np.minimum(x.overlap, x.far_overlap) * pairs.d
        length = np.where(x.has_two & (x.exponent < 1.0), np.minimum(length, least), length)
    angle = length / (np.maximum(pairs.A_i, pairs.A_j) + pairs.d)
    small = np.where(x.depth > 1.0, SMALL_SINE * shorter / pairs.d, angle)
    angle = np.minimum(angle, small)
    D, turns = packing.dimension, 2 * packing.rotations
    return FRACTION * np.array([length] * D + [angle] * turns)


def are_resolved(packing, h):
    """Whether long doubles of the coordinates are much finer than the steps."""
    return h[0] > 1e-8 * packing.plain().extent


def is_smooth_around(packing, h, sides):
    at_rest = branches(packing.plain(), sides)
    smooth = np.ones(len(packing), bool)
    for variable, step in enumerate(h):
        for multiple in (*MULTIPLES, *-MULTIPLES):
            moved = branches(packing.moved(variable, multiple * step).plain(), sides)
            smooth &= np.all(moved == at_rest, axis=1)
    return smooth


def differences(packing, function, h):
    """(M, ..., n) derivatives of a function of packings."""
    columns = []
    for variable, step in enumerate(h):
        total = 0
        for multiple, weight in zip(MULTIPLES, WEIGHTS, strict=True):
            ahead = function(packing.moved(variable, multiple * step))
            behind = function(packing.moved(variable, -multiple * step))
            total = total + weight * (ahead - behind)
        columns.append(total / step.reshape(-1, *[1] * (total.ndim - 1)))
    return np.stack(columns, axis=-1)


def commuted(raw, gradient, dimension):
    """The second derivatives, from derivatives by a rotation of derivatives by a rotation before.

    exp(s a) exp(t b) = exp(s a + t b + s t a x b / 2): the order adds half of gradient . (a x b).
    """
    result = np.array(raw)
    if dimension == 3:
        for first in (3, 6):
            block = slice(first, first + 3)
            g = gradient[:, block]
            for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                result[:, first + a, first + b] -= 0.5 * g[:, c]
                result[:, first + b, first + a] += 0.5 * g[:, c]
    return result


def levers(packing):
    """(M, n) length that a unit of each variable moves surfaces by."""
    pairs, turns = packing.plain(), packing.rotations
    one = np.ones((len(packing), packing.dimension))
    i, j = (pairs.A_i + pairs.R_i)[:, None], (pairs.A_j + pairs.R_j)[:, None]
    return np.hstack([one, *[i] * turns, *[j] * turns]).astype(float)


def errors(packing, matrix, expected):
    """Largest of each pair, over the largest element; rotations in units of length."""
    lever = levers(packing)
    scale = lever[:, :, None] * lever[:, None, :]
    size = np.abs(expected / scale).max(axis=(1, 2))
    return (np.abs(matrix - expected) / scale).max(axis=(1, 2)) / size


LEAST_SMOOTH = 0.7
LEAST_RESOLVED = 0.3


def named(one):
    """Words of a case, for the name of its test."""
    return "-".join(getattr(word, "__name__", str(word)) for word in one)


EVERY_POWER = in_turn(CASES, [2.0, 2.5, 3.0])


@pytest.mark.parametrize(
    ("of", "power"), EVERY_POWER, ids=[named((*p.values[0], p.values[1])) for p in EVERY_POWER]
)
def test_second_derivatives_are_differences_of_force_and_torques(of, power, measured):
    case, dimension, sides = of
    packing = replace(packing_of(case, dimension), power=power)
    found = packing.derivatives(sides, K_E)
    h = steps(packing, sides)
    resolved = are_resolved(packing, h)
    smooth = is_smooth_around(packing, h, sides) & resolved
    assert resolved.mean() > LEAST_RESOLVED
    assert smooth.sum() > LEAST_SMOOTH * resolved.sum()
    packing, h, M = packing[smooth], h[:, smooth], hessian(found)[smooth]
    raw = differences(packing, lambda moved: moved.gradient(sides, K_E), h)
    expected = commuted(raw, packing.gradient(sides, K_E), dimension)
    error = errors(packing, M, expected)
    measured(worst=error.max(), median=np.median(error), smooth=smooth.mean())
    assert error.max() < 1e-8


def nearly_discs(rng, dimension):
    """alpha down to 1e-6, side by side within the sines that count."""
    return deep(rng, N, dimension, overlaps(rng, N), depth=(1e2, 1e10))


@pytest.mark.parametrize(("of", "power"), in_turn([(2, 1), (2, 2), (3, 2), (3, 1)], [2.0, 3.0]))
def test_second_derivatives_are_those_of_the_energy_written_a_second_time(of, power, measured):
    dimension, sides = of
    rng = np.random.default_rng([42, dimension])
    cases = [case for case, D, s in CASES if (D, s) == (dimension, sides)]
    cases += [nearly_discs] * (sides == 2)  # within |sin| = 1e-8, one bond has a kink
    packing = PairPacking.of(rng, concatenated(*(case(rng, dimension)[:15] for case in cases)))
    packing = replace(packing, power=power)

    def gradient(packing):
        return np.hstack(
            complex_step_gradient(
                packing.plain(), lambda pairs: K_E * ENERGIES[sides](pairs, power)
            )
        )

    h = steps(packing, sides)
    resolved = are_resolved(packing, h)
    smooth = is_smooth_around(packing, h, sides) & resolved
    assert resolved.mean() > LEAST_RESOLVED
    assert smooth.sum() > LEAST_SMOOTH * resolved.sum()
    packing, h = packing[smooth], h[:, smooth]
    expected = commuted(differences(packing, gradient, h), gradient(packing), dimension)
    for extended, name, most in ((True, "worst_extended", 1e-8), (False, "worst", 1e-7)):
        found = packing.derivatives(sides, K_E, extended=extended)
        error = errors(packing, hessian(found), expected)
        measured(**{name: error.max()})
        assert error.max() < most


# --- the parts ---------------------------------------------------------------------------------


def largest(packing, matrix):
    """Largest element of each pair, rotations in units of length."""
    lever = levers(packing)
    return np.abs(matrix / (lever[:, :, None] * lever[:, None, :])).max(axis=(1, 2))


@EVERY_CASE
def test_distances_gradients_and_stiffnesses_are_those_of_the_bonds(
    case, dimension, sides, measured
):
    packing, found = packing_of(case, dimension), found_in(case, dimension, sides)
    pairs = packing.plain()
    x = Approach(pairs)
    if sides == 2:
        shares, coupling = x.shares, x.couplings
    else:
        shares = np.tile([1.0, 0.0], (len(pairs), 1))
        coupling = 0.0 * shares
    # Within w of a, the two bonds change shares.
    unit = (K_E / pairs.d**2)[:, None] / np.where(x.has_two, x.exponent, 1.0)[:, None]
    coupling = coupling * np.sqrt(K_E) / pairs.d[:, None]
    worst = {
        "stiffness": np.max(
            np.abs(found["stiffness"] - shares * K_E / pairs.d[:, None] ** 2) / unit
        ),
        "coupling": np.max(np.abs(found["coupling"] - coupling) / np.sqrt(unit)),
    }

    both = found["n_bonds"] == 2
    bonds = [(0, slice(None), lambda pairs: Approach(pairs).closest.square)]
    bonds += [(1, both, lambda pairs: Approach(pairs).far_end.square)] * bool(both.any())
    # Parallel rods may be nearer at either end.
    tied = (np.abs(x.drop) < 1e-15 * pairs.extent / pairs.d) & (x.opposite > 0.0)
    for b, among, square in bonds:
        bond = pairs[among]
        distance = np.sqrt(square(bond))
        error = np.abs(found["distance"][among, b] - distance) / bond.extent
        worst[f"distance_{b}"] = error.max()
        gradient = np.hstack(complex_step_gradient(bond, lambda p, f=square: np.sqrt(f(p))))
        error = np.abs(found["gradient"][among, b] - gradient) / (levers(packing)[among])
        worst[f"gradient_{b}"] = error[~tied[among]].max(initial=0.0)
    measured(**worst)
    assert max(worst.values()) < 1e-12
    assert not np.any(found["gradient"][~both, 1])
    assert not np.any(found["stiffness"][~both, 1])


@EVERY_CASE
def test_second_derivatives_come_with_the_forces_of_the_same_contacts(case, dimension, sides):
    packing, found = packing_of(case, dimension), found_in(case, dimension, sides)
    sums = packing.sums(sides, K_E)
    np.testing.assert_allclose(found["energy"].sum(), sums["energy"], rtol=1e-14)
    np.testing.assert_array_equal(found["force"], sums["force"][::2])
    pairs = packing.plain()
    assert np.all(np.abs(found["separation"] - pairs.r) <= EPS * pairs.extent[:, None])
    virial = np.einsum("ca,cb->ab", found["separation"], found["force"])
    scale = np.abs(found["separation"] * found["force"]).sum()
    np.testing.assert_allclose(sums["virial"], virial, atol=1e-13 * scale)
    np.testing.assert_allclose(sums["bond_force"], found["bond_force"].sum(), rtol=1e-13)
    assert sums["n_bonds"] == found["n_bonds"].sum()
    assert all(np.all(np.isfinite(x)) for x in found.values())


@EVERY_CASE
def test_second_derivatives_do_not_see_motion_of_the_whole(case, dimension, sides, measured):
    """Motion of the pair as one body keeps V(r, i, j), and rotates its first derivatives.

    With exp(t w) before exp(s v) as in `commuted`, M (w x r, w, w) = (w x V_r, w x V_i / 2,
    w x V_j / 2), and no bond changes its distance.
    """
    packing, found = packing_of(case, dimension), found_in(case, dimension, sides)
    r, gradient = found["separation"], packing.gradient(sides, K_E)
    lever, n = levers(packing), len(packing)
    worst = {"gradient": 0.0, "curvature": 0.0}
    for w in np.eye(packing.rotations):
        if dimension == 2:
            turned = [scaled(w[0] * np.ones(n), np.column_stack([-v[:, 1], v[:, 0]]))
                      for v in (r, gradient[:, :2])]  # fmt: skip
            motion = np.column_stack([turned[0], np.ones((n, 2))])
            expected = np.column_stack([turned[1], np.zeros((n, 2))])
        else:
            motion = np.column_stack([np.cross(w, r), np.tile(w, (n, 2))])
            halves = [0.5 * np.cross(w, gradient[:, k : k + 3]) for k in (3, 6)]
            expected = np.column_stack([np.cross(w, gradient[:, :3]), *halves])
        size = np.abs(motion * lever).max(axis=1)
        still = np.einsum("cbi,ci->cb", found["gradient"], motion)
        worst["gradient"] = max(worst["gradient"], np.max(np.abs(still).max(axis=1) / size))
        error = np.einsum("cij,cj->ci", found["curvature"], motion) - expected
        unit = largest(packing, found["curvature"]) * size
        error = np.abs(error / lever).max(axis=1) / unit
        worst["curvature"] = max(worst["curvature"], error.max())
    measured(**worst)
    assert worst["gradient"] < 4.0 * EPS
    assert worst["curvature"] < 8.0 * EPS


@EVERY_CASE
def test_curvature_is_symmetric_and_that_of_the_pair_seen_from_the_other_particle(
    case, dimension, sides, measured
):
    packing, found = packing_of(case, dimension), found_in(case, dimension, sides)
    curvature = found["curvature"]
    assert np.array_equal(curvature, curvature.transpose(0, 2, 1))

    back = np.arange(2 * len(packing)).reshape(-1, 2)[:, ::-1].ravel()
    other = PairPacking(
        packing.diameters[back],
        packing.position[back],
        packing.orientation[back],
        packing.edges,
        -packing.shift,
    )
    swapped = other.derivatives(sides, K_E)
    D, turns = packing.dimension, packing.rotations
    order = np.concatenate([np.arange(D), D + turns + np.arange(turns), D + np.arange(turns)])
    sign = np.concatenate([-np.ones(D), np.ones(2 * turns)])
    seen = (sign[:, None] * sign * swapped["curvature"])[:, order[:, None], order]
    error = np.abs(largest(packing, seen - curvature) / largest(packing, curvature))
    measured(worst=error.max())
    assert error.max() < 1e-9


def rounding_of_second_derivatives(packing):
    """Error due to coordinates in double precision, relative to the largest second derivative.

    Through what feet of skew spines slide by, and what the steps of the weights are taken of, whose
    third derivatives are tens of the second.
    """
    pairs = packing.plain()
    x = Approach(pairs)
    relative = pairs.extent / pairs.d
    sine = np.linalg.norm(cross(pairs.u_i, pairs.u_j).astype(float), axis=1)
    inside = (np.abs(x.closest.s) < pairs.A_i) & (np.abs(x.closest.t) < pairs.A_j)
    slides = np.where(inside, 1.0 / np.where(inside, sine, 1.0) ** 2, 0.0)
    fading = (x.by_steps > 0.0) & (x.by_steps < 1.0)
    by_length = np.where(fading, pairs.extent / fade_length(pairs), 0.0)
    not_two = x.has_two & (x.exponent < 1.0)
    least = np.where(not_two, x.exponent * np.minimum(x.overlap, x.far_overlap), 1.0)
    by_overlaps = np.where(not_two, relative / least, 0.0)
    by_steps = 10.0 * (by_length + by_overlaps)
    return (EPS * (relative * (1.0 + slides) + by_steps)).astype(float)


@EVERY_CASE
def test_double_precision_agrees_with_extended(case, dimension, sides, measured):
    packing, found = packing_of(case, dimension), found_in(case, dimension, sides)
    double = found_in(case, dimension, sides, extended=False)
    smooth = is_smooth_around(packing, 1e-6 * steps(packing, sides), sides)
    assert smooth.mean() > LEAST_SMOOTH
    np.testing.assert_array_equal(double["n_bonds"], found["n_bonds"])
    error = errors(packing, hessian(double), hessian(found))
    in_roundings = error / rounding_of_second_derivatives(packing)
    measured(in_roundings=in_roundings[smooth].max(), median=np.median(in_roundings))
    assert in_roundings[smooth].max() < 64.0


# --- closed forms ------------------------------------------------------------------------------


def turning(u, dimension):
    """(M, D, turns) derivatives of the axes by their rotation."""
    if dimension == 2:
        return np.column_stack([-u[:, 1], u[:, 0]])[:, :, None]
    return np.stack([np.cross(w, u) for w in np.eye(3)], axis=2)


def turning_twice(u, n, dimension):
    """(M, turns, turns) second derivatives of n . u, by rotation vectors."""
    along = np.einsum("mk,mk->m", n, u)[:, None, None]
    if dimension == 2:
        return -along
    both = np.einsum("ma,mb->mab", n, u)
    return 0.5 * (both + both.transpose(0, 2, 1)) - along * np.eye(3)


def distance_hessian(pairs, foot):
    """(M, n, n) second derivatives of the distance between the spines.

    That of |r + s u_i - t u_j| by its variables, s and t among them; those inside the spines follow
    the others such that the distance stays the least (their Schur complement).
    """
    n, D = pairs.r.shape
    u_i, u_j, s, t = (x.astype(float) for x in (pairs.u_i, pairs.u_j, foot.s, foot.t))
    p = (pairs.r + scaled(foot.s, pairs.u_i) - scaled(foot.t, pairs.u_j)).astype(float)
    distance = np.linalg.norm(p, axis=1)
    normal = p / distance[:, None]
    turn_i, turn_j = turning(u_i, D), turning(u_j, D)
    turns = turn_i.shape[2]
    i, j = slice(D, D + turns), slice(D + turns, D + 2 * turns)
    P = np.concatenate([
        np.tile(np.eye(D), (n, 1, 1)), s[:, None, None] * turn_i, -t[:, None, None] * turn_j,
        u_i[:, :, None], -u_j[:, :, None],
    ], axis=2)  # fmt: skip
    across = np.eye(D) - np.einsum("ma,mb->mab", normal, normal)
    H = np.einsum("mai,mab,mbj->mij", P, across, P) / distance[:, None, None]
    H[:, i, i] += s[:, None, None] * turning_twice(u_i, normal, D)
    H[:, j, j] -= t[:, None, None] * turning_twice(u_j, normal, D)
    for slide, block, turn, sign in ((-2, i, turn_i, 1.0), (-1, j, turn_j, -1.0)):
        mixed = sign * np.einsum("ma,mak->mk", normal, turn)
        H[:, slide, block] += mixed
        H[:, block, slide] += mixed
    for slide, x, A in ((-1, foot.t, pairs.A_j), (-1, foot.s, pairs.A_i)):
        eliminated = (np.abs(x) < A)[:, None, None]
        column = H[:, :, slide]
        pivot = np.where(eliminated, column[:, slide][:, None, None], 1.0)
        less = column[:, :, None] * column[:, None, :] / pivot
        H = np.delete(np.delete(H - np.where(eliminated, less, 0.0), slide, 1), slide, 2)
    return H


def shallow(rng, dimension):
    """Overlaps of 1e-9 of every class, two bonds among them."""
    n, alpha = 300, (1e-3, 3.0)
    overlap = np.full(n, 1e-9)
    parts = [
        disc_to_disc(rng, n, dimension, overlap),
        tip_to_tip(rng, n, dimension, overlap, alpha),
        tip_to_side(rng, n, dimension, overlap, alpha),
        nearly_parallel(rng, n, dimension, overlap, (0.1, 3.0), least_tilt=0.1),
    ]
    if dimension == 3:
        parts.append(skew(rng, n, overlap, rng.uniform(0.5, 0.5 * np.pi, n), alpha))
    pairs = concatenated(*parts)
    x = Approach(pairs)
    whole = (x.exponent < LEAST_EXPONENT) | (x.exponent == 1.0)
    return pairs[whole | (x.far_overlap < 0.0)]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("sides", [1, 2])
def test_curvature_of_shallow_contacts_has_closed_forms(dimension, sides, measured):
    """Bonds with forces F push along distances of second derivatives H: the curvature is -F H."""
    rng = np.random.default_rng([43, dimension])
    pairs = shallow(rng, dimension)
    if sides == 1:  # those that one bond takes for parallel have a kink
        pairs = pairs[np.linalg.norm(cross(pairs.u_i, pairs.u_j), axis=1) > 1e-7]
    packing = PairPacking.of(rng, pairs)
    pairs = packing.plain()
    x = Approach(pairs)
    expected = scaled_matrix(-K_E * x.overlap / pairs.d, distance_hessian(pairs, x.closest))
    second = x.has_two & (sides == 2)
    assert np.all(x.exponent[second] == 1.0)
    push = -K_E * np.where(second, x.far_overlap, 0.0) / pairs.d
    expected += scaled_matrix(push, distance_hessian(pairs, x.far_end))
    smooth = is_smooth_around(packing, 1e-6 * steps(packing, sides), sides)
    assert smooth.mean() > LEAST_SMOOTH
    for extended, most in ((True, 1e-7), (False, 1e-6)):
        found = packing.derivatives(sides, K_E, extended=extended)
        assert np.array_equal(found["pair"], np.arange(len(packing)))
        error = errors(packing, found["curvature"], expected)[smooth]
        measured(**{"worst_extended" if extended else "worst": error.max(), "two": second.sum()})
        assert error.max() < most
    kinds = set(found["kind"])
    assert kinds >= {TIP_TO_TIP, TIP_TO_SIDE}
    assert SIDE_TO_SIDE in kinds or (dimension, sides) == (2, 1)


def scaled_matrix(factor, matrices):
    return np.asarray(factor)[:, None, None] * matrices


@pytest.mark.parametrize("dimension", [2, 3])
def test_curvature_of_discs_is_their_force_over_their_distance(dimension, measured):
    """-F / r across the normal, and nothing else."""
    rng = np.random.default_rng([44, dimension])
    packing = PairPacking.of(rng, disc_to_disc(rng, 300, dimension, np.full(300, 1e-9)))
    pairs = packing.plain()
    distance = np.sqrt((pairs.r**2).sum(axis=1))
    normal = pairs.r / distance[:, None]
    force = K_E * (pairs.d - distance) / pairs.d**2
    across = np.eye(dimension) - normal[:, :, None] * normal[:, None, :]
    expected = np.zeros((300, *[dimension + 2 * packing.rotations] * 2), LONG)
    expected[:, :dimension, :dimension] = scaled_matrix(-force / distance, across)
    for sides in (1, 2):
        for extended, most in ((True, 1e-7), (False, 1e-6)):
            found = packing.derivatives(sides, K_E, extended=extended)
            error = errors(packing, found["curvature"], expected)
            measured(**{"worst_extended" if extended else "worst": error.max()})
            assert error.max() < most
            assert not np.any(found["curvature"][:, dimension:])
            np.testing.assert_allclose(found["stiffness"][:, 0], K_E / pairs.d.astype(float) ** 2)


# --- poses where something degenerates ---------------------------------------------------------


def exact_poses(dimension):
    """Parallel, aligned, end to end and T-shaped, of all lengths, overlaps and pairs with discs."""
    x, y = np.eye(dimension)[:2]
    A, R = [], []
    r, u_i = [], []
    for alpha_i in (0.0, 1e-6, 1e-3, 1.0, 100.0):
        for alpha_j in sorted({0.0, alpha_i, 0.7 * alpha_i}):
            for overlap in (1e-12, 1e-6, 1e-3, 0.3):
                for size in (1.0, 1.4):
                    A_i, A_j, d = alpha_i, size * alpha_j, 1.0 + size
                    gap = (1.0 - overlap) * d
                    along = A_i + A_j
                    shorter = min(A_i, A_j)
                    depth = overlap * (d / shorter) ** 2 if shorter > 0.0 else 0.0
                    edge = along - least_whole(shorter, depth)
                    poses = [(past * x + gap * y, x) for past in (0.0, 0.5 * along, along, edge)]
                    poses += [((along + gap) * x, x), ((A_i + gap) * y, y), ((A_j + gap) * x, y)]
                    r += [pose[0] for pose in poses]
                    u_i += [pose[1] for pose in poses]
                    A += [(A_i, A_j)] * len(poses)
                    R += [(1.0, size)] * len(poses)
    A, R, n = np.array(A), np.array(R), len(r)
    return Pairs(np.array(r), np.array(u_i), np.tile(x, (n, 1)), *A.T, *R.T)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("sides", [1, 2])
@pytest.mark.parametrize("extended", [False, True])
def test_exactly_aligned_poses_have_finite_second_derivatives(dimension, sides, extended):
    rng = np.random.default_rng(45)
    packing = PairPacking.of(rng, exact_poses(dimension))
    found = packing.derivatives(sides, K_E, extended=extended)
    assert len(found["pair"]) > 0.8 * len(packing)
    assert all(np.all(np.isfinite(x)) for x in found.values())
    assert np.all(found["energy"] > 0.0)
    packing = packing[found["pair"]]
    unit = K_E / packing.plain().d ** 2
    assert np.all(found["stiffness"] >= -16.0 * EPS * unit[:, None])
    assert np.all(largest(packing, found["curvature"]) < 2.0 * unit)


@pytest.mark.parametrize("extended", [False, True])
def test_pairs_apart_and_crossing_have_no_second_derivatives(extended):
    rng = np.random.default_rng(46)
    touching = tip_to_side(rng, 3, 2, np.full(3, 0.1), (1.0, 4.0))
    apart = touching.replaced(r=100.0 * touching.r)
    crossing = touching.replaced(r=np.zeros((3, 2)))
    every = concatenated(Pairs(**{k: getattr(touching, k) for k in vars(apart)}), apart, crossing)
    every = every[[3, 0, 6, 1, 4, 2]]
    found = PairPacking.of(rng, every).derivatives(2, K_E, extended=extended)
    assert found["pair"].tolist() == [1, 3, 5]
    assert found["curvature"].shape == (3, 4, 4)
    assert found["gradient"].shape == (3, 2, 4)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("extended", [False, True])
def test_axes_of_discs_mean_nothing(dimension, extended):
    """Nor where they are exactly across the normal, as those of discs next to rods along x are."""
    x, y = np.eye(dimension)[:2]
    axes = np.array([x, y, -x, *random_directions(np.random.default_rng(47), 5, dimension)])
    for r, u_j in ((0.3 * x + 1.8 * y, x), (2.8 * x, x), (1.8 * x, y), (2.8 * y, y)):
        n = len(axes)
        pairs = Pairs(np.tile(r, (n, 1)), axes, np.tile(u_j, (n, 1)), np.zeros(n), np.ones(n),
                      np.ones(n), np.ones(n))  # fmt: skip
        packing = PairPacking.of(np.random.default_rng(48), pairs)
        # to the last bit where they should be
        packing.edges, packing.shift = 8.0 + 0.0 * packing.edges, 0 * packing.shift
        packing.position[::2], packing.position[1::2] = r, 0.0
        found = packing.derivatives(2, K_E, extended=extended)
        turns = slice(dimension, dimension + packing.rotations)
        assert not np.any(found["gradient"][:, :, turns])
        assert not np.any(found["curvature"][:, turns])
        spread = np.ptp(found["curvature"], axis=0).max()
        assert spread <= 64.0 * EPS * np.abs(found["curvature"]).max()
