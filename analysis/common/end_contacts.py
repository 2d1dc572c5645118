"""Contacts at the ends of rods in space, and the degrees of freedom that contacts block.

All forces at points inside the cylinder are normal to the axis of a rod without friction. Contacts at its ends alone push
along it, so that a rod at rest has contacts at both ends, or at neither and slides freely along its axis (Heussinger,
arXiv 2004.13460).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from common.bearing import bearing_bonds
from jamshape.arrays import BoolArray, IntArray
from jamshape.contacts import ContactKind, ContactNetwork, Contacts
from jamshape.measures.contact_statistics import lever_arms


class EndContacts(NamedTuple):
    """Contacts of a packing of rods, without rattlers and their contacts, and without grazing bonds."""

    side_to_side: float
    """Fraction of the bonds at which neither nearest point of the two spines is an end."""
    end_to_side: float
    end_to_end: float
    at_neither: float
    """Fraction of the rods that have contacts at none of their ends."""
    at_one: float
    at_both: float
    """f_0 of Heussinger."""
    z: float
    """Bonds per rod."""
    z_blocked: float
    """Bonds per rod that would block all motions but the slides of rods `at_neither`, 8 + 2 f_0 for many."""

    @property
    def is_isostatic(self) -> int:
        """1 if there are enough bonds to block these motions."""
        return int(self.z > self.z_blocked - 1e-9)


def at_ends(network: ContactNetwork) -> BoolArray:
    """Flag whether each bond is at an end of either rod, (B, 2).

    Parallel rods side by side touch at two points where one or the other ends, but with forces normal to both.
    """
    is_beside = network.kind[network.bonds.contact] == ContactKind.SIDE_TO_SIDE
    return np.asarray(~network.bonds.on_side & ~is_beside[:, None])


def touched_ends(found: Contacts) -> IntArray:
    """Count the ends of each rod that have a bond of `bearing_bonds`, (N,) from 0 to 2."""
    packing, bonds = found.packing, found.network.bonds
    counted = at_ends(found.network) & bearing_bonds(found)[:, None]
    touched = np.zeros((packing.n, 2), np.bool_)
    for k, arm in enumerate(lever_arms(packing, found.network)):
        own = counted[:, k]
        rod = found.pairs[bonds.contact[own], k]
        forward = (arm[own] * packing.axes[rod]).sum(axis=1) > 0
        touched[rod, forward.astype(np.int64)] = True
    return np.asarray(touched.sum(axis=1))


def end_contacts(found: Contacts) -> EndContacts:
    """Count the contacts at ends, and compare their number with that of the motions to block.

    N rods that do not rattle have 5 N motions less one for each that slides freely, less the translations of all. One
    more bond blocks the box, since the packing has a pressure.

    Parameters
    ----------
    found : Contacts
        Of rods in three dimensions.

    Raises
    ------
    ValueError
        If a particle is no rod, or no contact is held.

    Examples
    --------
    >>> from jamshape import Spherocylinders, make_packing
    >>> rods = make_packing(Spherocylinders(alpha=4, size_ratio=1), n=16, dimension=3, seed=1, progress=False)
    >>> end_contacts(rods.contacts()).at_one
    0.0
    """
    packing = found.packing
    if packing.dimension != 3 or not (packing.half_length > 0).all():
        msg = (
            f"the packing in {packing.dimension}D has half lengths from {packing.half_length.min():g},"
            " expected rods in 3D; select their files"
        )
        raise ValueError(msg)
    bonds_at_ends = at_ends(found.network)[bearing_bonds(found)]
    of_bonds = np.bincount(bonds_at_ends.sum(axis=1), minlength=3)
    rods = ~found.rattlers
    n = int(np.count_nonzero(rods))
    of_rods = np.bincount(touched_ends(found)[rods], minlength=3)
    motions = packing.freedoms[rods].sum() - of_rods[0] - packing.dimension
    fractions = [*of_bonds / of_bonds.sum(), *of_rods / n]
    counts = [2 * of_bonds.sum() / n, 2 * (motions + 1) / n]
    return EndContacts(*map(float, (*fractions, *counts)))
