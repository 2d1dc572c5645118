"""Contacts, forces and rattlers of a packing, without LAMMPS.

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
from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.packing import Box, Packing

_TOUCHING, _CROSSING, _UNCONVERGED = 1, 2, 3  # ContactStatus of contact/contact.hpp
_CORE = {"spherocylinder": "spines", "superellipsoid": "centres"}  # what must not cross

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
        r and d = R_i + R_j of the overlap 1 - r/d; of superellipsoids that is 1 - eta^2.
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


def superellipsoid_bodies(packing: Packing) -> FloatArray:
    """Pack shapes and poses of superellipsoids into the rows that `jamshape._contact` takes.

    Returns
    -------
    (N, 6) array in 2D, (N, 11) in 3D, of float64
        Centre, angle or quaternion, D semi-axes, exponent.
    """
    axes = packing.diameters[:, : packing.dimension] / 2
    return np.column_stack([packing.position, packing.orientation, axes, packing.exponent])


def spheres(position: FloatArray, radius: FloatArray) -> FloatArray:
    """(N, D + 2) rows for `near_pairs` that are spheres (discs) of these radii."""
    return np.column_stack([position, np.zeros(len(radius)), radius])


def near_pairs(first: FloatArray, second: FloatArray, box: Box) -> NearPairs:
    """Find all pairs whose bounding spheres overlap, with all periodic images.

    Parameters
    ----------
    first, second : (M, ...) array of float64
        Rows of `bodies` or `spheres`, anywhere, in the box or not: the centre first, and last two lengths
        whose sum is the radius of the bounding sphere.
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
    """Move rows (M, ...), whose first D columns are positions, by (M, D) box edges."""
    D = box.dimension
    return np.column_stack([rows[:, :D] + shift * box.edges, rows[:, D:]])


def find_contacts(packing: Packing, k_e: float = 1.0, sides: int = 1) -> ContactNetwork:
    """Find all contacts, with all periodic images in reach.

    Parameters
    ----------
    packing : Packing
        Positions need not lie in the box.
    k_e : float, [energy]
        The epsilon of superellipsoids.
    sides : {1, 2}
        Bonds of a side-to-side contact of spherocylinders: one in the dynamics, two for minima and modes.

    Returns
    -------
    ContactNetwork

    Raises
    ------
    ValueError
        If two spines or centres cross, a contact did not converge, or an argument is out of its
        range.
    """
    are_rods = packing.shape_style == "spherocylinder"
    rows = bodies(packing) if are_rods else superellipsoid_bodies(packing)
    bounds = rows if are_rods else spheres(packing.position, outer_radius(packing))
    near = each_once(near_pairs(bounds, bounds, packing.box))
    i, j = rows[near.first], shifted(rows[near.second], near.shift, packing.box)
    if are_rods:
        found = _contact.spherocylinder_contacts(i, j, k_e, sides)
        found["bond_reach"] = np.repeat((i[:, -1] + j[:, -1])[:, None], 2, axis=1)
    else:
        found = _with_slots(_contact.superellipsoid_contacts(i, j, k_e))
    _refuse_crossing(packing, near, found["status"])
    _refuse_unconverged(packing, near, found["status"])

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
        bonds=_bonds(found, i),
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
            f"the {_CORE[packing.shape_style]} of particles {first} and {second} cross (1 of {len(crossing)} such"
            " pairs), expected overlaps smaller than the particles; take a packing without crossings"
        )
        raise ValueError(msg)


def _refuse_unconverged(packing: Packing, near: NearPairs, status: NDArray[np.int32]) -> None:
    failed = np.flatnonzero(status == _UNCONVERGED)
    if len(failed):
        first, second = packing.id[near.first[failed[0]]], packing.id[near.second[failed[0]]]
        raise ValueError(unconverged_sentence(first, second))


def unconverged_sentence(first: int, second: int) -> str:
    """Say what happened to two particles whose contact is ContactStatus::UNCONVERGED."""
    return (
        f"the contact of particles {first} and {second} did not converge; use semi-axes within a factor"
        " 100 and exponents from 0.55 to 10"
    )


def _rotation(torque: FloatArray) -> FloatArray:
    """(M,) about z in 2D, (M, 3) in 3D."""
    return torque[:, 0] if torque.shape[1] == 1 else torque


def outer_radius(packing: Packing) -> FloatArray:
    """(N,) radii of the spheres around the particles, [length]."""
    if packing.shape_style == "spherocylinder":
        return packing.half_length + packing.radius
    radius: FloatArray = _contact.superellipsoid_bounding_radius(
        packing.diameters, packing.exponent, packing.dimension
    )
    return radius


def _with_slots(found: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Give contacts of one bond the arrays (M, slots, ...) of those that may have more."""
    one = {n: v[:, None] if n.startswith("bond_") else v for n, v in found.items()}
    nowhere = np.zeros((len(found["status"]), 1), bool)
    one |= {"bond_on_side_i": nowhere, "bond_on_side_j": nowhere}
    one |= {"bond_force": found["force"][:, None], "bond_energy": found["energy"][:, None]}
    n_bonds = (found["status"] == _TOUCHING).astype(np.int64)
    return one | {"n_bonds": n_bonds, "kind": np.zeros_like(n_bonds)}


def _bonds(found: dict[str, NDArray[Any]], i: FloatArray) -> Bonds:
    slots = found["bond_distance"].shape[1]
    contact, slot = np.nonzero(np.arange(slots) < found["n_bonds"][:, None])

    def column(name: str) -> NDArray[Any]:
        return found[f"bond_{name}"][contact, slot]

    return Bonds(
        contact=contact,
        normal=column("normal"),
        force=column("force"),
        point=i[contact, : found["force"].shape[1]] + column("arm_i"),
        distance=column("distance"),
        reach=column("reach"),
        energy=column("energy"),
        on_side=np.column_stack([column("on_side_i"), column("on_side_j")]),
    )
