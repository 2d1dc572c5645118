"""Initial states: particles at random places in a periodic box, with or without overlaps."""

from __future__ import annotations

import math

import numpy as np

from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.checks import RANGES, require_in, require_one_of, require_stated
from jamshape.contacts import NearPairs, PairArrays, Spheres, each_once, near_pairs
from jamshape.packing import Box, Packing, State
from jamshape.shapes.particles import Particles

# Trial placements in all: a few seconds for 1000 particles.
_ATTEMPTS, _ATTEMPTS_PER_PARTICLE = 200_000, 500

# Trials that are tested in one go, and pairs of bodies among them, which bounds the memory.
_MOST_TRIALS = 4096
_MOST_PAIRS = 2**19

# This share of the particles competes in one go: few enough that the longest stay ahead.
_COMPETING = 1 / 16

# Trials are tested against one such part of the placed particles after another: most fail early.
_PARTS = 4

# Directions in which the longest particle is tried in a box shorter than it.
_DIRECTIONS = 4096

# Of the packing fraction where insertion stalls, what it reaches when asked for no more: the long
# particles, placed first, fill their share of a box that is too small better than all do together.
_SAFE = 0.85


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


class _Insertion:
    """Particles on their way into the box.

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

    def _trials(self, index: IntArray) -> Packing:
        """Put the particles `index`, any of them any number of times, anywhere in the box."""
        box, names = self.particles.box, ("diameters", "exponent", "species")
        return Packing(
            position=box.edges * self.rng.random((len(index), box.dimension)),
            orientation=self.orientation[index],
            **{name: getattr(self.particles, name)[index] for name in names},
            id=1 + np.arange(len(index)),
            box=box,
            shape_style=self.particles.shape_style,
        )

    def _place(self, index: IntArray) -> int:
        """Try each of the particles `index` once anywhere; return how many found a place."""
        trials = self._trials(index)
        free = self._clear_of_placed(trials, index)
        if not len(free):
            return 0
        _, first_of_particle = np.unique(index[free], return_index=True)
        free = free[first_of_particle]
        free = free[self._clear_of_earlier(_taken(trials, free))]
        self.position[index[free]] = trials.position[free]
        self.waiting = np.setdiff1d(self.waiting, index[free])
        return len(free)

    def _clear_of_own_images(self, trials: Packing) -> IntArray:
        n, n_shifts = trials.n, len(self.own_shifts)
        index = np.repeat(np.arange(n), n_shifts)
        images = NearPairs(index, index, np.tile(self.own_shifts, (n, 1)))
        return np.setdiff1d(np.arange(n), _overlapping(images, trials).first)

    def _clear_of_placed(self, trials: Packing, index: IntArray) -> IntArray:
        """Find the trials, of the particles `index`, that overlap none of those that are placed."""
        free = np.arange(len(index))
        placed = np.delete(np.arange(self.particles.n), self.waiting)
        for part in np.array_split(placed, _PARTS):
            if not (len(part) and len(free)):
                continue
            both = _joined(_taken(trials, free), _taken(self._placed, part))
            around, others = self._around(both, 0, len(free)), self._around(both, len(free), both.n)
            near = near_pairs(around, others, both.box)
            near = near._replace(second=near.second + len(free))
            free = np.delete(free, _overlapping(near, both).first)
        return free

    @property
    def _placed(self) -> Packing:
        return self.particles.with_(position=self.position, orientation=self.orientation)

    @staticmethod
    def _around(packing: Packing, first: int, last: int) -> Spheres:
        return Spheres(packing.position[first:last], packing.outer_radius[first:last])

    def _clear_of_earlier(self, trials: Packing) -> BoolArray:
        around = self._around(trials, 0, trials.n)
        hits = _overlapping(each_once(near_pairs(around, around, trials.box)), trials)
        clear = np.ones(trials.n, dtype=np.bool_)
        for i, j in zip(hits.first, hits.second, strict=True):  # ascending in i, and i < j
            if clear[i]:
                clear[j] = False
        return clear

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


def _taken(packing: Packing, rows: IntArray) -> Packing:
    """Select particles by row; numbered anew. At least one."""
    names = ("position", "orientation", "diameters", "exponent", "species", "image")
    picked = {name: getattr(packing, name)[rows] for name in names}
    return packing.with_(**picked, id=1 + np.arange(len(rows)))


def _joined(first: Packing, second: Packing) -> Packing:
    """Put the particles of two packings into one box."""
    names = ("position", "orientation", "diameters", "exponent", "species", "image")
    both = {k: np.concatenate([getattr(p, k) for p in (first, second)]) for k in names}
    return first.with_(**both, id=1 + np.arange(first.n + second.n))


def _overlapping(near: NearPairs, packing: Packing) -> NearPairs:
    """Keep the pairs whose surfaces overlap."""
    hit: BoolArray = packing.compiled().overlaps(*PairArrays.of(State.of(packing), near))
    return near.take(hit)


def _random_orientations(n: int, dimension: int, rng: np.random.Generator) -> FloatArray:
    """Uniform angles (n,) in 2D, uniform unit quaternions (n, 4) in 3D."""
    if dimension == 2:
        return rng.uniform(0, 2 * np.pi, n)
    quaternions = rng.normal(size=(n, 4))
    unit: FloatArray = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return unit
