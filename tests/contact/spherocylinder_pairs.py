"""Pairs of spherocylinders built around a known contact, and the binding called on them.

Each builder chooses the point of contact first (where it sits on either spine, the normal and the
overlap) and places i last, so class, distance and lever arms are known before the code under test
says anything.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache

import numpy as np

from jamshape import _contact

APART, TOUCHING, CROSSING = 0, 1, 2
TIP_TO_TIP, TIP_TO_SIDE, SIDE_TO_SIDE = 0, 1, 2

EPS = np.finfo(float).eps
SHALLOW, FADE_LENGTH, FADE_GROWTH = 0.01, 0.05, 4.0
SMALL_SINE = 0.1  # times A_min / d


def growth_of(depth):
    """0 up to a mean overlap of SHALLOW times (A_min / d)^2, and about that depth far above."""
    g = np.where(depth.real > SHALLOW, depth - SHALLOW, 0.0)
    return g**3 / (g**2 + SHALLOW**2)


def length_of_fade(shorter, depth):
    """Length of opposite spines over which the second bond fades in."""
    square = (FADE_GROWTH * growth_of(depth)) ** 2
    return shorter * np.sqrt((FADE_LENGTH**2 + square) / (1.0 + square))


def least_whole(shorter, depth):
    """Overlap of the spines of parallel rods from which on the second bond does not fade."""
    return length_of_fade(shorter, np.asarray(depth))


def least_whole_of(pairs):
    """Least length of the pairs as they were built."""
    shapes = (pairs.A_i, pairs.A_j, pairs.R_i, pairs.R_j)
    return least_whole(np.minimum(pairs.A_i, pairs.A_j), depth_of(shapes, pairs.overlap))


@dataclass
class Pairs:
    """M pairs; r is the centre of i relative to that of j."""

    r: np.ndarray
    u_i: np.ndarray
    u_j: np.ndarray
    A_i: np.ndarray
    A_j: np.ndarray
    R_i: np.ndarray
    R_j: np.ndarray

    @property
    def dimension(self):
        return self.r.shape[1]

    @property
    def d(self):
        return self.R_i + self.R_j

    @property
    def extent(self):
        """Largest coordinate that enters: what rounding is relative to."""
        return np.linalg.norm(self.r, axis=1) + self.A_i + self.A_j

    def __len__(self):
        return len(self.r)

    def __getitem__(self, which):
        return type(self)(**{f.name: getattr(self, f.name)[which] for f in fields(self)})

    def replaced(self, **changes):
        return Pairs(**({f.name: getattr(self, f.name) for f in fields(Pairs)} | changes))

    def swapped(self):
        return Pairs(-self.r, self.u_j, self.u_i, self.A_j, self.A_i, self.R_j, self.R_i)

    def bodies(self, centre_j=0.0):
        """Rows of i and of j as the binding reads them; j at the origin keeps r as it is."""
        centre_j = np.broadcast_to(centre_j, self.r.shape)
        i = np.column_stack([centre_j + self.r, self.u_i, self.A_i, self.R_i])
        j = np.column_stack([centre_j, self.u_j, self.A_j, self.R_j])
        return i, j


@dataclass
class BuiltPairs(Pairs):
    """Pairs with the contact that they were built around: feet s and t, normal into i, overlap."""

    s: np.ndarray
    t: np.ndarray
    normal: np.ndarray
    overlap: np.ndarray

    def swapped(self):
        plain = super().swapped()
        return BuiltPairs(**vars(plain), s=self.t, t=self.s, normal=-self.normal,
                          overlap=self.overlap)  # fmt: skip


def contacts(pairs, sides, k_e=1.0, power=2.0):
    return _contact.spherocylinder_contacts(*pairs.bodies(), k_e, sides, power)


def energies(pairs, sides, k_e=1.0):
    return contacts(pairs, sides, k_e)["energy"]


def force_scale(pairs, result, k_e, power=2.0):
    """The force of one bond of the built overlap, or the force if that is larger."""
    of_one = k_e * pairs.overlap ** (power - 1.0) / pairs.d
    return np.maximum(of_one, np.linalg.norm(result["force"], axis=1))


def relative_errors(pairs, result, gradient, k_e, power=2.0):
    """Largest error of each pair: of the force over its scale, of the torques over force (A + R)."""
    by_r, by_i, by_j = gradient
    force = force_scale(pairs, result, k_e, power)
    return np.max([
        np.abs(by_r + result["force"]).max(axis=1) / force,
        np.abs(by_i + result["torque_i"]).max(axis=1) / (force * (pairs.A_i + pairs.R_i)),
        np.abs(by_j + result["torque_j"]).max(axis=1) / (force * (pairs.A_j + pairs.R_j)),
    ], axis=0)  # fmt: skip


def concatenated(*parts):
    kind = BuiltPairs if all(isinstance(p, BuiltPairs) for p in parts) else Pairs
    return kind(**{f.name: np.concatenate([getattr(p, f.name) for p in parts])
                   for f in fields(kind)})  # fmt: skip


def swapped_every_other(pairs):
    """Every second pair with i and j exchanged, so that neither is favoured by construction."""
    return concatenated(pairs[0::2], pairs[1::2].swapped())


# --- vectors -----------------------------------------------------------------------------------


def row_dot(a, b):
    return np.einsum("mk,mk->m", a, b)


def cross(a, b):
    """Columns of the cross product: one in 2D (about z), three in 3D."""
    if a.shape[1] == 2:
        return (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[:, None]
    return np.cross(a, b)


def scaled(factor, vectors):
    return np.asarray(factor)[:, None] * vectors


def normalised(v):
    return v / np.linalg.norm(v, axis=1)[:, None]


def random_directions(rng, n, dimension):
    return normalised(rng.normal(size=(n, dimension)))


def random_perpendicular(rng, axis):
    if axis.shape[1] == 2:
        return scaled(
            rng.choice([-1.0, 1.0], len(axis)), np.column_stack([-axis[:, 1], axis[:, 0]])
        )
    v = rng.normal(size=axis.shape)
    for _ in range(2):  # the second pass removes what cancellation left in the first
        v = normalised(v - scaled(row_dot(v, axis), axis))
    return v


def turned(u, angle, component):
    """Axes turned by `angle` about z (2D) or about the coordinate axis `component` (3D)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    if u.shape[1] == 2:
        return np.column_stack([cosine * u[:, 0] - sine * u[:, 1],
                                sine * u[:, 0] + cosine * u[:, 1]])  # fmt: skip
    first, second = (component + 1) % 3, (component + 2) % 3
    result = u.copy()
    result[:, first] = cosine * u[:, first] - sine * u[:, second]
    result[:, second] = sine * u[:, first] + cosine * u[:, second]
    return result


# --- shapes and builders -----------------------------------------------------------------------


def log_uniform(rng, low, high, n):
    return np.exp(rng.uniform(np.log(low), np.log(high), n))


def random_shapes(rng, n, alpha=(1e-6, 100.0)):
    """A_i, A_j, R_i, R_j: size ratios to 10, alpha log-uniform and unequal, in any unit of length."""
    unit = log_uniform(rng, 0.1, 10.0, n)
    R_i, R_j = unit * log_uniform(rng, 1.0, 10.0, n), unit * log_uniform(rng, 1.0, 10.0, n)
    return R_i * log_uniform(rng, *alpha, n), R_j * log_uniform(rng, *alpha, n), R_i, R_j


def placed(shapes, u_i, u_j, s, t, normal, overlap):
    """Place i so that foot s on its spine lies along `normal` from foot t on the spine of j."""
    A_i, A_j, R_i, R_j = shapes
    delta = scaled((1.0 - overlap) * (R_i + R_j), normal)
    r = delta - scaled(s, u_i) + scaled(t, u_j)
    return BuiltPairs(r, u_i, u_j, A_i, A_j, R_i, R_j, s, t, normal, overlap)


def overlaps(rng, n, low=1e-3, high=1.0 / 3.0):
    return log_uniform(rng, low, high, n)


def facing(rng, u, direction):
    """u or -u, whichever has a positive component along `direction`; never quite zero."""
    sign = np.where(row_dot(u, direction) < 0.0, -1.0, 1.0)
    return normalised(scaled(sign, u) + scaled(1e-3 * rng.uniform(0.5, 1.0, len(u)), direction))


def tip_to_tip(rng, n, dimension, overlap, alpha=(1e-6, 100.0)):
    shapes = random_shapes(rng, n, alpha)
    normal = random_directions(rng, n, dimension)
    end_i, end_j = rng.choice([-1.0, 1.0], n), rng.choice([-1.0, 1.0], n)
    into_i = facing(rng, random_directions(rng, n, dimension), normal)  # from the tip inwards
    into_j = facing(rng, random_directions(rng, n, dimension), -normal)
    return placed(shapes, scaled(-end_i, into_i), scaled(-end_j, into_j), end_i * shapes[0],
                  end_j * shapes[1], normal, overlap)  # fmt: skip


def tip_to_side(rng, n, dimension, overlap, alpha=(1e-6, 100.0)):
    shapes = random_shapes(rng, n, alpha)
    u_j = random_directions(rng, n, dimension)
    normal = random_perpendicular(rng, u_j)
    end = rng.choice([-1.0, 1.0], n)
    into_i = facing(rng, random_directions(rng, n, dimension), normal)
    t = 0.999 * shapes[1] * rng.uniform(-1.0, 1.0, n)
    return swapped_every_other(
        placed(shapes, scaled(-end, into_i), u_j, end * shapes[0], t, normal, overlap)
    )


def disc_to_rod(rng, n, dimension, overlap, at_side):
    """A disc against the side of a rod, or against its tip."""
    _, A_j, R_i, R_j = random_shapes(rng, n)
    shapes = (np.zeros(n), A_j, R_i, R_j)
    u_i, u_j = random_directions(rng, n, dimension), random_directions(rng, n, dimension)
    if at_side:
        normal, t = random_perpendicular(rng, u_j), 0.999 * A_j * rng.uniform(-1.0, 1.0, n)
    else:
        end = rng.choice([-1.0, 1.0], n)
        normal = facing(rng, random_directions(rng, n, dimension), scaled(end, u_j))
        t = end * A_j
    return swapped_every_other(placed(shapes, u_i, u_j, np.zeros(n), t, normal, overlap))


def disc_to_disc(rng, n, dimension, overlap):
    _, _, R_i, R_j = random_shapes(rng, n)
    zero = np.zeros(n)
    u_i, u_j = random_directions(rng, n, dimension), random_directions(rng, n, dimension)
    normal = random_directions(rng, n, dimension)
    return placed((zero, zero, R_i, R_j), u_i, u_j, zero, zero, normal, overlap)


def skew(rng, n, overlap, angle, alpha=(1e-6, 100.0)):
    """3D: spines that pass each other at `angle`, closest inside both."""
    shapes = random_shapes(rng, n, alpha)
    normal = random_directions(rng, n, 3)
    u_j = random_perpendicular(rng, normal)
    sideways = np.cross(normal, u_j)
    u_i = scaled(np.cos(angle), u_j) + scaled(np.sin(angle), sideways)
    u_i = scaled(rng.choice([-1.0, 1.0], n), u_i)
    s = 0.999 * shapes[0] * rng.uniform(-1.0, 1.0, n)
    t = 0.999 * shapes[1] * rng.uniform(-1.0, 1.0, n)
    return placed(shapes, u_i, u_j, s, t, normal, overlap)


def limited_to_depth(shapes, overlap, depth):
    """Overlaps up to `depth` times (A_min / d)^2, beyond which two bonds become one."""
    return np.minimum(overlap, depth * overlap / depth_of(shapes, overlap))


def depth_of(shapes, overlap):
    """Overlaps over (A_min / d)^2."""
    A_i, A_j, R_i, R_j = shapes
    return overlap * ((R_i + R_j) / np.minimum(A_i, A_j)) ** 2


def parallel(rng, n, dimension, overlap, alpha=(1e-6, 100.0), fading=False, depth=np.inf):
    """Exactly parallel, spines that overlap; s and t are the middle of the overlap of the spines.

    With `fading` they overlap by less than the length over which the second bond fades in. Returns
    the pairs and half the length of the overlap.
    """
    shapes = random_shapes(rng, n, alpha)
    overlap = limited_to_depth(shapes, overlap, depth)
    A_i, A_j = shapes[:2]
    u_j = random_directions(rng, n, dimension)
    sign = rng.choice([-1.0, 1.0], n)
    shorter = np.minimum(A_i, A_j)
    most = least_whole(shorter, depth_of(shapes, overlap)) if fading else A_i + A_j
    least = 0.03 if fading else 1e-3  # a second bond of less is none
    offset = rng.choice([-1.0, 1.0], n) * (A_i + A_j - most * rng.uniform(least, 0.999, n))
    low, high = np.maximum(offset - A_i, -A_j), np.minimum(offset + A_i, A_j)
    t = 0.5 * (low + high)
    s = sign * (t - offset)  # offset is that of i's centre along u_j
    built = placed(shapes, scaled(sign, u_j), u_j, s, t, random_perpendicular(rng, u_j), overlap)
    return built, 0.5 * (high - low)


def nearly_parallel(rng, n, dimension, overlap, alpha=(1e-6, 100.0), least_tilt=1e-3, depth=np.inf):
    """A tip of one on the side of the other at so small an angle that the far ends overlap too.

    The far ends are `least_tilt` to 0.9 of the built overlap further apart.

    Half of them have spines that overlap by no more than the length over which the second bond,
    or the mean of both, fades in.
    """
    shapes = random_shapes(rng, n, alpha)
    overlap = limited_to_depth(shapes, overlap, depth)
    A_i, A_j, d = shapes[0], shapes[1], shapes[2] + shapes[3]
    u_j = random_directions(rng, n, dimension)
    normal = random_perpendicular(rng, u_j)
    towards = rng.choice([-1.0, 1.0], n)  # i's spine leaves its tip along towards * u_j
    fading = np.arange(n) % 4 < 2
    shorter = np.minimum(A_i, A_j)
    of_second = np.arange(n) % 8 == 0  # the others fade with the mean of both
    of_overlap = length_of_fade(shorter, depth_of(shapes, overlap))
    fade = np.where(of_second, of_overlap, FADE_LENGTH * shorter)
    most = np.where(fading, 1.2 * fade, 2.0 * A_j)
    # A second bond of less is none.
    stretch = np.maximum(most * rng.uniform(1e-3, 0.999, n), 0.03 * of_overlap)
    t = towards * (A_j - stretch)
    common = np.minimum(2.0 * A_i, stretch)

    room = overlap * d / common
    tilt = np.minimum(room, 1.0) * rng.uniform(least_tilt, 0.9, n)
    into_i = scaled(np.cos(tilt) * towards, u_j) + scaled(np.sin(tilt), normal)
    if dimension == 3:  # and twisted about the normal
        twist = np.minimum(np.sqrt(room * d / common), 0.8) * rng.uniform(-0.4, 0.4, n)
        sideways = np.cross(normal, u_j)
        into_i = scaled(np.cos(tilt), scaled(towards * np.cos(twist), u_j)
                        + scaled(np.sin(twist), sideways)) + scaled(np.sin(tilt), normal)  # fmt: skip
    end = rng.choice([-1.0, 1.0], n)
    return swapped_every_other(
        placed(shapes, scaled(-end, into_i), u_j, end * A_i, t, normal, overlap)
    )


def deep(rng, n, dimension, overlap, depth=(0.5, 1e4)):
    """Two bonds on their way to one, or past it: overlaps of `depth` times (A_min / d)^2.

    Tilted, in 3D in any direction, by up to the sine over which the mean of the two bonds fades out;
    half of them with spines that overlap by no more than the length over which it fades in.
    """
    _, _, R_i, R_j = random_shapes(rng, n)
    d = R_i + R_j
    shorter = d * np.sqrt(overlap / log_uniform(rng, *depth, n))
    longer = shorter * log_uniform(rng, 1.0, 10.0, n)
    i_is_shorter = rng.uniform(size=n) < 0.5
    A_i, A_j = np.where(i_is_shorter, [shorter, longer], [longer, shorter])
    u_j = random_directions(rng, n, dimension)
    normal = random_perpendicular(rng, u_j)
    sine = SMALL_SINE * shorter / d * rng.uniform(0.0, 0.999, n)
    sideways = random_perpendicular(rng, u_j)
    away = scaled(np.where(row_dot(sideways, normal) < 0.0, -1.0, 1.0), sideways)
    towards, end = rng.choice([-1.0, 1.0], (2, n))  # i's spine leaves its tip along towards * u_j
    into_i = scaled(np.sqrt(1.0 - sine**2) * towards, u_j) + scaled(sine, away)
    most = np.where(np.arange(n) % 4 < 2, 1.2 * FADE_LENGTH * shorter, 2.0 * A_j)
    t = towards * (A_j - most * rng.uniform(1e-3, 0.999, n))
    return swapped_every_other(
        placed((A_i, A_j, R_i, R_j), scaled(-end, into_i), u_j, end * A_i, t, normal, overlap)
    )


# --- samples of the three classes --------------------------------------------------------------


def tip_pairs(rng, n, dimension):
    return concatenated(
        tip_to_tip(rng, n, dimension, overlaps(rng, n)),
        disc_to_rod(rng, n // 4, dimension, overlaps(rng, n // 4), at_side=False),
        disc_to_disc(rng, n // 4, dimension, overlaps(rng, n // 4)),
    )


def tip_and_side_pairs(rng, n, dimension):
    return concatenated(
        tip_to_side(rng, n, dimension, overlaps(rng, n)),
        disc_to_rod(rng, n // 4, dimension, overlaps(rng, n // 4), at_side=True),
        nearly_parallel(rng, n // 2, dimension, overlaps(rng, n // 2)),
    )


def side_pairs(rng, n, dimension, sides):
    """With one bond: skew rods in 3D. With two also nearly parallel and parallel ones.

    Of the parallel ones only those whose second bond has its full strength: the others sit on a kink.
    """
    parts = []
    if sides == 2:
        # Below, overlaps that leave two bonds are too small to be differenced.
        alpha = (0.1, 100.0)
        for m, depth in ((n // 4, SHALLOW), (n // 8, np.inf)):
            both, half_overlap = parallel(rng, m, dimension, overlaps(rng, m), alpha, depth=depth)
            whole = 2.0 * half_overlap > 1.001 * least_whole_of(both)
            parts.append(both[whole])
        parts += [
            nearly_parallel(rng, n, dimension, overlaps(rng, n), alpha, depth=8.0),
            deep(rng, n // 2, dimension, overlaps(rng, n // 2)),
            # Short rods at larger angles.
            nearly_parallel(rng, m, dimension, overlaps(rng, m, 0.1), (0.3, 2.0), depth=2.0),
        ]
    if dimension == 3:
        parts.append(skew(rng, n, overlaps(rng, n), rng.uniform(0.5, 0.5 * np.pi, n)))
    return concatenated(*parts)


@cache
def touching(dimension, sides, kind):
    """1e4 to 3e4 pairs that the code under test puts in the class `kind`.

    With one bond that is the class they were built for, but for tips placed within rounding of the
    end of a short rod. With two, nearly round rods that meet tip to tip or tip to side have their far
    ends in reach as well and become side to side.
    """
    rng = np.random.default_rng([1, dimension, sides, kind])
    n = 12_000 if sides == 1 else 25_000
    if kind == SIDE_TO_SIDE:
        pairs = side_pairs(rng, n, dimension, sides)
    else:
        pairs = (tip_pairs if kind == TIP_TO_TIP else tip_and_side_pairs)(rng, n, dimension)
    result = contacts(pairs, sides)
    assert np.all(result["status"] == TOUCHING)
    as_built = result["kind"] == kind
    if sides == 1:
        assert np.mean(as_built) > 0.99
    elif (
        kind == SIDE_TO_SIDE
    ):  # tilted rods of which a tip lies beyond the other's end have one bond
        assert np.mean(as_built) > 0.5
    else:
        assert np.mean(as_built | (result["kind"] == SIDE_TO_SIDE)) > 0.99
    most = 30_000 if (sides, kind) == (2, SIDE_TO_SIDE) else 20_000
    return pairs[rng.permutation(np.flatnonzero(as_built))[:most]]


EVERY_CLASS = [
    (dimension, sides, kind)
    for dimension in (2, 3)
    for sides in (1, 2)
    for kind in (TIP_TO_TIP, TIP_TO_SIDE, SIDE_TO_SIDE)
    # One bond between flat sides in 2D is for parallel rods only, where the energy has a kink.
    if (dimension, sides, kind) != (2, 1, SIDE_TO_SIDE)
]
