"""Contacts and forces of a packing, without LAMMPS.

The geometry and the energies are those of `lammps_plugin/contact/`; here they are only summed.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.contacts.near import NearPairs, PairArrays, near_particles
from jamshape.packing import Packing, State

_CROSSING, _UNCONVERGED = 2, 3  # ContactStatus of contact/contact.hpp


class CrossingError(ValueError):
    """The cores (spines or centres) of two particles cross: their contact has no energy."""


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
        Row of the `ContactNetwork`, ascending.
    normal : (B, D) array of float64
        Unit vectors into particle i.
    force : (B, D) array of float64, [energy / length]
        On particle i.
    point : (B, D) array of float64, [length]
        Point of interpenetration of the surfaces, next to the position of i as given in the packing.
    distance : (B,) array of float64, [length]
        r of the overlap 1 - r/d.
    reach : (B,) array of float64, [length]
        d of the overlap 1 - r/d: R_i + R_j, or the length that makes the overlap 1 - eta^2.
    energy : (B,) array of float64, [energy]
    on_side : (B, 2) array of bool
        Whether the point lies on the flat part of i, of j.
    on_face : (B, 2) array of bool
        Whether the surface of i, of j, is flat there in all directions: the side of a rod in the plane,
        a side of a box in space.
    """

    contact: IntArray
    normal: FloatArray
    force: FloatArray
    point: FloatArray
    distance: FloatArray
    reach: FloatArray
    energy: FloatArray
    on_side: BoolArray
    on_face: BoolArray

    @property
    def overlap(self) -> FloatArray:
        """(B,) overlaps 1 - r/d, or 1 - eta^2, to the rounding of lengths in doubles."""
        return 1 - self.distance / self.reach


@dataclass(frozen=True, eq=False)
class ContactErrors:
    """Error bounds of M contacts, for exactly these particles.

    Parameters
    ----------
    energy : (M,) array of float64, [energy]
        From the error of the overlap.
    force : (M,) array of float64, [energy / length]
        Magnitude of the difference, from the errors of overlap and normal.
    torque : (M,) array of float64, [energy]
        For the larger of both torques, from these and the error of the contact point.
    """

    energy: FloatArray
    force: FloatArray
    torque: FloatArray


@dataclass(frozen=True, eq=False)
class ContactNetwork:
    """The M contacts of a packing, each pair of touching images once, in ascending order.

    Parameters
    ----------
    pairs : (M, 2) array of int64
        Rows i <= j of the packing; i = j where a particle touches its own periodic image.
    shift : (M, D) array of int64
        Cell vectors of the box that bring j next to i: r_ij = x_i - (x_j + matrix shift), of `Box.matrix`.
    separation : (M, D) array of float64, [length]
        The vector r_ij.
    kind : (M,) array of int64
        `ContactKind`.
    n_bonds : (M,) array of int64
        At least one.
    energy : (M,) array of float64, [energy]
    force : (M, D) array of float64, [energy / length]
        On i; j carries the opposite.
    torque_i : (M,) array in 2D, (M, 3) in 3D, of float64, [energy]
        On i, about its centre.
    torque_j : (M,) array in 2D, (M, 3) in 3D, of float64, [energy]
        On j, about its centre.
    bonds : Bonds
    bonds_are_contacts : bool
        Whether each bond counts as a contact of its own for stability: for particles made of
        several round parts.
    errors : ContactErrors or None
        If requested.
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
    bonds_are_contacts: bool = False
    errors: ContactErrors | None = None


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


def find_contacts(
    packing: Packing,
    k_e: ArrayLike | None = None,
    sides: int | None = None,
    *,
    errors: bool = False,
) -> ContactNetwork:
    """Find all contacts, including those with periodic images.

    Parameters
    ----------
    packing : Packing
        Positions need not lie in the box.
    k_e : float or (T, T) array_like, [energy], optional
    sides : {1, 2}, optional
        Bonds of a side-to-side contact, of shapes that have both laws: one in the dynamics of Marschall
        & Teitel, two for minima and modes. Both are those of the packing's law by default.
    errors : bool
        Also bound the error of each contact, which takes many times as long.

    Returns
    -------
    ContactNetwork

    Raises
    ------
    CrossingError
        If the cores (spines or centres) of two particles cross.
    ValueError
        If a contact did not converge, or an argument is out of its range.

    Examples
    --------
    >>> from jamshape.contacts import find_contacts
    >>> from jamshape.protocols.random_start import random_packing
    >>> len(find_contacts(random_packing(n=10, phi=0.3, seed=1)).pairs)
    0
    """
    bodies, state = packing.compiled(packing.law.but(k_e, sides)), State.of(packing)
    near = near_particles(state, bodies)
    found = bodies.contacts(*PairArrays.of(state, near), packing.has_rests, errors)
    near = near.take(found["pair"])
    pairs = np.column_stack([near.first, near.second])
    refuse_crossing(packing, bodies.core, pairs[found["status"] == _CROSSING])
    refuse_unconverged(packing, pairs[found["status"] == _UNCONVERGED])
    return ContactNetwork(
        pairs=pairs,
        shift=near.shift,
        separation=_separation(state, near),
        kind=found["kind"].astype(np.int64),
        n_bonds=found["n_bonds"].astype(np.int64),
        energy=found["energy"],
        force=found["force"],
        torque_i=_rotation(found["torque_i"]),
        torque_j=_rotation(found["torque_j"]),
        bonds=_bonds(found, packing.position[near.first]),
        bonds_are_contacts=bodies.bonds_are_contacts,
        errors=_errors(found) if errors else None,
    )


def forces(packing: Packing, k_e: ArrayLike | None = None, sides: int | None = None) -> Forces:
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


def refuse_crossing(packing: Packing, core: str, crossing: IntArray) -> None:
    """Raise for pairs (M, 2) of particles whose `core` crosses, if there are any.

    Raises
    ------
    CrossingError
    """
    n = len(crossing)
    if n:
        first, second = packing.id[crossing[0]]
        more = f" (1 of {n} such pairs)" if n > 1 else ""
        msg = (
            f"the {core} of particles {first} and {second} cross{more}, expected overlaps smaller than"
            " the particles; start from a state without crossings"
        )
        raise CrossingError(msg)


def refuse_unconverged(packing: Packing, failed: IntArray) -> None:
    """Raise for pairs (M, 2) of particles whose contact is ContactStatus::UNCONVERGED, if there are any.

    Raises
    ------
    ValueError
    """
    if len(failed):
        first, second = packing.id[failed[0]]
        msg = (
            f"the contact of particles {first} and {second} did not converge; keep semi-axes within a"
            " factor 100 and exponents from 0.55 to 10"
        )
        raise ValueError(msg)


def _separation(state: State, near: NearPairs) -> FloatArray:
    x, shift = state.position, near.shift @ state.cell.T
    return np.asarray(x[near.first] - x[near.second] - shift, np.float64)


def _rotation(torque: FloatArray) -> FloatArray:
    """(M,) about z in 2D, (M, 3) in 3D."""
    return torque[:, 0] if torque.shape[1] == 1 else torque


def _errors(found: dict[str, NDArray[Any]]) -> ContactErrors:
    return ContactErrors(*(found[f"{name}_error"] for name in ("energy", "force", "torque")))


def _bonds(found: dict[str, NDArray[Any]], position: FloatArray) -> Bonds:
    slots = found["bond_distance"].shape[1]
    contact, slot = np.nonzero(np.arange(slots) < found["n_bonds"][:, None])

    def column(name: str) -> NDArray[Any]:
        return found[f"bond_{name}"][contact, slot]

    return Bonds(
        contact=contact,
        normal=column("normal"),
        force=column("force"),
        point=position[contact] + column("arm_i"),
        distance=column("distance"),
        reach=column("reach"),
        energy=column("energy"),
        on_side=column("on_side"),
        on_face=column("on_face"),
    )
