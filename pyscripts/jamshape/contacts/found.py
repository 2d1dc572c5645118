"""A packing with its contacts and rattlers, and derived numbers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from numpy.typing import ArrayLike

from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.contacts.network import Bonds, ContactNetwork, find_contacts
from jamshape.contacts.rattlers import Coordination, coordination, find_rattlers
from jamshape.packing import Packing
from jamshape.records import Record


@dataclass(frozen=True, eq=False)
class Contacts(Record):
    """A packing of N particles with its M contacts and its rattlers.

    Parameters
    ----------
    packing : Packing
    network : ContactNetwork
    rattlers : (N,) array of bool
        Whether the particle is a rattler, not held in place by its contacts.
    """

    packing: Packing
    network: ContactNetwork
    rattlers: BoolArray

    @classmethod
    def of(
        cls, packing: Packing, k_e: ArrayLike | None = None, sides: int | None = None
    ) -> Contacts:
        """Find the contacts; arguments and errors as `find_contacts`."""
        network = find_contacts(packing, k_e, sides)
        return cls(packing, network, find_rattlers(packing, network))

    @cached_property
    def counts(self) -> Coordination:
        """Contact numbers without rattlers (Marschall & Teitel 2018, Sec. III C)."""
        return coordination(self.packing, self.network)

    @property
    def z(self) -> float:
        """Bonds per particle, rattlers excluded."""
        return self.counts.z

    @property
    def z_single(self) -> float:
        """Contacts per particle, rattlers excluded."""
        return self.counts.z_single

    @property
    def z_bearing(self) -> float:
        """Bonds per particle with at least 1e-6 of the mean force, rattlers excluded."""
        return self.counts.z_bearing

    @property
    def pairs(self) -> IntArray:
        """(M, 2) rows i <= j of the packing; i = j where a particle touches its own periodic image."""
        return self.network.pairs

    @property
    def force(self) -> FloatArray:
        """(M, D) force on i, [energy / length]; j carries the opposite."""
        return self.network.force

    @property
    def energy(self) -> FloatArray:
        """(M,) elastic energy, [energy]."""
        return self.network.energy

    @property
    def bonds(self) -> Bonds:
        """Points of contact with their normals, overlaps, forces and energies."""
        return self.network.bonds

    def __len__(self) -> int:
        return len(self.network.pairs)

    def __repr__(self) -> str:
        c = self.counts
        return (
            f"<{len(self)} contacts of {self.packing.n} particles: z = {c.z:.4g} bonds per particle,"
            f" {c.n_rattlers} rattlers left out>"
        )
