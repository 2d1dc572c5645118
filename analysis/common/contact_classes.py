"""Classes of contact of spherocylinders in the plane: their fractions, and the stress that each carries.

Marschall & Teitel 2018, Sec. III C and Fig. 9. Contacts of rattlers are left out of the fractions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jamshape.arrays import BoolArray, FloatArray
from jamshape.contacts import ContactKind, ContactNetwork, Contacts
from jamshape.measures.contact_statistics import held_contacts, require_plane


class ClassFractions(NamedTuple):
    """Fractions of the bonds that belong to each class of contact; their sum is 1."""

    tip_to_tip: float
    tip_to_side: float
    side_to_side: float


class FlatFraction(NamedTuple):
    """Fraction of the particles that have a contact on at least one of their two flat sides."""

    of_backbone: float
    """Fraction of the particles without rattlers."""
    of_all: float
    """Fraction of all particles; rattlers have none."""


def class_fractions(network: ContactNetwork, rattlers: BoolArray) -> ClassFractions:
    """Fractions of bonds by class of contact; a side-to-side contact is two bonds.

    Marschall & Teitel 2018, Fig. 9. Counted as in `jamshape.contacts.coordination`: two bonds even
    if `find_contacts` was called with sides=1.

    Parameters
    ----------
    network : ContactNetwork
        Contacts of a packing in two dimensions.
    rattlers : (N,) array of bool

    Returns
    -------
    ClassFractions

    Raises
    ------
    ValueError
        If no contact is held, or in three dimensions.
    """
    require_plane(network)
    kind = network.kind[held_contacts(network, rattlers)]
    contacts = np.bincount(kind, minlength=len(ContactKind))
    bonds = contacts * np.where(np.arange(len(ContactKind)) == ContactKind.SIDE_TO_SIDE, 2, 1)
    return ClassFractions(*(bonds / bonds.sum()).tolist())


def flat_contacts(network: ContactNetwork, rattlers: BoolArray) -> BoolArray:
    """Flag the particles that have a contact on one of their two flat sides.

    Parameters
    ----------
    network : ContactNetwork
    rattlers : (N,) array of bool

    Returns
    -------
    (N,) array of bool

    Raises
    ------
    ValueError
        If no contact is held.
    """
    held, bonds = held_contacts(network, rattlers), network.bonds
    on_side = np.repeat((network.kind == ContactKind.SIDE_TO_SIDE)[:, None], 2, axis=1)
    np.logical_or.at(on_side, bonds.contact, bonds.on_side)
    flat = np.zeros(len(rattlers), dtype=np.bool_)
    flat[network.pairs[held][on_side[held]]] = True
    return flat


def flat_fraction(network: ContactNetwork, rattlers: BoolArray) -> FlatFraction:
    """Count the particles of `flat_contacts`; arguments and errors as there.

    Marschall & Teitel 2018, Sec. III C: "virtually all the particles (96.3% of them) have a contact
    on at least one of their two flat sides" at alpha = 0.01, where 3.3 % are rattlers; the reference number
    is not given.
    """
    n_flat = np.count_nonzero(flat_contacts(network, rattlers))
    return FlatFraction(float(n_flat / np.count_nonzero(~rattlers)), float(n_flat / len(rattlers)))


NAMES = (*ClassFractions._fields, *(f"flat_{name}" for name in FlatFraction._fields))
"""Keys of `class_numbers`."""


def class_numbers(found: Contacts) -> dict[str, float]:
    """Count classes of contact and flat contacts of one packing, by `NAMES`."""
    fractions = class_fractions(found.network, found.rattlers)
    return dict(
        zip(NAMES, (*fractions, *flat_fraction(found.network, found.rattlers)), strict=True)
    )


def class_stress(found: Contacts) -> dict[int, FloatArray]:
    """Return the pressure tensor of the contacts of each class.

    Parameters
    ----------
    found : Contacts
        Contacts of classes 0 tip-to-tip, 1 tip-to-side and 2 side-to-side; shapes without sides have only 0.

    Returns
    -------
    dict
        (D, D) arrays p_kl by class, the sum of r_l f_k over its contacts, over the volume, [energy / length^D].
        Their sum is the pressure tensor.
    """
    network, volume = found.network, found.packing.box.volume
    tensors = np.einsum("ck,cl->ckl", network.force, network.separation) / volume
    return {
        int(kind): tensors[network.kind == kind].sum(axis=0) for kind in np.unique(network.kind)
    }
