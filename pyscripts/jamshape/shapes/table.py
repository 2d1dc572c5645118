"""The shapes that there are: the only list of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from jamshape.shapes.dimer import Dimer
from jamshape.shapes.shape import Shape
from jamshape.shapes.spherocylinder import Spherocylinder
from jamshape.shapes.superellipsoid import Superellipsoid

if TYPE_CHECKING:
    from jamshape.arrays import FloatArray

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
