"""Initial states: particles at random places in a periodic box, with or without overlaps."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.checks import RANGES, require_in, require_one_of, require_stated
from jamshape.contacts import (
    NearPairs,
    PairArrays,
    Spheres,
    Surroundings,
    each_once,
    near_pairs,
)
from jamshape.packing import Box, Packing
from jamshape.shapes.particles import Particles
from jamshape.shapes.shape import Interaction

# Trial placements in all: a few seconds for 1000 particles.
_ATTEMPTS, _ATTEMPTS_PER_PARTICLE = 200_000, 500

# Trials that are tested in one go, and pairs of bodies among them, which bounds the memory.
_MOST_TRIALS = 4096
_MOST_PAIRS = 2**19

# This share of the particles competes in one go: few enough that the longest stay ahead.
_COMPETING = 1 / 16

# Trials are first tested against so many particles whose centres are nearest: most fail there.
_NEAREST = 4

# A tree of placed particles that is at most so many times larger than the next one is joined with it.
_TREES_APART = 4

# Directions in which the longest particle is tried in a box shorter than it.
_DIRECTIONS = 4096

# Of the packing fraction where insertion stalls, what it reaches when asked for no more: the long
# particles, placed first, fill their share of a box that is too small better than all do together.
_SAFE = 0.85


# Packing fractions at which starts are tried that are to be compressed.
_DENSEST, _LOOSEST = (0.4, 0.2, 0.1, 0.05), 0.02


class InsertionError(ValueError):
    """Random insertion did not find room for all particles."""


def random_packing(
    n: int, phi: float, seed: int, particles: Particles | None = None, dimension: int = 2
) -> Packing:
    """Place particles at random, one after another, wherever they overlap no other.

    Parameters
    ----------
    n : int
    phi : float
        Packing fraction; the periodic box is a square (cube) that has it exactly.
    seed : int
        Of `numpy.random.default_rng`; the same arguments give the same packing.
    particles : Particles, optional
        ``Particles.of()`` when left out.
    dimension : {2, 3}

    Returns
    -------
    Packing
        No two surfaces overlap and no spines cross, periodic images included. Orientations are
        uniform on the circle (sphere). IDs tell nothing of the size.

    Raises
    ------
    InsertionError
        If there is no room: random insertion ends far below jamming, at about phi = 0.5 for rods
        with alpha = 4 in 2D; or if the box is too short for the longest particle.
    ValueError
        If an argument is out of its range.

    Examples
    --------
    >>> from jamshape.protocols.random_start import random_packing
    >>> round(random_packing(n=20, phi=0.3, seed=1).phi, 12)
    0.3
    """
    unplaced, rng = _unplaced(n, phi, seed, (particles or Particles.of(), dimension))
    ordered = _longest_first(unplaced)
    insertion = _Insertion(_boxed(ordered, ordered.phi, phi), rng)
    insertion.run(_ATTEMPTS + _ATTEMPTS_PER_PARTICLE * n)
    return insertion.shuffled()


def start_below(
    phi: float, n: int, seed: int, particles: Particles | None = None, dimension: int = 2
) -> Packing:
    """Make a random packing to compress to phi: as dense as long particles find room at random.

    Arguments and errors as of `random_packing`.
    """
    for densest in _DENSEST:
        with suppress(InsertionError):
            return random_packing(n, min(phi, densest), seed, particles, dimension)
    return random_packing(n, min(phi, _LOOSEST), seed, particles, dimension)


def dilute_packing(
    n: int, phi: float, seed: int, particles: Particles | None = None, dimension: int = 3
) -> Packing:
    """Place particles at random with random orientations, whether they overlap or not.

    Yuan et al. 2019, Sec. 2.2. Arguments and errors as of `random_packing`; in dilute packings overlaps
    are few and small, and the first minimisation undoes them.
    """
    unplaced, rng = _unplaced(n, phi, seed, (particles or Particles.of(), dimension))
    boxed = _boxed(unplaced, math.fsum(unplaced.measures), phi)
    orientation = _random_orientations(n, dimension, rng)
    position = rng.uniform(0, boxed.box.edges[0], (n, dimension))
    return boxed.with_(position=position, orientation=orientation)


def _unplaced(
    n: int, phi: float, seed: int, of: tuple[Particles, int]
) -> tuple[Packing, np.random.Generator]:
    """Draw particles, still without poses, in a box of one unit."""
    particles, dimension = of
    require_in("phi", phi, RANGES["phi_start"])
    require_one_of("dimension", dimension, (2, 3))
    require_stated(n=n, seed=seed)
    rng = np.random.default_rng(seed)
    sizes = particles.sample(n, rng)
    no_turn = np.eye(1, 4)[0]
    unplaced = Packing(
        position=np.zeros((n, dimension)),
        orientation=np.zeros(n) if dimension == 2 else np.tile(no_turn, (n, 1)),
        diameters=sizes.diameters,
        exponent=sizes.exponent,
        species=sizes.species,
        id=1 + np.arange(n),
        box=Box(lo=np.zeros(dimension), edges=np.ones(dimension)),
        shape_style=particles.shape.name,
    )
    return unplaced, rng


def _boxed(packing: Packing, area: float, phi: float) -> Packing:
    """Take the box in which particles of that area (volume) have the packing fraction phi."""
    edge = (area / phi) ** (1 / packing.dimension)
    return packing.with_(box=Box(np.zeros(packing.dimension), np.full(packing.dimension, edge)))


def _longest_first(packing: Packing) -> Packing:
    """Order for insertion: early there is room for the long ones, the short ones fit into gaps."""
    order = np.argsort(-packing.outer_radius, kind="stable")
    names = ("diameters", "exponent", "species")
    return packing.with_(**{k: getattr(packing, k)[order] for k in names})


class _Poses(NamedTuple):
    """Particles somewhere in the box, any of them any number of times."""

    which: IntArray
    """(M,) rows of all particles."""
    position: FloatArray
    """(M, D)"""

    def take(self, rows: IntArray) -> _Poses:
        return _Poses(self.which[rows], self.position[rows])

    def joined(self, other: _Poses) -> _Poses:
        return _Poses(*(np.concatenate(both) for both in zip(self, other, strict=True)))


class _Placed(NamedTuple):
    """Some of the particles whose poses are final, in a tree."""

    poses: _Poses
    around: Surroundings


class _Insertion:
    """Particles on their way into the box.

    What one batch of trials costs does not grow with the number of particles: those that are placed
    are in trees of sizes far apart, of which the small ones are joined as they come.

    Parameters
    ----------
    particles : Packing
        Shapes in the order of insertion, and the box; their poses do not matter.
    rng : numpy.random.Generator
    """

    def __init__(self, particles: Packing, rng: np.random.Generator) -> None:
        self.particles = particles
        self.rng = rng
        self.radius = self.particles.outer_radius
        self.waiting = np.arange(particles.n)  # poses of all others are final
        self.placed: list[_Placed] = []

        reach = 2 * self.radius[0]
        pairs_per_trial = particles.n * np.prod(2 * reach / particles.box.edges)
        if pairs_per_trial > _MOST_PAIRS:
            raise self._too_short()
        self.most_trials = min(int(_MOST_PAIRS / pairs_per_trial), _MOST_TRIALS)
        longest = Spheres(np.zeros((1, particles.dimension)), self.radius[:1])
        self.own_shifts = each_once(near_pairs(longest, longest, particles.box)).shift
        self.position = np.array(self.particles.position)
        self.orientation = np.array(self.particles.orientation)
        self._turn(self.waiting)

    def _turn(self, index: IntArray) -> None:
        """Draw orientations of the particles `index` that do not bring them onto their own images.

        Once, not for each trial: that would favour those aligned with what is already there.
        """
        for _ in range(_DIRECTIONS):
            self.orientation[index] = _random_orientations(
                len(index), self.particles.dimension, self.rng
            )
            parts = np.array_split(index, 1 + len(index) // self.most_trials)
            clear = [part[self._clear_of_own_images(self._trials(part))] for part in parts]
            index = np.setdiff1d(index, np.concatenate(clear))
            if not len(index):
                return
        raise self._too_short()

    def run(self, max_attempts: int) -> None:
        """Place all particles."""
        competing = max(1, int(_COMPETING * self.particles.n))
        n_trials, n_attempts = min(competing, self.most_trials), 0
        while len(self.waiting):
            if n_attempts >= max_attempts:
                raise self._stalled(n_attempts)
            index = np.resize(self.waiting[:competing], n_trials)
            n_attempts += n_trials
            n_placed = self._place(index)
            if n_placed == 0 and n_trials == self.most_trials:
                self._turn(self.waiting)  # no room for them as they are
            if 2 * n_placed < min(competing, n_trials):
                n_trials = min(2 * n_trials, self.most_trials)

    def shuffled(self) -> Packing:
        """Return the packing, in an order that has nothing to do with that of the insertion."""
        order = self.rng.permutation(self.particles.n)
        names = ("diameters", "exponent", "species")
        return self.particles.with_(
            position=self.position[order],
            orientation=self.orientation[order],
            **{name: getattr(self.particles, name)[order] for name in names},
        )

    def _trials(self, index: IntArray) -> _Poses:
        """Put the particles `index`, any of them any number of times, anywhere in the box."""
        box = self.particles.box
        return _Poses(index, box.edges * self.rng.random((len(index), box.dimension)))

    def _place(self, index: IntArray) -> int:
        """Try each of the particles `index` once anywhere; return how many found a place."""
        trials = self._trials(index)
        free = self._clear_of_placed(trials)
        if not len(free):
            return 0
        _, first_of_particle = np.unique(index[free], return_index=True)
        found = trials.take(free[first_of_particle])
        found = found.take(self._clear_of_earlier(found))
        self._keep(found)
        return len(found.which)

    def _clear_of_own_images(self, trials: _Poses) -> IntArray:
        n, n_shifts = len(trials.which), len(self.own_shifts)
        if not n_shifts:
            return np.arange(n)
        index = np.repeat(np.arange(n), n_shifts)
        images = NearPairs(index, index, np.tile(self.own_shifts, (n, 1)))
        return np.setdiff1d(np.arange(n), self._overlapping(images, trials).first)

    def _clear_of_placed(self, trials: _Poses) -> IntArray:
        """Find the trials that overlap none of the particles that are placed."""
        free = np.arange(len(trials.which))
        for placed in self.placed:
            if len(free):
                free = free[self._clear_of(placed, trials.take(free))]
        return free

    def _clear_of(self, placed: _Placed, trials: _Poses) -> IntArray:
        """Find the trials that overlap none of some placed particles."""
        near = placed.around.nearest(self._around(trials), _NEAREST)
        free = self._clear_of_pairs(near, placed, trials)
        if not len(free):
            return free
        near = placed.around.near(self._around(trials.take(free)))
        return free[self._clear_of_pairs(near, placed, trials.take(free))]

    def _clear_of_pairs(self, near: NearPairs, placed: _Placed, trials: _Poses) -> IntArray:
        """Find the trials that overlap in none of the pairs with placed particles."""
        n = len(trials.which)
        rows, second = np.unique(near.second, return_inverse=True)
        both = trials.joined(placed.poses.take(rows))
        hits = self._overlapping(near._replace(second=second + n), both)
        return np.delete(np.arange(n), hits.first)

    def _keep(self, found: _Poses) -> None:
        """Let particles stay where they are; all of them are among the first that wait."""
        self.position[found.which] = found.position
        end = 1 + np.searchsorted(self.waiting, found.which.max())
        behind = self.waiting[:end][~np.isin(self.waiting[:end], found.which)]
        self.waiting = self.waiting[len(found.which) :]
        self.waiting[: len(behind)] = behind
        while self.placed and len(self.placed[-1].poses.which) <= _TREES_APART * len(found.which):
            found = self.placed.pop().poses.joined(found)
        reach = 3 * self.radius[0]  # a margin over two radii
        around = Surroundings(self._around(found), self.particles.box, reach)
        self.placed.append(_Placed(found, around))

    def _around(self, poses: _Poses) -> Spheres:
        return Spheres(poses.position, self.radius[poses.which])

    def _clear_of_earlier(self, trials: _Poses) -> IntArray:
        around = self._around(trials)
        near = each_once(near_pairs(around, around, self.particles.box))
        hits = self._overlapping(near, trials)
        clear = np.ones(len(trials.which), dtype=np.bool_)
        for i, j in zip(hits.first, hits.second, strict=True):  # ascending in i, and i < j
            if clear[i]:
                clear[j] = False
        return np.flatnonzero(clear)

    def _overlapping(self, near: NearPairs, poses: _Poses) -> NearPairs:
        """Keep of pairs of these poses those whose surfaces overlap."""
        if not len(near.first):
            return near
        particles, index = self.particles, poses.which
        sizes = (particles.diameters[index], particles.exponent[index])
        bodies = particles.shape.compiled(sizes, particles.dimension, Interaction())
        turned = self.orientation[index].reshape(len(index), -1)
        position, orientation, cell = (
            np.stack([x, np.zeros_like(x)]) for x in (poses.position, turned, particles.box.matrix)
        )
        pairs = np.column_stack([near.first, near.second])
        arrays = PairArrays(position, orientation, cell, pairs, near.shift)
        hit: BoolArray = bodies.overlaps(*arrays)
        return near.take(hit)

    def _stalled(self, n_attempts: int) -> InsertionError:
        if len(self.waiting) == self.particles.n:
            return self._too_short()
        particles = self.particles
        measure = np.array(particles.measures)
        measure[self.waiting] = 0
        reached = measure.sum() / particles.box.volume
        return InsertionError(
            f"random insertion of {particles.n} particles stalled at phi = {reached:.3g} of the"
            f" {particles.phi:.3g} asked after {n_attempts} attempts: start at"
            f" phi <= {_SAFE * reached:.2g} and compress from there"
        )

    def _too_short(self) -> InsertionError:
        particles = self.particles
        length, edge = 2 * particles.outer_radius[0], particles.box.edges[0]
        fits = particles.phi * (edge / length) ** particles.dimension
        return InsertionError(
            f"no direction found that keeps the longest particle, of length {length:.3g}, off its"
            f" own periodic images in a box of edge {edge:.3g}: start at phi <= {_SAFE * fits:.2g}"
            " and compress from there, or take more particles"
        )


def _random_orientations(n: int, dimension: int, rng: np.random.Generator) -> FloatArray:
    """Uniform angles (n,) in 2D, uniform unit quaternions (n, 4) in 3D."""
    if dimension == 2:
        return rng.uniform(0, 2 * np.pi, n)
    quaternions = rng.normal(size=(n, 4))
    unit: FloatArray = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return unit
