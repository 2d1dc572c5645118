"""Rattlers, and contact numbers without them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jamshape import _contact
from jamshape.arrays import BoolArray
from jamshape.contacts.network import ContactKind, ContactNetwork
from jamshape.packing import Packing

# Bonds weaker than this fraction of the mean force are grazing: particles that slide, until they meet another one, rest on
# such bonds. Forces of packings at 1e-15 have a gap there, from 1e-6 to 1e-3 and more of the mean.
GRAZING = 1e-6


class Coordination(NamedTuple):
    """Contact numbers without rattlers (Marschall & Teitel 2018, Sec. III C)."""

    z: float
    """Bonds per particle, a side-to-side contact of two rods in the plane counting as two."""
    z_single: float
    """Contacts per particle."""
    z_bearing: float
    """Bonds per particle without grazing ones, which bear less than 1e-6 of the mean force."""
    n_rattlers: int
    n_bonds: int
    n_contacts: int
    n_grazing: int
    """Grazing bonds."""


def find_rattlers(packing: Packing, network: ContactNetwork) -> BoolArray:
    """Flag particles that contacts do not hold in place.

    Marschall & Teitel 2018, Sec. III C, for any shape and dimension D: in the plane, fewer than two contacts, or
    two that are not on opposite flat sides; in space fewer than four, unless two of
    them lie on opposite faces. Repeated until no more are found.

    Returns
    -------
    (N,) array of bool
    """
    bonds, n_contacts = network.bonds, len(network.pairs)
    if network.bonds_are_contacts:
        pairs, normal, on_face = network.pairs[bonds.contact], bonds.normal, bonds.on_face
    else:
        pairs = network.pairs
        normal = bonds.normal[np.searchsorted(bonds.contact, np.arange(n_contacts))]
        on_face = np.zeros((n_contacts, 2), dtype=np.bool_)
        np.logical_or.at(on_face, bonds.contact, bonds.on_face)
    normals = np.zeros((len(pairs), 3))
    normals[:, : packing.dimension] = normal
    return _contact.find_rattlers(packing.n, packing.dimension, pairs, normals, on_face)


def coordination(
    packing: Packing, network: ContactNetwork, grazing_below: float = GRAZING
) -> Coordination:
    """Count bonds and contacts per particle, without rattlers and their contacts.

    In the plane a side-to-side contact is two bonds, even if `find_contacts` was called with sides=1;
    in 3D bonds are counted as they are, since skew rods touch side to side at one point.

    Parameters
    ----------
    packing : Packing
    network : ContactNetwork
    grazing_below : float
        Fraction of the mean force below which a bond grazes.

    Returns
    -------
    Coordination
        With z = 0 if all particles are rattlers.
    """
    rattlers = find_rattlers(packing, network)
    held = ~(rattlers[network.pairs[:, 0]] | rattlers[network.pairs[:, 1]])
    bonds = network.n_bonds[held]
    grazing = np.bincount(
        network.bonds.contact[is_grazing(network, held, grazing_below)], minlength=len(held)
    )[held]
    if packing.dimension == 2:
        grazing = np.where(
            network.kind[held] == ContactKind.SIDE_TO_SIDE, 2 * grazing // bonds, grazing
        )
        bonds = np.where(network.kind[held] == ContactKind.SIDE_TO_SIDE, 2, bonds)
    n_particles, n_bonds, n_contacts = int((~rattlers).sum()), int(bonds.sum()), int(held.sum())
    n_grazing = int(grazing.sum())
    per_particle = 2 / max(n_particles, 1)
    return Coordination(
        z=per_particle * n_bonds,
        z_single=per_particle * n_contacts,
        z_bearing=per_particle * (n_bonds - n_grazing),
        n_rattlers=int(rattlers.sum()),
        n_bonds=n_bonds,
        n_contacts=n_contacts,
        n_grazing=n_grazing,
    )


def is_grazing(network: ContactNetwork, held: BoolArray, below: float = GRAZING) -> BoolArray:
    """Flag the bonds weaker than a fraction of the mean of those without rattlers, (B,).

    Parameters
    ----------
    network : ContactNetwork
    held : (M,) array of bool
        Contacts that do not involve rattlers.
    below : float
        That fraction.
    """
    force = np.linalg.norm(network.bonds.force, axis=1)
    counted = force[held[network.bonds.contact]]
    found: BoolArray = force < below * float(counted.mean() if len(counted) else 0.0)
    return found
