"""Constraints by contacts: first-order ones, motions blocked to second order, and motions that are free.

A contact that forbids overlaps constrains one motion to first order, along the gradient of its gap. Along motions that
leave the gap unchanged to first order, its second derivatives matter: where they are negative the gap closes, and
the contact blocks that motion, too (VanderWerf et al. 2018). A minimum with N_q modes that contacts leave free to first
order needs at least N_q such blocked motions: forces weight the second derivatives, whose sum is positive on all
these modes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space

from common.quartic import by_size, quartic_count
from jamshape.arrays import FloatArray, IntArray
from jamshape.landscape import Landscape, State
from jamshape.packing import Packing
from jamshape.vibration.hessian import DynamicalMatrix, dynamical_matrix
from jamshape.vibration.table import ModeTable

# Second derivatives below this part of a contact's largest are rounding.
_ZERO = 1e-7

# A mode is free if its eigenvalue is below this part of the largest entry of the prestress.
_FREE = 1e-6


class Constraints(NamedTuple):
    """Counts of one packing, without rattlers."""

    n_contacts: int
    """N_c, bonds: two for a side-to-side contact."""
    n_isostatic: int
    """N_iso: contacts that would constrain all coordinates but translations to first order, with one set of forces."""
    n_quartic: int
    """N_q: modes below the gap of the spectrum but free ones, which contacts block to second order only."""
    n_free: int
    """Modes that no contact blocks: rotation of a particle all of whose contacts are on one of its discs, or sliding
    between parallel sides."""
    n_redundant: int
    """Contacts that constrain nothing that others leave free, by the rank of the gradients."""
    n_blocking: int
    """Contacts that block at least one motion to second order."""
    n_blocked: int
    """Motions blocked to second order, over all contacts."""

    @property
    def is_matched(self) -> bool:
        """Whether there is one quartic or free mode for each missing contact."""
        return self.n_isostatic - self.n_contacts == self.n_quartic + self.n_free


def blocked_motions(matrix: DynamicalMatrix, rotation_length: FloatArray) -> IntArray:
    """Count the motions of the two particles of each contact that it blocks to second order only.

    Parameters
    ----------
    matrix : DynamicalMatrix
    rotation_length : (N,) array of float64, [length]
        Scales rotations; the counts do not depend on it but for rounding.

    Returns
    -------
    (C,) array of int64
    """
    lengths = np.where(rotation_length > 0, rotation_length, 1.0)[matrix.contacts["particles"]]
    turns = (matrix.curvature.shape[1] - matrix.coordinates.dimension) // 2
    found = np.zeros(len(matrix.curvature), np.int64)
    for contact, curvature in enumerate(matrix.curvature):
        scale = np.ones(len(curvature))
        scale[-2 * turns :] = 1 / np.repeat(lengths[contact], turns)
        scaled = curvature * np.outer(scale, scale)
        along = null_space(matrix.bonds.gradient[matrix.bonds.contact == contact] * scale)
        second = np.linalg.eigvalsh(along.T @ scaled @ along)
        found[contact] = np.count_nonzero(second > _ZERO * np.abs(scaled).max())
    return found


def constraints_of(packing: Packing, table: ModeTable) -> Constraints:
    """Count constraints of a packing, from its modes; errors as `dynamical_matrix`."""
    landscape = Landscape(packing)
    matrix = dynamical_matrix(landscape, State.of(packing))
    blocked = blocked_motions(matrix, landscape.rotation_length)
    count = quartic_count(table)
    size = np.abs(table["eigenvalues"][by_size(table)])[: count.n_quartic]
    prestress = np.abs(matrix.prestress.diagonal()).max()
    n_free = int(np.count_nonzero(size < _FREE * prestress))
    isostatic = count.n_coordinates - count.n_translations + 1
    n_quartic = count.n_quartic - n_free
    rank = count.n_coordinates - count.n_translations - count.n_quartic_by_rank
    return Constraints(
        n_contacts=count.n_contacts,
        n_isostatic=isostatic,
        n_quartic=n_quartic,
        n_free=n_free,
        n_redundant=count.n_contacts - rank - 1,
        n_blocking=int(np.count_nonzero(blocked)),
        n_blocked=int(blocked.sum()),
    )
