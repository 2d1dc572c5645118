"""Constructors of particles by shape: ``Spherocylinders(alpha=4)``.

Each takes numbers, or arrays with an entry for each kind of a mixture. `Particles.given` takes individual
particles.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arguments import checked
from jamshape.arrays import real_numbers
from jamshape.shapes.particles import Kind, Particles


@checked
def Spherocylinders(
    alpha: ArrayLike = 4.0, size_ratio: float | None = None, **kinds: ArrayLike
) -> Particles:
    """Spherocylinders: segments of length 2A thickened by the radius R (Marschall & Teitel 2018).

    Parameters
    ----------
    alpha : float or (k,) array
        Aspect ratio A/R; 0 for discs, or spheres. An array makes a mixture of k kinds.
    size_ratio : float, optional
        Size ratio of big and small particles, mixed 1:1, with one aspect ratio; 1.4 as in the paper
        by default, 1 for equal particles.
    **kinds : float or (k,) array
        ``size``, R of each kind over the unit of length 1/2 (1); ``share``, number fraction of the kind
        up to normalisation (1); ``spread``, standard deviation of the logarithm of the
        size (0). These exclude `size_ratio`.

    Returns
    -------
    Particles

    Raises
    ------
    ValueError
        If a number is out of its range, or arrays differ in length.

    Examples
    --------
    >>> import jamshape as js
    >>> js.Spherocylinders(alpha=4)
    Particles('spherocylinder', alpha=4, size_ratio=1.4)
    >>> discs_among_rods = js.Spherocylinders(alpha=[0, 4], size=[1, 1.4], share=[3, 1])
    >>> discs_among_rods.told["kinds"]
    'alpha=0.0,size=1.0,share=3.0,spread=0.0; alpha=4.0,size=1.4,share=1.0,spread=0.0'
    """
    return _particles("spherocylinder", {"alpha": alpha}, size_ratio, kinds)


@checked
def Superellipsoids(
    p: ArrayLike = 1.0,
    w1: ArrayLike = 1.0,
    w2: ArrayLike = 1.0,
    size_ratio: float | None = None,
    **kinds: ArrayLike,
) -> Particles:
    """Superellipsoids ``|x/a|^2p + |y/b|^2p + |z/c|^2p = 1`` (Yuan et al. 2019, Eqs. 1 and 2).

    Parameters
    ----------
    p : float or (k,) array
        Exponent, above 1/2: 1 for ellipsoids, larger towards boxes, smaller towards octahedra. An array
        makes a mixture of k kinds.
    w1, w2 : float or (k,) array
        Ratios a/b, at most 1, and c/b, at least 1, of the semi-axes.
    size_ratio : float, optional
        Size ratio of big and small particles, mixed 1:1; 1, equal particles, by default.
    **kinds : float or (k,) array
        See `Spherocylinders`; the unit of length is the shortest semi-axis.

    Returns
    -------
    Particles

    Raises
    ------
    ValueError
        If a number is out of its range, or arrays differ in length.

    Examples
    --------
    >>> import jamshape as js
    >>> js.Superellipsoids(p=1.5)
    Particles('superellipsoid', exponent=1.5, w1=1, w2=1)
    """
    return _particles("superellipsoid", {"p": p, "w1": w1, "w2": w2}, size_ratio, kinds)


@checked
def Dimers(
    alpha: ArrayLike = 1.0, size_ratio: float | None = None, **kinds: ArrayLike
) -> Particles:
    """Dimers: two equal discs (spheres) of radius R joined rigidly, centres A from the middle.

    Parameters
    ----------
    alpha : float or (k,) array
        A/R, above 0; the discs just touch at 1. An array makes a mixture of k kinds.
    size_ratio : float, optional
        Size ratio of big and small particles, mixed 1:1; 1.4 by default, 1 for equal particles.
    **kinds : float or (k,) array
        See `Spherocylinders`.

    Returns
    -------
    Particles

    Raises
    ------
    ValueError
        If a number is out of its range, or arrays differ in length.

    Examples
    --------
    >>> import jamshape as js
    >>> js.Dimers(alpha=0.5, size_ratio=1)
    Particles('dimer', alpha=0.5, size_ratio=1)
    """
    return _particles("dimer", {"alpha": alpha}, size_ratio, kinds)


_OF_KINDS = ("size", "share", "spread")


def _particles(
    shape: str,
    parameters: Mapping[str, ArrayLike],
    size_ratio: float | None,
    kinds: Mapping[str, ArrayLike],
) -> Particles:
    """Make particles from numbers, or kinds from arrays."""
    for name in kinds:
        if name not in _OF_KINDS:
            msg = f"{name} is unknown for {shape}s, expected {', '.join((*parameters, 'size_ratio', *_OF_KINDS))}"
            raise ValueError(msg)
    values = {name: real_numbers(name, value) for name, value in {**parameters, **kinds}.items()}
    if not kinds and all(np.ndim(value) == 0 for value in values.values()):
        numbers = {name: float(value) for name, value in values.items()}
        return Particles.of(shape, size_ratio, **numbers)
    if size_ratio is not None:
        msg = "size_ratio does not work with kinds, expected the size of each kind in size alone"
        raise ValueError(msg)
    try:
        columns = np.broadcast_arrays(
            *(np.atleast_1d(v).astype(np.float64) for v in values.values())
        )
    except ValueError:
        lengths = {name: np.size(value) for name, value in values.items()}
        msg = f"arrays have lengths {lengths}, expected one entry for each kind"
        raise ValueError(msg) from None
    rows = [dict(zip(values, row, strict=True)) for row in np.column_stack(columns).tolist()]
    own = [{name: row.pop(name) for name in kinds} for row in rows]
    return Particles.mixture(shape, [Kind(row, **k) for row, k in zip(rows, own, strict=True)])
