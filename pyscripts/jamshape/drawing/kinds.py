"""Kinds of particles of a packing, from the particles alone, for colours and legends."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jamshape.arrays import BoolArray, IntArray
from jamshape.packing import Packing

MOST = 8  # kinds that colours can distinguish

_DIGITS = 9  # in which particles of one kind agree


class Kinds(NamedTuple):
    """Kinds of particles, the smallest first."""

    of: IntArray
    """(N,)"""
    parameters: list[str]
    """TeX labels of each kind; empty if there are too many kinds."""
    sizes: list[str]
    """TeX."""

    @property
    def labels(self) -> list[str]:
        """Label the kinds by parameters, size and number."""
        counts = np.bincount(self.of)
        rows = zip(self.parameters, self.sizes, counts, strict=False)
        return [f"{parameters}, {size} ({count})" for parameters, size, count in rows]

    @property
    def title(self) -> str:
        """List the parameters; empty if there are too many kinds."""
        return "; ".join(dict.fromkeys(self.parameters))


def kinds_of(packing: Packing) -> Kinds:
    """Find the kinds of particles: equal particles, or one species if most are different.

    Returns
    -------
    Kinds
        Without labels, with each particle a kind, if there are more than `MOST`.
    """
    rows = np.column_stack([packing.diameters, packing.form])
    rounded = np.round(rows / np.maximum(np.abs(rows).max(axis=0), np.finfo(float).tiny), _DIGITS)
    first, of = np.unique(rounded, axis=0, return_index=True, return_inverse=True)[1:]
    if len(first) > MOST:
        first, of = np.unique(packing.species, return_index=True, return_inverse=True)[1:]
        if not 1 < len(first) <= MOST:
            return Kinds(np.arange(packing.n), [], [])
    size = np.array(
        [packing.diameters[of.ravel() == k].prod(axis=1).mean() for k in range(len(first))]
    )
    place = np.argsort(np.argsort(size, kind="stable"), kind="stable")
    of = place[of.ravel()]
    named = [_named(packing, of == k) for k in range(len(first))]
    return Kinds(of, [parameters for parameters, _ in named], [text for _, text in named])


def _named(packing: Packing, own: BoolArray) -> tuple[str, str]:
    """Return labels of parameters and sizes for the particles of one kind."""
    shape, rows = packing.shape, zip(packing.diameters[own], packing.form[own], strict=True)
    known = [shape.parameters_of(*row) for row in rows]
    sizes = np.array([size for _, size in known])
    low, high = sizes.min(), sizes.max()
    size = f"{low:.3g}" if np.isclose(low, high) else rf"{low:.3g}\dots {high:.3g}"
    parameters = {
        name: value if isinstance(value, str) else float(f"{value:.3g}")
        for name, value in known[0][0].items()
    }
    return shape.label(parameters), f"${shape.unit}={size}$"
