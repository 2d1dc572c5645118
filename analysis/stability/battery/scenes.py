"""Extreme packings and what judges them: for the cases of `stability_report.py`.

The oracle is a second evaluation of spherocylinders, in NumPy's long double, from the definitions of Marschall &
Teitel 2018 and over all images one by one. It shares nothing with `lammps_plugin/contact/`.
"""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jamshape.arrays import FloatArray, LongArray
from jamshape.contacts import find_contacts
from jamshape.landscape import Landscape, State
from jamshape.minima import Stop, minimise
from jamshape.packing import Box, Packing
from jamshape.protocols.random_start import Mixture, random_packing

EPS = float(np.finfo(np.float64).eps)
LONG_EPS = float(np.finfo(np.longdouble).eps)
PARALLEL_SINE = 1e-8


def packing_of(
    position: ArrayLike,
    orientation: ArrayLike,
    diameters: ArrayLike,
    edges: ArrayLike,
    **fields: Any,
) -> Packing:
    """Make a packing from arrays; one orientation or shape may stand for all."""
    x, edges = np.asarray(position, float), np.asarray(edges, float)
    n, D = x.shape
    turn = np.broadcast_to(np.asarray(orientation, float), (n,) if D == 2 else (n, 4))
    return Packing(
        position=x,
        orientation=turn if D == 2 else turn / np.linalg.norm(turn, axis=1, keepdims=True),
        diameters=np.broadcast_to(np.asarray(diameters, float), (n, 3)),
        species=np.ones(n, np.int64),
        id=np.arange(1, n + 1),
        box=Box(-edges / 2, edges),
        **fields,
    )


def rods(
    position: ArrayLike,
    orientation: ArrayLike,
    half_length: ArrayLike,
    radius: ArrayLike,
    edges: ArrayLike,
) -> Packing:
    """Spherocylinders from arrays."""
    n = len(np.asarray(position))
    A, R = np.broadcast_to(half_length, n), np.broadcast_to(radius, n)
    diameters = 2 * np.column_stack([A + R, R, R])
    return packing_of(position, orientation, diameters, edges)


def superellipsoids(
    position: ArrayLike,
    orientation: ArrayLike,
    semi_axes: ArrayLike,
    exponent: ArrayLike,
    edges: ArrayLike,
) -> Packing:
    """Superellipsoids from arrays; (N, 3) semi-axes."""
    n = len(np.asarray(position))
    p = np.broadcast_to(np.asarray(exponent, float), n)
    axes = np.broadcast_to(np.asarray(semi_axes, float), (n, 3))
    return packing_of(
        position, orientation, 2 * axes, edges, shape_style="superellipsoid", exponent=p
    )


def scaled(packing: Packing, factor: float) -> Packing:
    """All lengths times a factor: the same packing in another unit."""
    state = State.of(packing)
    factor_long = np.longdouble(factor)
    larger = packing.with_(
        diameters=factor * packing.diameters,
        box=Box(factor * packing.box.lo, factor * packing.box.edges),
    )
    orientation = state.orientation[:, 0] if packing.dimension == 2 else state.orientation
    return larger.with_poses(factor_long * state.position, orientation, factor_long * state.edges)


def deepest(packing: Packing) -> float:
    """Largest overlap; 0 without contacts."""
    bonds = find_contacts(packing).bonds
    return float((1 - bonds.distance / bonds.reach).max(initial=0.0))


def pressed(packing: Packing, overlap: float) -> Packing:
    """Shrink positions and box, orientations kept, until the deepest overlap is close to a number."""
    state, step = State.of(packing), 0.02
    while step > 1e-9:
        closer = state.strained(-step)
        try:
            found = deepest(closer.packing(packing))
        except ValueError:  # spines cross
            found = np.inf
        if found > overlap:
            step /= 2
            continue
        state = closer
        if found > 0.9 * overlap:
            break
    return state.packing(packing)


def in_doubles(packing: Packing) -> Packing:
    """Forget the small rests of all coordinates."""
    return packing.with_(
        position=packing.position, orientation=packing.orientation, box=packing.box
    )


def shorter_first(alpha: FloatArray, dimension: int, phi: float, overlap: float) -> Packing:
    """Rods of these aspect ratios in one box, placed at random, then pressed together."""
    n = len(alpha)
    radius = np.where(np.arange(n) % 2, 0.5, 0.7)
    mixture = Mixture.from_arrays(alpha * radius, radius)
    return in_doubles(pressed(random_packing(n, phi, 1, mixture, dimension=dimension), overlap))


@cache
def all_aspect_ratios(dimension: int, largest: float = 100.0) -> Packing:
    """Alpha from 1e-6 to the largest in the same box; the longest rods are longer than it."""
    alpha = np.append(np.geomspace(1e-6, largest, 9), np.tile([0.0, 1e-6, 0.01, 1.0], 4))
    phi = 0.3 if dimension == 2 else 0.5 / largest
    return shorter_first(alpha, dimension, phi, 0.1)


@cache
def all_sizes(dimension: int) -> Packing:
    """Rods of alpha 1 with radii from 0.5 to 5."""
    radius = np.append(np.geomspace(0.5, 5.0, 5), np.full(40, 0.5))
    mixture = Mixture.from_arrays(radius, radius)
    start = random_packing(45, 0.45 if dimension == 2 else 0.2, 1, mixture, dimension=dimension)
    return in_doubles(pressed(start, 0.1))


def stack(angle: float, dimension: int, n: int = 6, heads: bool = True) -> Packing:
    """Nearly parallel rods side by side, some upside down, with their neighbours' images."""
    rng = np.random.default_rng(2)
    height, gap = 3 * n * 0.97, 0.97
    y = gap * np.arange(n) - height / 2 + 1.0
    x = rng.uniform(-1, 1, n)
    turn = angle * rng.uniform(0.5, 1, n) * (-1) ** np.arange(n)
    if dimension == 2:
        head = np.pi * (np.arange(n) % 3 == 0) * heads
        return rods(np.column_stack([x, y]), turn + head, 2.0, 0.5, [12.0, height])
    axis = rng.normal(size=(n, 3))
    quaternion = np.column_stack([np.ones(n), axis * turn[:, None] / 2])
    position = np.column_stack([x, y, 0.01 * rng.uniform(-1, 1, n)])
    return rods(position, quaternion, 2.0, 0.5, [12.0, height, 12.0])


def longer_than_the_box(alpha: float = 100.0, n: int = 4) -> Packing:
    """Rods of length 101 in a box 60 wide: each lies on its own image and its neighbours'."""
    rng = np.random.default_rng(1)
    gap, width = 0.95, 60.0
    tilt = np.arcsin(gap / width)
    height = 2 * gap * n / np.cos(tilt)
    x = rng.uniform(-2, 2, n)
    y = height * (np.arange(n) / n - 0.45) + np.tan(tilt) * x
    angle = tilt + 1e-12 * rng.uniform(-1, 1, n)
    return rods(np.column_stack([x, y]), angle, alpha / 2, 0.5, [width, height])


def own_images(dimension: int) -> Packing:
    """Two rods that touch their own images and several images of each other."""
    if dimension == 2:
        return rods([[0.0, 0.0], [0.25, 1.0]], [0.0, 0.02], 1.5, [0.6, 0.5], [4.0, 2.0])
    turn = [[1.0, 0.0, 0.0, 0.01], [1.0, 0.0, 0.01, 0.0]]
    position = [[0.0, 0.0, 0.0], [0.25, 1.0, 0.1]]
    return rods(position, turn, 1.5, [0.6, 0.5], [4.0, 2.0, 1.15])


@cache
def deep(dimension: int, alpha: float = 1.0, n: int = 16) -> Packing:
    """Far beyond jamming: minimised while it is compressed, to overlaps of a third.

    In 3D some samples end on a kink of twisted rods; that of this seed does not.
    """
    phi, seed = (0.4, 1) if dimension == 2 else (0.2, 4)
    packing = random_packing(n, phi, seed, Mixture.bidisperse(alpha), dimension=dimension)
    landscape, state = Landscape(packing), State.of(packing)
    for _ in range(200):
        state = state.strained(-0.02)
        rough = Stop(tolerance=1e-2, lowest=1e-10, evaluations=60)
        state = minimise(landscape, state, "lbfgs", rough).state
        if deepest(state.packing(packing)) > 1 / 3:
            return in_doubles(state.packing(packing))
    msg = "the packing did not reach the overlap"
    raise ValueError(msg)


@cache
def jammed(alpha: float, n: int = 16, phi: float = 0.9, seed: int = 1) -> Packing:
    """Make a random packing of the plane, squeezed to phi and roughly minimised on the way."""
    packing = random_packing(n, 0.4, seed, Mixture.bidisperse(alpha))
    landscape, state = Landscape(packing), State.of(packing)
    while (now := state.packing(packing).phi) < phi * (1 - 1e-12):
        state = state.strained(max(-0.01, np.sqrt(now / phi) - 1))
        rough = Stop(tolerance=1e-2, lowest=1e-10, evaluations=200)
        state = minimise(landscape, state, "lbfgs", rough).state
    return in_doubles(state.packing(packing))


@cache
def scattered_superellipsoids(
    p: tuple[float, ...],
    w: tuple[float, ...],
    dimension: int = 3,
    overlap: float = 0.2,
    n: int = 12,
) -> Packing:
    """Of these exponents and ratios of semi-axes, moved apart, then pressed together."""
    rng = np.random.default_rng(3)
    ratio = np.resize(np.asarray(w), n)
    axes = 0.5 * np.column_stack([np.ones(n), np.ones(n), ratio])
    if dimension == 2:
        axes = 0.5 * np.column_stack([ratio, np.ones(n), np.ones(n)])
    quaternion = rng.normal(size=(n, 4))
    turn = rng.uniform(-3, 3, n) if dimension == 2 else quaternion
    start = superellipsoids(
        rng.uniform(-0.5, 0.5, (n, dimension)),
        turn,
        axes,
        np.resize(np.asarray(p), n),
        np.ones(dimension),
    )
    edge = (start.phi / (0.4 if dimension == 2 else 0.2)) ** (1 / dimension)
    packing = scaled(start, edge).with_(diameters=start.diameters)
    found = minimise(Landscape(packing), State.of(packing), "lbfgs", Stop(lowest=1e-14))
    return in_doubles(pressed(found.state.packing(packing), overlap))


@cache
def jammed_spheroids() -> Packing:
    """Twelve prolate spheroids in space, squeezed until they stay jammed."""
    packing = scattered_superellipsoids((1.0,), (1.5,), 3, 0.01)
    landscape, state = Landscape(packing), State.of(packing)
    for _ in range(200):
        state = state.strained(-0.01)
        rough = Stop(tolerance=1e-2, lowest=1e-10, evaluations=200)
        found = minimise(landscape, state, "lbfgs", rough)
        state = found.state
        if found.evaluation.energy > 1e-4 * packing.n:
            break
    return in_doubles(state.packing(packing))


# --- the oracle ----------------------------------------------------------------------------------


class Found(NamedTuple):
    """What the oracle sees of a packing."""

    force: LongArray
    torque: LongArray
    energy: float
    n_contacts: int
    largest: float
    """Largest force of a contact."""


class Spines(NamedTuple):
    """M pairs of spines; r is the centre of i relative to that of j."""

    r: LongArray
    u_i: LongArray
    u_j: LongArray
    A_i: LongArray
    A_j: LongArray
    d: LongArray


def _dot(a: LongArray, b: LongArray) -> LongArray:
    return np.asarray((a * b).sum(axis=-1))


def _cross(a: LongArray, b: LongArray) -> LongArray:
    if a.shape[-1] == 2:
        return np.asarray((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[:, None])
    return np.asarray(np.cross(a, b))


def _across(s: Spines) -> LongArray:
    """Give the part of u_i across u_j, through their difference: nearly parallel axes keep its digits."""
    sign = np.where(_dot(s.u_i, s.u_j) < 0, -1, 1)[:, None]
    turn = s.u_i - sign * s.u_j
    return np.asarray(turn - _dot(turn, s.u_j)[:, None] * s.u_j)


def sine(s: Spines) -> LongArray:
    """|sin| of the angle between the spines."""
    return np.sqrt(_dot(_across(s), _across(s)))


def crossing(s: Spines) -> NDArray[np.bool_]:
    """Whether two spines of the plane cross: each has its tips on both sides of the other."""
    bend = np.abs(_cross(s.u_i, s.u_j)[:, 0])
    on_i = np.abs(_cross(s.u_j, s.r)[:, 0]) < s.A_i * bend
    return np.asarray(on_i & (np.abs(_cross(s.u_i, s.r)[:, 0]) < s.A_j * bend))


def closest(s: Spines) -> tuple[LongArray, LongArray, LongArray]:
    """Feet on both spines and the vector between them: the best of all candidates."""
    candidates = []
    for e in (-1, 1):
        t = np.clip(_dot(s.u_j, s.r + (e * s.A_i)[:, None] * s.u_i), -s.A_j, s.A_j)
        candidates.append((e * s.A_i, t))
        f = np.clip(_dot(s.u_i, (e * s.A_j)[:, None] * s.u_j - s.r), -s.A_i, s.A_i)
        candidates.append((f, e * s.A_j))
    if s.r.shape[1] == 3:
        across = _across(s)
        square = _dot(across, across)
        f = -_dot(s.r, across) / np.where(square > 0, square, 1)
        t = _dot(s.u_j, s.r + f[:, None] * s.u_i)
        inside = (square > 0) & (np.abs(f) < s.A_i) & (np.abs(t) < s.A_j)
        candidates.append((np.where(inside, f, s.A_i), np.where(inside, t, candidates[1][1] * 0)))
        # Where it is not inside, the tip of i with the middle of j, which is never the nearest.
    feet = [np.stack(x) for x in zip(*candidates, strict=True)]
    delta = s.r + feet[0][..., None] * s.u_i - feet[1][..., None] * s.u_j
    best = (delta**2).sum(axis=-1).argmin(axis=0)
    row = np.arange(len(s.r))
    return feet[0][best, row], feet[1][best, row], delta[best, row]


def middle(s: Spines) -> tuple[LongArray, LongArray, NDArray[np.bool_]]:
    """Middle of the overlap of two nearly parallel spines on both, and whether they overlap."""

    def centre(at: LongArray, own: LongArray, other: LongArray) -> tuple[LongArray, LongArray]:
        low, high = np.maximum(-own, at - other), np.minimum(own, at + other)
        return (low + high) / 2, high - low

    f, length = centre(-_dot(s.r, s.u_i), s.A_i, s.A_j)
    t, _ = centre(_dot(s.r, s.u_j), s.A_j, s.A_i)
    return f, t, length > 0


def every_image(packing: Packing) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All pairs (M, 2) and shifts (M, D) whose bounding spheres may overlap, each once."""
    D, edges = packing.dimension, packing.box.edges
    reach = 2 * float(np.linalg.norm(packing.diameters[:, :D], axis=1).max())
    spread = np.ptp(packing.position, axis=0)
    most = np.ceil((reach + spread) / edges).astype(int)
    shifts = np.array(list(itertools.product(*(range(-m, m + 1) for m in most))))
    i, j = np.triu_indices(packing.n)
    first = (shifts != 0).argmax(axis=1)
    leading = shifts[np.arange(len(shifts)), first] > 0
    pairs = np.repeat(np.column_stack([i, j]), len(shifts), axis=0)
    all_shifts = np.tile(shifts, (len(i), 1))
    keep = (pairs[:, 0] < pairs[:, 1]) | np.tile(leading, len(i))
    pairs, all_shifts = pairs[keep], all_shifts[keep]
    x = packing.position
    apart = x[pairs[:, 0]] - x[pairs[:, 1]] - all_shifts * edges
    bound = np.linalg.norm(packing.diameters[:, :D], axis=1) / 2
    near = np.linalg.norm(apart, axis=1) < 1.001 * (bound[pairs[:, 0]] + bound[pairs[:, 1]])
    return pairs[near], all_shifts[near]


def long_axes(packing: Packing, quaternion: FloatArray | None = None) -> LongArray:
    """(N, D) unit axes in long double, from the poses or from quaternions as LAMMPS holds them."""
    if quaternion is None and packing.dimension == 2:
        angle = packing.poses()[1]
        return np.column_stack([np.cos(angle), np.sin(angle)])
    q = packing.poses()[1] if quaternion is None else np.asarray(quaternion, np.longdouble)
    w, i, j, k = q.T
    x = np.column_stack([w * w + i * i - j * j - k * k, 2 * (i * j + w * k), 2 * (i * k - w * j)])
    unit: LongArray = (x / (q**2).sum(axis=1, keepdims=True))[:, : packing.dimension]
    return unit


def oracle(packing: Packing, k_e: float = 1.0, quaternion: FloatArray | None = None) -> Found:
    """Energy, forces and torques of one-bond contacts, over every pair and every image.

    Raises
    ------
    ValueError
        If spines cross.
    """
    pairs, shift = every_image(packing)
    i, j = pairs.T
    x, _, edges = packing.poses()
    u = long_axes(packing, quaternion)
    A, R = (np.asarray(length, np.longdouble) for length in (packing.half_length, packing.radius))
    s = Spines(x[i] - x[j] - shift * edges, u[i], u[j], A[i], A[j], R[i] + R[j])
    f, t, delta = closest(s)
    distance = np.sqrt(_dot(delta, delta))
    touching = distance < s.d
    if packing.dimension == 2 and (crossing(s) & touching).any():
        msg = "spines cross"
        raise ValueError(msg)
    middle_f, middle_t, overlapping = middle(s)
    flat = (sine(s) < PARALLEL_SINE) & overlapping
    f, t = np.where(flat, middle_f, f), np.where(flat, middle_t, t)
    delta = s.r + f[:, None] * s.u_i - t[:, None] * s.u_j
    normal = delta / np.maximum(np.sqrt(_dot(delta, delta)), np.longdouble(1e-300))[:, None]
    overlap = np.where(touching, 1 - distance / s.d, 0)
    force = (k_e * overlap / s.d)[:, None] * normal
    total, torque = np.zeros_like(x), np.zeros((packing.n, len(_cross(x[:1], x[:1])[0])), x.dtype)
    np.add.at(total, i, force)
    np.add.at(total, j, -force)
    np.add.at(torque, i, f[:, None] * _cross(s.u_i, force))
    np.add.at(torque, j, -t[:, None] * _cross(s.u_j, force))
    return Found(
        force=total,
        torque=torque,
        energy=float((0.5 * k_e * overlap**2).sum()),
        n_contacts=int(touching.sum()),
        largest=float(np.sqrt(_dot(force, force)).max(initial=0)),
    )


def difference(
    packing: Packing, force: ArrayLike, torque: ArrayLike, found: Found, k_e: float = 1.0
) -> float:
    """Largest difference from the oracle of a force, in units of overlap: times 2R / k_e.

    Torques are divided by the half length of the particle, or its radius if that is longer.
    """
    unit = float(packing.diameters[:, 1].min()) / k_e
    arm = np.maximum(packing.half_length, packing.radius)[:, None]
    by_force = np.abs(np.asarray(force) - found.force).max()
    by_torque = np.abs((np.asarray(torque).reshape(packing.n, -1) - found.torque) / arm).max()
    return unit * float(max(by_force, by_torque))
