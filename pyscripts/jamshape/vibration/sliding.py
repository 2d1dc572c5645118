"""Motions that the stiff contacts of a packing leave free, and their range until a new contact forms.

These are modes of the dynamical matrix that vanish at first order in the prestress (Marschall & Teitel 2018,
Appendix B): rods that slide along flat sides. Contacts with forces of second order in the overlap, which stop
sliding, are approximated as hard walls. Independent of the shape; needs no LAMMPS.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy  # loads its parts once they are used

from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.landscape import Landscape, State
from jamshape.shapes.shape import HARMONIC
from jamshape.vibration.hessian import (
    DynamicalMatrix,
    DynamicalMatrixOptions,
    dynamical_matrix,
    lengths_of_bonds,
)
from jamshape.vibration.sparse_modes import below_sliding, near, typical_prestress

# Modes softer than this fraction of the prestress vanish at first order in it.
_FIRST_ORDER = 1e-2

# Forces below this fraction of the root of the prestress (over the stiffness) are of second order in the overlap.
_WEAK = 0.1

# Modes that are asked for beyond those without a bond, since some bonds are redundant.
_MORE = 16

# Scale of the perturbation to measure surface distances, relative to the longest step.
_LEVELS = (1e-6, 1e-4, 1e-2, 1.0)

_SEEN = 1e-4  # smaller components of unit motions are not limited
_MET = 1e-9  # distance over the step at which a wall is met

# Bonds of force-bearing contacts are new if they are open by more than this fraction of the step.
_OPEN = 0.1


class Walls(NamedTuple):
    """Constraints: m distances between surfaces, and their derivatives by (n,) coordinates."""

    gap: FloatArray
    """(m,) [length]"""
    gradient: scipy.sparse.csr_matrix
    """(m, n)"""


@dataclass(frozen=True, eq=False)
class Sliding:
    """Sliding motions of one state.

    Parameters
    ----------
    matrix : DynamicalMatrix
        Dynamical matrix of the contacts with forces of first order.
    modes : (n, k) array of float64
        Orthonormal columns.
    eigenvalues : (k,) array of float64, [energy / length^2]
    slope : (k,) array of float64, [energy / length]
        Slope of the energy of these contacts along the modes.
    walls : Walls
    """

    matrix: DynamicalMatrix
    modes: FloatArray
    eigenvalues: FloatArray
    slope: FloatArray
    walls: Walls

    @classmethod
    def at(
        cls, landscape: Landscape, state: State, reach: float, *, keeping: bool = False
    ) -> Sliding:
        """Find the sliding modes at a state with relaxed stiff modes.

        Parameters
        ----------
        landscape : Landscape
        state : State
        reach : float, [length]
            Largest displacement of particles.
        keeping : bool
            Whether to keep weak contacts, rather than treat them as walls: for states in force balance.
        """
        every = dynamical_matrix(landscape, state, DynamicalMatrixOptions(force=True))
        stiffest = float(every.bonds.stiffness.max())
        weakest = _WEAK * math.sqrt(typical_prestress(every) / stiffest)
        strong = DynamicalMatrixOptions(force=True, least_force=weakest)
        matrix = every if keeping else dynamical_matrix(landscape, state, strong)
        values, modes = _softest(matrix)
        slope = -((matrix.compatibility @ modes).T @ matrix.bonds.pull)
        return cls(matrix, modes, values, slope, _walls(landscape, state, matrix, reach))

    @property
    def n_free(self) -> int:
        """Number of motions k."""
        return len(self.eigenvalues)

    def step(self, farthest: FloatArray, radius: FloatArray) -> Step:
        """Find the step that lowers the energy most to first order, limited by the walls.

        Along negative curvature the energy falls faster than its slope. So this is a linear programme, whose
        solution is a vertex: each motion continues to a wall, or to its limit.

        Parameters
        ----------
        farthest : (N,) array of float64, [length]
            Largest displacement of each particle.
        radius : (N,) array of float64, [length]
            Largest displacement of a particle's surface per radian.
        """
        if not self.n_free:
            return Step(np.zeros(self.matrix.size), 0.0, 0, self._split(np.zeros(0), radius))
        scale = float(farthest.max())
        bend = 0.5 * scale * np.maximum(-self.eigenvalues, 0.0)
        downhill = np.where(self.slope >= 0, 1.0, -1.0)
        # From a saddle the energy falls on both sides, one of which may have a wall.
        other = np.where(bend > np.abs(self.slope), -downhill, downhill)
        sides = [downhill] if (other == downhill).all() else [downhill, other]
        limits = self._limits(farthest, radius)
        steps = [scale * limits.corner(self.slope + side * bend) for side in sides]
        gains = [self.slope @ c + 0.5 * self.eigenvalues @ c**2 for c in steps]
        c = steps[int(np.argmin(gains))]
        n_met = int((limits.gap + limits.walls @ (c / scale) < _MET).sum())
        return Step(self.modes @ c, float(min(gains)), n_met, self._split(c, radius))

    def _limits(self, farthest: FloatArray, radius: FloatArray) -> _Limits:
        """Return the limits of the motions, in units of the longest step."""
        scale = float(farthest.max())
        moved = scale * self._moved(radius) / farthest[:, None, None]
        moved = moved.reshape(-1, self.n_free)
        moved = moved[np.abs(moved).max(axis=1) > _SEEN]
        limit = np.full(self.n_free, math.sqrt(self.matrix.size))
        up = self.eigenvalues > 0
        limit[up] = np.minimum(limit[up], np.abs(self.slope[up]) / self.eigenvalues[up] / scale)
        return _Limits(self.walls.gradient @ self.modes, self.walls.gap / scale, moved, limit)

    def _moved(self, radius: FloatArray) -> FloatArray:
        """(N, D + T, k) displacements of the particles' surfaces by translation and rotation in each mode."""
        at, D = self.matrix.coordinates, self.matrix.coordinates.dimension
        moved = (at.embedding @ self.modes).reshape(at.n_all, at.direction.shape[1], self.n_free)
        moved[:, D:] *= radius[:, None, None]
        return np.asarray(moved)

    def _split(self, c: FloatArray, radius: FloatArray) -> FloatArray:
        return np.asarray(self._moved(radius) @ c)


class _Limits(NamedTuple):
    """Limits of k motions."""

    walls: FloatArray
    """(m, k) derivatives of the surface distances."""
    gap: FloatArray
    """(m,) surface distances."""
    moved: FloatArray
    """(l, k) derivatives of displacements, each limited to 1."""
    limit: FloatArray
    """(k,) limit of each motion."""

    def corner(self, cost: FloatArray) -> FloatArray:
        """Move down a slope to the end; nowhere if there is none."""
        rows = np.vstack([-self.walls, self.moved, -self.moved])
        most = np.concatenate([self.gap, np.ones(2 * len(self.moved))])
        bounds = np.column_stack([-self.limit, self.limit])
        largest = float(np.abs(cost).max()) or 1.0
        found = scipy.optimize.linprog(cost / largest, A_ub=rows, b_ub=most, bounds=bounds)
        return np.asarray(found.x) if found.status == 0 else np.zeros(len(cost))


class Step(NamedTuple):
    """A step along sliding motions."""

    vector: FloatArray
    """(n,)"""
    gain: float
    """Change of the energy to second order."""
    n_met: int
    """Number of walls met."""
    moved: FloatArray
    """(N, D + T) displacements of the particles' surfaces by translation and rotation."""


def _softest(matrix: DynamicalMatrix) -> tuple[FloatArray, FloatArray]:
    """Find the modes that vanish at first order in the prestress."""
    limit = _FIRST_ORDER * typical_prestress(matrix)
    most = matrix.size - matrix.translations.shape[1] - 2
    k = min(most, max(8, matrix.size - matrix.n_bonds + _MORE))
    while True:
        # Modes that are stiffer need not be resolved, so that one shift suffices.
        found = near(matrix, k, below_sliding(matrix))
        soft = found.eigenvalues < limit
        if not soft.all() or k == most:
            return found.eigenvalues[soft], found.vectors[:, soft]
        k = min(k + max(_MORE, k // 4), most)


def _walls(landscape: Landscape, state: State, matrix: DynamicalMatrix, reach: float) -> Walls:
    """Measure distances on enlarged particles, so that they touch, as precisely as overlaps are small."""
    radius = 0.5 * landscape.length
    bearing = _named(matrix.contacts)
    is_held = np.zeros(matrix.coordinates.n_all, bool)
    is_held[matrix.coordinates.backbone] = True
    known: dict[tuple[int, ...], int] = dict.fromkeys(bearing, 0)
    gaps, rows = [], []
    for level in _LEVELS:
        swelling = level * reach / radius
        contacts = _larger(landscape, swelling).derivatives(state)
        names = _named(contacts)
        bonds = lengths_of_bonds(contacts, matrix.coordinates)
        D = state.dimension
        apart = np.einsum(
            "md,md->m", bonds.by_variables[:, :D], contacts["separation"][bonds.contact]
        )
        gap = swelling * apart - bonds.overlap
        is_new = _are_new(names, bonds.contact, known)
        seen = np.array([names[c] in known for c in bonds.contact], bool)
        used = is_held[contacts["particles"][bonds.contact]].all(axis=1) & is_new
        used &= ~seen | (gap > _OPEN * level * reach)
        gaps.append(np.maximum(gap[used], 0.0))
        rows.append(bonds.gradient[used])
        count = np.bincount(bonds.contact, minlength=len(names))
        for name, n in zip(names, count.tolist(), strict=True):
            if name not in bearing or n > 1:
                known[name] = max(n, known.get(name, 0))
    return Walls(np.concatenate(gaps), scipy.sparse.vstack(rows).tocsr())


def _are_new(
    names: list[tuple[int, ...]], contact: IntArray, known: dict[tuple[int, ...], int]
) -> BoolArray:
    """Flag bonds beyond the previous number in their contact."""
    count = np.bincount(contact, minlength=len(names))
    more = np.array([count[c] > known.get(names[c], 0) for c in range(len(names))], bool)
    return np.asarray(more[contact])


def _named(contacts: dict[str, FloatArray]) -> list[tuple[int, ...]]:
    """Key contacts by their particles and periodic image."""
    return [
        tuple(row) for row in np.column_stack([contacts["particles"], contacts["shift"]]).tolist()
    ]


def _larger(landscape: Landscape, swelling: float) -> Landscape:
    particles = landscape.particles
    # Of harmonic bonds, the overlap is the force over the stiffness.
    law = particles.law.but(power=HARMONIC)
    larger = particles.with_(diameters=(1 + swelling) * particles.diameters, law=law)
    return Landscape(larger, landscape.k_e, landscape.sides)
