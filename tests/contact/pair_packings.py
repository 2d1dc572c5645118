"""Packings of M separate pairs (particles 2m and 2m + 1) with poses in long double.

The second particle of a pair sits some cell vectors away from the first, so that every contact is with
a periodic image.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from spherocylinder_pairs import Pairs

from jamshape import _contact

LONG = np.longdouble
LONG_EPS = float(np.finfo(LONG).eps)


def split(x):
    """(2, ...) the doubles and their small rests."""
    double = np.asarray(x, LONG).astype(float)
    return np.stack([double, (x - double).astype(float)])


def rods(diameters, dimension, k_e=1.0, sides=1, shape=_contact.Spherocylinders, power=2.0):
    return shape(diameters, np.ones(len(diameters)), dimension, k_e, sides, power)


def quaternion_product(p, q):
    vector = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
    return np.column_stack([p[:, 0] * q[:, 0] - (p[:, 1:] * q[:, 1:]).sum(axis=1), vector])


def unit(q):
    return q / np.sqrt((q**2).sum(axis=1, keepdims=True))


def along_x_turned_to(u):
    """Angles (M, 1) or quaternions (M, 4) of the axes u or, as rods have no head, -u."""
    u = u.astype(LONG)
    if u.shape[1] == 2:
        return np.arctan2(u[:, 1:], u[:, :1])
    u = np.where(u[:, :1] < 0.0, -u, u)
    return unit(np.column_stack([1.0 + u[:, 0], np.zeros(len(u)), -u[:, 2], u[:, 1]]))


@dataclass
class PairPacking:
    diameters: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    edges: np.ndarray
    shift: np.ndarray
    shape: type = _contact.Spherocylinders  # or another one of these diameters
    power: float = 2.0

    @classmethod
    def of(cls, rng, pairs, shape=_contact.Spherocylinders):
        n, dimension = pairs.r.shape
        edges = LONG(1) * rng.uniform(5.0, 50.0, dimension)
        shift = rng.integers(1, 3, (n, dimension)) * rng.choice([-1, 1], (n, dimension))
        second = edges * rng.uniform(-1.0, 1.0, (n, dimension))
        first = second + shift * edges + pairs.r
        orientation = along_x_turned_to(np.stack([pairs.u_i, pairs.u_j], 1).reshape(2 * n, -1))
        if dimension == 3:  # rolled, both of a pair alike, so that parallel rods stay parallel
            roll = np.repeat(rng.uniform(-1.0, 1.0, n), 2).astype(LONG)
            zero = np.zeros(2 * n)
            about_x = np.column_stack([np.cos(roll), np.sin(roll), zero, zero])
            orientation = quaternion_product(orientation, about_x)
        A = np.stack([pairs.A_i, pairs.A_j], 1).ravel()
        R = np.stack([pairs.R_i, pairs.R_j], 1).ravel()
        return cls(
            2.0 * np.column_stack([A + R, R, R]),
            np.stack([first, second], 1).reshape(2 * n, -1),
            orientation,
            edges,
            shift,
            shape,
        )

    def __len__(self):
        return len(self.shift)

    def __getitem__(self, which):
        particles = np.arange(2 * len(self)).reshape(-1, 2)[which].ravel()
        return PairPacking(
            self.diameters[particles],
            self.position[particles],
            self.orientation[particles],
            self.edges,
            self.shift[which],
            self.shape,
            self.power,
        )

    @property
    def dimension(self):
        return len(self.edges)

    @property
    def rotations(self):
        return 1 if self.dimension == 2 else 3

    def arguments(self):
        poses = (split(x) for x in (self.position, self.orientation, np.diag(self.edges)))
        return (*poses, np.arange(2 * len(self)).reshape(-1, 2), self.shift)

    def compiled(self, sides, k_e):
        return rods(self.diameters, self.dimension, k_e, sides, self.shape, self.power)

    def derivatives(self, sides, k_e, *, extended=True):
        return self.compiled(sides, k_e).derivatives(*self.arguments(), extended)

    def sums(self, sides, k_e, *, extended=True):
        return self.compiled(sides, k_e).sums(*self.arguments(), extended)

    def gradient(self, sides, k_e):
        """(M, n) of the energies, by the variables of the second derivatives."""
        found = self.sums(sides, k_e)
        assert found["crossing"] == -1
        torque = found["torque"].reshape(len(self), -1)
        return -np.column_stack([found["force"][::2], torque])

    def moved(self, variable, step):
        """r or, by space rotations, i or j moved by (M,) steps along one variable."""
        D = self.dimension
        if variable < D:
            position = self.position.copy()
            position[::2, variable] += step
            return replace(self, position=position)
        which, component = divmod(variable - D, self.rotations)
        orientation = self.orientation.copy()
        if D == 2:
            orientation[which::2, 0] += step
        else:
            turn = np.zeros((len(self), 4), LONG)
            turn[:, 0], turn[:, 1 + component] = np.cos(LONG(0.5) * step), np.sin(LONG(0.5) * step)
            orientation[which::2] = quaternion_product(turn, orientation[which::2])
        return replace(self, orientation=orientation)

    def axes(self):
        if self.dimension == 2:
            return np.column_stack([np.cos(self.orientation), np.sin(self.orientation)])
        w, i, j, k = unit(self.orientation).T
        return np.column_stack(
            [w * w + i * i - j * j - k * k, 2 * (i * j + w * k), 2 * (i * k - w * j)]
        )

    def plain(self):
        """The pairs in long double."""
        r = self.position[::2] - self.position[1::2] - self.shift * self.edges
        u, R = self.axes(), 0.5 * self.diameters[:, 1]
        A = 0.5 * self.diameters[:, 0] - R
        return Pairs(r, u[::2], u[1::2], A[::2], A[1::2], R[::2], R[1::2])
