"""Extreme packings of rods and discs and, by `style`, of dimers of the same half lengths and radii."""

from functools import cache, partial

import numpy as np
from packings_in_a_box import (
    deepest,
    hardened,
    in_doubles,
    packing_of,
    pressed,
    squeezed_until,
    widened,
)
from squeezed import squeezed

from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles

RODS, DIMERS = "spherocylinder", "dimer"


def sizes(half_length, radius):
    return 2 * np.column_stack([half_length + radius, radius, radius])


def rods(position, orientation, half_length, radius, edges, style=RODS):
    lengths = np.broadcast_arrays(half_length, radius, np.zeros(len(position)))
    return packing_of(position, orientation, sizes(*lengths[:2]), edges, shape_style=style)


def as_dimers(scene):
    """Maker of dimers of the sizes and poses of rods."""
    return lambda: scene().with_(shape_style=DIMERS)


# --- in one box ----------------------------------------------------------------------------------


def started(half_length, radius, phi, dimension, style):
    particles = Particles.given(style, sizes(half_length, radius))
    start = random_packing(len(radius), phi, 1, particles, dimension)
    return in_doubles(pressed(start, 0.1))


@cache
def all_aspect_ratios(dimension, largest=100.0, style=RODS):
    """Alpha from 1e-6 to the largest; the longest are longer than the box."""
    alpha = np.append(np.geomspace(1e-6, largest, 9), np.tile([0.0, 1e-6, 0.01, 1.0], 4))
    phi = 0.3 if dimension == 2 else 0.5 / largest
    radius = np.where(np.arange(len(alpha)) % 2, 0.5, 0.7)
    return started(alpha * radius, radius, phi, dimension, style)


@cache
def all_sizes(dimension, style=RODS):
    """Alpha 1, radii from 0.5 to 5."""
    radius = np.append(np.geomspace(0.5, 5.0, 5), np.full(40, 0.5))
    return started(radius, radius, 0.45 if dimension == 2 else 0.2, dimension, style)


def stack(angle, dimension=2, n=6):
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


def longer_than_the_box(alpha=100.0, n=4):
    """Rods of length 101 in a box 60 wide: each lies on its own image and its neighbours'."""
    rng = np.random.default_rng(1)
    gap, width = 0.95, 60.0
    tilt = np.arcsin(gap / width)
    height = 2 * gap * n / np.cos(tilt)
    x = rng.uniform(-2, 2, n)
    y = height * (np.arange(n) / n - 0.45) + np.tan(tilt) * x
    angle = tilt + 1e-12 * rng.uniform(-1, 1, n)
    return rods(np.column_stack([x, y]), angle, alpha / 2, 0.5, [width, height])


def own_images(dimension):
    """Two rods that touch their own images and several images of each other."""
    if dimension == 2:
        return rods([[0.0, 0.0], [0.25, 1.0]], [0.0, 0.02], 1.5, [0.6, 0.5], [4.0, 2.0])
    turn = [[1.0, 0.0, 0.0, 0.01], [1.0, 0.0, 0.01, 0.0]]
    position = [[0.0, 0.0, 0.0], [0.25, 1.0, 0.1]]
    return rods(position, turn, 1.5, [0.6, 0.5], [4.0, 2.0, 1.15])


@cache
def deep(dimension, alpha=1.0, n=16, style=RODS):
    """Far beyond jamming: minimised while it is compressed, to overlaps of a third.

    In 3D some samples end on a kink of twisted rods; that of this seed does not.
    """
    phi, seed = (0.4, 1) if dimension == 2 else (0.2, 4)
    packing = random_packing(n, phi, seed, Particles.of(style, alpha=alpha), dimension)
    return squeezed_until(
        packing, 0.02, 60, lambda found: deepest(found.state.packing(packing)) > 1 / 3
    )


@cache
def jammed(alpha, n=16, phi=0.9, style=RODS):
    packing, state = squeezed(n, alpha, phi, style=style)
    return in_doubles(state.packing(packing))


@cache
def loose(dimension, alpha, n=8, style=RODS):
    """Particles of one aspect ratio in a box that leaves them room."""
    phi = 0.2 if dimension == 2 else min(0.2, 0.4 / (1 + alpha))
    start = random_packing(n, phi, 1, Particles.of(style, alpha=alpha), dimension)
    return widened(pressed(start, 1e-3), 0.02)


@cache
def hard(dimension, alpha, style=RODS):
    return hardened(loose(dimension, alpha, 12, style))


@cache
def jammed_off_kinks(alpha):
    """Jammed rods turned off the kinks of side-to-side contacts, where the energy has no rate."""
    packing, rng = jammed(alpha), np.random.default_rng(9)
    return packing.with_(orientation=packing.orientation + 0.03 * rng.normal(size=packing.n))


def of_two_types(alpha, style=RODS):
    packing = jammed(alpha, style=style)
    return packing.with_(species=1 + np.arange(packing.n) % 2)


# --- two or a few --------------------------------------------------------------------------------


def in_space(angle):
    """Quaternions of rotations about z."""
    zero = np.zeros_like(angle)
    return np.column_stack([np.cos(angle / 2), zero, zero, np.sin(angle / 2)])


def pairs_of_rods(position, angle, half_length, radius, edges, dimension, style=RODS):
    """Pairs in a plane of the plane or of space."""
    if dimension == 2:
        return rods(position, angle, half_length, radius, edges, style)
    there = np.pad(position, ((0, 0), (0, 1)))
    return rods(there, in_space(angle), half_length, radius, [*edges, edges[1]], style)


def direction(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def overlaps(dimension, overlap):
    """Pairs of every class of contact, far from each other, with this overlap."""
    lengths, radii = np.array([1.0, 0.6]), np.array([0.5, 0.3])
    (long, short), d = lengths, (1 - overlap) * radii.sum()
    rows = [  # angles of i and j, centre of j
        (0.0, 1.0, np.array([0.3, d]) + short * direction(1.0)),
        (0.7, -0.6, np.array([d, 0.0]) + long * direction(0.7) + short * direction(-0.6)),
        (0.0, 0.0, np.array([0.8, d])),
        (0.0, 1e-12, np.array([0.8, d])),
    ]
    centres = np.array([[16.0 * n - 24.0, 0.0] for n in range(len(rows))])
    position = np.stack([centres, centres + [shift for *_, shift in rows]], axis=1).reshape(-1, 2)
    angle = np.array([turns for *turns, _ in rows]).ravel()
    half, radius = np.tile(lengths, len(rows)), np.tile(radii, len(rows))
    return pairs_of_rods(position, angle, half, radius, [72.0, 16.0], dimension)


def interlocked(dimension, overlap):
    """Pairs of dimers with one to four bonds, the deepest of which has this overlap."""
    d, half = 1 - overlap, 0.5
    rise = [d, np.sqrt(d**2 - half**2), np.sqrt(d**2 - half**2), d]
    across = [2 * half, 0.0, half, 0.0]
    angle = [0.0, np.pi / 2, 0.0, 0.0]
    lift = [0.0, half, 0.0, 0.0]  # upright ones stand on their lower disc
    centres = np.array([[8.0 * k - 12.0, 0.0] for k in range(4)])
    other = centres + np.column_stack([across, np.add(rise, lift)])
    position = np.stack([centres, other], axis=1).reshape(-1, 2)
    turn = np.column_stack([np.zeros(4), angle]).ravel()
    lengths = np.repeat([half, half, half, 0.1], 2)
    return pairs_of_rods(position, turn, lengths, 0.5, [32.0, 8.0], dimension, DIMERS)


def two(position, angle, half_length=1.0, style=RODS):
    return rods(position, angle, half_length, 0.5, [12.0, 12.0], style)


crossed = partial(two, [[0.0, 0.0], [0.1, 0.2]], [0.0, 1.5])


def crossed_by(depth):
    """Two, the tip of one beyond the spine of the other by this depth."""
    return two([[0.0, 0.0], [0.3, 1 - depth]], [0.0, np.pi / 2])


def two_discs(overlap=0.1):
    return rods([[0.0, 0.0], [1.0 - overlap, 0.0]], 0.0, 0.0, 0.5, [20.0, 20.0])


def two_dimers(overlap=0.1):
    """Two in a line, with one bond."""
    return rods([[0.0, 0.0], [2.0 - overlap, 0.0]], 0.0, 0.5, 0.5, [20.0, 20.0], DIMERS)


# Of the overlap, in units of k_e and k_d: both move, each with the drag k_d times its area.
RATE_OF_TWO_DISCS = 2 / (np.pi / 4)
RATE_OF_TWO_DIMERS = RATE_OF_TWO_DISCS / 2

# Two that touch nothing.
lone = partial(rods, [[3.0, 1.0], [-4.0, -2.0]], [0.3, 1.2], 1.0, 0.5, [20.0, 20.0])
