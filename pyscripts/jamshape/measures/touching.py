"""Positions of contacts on particle surfaces in two dimensions, averaged over samples.

Marschall & Teitel 2018, Sec. III C, Figs. 9 and 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.contacts import Contacts
from jamshape.files.sets import PackingFile
from jamshape.measures.averages import Mean, mean, standard_error
from jamshape.measures.contact_statistics import (
    ClassFractions,
    FlatFraction,
    angle_density,
    angle_edges,
    class_fractions,
    contact_angles,
    flat_fraction,
)

NAMES = (*ClassFractions._fields, *(f"flat_{name}" for name in FlatFraction._fields))
"""Keys of `class_numbers`."""


def class_numbers(found: Contacts) -> dict[str, float]:
    """Count classes of contact and flat contacts of one packing, by `NAMES`."""
    fractions = class_fractions(found.network, found.rattlers)
    return dict(
        zip(NAMES, (*fractions, *flat_fraction(found.network, found.rattlers)), strict=True)
    )


def angles_of(file: PackingFile) -> FloatArray:
    """(K,) polar angles of the contacts of one packing, folded to [0, pi/2]; see `contact_angles`."""
    found = file.contacts()
    return contact_angles(found.packing, found.network, found.rattlers)


class AngleCurve(NamedTuple):
    """P(phi) of a system, averaged over samples."""

    edges: FloatArray
    """(B + 1,) degrees."""
    density: FloatArray
    """(B,) 1 / rad."""
    error: FloatArray
    """(B,), 0 for one sample."""
    samples: int
    n_contacts: int
    on_flat: Mean
    """Fraction of the angles on the flat sides."""

    @property
    def peak_degrees(self) -> float:
        """Centre of the bin with the highest P."""
        middles = (self.edges[1:] + self.edges[:-1]) / 2
        return float(middles[np.argmax(self.density)])


def angle_curve(alpha: float, files: Sequence[PackingFile]) -> AngleCurve:
    """Average P over samples in common bins; `alpha` determines where flat sides begin."""
    return curve_of_angles(alpha, [angles_of(file) for file in files])


def curve_of_angles(alpha: float, found: Sequence[FloatArray]) -> AngleCurve:
    """Average P over the angles (K,) of packings, or of frames of a run, in common bins."""
    edges = angle_edges(np.concatenate(found))
    densities = np.array([angle_density(angles, edges).density for angles in found])
    corner = np.arctan2(1, alpha)
    return AngleCurve(
        np.degrees(angle_density(found[0], edges).edges),
        densities.mean(axis=0),
        standard_error(densities),
        len(found),
        sum(map(len, found)) // 2,
        mean([np.count_nonzero(angles > corner) / len(angles) for angles in found]),
    )
