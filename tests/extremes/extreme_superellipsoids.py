"""Extreme packings of superellipsoids. In those that LAMMPS takes each exponent is a type of its own."""

from functools import cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from packings_in_a_box import (
    hardened,
    in_doubles,
    packing_of,
    pressed,
    scaled,
    squeezed_until,
    widened,
)

from jamshape._contact import superellipsoid_scales
from jamshape.landscape import Landscape, State
from jamshape.minima import Stop, minimise
from jamshape.packing import Box
from methods.lbfgs import lbfgs

EXPONENTS = (0.55, 0.75, 1.0, 1.5, 2.0, 5.0, 10.0)

_UPRIGHT = [1.0, 0.0, 0.0, 0.0]


def superellipsoids(position, orientation, semi_axes, exponent, edges):
    """Packing from arrays; one shape may stand for all."""
    n = len(np.asarray(position))
    p = np.broadcast_to(np.asarray(exponent, float), n)
    axes = np.broadcast_to(np.asarray(semi_axes, float), (n, 3))
    return packing_of(
        position, orientation, 2 * axes, edges, shape_style="superellipsoid", exponent=p
    )


# --- in one box ----------------------------------------------------------------------------------


@cache
def scattered(p, w, dimension=3, overlap=0.2, n=12):
    """Packing of these exponents and ratios of semi-axes: moved apart, then pressed together."""
    rng = np.random.default_rng(3)
    ratio, one = np.resize(np.asarray(w), n), np.ones(n)
    axes = 0.5 * np.column_stack([ratio, one, one] if dimension == 2 else [one, one, ratio])
    quaternion = rng.normal(size=(n, 4))
    turn = rng.uniform(-3, 3, n) if dimension == 2 else quaternion
    position = rng.uniform(-0.5, 0.5, (n, dimension))
    exponent = np.resize(np.asarray(p), n)
    start = superellipsoids(position, turn, axes, exponent, np.ones(dimension))
    edge = (start.phi / (0.4 if dimension == 2 else 0.2)) ** (1 / dimension)
    packing = scaled(start, edge).with_(diameters=start.diameters)
    found = minimise(Landscape(packing), State.of(packing), lbfgs, Stop(lowest=1e-14))
    return in_doubles(pressed(found.state.packing(packing), overlap))


@cache
def jammed_spheroids():
    """Twelve prolate spheroids in space, squeezed until they stay jammed."""
    packing = scattered((1.0,), (1.5,), 3, 0.01)
    enough = 1e-4 * packing.n
    return squeezed_until(packing, 0.01, 200, lambda found: found.evaluation.energy > enough)


@cache
def loose(dimension, p, w, n=8):
    """Particles of one shape in a box that leaves them room."""
    return widened(scattered((p,), (w,), dimension, 1e-3, n), 0.02)


@cache
def hard(dimension, p, w, wider=0.0):
    n = 12 if dimension == 3 else int(np.clip(8 * max(w, 1 / w), 12, 60))
    return hardened(loose(dimension, p, w, n), wider)


def needles():
    """Ellipsoids longer than the box: they touch their own images."""
    turn = [[1.0, 0.1, 0.2, 0.3], [1.0, -0.1, 0.2, 0.31]]
    position = [[0.0, 0.0, 0.0], [0.6, 0.7, 0.5]]
    apart = superellipsoids(position, turn, [0.3, 0.3, 3.0], [1.0, 1.5], [2.2, 2.2, 3.0])
    return pressed(apart, 0.1)


# --- as LAMMPS takes them ------------------------------------------------------------------------


def particles(*arrays, **named):
    """Superellipsoids, each exponent a type of its own."""
    packing = superellipsoids(*arrays, **named)
    return packing.with_(species=1 + np.unique(packing.exponent, return_inverse=True)[1])


class Kind(NamedTuple):
    axes: ArrayLike
    p: float


KINDS = (
    Kind([0.5, 0.6, 0.8], 0.75),
    Kind([0.35, 0.7, 0.7], 1.0),
    Kind([0.6, 0.6, 0.6], 1.5),
    Kind([0.5, 0.5, 0.9], 2.0),
)

# The most extreme.
P = (0.55, 10.0)
W = {"w 0.1": [1.0, 1.0, 0.1], "w 10": [0.2, 0.2, 2.0], "w 0.1 and 10": [0.1, 1.0, 10.0]}


def crowd(dimension=3, kinds=KINDS, n=48, phi=0.8, spread=0.15):
    """On a jittered lattice, turned at random, with deep and shallow overlaps."""
    rng = np.random.default_rng(1)
    kind = np.arange(n) % len(kinds)
    side = int(np.ceil(n ** (1 / dimension)))
    sites = rng.permutation(side**dimension)[:n]
    at = np.stack(np.unravel_index(sites, (side,) * dimension), axis=1)
    cells = at + 0.5 + rng.uniform(-0.15, 0.15, at.shape)
    scale = 1 + spread * rng.uniform(-1, 1, (n, 1))
    turn = rng.normal(size=(n, 4)) if dimension == 3 else rng.uniform(-4, 4, n)
    axes, exponents = (np.array(values, float)[kind] for values in zip(*kinds, strict=True))
    edges = np.full(dimension, float(side))
    unit = particles(cells - side / 2, turn, scale * axes, exponents, edges)
    edge = side * (unit.phi / phi) ** (1 / dimension)
    edge = 2.0**-20 * np.round(2.0**20 * edge)  # periodic images are then exact
    position = np.round(2.0**30 * unit.position * edge / side) / 2.0**30
    box = Box(np.full(dimension, -edge / 2), np.full(dimension, edge))
    return unit.with_(position=position, box=box)


def of_one_shape(p, axes):
    return crowd(kinds=[Kind(axes, p)], n=16, phi=0.4, spread=0.0)


def of_all_shapes(dimension):
    """All pairs of P and W in one box."""
    return crowd(dimension, [Kind(axes, p) for axes in W.values() for p in P], n=24, phi=0.5)


@cache
def dense(dimension):
    return crowd(dimension, n=16, phi=0.8)


of_all_exponents = partial(crowd, kinds=[Kind([0.5, 0.6, 0.7], p) for p in EXPONENTS], n=28)
spheres_of_several_sizes = partial(crowd, kinds=[Kind([0.5] * 3, 1.0)], n=16)
of_two_types = partial(crowd, kinds=KINDS[1:3], n=24)


def tiny_box(dimension=3, exponents=(1.5, 0.75)):
    """Two that touch their own images and several images of each other."""
    if dimension == 2:
        axes = [[1.5, 0.6, 1.0], [1.2, 0.5, 1.0]]
        return particles([[0.0, 0.0], [0.25, 1.0]], [0.0, 0.3], axes, exponents, [2.5, 1.75])
    quaternion = [[1.0, 0.0, 0.02, 0.0], [1.0, 0.3, 0.0, 0.1]]
    position, axes = [[0.0, 0.0, 0.0], [0.25, 1.0, 0.1]], [[1.5, 0.6, 0.5], [1.2, 0.5, 0.5]]
    return particles(position, quaternion, axes, exponents, [2.5, 1.75, 1.0625])


# --- pairs far from each other -------------------------------------------------------------------


def far_apart(pairs, side=8.0):
    """Pairs of bodies, rows of centre, quaternion, semi-axes, exponent, with the first of each on a grid."""
    first, second = (np.array(rows, float) for rows in zip(*pairs, strict=True))
    at = np.zeros((len(pairs), 3))
    at[:, 0] = side * (np.arange(len(pairs)) - 0.5 * (len(pairs) - 1))
    position = np.stack([at, at + second[:, :3] - first[:, :3]], axis=1).reshape(-1, 3)
    rows = np.stack([first, second], axis=1).reshape(-1, first.shape[1])
    edges = [side * len(pairs), side, side]
    return particles(position, rows[:, 3:7], rows[:, 7:10], rows[:, 10], edges)


def in_a_row(p, width):
    """Touching on faces or tips of about this width: exactly, nearly, and off the middle."""
    cases = [(0.0, 0.0), (1e-9, 0.0), (0.0, 1e-9), (0.2, 0.0), (0.0, 0.1), (0.04, 0.06)]
    first = [0.0, 0.0, 0.0, *_UPRIGHT, 0.5, 0.5, 0.5, p]
    pairs = []
    for offset, tilt in width * np.array(cases):
        beside = [0.98, offset, 0.5 * offset, 1.0, 0.0, tilt, 0.5 * tilt]
        pairs.append((first, [*beside, 0.5, 0.5, 0.5, p]))
    return far_apart(pairs)


def random_rows(seed, n=12):
    """(n, 11) bodies i and j of the most extreme shapes."""
    rng = np.random.default_rng(seed)
    axes = list(W.values())[:2]
    turn = rng.normal(size=(2, n, 4))
    turn /= np.linalg.norm(turn, axis=2, keepdims=True)
    rows = np.zeros((2, n, 11))
    rows[1, :, :3] = rng.normal(size=(n, 3))
    rows[:, :, 3:7] = turn
    rows[:, :, 7:10] = [[axes[k % 2] for k in range(n)], [axes[k // 2 % 2] for k in range(n)]]
    rows[:, :, 10] = rng.choice(P, (2, n))
    return rows


def nearly_concentric():
    """Pairs with centres from 1e-9 to a tenth of their size apart."""
    i, j = random_rows(1)
    distance = np.logspace(-9, -1, len(j))
    j[:, :3] *= (distance / np.linalg.norm(j[:, :3], axis=1))[:, None]
    return far_apart(list(zip(i, j, strict=True)))


def overlapping_by(overlap):
    """Pairs of the most extreme shapes with 1 - eta^2 equal to this overlap."""
    i, j = random_rows(2)
    eta = superellipsoid_scales(i, j)["eta"]
    j[:, :3] *= (np.sqrt(1 - overlap) / eta)[:, None]
    return far_apart(list(zip(i, j, strict=True)))


def coincident(p, dimension):
    """Two at the same place."""
    turn = [0.1, 0.7] if dimension == 2 else [[1.0, 0.1, 0.2, 0.3], [1.0, 0.3, 0.0, 0.1]]
    return particles(np.ones((2, dimension)), turn, [0.5, 0.6, 0.8], p, [9.0] * dimension)


def two_spheres(overlap):
    return particles([[0.0] * 3, [1.0 - overlap, 0.0, 0.0]], _UPRIGHT, 0.5, 1.0, [20.0] * 3)


# Of their overlap: U = k_e (1 - r^2)^2 / 2 has the stiffness 4 k_e at r = 1; both move, each with the drag k_d V.
RATE_OF_TWO_SPHERES = 2 * 4 / (np.pi / 6)


def lone():
    """Two that touch nothing."""
    turn = [[1.0, 0.1, 0.2, 0.3], [1.0, -0.1, 0.2, 0.31]]
    position = [[3.0, 1.0, 0.5], [-4.0, -2.0, 0.0]]
    return particles(position, turn, [1.0, 0.5, 0.7], [0.75, 1.5], [20.0] * 3)


# --- of all sizes --------------------------------------------------------------------------------


@cache
def all_sizes(p):
    """Pairs of all sizes from 1e-6 to 100 in one box, each with an overlap of a tenth of the smaller."""
    sizes = (1e-6, 1e-4, 1e-2, 1.0, 100.0)
    rng, position, axes, at = np.random.default_rng(4), [], [], 0.0
    for k, large in enumerate(sizes):
        for small in sizes[: k + 1]:
            line = rng.normal(size=3)
            line /= np.linalg.norm(line)
            at += 3 * large + 1
            position += [np.array([at, 0.0, 0.0]), np.array([at, 0.0, 0.0]) + large * line]
            axes += [large * np.array([1.0, 0.8, 0.7]), small * np.array([0.8, 1.0, 0.9])]
            at += 3 * large + 1
    centred = np.array(position) - [at / 2, 0.0, 0.0]
    turn = rng.normal(size=(len(axes), 4))
    apart = particles(centred, turn, axes, p, [at + 800.0, 800.0, 800.0])
    x, small = apart.position.copy(), apart.diameters[1::2].min(axis=1) / 2
    rows = np.column_stack([x, apart.orientation, apart.diameters / 2, apart.exponent])
    i, j = np.ascontiguousarray(rows[::2]), np.ascontiguousarray(rows[1::2])
    line = j[:, :3] - i[:, :3]
    eta = superellipsoid_scales(i, j)["eta"]
    x[1::2] = x[::2] + (line.T * (1 / eta - 0.1 * small / np.linalg.norm(line, axis=1))).T
    return apart.with_(position=x)
