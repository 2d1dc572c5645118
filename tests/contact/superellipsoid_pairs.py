"""Random pairs of superellipsoids, their norms in NumPy, and rigid motions of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from jamshape import _contact

EXPONENTS = [0.55, 0.75, 0.85, 1.0, 1.5, 2.0, 5.0, 10.0]


def quaternion_product(p, q):
    scalar = p[:, 0] * q[:, 0] - (p[:, 1:] * q[:, 1:]).sum(axis=1)
    vector = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
    return np.column_stack([scalar, vector])


def matrix_of(turn):
    """Rotations (M, D, D) of angles (M, 1) or quaternions (M, 4)."""
    if turn.shape[1] == 1:
        c, s = np.cos(turn[:, 0]), np.sin(turn[:, 0])
        return np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], 1)
    w, v = turn[:, 0], turn[:, 1:]
    cross = np.zeros((len(v), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    cross -= cross.transpose(0, 2, 1)
    square = (w**2 - (v**2).sum(1))[:, None, None] * np.eye(3)
    return square + 2.0 * v[:, :, None] * v[:, None, :] + 2.0 * w[:, None, None] * cross


@dataclass
class Bodies:
    centre: np.ndarray  # (M, D)
    turn: np.ndarray  # (M, 1) angles or (M, 4) quaternions
    semi_axes: np.ndarray  # (M, D)
    p: np.ndarray  # (M,)

    @property
    def dimension(self):
        return self.centre.shape[1]

    def __len__(self):
        return len(self.p)

    def __getitem__(self, which):
        return Bodies(self.centre[which], self.turn[which], self.semi_axes[which], self.p[which])

    def replaced(self, **fields):
        return replace(self, **fields)

    @property
    def rows(self):
        columns = [self.centre, self.turn, self.semi_axes, self.p[:, None]]
        return np.ascontiguousarray(np.hstack(columns))

    def turned(self, component, angle):
        """About a space axis through the centre (about z in 2D)."""
        if self.dimension == 2:
            return self.replaced(turn=self.turn + angle)
        by = np.zeros((len(self), 4))
        by[:, 0], by[:, 1 + component] = np.cos(0.5 * angle), np.sin(0.5 * angle)
        return self.replaced(turn=quaternion_product(by, self.turn))

    def shifted(self, component, step):
        centre = self.centre.copy()
        centre[:, component] += step
        return self.replaced(centre=centre)


def random_bodies(rng, n, dimension, p, axis_range=10.0**0.5):
    """Semi-axes within a factor axis_range**2 of each other, any orientation."""
    spread = np.log(axis_range)
    turn = rng.normal(size=(n, 4))
    turn /= np.linalg.norm(turn, axis=1)[:, None]
    if dimension == 2:
        turn = rng.uniform(-np.pi, np.pi, (n, 1))
    axes = np.exp(rng.uniform(-spread, spread, (n, dimension)))
    return Bodies(rng.normal(size=(n, dimension)), turn, axes, np.broadcast_to(p, n).astype(float))


def random_pairs(rng, n, dimension, p_i, p_j=None, size_range=10.0**0.5):
    i = random_bodies(rng, n, dimension, p_i)
    j = random_bodies(rng, n, dimension, p_i if p_j is None else p_j)
    size = np.exp(rng.uniform(-np.log(size_range), np.log(size_range), (n, 1)))
    return i, j.replaced(semi_axes=size * j.semi_axes)


def at_scale(i, j, eta):
    """Moves i along the line of centres until the pair touches at the scale eta."""
    found = scales(i, j)["eta"]
    r = i.centre - j.centre
    return i.replaced(centre=j.centre + (eta / found)[:, None] * r)


def scales(i, j, normals=None):
    return _contact.superellipsoid_scales(i.rows, j.rows, normals)


def contacts(i, j, epsilon=1.0):
    return _contact.superellipsoid_contacts(i.rows, j.rows, epsilon)


def power_norm(ratio, order):
    """Norm over the last axis; order broadcasts against the others."""
    most = ratio.max(-1)
    relative = ratio / most[..., None]
    return most * (relative ** np.asarray(order)[..., None]).sum(-1) ** (1.0 / order)


def gauge(x, axes, p):
    """1 on the surface; of points in body coordinates."""
    return power_norm(np.abs(x) / axes, 2.0 * p)


def support(n, axes, p):
    return power_norm(np.abs(n) * axes, 2.0 * p / (2.0 * p - 1.0))


def in_body(v, bodies):
    return np.einsum("nba,nb->na", matrix_of(bodies.turn), v)


def shapes_of(i, j, epsilon=1.0):
    """The compiled class of the particles of M pairs: pair m is particles 2m and 2m + 1."""
    n, dimension = i.centre.shape
    diameters = np.ones((2 * n, 3))
    diameters[:, :dimension] = 2.0 * np.stack([i.semi_axes, j.semi_axes], 1).reshape(2 * n, -1)
    exponent = np.stack([i.p, j.p], 1).ravel()
    return _contact.Superellipsoids(diameters, exponent, dimension, epsilon, 1)


def packed(i, j):
    """The same pairs' poses, as the methods of the class take them."""
    n, dimension = i.centre.shape

    def split(x):
        return np.ascontiguousarray(np.stack([x, np.zeros_like(x)]))

    position = np.stack([i.centre, j.centre], 1).reshape(2 * n, dimension)
    turn = np.stack([i.turn, j.turn], 1).reshape(2 * n, -1)
    return (
        split(position),
        split(turn),
        split(100.0 * np.eye(dimension)),
        np.arange(2 * n).reshape(n, 2),
        np.zeros((n, dimension), np.int64),
    )
