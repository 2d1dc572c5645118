"""Clumps: rigid unions of discs (balls in 3D) of any radii at any places.

Contacts, area and moments: `lammps_plugin/contact/clump/`.
"""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from jamshape.arguments import checked
from jamshape.arrays import FloatArray
from jamshape.checks import Range, require_in
from jamshape.shapes.level_set import level_set_mesh
from jamshape.shapes.mesh import SurfaceMesh, arc
from jamshape.shapes.principal import Moments, is_principal, principal, rows_of, text_of
from jamshape.shapes.shape import MOST_NUMBERS, ROUND, FormedShape, Parameter
from jamshape.shapes.solid import Balls

_WIDTH = 4  # numbers of a disc: x y z r
_RATIO = Range(1e-6, 1e6, "a ratio")
_DISTANCE = Range(0.0, 1e6, "a distance")
_ANGLE = Range(0.0, 180.0, "an angle in degrees")
_POINT = 1e-9  # radians; where three circles meet, rounding leaves arcs that have no direction


class Discs(Parameter):
    """The discs of a clump as text: x y z r of each, and a slash between two."""

    __slots__ = ()

    def read(self, value: Any) -> str:
        """Return discs about their centre of area, or balls about that of volume, along principal axes.

        Rows x y r are discs in the plane; rows x y z r are balls, unless they lie as discs already.

        Raises
        ------
        ValueError
            If they are not discs.
        """
        rows = _rows(value)
        if rows.shape[1] == _WIDTH:
            placed = _place(rows[:, :3], rows[:, 3])
        else:
            placed = principal(np.insert(rows[:, :2], 2, 0.0, axis=1), _moments(rows[:, 2], 2))
        return text_of(np.column_stack([placed, rows[:, -1]]))


def _place(centres: FloatArray, radii: FloatArray) -> FloatArray:
    is_flat = not centres[:, 2].any() and is_principal(centres, _moments(radii, 2))
    return centres if is_flat else principal(centres, _moments(radii, 3))


def _moments(radii: FloatArray, dimension: int) -> Moments:
    contact = importlib.import_module("jamshape._contact")
    return lambda centres: np.asarray(
        contact.union_moments(np.column_stack([centres, radii]), dimension)
    )


def _rows(value: Any) -> FloatArray:
    """Return rows of discs, or raise a ValueError."""
    expected = "x y r of each disc, or x y z r, with positive radii and at most 255 of them"
    rows = rows_of("discs", value, (_WIDTH - 1, _WIDTH), expected)
    if not (rows[:, -1] > 0).all() or len(rows) >= MOST_NUMBERS // _WIDTH:
        msg = f"discs has {len(rows)} rows with radii from {rows[:, -1].min():g} on, expected {expected}"
        raise ValueError(msg)
    return rows


def _discs(form: FloatArray) -> FloatArray:
    """Return the discs (n, 4) of a form (4 n,), without zeros that fill up arrays."""
    rows = np.asarray(form).reshape(-1, _WIDTH)
    return rows[rows[:, -1] > 0]


def _half_extents(rows: FloatArray) -> FloatArray:
    """(3,) half lengths of the box around discs, as balls."""
    found: FloatArray = (np.abs(rows[:, :3]) + rows[:, 3:]).max(axis=0)
    return found


# Three touching discs of diameter 1.
_TRIMER = text_of(np.array([[2, 0, 0, 0], [-1, 3**0.5, 0, 0], [-1, -(3**0.5), 0, 0]]) / 12**0.5 + [0, 0, 0, 0.5])  # fmt: skip


class Clump(FormedShape):
    """Clumps: rigid unions of discs (balls in 3D) of any radii at any places, overlapping or apart.

    Every pair of discs has the harmonic law of the overlap 1 - r/d. Bodies lie with their centre of area (volume) at the
    origin, and their principal axes along x, y and z.
    """

    name = "clump"
    families = ("asymmetric dimers", "dumbbells", "clumps")
    parameters = (
        Discs("discs", _TRIMER, "x y r of each disc, or x y z r of each ball: rows, text such as '0 0 1/1 0 0.5', or the name of a file", "discs", None),
    )  # fmt: skip
    form_rule = "x y z r of the discs"
    examples = (
        {"discs": _TRIMER},
        {"discs": text_of(np.array([[-0.35, 0, 0, 0.5], [0.35, 0, 0, 0.5]]))},
        {"discs": text_of(np.array([[x, y, 0, 0.45] for x in (-0.4, 0.4) for y in (-0.3, 0.3)]))},
    )

    def check_form(self, form: FloatArray, dimension: int) -> None:
        """See `Shape.check_form`."""
        columns = form.shape[1]
        if columns % _WIDTH or not 0 < columns < MOST_NUMBERS:
            msg = f"form has {columns} columns, expected x y z r of each disc of a clump"
            raise ValueError(msg)
        if dimension == 2 and form[:, 2::_WIDTH].any():
            msg = (
                "form of a clump in the plane has discs off z = 0, expected all at 0; give rows x y r of discs in the"
                " plane, since rows x y z r are balls, or make a packing of dimension 3"
            )
            raise ValueError(msg)

    def sizes(
        self, parameters: Mapping[str, Any], size: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """See `Shape.sizes`."""
        rows = _rows(parameters["discs"])
        extents = 2 * _half_extents(rows)
        return size[:, None] * extents, np.tile(rows.ravel(), (len(size), 1))

    def parameters_of(
        self, diameters: FloatArray, form: FloatArray
    ) -> tuple[dict[str, Any], float]:
        """See `Shape.parameters_of`."""
        rows = _discs(form)
        return {"discs": text_of(rows)}, float(diameters[0] / (2 * _half_extents(rows)[0]))

    def perimeter(self, diameters: FloatArray, form: FloatArray) -> float:
        """See `Shape.perimeter`."""
        contact = importlib.import_module("jamshape._contact")
        rows = self._placed_discs(diameters, form)
        which, begin, end = contact.boundary_arcs(rows).T
        return float((rows[which.astype(int), 3] * (end - begin)).sum())

    def outline(self, diameters: FloatArray, form: FloatArray, points: int = 64) -> FloatArray:
        """See `Shape.outline`: closed curves of arcs, joined by a line there and back where there are several."""
        contact = importlib.import_module("jamshape._contact")
        rows = self._placed_discs(diameters, form)
        arcs = contact.boundary_arcs(rows)
        arcs = arcs[arcs[:, 2] - arcs[:, 1] > _POINT]
        least = max(8, points // len(arcs))
        pieces = [
            rows[int(k), :2] + rows[int(k), 3] * arc(begin, end, least) for k, begin, end in arcs
        ]
        return _joined(pieces)

    def surface(self, diameters: FloatArray, form: FloatArray, level: int = 3) -> SurfaceMesh:
        """See `Shape.surface`."""
        rows = self._placed_discs(diameters, form)

        def height(points: FloatArray) -> FloatArray:
            found: FloatArray = (
                np.linalg.norm(points[:, None] - rows[:, :3], axis=2) - rows[:, 3]
            ).min(axis=1)
            return found

        return level_set_mesh(height, (np.abs(rows[:, :3]) + rows[:, 3:]).max(axis=0), level)

    def solid(self, diameters: FloatArray, form: FloatArray) -> Balls:
        """See `Shape.solid`."""
        rows = self._placed_discs(diameters, form)
        return Balls(rows[:, :3], rows[:, 3])

    def family(self, parameters: Mapping[str, Any], dimension: int) -> str:
        """See `Shape.family`."""
        rows = _rows(parameters["discs"])
        radii = rows[:, -1]
        if len(rows) == 1:
            return ROUND[dimension]
        of_two, apart, others = self.families
        if len(rows) > 2:
            return others
        is_apart = np.linalg.norm(rows[1, :-1] - rows[0, :-1]) > radii.sum()
        return apart if is_apart else "dimers" if radii[0] == radii[1] else of_two

    def label(self, parameters: Mapping[str, Any]) -> str:
        """See `Shape.label`."""
        n = len(_rows(parameters["discs"]))
        return f"${n}$ disc{'s' if n > 1 else ''}"

    def stem(self, parameters: Mapping[str, Any]) -> str:
        """See `Shape.stem`."""
        text = parameters["discs"]
        return f"clump{len(_rows(text))}_{hashlib.sha256(text.encode()).hexdigest()[:8]}"

    def _placed_discs(self, diameters: FloatArray, form: FloatArray) -> FloatArray:
        """(n, 4) discs of a particle in its own coordinates, [length]."""
        rows = _discs(form)
        return np.asarray(rows * (diameters[0] / (2 * _half_extents(rows)[0])))


def _joined(pieces: list[FloatArray]) -> FloatArray:
    """Link arcs, each of which begins where another one ends, to closed curves, and these to one."""
    ends = np.array([piece[-1] for piece in pieces])
    begins = np.array([piece[0] for piece in pieces])
    left, curves = set(range(len(pieces))), []
    while left:
        at = min(left)
        curve = []
        while at in left:
            left.remove(at)
            curve.append(pieces[at][:-1])
            away = np.linalg.norm(begins - ends[at], axis=1)
            at = int(away.argmin())
        curves.append(np.concatenate(curve))
    joined = curves[0]
    for other in curves[1:]:
        away = np.linalg.norm(joined[:, None] - other, axis=2)
        at, begin = np.unravel_index(away.argmin(), away.shape)
        around = np.roll(other, -begin, axis=0)
        joined = np.concatenate([joined[: at + 1], around, around[:1], joined[at:]])
    return joined


@checked
def dimer_discs(ratio: float = 1.0, distance: float = 1.0) -> FloatArray:
    """Return the discs of a dimer, the first of diameter 1.

    Parameters
    ----------
    ratio : float
        Diameter of the second disc over that of the first.
    distance : float
        Between their centres, over the mean of their diameters: 1 where they just touch.

    Returns
    -------
    (2, 3) array of float64
        x y r.

    Raises
    ------
    ValueError
        If the ratio is not positive, or the distance is negative.

    Examples
    --------
    >>> dimer_discs(0.5).tolist()
    [[0.0, 0.0, 0.5], [0.75, 0.0, 0.25]]
    """
    require_in("ratio", ratio, _RATIO)
    require_in("distance", distance, _DISTANCE)
    return np.array([[0.0, 0.0, 0.5], [distance * (1 + ratio) / 2, 0.0, ratio / 2]])


@checked
def trimer_discs(angle: float = 60.0) -> FloatArray:
    """Return three discs of diameter 1, the outer two touching the middle one, at an angle between them.

    Parameters
    ----------
    angle : float, [degree]
        60 for an equilateral triangle, 180 for a row.

    Returns
    -------
    (3, 3) array of float64
        x y r.

    Raises
    ------
    ValueError
        If the angle is not from 0 to 180.

    Examples
    --------
    >>> trimer_discs(180)[:, 0].round(6).tolist()
    [0.0, -1.0, 1.0]
    """
    require_in("angle", angle, _ANGLE)
    half = np.deg2rad(angle) / 2
    x, y = np.sin(half), np.cos(half)
    return np.array([[0.0, 0.0, 0.5], [-x, -y, 0.5], [x, -y, 0.5]])


@checked
def bumpy_discs(bumps: int = 12, depth: float = 0.2) -> FloatArray:
    """Return a ring of equal discs around a large one: a disc of diameter 1 with a rough surface (Papanikolaou et al. 2013).

    Parameters
    ----------
    bumps : int
        Number of discs on the rim.
    depth : float
        Depth of the notches between them over their radius: 0 is smooth; 1 where neighbours just touch.

    Returns
    -------
    (bumps + 1, 3) array of float64
        x y r, the large disc, which fills the middle, first.

    Raises
    ------
    ValueError
        If there are fewer than 3 bumps, or the depth is not above 0 and at most 1.

    Examples
    --------
    >>> rows = bumpy_discs(8, 0.3)
    >>> float((rows[1:, 0] + rows[1:, 2]).max())
    0.5
    """
    if bumps < 3 or not 0 < depth <= 1:
        msg = f"bumpy_discs has bumps={bumps} and depth={depth}, expected at least 3 and a depth above 0, up to 1"
        raise ValueError(msg)
    half = np.pi / bumps
    # Bumps of radius r at distance 1/2 - r overlap so that notches are depth r below their tops.
    gap = np.sqrt(1 - (1 - depth) ** 2)  # half the distance of neighbours over r
    r = 0.5 * np.sin(half) / (gap + np.sin(half))
    at = arc(0.0, 2 * np.pi, bumps + 1)[:-1] * (0.5 - r)
    inner = (0.5 - r) * np.cos(half) + r * (1 - depth)
    rim = np.column_stack([at, np.full(bumps, r)])
    return np.concatenate([[[0.0, 0.0, inner]], rim])
