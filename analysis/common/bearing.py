"""Bonds that bear a load."""

from __future__ import annotations

from jamshape.arrays import BoolArray
from jamshape.contacts import Contacts, is_grazing
from jamshape.measures.contact_statistics import held_contacts


def bearing_bonds(found: Contacts) -> BoolArray:
    """Flag the bonds that count, (B,): without those of rattlers and without grazing ones."""
    held = held_contacts(found.network, found.rattlers)
    return held[found.network.bonds.contact] & ~is_grazing(found.network, held)
