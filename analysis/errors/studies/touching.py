"""Pairs of superellipsoids whose faces, edges or tips lie on each other, or nearly so."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from jamshape.arrays import FloatArray
from jamshape.shapes.single_pairs import superellipsoid_scales

EXPONENTS = (0.55, 0.6, 0.75, 0.9, 1.0, 1.1, 1.5, 2.0, 3.0, 4.0, 5.0, 8.0, 10.0)
TILTS = (1e-13, 1e-2)
OVERLAPS = (1e-10, 1e-2)


class Couples(NamedTuple):
    """M pairs, rows of bodies as `superellipsoid_contacts` takes them."""

    i: FloatArray
    j: FloatArray

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return 2 if self.i.shape[1] == 6 else 3

    @property
    def largest_axis(self) -> FloatArray:
        """(M,) the largest semi-axis of both."""
        D = self.dimension
        first = D + (1 if D == 2 else 4)  # behind centre and rotation
        return np.asarray(np.maximum(*(b[:, first : first + D].max(axis=1) for b in self)))


class Bodies(NamedTuple):
    """One particle each: semi-axes (M, D), exponents (M,), a point and a normal there (M, 3)."""

    axes: FloatArray
    p: FloatArray
    point: FloatArray
    normal: FloatArray


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    scalar = a[:, 0] * b[:, 0] - (a[:, 1:] * b[:, 1:]).sum(1)
    vector = a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])
    return np.column_stack([scalar, vector])


def _turned(q: FloatArray, v: FloatArray) -> FloatArray:
    twice = 2 * np.cross(q[:, 1:], v)
    return np.asarray(v + q[:, :1] * twice + np.cross(q[:, 1:], twice))


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def _about(axis: FloatArray, angle: FloatArray) -> FloatArray:
    return np.column_stack([np.cos(angle / 2), np.sin(angle / 2)[:, None] * _unit(axis)])


def _log_uniform(rng: Generator, least: float, most: float, n: int) -> FloatArray:
    return np.asarray(np.exp(rng.uniform(np.log(least), np.log(most), n)))


def _exponents(rng: Generator, n: int) -> FloatArray:
    return np.where(rng.random(n) < 0.5, _log_uniform(rng, 0.55, 10.0, n), rng.choice(EXPONENTS, n))


def _bodies(axes: FloatArray, p: FloatArray, signs: FloatArray) -> Bodies:
    """Give the end of an axis, the middle of an edge or a corner, by the signs (M, D) of its coordinates."""
    n, D = axes.shape
    sum_of = np.abs(signs).sum(axis=1)[:, None]  # of |x/a|^2p where all |x/a| are 0 or 1
    ratio = np.abs(signs) / sum_of ** (1 / (2 * p[:, None]))
    flat = np.zeros((n, 3 - D))
    point = np.hstack([signs * axes / sum_of ** (1 / (2 * p[:, None])), flat])
    normal = np.hstack([signs * ratio ** (2 * p[:, None] - 1) / axes, flat])
    return Bodies(axes, p, point, _unit(normal))


def _signs(rng: Generator, n: int, D: int) -> FloatArray:
    some = np.argsort(rng.random((n, D)), axis=1) < rng.integers(1, D + 1, n)[:, None]
    return np.asarray(some * rng.choice([-1.0, 1.0], (n, D)))


def _two_bodies(rng: Generator, n: int, D: int) -> tuple[Bodies, Bodies]:
    """Draw two shapes and what of them touches: most often the same exponent, and the same of both."""
    p_i = _exponents(rng, n)
    p_j = np.where(rng.random(n) < 0.6, p_i, _exponents(rng, n))
    axes = np.exp(rng.uniform(-1, 1, (n, D)))
    axes[rng.random(n) < 0.3] = 1.0
    size, alike = np.exp(rng.uniform(-1, 1, (n, 1))), rng.random((n, 1))
    other = np.where(alike < 0.6, size * axes, np.exp(rng.uniform(-1, 1, (n, D))))
    axes_j = np.where(alike < 0.3, axes, other)
    signs = _signs(rng, n, D)
    signs_j = np.where(rng.random((n, 1)) < 0.6, signs, _signs(rng, n, D))
    return _bodies(axes, p_i, signs), _bodies(axes_j, p_j, signs_j)


def _small_or_not(rng: Generator, n: int, shares: tuple[float, float], most: float) -> FloatArray:
    """Nothing, 1e-13 to 1e-2, or up to `most`; the first two with these shares."""
    which = rng.random(n)
    small = np.where(which < sum(shares), _log_uniform(rng, *TILTS, n), rng.uniform(0, most, n))
    return np.where(which < shares[0], 0.0, small * rng.choice([-1.0, 1.0], n))


def _orientation_of_j(rng: Generator, i: Bodies, j: Bodies, D: int) -> FloatArray:
    """Turn the normal of j to that of i, then twist and tilt it a little; beside i, quaternions."""
    n = len(i.p)
    opposite = (i.normal * j.normal).sum(axis=1) < -0.999
    normal = np.where(opposite[:, None], -j.normal, j.normal)
    cosine = (normal * i.normal).sum(axis=1)
    turn = _unit(np.column_stack([1 + cosine, np.cross(normal, i.normal)]))
    if D == 3:
        turn = _product(_about(i.normal, _small_or_not(rng, n, (0.4, 0.2), 3.0)), turn)
    tilt = _small_or_not(rng, n, (0.1, 0.9), 0.0)
    axis = rng.normal(size=(n, 3)) if D == 3 else np.tile([0.0, 0.0, 1.0], (n, 1))
    return _product(_about(axis, tilt), turn)


def _rows(D: int, centre: FloatArray, turn: FloatArray, body: Bodies) -> FloatArray:
    if D == 2:
        turn = 2 * np.arctan2(turn[:, 3:], turn[:, :1])
    return np.ascontiguousarray(np.hstack([centre[:, :D], turn, body.axes, body.p[:, None]]))


def targeted_pairs(rng: Generator, n: int, D: int) -> Couples:
    """Draw n pairs in D dimensions: as the head of superellipsoid_error.py says."""
    i, j = _two_bodies(rng, n, D)
    turn_j = _orientation_of_j(rng, i, j, D)
    opposite = ((i.normal * j.normal).sum(axis=1) < -0.999)[:, None]
    point_j = _turned(turn_j, np.where(opposite, -j.point, j.point))
    side = rng.normal(size=(n, 3)) * ([1, 1, 0] if D == 2 else 1)
    side -= (side * i.normal).sum(axis=1)[:, None] * i.normal
    smallest = np.minimum(i.axes.min(axis=1), j.axes.min(axis=1))
    shift = (_small_or_not(rng, n, (0.25, 0.35), 0.7) * smallest)[:, None] * _unit(side)
    frame = _unit(rng.normal(size=(n, 4)) * ([1, 0, 0, 1] if D == 2 else 1))
    frame[rng.random(n) < 0.2] = [1.0, 0.0, 0.0, 0.0]
    r = _turned(frame, -(i.point + point_j + shift))
    a, b = _rows(D, r, frame, i), _rows(D, 0 * r, _product(frame, turn_j), j)
    eta = superellipsoid_scales(a, b)["eta"]
    a[:, :D] *= (np.sqrt(1 - _log_uniform(rng, *OVERLAPS, n)) / eta)[:, None]
    swapped = (rng.random(n) < 0.5)[:, None]
    return Couples(
        *(np.ascontiguousarray(x) for x in (np.where(swapped, b, a), np.where(swapped, a, b)))
    )
