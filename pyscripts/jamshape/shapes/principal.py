"""Bodies given by points, moved to their centre of area and to their principal axes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.shapes.shape import MOST_NUMBERS

_ROUNDING = 1e-9  # relative; off the centre or the principal axes by less is rounding

Moments = Callable[[FloatArray], FloatArray]
"""Integrals (10,) of 1, x, y, z, xx, yy, zz, xy, xz, yz over the body of points (n, 3)."""


class _Frame(NamedTuple):
    centre: FloatArray
    """(3,)"""
    axes: FloatArray
    """(3, 3) principal axes as columns, each near the one that it replaces."""


def is_principal(points: FloatArray, moments: Moments) -> bool:
    """Whether the centre of a body's area (volume) and its principal axes are those of the points."""
    return _frame(points, moments) is None


def principal(points: FloatArray, moments: Moments) -> FloatArray:
    """Move the points (n, 3) of a body to its centre and principal axes, rotated by as little as possible.

    Points that are there are returned unchanged.
    """
    for _ in range(3):  # the second time corrects rounding
        frame = _frame(points, moments)
        if frame is None:
            break
        points = (points - frame.centre) @ frame.axes
    return points


def _frame(points: FloatArray, moments: Moments) -> _Frame | None:
    """Return where a body is; None if that is at 0 along the axes."""
    measure, x, y, z, xx, yy, zz, xy, xz, yz = moments(points)
    centre = np.array([x, y, z]) / measure
    square = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) / measure
    square -= np.outer(centre, centre)
    size = np.sqrt(np.trace(square))
    off = np.abs(square - np.diag(np.diag(square))).max()
    if (np.abs(centre) <= _ROUNDING * size).all() and off <= _ROUNDING * size**2:
        return None
    return _Frame(centre, _nearest_axes(square, 3 if points[:, 2].any() else 2))


def _nearest_axes(square: FloatArray, dimension: int) -> FloatArray:
    found = np.eye(3)
    _, vectors = np.linalg.eigh(square[:dimension, :dimension])
    for k in range(dimension):
        nearest = int(np.abs(vectors[k]).argmax())
        found[:dimension, k] = vectors[:, nearest] * np.sign(vectors[k, nearest])
        vectors[:, nearest] = 0.0
    if np.linalg.det(found) < 0:
        found[:, dimension - 1] *= -1
    return found


def rows_of(name: str, value: Any, widths: tuple[int, ...], expected: str) -> FloatArray:
    """Return rows of numbers, from rows, text with a slash between two, or the name of a file.

    Parameters
    ----------
    name : str
        Their name in messages.
    value : array_like or str
    widths : tuple of int
        Allowed numbers in a row.
    expected : str
        What is expected, in messages.

    Raises
    ------
    ValueError
        If they are not finite numbers, or rows have other lengths.
    """
    given = value
    if isinstance(value, str):
        path = Path(value)
        try:
            lines = path.read_text().splitlines() if path.is_file() else value.split("/")
            plain = [line.partition("#")[0].split() for line in lines]
            given = [[float(word) for word in row] for row in plain if row]
        except (OSError, ValueError):
            given = []
    try:
        rows = np.array(given, np.float64)
    except (TypeError, ValueError):
        rows = np.empty(0)
    is_table = rows.ndim == 2 and rows.shape[1] in widths and 0 < len(rows) <= MOST_NUMBERS
    if not (is_table and np.isfinite(rows).all()):
        found = repr(value) if isinstance(value, str) else f"of shape {rows.shape}"
        msg = f"{name} is {found}, expected {expected}, as rows, as text with a slash between two, or the name of a file"
        raise ValueError(msg)
    return rows


def text_of(rows: FloatArray) -> str:
    """Write rows as text that `rows_of` reads again, to the last bit."""
    return "/".join(" ".join(map(repr, row)) for row in (rows + 0.0).tolist())
