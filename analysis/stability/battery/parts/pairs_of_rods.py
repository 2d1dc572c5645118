"""Cases of the stability battery: contacts of pairs of rods."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from battery.case import Case
from battery.oracle import PARALLEL_SINE, Spines, closest, crossing, middle, sine
from battery.pairs import CROSSING, OVERLAPS, TOUCHING, in_other_units, unnamed
from jamshape.arrays import FloatArray, LongArray
from jamshape.shapes.single_pairs import spherocylinder_contacts

PART = "contact of spherocylinders"

ANGLES = (1e-2, 1e-6, 1e-7, 1e-9, 1e-10, 1e-12, 1e-14, 0.0)
SIDES = {"one": 1, "two": 2}

_UNIT = "force and torque against long double, in overlaps"


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
        axes = i[:, D : 2 * D], j[:, D : 2 * D]
        return Spines(r, *axes, i[:, -2], j[:, -2], i[:, -1] + j[:, -1])

    def contacts(self, k_e: float = 1.0, sides: int = 1) -> dict[str, NDArray[Any]]:
        """As `Pairs.contacts`."""
        i, j = map(np.ascontiguousarray, self[:2])
        return spherocylinder_contacts(i, j, k_e, sides)

    def in_unit(self, length: float) -> Rods:
        """As `Pairs.in_unit`."""
        factor = np.ones(self.i.shape[1])
        factor[np.r_[: self.D, 2 * self.D : 2 * self.D + 2]] = length
        return Rods(self.i * factor, self.j * factor, self.D)

    @property
    def arms(self) -> FloatArray:
        """As `Pairs.arms`: half lengths, or radii if these are larger."""
        return np.asarray(np.maximum(self.i[:, -2:].max(axis=1), self.j[:, -2:].max(axis=1)))


# --- pairs ---------------------------------------------------------------------------------------


class Drawn(NamedTuple):
    """How pairs are drawn: alpha and R log-uniform between bounds; in all directions, or nearly parallel."""

    overlap: float
    alpha: tuple[float, float] = (1.0, 1.0)
    size: tuple[float, float] = (0.5, 0.7)
    angle: float | None = None
    n: int = 400


def _units(rng: np.random.Generator, n: int, D: int) -> FloatArray:
    u = rng.normal(size=(n, D))
    return np.asarray(u / np.linalg.norm(u, axis=1, keepdims=True))


def _log_uniform(rng: np.random.Generator, bounds: tuple[float, float], n: int) -> FloatArray:
    return np.asarray(np.exp(rng.uniform(np.log(bounds[0]), np.log(bounds[1]), (2, n))))


def _across(v: FloatArray, u: FloatArray) -> FloatArray:
    """Make unit vectors along the parts of v across u."""
    rest = v - (v * u).sum(axis=1, keepdims=True) * u
    return np.asarray(rest / np.linalg.norm(rest, axis=1, keepdims=True))


def random_rods(D: int, drawn: Drawn) -> Rods:
    """Pairs that overlap as asked for."""
    rng, n, angle = np.random.default_rng(1), drawn.n, drawn.angle
    R = _log_uniform(rng, drawn.size, n)
    A = R * _log_uniform(rng, drawn.alpha, n)
    u_i, u_j = _units(rng, n, D), _units(rng, n, D)
    if angle is not None:
        across = _across(u_j, u_i)
        u_j = rng.choice([-1, 1], (n, 1)) * (u_i + angle * across)  # length 1 to angle^2 / 2
        u_j /= np.linalg.norm(u_j, axis=1, keepdims=True)
    line = _units(rng, n, D)
    if angle is not None:  # side by side
        line = _across(line, u_i)
    offset = rng.uniform(-0.5, 0.5, (n, 1)) * A.min(axis=0)[:, None] * u_i * (angle is not None)
    long = [np.asarray(y, np.longdouble) for y in (offset, u_i, u_j, A[0], A[1], R.sum(0))]
    r = np.asarray(_apart_along(line, Spines(*long), drawn.overlap), float)
    i, j = np.column_stack([r, u_i, A[0], R[0]]), np.column_stack([0 * r, u_j, A[1], R[1]])
    pairs = Rods(i, j, D)
    keep = np.sqrt((closest(pairs.spines)[2] ** 2).sum(axis=1)) < pairs.spines.d
    keep &= ~crossing(pairs.spines) if D == 2 else True
    return Rods(pairs.i[keep], pairs.j[keep], D)


def _apart_along(line: FloatArray, s: Spines, overlap: float) -> LongArray:
    """Move i along a line until the overlap is that asked for, by bisection."""
    low, high = np.zeros(len(line), np.longdouble), np.longdouble(1) * (s.A_i + s.A_j + 1.1 * s.d)
    for _ in range(80):
        x = (low + high) / 2
        delta = closest(s._replace(r=s.r + x[:, None] * line))[2]
        apart = np.sqrt((delta**2).sum(axis=1)) > (1 - overlap) * s.d
        low, high = np.where(apart, low, x), np.where(apart, x, high)
    return np.asarray(s.r + low[:, None] * line)


# --- what is expected ----------------------------------------------------------------------------


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
    flat = (sine(s) < PARALLEL_SINE) & overlapping
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


def rod_error(
    D: int, drawn: Drawn, expected: Callable[[Spines], Bond] = one_bond, sides: int = 1
) -> float:
    """Of forces and torques, in units of overlap; infinite if a contact is lost."""
    pairs = random_rods(D, drawn)
    found, s = pairs.contacts(1.0, sides), pairs.spines
    if len(pairs.i) < 50 or not (found["status"] == TOUCHING).all():
        return np.inf
    wanted = expected(s)
    worst = [np.abs(found["force"] - wanted.force).max(axis=1) * s.d]
    for name, torque, body in (
        ("torque_i", wanted.torque_i, pairs.i),
        ("torque_j", wanted.torque_j, pairs.j),
    ):
        arm = body[:, -2:].max(axis=1)
        worst.append(np.abs(found[name][:, 0] - torque) * s.d / arm)
    return float(np.max(worst))


# --- symmetries ----------------------------------------------------------------------------------


def in_units(D: int, sides: int, length: float, energy: float) -> float:
    """Change of scaled forces of crossed and of parallel rods, in overlaps."""
    drawn = (Drawn(0.01), Drawn(0.01, angle=1e-9))
    worst = (in_other_units(random_rods(D, x), sides, length, energy) for x in drawn)
    return 0.01 * max(worst)


def exchanged(D: int, sides: int, angle: float | None) -> float:
    """Compare the force on i with minus that on j when both change places."""
    pairs = random_rods(D, Drawn(0.01, angle=angle))
    found, other = pairs.contacts(1.0, sides), Rods(pairs.j, pairs.i, D).contacts(1.0, sides)
    size = np.abs(found["force"]).max()
    by_force = np.abs(found["force"] + other["force"]).max()
    by_torque = np.abs(found["torque_i"] - other["torque_j"]).max()
    return 0.01 * float(max(by_force, by_torque) / size)


def upside_down(D: int, sides: int, angle: float) -> float:
    """Rods have no head."""
    pairs = random_rods(D, Drawn(0.01, angle=angle))
    j = pairs.j.copy()
    j[:, D : 2 * D] *= -1
    found, other = pairs.contacts(1.0, sides), Rods(pairs.i, j, D).contacts(1.0, sides)
    names = ("force", "torque_i", "torque_j")
    return float(max(np.abs(found[n] - other[n]).max() for n in names))


def missed_crossings(depth: float) -> float:
    """Share of crossing spines, by at least this fraction of a radius, that are not called that."""
    rng, n = np.random.default_rng(2), 2000
    A, R = _log_uniform(rng, (0.01, 100.0), n), np.ones((2, n))
    u_i, u_j = _units(rng, n, 2), _units(rng, n, 2)
    # The tip of i is past spine j, or both cross anywhere.
    sine_ij = np.abs(u_i[:, 0] * u_j[:, 1] - u_i[:, 1] * u_j[:, 0])
    past = depth / np.maximum(sine_ij, depth)
    f = np.where(rng.random(n) < 0.5, A[0] - past, rng.uniform(-0.9, 0.9, n) * A[0])
    t = rng.uniform(-0.9, 0.9, n) * A[1]
    r = t[:, None] * u_j - f[:, None] * u_i
    i, j = np.column_stack([r, u_i, A[0], R[0]]), np.column_stack([0 * r, u_j, A[1], R[1]])
    pairs = Rods(i, j, 2)
    truly = crossing(pairs.spines)
    missed = [(pairs.contacts(1.0, k)["status"] != CROSSING)[truly].mean() for k in SIDES.values()]
    return float(max(missed)) if truly.mean() > 0.5 else np.inf


def coincident(D: int, distance: float) -> float:
    """Share of pairs at this distance of the feet that are neither named nor have finite forces."""
    rng, n = np.random.default_rng(3), 200
    u_i, u_j = _units(rng, n, D), _units(rng, n, D)
    r, wrong = distance * _units(rng, n, D), 0.0
    for A in (0.0, 1e-6, 1.0, 100.0):
        lengths = np.tile([A, 1.0], (n, 1))
        pairs = Rods(np.hstack([r, u_i, lengths]), np.hstack([0 * r, u_j, lengths]), D)
        must_cross = distance == 0.0 or (D == 2 and A == 100.0)
        for sides in SIDES.values():
            wrong = max(wrong, unnamed(pairs, sides, must_cross=must_cross))
    return wrong


# --- cases ---------------------------------------------------------------------------------------


def accurate(D: int) -> Iterator[Case]:
    """List cases against long doubles."""
    for overlap in OVERLAPS:
        run = partial(rod_error, D, Drawn(overlap))
        yield Case(PART, f"{D}D, overlap {overlap:.2g}", _UNIT, 3e-15, run)
    for alpha in ((1e-6, 1e-6), (1e-6, 100.0), (100.0, 100.0)):
        run = partial(rod_error, D, Drawn(0.05, alpha))
        name = f"{D}D, alpha {alpha[0]:g} to {alpha[1]:g}"
        # Axes are rounded by EPS, tips by alpha times that.
        yield Case(PART, name, _UNIT, 3e-15 * (1 + alpha[1]), run)
    run = partial(rod_error, D, Drawn(0.05, (0.1, 10), (0.5, 5)))
    yield Case(PART, f"{D}D, size ratio to 10", _UNIT, 3e-14, run)
    for angle in ANGLES:
        drawn = Drawn(0.02, (2, 5), angle=angle)
        name, run = f"{D}D, parallel to {angle:g}", partial(rod_error, D, drawn)
        yield Case(PART, f"{name}, sides one", _UNIT, 2e-14, run)
        if D == 2 or angle == 0.0:
            # Two bonds as printed are the limit of shallow overlaps: exactly so from y = 0.01 down.
            shallow = drawn._replace(overlap=0.005)
            run = partial(rod_error, D, shallow, both_ends, 2)
            what = "force and torque against both bonds as printed, in overlaps"
            yield Case(PART, f"{name}, sides two", what, 4e-14, run)


def symmetric(D: int, word: str) -> Iterator[Case]:
    """List what must not change a contact."""
    sides, name = SIDES[word], f"{D}D, sides {word}"
    for unit in (2.0**-20, 2.0**20, 1e-6, 1e6):
        is_exact = np.log2(unit) % 1 == 0
        what, run = "change of scaled forces, in overlaps", partial(in_units, D, sides, unit, 1.0)
        limit = 0.0 if is_exact else 1e-14
        yield Case(PART, f"{name}, unit of length {unit:.3g}", what, limit, run)
        what, run = "change of forces over k_e, in overlaps", partial(in_units, D, sides, 1.0, unit)
        yield Case(PART, f"{name}, k_e {unit:.3g}", what, 0.0 if is_exact else 1e-17, run)
    for tilt in (None, 1e-6, 1e-12):
        label = f"{name}, i and j exchanged, angle {tilt or 'any'}"
        run = partial(exchanged, D, sides, tilt)
        yield Case(PART, label, "change of forces, in overlaps", 1e-14, run)
    run = partial(upside_down, D, sides, 1e-12)
    yield Case(PART, f"{name}, upside down", "change of forces", 0.0, run)


def cases() -> list[Case]:
    """All of them."""
    found: list[Case] = []
    for D in (2, 3):
        found += accurate(D)
        for word in SIDES:
            found += symmetric(D, word)
        for distance in (0.0, 1e-300, 1e-15, 1e-12, 1e-6):
            run = partial(coincident, D, distance)
            name = f"{D}D, centres {distance:g} apart"
            found.append(Case(PART, name, "share neither named nor finite", 0.0, run))
    for depth in (0.5, 1e-6, 1e-12):
        name, run = f"spines cross by {depth:g} of a radius", partial(missed_crossings, depth)
        found.append(Case(PART, name, "share of crossings missed", 0.0, run))
    return found
