"""Initial states: random sequential insertion of spherocylinders in a periodic box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jamshape import _contact
from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.contacts import NearPairs, bodies, each_once, near_pairs, shifted
from jamshape.packing import Box, Packing

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


class Sizes(NamedTuple):
    """Shapes of n spherocylinders."""

    half_length: FloatArray
    """(n,) A, [length]; 0 for a disc."""
    radius: FloatArray
    """(n,) R, [length]."""
    species: IntArray
    """(n,) LAMMPS types, from 1."""


@dataclass(frozen=True)
class Mixture:
    """A distribution of sizes and aspect ratios.

    Parameters
    ----------
    draw : callable
        ``draw(n, rng)`` returns the (n,) half lengths, radii and species of n particles, in any
        order; what is random in it comes from the `numpy.random.Generator`.
    """

    draw: Callable[[int, np.random.Generator], tuple[ArrayLike, ArrayLike, ArrayLike]]

    @classmethod
    def bidisperse(cls, alpha: float = 4.0, size_ratio: float = 1.4) -> Mixture:
        """Small (species 1, 2R = 1) and big (species 2) particles, 1:1, of equal alpha = A / R.

        With an odd number there is one more small particle (Marschall & Teitel 2018, Sec. II).
        """
        _require_alpha(alpha)
        if not size_ratio >= 1:
            msg = f"size_ratio is {size_ratio}, expected big over small, at least 1"
            raise ValueError(msg)

        def draw(n: int, _: np.random.Generator) -> Sizes:
            species = np.repeat([1, 2], [n - n // 2, n // 2])
            radius = np.where(species == 1, 0.5, 0.5 * size_ratio)
            return Sizes(alpha * radius, radius, species)

        return cls(draw)

    @classmethod
    def monodisperse(cls, alpha: float) -> Mixture:
        """Equal particles with 2R = 1 and A = alpha R."""
        _require_alpha(alpha)
        return cls(lambda n, _: (np.full(n, 0.5 * alpha), np.full(n, 0.5), np.ones(n, np.int64)))

    @classmethod
    def from_arrays(
        cls, half_length: ArrayLike, radius: ArrayLike, species: ArrayLike | None = None
    ) -> Mixture:
        """Given particles, (n,) each; all of species 1 unless told."""
        types = np.ones(np.shape(radius), np.int64) if species is None else species
        return cls(lambda _n, _rng: (half_length, radius, types))

    def sample(self, n: int, rng: np.random.Generator) -> Sizes:
        """Draw n particles.

        Raises
        ------
        ValueError
            If n < 1, or the draw is not n particles with A >= 0 and R > 0.
        """
        if n < 1:
            msg = f"n is {n}, expected at least one particle"
            raise ValueError(msg)
        sizes = Sizes(*map(np.asarray, self.draw(n, rng)))
        for name, values in sizes._asdict().items():
            if values.shape != (n,):
                msg = f"{name} of the mixture has shape {values.shape}, expected ({n},)"
                raise ValueError(msg)
        A, R = sizes.half_length.astype(np.float64), sizes.radius.astype(np.float64)
        _require((A >= 0) & np.isfinite(A), "half_length", A, "finite lengths from 0")
        _require((R > 0) & np.isfinite(R), "radius", R, "finite lengths above 0")
        return Sizes(A, R, sizes.species)


def random_packing(
    n: int,
    phi: float,
    seed: int,
    mixture: Mixture | None = None,
    *,
    dimension: int = 2,
    max_attempts: int | None = None,
) -> Packing:
    """Place particles at random, one after another, wherever they overlap no other.

    Parameters
    ----------
    n : int
    phi : float
        Packing fraction; the periodic box is a square (cube) that has it exactly.
    seed : int
        Of `numpy.random.default_rng`; the same arguments give the same packing.
    mixture : Mixture, optional
        ``Mixture.bidisperse()`` when left out.
    dimension : {2, 3}
    max_attempts : int, optional
        Trial placements in all; 200 000 + 500 n, a few seconds for 1000 particles, when left out.

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
    """
    if not 0 < phi < 1:
        msg = f"phi is {phi}, expected a packing fraction between 0 and 1"
        raise ValueError(msg)
    if dimension not in {2, 3}:
        msg = f"dimension is {dimension}, expected 2 or 3"
        raise ValueError(msg)
    if seed < 0:
        msg = f"seed is {seed}, expected an integer from 0"
        raise ValueError(msg)
    rng = np.random.default_rng(seed)
    sizes = (mixture or Mixture.bidisperse()).sample(n, rng)
    insertion = _Insertion(_longest_first(sizes, phi, dimension), rng)
    insertion.run(200_000 + 500 * n if max_attempts is None else max_attempts)
    return insertion.shuffled()


class _Insertion:
    """Particles on their way into the box.

    Parameters
    ----------
    particles : Packing
        Shapes in the order of insertion, and the box; their poses do not matter.
    rng : numpy.random.Generator
    """

    def __init__(self, particles: Packing, rng: np.random.Generator) -> None:
        self.particles, self.rng = particles, rng
        self.rows = bodies(particles)
        self.waiting = np.arange(particles.n)  # `rows` of all others are final

        longest = self.rows[:1]
        reach = 2 * longest[0, -2:].sum()
        pairs_per_trial = particles.n * np.prod(2 * reach / particles.box.edges)
        if pairs_per_trial > _MOST_PAIRS:
            raise self._too_short()
        self.most_trials = min(int(_MOST_PAIRS / pairs_per_trial), _MOST_TRIALS)
        self.own_shifts = each_once(near_pairs(longest, longest, particles.box)).shift
        self.orientation = np.array(particles.orientation)
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
            clear = [part[self._clear_of_own_images(self._rows(part))] for part in parts]
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
        return self.particles.with_(
            position=self.rows[order, : self.particles.dimension],
            orientation=self.orientation[order],
            diameters=self.particles.diameters[order],
            species=self.particles.species[order],
        )

    def _rows(self, index: IntArray) -> FloatArray:
        """Put the particles `index`, any of them any number of times, anywhere in the box."""
        box = self.particles.box
        return bodies(
            Packing(
                position=box.edges * self.rng.random((len(index), box.dimension)),
                orientation=self.orientation[index],
                diameters=self.particles.diameters[index],
                species=self.particles.species[index],
                id=1 + np.arange(len(index)),
                box=box,
            )
        )

    def _place(self, index: IntArray) -> int:
        """Try each of the particles `index` once anywhere; return how many found a place."""
        rows = self._rows(index)
        free = self._clear_of_placed(rows, np.arange(len(rows)))
        _, first_of_particle = np.unique(index[free], return_index=True)
        free = free[first_of_particle]
        free = free[self._clear_of_earlier(rows[free])]
        self.rows[index[free]] = rows[free]
        self.waiting = np.setdiff1d(self.waiting, index[free])
        return len(free)

    def _clear_of_own_images(self, rows: FloatArray) -> IntArray:
        n, n_shifts = len(rows), len(self.own_shifts)
        index = np.repeat(np.arange(n), n_shifts)
        images = NearPairs(index, index, np.tile(self.own_shifts, (n, 1)))
        hit = self._overlapping(images, rows, rows).first
        return np.setdiff1d(np.arange(n), hit)

    def _clear_of_placed(self, rows: FloatArray, free: IntArray) -> IntArray:
        placed = np.delete(self.rows, self.waiting, axis=0)
        for part in np.array_split(placed, _PARTS):
            near = near_pairs(rows[free], part, self.particles.box)
            hit = self._overlapping(near, rows[free], part).first
            free = np.delete(free, hit)
        return free

    def _clear_of_earlier(self, rows: FloatArray) -> BoolArray:
        near = each_once(near_pairs(rows, rows, self.particles.box))
        hits = self._overlapping(near, rows, rows)
        clear = np.ones(len(rows), dtype=np.bool_)
        for i, j in zip(hits.first, hits.second, strict=True):  # ascending in i, and i < j
            if clear[i]:
                clear[j] = False
        return clear

    def _overlapping(self, near: NearPairs, first: FloatArray, second: FloatArray) -> NearPairs:
        """Keep the pairs whose surfaces overlap."""
        i = first[near.first]
        j = shifted(second[near.second], near.shift, self.particles.box)
        return near.take(_contact.spine_distances(i, j) < i[:, -1] + j[:, -1])

    def _stalled(self, n_attempts: int) -> InsertionError:
        if len(self.waiting) == self.particles.n:
            return self._too_short()
        particles = self.particles
        measure, _ = _contact.spherocylinder_drag(
            particles.half_length, particles.radius, particles.dimension
        )
        measure[self.waiting] = 0
        reached = measure.sum() / particles.box.volume
        return InsertionError(
            f"random insertion of {particles.n} particles stalled at phi = {reached:.3g} of the"
            f" {particles.phi:.3g} asked after {n_attempts} attempts: start at"
            f" phi <= {_SAFE * reached:.2g} and compress from there"
        )

    def _too_short(self) -> InsertionError:
        particles = self.particles
        length, edge = particles.diameters[0, 0], particles.box.edges[0]
        fits = particles.phi * (edge / length) ** particles.dimension
        return InsertionError(
            f"no direction found that keeps the longest particle, of length {length:.3g}, off its"
            f" own periodic images in a box of edge {edge:.3g}: start at phi <= {_SAFE * fits:.2g}"
            " and compress from there, or take more particles"
        )


def _require_alpha(alpha: float) -> None:
    if not 0 <= alpha < np.inf:
        msg = f"alpha is {alpha}, expected A / R, 0 for discs or above"
        raise ValueError(msg)


def _require(valid: BoolArray, name: str, values: FloatArray, expected: str) -> None:
    if not valid.all():
        msg = f"{name} of the mixture holds {values[~valid][0]}, expected {expected}"
        raise ValueError(msg)


def _longest_first(sizes: Sizes, phi: float, dimension: int) -> Packing:
    """Arrange particles, still without poses, in the order of insertion and in a box for `phi`."""
    A, R, species = sizes
    # Early there is room for the long ones; the short ones fit into the gaps that are left.
    order = np.argsort(-(A + R), kind="stable")
    n, no_turn = len(order), np.eye(1, 4)[0]
    particles = Packing(
        position=np.zeros((n, dimension)),
        orientation=np.zeros(n) if dimension == 2 else np.tile(no_turn, (n, 1)),
        diameters=np.column_stack([2 * (A + R), 2 * R, 2 * R])[order],
        species=species[order],
        id=1 + np.arange(n),
        box=Box(lo=np.zeros(dimension), edges=np.ones(dimension)),
    )
    edge = (particles.phi / phi) ** (1 / dimension)
    return particles.with_(box=Box(lo=np.zeros(dimension), edges=np.full(dimension, edge)))


def _random_orientations(n: int, dimension: int, rng: np.random.Generator) -> FloatArray:
    """Uniform angles (n,) in 2D, uniform unit quaternions (n, 4) in 3D."""
    if dimension == 2:
        return rng.uniform(0, 2 * np.pi, n)
    quaternions = rng.normal(size=(n, 4))
    unit: FloatArray = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return unit
