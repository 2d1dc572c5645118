"""Cases of the stability battery: contacts of pairs, and their sums over packings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from stability_cases import Case
from stability_scenes import (
    EPS,
    LONG_EPS,
    Found,
    Spines,
    all_aspect_ratios,
    all_sizes,
    closest,
    crossing,
    deep,
    every_image,
    longer_than_the_box,
    middle,
    oracle,
    own_images,
    pressed,
    rods,
    scaled,
    scattered_superellipsoids,
    sine,
    stack,
    superellipsoids,
)

from jamshape import _contact
from jamshape.arrays import FloatArray, LongArray
from jamshape.contacts import find_contacts, superellipsoid_bodies
from jamshape.landscape import Landscape, State
from jamshape.packing import Packing

ROD, SUPER = "contact of spherocylinders", "contact of superellipsoids"
ROD_SUM, SUPER_SUM = "landscape, spherocylinders", "landscape, superellipsoids"

# Ten thousand images for each of its pairs.
HEAVY = "3D, alpha 1e-6 to 100"

OVERLAPS = (1e-14, 1e-11, 1e-8, 1e-4, 1 / 3)
ANGLES = (1e-2, 1e-6, 1e-7, 1e-9, 1e-10, 1e-12, 1e-14, 0.0)
EXPONENTS = (0.55, 0.75, 1.0, 1.5, 2.0, 5.0, 10.0)

_TOUCHING, _CROSSING = 1, 2
_CROSS = r"(spines|centres) of particles \d+ and \d+ cross"


# --- pairs of rods -------------------------------------------------------------------------------


class Rods(NamedTuple):
    """M pairs: rows of bodies as the binding takes them."""

    i: FloatArray
    j: FloatArray
    D: int

    @property
    def spines(self) -> Spines:
        """The same numbers as long doubles."""
        i, j = np.asarray(self.i, np.longdouble), np.asarray(self.j, np.longdouble)
        D = self.D
        r = i[:, :D] - j[:, :D]
        A, R = slice(2 * D, 2 * D + 1), slice(2 * D + 1, None)
        axes = i[:, D : 2 * D], j[:, D : 2 * D]
        return Spines(r, *axes, i[:, A][:, 0], j[:, A][:, 0], (i[:, R] + j[:, R])[:, 0])

    def contacts(self, sides: int = 1, k_e: float = 1.0) -> dict[str, NDArray[Any]]:
        """Call the binding."""
        i, j = map(np.ascontiguousarray, self[:2])
        return _contact.spherocylinder_contacts(i, j, k_e, sides)


def _units(rng: np.random.Generator, n: int, D: int) -> FloatArray:
    u = rng.normal(size=(n, D))
    return np.asarray(u / np.linalg.norm(u, axis=1, keepdims=True))


def random_rods(
    D: int,
    overlap: float,
    alpha: tuple[float, float] = (1.0, 1.0),
    size: tuple[float, float] = (0.5, 0.7),
    n: int = 400,
    angle: float | None = None,
) -> Rods:
    """Pairs that overlap by so much, in all directions; alpha and R log-uniform between bounds."""
    rng = np.random.default_rng(1)
    R = np.exp(rng.uniform(np.log(size[0]), np.log(size[1]), (2, n)))
    A = R * np.exp(rng.uniform(np.log(alpha[0]), np.log(alpha[1]), (2, n)))
    u_i, u_j = _units(rng, n, D), _units(rng, n, D)
    if angle is not None:
        across = u_j - (u_j * u_i).sum(axis=1, keepdims=True) * u_i
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        u_j = rng.choice([-1, 1], (n, 1)) * (u_i + angle * across)  # length 1 to angle^2 / 2
        u_j /= np.linalg.norm(u_j, axis=1, keepdims=True)
    line = _units(rng, n, D)
    if angle is not None:  # side by side
        line -= (line * u_i).sum(axis=1, keepdims=True) * u_i
        line /= np.linalg.norm(line, axis=1, keepdims=True)
    offset = rng.uniform(-0.5, 0.5, (n, 1)) * A.min(axis=0)[:, None] * u_i * (angle is not None)

    def at(x: LongArray) -> Spines:
        r = np.asarray(offset + x[:, None] * line, np.longdouble)
        long = [np.asarray(y, np.longdouble) for y in (u_i, u_j, A[0], A[1], R.sum(0))]
        return Spines(r, long[0], long[1], long[2], long[3], long[4])

    low, high = np.zeros(n, np.longdouble), np.longdouble(1) * (A.sum(0) + 1.1 * R.sum(0))
    for _ in range(80):
        x = (low + high) / 2
        delta = closest(at(x))[2]
        apart = np.sqrt((delta**2).sum(axis=1)) > (1 - overlap) * R.sum(0)
        low, high = np.where(apart, low, x), np.where(apart, x, high)
    r = np.asarray(at(low).r, float)
    x_j = np.zeros((n, D))
    pairs = Rods(np.column_stack([r, u_i, A[0], R[0]]), np.column_stack([x_j, u_j, A[1], R[1]]), D)
    keep = np.sqrt((closest(pairs.spines)[2] ** 2).sum(axis=1)) < pairs.spines.d
    keep &= ~crossing(pairs.spines) if D == 2 else True
    return Rods(pairs.i[keep], pairs.j[keep], D)


class Bond(NamedTuple):
    """Energy, force on i, and both torques of contacts."""

    energy: LongArray
    force: LongArray
    torque_i: LongArray
    torque_j: LongArray


def _bond_at(s: Spines, f: LongArray, t: LongArray, shortest: LongArray | None = None) -> Bond:
    delta = s.r + f[:, None] * s.u_i - t[:, None] * s.u_j
    distance = np.sqrt((delta**2).sum(axis=1))
    overlap = np.maximum(1 - (distance if shortest is None else shortest) / s.d, 0)
    force = (overlap / s.d / distance)[:, None] * delta
    return Bond(overlap**2 / 2, force, f * _turn(s.u_i, force), -t * _turn(s.u_j, force))


def _turn(u: LongArray, force: LongArray) -> LongArray:
    """Torque of a force on a unit lever; its component or its length suffices here."""
    if u.shape[1] == 2:
        return np.asarray(u[:, 0] * force[:, 1] - u[:, 1] * force[:, 0])
    return np.asarray(np.cross(u, force)[:, 0])


def one_bond(s: Spines) -> Bond:
    """Give the contact with one bond, from the definition."""
    f, t, delta = closest(s)
    middle_f, middle_t, overlapping = middle(s)
    flat = (sine(s) < 1e-8) & overlapping
    shortest = np.sqrt((delta**2).sum(axis=1))
    return _bond_at(s, np.where(flat, middle_f, f), np.where(flat, middle_t, t), shortest)


def both_ends(s: Spines) -> Bond:
    """Side-to-side contacts as printed (Fig. 6): a bond at either end of the overlap of the spines."""
    sign = np.where((s.u_i * s.u_j).sum(axis=1) < 0, -1, 1)
    bonds = []
    for e in (-1, 1):
        f_i = e * s.A_i
        t_i = np.clip((s.u_j * (s.r + f_i[:, None] * s.u_i)).sum(axis=1), -s.A_j, s.A_j)
        t_j = e * sign * s.A_j
        f_j = np.clip((s.u_i * (t_j[:, None] * s.u_j - s.r)).sum(axis=1), -s.A_i, s.A_i)
        squares = [
            ((s.r + f[:, None] * s.u_i - t[:, None] * s.u_j) ** 2).sum(axis=1)
            for f, t in ((f_i, t_i), (f_j, t_j))
        ]
        by_i = squares[0] < squares[1]
        bonds.append(_bond_at(s, np.where(by_i, f_i, f_j), np.where(by_i, t_i, t_j)))
    return Bond(*(a + b for a, b in zip(*bonds, strict=True)))


def rod_error(pairs: Rods, expected: Callable[[Spines], Bond] = one_bond, sides: int = 1) -> float:
    """Of forces and torques, in units of overlap; infinite if a contact is lost."""
    found, s = pairs.contacts(sides), pairs.spines
    if len(pairs.i) < 50 or not (found["status"] == _TOUCHING).all():
        return np.inf
    wanted = expected(s)
    R = np.stack([pairs.i[:, -1], pairs.j[:, -1]])
    arms = np.maximum(np.stack([s.A_i, s.A_j]), R)
    by_force = np.abs(found["force"] - wanted.force).max(axis=1) * s.d
    by_torque = [
        np.abs(found[name][:, 0] - torque) * s.d / arm
        for name, torque, arm in (
            ("torque_i", wanted.torque_i, arms[0]),
            ("torque_j", wanted.torque_j, arms[1]),
        )
    ]
    return float(np.max([by_force, *by_torque]))


def rods_in_other_units(D: int, sides: int, length: float, energy: float) -> float:
    """Energies scale with k_e alone, forces with k_e over the length."""
    worst = 0.0
    for pairs in (random_rods(D, 0.01), random_rods(D, 0.01, angle=1e-9)):
        lengths = np.r_[:D, 2 * D : 2 * D + 2]
        i, j = pairs.i.copy(), pairs.j.copy()
        i[:, lengths] *= length
        j[:, lengths] *= length
        small, large = pairs.contacts(sides), Rods(i, j, D).contacts(sides, energy)
        if (small["status"] != large["status"]).any():
            return np.inf
        for name, unit in (("energy", energy), ("force", energy / length), ("torque_i", energy)):
            size = np.abs(small[name]).max()
            worst = max(worst, float(np.abs(large[name] / unit - small[name]).max() / size))
    return 0.01 * worst


def rods_exchanged(D: int, sides: int, angle: float | None) -> float:
    """Compare the force on i with minus that on j when both change places."""
    pairs = random_rods(D, 0.01, angle=angle)
    found, other = pairs.contacts(sides), Rods(pairs.j, pairs.i, D).contacts(sides)
    size = np.abs(found["force"]).max()
    return 0.01 * float(
        max(
            np.abs(found["force"] + other["force"]).max() / size,
            np.abs(found["torque_i"] - other["torque_j"]).max() / size,
        )
    )


def upside_down(D: int, sides: int, angle: float) -> float:
    """Rods have no head."""
    pairs = random_rods(D, 0.01, angle=angle)
    j = pairs.j.copy()
    j[:, D : 2 * D] *= -1
    found, other = pairs.contacts(sides), Rods(pairs.i, j, D).contacts(sides)
    names = ("force", "torque_i", "torque_j")
    return float(max(np.abs(found[n] - other[n]).max() for n in names))


def missed_crossings(depth: float) -> float:
    """Share of crossing spines, by at least this fraction of a radius, that are not called that."""
    rng, n = np.random.default_rng(2), 2000
    A, R = np.exp(rng.uniform(np.log(0.01), np.log(100), (2, n))), np.ones((2, n))
    u_i, u_j = _units(rng, n, 2), _units(rng, n, 2)
    # The tip of i is past spine j, or both cross anywhere.
    sine_ij = np.abs(u_i[:, 0] * u_j[:, 1] - u_i[:, 1] * u_j[:, 0])
    past = depth / np.maximum(sine_ij, depth)
    f = np.where(rng.random(n) < 0.5, A[0] - past, rng.uniform(-0.9, 0.9, n) * A[0])
    t = rng.uniform(-0.9, 0.9, n) * A[1]
    r = t[:, None] * u_j - f[:, None] * u_i
    pairs = Rods(
        np.column_stack([r, u_i, A[0], R[0]]), np.column_stack([0 * r, u_j, A[1], R[1]]), 2
    )
    truly = crossing(pairs.spines)
    missed = [(pairs.contacts(sides)["status"] != _CROSSING)[truly].mean() for sides in (1, 2)]
    return float(max(missed)) if truly.mean() > 0.5 else np.inf


def coincident(D: int, distance: float) -> float:
    """Share of pairs at this distance of the feet that are neither named nor have finite forces."""
    rng, n = np.random.default_rng(3), 200
    u_i, u_j = _units(rng, n, D), _units(rng, n, D)
    r = distance * _units(rng, n, D)
    wrong = 0.0
    for A in (0.0, 1e-6, 1.0, 100.0):
        i = np.column_stack([r, u_i, np.full(n, A), np.ones(n)])
        j = np.column_stack([0 * r, u_j, np.full(n, A), np.ones(n)])
        for sides in (1, 2):
            found = Rods(i, j, D).contacts(sides)
            finite = np.isfinite(found["force"]).all(axis=1) & (found["status"] == _TOUCHING)
            finite &= np.linalg.norm(found["force"], axis=1) > 0
            named = found["status"] == _CROSSING
            right = named if distance == 0.0 or (D == 2 and A == 100.0) else named | finite
            wrong = max(wrong, float(1 - right.mean()))
    return wrong


def rod_cases() -> list[Case]:
    """Pairs of spherocylinders."""
    unit = "force and torque against long double, in overlaps"
    found = []
    for D in (2, 3):
        for overlap in OVERLAPS:
            run = partial(lambda D, x: rod_error(random_rods(D, x)), D, overlap)
            found.append(Case(ROD, f"{D}D, overlap {overlap:.2g}", unit, 3e-15, run))
        for alpha in ((1e-6, 1e-6), (1e-6, 100.0), (100.0, 100.0)):
            run = partial(lambda D, a: rod_error(random_rods(D, 0.05, a)), D, alpha)
            name = f"{D}D, alpha {alpha[0]:g} to {alpha[1]:g}"
            # Axes are rounded by EPS, tips by alpha times that.
            found.append(Case(ROD, name, unit, 3e-15 * (1 + alpha[1]), run))
        run = partial(lambda D: rod_error(random_rods(D, 0.05, (0.1, 10), (0.5, 5))), D)
        found.append(Case(ROD, f"{D}D, size ratio to 10", unit, 3e-14, run))
        for angle in ANGLES:
            pairs = partial(random_rods, D, 0.02, (2, 5), angle=angle)
            run = partial(lambda p: rod_error(p()), pairs)
            found.append(Case(ROD, f"{D}D, parallel to {angle:g}, sides one", unit, 2e-14, run))
            if D == 2 or angle == 0.0:
                run = partial(lambda p: rod_error(p(), both_ends, 2), pairs)
                what = "force and torque against both bonds as printed, in overlaps"
                found.append(Case(ROD, f"{D}D, parallel to {angle:g}, sides two", what, 4e-14, run))
        for sides in (1, 2):
            word = ("one", "two")[sides - 1]
            for length in (2.0**-20, 2.0**20, 1e-6, 1e6):
                limit = 0.0 if np.log2(length) % 1 == 0 else 1e-14
                run = partial(rods_in_other_units, D, sides, length, 1.0)
                name = f"{D}D, sides {word}, unit of length {length:.3g}"
                found.append(Case(ROD, name, "change of scaled forces, in overlaps", limit, run))
            for energy in (2.0**-20, 2.0**20, 1e-6, 1e6):
                limit = 0.0 if np.log2(energy) % 1 == 0 else 1e-17
                run = partial(rods_in_other_units, D, sides, 1.0, energy)
                name = f"{D}D, sides {word}, k_e {energy:.3g}"
                found.append(Case(ROD, name, "change of forces over k_e, in overlaps", limit, run))
            for tilt in (None, 1e-6, 1e-12):
                name = f"{D}D, sides {word}, i and j exchanged, angle {tilt or 'any'}"
                run = partial(rods_exchanged, D, sides, tilt)
                found.append(Case(ROD, name, "change of forces, in overlaps", 1e-14, run))
            run = partial(upside_down, D, sides, 1e-12)
            name = f"{D}D, sides {word}, upside down"
            found.append(Case(ROD, name, "change of forces", 0.0, run))
        for distance in (0.0, 1e-300, 1e-15, 1e-12, 1e-6):
            run = partial(coincident, D, distance)
            name = f"{D}D, centres {distance:g} apart"
            found.append(Case(ROD, name, "share neither named nor finite", 0.0, run))
    for depth in (0.5, 1e-6, 1e-12):
        run = partial(missed_crossings, depth)
        name = f"spines cross by {depth:g} of a radius"
        found.append(Case(ROD, name, "share of crossings missed", 0.0, run))
    return found


# --- pairs of superellipsoids --------------------------------------------------------------------


class Bodies(NamedTuple):
    """M superellipsoids."""

    centre: FloatArray
    turn: FloatArray
    axes: FloatArray
    p: FloatArray

    @property
    def rows(self) -> FloatArray:
        """As the binding takes them."""
        columns = [self.centre, self.turn, self.axes, self.p[:, None]]
        return np.ascontiguousarray(np.hstack(columns))

    @property
    def matrix(self) -> LongArray:
        """(M, D, D) rotations in long double."""
        turn = np.asarray(self.turn, np.longdouble)
        if turn.shape[1] == 1:
            c, s = np.cos(turn[:, 0]), np.sin(turn[:, 0])
            return np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], 1)
        turn = turn / np.sqrt((turn**2).sum(axis=1, keepdims=True))
        w, i, j, k = turn.T
        rows = [
            [w * w + i * i - j * j - k * k, 2 * (i * j - w * k), 2 * (i * k + w * j)],
            [2 * (i * j + w * k), w * w - i * i + j * j - k * k, 2 * (j * k - w * i)],
            [2 * (i * k - w * j), 2 * (j * k + w * i), w * w - i * i - j * j + k * k],
        ]
        return np.stack([np.stack(row, -1) for row in rows], 1)

    def inside(self, v: LongArray) -> LongArray:
        """Components of vectors along the body's axes."""
        return np.asarray(np.einsum("nba,nb->na", self.matrix, v))


def _norm(ratio: LongArray, order: LongArray) -> LongArray:
    most = np.asarray(ratio.max(axis=1))
    return np.asarray(most * ((ratio / most[:, None]) ** order[:, None]).sum(axis=1) ** (1 / order))


def bounds(i: Bodies, j: Bodies, normal: FloatArray, point: FloatArray) -> tuple[LongArray, ...]:
    """Bounds of the scale of contact, from below by a plane and from above by a point, in long double."""
    r = np.asarray(i.centre, np.longdouble) - j.centre
    n, y = np.asarray(normal, np.longdouble), -np.asarray(point, np.longdouble)
    widths, gauges = [], []
    for body, at in ((i, y), (j, r - y)):
        p = np.asarray(body.p, np.longdouble)
        axes = np.asarray(body.axes, np.longdouble)
        widths.append(_norm(np.abs(body.inside(n)) * axes, 2 * p / (2 * p - 1)))
        gauges.append(_norm(np.abs(body.inside(at)) / axes, 2 * p))
    return (r * n).sum(axis=1) / (widths[0] + widths[1]), np.maximum(*gauges)


def random_super(
    D: int, p: ArrayLike, w: tuple[float, float] = (0.1, 10.0), size: float = 1.0, n: int = 200
) -> tuple[Bodies, Bodies]:
    """Pairs of any orientation; ratios of semi-axes log-uniform between bounds."""
    rng = np.random.default_rng(4)

    def bodies(p: ArrayLike, size: float) -> Bodies:
        quaternion = rng.normal(size=(n, 4))
        turn = rng.uniform(-3, 3, (n, 1)) if D == 2 else quaternion
        if D == 3:
            turn = turn / np.linalg.norm(turn, axis=1, keepdims=True)
        axes = np.exp(rng.uniform(np.log(w[0]), np.log(w[1]), (n, D)))
        axes[:, 0] = 1.0
        largest = np.exp(rng.uniform(0, np.log(size), n)) if size > 1 else np.ones(n)
        order = np.broadcast_to(np.asarray(p, float), n)
        return Bodies(rng.normal(size=(n, D)), turn, axes * largest[:, None], order)

    both = np.asarray(p, float)
    p_i, p_j = (both, both) if both.ndim == 0 else rng.choice(both, (2, n))
    return bodies(p_i, 1.0), bodies(p_j, size)


def at_overlap(i: Bodies, j: Bodies, overlap: float) -> tuple[Bodies, Bodies]:
    """Move i along the line of centres to 1 - eta^2 = overlap."""
    eta = _contact.superellipsoid_scales(i.rows, j.rows)["eta"]
    r = (i.centre - j.centre) * (np.sqrt(1 - overlap) / eta)[:, None]
    return i._replace(centre=r), j._replace(centre=0 * r)


def scale_error(i: Bodies, j: Bodies) -> float:
    """Relative gap between independent bounds of the scale, or how far it lies outside of them."""
    found = _contact.superellipsoid_scales(i.rows, j.rows)
    low, high = bounds(i, j, found["normal"], found["point_i"])
    eta = found["eta"]
    return float(np.max([(high - low) / eta, (low - eta) / eta, (eta - high) / eta]))


def force_error(i: Bodies, j: Bodies, overlap: float) -> float:
    """F.r = 2 eta^2 (1 - eta^2), and no torque on the pair as a whole; in overlaps."""
    found = _contact.superellipsoid_contacts(i.rows, j.rows, 1.0)
    scales = _contact.superellipsoid_scales(i.rows, j.rows)
    low, high = bounds(i, j, scales["normal"], scales["point_i"])
    square = ((low + high) / 2) ** 2
    if overlap > 1e-12 and not (found["status"] == _TOUCHING).all():
        return np.inf
    names = ("energy", "force", "torque_i", "torque_j")
    if not all(np.isfinite(found[name]).all() for name in names):
        return np.inf
    r = i.centre - j.centre
    work = (found["force"] * r).sum(axis=1) - 2 * square * np.maximum(1 - square, 0)
    energy = found["energy"] - np.maximum(1 - square, 0) ** 2 / 2
    force, torques = found["force"], found["torque_i"] + found["torque_j"]
    if r.shape[1] == 2:
        rest = torques + (r[:, 0] * force[:, 1] - r[:, 1] * force[:, 0])[:, None]
    else:
        rest = torques + np.cross(r, force)
    size = np.linalg.norm(force, axis=1) * np.maximum(i.axes.max(1), j.axes.max(1)) + 1e-300
    share = np.abs(rest).max(axis=1) / size * overlap
    return float(max(np.abs(work).max(), np.abs(energy).max() / max(overlap, EPS), share.max()))


def aligned_error(p: float, tilt: float) -> float:
    """Face on face and tip on tip: closed form for aligned bodies, bounds for tilted ones."""
    n = 60
    rng = np.random.default_rng(5)
    axes = np.exp(rng.uniform(-1, 1, (n, 3)))
    factor = np.exp(rng.uniform(-2.3, 2.3, (n, 1)))
    r = np.eye(3)[rng.integers(0, 3, n)] * axes * (1 + factor) * 0.95
    r += rng.choice([0.0, 1e-9, 0.1], (n, 1)) * axes * rng.uniform(-1, 1, (n, 3))
    turn = np.column_stack([np.ones(n), tilt / 2 * rng.normal(size=(n, 3))])
    ratio = np.abs(np.asarray(r, np.longdouble)) / (axes + factor * axes)
    r *= np.asarray(0.95 / _norm(ratio, np.full(n, 2 * p)), float)[:, None]
    i = Bodies(r, turn, axes, np.full(n, p))
    j = Bodies(0 * r, np.tile([1.0, 0, 0, 0], (n, 1)), factor * axes, np.full(n, p))
    worst = max(scale_error(i, j), force_error(i, j, 0.1))
    if tilt == 0.0:
        eta = _contact.superellipsoid_scales(i.rows, j.rows)["eta"]
        ratio = np.abs(np.asarray(r, np.longdouble)) / (axes + factor * axes)
        worst = max(worst, float(np.abs(eta / _norm(ratio, np.full(n, 2 * p)) - 1).max()))
    return worst


def super_in_other_units(length: float, energy: float) -> float:
    """Energies scale with epsilon alone, forces with epsilon over the length."""
    i, j = at_overlap(*random_super(3, EXPONENTS), 0.1)
    small = _contact.superellipsoid_contacts(i.rows, j.rows, 1.0)
    i, j = (b._replace(centre=length * b.centre, axes=length * b.axes) for b in (i, j))
    large = _contact.superellipsoid_contacts(i.rows, j.rows, energy)
    force = np.linalg.norm(small["force"], axis=1)
    arm = np.maximum(i.axes.max(axis=1), j.axes.max(axis=1)) / length
    worst = 0.0
    for name, unit, size in (
        ("energy", energy, small["energy"]),
        ("force", energy / length, force),
        ("torque_i", energy, arm * force),
    ):
        value = small[name].reshape(len(i.p), -1)
        change = np.abs(large[name].reshape(value.shape) / unit - value).max(axis=1)
        worst = max(worst, float((change / size).max()))
    return 0.1 * worst


def concentric(distance: float) -> float:
    """Share of pairs at this distance that are neither named nor have finite forces."""
    wrong = 0.0
    for D in (2, 3):
        i, j = random_super(D, EXPONENTS)
        i = i._replace(centre=distance * i.centre)
        j = j._replace(centre=0 * j.centre)
        found = _contact.superellipsoid_contacts(i.rows, j.rows, 1.0)
        finite = np.isfinite(found["force"]).all(axis=1) & (found["status"] == _TOUCHING)
        finite &= np.linalg.norm(found["force"], axis=1) > 0
        named = found["status"] == _CROSSING
        wrong = max(wrong, float(1 - (named if distance == 0 else named | finite).mean()))
    return wrong


def super_cases() -> list[Case]:
    """Pairs of superellipsoids."""
    gap = "gap of independent bounds of eta"
    law = "F.r, energy and torque balance, in overlaps"
    found = []
    for D in (2, 3):
        for p in EXPONENTS:
            run = partial(lambda D, p: scale_error(*random_super(D, p)), D, p)
            found.append(Case(SUPER, f"{D}D, p {p:g}, w 0.1 to 10", gap, 5e-14, run))
            run = partial(
                lambda D, p: force_error(*at_overlap(*random_super(D, p), 0.1), 0.1), D, p
            )
            found.append(Case(SUPER, f"{D}D, p {p:g}, forces", law, 1e-12, run))
        for overlap in OVERLAPS:
            run = partial(
                lambda D, x: force_error(*at_overlap(*random_super(D, EXPONENTS), x), x), D, overlap
            )
            found.append(Case(SUPER, f"{D}D, overlap {overlap:.2g}", law, 1e-13, run))
        run = partial(lambda D: scale_error(*random_super(D, (0.55, 10.0), size=10.0)), D)
        found.append(Case(SUPER, f"{D}D, p 0.55 with 10, size ratio to 10", gap, 5e-14, run))
    for p in (0.55, 1.0, 2.0, 10.0):
        for tilt in (0.0, 1e-14, 1e-12, 1e-6, 1e-3):
            run = partial(aligned_error, p, tilt)
            what = f"{gap}, closed form, forces"
            found.append(Case(SUPER, f"aligned to {tilt:g}, p {p:g}", what, 1e-13, run))
    for length in (1e-6, 1e6):
        run = partial(super_in_other_units, length, 1.0)
        what = "change of scaled forces, in overlaps"
        found.append(Case(SUPER, f"unit of length {length:g}", what, 1e-10, run))
    for energy in (1e-6, 1e6):
        run = partial(super_in_other_units, 1.0, energy)
        found.append(
            Case(SUPER, f"epsilon {energy:g}", "change of forces over epsilon", 1e-15, run)
        )
    for distance in (0.0, 1e-300, 1e-15, 1e-8):
        run = partial(concentric, distance)
        name = f"centres {distance:g} apart"
        found.append(Case(SUPER, name, "share neither named nor finite", 0.0, run))
    return found


# --- packings ------------------------------------------------------------------------------------

RODS: dict[str, Callable[[], Packing]] = {
    "alpha 1e-6 to 100 in one box": partial(all_aspect_ratios, 2),
    "3D, alpha 1e-6 to 10 in one box": partial(all_aspect_ratios, 3, 10.0),
    "3D, alpha 1e-6 to 100 in one box": partial(all_aspect_ratios, 3),
    "sizes 1 to 10": partial(all_sizes, 2),
    "3D, sizes 1 to 10": partial(all_sizes, 3),
    "longer than the box": longer_than_the_box,
    "own images": partial(own_images, 2),
    "3D, own images": partial(own_images, 3),
    "overlaps of a third": partial(deep, 2),
    "3D, overlaps of a third": partial(deep, 3),
    **{f"stack to {a:g}": partial(stack, a, 2) for a in (1e-6, 1e-10, 1e-14)},
    **{f"3D, stack to {a:g}": partial(stack, a, 3) for a in (1e-6, 1e-10, 1e-14)},
}
SUPERS: dict[str, Callable[[], Packing]] = {
    "p 0.55 to 10 in one box": partial(scattered_superellipsoids, EXPONENTS, (1.0,)),
    "w 0.1 to 10 in one box": partial(scattered_superellipsoids, (1.0, 1.5), (0.1, 1.0, 10.0)),
    "2D, p 0.55 to 10, w to 10": partial(
        scattered_superellipsoids, (0.55, 1.0, 10.0), (10.0, 1.0), 2
    ),
    "overlaps of a third": partial(scattered_superellipsoids, (0.75, 2.0), (1.0, 3.0), 3, 1 / 3),
}


def needles() -> Packing:
    """Ellipsoids longer than the box: they touch their own images."""
    turn = [[1.0, 0.1, 0.2, 0.3], [1.0, -0.1, 0.2, 0.31]]
    position = [[0.0, 0.0, 0.0], [0.6, 0.7, 0.5]]
    loose = superellipsoids(position, turn, [0.3, 0.3, 3.0], [1.0, 1.5], [2.2, 2.2, 3.0])
    return pressed(loose, 0.1)


SUPERS["own images, w 10"] = needles


@cache
def expected_of(scene: Callable[[], Packing]) -> Found:
    """Ask what the oracle says of a scene."""
    return oracle(scene())


def against_oracle(scene: Callable[[], Packing]) -> float:
    """Compare forces of one-bond contacts in long double, relative to the largest; contacts counted."""
    packing = scene()
    landscape, expected = Landscape(packing, sides=1), expected_of(scene)
    found = landscape.evaluate(State.of(packing))
    if found.n_bonds != expected.n_contacts:
        return np.inf
    components = landscape.components(found.gradient)
    D = packing.dimension
    by_force = np.abs(components[:, :D] + expected.force).max()
    arm = np.where(landscape.rotation_length > 0, landscape.rotation_length, 1.0)
    turns = (landscape.rotation_length > 0)[:, None]
    by_torque = np.abs(components[:, D:] + expected.torque / arm[:, None])[turns[:, 0]]
    return float(max(by_force, by_torque.max(initial=0.0)) / expected.largest)


def contacts_lost(scene: Callable[[], Packing]) -> float:
    """Contacts that `find_contacts` has too few or too many, over all pairs and images."""
    packing = scene()
    network = find_contacts(packing)
    if packing.shape_style == "spherocylinder":
        return float(abs(expected_of(scene).n_contacts - len(network.pairs)))
    pairs, shift = every_image(packing)
    rows, D = superellipsoid_bodies(packing), packing.dimension
    j = rows[pairs[:, 1]].copy()
    j[:, :D] += shift * packing.box.edges
    touching = _contact.superellipsoid_overlap(np.ascontiguousarray(rows[pairs[:, 0]]), j)
    expected = np.column_stack([pairs, shift])[touching].tolist()
    found = np.column_stack([network.pairs, network.shift]).tolist()
    return float(len({*map(tuple, expected)} ^ {*map(tuple, found)}))


def slope_error(scene: Callable[[], Packing], sides: int = 2, size: float = 1e-6) -> float:
    """Differences of energies along random directions against forces, relative."""
    packing = scene()
    landscape, state = Landscape(packing, sides=sides), State.of(packing)
    length = landscape.components(np.ones(landscape.size))
    D, rng = packing.dimension, np.random.default_rng(6)
    length[:, :D] *= landscape.inner_radius[:, None]
    length[:, D:] *= landscape.rotation_length[:, None]
    scale = length[length > 0]
    gradient = landscape.evaluate(state).gradient
    largest = float(np.linalg.norm(gradient * scale))
    worst = 0.0
    for _ in range(6):
        v = scale * rng.normal(size=len(scale)) / np.sqrt(len(scale))
        ahead, behind = (
            landscape.evaluate(landscape.displaced(state, h * v)).energy for h in (size, -size)
        )
        worst = max(worst, abs((ahead - behind) / (2 * size) - float(gradient @ v)) / largest)
    return worst


def doubles_error(scene: Callable[[], Packing], sides: int = 2) -> float:
    """Doubles against long doubles, in overlaps."""
    packing = scene()
    landscape, state = Landscape(packing, sides=sides), State.of(packing)
    long, short = (landscape.evaluate(state, extended=x).gradient for x in (True, False))
    return float(np.abs(long - short).max() * 2 * landscape.inner_radius.min())


def moved_error(scene: Callable[[], Packing]) -> float:
    """Move, wrap and reorder: change of forces relative to the largest."""
    packing = scene()
    landscape, state = Landscape(packing), State.of(packing)
    expected = landscape.components(landscape.evaluate(state).gradient)
    rng = np.random.default_rng(7)
    order = rng.permutation(packing.n)
    x = state.position + rng.random(packing.dimension) * state.edges
    x = x + rng.integers(-3, 4, x.shape) * state.edges
    names = ("diameters", "exponent", "species", "id")
    mixed = packing.with_(**{name: getattr(packing, name)[order] for name in names})
    other = Landscape(mixed)
    there = State(x[order], state.orientation[order], state.edges)
    found = other.components(other.evaluate(there).gradient)
    return float(np.abs(found - expected[order]).max() / np.abs(expected).max())


def units_error(scene: Callable[[], Packing], length: float, energy: float) -> float:
    """Give the same packing in other units: forces relative to the largest."""
    packing = scene()
    small, large = Landscape(packing), Landscape(scaled(packing, length), energy)
    a = small.evaluate(State.of(packing))
    b = large.evaluate(State.of(large.particles))
    if a.n_bonds != b.n_bonds:
        return np.inf
    change = np.abs(b.gradient * (length / energy) - a.gradient).max()
    return float(change / np.abs(a.gradient).max())


def second_derivatives(scene: Callable[[], Packing], h: float) -> float:
    """v.H v against differences of forces along v, relative: rotations in space do not commute."""
    packing = scene()
    landscape, state = Landscape(packing), State.of(packing)
    hessian = landscape.curvature(state, extended=True).hessian
    rng, worst = np.random.default_rng(8), 0.0
    size = float(landscape.inner_radius.min())
    turning = np.where(landscape.rotation_length > 0, landscape.rotation_length, size)
    part = np.minimum(turning, size)[landscape.particle_of_coordinate()]
    for _ in range(6):
        v = part * rng.normal(size=landscape.size)
        ahead, behind = (
            landscape.evaluate(landscape.displaced(state, x * v)).gradient for x in (h, -h)
        )
        size_of = float(np.abs(v) @ np.abs(hessian @ v))
        worst = max(worst, abs(float(v @ (ahead - behind)) / (2 * h) - v @ (hessian @ v)) / size_of)
    return worst


def barely_touching(overlap: float) -> float:
    """Resolve in long double what a double drops: relative error of one force in a box of 1000."""
    state_edges = np.full(2, np.longdouble(1000))
    packing = rods([[-400.3, 0.0], [-399.3, 0.0]], [0.0, 0.0], 0.0, 0.5, [1000.0, 1000.0])
    x = np.array([[-400.3, 0.1], [0.0, 0.1]], np.longdouble)
    x[1, 0] = x[0, 0] + 1 - np.longdouble(overlap)
    state = State(x, State.of(packing).orientation, state_edges)
    found = Landscape(packing).evaluate(state)
    true = 1 - (x[1, 0] - x[0, 0])
    rounding = LONG_EPS * 400 / overlap
    error = abs(float(found.gradient[0] / true) - 1)
    return max(error - 4 * rounding, 0.0)


def _concentric(packing: Packing) -> str:
    first = packing.position[0]
    both = packing.with_(position=np.array([first, first, *packing.position[2:]]))
    Landscape(both).evaluate(State.of(both))
    return "no sentence"


def packing_cases() -> list[Case]:
    """List sums over packings."""
    found = []
    lost, unit = "contacts too few or too many", "forces against long double over all images"
    for name, scene in RODS.items():
        found += [
            Case(ROD_SUM, f"{name}: contacts", lost, 0.0, partial(contacts_lost, scene)),
            Case(ROD_SUM, f"{name}: forces", unit, 1e-14, partial(against_oracle, scene)),
        ]
    # A stack at 1e-6 and below is within 1e-6 of kinks of the one-bond energy.
    smooth = {k: v for k, v in RODS.items() if "stack" not in k}
    for part, scenes, short in ((ROD_SUM, smooth, 1e-13), (SUPER_SUM, SUPERS, 1e-12)):
        for name, scene in scenes.items():
            slope, doubles = partial(slope_error, scene), partial(doubles_error, scene)
            what = "differences of energies against forces"
            found.append(Case(part, f"{name}: slopes", what, 1e-7, slope))
            what = "doubles against long doubles, in overlaps"
            limit = short * (100 if "100" in name or "longer" in name else 1)
            found.append(Case(part, f"{name}: doubles", what, limit, doubles))
            what = "change of forces by moving, wrapping, order"
            found.append(Case(part, f"{name}: moved", what, 1e-13, partial(moved_error, scene)))
            for length, energy in ((1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6)):
                run = partial(units_error, scene, length, energy)
                label = f"{name}: length {length:g}, k_e {energy:g}"
                found.append(Case(part, label, "change of scaled forces", 1e-12, run))
    for name in ("p 0.55 to 10 in one box", "w 0.1 to 10 in one box", "own images, w 10"):
        run = partial(contacts_lost, SUPERS[name])
        found.append(Case(SUPER_SUM, f"{name}: contacts", lost, 0.0, run))
    for name in ("alpha 1e-6 to 100 in one box", "sizes 1 to 10", "overlaps of a third"):
        run = partial(second_derivatives, RODS[name], 1e-9)
        what = "Hessian against differences of forces"
        found.append(Case(ROD_SUM, f"{name}: Hessian", what, 1e-6, run))
    for name in ("w 0.1 to 10 in one box", "own images, w 10", "overlaps of a third"):
        run = partial(second_derivatives, SUPERS[name], 1e-6)
        what = "Hessian against differences of forces"
        found.append(Case(SUPER_SUM, f"{name}: Hessian", what, 1e-6, run))
    for overlap in (1e-6, 1e-10, 1e-14):
        run = partial(barely_touching, overlap)
        name = f"overlap {overlap:g} in a box of 1000"
        found.append(Case(ROD_SUM, name, "relative error beyond rounding of x", 1e-15, run))
    two = partial(lambda: _concentric(own_images(2)))
    found.append(Case(ROD_SUM, "coincident rods", "sentence", _CROSS, two))
    two = partial(lambda: _concentric(needles()))
    found.append(Case(SUPER_SUM, "concentric bodies", "sentence", _CROSS, two))
    return found


def cases() -> list[Case]:
    """All of them."""
    found = [*rod_cases(), *super_cases(), *packing_cases()]
    return [replace(case, heavy=HEAVY in case.name) for case in found]
