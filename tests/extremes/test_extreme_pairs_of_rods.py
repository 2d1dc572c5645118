"""Contacts of pairs of rods, with one bond or two."""

from typing import NamedTuple

import numpy as np
from extreme import case, extreme
from long_oracle import bond_at, crossing, in_long, nearest, one_bond
from pair_contacts import OVERLAPS, change_in_units, unnamed
from reference_energy import end_feet
from spherocylinder_pairs import (
    CROSSING,
    TOUCHING,
    Pairs,
    contacts,
    log_uniform,
    normalised,
    random_directions,
    row_dot,
    scaled,
)

PART = "contact of spherocylinders"

ANGLES = (1e-2, 1e-6, 1e-7, 1e-9, 1e-10, 1e-12, 1e-14, 0.0)
SIDES = {"one": 1, "two": 2}
EVERY = [(D, word, f"{PART}: {D}D, sides {word}") for D in (2, 3) for word in SIDES]


# --- pairs ---------------------------------------------------------------------------------------


class Drawn(NamedTuple):
    overlap: float
    alpha: tuple[float, float] = (1.0, 1.0)
    """Bounds, log-uniform between them."""
    size: tuple[float, float] = (0.5, 0.7)
    """Bounds of R, alike."""
    angle: float | None = None
    """Of nearly parallel rods side by side; None for any directions."""
    n: int = 400


def across(v, u):
    """Unit vectors along the components of v perpendicular to u."""
    return normalised(v - scaled(row_dot(v, u), u))


def random_rods(D, drawn):
    """Pairs with the overlap that is asked for."""
    rng, n, angle = np.random.default_rng(1), drawn.n, drawn.angle
    R = log_uniform(rng, *drawn.size, (2, n))
    A = R * log_uniform(rng, *drawn.alpha, (2, n))
    u_i, u_j = random_directions(rng, n, D), random_directions(rng, n, D)
    if angle is not None:
        u_j = normalised(rng.choice([-1, 1], (n, 1)) * (u_i + angle * across(u_j, u_i)))
    line = random_directions(rng, n, D)
    if angle is not None:
        line = across(line, u_i)
    offset = rng.uniform(-0.5, 0.5, (n, 1)) * A.min(axis=0)[:, None] * u_i * (angle is not None)
    pairs = in_long(Pairs(offset, u_i, u_j, *A, *R))
    r = apart_along(line, pairs, drawn.overlap).astype(float)
    pairs = Pairs(r, u_i, u_j, *A, *R)
    keep = nearest(in_long(pairs))[2] < pairs.d
    keep &= ~crossing(in_long(pairs)) if D == 2 else True
    return pairs[keep]


def apart_along(line, pairs, overlap):
    """Move i along a line until the overlap is that asked for, by bisection."""
    low, high = 0 * pairs.d, pairs.A_i + pairs.A_j + np.longdouble(1.1) * pairs.d
    for _ in range(80):
        x = (low + high) / 2
        distance = nearest(pairs.replaced(r=pairs.r + scaled(x, line)))[2]
        apart = distance > (1 - overlap) * pairs.d
        low, high = np.where(apart, low, x), np.where(apart, x, high)
    return pairs.r + scaled(low, line)


def both_ends(pairs):
    """Side-to-side contacts as printed (Fig. 6): a bond at either end of the overlap of the spines."""
    return [sum(x) for x in zip(*(bond_at(pairs, f.s, f.t) for f in end_feet(pairs)), strict=True)]


# --- accuracy ------------------------------------------------------------------------------------


def accurate(D):
    for overlap in OVERLAPS:
        yield case(f"{PART}: {D}D, overlap {overlap:.2g}", D, Drawn(overlap), expected=3e-15)
    for alpha in ((1e-6, 1e-6), (1e-6, 100.0), (100.0, 100.0)):
        # Axes are rounded by EPS, tips by alpha times that.
        name = f"{PART}: {D}D, alpha {alpha[0]:g} to {alpha[1]:g}"
        yield case(name, D, Drawn(0.05, alpha), expected=3e-15 * (1 + alpha[1]))
    drawn = Drawn(0.05, (0.1, 10), (0.5, 5))
    yield case(f"{PART}: {D}D, size ratio to 10", D, drawn, expected=3e-14)
    for angle in ANGLES:
        drawn, name = Drawn(0.02, (2, 5), angle=angle), f"{PART}: {D}D, parallel to {angle:g}"
        yield case(f"{name}, sides one", D, drawn, expected=2e-14)
        if D == 2 or angle == 0.0:
            # Two bonds as printed are the limit of shallow overlaps: exactly so from y = 0.01 down.
            shallow, what = (
                drawn._replace(overlap=0.005),
                "against both bonds as printed, in overlaps",
            )
            name += ", sides two"
            yield case(
                name, D, shallow, both_ends, 2, expected=4e-14, measure=f"force and torque {what}"
            )


@extreme("force and torque against long double, in overlaps", [*accurate(2), *accurate(3)])
def test_forces_and_torques(D, drawn, oracle=one_bond, sides=1):
    pairs = random_rods(D, drawn)
    found = contacts(pairs, sides)
    if len(pairs) < 50 or not (found["status"] == TOUCHING).all():
        return np.inf
    _, *wanted = oracle(in_long(pairs))
    arms = (1, np.maximum(pairs.A_i, pairs.R_i), np.maximum(pairs.A_j, pairs.R_j))
    names = ("force", "torque_i", "torque_j")
    return max(
        (np.abs(found[name].reshape(right.shape) - right).max(axis=1) * pairs.d / arm).max()
        for name, right, arm in zip(names, wanted, arms, strict=True)
    )


# --- symmetries ----------------------------------------------------------------------------------


def in_units():
    for D, word, name in EVERY:
        for unit in (2.0**-20, 2.0**20, 1e-6, 1e6):
            is_exact = np.log2(unit) % 1 == 0
            bound = 0.0 if is_exact else 1e-14
            what = "change of scaled forces, in overlaps"
            name_here = f"{name}, unit of length {unit:.3g}"
            yield case(name_here, D, SIDES[word], unit, 1.0, expected=bound, measure=what)
            bound = 0.0 if is_exact else 1e-17
            yield case(f"{name}, k_e {unit:.3g}", D, SIDES[word], 1.0, unit, expected=bound)


@extreme("change of forces over k_e, in overlaps", in_units())
def test_units(D, sides, length, energy):
    """Crossed and parallel rods."""
    worst = 0.0
    for drawn in (Drawn(0.01), Drawn(0.01, angle=1e-9)):
        pairs = random_rods(D, drawn)
        lengths = {name: length * x for name, x in vars(pairs).items() if not name.startswith("u_")}
        large = contacts(pairs.replaced(**lengths), sides, energy)
        arms = np.max([pairs.A_i, pairs.A_j, pairs.R_i, pairs.R_j], axis=0)
        small = contacts(pairs, sides)
        worst = max(worst, change_in_units(small, large, arms, length, energy))
    return 0.01 * worst


@extreme("change of forces, in overlaps", [
    case(f"{name}, i and j exchanged, angle {tilt or 'any'}", D, SIDES[word], tilt)
    for D, word, name in EVERY for tilt in (None, 1e-6, 1e-12)
], 1e-14)  # fmt: skip
def test_exchange(D, sides, angle):
    pairs = random_rods(D, Drawn(0.01, angle=angle))
    found, other = contacts(pairs, sides), contacts(pairs.swapped(), sides)
    by_force = np.abs(found["force"] + other["force"]).max()
    by_torque = np.abs(found["torque_i"] - other["torque_j"]).max()
    return 0.01 * max(by_force, by_torque) / np.abs(found["force"]).max()


@extreme("change of forces", [
    case(f"{name}, upside down", D, SIDES[word]) for D, word, name in EVERY
], 0.0)  # fmt: skip
def test_rods_have_no_head(D, sides):
    pairs = random_rods(D, Drawn(0.01, angle=1e-12))
    found, other = contacts(pairs, sides), contacts(pairs.replaced(u_j=-pairs.u_j), sides)
    return max(np.abs(found[n] - other[n]).max() for n in ("force", "torque_i", "torque_j"))


# --- where there is no force ---------------------------------------------------------------------


@extreme("fraction of crossings missed", [
    case(f"{PART}: spines cross by {depth:g} of a radius", depth) for depth in (0.5, 1e-6, 1e-12)
], 0.0)  # fmt: skip
def test_crossings_are_named(depth):
    rng, n = np.random.default_rng(2), 2000
    A = log_uniform(rng, 0.01, 100.0, (2, n))
    u_i, u_j = random_directions(rng, n, 2), random_directions(rng, n, 2)
    # The tip of i is past spine j, or both cross anywhere.
    sine = np.abs(u_i[:, 0] * u_j[:, 1] - u_i[:, 1] * u_j[:, 0])
    past = depth / np.maximum(sine, depth)
    s = np.where(rng.random(n) < 0.5, A[0] - past, rng.uniform(-0.9, 0.9, n) * A[0])
    t = rng.uniform(-0.9, 0.9, n) * A[1]
    pairs = Pairs(scaled(t, u_j) - scaled(s, u_i), u_i, u_j, *A, np.ones(n), np.ones(n))
    truly = crossing(in_long(pairs))
    if truly.mean() <= 0.5:
        return np.inf
    return max((contacts(pairs, k)["status"] != CROSSING)[truly].mean() for k in SIDES.values())


@extreme("fraction neither named nor finite", [
    case(f"{PART}: {D}D, centres {distance:g} apart", D, distance)
    for D in (2, 3) for distance in (0.0, 1e-300, 1e-15, 1e-12, 1e-6)
], 0.0)  # fmt: skip
def test_coincident_centres(D, distance):
    rng, n = np.random.default_rng(3), 200
    u_i, u_j = random_directions(rng, n, D), random_directions(rng, n, D)
    r, wrong = distance * random_directions(rng, n, D), 0.0
    for A in (0.0, 1e-6, 1.0, 100.0):
        pairs = Pairs(r, u_i, u_j, *np.full((2, n), A), *np.ones((2, n)))
        must_cross = distance == 0.0 or (D == 2 and A == 100.0)
        for sides in SIDES.values():
            wrong = max(wrong, unnamed(contacts(pairs, sides), must_cross=must_cross))
    return wrong
