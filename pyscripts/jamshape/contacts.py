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

    def take(self, rows: NDArray[Any]) -> NearPairs:
        """Select rows by index or mask."""
        return NearPairs(self.first[rows], self.second[rows], self.shift[rows])


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
    reach = bounds[0].max(initial=0) + bounds[1].max(initial=0)
    owner, shift = _images_near_box(inside[1], edges, reach)
    near = cKDTree(inside[0]).sparse_distance_matrix(
        cKDTree(inside[1][owner] + shift * edges), reach, output_type="ndarray"
    )
    i, j = near["i"], owner[near["j"]]
    keep = near["v"] < bounds[0][i] + bounds[1][j]
    i, j, shift = i[keep], j[keep], shift[near["j"][keep]]
    return NearPairs(i, j, shift + turns[0][i] - turns[1][j])


def each_once(near: NearPairs) -> NearPairs:
    """Of the `near_pairs` of bodies among themselves, keep one of (i, j) and (j, i), and sort.

    Returns
    -------
    NearPairs
        i <= j, ascending; of a body and its own images one of each two that are opposite.
    """
    i, j, shift = near
    leading = np.take_along_axis(shift, np.argmax(shift != 0, axis=1)[:, None], axis=1)[:, 0]
    near = near.take((i < j) | ((i == j) & (leading > 0)))
    return near.take(np.lexsort((*near.shift.T[::-1], near.second, near.first)))


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
    near = each_once(near_pairs(rows, rows, packing.box))
    i, j = rows[near.first], shifted(rows[near.second], near.shift, packing.box)
    found = _contact.spherocylinder_contacts(i, j, k_e, sides)
    _refuse_crossing(packing, near, found["status"])

    touching = found["status"] == _TOUCHING
    i, j, near = i[touching], j[touching], near.take(touching)
    found = {name: values[touching] for name, values in found.items()}
    D = packing.dimension
    return ContactNetwork(
        pairs=np.column_stack([near.first, near.second]),
        shift=near.shift,
        separation=i[:, :D] - j[:, :D],
        kind=found["kind"].astype(np.int64),
        n_bonds=found["n_bonds"].astype(np.int64),
        energy=found["energy"],
        force=found["force"],
        torque_i=_rotation(found["torque_i"]),
        torque_j=_rotation(found["torque_j"]),
        bonds=_bonds(found, i, j),
    )


def forces(packing: Packing, k_e: float = 1.0, sides: int = 1) -> Forces:
    """Sum energy, forces, torques and pressure; arguments and errors as `find_contacts`."""
    return sum_forces(packing, find_contacts(packing, k_e, sides))


def sum_forces(packing: Packing, network: ContactNetwork) -> Forces:
    """Sum energy, forces, torques and pressure of the contacts that `find_contacts` found."""
    i, j = network.pairs.T
    force = np.zeros((packing.n, packing.dimension))
    np.add.at(force, i, network.force)
    np.subtract.at(force, j, network.force)
    torque = np.zeros((packing.n, *network.torque_i.shape[1:]))
    np.add.at(torque, i, network.torque_i)
    np.add.at(torque, j, network.torque_j)
    virial: FloatArray = network.separation.T @ network.force
    return Forces(
        energy=float(network.energy.sum()),
        force=force,
        torque=torque,
        virial=virial,
        pressure=float(np.trace(virial)) / (packing.dimension * packing.box.volume),
    )


def find_rattlers(packing: Packing, network: ContactNetwork) -> BoolArray:
    """Flag the particles that no contacts hold in place.

    Marschall & Teitel 2018, Sec. III C: fewer than two contacts, or two unless on opposite flat
    sides; repeated until none is left. In 3D fewer than four contacts.

    Returns
    -------
    (N,) array of bool
    """
    bonds = network.bonds
    normals = np.zeros((len(network.pairs), 3))
    flat = np.repeat((network.kind == ContactKind.SIDE_TO_SIDE)[:, None], 2, axis=1)
    first_bond = np.searchsorted(bonds.contact, np.arange(len(normals)))
    normals[:, : packing.dimension] = bonds.normal[first_bond]
    np.logical_or.at(flat, bonds.contact, bonds.on_side)
    return _contact.find_rattlers(packing.n, packing.dimension, network.pairs, normals, flat)


def coordination(packing: Packing, network: ContactNetwork) -> Coordination:
    """Count bonds and contacts per particle, without rattlers and their contacts.

    In the plane a side-to-side contact is two bonds, also where `find_contacts` was asked for one;
    in 3D bonds are counted as they are, since skew rods touch side to side at one point.

    Returns
    -------
    Coordination
        With z = 0 where all particles are rattlers.
    """
    rattlers = find_rattlers(packing, network)
    held = ~rattlers[network.pairs].any(axis=1)
    bonds = network.n_bonds[held]
    if packing.dimension == 2:
        bonds = np.where(network.kind[held] == ContactKind.SIDE_TO_SIDE, 2, bonds)
    n_particles, n_bonds, n_contacts = int((~rattlers).sum()), int(bonds.sum()), int(held.sum())
    per_particle = 2 / max(n_particles, 1)
    return Coordination(
        z=per_particle * n_bonds,
        z_single=per_particle * n_contacts,
        n_rattlers=int(rattlers.sum()),
        n_bonds=n_bonds,
        n_contacts=n_contacts,
    )


def _images_near_box(
    inside: FloatArray, edges: FloatArray, reach: float
) -> tuple[IntArray, IntArray]:
    """List all images of points in [0, edges) within `reach` of it: their owner, their shift."""
    owner = np.arange(len(inside))
    shift = np.zeros((len(inside), 0), dtype=np.int64)
    for d, edge in enumerate(edges):
        turns = np.arange(-np.ceil(reach / edge), np.ceil(reach / edge) + 1, dtype=np.int64)
        coordinate = inside[owner, d, None] + turns * edge
        row, column = np.nonzero((coordinate > -reach) & (coordinate < edge + reach))
        owner, shift = owner[row], np.column_stack([shift[row], turns[column]])
    return owner, shift


def _refuse_crossing(packing: Packing, near: NearPairs, status: NDArray[np.int32]) -> None:
    crossing = np.flatnonzero(status == _CROSSING)
    if len(crossing):
        first, second = packing.id[near.first[crossing[0]]], packing.id[near.second[crossing[0]]]
        msg = (
            f"the spines of particles {first} and {second} cross (1 of {len(crossing)} such"
            " pairs), expected overlaps smaller than the particles; take a packing without crossings"
        )
        raise ValueError(msg)


def _rotation(torque: FloatArray) -> FloatArray:
    """(M,) about z in 2D, (M, 3) in 3D."""
    return torque[:, 0] if torque.shape[1] == 1 else torque


def _bonds(found: dict[str, NDArray[Any]], i: FloatArray, j: FloatArray) -> Bonds:
    contact, slot = np.nonzero(np.arange(2) < found["n_bonds"][:, None])

    def column(name: str) -> NDArray[Any]:
        return found[f"bond_{name}"][contact, slot]

    return Bonds(
        contact=contact,
        normal=column("normal"),
        force=column("force"),
        point=i[contact, : found["force"].shape[1]] + column("arm_i"),
        distance=column("distance"),
        reach=(i[:, -1] + j[:, -1])[contact],
        energy=column("energy"),
        on_side=np.column_stack([column("on_side_i"), column("on_side_j")]),
    )
