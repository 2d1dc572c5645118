"""Contacts, forces and rattlers of a packing of spherocylinders, without LAMMPS.

The geometry and the energies are those of `lammps_plugin/contact/`; here they are only summed.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from jamshape import _contact
from jamshape.packing import Box, FloatArray, IntArray, Packing

BoolArray = NDArray[np.bool_]

_TOUCHING, _CROSSING = 1, 2  # ContactStatus of contact/contact.hpp

# Bounding spheres are larger by this fraction, so that rounding never drops a contact.
_BOUNDING_MARGIN = 1e-9


class ContactKind(IntEnum):
    """Classes of contact (Marschall & Teitel 2018, Fig. 1), numbered as in contact/contact.hpp."""

    TIP_TO_TIP = 0
    TIP_TO_SIDE = 1
    SIDE_TO_SIDE = 2


@dataclass(frozen=True, eq=False)
class Bonds:
    """Points of contact, each with one force; B of them.

    Parameters
    ----------
    contact : (B,) array of int64
        Row of `ContactNetwork` that the bond belongs to, ascending.
    normal : (B, D) array of float64
        Unit vectors into particle i.
    force : (B, D) array of float64, [energy / length]
        On particle i.
    point : (B, D) array of float64, [length]
        Where the surfaces interpenetrate, next to the position of i as the packing gives it.
    distance, reach : (B,) array of float64, [length]
        r and d = R_i + R_j of the overlap 1 - r/d.
    energy : (B,) array of float64, [energy]
    on_side : (B, 2) array of bool
        Whether the point lies on the flat part of i, of j.
    """

    contact: IntArray
    normal: FloatArray
    force: FloatArray
    point: FloatArray
    distance: FloatArray
    reach: FloatArray
    energy: FloatArray
    on_side: BoolArray


@dataclass(frozen=True, eq=False)
class ContactNetwork:
    """The M contacts of a packing, each pair of touching images once, in ascending order.

    Parameters
    ----------
    pairs : (M, 2) array of int64
        Rows i <= j of the packing; i = j where a particle touches its own periodic image.
    shift : (M, D) array of int64
        Box edges that bring j next to i: r_ij = x_i - (x_j + shift * edges).
    separation : (M, D) array of float64, [length]
        That r_ij.
    kind : (M,) array of int64
        `ContactKind`.
    n_bonds : (M,) array of int64
        1 or 2.
    energy : (M,) array of float64, [energy]
    force : (M, D) array of float64, [energy / length]
        On i; j carries the opposite.
    torque_i, torque_j : (M,) array in 2D, (M, 3) in 3D, of float64, [energy]
    bonds : Bonds
    """

    pairs: IntArray
    shift: IntArray
    separation: FloatArray
    kind: IntArray
    n_bonds: IntArray
    energy: FloatArray
    force: FloatArray
    torque_i: FloatArray
    torque_j: FloatArray
    bonds: Bonds


@dataclass(frozen=True, eq=False)
class Forces:
    """Elastic energy of a packing and its derivatives.

    Parameters
    ----------
    energy : float, [energy]
    force : (N, D) array of float64, [energy / length]
    torque : (N,) array in 2D, (N, 3) in 3D, of float64, [energy]
        About the centres, in space coordinates.
    virial : (D, D) array of float64, [energy]
        Sum over contacts of r_ij (x) F_ij.
    pressure : float, [energy / length^D]
        trace(virial) / (D V) = -dU/dV for affine changes of the positions at fixed orientations.
    """

    energy: float
    force: FloatArray
    torque: FloatArray
    virial: FloatArray
    pressure: float


class Coordination(NamedTuple):
    """Contact numbers without rattlers (Marschall & Teitel 2018, Sec. III C)."""

    z: float
    """Bonds per particle, a side-to-side contact of two rods in the plane counted as two."""
    z_single: float
    """Contacts per particle."""
    n_rattlers: int
    n_bonds: int
    n_contacts: int


class NearPairs(NamedTuple):
    """Pairs of bodies, one row for each image of the second that is near enough."""

    first: IntArray
    second: IntArray
    shift: IntArray
    """(M, D) box edges to add to the second."""


def bodies(packing: Packing) -> FloatArray:
    """Pack shapes and poses into the rows that `jamshape._contact` takes.

    Parameters
    ----------
    packing : Packing
        Spherocylinders.

    Returns
    -------
    (N, 6) array in 2D, (N, 8) in 3D, of float64
        Centre, unit axis, half length, radius.

    Raises
    ------
    ValueError
        If the shape style is another one.
    """
    if packing.shape_style != "spherocylinder":
        msg = f"shape style is {packing.shape_style!r}, expected 'spherocylinder'"
        raise ValueError(msg)
    return np.column_stack([packing.position, packing.axes, packing.half_length, packing.radius])


def near_pairs(first: FloatArray, second: FloatArray, box: Box) -> NearPairs:
    """Find all pairs whose bounding spheres overlap, with all periodic images.

    Parameters
    ----------
    first, second : (M, 6) or (M, 8) array of float64
        Rows of `bodies`, anywhere, in the box or not.
    box : Box
        Of any size; a pair is there several times when it is shorter than the bodies.

    Returns
    -------
    NearPairs
        In no particular order; a row of `first` that also stands in `second` meets itself.
    """
    D, edges = box.dimension, box.edges
    turns = [np.floor((rows[:, :D] - box.lo) / edges).astype(np.int64) for rows in (first, second)]
    inside = [
        rows[:, :D] - box.lo - turn * edges
        for rows, turn in zip((first, second), turns, strict=True)
    ]
    bounds = [(1 + _BOUNDING_MARGIN) * rows[:, -2:].sum(axis=1) for rows in (first, second)]
    reach = bounds[0].max() + bounds[1].max()
    owner, shift = _images_near_box(inside[1], edges, reach)
    near = cKDTree(inside[0]).sparse_distance_matrix(
        cKDTree(inside[1][owner] + shift * edges), reach, output_type="ndarray"
    )
    i, j = near["i"], owner[near["j"]]
    keep = near["v"] < bounds[0][i] + bounds[1][j]
    i, j, shift = i[keep], j[keep], shift[near["j"][keep]]
    return NearPairs(i, j, shift + turns[0][i] - turns[1][j])


def shifted(rows: FloatArray, shift: IntArray, box: Box) -> FloatArray:
    """Move rows (M, 6) or (M, 8) of `bodies` by (M, D) box edges."""
    D = box.dimension
    return np.column_stack([rows[:, :D] + shift * box.edges, rows[:, D:]])


def find_contacts(packing: Packing, k_e: float = 1.0, sides: int = 1) -> ContactNetwork:
    """Find all contacts, with all periodic images in reach.

    Parameters
    ----------
    packing : Packing
        Spherocylinders; positions need not lie in the box.
    k_e : float, [energy]
    sides : {1, 2}
        Bonds of a side-to-side contact: one in the dynamics, two for minima and modes.

    Returns
    -------
    ContactNetwork

    Raises
    ------
    ValueError
        If two spines cross, or an argument is out of its range.
    """
    rows = bodies(packing)
    near = near_pairs(rows, rows, packing.box)
    near = _take(near, _each_once(near))
    i, j = rows[near.first], shifted(rows[near.second], near.shift, packing.box)
    found = _contact.spherocylinder_contacts(i, j, k_e, sides)
    _refuse_crossing(packing, near, found["status"])

    touching = np.flatnonzero(found["status"] == _TOUCHING)
    order = touching[np.lexsort((*near.shift.T[::-1], near.second, near.first))[touching]]
    return order
