"""Contacts of pairs of superellipsoids."""

import numpy as np
from extreme import case, extreme
from extreme_superellipsoids import EXPONENTS
from packings_in_a_box import EPS
from pair_contacts import OVERLAPS, change_in_units, unnamed
from spherocylinder_pairs import TOUCHING, cross, row_dot, scaled
from superellipsoid_pairs import Bodies, contacts, gauge, in_body, power_norm, scales, support

PART = "contact of superellipsoids"

GAP = "gap of independent bounds of eta"
LAW = "F.r, energy and torque balance, in overlaps"


# --- pairs ---------------------------------------------------------------------------------------


def random_pairs(D, p, size=1.0, n=200):
    """Pairs of any orientation, ratios of semi-axes log-uniform from 0.1 to 10."""
    rng = np.random.default_rng(4)

    def bodies(p, size):
        turn = rng.normal(size=(n, 4))
        turn /= np.linalg.norm(turn, axis=1, keepdims=True)
        if D == 2:
            turn = rng.uniform(-3, 3, (n, 1))
        axes = np.exp(rng.uniform(np.log(0.1), np.log(10.0), (n, D)))
        axes[:, 0] = 1.0
        largest = np.exp(rng.uniform(0, np.log(size), n)) if size > 1 else np.ones(n)
        order = np.broadcast_to(np.asarray(p, float), n)
        return Bodies(rng.normal(size=(n, D)), turn, scaled(largest, axes), order)

    p_i, p_j = (p, p) if np.ndim(p) == 0 else rng.choice(p, (2, n))
    return bodies(p_i, 1.0), bodies(p_j, size)


def at(i, j, r):
    """Move i to these places beside j."""
    return i.replaced(centre=r), j.replaced(centre=0 * r)


def at_overlap(i, j, overlap):
    """Move i along the line of centres to 1 - eta^2 = overlap."""
    return at(i, j, scaled(np.sqrt(1 - overlap) / scales(i, j)["eta"], i.centre - j.centre))


def aligned(p, tilt):
    """Pairs face on face and tip on tip, but for a tilt."""
    n, rng = 60, np.random.default_rng(5)
    axes = np.exp(rng.uniform(-1, 1, (n, 3)))
    factor = np.exp(rng.uniform(-2.3, 2.3, (n, 1)))
    r = np.eye(3)[rng.integers(0, 3, n)] * axes * (1 + factor) * 0.95
    r += rng.choice([0.0, 1e-9, 0.1], (n, 1)) * axes * rng.uniform(-1, 1, (n, 3))
    turn = np.column_stack([np.ones(n), tilt / 2 * rng.normal(size=(n, 3))])
    i = Bodies(r, turn, axes, np.full(n, p))
    j = Bodies(0 * r, np.tile([1.0, 0, 0, 0], (n, 1)), factor * axes, np.full(n, p))
    return at(i, j, scaled(0.95 / scale_if_aligned(i, j).astype(float), r))


def scale_if_aligned(i, j):
    """Scale of contact in closed form, of bodies of the same exponent along the same axes."""
    apart = np.abs(i.centre - j.centre).astype(np.longdouble)
    return power_norm(apart / (i.semi_axes + j.semi_axes), np.longdouble(2) * i.p)


def arms(i, j):
    return np.maximum(i.semi_axes.max(axis=1), j.semi_axes.max(axis=1))


# --- accuracy ------------------------------------------------------------------------------------


def bounds(i, j, found):
    """Bounds of the scale of contact, from below by a plane and from above by a point, in long double."""
    r = i.centre.astype(np.longdouble) - j.centre
    n, y = found["normal"].astype(np.longdouble), -found["point_i"].astype(np.longdouble)
    widths, gauges = [], []
    for body, point in ((i, y), (j, r - y)):
        turn = body.turn.astype(np.longdouble)
        if turn.shape[1] == 4:
            turn = turn / np.sqrt(row_dot(turn, turn))[:, None]
        body = Bodies(body.centre, turn, body.semi_axes, body.p.astype(np.longdouble))  # noqa: PLW2901
        widths.append(support(in_body(n, body), body.semi_axes, body.p))
        gauges.append(gauge(in_body(point, body), body.semi_axes, body.p))
    return row_dot(r, n) / (widths[0] + widths[1]), np.maximum(*gauges)


def scale_error(i, j):
    """Relative gap between independent bounds of the scale, or how far it lies outside of them."""
    found = scales(i, j)
    low, high = bounds(i, j, found)
    eta = found["eta"]
    return float(np.max([(high - low) / eta, (low - eta) / eta, (eta - high) / eta]))


def force_error(i, j, overlap):
    """F.r = 2 eta^2 (1 - eta^2), and no torque on the pair as a whole; in overlaps."""
    found = contacts(i, j)
    low, high = bounds(i, j, scales(i, j))
    square = ((low + high) / 2) ** 2
    if overlap > 1e-12 and not (found["status"] == TOUCHING).all():
        return np.inf
    names = ("energy", "force", "torque_i", "torque_j")
    if not all(np.isfinite(found[name]).all() for name in names):
        return np.inf
    force, r, shrunk = found["force"], i.centre - j.centre, np.maximum(1 - square, 0)
    work = row_dot(force, r) - 2 * square * shrunk
    energy = found["energy"] - shrunk**2 / 2
    rest = found["torque_i"] + found["torque_j"] + cross(r, force)
    size = np.linalg.norm(force, axis=1) * arms(i, j) + 1e-300
    share = np.abs(rest).max(axis=1) / size * overlap
    return max(np.abs(work).max(), np.abs(energy).max() / max(overlap, EPS), share.max())


def named(D, name):
    return f"{PART}: {D}D, {name}"


@extreme(GAP, [
    *(case(named(D, f"p {p:g}, w 0.1 to 10"), D, p) for D in (2, 3) for p in EXPONENTS),
    *(case(named(D, "p 0.55 with 10, size ratio to 10"), D, (0.55, 10.0), 10.0) for D in (2, 3)),
], 5e-14)  # fmt: skip
def test_scale(D, p, size=1.0):
    return scale_error(*random_pairs(D, p, size))


@extreme(LAW, [
    *(case(named(D, f"p {p:g}, forces"), D, p, 0.1, expected=1e-12) for D in (2, 3) for p in EXPONENTS),
    *(case(named(D, f"overlap {x:.2g}"), D, EXPONENTS, x, expected=1e-13) for D in (2, 3) for x in OVERLAPS),
])  # fmt: skip
def test_forces(D, p, overlap):
    return force_error(*at_overlap(*random_pairs(D, p), overlap), overlap)


@extreme(f"{GAP}, closed form, forces", [
    case(f"{PART}: aligned to {tilt:g}, p {p:g}", p, tilt)
    for p in (0.55, 1.0, 2.0, 10.0) for tilt in (0.0, 1e-14, 1e-12, 1e-6, 1e-3)
], 1e-13)  # fmt: skip
def test_face_on_face_and_tip_on_tip(p, tilt):
    """Closed form for aligned bodies, bounds for tilted ones."""
    i, j = aligned(p, tilt)
    worst = max(scale_error(i, j), force_error(i, j, 0.1))
    if tilt == 0.0:
        worst = max(worst, np.abs(scales(i, j)["eta"] / scale_if_aligned(i, j) - 1).max())
    return worst


# --- units, and where there is no force ----------------------------------------------------------


@extreme("change of scaled forces, in overlaps", [
    *(case(f"{PART}: unit of length {unit:g}", unit, 1.0, expected=1e-10) for unit in (1e-6, 1e6)),
    *(case(f"{PART}: epsilon {unit:g}", 1.0, unit, expected=1e-15) for unit in (1e-6, 1e6)),
])  # fmt: skip
def test_units(length, energy):
    small = at_overlap(*random_pairs(3, EXPONENTS), 0.1)
    large = [b.replaced(centre=length * b.centre, semi_axes=length * b.semi_axes) for b in small]
    found = contacts(*small), contacts(*large, energy)
    return 0.1 * change_in_units(*found, arms(*small), length, energy)


@extreme("fraction neither named nor finite", [
    case(f"{PART}: centres {distance:g} apart", distance) for distance in (0.0, 1e-300, 1e-15, 1e-8)
], 0.0)  # fmt: skip
def test_concentric(distance):
    wrong = 0.0
    for D in (2, 3):
        i, j = random_pairs(D, EXPONENTS)
        found = contacts(*at(i, j, distance * i.centre))
        wrong = max(wrong, unnamed(found, must_cross=distance == 0))
    return wrong
