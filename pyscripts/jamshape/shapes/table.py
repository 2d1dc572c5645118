"""The only list of shapes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from jamshape.shapes.clump import Clump
from jamshape.shapes.dimer import Dimer
from jamshape.shapes.shape import Shape
from jamshape.shapes.spherocylinder import Spherocylinder
from jamshape.shapes.spheropolygon import Spheropolygon
from jamshape.shapes.superellipsoid import Superellipsoid

if TYPE_CHECKING:
    from jamshape.arrays import FloatArray, IntArray

SHAPES: dict[str, Shape] = {
    shape.name: shape
    for shape in (
        Spherocylinder(),
        Superellipsoid(),
        Dimer(),
        Clump(),
        Spheropolygon(),
    )
}
"""Shapes by name; the first is the default."""

DEFAULT = next(iter(SHAPES))


def shape_named(name: str) -> Shape:
    """Return the shape of a name.

    Raises
    ------
    ValueError
        If the name is unknown.
    """
    if name not in SHAPES:
        msg = f"shape style is {name!r}, expected one of {', '.join(SHAPES)}"
        raise ValueError(msg)
    return SHAPES[name]


class Fitted(NamedTuple):
    """A shape and bodies that fit it, with axes in its order."""

    name: str
    diameters: FloatArray
    """(N, 3), [length]"""
    first: IntArray
    """(N,) index of the given axis that is the body's first one."""


def fitted(names: Sequence[str], diameters: FloatArray, dimension: int) -> Fitted:
    """Find the first of some shapes that fits (N, 3) diameters, whichever axis is the longest.

    Raises
    ------
    ValueError
        If none of them fits.
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
    """Name the first shape of the table that fits (N, 3) diameters.

    With `has_exponent`, the first one that has an exponent.

    Several shapes may have the same diameters, so callers with better knowledge must name the shape.

    Raises
    ------
    ValueError
        If no shape fits.
    """
    for name, shape in SHAPES.items():
        if shape.fits(diameters) and shape.has_exponent >= has_exponent and not shape.has_form:
            return name
    msg = f"diameters such as {diameters[0].tolist()} fit no shape, expected positive lengths"
    raise ValueError(msg)
