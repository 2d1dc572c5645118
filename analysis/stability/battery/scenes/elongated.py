"""Extreme packings of shapes with a half length A and a radius R: rods, dimers, discs.

Rods unless another style is asked for.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from battery.scenes.making import (
    Scene,
    deepest,
    hardened,
    in_doubles,
    packing_of,
    pressed,
    squeezed,
    squeezed_to,
    widened,
)
from jamshape.arrays import FloatArray
from jamshape.packing import Packing
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles

RODS, DIMERS = "spherocylinder", "dimer"


def rods(
    position: ArrayLike,
    orientation: ArrayLike,
    half_length: ArrayLike,
    radius: ArrayLike,
    edges: ArrayLike,
) -> Packing:
    """Rods from arrays."""
    n = len(np.asarray(position))
    diameters = _diameters(np.broadcast_to(half_length, n), np.broadcast_to(radius, n))
    return packing_of(position, orientation, diameters, edges, shape_style=RODS)


def as_dimers(scene: Scene) -> Packing:
    """Give dimers of the sizes and poses of rods."""
    return scene().with_(shape_style=DIMERS)


def given(half_length: FloatArray, radius: FloatArray, style: str) -> Particles:
    """Give particles of these sizes, to be placed."""
    return Particles.given(style, _diameters(half_length, radius))


def _diameters(half_length: FloatArray, radius: FloatArray) -> FloatArray:
    return 2 * np.column_stack([half_length + radius, radius, radius])


# --- in one box ----------------------------------------------------------------------------------


@cache
def all_aspect_ratios(dimension: int, largest: float = 100.0, style: str = RODS) -> Packing:
    """Alpha from 1e-6 to the largest in the same box; the longest are longer than it."""
    alpha = np.append(np.geomspace(1e-6, largest, 9), np.tile([0.0, 1e-6, 0.01, 1.0], 4))
    phi = 0.3 if dimension == 2 else 0.5 / largest
    radius = np.where(np.arange(len(alpha)) % 2, 0.5, 0.7)
    start = random_packing(len(alpha), phi, 1, given(alpha * radius, radius, style), dimension)
    return in_doubles(pressed(start, 0.1))


@cache
def all_sizes(dimension: int, style: str = RODS) -> Packing:
    """Alpha 1, with radii from 0.5 to 5."""
    radius = np.append(np.geomspace(0.5, 5.0, 5), np.full(40, 0.5))
    phi = 0.45 if dimension == 2 else 0.2
    start = random_packing(len(radius), phi, 1, given(radius, radius, style), dimension)
    return in_doubles(pressed(start, 0.1))


def stack(angle: float, dimension: int, n: int = 6) -> Packing:
    """Nearly parallel rods side by side, some upside down, with their neighbours' images."""
    rng = np.random.default_rng(2)
    height, gap = 3 * n * 0.97, 0.97
    y = gap * np.arange(n) - height / 2 + 1.0
    x = rng.uniform(-1, 1, n)
    turn = angle * rng.uniform(0.5, 1, n) * (-1) ** np.arange(n)
    if dimension == 2:
        head = np.pi * (np.arange(n) % 3 == 0)
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
def deep(dimension: int, alpha: float = 1.0, n: int = 16, style: str = RODS) -> Packing:
    """Far beyond jamming: minimised while it is compressed, to overlaps of a third.

    In 3D some samples end on a kink of twisted rods; that of this seed does not.
    """
    phi, seed = (0.4, 1) if dimension == 2 else (0.2, 4)
    packing = random_packing(n, phi, seed, Particles.of(style, alpha=alpha), dimension)
    return squeezed(packing, 0.02, 60, lambda found: deepest(found.state.packing(packing)) > 1 / 3)


@cache
def jammed(alpha: float, n: int = 16, phi: float = 0.9, style: str = RODS) -> Packing:
    """Make a random packing of the plane, squeezed to phi and roughly minimised on the way."""
    return squeezed_to(random_packing(n, 0.4, 1, Particles.of(style, alpha=alpha)), phi)


@cache
def loose(dimension: int, alpha: float, n: int = 8, style: str = RODS) -> Packing:
    """Particles of one aspect ratio in a box that leaves them room."""
    phi = 0.2 if dimension == 2 else min(0.2, 0.4 / (1 + alpha))
    start = random_packing(n, phi, 1, Particles.of(style, alpha=alpha), dimension)
    return widened(pressed(start, 1e-3), 0.02)


@cache
def hard(dimension: int, alpha: float, style: str = RODS) -> Packing:
    """Particles without overlaps in a box twice as wide as they are long."""
    return hardened(loose(dimension, alpha, 12, style))


@cache
def jammed_off_kinks(alpha: float) -> Packing:
    """Turn jammed rods off the kinks of side-to-side contacts, where the energy has no rate."""
    packing, rng = jammed(alpha), np.random.default_rng(9)
    return packing.with_(orientation=packing.orientation + 0.03 * rng.normal(size=packing.n))


# --- two or a few --------------------------------------------------------------------------------

_LENGTHS, _RADII = np.array([1.0, 0.6]), np.array([0.5, 0.3])


def overlaps(dimension: int, overlap: float) -> Packing:
    """Pairs of every class of contact, far from each other, with this overlap."""
    (long, short), d = _LENGTHS, (1 - overlap) * _RADII.sum()
    rows = [  # angles of i and j, centre of j
        (0.0, 1.0, np.array([0.3, d]) + short * _direction(1.0)),
        (0.7, -0.6, np.array([d, 0.0]) + long * _direction(0.7) + short * _direction(-0.6)),
        (0.0, 0.0, np.array([0.8, d])),
        (0.0, 1e-12, np.array([0.8, d])),
    ]
    centres = np.array([[16.0 * n - 24.0, 0.0] for n in range(len(rows))])
    position = np.stack([centres, centres + [shift for *_, shift in rows]], axis=1).reshape(-1, 2)
    angle = np.array([turns for *turns, _ in rows]).ravel()
    half, radius = np.tile(_LENGTHS, len(rows)), np.tile(_RADII, len(rows))
    if dimension == 2:
        return rods(position, angle, half, radius, [72.0, 16.0])
    q = np.column_stack([np.cos(angle / 2), 0 * angle, 0 * angle, np.sin(angle / 2)])
    return rods(np.pad(position, ((0, 0), (0, 1))), q, half, radius, [72.0, 16.0, 16.0])


def _direction(angle: float) -> FloatArray:
    return np.array([np.cos(angle), np.sin(angle)])


def of_two_types(alpha: float, style: str = RODS) -> Packing:
    """Jammed ones of alternate types."""
    packing = jammed(alpha, style=style)
    return packing.with_(species=1 + np.arange(packing.n) % 2)


def two(position: ArrayLike, angle: ArrayLike, half_length: float = 1.0) -> Packing:
    """Two in a box of 12."""
    return rods(position, angle, half_length, 0.5, [12.0, 12.0])


def crossed() -> Packing:
    """Two whose spines cross."""
    return two([[0.0, 0.0], [0.1, 0.2]], [0.0, 1.5])


def crossed_by(depth: float) -> Packing:
    """Two of which the tip of one is so far beyond the spine of the other."""
    return two([[0.0, 0.0], [0.3, 1 - depth]], [0.0, np.pi / 2])


def two_discs(overlap: float = 0.1) -> Packing:
    """Two that overlap by this part of their diameter, which is 1."""
    return rods([[0.0, 0.0], [1.0 - overlap, 0.0]], 0.0, 0.0, 0.5, [20.0, 20.0])


def two_dimers(overlap: float = 0.1) -> Packing:
    """Two in a line, of whose discs two overlap by this part of their diameter, which is 1."""
    along = rods([[0.0, 0.0], [2.0 - overlap, 0.0]], 0.0, 0.5, 0.5, [20.0, 20.0])
    return along.with_(shape_style=DIMERS)


def interlocked(dimension: int, overlap: float) -> Packing:
    """Pairs of dimers with one to four bonds, of which the deepest has this overlap."""
    d, half = 1 - overlap, 0.5
    short = np.array([half, half, half, 0.1])
    rise = [d, np.sqrt(d**2 - half**2), np.sqrt(d**2 - half**2), d]
    across = [2 * half, 0.0, half, 0.0]
    angle = [0.0, np.pi / 2, 0.0, 0.0]
    lift = [0.0, half, 0.0, 0.0]  # upright ones stand on their lower disc
    centres = np.array([[8.0 * k - 12.0, 0.0] for k in range(4)])
    other = centres + np.column_stack([across, np.add(rise, lift)])
    position = np.stack([centres, other], axis=1).reshape(-1, 2)
    turn = np.column_stack([np.zeros(4), angle]).ravel()
    lengths = np.repeat(short, 2)
    if dimension == 3:
        zero = np.zeros(8)
        q = np.column_stack([np.cos(turn / 2), zero, zero, np.sin(turn / 2)])
        there = rods(np.pad(position, ((0, 0), (0, 1))), q, lengths, 0.5, [32.0, 8.0, 8.0])
    else:
        there = rods(position, turn, lengths, 0.5, [32.0, 8.0])
    return there.with_(shape_style=DIMERS)


RATE_OF_TWO_DIMERS = 2 / (2 * np.pi / 4)
RATE_OF_TWO_DISCS = 2 / (np.pi / 4)
"""Of their overlap: both move, each with the drag k_d times its area; in units of k_e and k_d."""


def lone() -> Packing:
    """Two that touch nothing."""
    return rods([[3.0, 1.0], [-4.0, -2.0]], [0.3, 1.2], 1.0, 0.5, [20.0, 20.0])
