"""Colours of particles by kind, local order or direction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import BoolArray, FloatArray
from jamshape.checks import require_one_of
from jamshape.contacts import Contacts
from jamshape.drawing.kinds import kinds_of
from jamshape.drawing.styles import GREEN, KINDS, RATTLER, RED, YELLOW
from jamshape.measures.local_order import NAMES, local_order
from jamshape.packing import Packing

if TYPE_CHECKING:
    from matplotlib.cm import ScalarMappable

CHOICES = ("kind", "S2", "S4", "C4", "orientation", "one")

NAMED = {"nematic": "S2", "tetratic": "S4", "cubatic": "C4"}
"""Words for the orders."""

ORDER = {
    "S2": r"local nematic order $S_2^\mathrm{loc}$",
    "S4": r"local tetratic order $S_4^\mathrm{loc}$",
    "C4": r"local cubatic order $C_4^\mathrm{loc}$",
}

_UNKNOWN = 0.75  # grey
_LEAST = 0.1  # end of a scale of order
_SMALLEST, _LARGEST = KINDS[0], KINDS[1]
_ALONE = KINDS[1]  # for particles of a single kind


def color_of(word: str) -> str:
    """Return the quantity that a word names, one of `CHOICES`; raises ValueError for others."""
    color = NAMED.get(word, word)
    require_one_of("color", color, (*CHOICES, *NAMED))
    return color


class Coloring(NamedTuple):
    """Colours of the particles of a packing and their meaning."""

    rgb: FloatArray
    """(N, 3)"""
    legend: list[tuple[str, FloatArray]]
    """Names of kinds with their colours."""
    values: FloatArray
    """(N,) local order, NaN without neighbours; empty for other colourings."""


class Scale(NamedTuple):
    """Colours of local order, one scale for all packings of a figure."""

    label: str
    mapped: ScalarMappable

    @classmethod
    def of(cls, name: str, values: FloatArray) -> Scale:
        """Map order up to the largest of these values from green to red."""
        from matplotlib.cm import ScalarMappable  # noqa: PLC0415 - not needed for --help
        from matplotlib.colors import LinearSegmentedColormap, Normalize  # noqa: PLC0415

        colors = LinearSegmentedColormap.from_list("order", [GREEN, YELLOW, RED])
        known = values[np.isfinite(values)]
        end = max(float(known.max(initial=_LEAST)), _LEAST)
        grey = ", grey without contacts" * (len(known) < len(values))
        return cls(ORDER[name] + grey, ScalarMappable(Normalize(0.0, end), colors))

    def rgb(self, values: FloatArray) -> FloatArray:
        """(N, 3) colours, grey where order is undefined."""
        known = np.isfinite(values)
        colors: Any = self.mapped.to_rgba(np.where(known, values, 0.0))
        return np.where(known[:, None], colors[:, :3], _UNKNOWN)


def order_of(found: Contacts, name: str) -> FloatArray:
    """(N,) order around the particles of a packing.

    Raises
    ------
    ValueError
        If the order is undefined in the packing's dimension.
    """
    names = NAMES[found.packing.dimension]
    if name not in names:
        D = found.packing.dimension
        words = {symbol: f"{symbol} ({word})" for word, symbol in NAMED.items()}
        expected = " or ".join(words[symbol] for symbol in names)
        msg = f"particles are in {D}D and coloured by {words[name]}, expected {expected} there"
        raise ValueError(msg)
    return local_order(found.packing, found.network.pairs)[name]


def by_kind(found: Contacts) -> Coloring:
    """Colour by kind; rattlers are grey, unless all are rattlers."""
    return of_kinds(found.packing, found.rattlers)


def of_kinds(packing: Packing, rattlers: BoolArray) -> Coloring:
    """Colour by kind; the (N,) rattlers are grey, unless all are rattlers."""
    from matplotlib.colors import LinearSegmentedColormap, to_rgb  # noqa: PLC0415 - not for --help

    kinds = kinds_of(packing)
    palette = np.array([to_rgb(c) for c in KINDS])
    if len(kinds.labels) == 1:
        palette = np.array([to_rgb(_ALONE)])
    if kinds.labels:
        rgb = palette[kinds.of]
        legend = list(zip(kinds.labels, palette, strict=False))
    else:
        size = np.cbrt(packing.diameters.prod(axis=1))
        place = (size - size.min()) / (np.ptp(size) or 1.0)
        between = LinearSegmentedColormap.from_list("size", [_SMALLEST, _LARGEST])
        rgb, legend = np.asarray(between(place))[:, :3], _ends(size, palette)
    if rattlers.any() and not rattlers.all():
        rgb = np.where(rattlers[:, None], to_rgb(RATTLER), rgb)
        legend.append((f"rattlers ({rattlers.sum()})", np.array(to_rgb(RATTLER))))
    return Coloring(rgb, legend, np.empty(0))


def _ends(size: FloatArray, palette: FloatArray) -> list[tuple[str, FloatArray]]:
    """Label the smallest and the largest of many sizes."""
    texts = (f"smallest: {size.min():.3g} across", f"largest: {size.max():.3g}, {len(size)} sizes")
    return list(zip(texts, palette, strict=False))


def by_direction(packing: Packing) -> Coloring:
    """Colour by direction: in space x, y, z as red, green, blue; in the plane around a circle."""
    directors = packing.directors
    names, marked = ["along x", "along y", "along z"], np.eye(3)
    if packing.dimension == 2:
        names = [f"direction {angle} degrees" for angle in (0, 45, 90, 135)]
        angle = np.pi / 4 * np.arange(4)
        marked = np.column_stack([np.cos(angle), np.sin(angle)])
    known = np.isfinite(directors).all(axis=1, keepdims=True)
    rgb = np.where(known, _hues(directors), _UNKNOWN)
    legend = list(zip(names, _hues(marked), strict=True))
    legend += [("no direction", np.full(3, _UNKNOWN))] * (not known.all())
    return Coloring(rgb, legend, np.empty(0))


def _hues(directors: FloatArray) -> FloatArray:
    """(N, 3) colours of unit vectors of either sign."""
    from matplotlib.colors import hsv_to_rgb  # noqa: PLC0415 - not needed for --help

    if directors.shape[1] == 3:
        return np.asarray(0.1 + 0.85 * np.abs(directors))
    turn = np.arctan2(directors[:, 1], directors[:, 0]) % np.pi / np.pi
    hue = np.where(np.isfinite(turn), turn, 0.0)
    return np.asarray(
        hsv_to_rgb(np.column_stack([hue, np.full_like(hue, 0.55), np.full_like(hue, 0.92)]))
    )


def all_one(packing: Packing, color: str) -> Coloring:
    """Colour all particles alike."""
    from matplotlib.colors import to_rgb  # noqa: PLC0415 - not needed for --help

    return Coloring(np.tile(to_rgb(color), (packing.n, 1)), [], np.empty(0))
