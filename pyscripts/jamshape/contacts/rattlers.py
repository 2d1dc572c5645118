"""Rattlers, and contact numbers without them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jamshape import _contact
from jamshape.arrays import BoolArray
from jamshape.contacts.network import ContactKind, ContactNetwork
from jamshape.packing import Packing


class Coordination(NamedTuple):
    """Contact numbers without rattlers (Marschall & Teitel 2018, Sec. III C)."""

    z: float
    """Bonds per particle, a side-to-side contact of two rods in the plane counted as two."""
    z_single: float
    """Contacts per particle."""
    n_rattlers: int
    n_bonds: int
    n_contacts: int


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
