"""Pairs of bodies of any shape with forms, each pair far from all others, and the compiled class called on them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from pair_packings import quaternion_product, unit

from jamshape import _contact
from jamshape.shapes.table import SHAPES

FAR = 1e6  # edge of a box that no image reaches across


@dataclass
class BodyPairs:
    """M pairs: row 2m is i of pair m, row 2m + 1 its j, at the origin."""

    shape: str
    diameters: np.ndarray
    form: np.ndarray
    centre: np.ndarray
    """(2M, D)"""
    turn: np.ndarray
    """(2M, 1) angles or (2M, 4) quaternions."""

    def __len__(self):
        return len(self.centre) // 2

    @property
    def dimension(self):
        return self.centre.shape[1]

    def compiled(self, k_e=1.0, sides=2):
        arrays = self.diameters.tobytes(), self.form.tobytes()
        return _compiled(self.shape, arrays, self.form.shape, self.dimension, k_e, sides)

    def arguments(self):
        D, n = self.dimension, len(self)
        poses = (np.stack([x, 0 * x]) for x in (self.centre, self.turn, FAR * np.eye(D)))
        return (*poses, np.arange(2 * n).reshape(-1, 2), np.zeros((n, D), np.int64))

    def contacts(self, k_e=1.0, sides=2):
        """Arrays of all M pairs, zero where they are apart."""
        found = self.compiled(k_e, sides).contacts(*self.arguments())
        every = {name: np.zeros((len(self), *x.shape[1:]), x.dtype) for name, x in found.items()}
        for name, x in found.items():
            every[name][found["pair"]] = x
        return every

    def near(self, margin):
        return self.compiled().near(*self.arguments(), margin)

    def overlaps(self):
        return self.compiled().overlaps(*self.arguments())

    def moved(self, shift, angle=0.0):
        """Every i moved by (M, D) shifts and turned by (M,) angles about z."""
        centre, turn = self.centre.copy(), self.turn.copy()
        centre[::2] += shift
        if self.dimension == 2:
            turn[::2, 0] += angle
        else:
            half = np.broadcast_to(0.5 * np.asarray(angle), len(self))
            zero = np.zeros(len(self))
            by = np.column_stack([np.cos(half), zero, zero, np.sin(half)])
            turn[::2] = quaternion_product(by, turn[::2])
        return dataclasses.replace(self, centre=centre, turn=turn)

    def matrices(self):
        """(2M, D, D) rotations of the bodies' coordinates to space."""
        if self.dimension == 2:
            c, s = np.cos(self.turn[:, 0]), np.sin(self.turn[:, 0])
            return np.stack([np.stack([c, -s], 1), np.stack([s, c], 1)], 1)
        w, x, y, z = unit(self.turn).T
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        return np.moveaxis(np.array(rows), 2, 0)


@lru_cache(8)
def _compiled(shape, arrays, shape_of_form, dimension, k_e, sides):
    """Compile bodies once, however they move: of balls, moments take a while."""
    diameters = np.frombuffer(arrays[0]).reshape(-1, 3)
    form = np.frombuffer(arrays[1]).reshape(shape_of_form)
    make = getattr(_contact, SHAPES[shape].compiled_name)
    return make(diameters, form, dimension, k_e, sides)


def sized(name, parameters, size):
    """Diameters (n, 3) and forms (n, K) of one body of each of n sets of parameters, zeros at the end."""
    shape = SHAPES[name]
    rows = [
        shape.sizes({p.name: p.read(its[p.name]) for p in shape.parameters}, np.array([s]))
        for its, s in zip(parameters, size, strict=True)
    ]
    widest = max(form.shape[1] for _, form in rows)
    forms = [shape.widened(form, widest) for _, form in rows]
    return np.concatenate([d for d, _ in rows]), np.concatenate(forms)


def at_random(rng, name, bodies, n, dimension, reach):
    """M pairs of random bodies, (diameters, form), at random poses.

    Centres are at a fraction of the sum of the outer radii, between the two numbers of `reach`.
    """
    which = rng.integers(0, len(bodies[0]), 2 * n)
    diameters, form = bodies[0][which], bodies[1][which]
    turn = (
        rng.uniform(-np.pi, np.pi, (2 * n, 1))
        if dimension == 2
        else unit(rng.normal(size=(2 * n, 4)))
    )
    pairs = BodyPairs(name, diameters, form, np.zeros((2 * n, dimension)), turn)
    outer = pairs.compiled().outer_radius.reshape(-1, 2).sum(axis=1)
    direction = rng.normal(size=(n, dimension))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    centre = pairs.centre.copy()
    centre[::2] = (rng.uniform(*reach, n) * outer)[:, None] * direction
    return dataclasses.replace(pairs, centre=centre)


def largest_jump(pairs, steps=400, sides=2, seed=1):
    """Largest change of energy along straight paths with rotation, over the bound that the forces at both ends of a step give.

    Twice the product of step and force, plus the square of the step over the smallest radius: what
    the energy may gain where a contact begins.
    """
    rng = np.random.default_rng(seed)
    n, D = len(pairs), pairs.dimension
    outer = pairs.compiled().outer_radius.reshape(-1, 2).sum(axis=1)
    inner = pairs.compiled().inner_radius.min()
    along = rng.normal(size=(n, D))
    along *= (outer / np.linalg.norm(along, axis=1))[:, None]
    turn = rng.uniform(-1, 1, n)
    worst, before = 0.0, None
    lever = outer.max()
    for t in np.linspace(-0.5, 0.5, steps):
        found = pairs.moved(t * along, t * turn).contacts(sides=sides)
        crossing = found["status"] == 2
        slope = np.linalg.norm(found["force"], axis=1) + (
            np.linalg.norm(found["torque_i"].reshape(n, -1), axis=1) / lever
        )
        if before is not None:
            step = (outer + lever * np.abs(turn)) / (steps - 1)
            bound = 2 * step * np.maximum(slope, before[1]) + 2 * (step / inner) ** 2
            change = np.abs(found["energy"] - before[0]) / bound
            worst = max(worst, float(change[~crossing & ~before[2]].max(initial=0.0)))
        before = found["energy"], slope, crossing
    return worst
