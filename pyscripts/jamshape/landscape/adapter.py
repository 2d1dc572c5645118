"""What a landscape needs to know of the shapes of its particles: one class for each shape.

Geometry and energies are those of `lammps_plugin/contact/`; here they are only called.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from jamshape import _contact
from jamshape.arrays import FloatArray, IntArray
from jamshape.contacts import (
    NearPairs,
    bodies,
    each_once,
    near_pairs,
    outer_radius,
    shifted,
    spheres,
    superellipsoid_bodies,
)
from jamshape.packing import Packing


class PairArrays(NamedTuple):
    """Poses and pairs as `jamshape._contact` takes them."""

    position: FloatArray
    """(2, N, D) doubles and their small rests."""
    orientation: FloatArray
    """(2, N, 1) or (2, N, 4)"""
    edges: FloatArray
    """(2, D)"""
    pairs: IntArray
    """(M, 2)"""
    shift: IntArray
    """(M, D)"""


class Coordinates(NamedTuple):
    """What coordinates of a packing in two dimensions are."""

    column: IntArray
    """(N, 3) numbers of the coordinates x, y, rotation; -1 for none."""
    rotation_length: FloatArray
    """(N,) as in `Shape`"""
    turning_radius: FloatArray
    """(N,) as in `Shape`"""


class Shape(Protocol):
    """Particles of one shape style: their sizes, pairs that may touch, and the sums over these."""

    core: str
    """What of two particles must not cross."""
    rotation_length: FloatArray
    """(N,) length that a radian counts for; 0 where no contact can turn the particle."""
    inner_radius: FloatArray
    """(N,) smallest length of a particle."""
    turning_radius: FloatArray
    """(N,) how far a rotation by a radian moves its surface at most."""
    outer_radius: FloatArray
    """(N,) radius of the sphere around it."""

    def near(self, packing: Packing, margin: float) -> NearPairs:
        """Find all pairs whose surfaces are closer than a margin, once each, in their order."""

    def nearer(self, packing: Packing, pairs: NearPairs, margin: float) -> NearPairs:
        """Select those of some pairs that are."""

    def sums(self, arrays: PairArrays, *, extended: bool) -> dict[str, Any]:
        """Sum energy, forces, torques and virial over pairs."""

    def derivatives(self, arrays: PairArrays, *, extended: bool) -> dict[str, NDArray[Any]]:
        """Evaluate second derivatives contact by contact."""

    def vicinity(self, coordinates: Coordinates) -> Any:
        """Compile the energy about a state in two dimensions, as `jamshape._contact` has it."""

    def turning_axes(self, packing: Packing) -> FloatArray:
        """(N, rotations, T) orthogonal unit vectors that contacts can turn particles about."""


class Spherocylinders:
    """Spherocylinders with harmonic overlap (Marschall & Teitel 2018, Eqs. 3 and 22)."""

    def __init__(self, packing: Packing, k_e: float, sides: int) -> None:
        self._diameters, self._law = packing.diameters, (k_e, sides)
        self.core = "spines"
        self.rotation_length = self.turning_radius = packing.half_length
        self.inner_radius = packing.radius
        self.outer_radius = outer_radius(packing)

    def near(self, packing: Packing, margin: float) -> NearPairs:
        """As `Shape.near`."""
        wide = bodies(packing)
        wide[:, -1] += 0.5 * margin
        return self.nearer(packing, each_once(near_pairs(wide, wide, packing.box)), margin)

    def nearer(self, packing: Packing, pairs: NearPairs, margin: float) -> NearPairs:
        """As `Shape.nearer`."""
        rows = bodies(packing)
        i, j = rows[pairs.first], shifted(rows[pairs.second], pairs.shift, packing.box)
        gaps = _contact.spine_distances(i, j) - i[:, -1] - j[:, -1]
        return pairs.take(gaps < margin)

    def sums(self, arrays: PairArrays, *, extended: bool) -> dict[str, Any]:
        """As `Shape.sums`."""
        found: dict[str, Any] = _contact.spherocylinder_sums(
            self._diameters, *arrays, *self._law, extended
        )
        return found

    def derivatives(self, arrays: PairArrays, *, extended: bool) -> dict[str, NDArray[Any]]:
        """As `Shape.derivatives`."""
        found: dict[str, NDArray[Any]] = _contact.spherocylinder_derivatives(
            self._diameters, *arrays, *self._law, extended
        )
        return found

    def vicinity(self, coordinates: Coordinates) -> Any:
        """As `Shape.vicinity`."""
        k_e, sides = self._law
        return _contact.SpherocylinderVicinity(self._diameters, k_e, sides, *coordinates)

    def turning_axes(self, packing: Packing) -> FloatArray:
        """Two in space: a rod spins freely about its own axis."""
        if packing.dimension == 2:
            return np.ones((packing.n, 1, 1))
        return _across(packing.axes)


class Superellipsoids:
    """Superellipsoids with U = k_e/2 (eta^2 - 1)^2 (Yuan et al. 2019, Eq. 3)."""

    def __init__(self, packing: Packing, k_e: float) -> None:
        self._packing, self._epsilon = packing, k_e
        self.core = "centres"
        axes = packing.diameters[:, : packing.dimension] / 2
        self.outer_radius = outer_radius(packing)
        self.inner_radius = axes.min(axis=1)
        is_round = packing.is_round
        self.rotation_length = np.where(is_round, 0.0, packing.diameters[:, 0] / 2)
        self.turning_radius = np.where(is_round, 0.0, self.outer_radius)

    def near(self, packing: Packing, margin: float) -> NearPairs:
        """As `Shape.near`."""
        wide = spheres(packing.position, self.outer_radius + 0.5 * margin)
        return self.nearer(packing, each_once(near_pairs(wide, wide, packing.box)), margin)

    def nearer(self, packing: Packing, pairs: NearPairs, margin: float) -> NearPairs:
        """As `Shape.nearer`."""
        rows = superellipsoid_bodies(packing)
        i, j = rows[pairs.first], shifted(rows[pairs.second], pairs.shift, packing.box)
        return pairs.take(_contact.superellipsoid_near(i, j, margin))

    def sums(self, arrays: PairArrays, *, extended: bool) -> dict[str, Any]:
        """As `Shape.sums`."""
        found: dict[str, Any] = _contact.superellipsoid_sums(
            self._packing.diameters, self._packing.exponent, *arrays, self._epsilon, extended
        )
        return found

    def derivatives(self, arrays: PairArrays, *, extended: bool) -> dict[str, NDArray[Any]]:
        """As `Shape.derivatives`."""
        found: dict[str, NDArray[Any]] = _contact.superellipsoid_derivatives(
            self._packing.diameters, self._packing.exponent, *arrays, self._epsilon, extended
        )
        return found

    def vicinity(self, coordinates: Coordinates) -> Any:
        """As `Shape.vicinity`."""
        packing = self._packing
        return _contact.SuperellipsoidVicinity(
            packing.diameters, packing.exponent, self._epsilon, *coordinates
        )

    def turning_axes(self, packing: Packing) -> FloatArray:
        """Three in space; two for spheroids, which spin freely about their axis."""
        n = packing.n
        if packing.dimension == 2:
            return np.ones((n, 1, 1))
        axes = np.tile(np.eye(3), (n, 1, 1))
        symmetric = packing.symmetry_axis
        for k in range(3):
            own = symmetric == k
            axes[own, :2] = _across(packing.body_axes(k)[own])
            axes[own, 2] = 0.0
        return axes


def shape_of(packing: Packing, k_e: float, sides: int) -> Shape:
    """Choose the class for the shape style of a packing."""
    if packing.shape_style == "spherocylinder":
        return Spherocylinders(packing, k_e, sides)
    return Superellipsoids(packing, k_e)


def _across(axis: FloatArray) -> FloatArray:
    """(N, 2, 3) two unit vectors perpendicular to each axis (N, 3) and to each other."""
    least = np.eye(3)[np.abs(axis).argmin(axis=1)]
    first = np.cross(axis, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(axis, first)], axis=1)
