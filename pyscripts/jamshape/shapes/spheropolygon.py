"""Rounded polygons: all points within a radius of a convex polygon, in the plane.

Contacts, area and moments: `lammps_plugin/contact/spheropolygon/`.
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
from jamshape.shapes.mesh import SurfaceMesh, arc
from jamshape.shapes.principal import principal, rows_of, text_of
from jamshape.shapes.shape import (
    MOST_NUMBERS,
    ROUND,
    FormedShape,
    Interaction,
    Parameter,
    in_name,
)
from jamshape.shapes.solid import RoundedPolygon

_STRAIGHT = 1e-9  # sine of the angle by which a side turns from the one before
_CORNERS = Range(3, 255, "corners", whole=True)


class Corners(Parameter):
    """The corners of a polygon as text: x y of each, and a slash between two."""

    __slots__ = ()

    def read(self, value: Any) -> str:
        """Return corners, counter-clockwise, of rows, text or the name of a file of rows.

        Raises
        ------
        ValueError
            If they are not the corners of a convex polygon.
        """
        rows = rows_of("corners", value, (2,), "x y of each corner of a convex polygon")
        step = np.roll(rows, -1, axis=0) - rows
        turn = step[:, 0] * np.roll(step[:, 1], -1) - step[:, 1] * np.roll(step[:, 0], -1)
        rows = rows[::-1] if (turn < 0).all() and len(rows) > 2 else rows
        if len(rows) > 1 and not ((turn > 0).all() or (turn < 0).all()):
            _require_corners(rows, step, turn)
        _placed(rows, 1.0)
        return text_of(rows)


def _require_corners(rows: FloatArray, step: FloatArray, turn: FloatArray) -> None:
    """Refuse repeated corners, and those on a line with their neighbours."""
    length = np.linalg.norm(step, axis=1)
    for k in np.flatnonzero(length == 0):
        x, y = rows[k]
        msg = (
            f"corners has {x:g} {y:g} twice in a row, expected each corner once; leave one out, such as the last of"
            " a closed ring"
        )
        raise ValueError(msg)
    is_straight = np.abs(turn) <= _STRAIGHT * length * np.roll(length, -1)
    for k in np.flatnonzero(is_straight) if len(rows) > 2 else ():
        x, y = rows[(k + 1) % len(rows)]
        msg = f"corners has {x:g} {y:g} on a line with its neighbours, expected corners of a convex polygon; leave it out"
        raise ValueError(msg)


def _placed(rows: FloatArray, rounding: float) -> FloatArray:
    """(n, 2) corners about the centre of area and along the principal axes of the rounded body."""
    contact = importlib.import_module("jamshape._contact")

    def moments(corners: FloatArray) -> FloatArray:
        return np.asarray(contact.polygon_moments(rounding, np.ascontiguousarray(corners[:, :2])))

    return principal(np.insert(rows, 2, 0.0, axis=1), moments)[:, :2]


@checked
def regular_polygon(n: int) -> FloatArray:
    """Return the corners of a regular polygon with sides of length 1.

    Parameters
    ----------
    n : int
        Number of corners, from 3 to 255.

    Returns
    -------
    (n, 2) array of float64

    Raises
    ------
    ValueError
        If it is out of this range.

    Examples
    --------
    >>> regular_polygon(4).round(3).tolist()
    [[0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]]
    """
    require_in("n", n, _CORNERS)
    half = np.pi / n
    turns = arc(-half, 2 * np.pi - half, n + 1)[:-1]
    return np.asarray(turns / (2 * np.sin(half)))


_SQUARE = text_of(regular_polygon(4).round(15))
_TRIANGLE = text_of(regular_polygon(3))


class Spheropolygon(FormedShape):
    """Rounded polygons: all points within a radius of a convex polygon, in the plane.

    One corner makes a disc, two a spherocylinder. Two sides in contact have the law of spherocylinders, with one or two
    bonds. Bodies lie with their centre of area at the origin, and their principal axes along x and y.
    """

    name = "spheropolygon"
    families = ("rounded triangles", "rounded quadrangles", "rounded polygons")
    parameters = (
        Corners("corners", _SQUARE, "x y of each corner: rows, text such as '0 0/1 0/0 1', or the name of a file", "corners", None),
        Parameter(
            "rounding", 0.1, "rounding radius, in the unit of the corners", "rounding",
            Range(1e-6, 1e6, "a radius"),
        ),
    )  # fmt: skip
    form_rule = "a rounding radius and x y of the corners"
    dimensions = (2,)
    examples = (
        {"corners": _TRIANGLE, "rounding": 0.4},
        {"corners": _SQUARE, "rounding": 0.3},
        {"corners": "-1.0 -0.3/1.0 -0.3/1.0 0.3/-1.0 0.3", "rounding": 0.2},
        {"corners": "-0.5 0.0/0.5 0.0", "rounding": 0.5},
    )

    def check_form(self, form: FloatArray, dimension: int) -> None:
        """See `Shape.check_form`."""
        if dimension not in self.dimensions:
            msg = (
                f"dimension is {dimension}, expected 2 for spheropolygons, which live in the plane"
            )
            raise ValueError(msg)
        columns = form.shape[1]
        if columns % 2 == 0 or columns > MOST_NUMBERS:
            msg = f"form has {columns} columns, expected a rounding radius and x y of each corner of a spheropolygon"
            raise ValueError(msg)

    def sizes(
        self, parameters: Mapping[str, Any], size: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """See `Shape.sizes`."""
        radii, which = np.unique(parameters["rounding"], return_inverse=True)
        corners = _corners_told(parameters["corners"])
        forms = np.array([np.append(radius, _placed(corners, radius)) for radius in radii])
        extents = np.array([_half_extents(form) for form in forms])
        which = np.broadcast_to(which.reshape(-1), len(size))
        return size[:, None] * (2 * extents[which]), forms[which]

    def parameters_of(
        self, diameters: FloatArray, form: FloatArray
    ) -> tuple[dict[str, Any], float]:
        """See `Shape.parameters_of`."""
        told = {"corners": text_of(_corners(form)), "rounding": float(form[0])}
        return told, float(diameters[0] / (2 * _half_extents(form)[0]))

    def perimeter(self, diameters: FloatArray, form: FloatArray) -> float:
        """See `Shape.perimeter`."""
        rows = _corners(form)
        of_core = np.linalg.norm(np.roll(rows, -1, axis=0) - rows, axis=1).sum()
        scale = diameters[0] / (2 * _half_extents(form)[0])
        return float(scale * (of_core + 2 * np.pi * form[0]))

    def outline(self, diameters: FloatArray, form: FloatArray, points: int = 64) -> FloatArray:
        """See `Shape.outline`."""
        rows, scale = _corners(form), diameters[0] / (2 * _half_extents(form)[0])
        radius, n = scale * form[0], len(rows)
        step = np.roll(rows, -1, axis=0) - rows
        out = np.arctan2(step[:, 1], step[:, 0]) - np.pi / 2  # of the side behind each corner
        turn = np.mod(out - np.roll(out, 1), 2 * np.pi) if n > 1 else np.array([2 * np.pi])
        least = max(2, points // n)
        arcs = [
            scale * at + radius * arc(end - by, end, least)
            for at, end, by in zip(rows, out, turn, strict=True)
        ]
        return np.concatenate(arcs)[: -1 if n == 1 else None]

    def surface(self, diameters: FloatArray, form: FloatArray, level: int = 3) -> SurfaceMesh:
        """See `Shape.surface`: a plate as thick as its shortest diameter, for programs that draw in space."""
        flat = self.outline(diameters, form, 16 * 2**level)
        n, half = len(flat), diameters[2] / 2
        rim = np.concatenate([np.insert(flat, 2, z, axis=1) for z in (-half, half)])
        vertices = np.concatenate([rim, [[0, 0, -half], [0, 0, half]]])
        k = np.arange(n)
        after = (k + 1) % n
        lower = np.column_stack([np.full(n, 2 * n), after, k])
        upper = np.column_stack([np.full(n, 2 * n + 1), n + k, n + after])
        sides = [np.column_stack(three) for three in ((k, after, n + k), (after, n + after, n + k))]
        out = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
        return SurfaceMesh(vertices, np.concatenate([lower, upper, *sides]), out)

    def solid(self, diameters: FloatArray, form: FloatArray) -> RoundedPolygon:
        """See `Shape.solid`."""
        scale = float(diameters[0] / (2 * _half_extents(form)[0]))
        return RoundedPolygon(scale * _corners(form), scale * float(form[0]))

    def style_name(self, law: Interaction) -> str:
        """See `Shape.style_name`; each law of two sides is a setting."""
        return f"{self.name}/harmonic sides {('one', 'two')[law.sides - 1]}"

    def family(self, parameters: Mapping[str, Any], dimension: int) -> str:
        """See `Shape.family`."""
        n = len(_corners_told(parameters["corners"]))
        rounded = (ROUND[dimension], "spherocylinders", *self.families)
        return rounded[min(n, len(rounded)) - 1]

    def label(self, parameters: Mapping[str, Any]) -> str:
        """See `Shape.label`."""
        n = len(_corners_told(parameters["corners"]))
        return f"${n}$ corner{'s' if n > 1 else ''}, rounding ${parameters['rounding']:g}$"

    def stem(self, parameters: Mapping[str, Any]) -> str:
        """See `Shape.stem`."""
        text = parameters["corners"]
        code = hashlib.sha256(text.encode()).hexdigest()[:8]
        n = len(_corners_told(text))
        return f"polygon{n}_{code}_r{in_name(parameters['rounding'])}"


def _corners_told(text: str) -> FloatArray:
    return rows_of("corners", text, (2,), "x y of each corner")


def _corners(form: FloatArray) -> FloatArray:
    """(n, 2) corners in a form, without zeros that fill up arrays."""
    rows = np.asarray(form[1:]).reshape(-1, 2)
    there = np.flatnonzero(rows.any(axis=1))
    return rows[: there[-1] + 1] if len(there) else np.zeros((1, 2))


def _half_extents(form: FloatArray) -> FloatArray:
    """(3,) half lengths of the box around a body of size 1."""
    across = np.abs(_corners(form)).max(axis=0) + form[0]
    return np.append(across, form[0])
