"""The shapes that there are: the only list of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from jamshape.shapes.dimer import Dimer
from jamshape.shapes.shape import Shape
from jamshape.shapes.spherocylinder import Spherocylinder
from jamshape.shapes.superellipsoid import Superellipsoid

if TYPE_CHECKING:
    from jamshape.arrays import FloatArray, IntArray

SHAPES: dict[str, Shape] = {
    shape.name: shape
    for shape in (
        Spherocylinder(),
        Superellipsoid(),
        Dimer(),
    )
}
"""By name; the first is what is meant when nobody says."""

DEFAULT = next(iter(SHAPES))


def shape_named(name: str) -> Shape:
    """Look a shape up.

    Raises
    ------
    ValueError
        If there is none of that name.
    """
    if name not in SHAPES:
        msg = f"shape style is {name!r}, expected one of {', '.join(SHAPES)}"
        raise ValueError(msg)
    return SHAPES[name]


class Fitted(NamedTuple):
    """A shape with the bodies that it fits, their axes named as it names them."""

    name: str
    diameters: FloatArray
    """(N, 3), [length]"""
    first: IntArray
    """(N,) which of the axes that were given is the body's first one."""


def fitted(names: Sequence[str], diameters: FloatArray, dimension: int) -> Fitted:
    """Find the first of some shapes that (N, 3) diameters can be those of, whichever axis is the longest.

    Raises
    ------
    ValueError
        If they are those of none.
    """
    for name in names:
        shape = shape_named(name)
        there, first = shape.placed(diameters, dimension)
        if shape.fits(there):
            return Fitted(name, there, first)
    rules = ", or ".join(f"{shape_named(name).rule()} of a {name}" for name in names)
    msg = f"diameters are such as {diameters[0].tolist()}, expected {rules}"
    raise ValueError(msg)


def guess_shape_style(diameters: FloatArray, *, has_exponent: bool = False) -> str:
    """Name the first shape of the table that (N, 3) diameters without a name can be those of.

    With `has_exponent` it is the first one that has an exponent.

    Several shapes may have the same diameters, so that a reader who knows better must say so.

    Raises
    ------
    ValueError
        If they are those of no shape.
    """
    for name, shape in SHAPES.items():
        if shape.fits(diameters) and shape.has_exponent >= has_exponent:
            return name
    msg = f"diameters such as {diameters[0].tolist()} are those of no shape, expected positive lengths"
    raise ValueError(msg)
