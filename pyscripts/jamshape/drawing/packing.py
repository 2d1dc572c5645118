"""Pictures of packings of any shape, in the plane and in space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.contacts import Contacts
from jamshape.drawing import plane, space
from jamshape.drawing.colors import ORDER, Coloring, Scale, all_one, by_direction, by_kind, order_of
from jamshape.drawing.styles import KINDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

MANY = 250  # number of particles in space above which meshes are coarser


class Look(NamedTuple):
    """Settings of pictures of packings."""

    color: str = "kind"
    """One of `jamshape.drawing.colors.CHOICES`."""
    height: float = 22.0
    """Elevation of the view in space, degrees."""
    turn: float = -58.0
    """Azimuth of the view about z, degrees."""
    level: int = 0
    """Refinement of meshes in space, with four times as many triangles per level; 0 adapts to N."""


def colorings(found: Sequence[Contacts], color: str) -> tuple[list[Coloring], Scale | None]:
    """Colour the particles of packings, with a common scale of local order.

    Raises
    ------
    ValueError
        If the order is undefined in a packing's dimension.
    """
    if color in ORDER:
        values = [order_of(one, color) for one in found]
        scale = Scale.of(color, np.concatenate(values))
        return [Coloring(scale.rgb(v), [], v) for v in values], scale
    if color == "orientation":
        return [by_direction(one.packing) for one in found], None
    if color == "one":
        return [all_one(one.packing, KINDS[k % len(KINDS)]) for k, one in enumerate(found)], None
    return [by_kind(one) for one in found], None


def draw_packing(axes: Axes, found: Contacts, colored: Coloring, look: Look | None = None) -> None:
    """Draw a packing in its box; in the plane with spines and points of contact.

    Parameters
    ----------
    axes : Axes
        Axes of a figure of final size: lines are thin where particles are small.
    found : Contacts
    colored : Coloring
        Result of `colorings`.
    look : Look
    """
    look, packing = look or Look(), found.packing
    if packing.dimension == 3:
        level = look.level or (3 if packing.n < MANY else 2)
        space.draw_bodies(axes, packing, colored.rgb, (space.view(look.height, look.turn), level))
        return
    shown = shown_at(axes, found)
    style = {"facecolors": colored.rgb, "edgecolors": "k", "lw": shown.line}
    plane.draw_bodies(axes, packing, packing.box, **style)
    plane.draw_spines(axes, packing, 1.5 * shown.line)
    plane.draw_contacts(axes, packing, found.network, shown.dot)
    plane.show_box(axes, packing.box)


def shown_at(axes: Axes, found: Contacts) -> plane.Shown:
    """Return the thickness of lines for a packing that fills the axes."""
    low, high = found.packing.box.bounds
    inch = float(((high - low) / inches_of(axes)).max())
    return plane.Shown(inch, float(found.packing.diameters[:, :2].min()))


def inches_of(axes: Axes) -> FloatArray:
    """Width and height of axes."""
    figure: Any = axes.figure
    return np.asarray(axes.get_position().size * figure.get_size_inches())


def add_legend(axes: Axes, colored: Coloring) -> None:
    """Add a legend below a picture, for its lines and dots, and its colours except those of a scale."""
    from matplotlib.patches import Patch  # noqa: PLC0415 - not needed for --help

    handles: list[Any] = [Patch(fc=rgb, ec="k", lw=0.5, label=text) for text, rgb in colored.legend]
    handles += axes.get_legend_handles_labels()[0]
    if not handles:
        return
    # A character is about 0.055 inch wide, and TeX source is longer than its output.
    longest = 0.04 * max(len(handle.get_label()) for handle in handles) + 0.6
    columns = max(1, min(len(handles), int(inches_of(axes)[0] / longest)))
    place: dict[str, Any] = {
        "loc": "upper center",
        "bbox_to_anchor": (0.5, 0.0),
        "borderaxespad": 0.3,
    }
    axes.legend(handles=handles, ncols=columns, fontsize=7, frameon=False, **place)
