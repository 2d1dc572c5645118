"""Near pairs, contacts, forces and rattlers of a packing."""

from jamshape.contacts.found import Contacts
from jamshape.contacts.near import NearPairs, PairArrays
from jamshape.contacts.network import (
    Bonds,
    ContactErrors,
    ContactKind,
    ContactNetwork,
    CrossingError,
    Forces,
    find_contacts,
    forces,
    sum_forces,
)
from jamshape.contacts.pairs import Pairs
from jamshape.contacts.rattlers import Coordination, coordination, find_rattlers, is_grazing

__all__ = [
    "Bonds",
    "ContactErrors",
    "ContactKind",
    "ContactNetwork",
    "Contacts",
    "Coordination",
    "CrossingError",
    "Forces",
    "NearPairs",
    "PairArrays",
    "Pairs",
    "coordination",
    "find_contacts",
    "find_rattlers",
    "forces",
    "is_grazing",
    "sum_forces",
]
