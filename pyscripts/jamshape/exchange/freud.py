"""Packings for freud: a box around 0, points in it, orientations, and our contacts as neighbours."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.contacts import ContactNetwork
from jamshape.exchange.fields import centered, in_space
from jamshape.exchange.tools import tool
from jamshape.packing import Packing


class FreudSystem(NamedTuple):
    """Arguments of freud's functions."""

    box: Any
    """`freud.box.Box` around 0, two-dimensional for packings in the plane."""
    points: FloatArray
    """(N, 3) float32 in that box, [length]."""
    orientations: FloatArray
    """(N, 4) float32 quaternions w i j k, in 2D about z."""
    directors: FloatArray
    """(N, 3) float32 unit vectors along `Packing.directors`, as for `freud.order.Nematic`; NaN where
    undefined."""

    @property
    def system(self) -> tuple[Any, FloatArray]:
        """Box and points, the first argument of most of freud's `compute`."""
        return self.box, self.points


def to_freud(packing: Packing) -> FreudSystem:
    """Convert a packing for freud.

    Parameters
    ----------
    packing : Packing

    Returns
    -------
    FreudSystem
        In single precision, as used by freud.

    Raises
    ------
    ImportError
        If freud is not installed.

    Examples
    --------
    >>> from jamshape.exchange.freud import to_freud
    >>> from jamshape.protocols.random_start import random_packing
    >>> there = to_freud(random_packing(n=8, phi=0.3, seed=1))
    >>> there.box.is2D, there.points.shape
    (True, (8, 3))
    """
    freud, seen = tool("freud", "freud-analysis"), centered(packing)
    return FreudSystem(
        box=freud.box.Box(*seen.box, is2D=packing.dimension == 2),
        points=seen.position.astype(np.float32),
        orientations=packing.quaternions.astype(np.float32),
        directors=in_space(packing.directors).astype(np.float32),
    )


def to_neighbors(packing: Packing, network: ContactNetwork) -> Any:
    """Convert contacts for freud, to average over touching particles instead of near ones.

    Parameters
    ----------
    packing : Packing
    network : ContactNetwork
        Its contacts, from `find_contacts`.

    Returns
    -------
    freud.locality.NeighborList
        Each contact twice, once from either particle.

    Raises
    ------
    ImportError
        If freud is not installed.
    """
    freud = tool("freud", "freud-analysis")
    i, j = network.pairs.T
    ways = np.concatenate([np.column_stack([i, j]), np.column_stack([j, i])])
    vectors = in_space(np.concatenate([-network.separation, network.separation]))
    order = np.lexsort(ways.T[::-1])
    first, second = ways[order].T
    return freud.locality.NeighborList.from_arrays(
        packing.n, packing.n, first, second, vectors[order].astype(np.float32)
    )
