"""Families of shapes with three axes, as in Yuan et al., Soft Matter (2019), Fig. 4, and their marks."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from common.ensembles import is_among
from jamshape.drawing.styles import BLACK, BLUE, GREEN, ORANGE, RED, SKY
from jamshape.files.ensembles import System
from jamshape.files.vocabulary import THERMAL
from jamshape.shapes.shape import Shape
from jamshape.shapes.table import SHAPES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NEEDS = ("exponent", "w1", "w2")
"""Attributes in files of such shapes."""

SPHERES = "spheres"

# Colours distinguishable with any colour vision.
_FAMILIES: dict[str, tuple[str, str]] = {
    SPHERES: ("*", BLACK),
    "oblate ellipsoids": ("s", BLUE),
    "prolate ellipsoids": ("o", RED),
    "self-dual ellipsoids": ("^", GREEN),
    "general ellipsoids": ("v", SKY),
    "superballs": ("D", ORANGE),
    "discs": ("*", BLACK),
}
_IN_PLANE = (
    ("o", RED),
    ("s", BLUE),
    ("D", ORANGE),
    ("P", GREEN),
    ("X", SKY),
    ("d", "#CC79A7"),
    ("H", "#7b8fc7"),
    ("^", "#882255"),
    ("h", "#6B4C9A"),
    ("p", "#8B5A2B"),
)
"""By place among `Shape.families` of all shapes."""

_OF_EXPONENTS = {
    0.75: ("p", "#CC79A7"),
    0.85: ("h", "#882255"),
    1.5: ("<", "#6B4C9A"),
    2.0: (">", "#8B5A2B"),
}
_OTHERS = (
    ("X", BLACK),
    ("P", "#4fa3a5"),
    ("d", "#e07b53"),
    ("H", "#7b8fc7"),
)  # by place in the table


def with_three_axes() -> Shape:
    """Find the shape with an exponent and two axis ratios."""
    names = (tuple(p.name for p in shape.needed) for shape in SHAPES.values())
    return next(shape for shape, own in zip(SHAPES.values(), names, strict=True) if own == NEEDS)


def shape_of(system: System) -> tuple[float, float, float]:
    """p, w1 and w2; NaN if the shape has none."""
    p, w1, w2 = (system.number(name) for name in NEEDS)
    return p, w1, w2


def beta(system: System) -> float:
    """Reduced aspect ratio ac/b^2; NaN if the shape has none."""
    _, w1, w2 = shape_of(system)
    return w1 * w2


def is_axisymmetric(system: System) -> bool:
    """Whether its z_iso is 10, including spheres."""
    p, w1, w2 = shape_of(system)
    return p == 1 and 1 in {w1, w2}


def family(system: System) -> str:
    """Name the family of shapes."""
    shape = SHAPES[system.shape]
    if shape.told(dict(system.parameters)):
        return shape.family(dict(system.parameters), system.dimension)
    return f"{system.shape}s"


def is_thermal(system: System) -> bool:
    """Whether it was made by protocol 2, from thermalised hard particles."""
    return system.protocol == THERMAL


def label(system: System) -> str:
    """Label a system in a legend by p, w1 and w2, or its parameters, and by protocol 2."""
    shape = (
        ", ".join(
            value if isinstance(value, str) else f"{value:g}" for _, value in system.parameters
        )
        or system.kinds
    )
    thermal = f", protocol 2, {system.n_sweeps:g} sweeps"
    law = f", {system.law}" if system.law else ""
    return f"$({shape})$" + thermal * is_thermal(system) + law


def mark(system: System) -> dict[str, Any]:
    """Return the style of points of a system: open for protocol 1, filled for protocol 2."""
    place = list(SHAPES).index(system.shape)
    of_exponent = [
        _OF_EXPONENTS[p] for p in _OF_EXPONENTS if is_among(system.number(NEEDS[0]), [p])
    ]
    others = [*of_exponent, _OTHERS[place % len(_OTHERS)]]
    flat = [name for shape in SHAPES.values() for name in shape.families]
    known = _FAMILIES | dict(zip(flat, _IN_PLANE, strict=False))
    marker, color = known.get(family(system), others[0])
    return {"marker": marker, "color": color, "mfc": color if is_thermal(system) else "none"}


def family_legend(axes: Axes, systems: Iterable[System], title: str, loc: str = "best") -> None:
    """Add a legend of the marks; "outside ..." is beside all axes, with the title above them."""
    from matplotlib.lines import Line2D  # noqa: PLC0415 - not needed for --help and for errors

    handles: dict[str, Line2D] = {}
    for system in systems:
        text = family(system) + ", protocol 2" * is_thermal(system)
        handles.setdefault(text, Line2D([], [], ls="none", ms=6, label=text, **mark(system)))
    known, _ = axes.get_legend_handles_labels()
    every = [*handles.values(), *known]
    outside, figure = loc.startswith("outside"), axes.figure
    where: Any = figure if outside else axes
    where.legend(handles=every, fontsize=8, loc=loc)
    set_title: Any = figure.suptitle if outside else axes.set_title
    set_title(title, fontsize=8)
