"""Cases of the stability battery: contacts of pairs of superellipsoids."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from battery.case import Case
from battery.pairs import OVERLAPS, TOUCHING, in_other_units, unnamed
from battery.scenes.making import EPS
from battery.scenes.superellipsoids import EXPONENTS
from jamshape.arrays import FloatArray, LongArray
from jamshape.shapes.single_pairs import superellipsoid_contacts, superellipsoid_scales

PART = "contact of superellipsoids"

_GAP = "gap of independent bounds of eta"
_LAW = "F.r, energy and torque balance, in overlaps"


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


class Couples(NamedTuple):
    """M pairs."""

    i: Bodies
    j: Bodies

    def contacts(self, k_e: float = 1.0, sides: int = 1) -> dict[str, NDArray[Any]]:
        """As `Pairs.contacts`; they have one law."""
        del sides
        return superellipsoid_contacts(self.i.rows, self.j.rows, k_e)

    def scales(self) -> dict[str, NDArray[Any]]:
        """Scales of contact, and how they were found."""
        return superellipsoid_scales(self.i.rows, self.j.rows)

    def in_unit(self, length: float) -> Couples:
        """As `Pairs.in_unit`."""
        both = (b._replace(centre=length * b.centre, axes=length * b.axes) for b in self)
        return Couples(*both)

    def at(self, r: FloatArray) -> Couples:
        """Move i to these places beside j."""
        return Couples(self.i._replace(centre=r), self.j._replace(centre=0 * r))

    @property
    def r(self) -> FloatArray:
        """(M, D) centres of i relative to those of j."""
        return np.asarray(self.i.centre - self.j.centre)

    @property
    def arms(self) -> FloatArray:
        """As `Pairs.arms`."""
        return np.asarray(np.maximum(self.i.axes.max(axis=1), self.j.axes.max(axis=1)))


# --- pairs ---------------------------------------------------------------------------------------


def random_pairs(D: int, p: ArrayLike, size: float = 1.0, n: int = 200) -> Couples:
    """Pairs of any orientation, ratios of semi-axes log-uniform from 0.1 to 10."""
    rng = np.random.default_rng(4)

    def bodies(p: ArrayLike, size: float) -> Bodies:
        quaternion = rng.normal(size=(n, 4))
        turn = rng.uniform(-3, 3, (n, 1)) if D == 2 else quaternion
        if D == 3:
            turn = turn / np.linalg.norm(turn, axis=1, keepdims=True)
        axes = np.exp(rng.uniform(np.log(0.1), np.log(10.0), (n, D)))
        axes[:, 0] = 1.0
        largest = np.exp(rng.uniform(0, np.log(size), n)) if size > 1 else np.ones(n)
        order = np.broadcast_to(np.asarray(p, float), n)
        return Bodies(rng.normal(size=(n, D)), turn, axes * largest[:, None], order)

    both = np.asarray(p, float)
    p_i, p_j = (both, both) if both.ndim == 0 else rng.choice(both, (2, n))
    return Couples(bodies(p_i, 1.0), bodies(p_j, size))


def at_overlap(pairs: Couples, overlap: float) -> Couples:
    """Move i along the line of centres to 1 - eta^2 = overlap."""
    eta = pairs.scales()["eta"]
    return pairs.at(pairs.r * (np.sqrt(1 - overlap) / eta)[:, None])


def aligned(p: float, tilt: float) -> Couples:
    """Face on face and tip on tip, but for a tilt."""
    n, rng = 60, np.random.default_rng(5)
    axes = np.exp(rng.uniform(-1, 1, (n, 3)))
    factor = np.exp(rng.uniform(-2.3, 2.3, (n, 1)))
    r = np.eye(3)[rng.integers(0, 3, n)] * axes * (1 + factor) * 0.95
    r += rng.choice([0.0, 1e-9, 0.1], (n, 1)) * axes * rng.uniform(-1, 1, (n, 3))
    turn = np.column_stack([np.ones(n), tilt / 2 * rng.normal(size=(n, 3))])
    i = Bodies(r, turn, axes, np.full(n, p))
    j = Bodies(0 * r, np.tile([1.0, 0, 0, 0], (n, 1)), factor * axes, np.full(n, p))
    found = Couples(i, j)
    return found.at(r * np.asarray(0.95 / _scale_if_aligned(found), float)[:, None])


def _scale_if_aligned(pairs: Couples) -> LongArray:
    """Scale of contact in closed form, of bodies of the same exponent along the same axes."""
    ratio = np.abs(np.asarray(pairs.r, np.longdouble)) / (pairs.i.axes + pairs.j.axes)
    return _norm(np.asarray(ratio, np.longdouble), np.asarray(2 * pairs.i.p, np.longdouble))


def _norm(ratio: LongArray, order: LongArray) -> LongArray:
    most = np.asarray(ratio.max(axis=1))
    return np.asarray(most * ((ratio / most[:, None]) ** order[:, None]).sum(axis=1) ** (1 / order))


# --- what is judged ------------------------------------------------------------------------------


def bounds(pairs: Couples, normal: FloatArray, point: FloatArray) -> tuple[LongArray, LongArray]:
    """Bounds of the scale of contact, from below by a plane and from above by a point, in long double."""
    r = np.asarray(pairs.i.centre, np.longdouble) - pairs.j.centre
    n, y = np.asarray(normal, np.longdouble), -np.asarray(point, np.longdouble)
    widths, gauges = [], []
    for body, at in ((pairs.i, y), (pairs.j, r - y)):
        p = np.asarray(body.p, np.longdouble)
        axes = np.asarray(body.axes, np.longdouble)
        widths.append(_norm(np.abs(body.inside(n)) * axes, 2 * p / (2 * p - 1)))
        gauges.append(_norm(np.abs(body.inside(at)) / axes, 2 * p))
    return (r * n).sum(axis=1) / (widths[0] + widths[1]), np.maximum(*gauges)


def scale_error(pairs: Couples) -> float:
    """Relative gap between independent bounds of the scale, or how far it lies outside of them."""
    found = pairs.scales()
    low, high = bounds(pairs, found["normal"], found["point_i"])
    eta = found["eta"]
    return float(np.max([(high - low) / eta, (low - eta) / eta, (eta - high) / eta]))


def force_error(pairs: Couples, overlap: float) -> float:
    """F.r = 2 eta^2 (1 - eta^2), and no torque on the pair as a whole; in overlaps."""
    found, scales = pairs.contacts(), pairs.scales()
    low, high = bounds(pairs, scales["normal"], scales["point_i"])
    square = ((low + high) / 2) ** 2
    if overlap > 1e-12 and not (found["status"] == TOUCHING).all():
        return np.inf
    names = ("energy", "force", "torque_i", "torque_j")
    if not all(np.isfinite(found[name]).all() for name in names):
        return np.inf
    force, r = found["force"], pairs.r
    work = (force * r).sum(axis=1) - 2 * square * np.maximum(1 - square, 0)
    energy = found["energy"] - np.maximum(1 - square, 0) ** 2 / 2
    rest = found["torque_i"] + found["torque_j"] + _moment(r, force)
    size = np.linalg.norm(force, axis=1) * pairs.arms + 1e-300
    share = np.abs(rest).max(axis=1) / size * overlap
    return float(max(np.abs(work).max(), np.abs(energy).max() / max(overlap, EPS), share.max()))


def _moment(r: FloatArray, force: FloatArray) -> FloatArray:
    if r.shape[1] == 2:
        return np.asarray((r[:, 0] * force[:, 1] - r[:, 1] * force[:, 0])[:, None])
    return np.asarray(np.cross(r, force))


def random_scale_error(D: int, p: ArrayLike, size: float = 1.0) -> float:
    """As `scale_error`, of random pairs."""
    return scale_error(random_pairs(D, p, size))


def random_force_error(D: int, p: ArrayLike, overlap: float) -> float:
    """As `force_error`, of random pairs."""
    return force_error(at_overlap(random_pairs(D, p), overlap), overlap)


def aligned_error(p: float, tilt: float) -> float:
    """Face on face and tip on tip: closed form for aligned bodies, bounds for tilted ones."""
    pairs = aligned(p, tilt)
    worst = max(scale_error(pairs), force_error(pairs, 0.1))
    if tilt == 0.0:
        eta = pairs.scales()["eta"]
        worst = max(worst, float(np.abs(eta / _scale_if_aligned(pairs) - 1).max()))
    return worst


def in_units(length: float, energy: float) -> float:
    """Change of scaled forces, in overlaps."""
    pairs = at_overlap(random_pairs(3, EXPONENTS), 0.1)
    return 0.1 * in_other_units(pairs, 1, length, energy)


def concentric(distance: float) -> float:
    """Share of pairs at this distance that are neither named nor have finite forces."""
    wrong = 0.0
    for D in (2, 3):
        pairs = random_pairs(D, EXPONENTS)
        there = pairs.at(distance * pairs.i.centre)
        wrong = max(wrong, unnamed(there, 1, must_cross=distance == 0))
    return wrong


# --- cases ---------------------------------------------------------------------------------------


def in_dimension(D: int) -> Iterator[Case]:
    """List random pairs."""
    for p in EXPONENTS:
        run = partial(random_scale_error, D, p)
        yield Case(PART, f"{D}D, p {p:g}, w 0.1 to 10", _GAP, 5e-14, run)
        run = partial(random_force_error, D, p, 0.1)
        yield Case(PART, f"{D}D, p {p:g}, forces", _LAW, 1e-12, run)
    for overlap in OVERLAPS:
        run = partial(random_force_error, D, EXPONENTS, overlap)
        yield Case(PART, f"{D}D, overlap {overlap:.2g}", _LAW, 1e-13, run)
    run = partial(random_scale_error, D, (0.55, 10.0), 10.0)
    yield Case(PART, f"{D}D, p 0.55 with 10, size ratio to 10", _GAP, 5e-14, run)


def cases() -> list[Case]:
    """All of them."""
    found = [*in_dimension(2), *in_dimension(3)]
    for p in (0.55, 1.0, 2.0, 10.0):
        for tilt in (0.0, 1e-14, 1e-12, 1e-6, 1e-3):
            label, run = f"aligned to {tilt:g}, p {p:g}", partial(aligned_error, p, tilt)
            found.append(Case(PART, label, f"{_GAP}, closed form, forces", 1e-13, run))
    for unit in (1e-6, 1e6):
        what, run = "change of scaled forces, in overlaps", partial(in_units, unit, 1.0)
        found.append(Case(PART, f"unit of length {unit:g}", what, 1e-10, run))
        what, run = "change of forces over epsilon", partial(in_units, 1.0, unit)
        found.append(Case(PART, f"epsilon {unit:g}", what, 1e-15, run))
    for distance in (0.0, 1e-300, 1e-15, 1e-8):
        name, run = f"centres {distance:g} apart", partial(concentric, distance)
        found.append(Case(PART, name, "share neither named nor finite", 0.0, run))
    return found
