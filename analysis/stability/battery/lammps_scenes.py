"""Extreme packings of superellipsoids as LAMMPS takes them, and what the bindings say of them.

For the cases of `stability_report.py` and for the tests of the pair style.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from stability_scenes import superellipsoids

from jamshape import _contact
from jamshape.arrays import FloatArray
from jamshape.landscape import State
from jamshape.landscape.adapter import PairArrays, shape_of
from jamshape.packing import Box, Packing

# Shapes of `crowd`.
AXES = np.array([[0.5, 0.6, 0.8], [0.35, 0.7, 0.7], [0.6, 0.6, 0.6], [0.5, 0.5, 0.9]])
EXPONENTS = np.array([0.75, 1.0, 1.5, 2.0])

# The most extreme.
P = (0.55, 10.0)
W = {"w 0.1": [1.0, 1.0, 0.1], "w 10": [0.2, 0.2, 2.0], "w 0.1 and 10": [0.1, 1.0, 10.0]}

_UPRIGHT = [1.0, 0.0, 0.0, 0.0]

Pair = tuple[ArrayLike, ArrayLike]


def particles(*arrays: ArrayLike, **named: ArrayLike) -> Packing:
    """As `superellipsoids`; one shape may stand for all. Each exponent is a type of its own."""
    packing = superellipsoids(*arrays, **named)
    return packing.with_(species=1 + np.unique(packing.exponent, return_inverse=True)[1])


def exponents_of(packing: Packing) -> FloatArray:
    """Give them by type."""
    table = np.ones(packing.species.max())
    table[packing.species - 1] = packing.exponent
    return table


def pair_commands(packing: Packing, epsilon: float) -> str:
    """Input of the pair style, with an exponent for each type."""
    lines = [f"pair_coeff * * {epsilon!r}"]
    lines += [
        f"pair_coeff {k} {k} {epsilon!r} {p:.17g}" for k, p in enumerate(exponents_of(packing), 1)
    ]
    return "pair_style superellipsoid/harmonic\n" + "\n".join(lines)


# --- packings ------------------------------------------------------------------------------------


def crowd(
    dimension: int = 3,
    kinds: Sequence[int] = (0, 1, 2, 3),
    n: int = 48,
    phi: float = 0.8,
    seed: int = 1,
    spread: float = 0.15,
    *,
    shapes: tuple[Any, Any] = (AXES, EXPONENTS),
) -> Packing:
    """On a jittered lattice, turned at random, with deep and shallow overlaps."""
    rng = np.random.default_rng(seed)
    kind = np.array(kinds)[np.arange(n) % len(kinds)]
    side = int(np.ceil(n ** (1 / dimension)))
    sites = rng.permutation(side**dimension)[:n]
    at = np.stack(np.unravel_index(sites, (side,) * dimension), axis=1)
    cells = at + 0.5 + rng.uniform(-0.15, 0.15, at.shape)
    scale = 1 + spread * rng.uniform(-1, 1, (n, 1))
    turn = rng.normal(size=(n, 4)) if dimension == 3 else rng.uniform(-4, 4, n)
    axes, exponents = map(np.asarray, shapes)
    edges = np.full(dimension, float(side))
    unit = particles(cells - side / 2, turn, scale * axes[kind], exponents[kind], edges)
    edge = side * (unit.phi / phi) ** (1 / dimension)
    edge = 2.0**-20 * np.round(2.0**20 * edge)  # periodic images are then exact
    position = np.round(2.0**30 * unit.position * edge / side) / 2.0**30
    box = Box(np.full(dimension, -edge / 2), np.full(dimension, edge))
    return unit.with_(position=position, box=box)


def of_one_shape(p: float, axes: ArrayLike) -> Packing:
    """Sixteen particles of the same size."""
    return crowd(kinds=(0,), n=16, phi=0.4, spread=0.0, shapes=([axes], [p]))


def of_all_shapes(dimension: int) -> Packing:
    """All pairs of P and W in one box."""
    axes = [axes for axes in W.values() for _ in P]
    return crowd(dimension, range(len(axes)), n=24, phi=0.5, shapes=(axes, len(W) * P))


def tiny_box(dimension: int = 3, exponents: ArrayLike = (1.5, 0.75)) -> Packing:
    """Two that touch their own images and several images of each other."""
    if dimension == 2:
        axes = [[1.5, 0.6, 1.0], [1.2, 0.5, 1.0]]
        return particles([[0.0, 0.0], [0.25, 1.0]], [0.0, 0.3], axes, exponents, [2.5, 1.75])
    quaternion = [[1.0, 0.0, 0.02, 0.0], [1.0, 0.3, 0.0, 0.1]]
    position, axes = [[0.0, 0.0, 0.0], [0.25, 1.0, 0.1]], [[1.5, 0.6, 0.5], [1.2, 0.5, 0.5]]
    return particles(position, quaternion, axes, exponents, [2.5, 1.75, 1.0625])


def far_apart(pairs: Sequence[Pair], side: float = 8.0) -> Packing:
    """Pairs of bodies, rows as of `superellipsoid_bodies`, with the first body of each on a grid."""
    first, second = (np.array(rows, float) for rows in zip(*pairs, strict=True))
    at = np.zeros((len(pairs), 3))
    at[:, 0] = side * (np.arange(len(pairs)) - 0.5 * (len(pairs) - 1))
    position = np.stack([at, at + second[:, :3] - first[:, :3]], axis=1).reshape(-1, 3)
    rows = np.stack([first, second], axis=1).reshape(-1, first.shape[1])
    edges = [side * len(pairs), side, side]
    return particles(position, rows[:, 3:7], rows[:, 7:10], rows[:, 10], edges)


def _aligned(p: float, distance: float, offset: float = 0.0, tilt: float = 0.0) -> Pair:
    """Two of semi-axes 1/2 along x."""
    beside = [distance, offset, 0.5 * offset, 1.0, 0.0, tilt, 0.5 * tilt]
    return [0.0, 0.0, 0.0, *_UPRIGHT, 0.5, 0.5, 0.5, p], [*beside, 0.5, 0.5, 0.5, p]


def in_a_row(p: float, width: float) -> Packing:
    """On faces or tips of about this width: exactly, nearly, and off the middle."""
    cases = [(0.0, 0.0), (1e-9, 0.0), (0.0, 1e-9), (0.2, 0.0), (0.0, 0.1), (0.04, 0.06)]
    return far_apart([_aligned(p, 0.98, width * x, width * tilt) for x, tilt in cases])


def _random_pairs(seed: int, n: int = 12) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    axes = list(W.values())[:2]
    turn = rng.normal(size=(2, n, 4))
    turn /= np.linalg.norm(turn, axis=2, keepdims=True)
    rows = np.zeros((2, n, 11))
    rows[1, :, :3] = rng.normal(size=(n, 3))
    rows[:, :, 3:7] = turn
    rows[:, :, 7:10] = [[axes[k % 2] for k in range(n)], [axes[k // 2 % 2] for k in range(n)]]
    rows[:, :, 10] = rng.choice(P, (2, n))
    return rows[0], rows[1]


def nearly_concentric() -> Packing:
    """From 1e-9 of the size to a tenth."""
    i, j = _random_pairs(1)
    distance = np.logspace(-9, -1, len(j))
    j[:, :3] *= (distance / np.linalg.norm(j[:, :3], axis=1))[:, None]
    return far_apart(list(zip(i, j, strict=True)))


def overlapping_by(overlap: float) -> Packing:
    """Pairs of the most extreme shapes, with 1 - eta^2 of this size."""
    i, j = _random_pairs(2)
    eta = _contact.superellipsoid_scales(i, j)["eta"]
    j[:, :3] *= (np.sqrt(1 - overlap) / eta)[:, None]
    return far_apart(list(zip(i, j, strict=True)))


SCENES: dict[str, Callable[[], Packing]] = {
    **{f"p {p} {w}": partial(of_one_shape, p, axes) for p in P for w, axes in W.items()},
    "all shapes": partial(of_all_shapes, 3),
    "plane, all shapes": partial(of_all_shapes, 2),
    "cubes face to face": partial(in_a_row, 10.0, 0.5),
    "octahedra tip to tip": partial(in_a_row, 0.55, 0.01),
    "nearly concentric": nearly_concentric,
    "overlap of a third": partial(overlapping_by, 1 / 3),
    "own images": partial(tiny_box, 3, (10.0, 0.55)),
    "plane, own images": partial(tiny_box, 2, (10.0, 0.55)),
}


# --- what is expected ----------------------------------------------------------------------------


def sums(packing: Packing, epsilon: float) -> dict[str, Any]:
    """Energy, forces and torques from the bindings, rows as the packing's."""
    shape = shape_of(packing, epsilon, 2)
    near = shape.near(packing, 0.0)
    pairs = np.column_stack([near.first, near.second])
    arrays = PairArrays(*State.of(packing).split, pairs, near.shift)
    return shape.sums(arrays, extended=False)


def difference(
    packing: Packing, found_force: FloatArray, found_torque: FloatArray, epsilon: float
) -> float:
    """Largest difference of forces and of torques from the bindings, relative to the largest."""
    expected = sums(packing, epsilon)
    force, torque = expected["force"], expected["torque"].reshape(found_torque.shape)
    largest = np.abs(force).max() or 1.0
    length = float(packing.diameters.min())
    # Torques of spheres are rounding.
    of_torque = max(np.abs(torque).max(), 1e-3 * length * largest)
    by_force = np.abs(found_force - force).max() / largest
    return float(max(by_force, np.abs(found_torque - torque).max() / of_torque))
