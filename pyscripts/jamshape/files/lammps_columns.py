"""Columns and marks that LAMMPS data files and text dumps share, and a frame of either."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.files.meaning import Said, most_digits

TITLE = "LAMMPS data file by jamshape"
EXPONENT_COMMENT = "exponent="
BLOCK_COMMENT = "block="
FORM_COMMENT = "form="
FORM = "# form "  # and its number, a colon and numbers, in one line or several
POSITION = ("x", "y", "z")
# Positions in dumps: wrapped or not, and in units of the box.
POSITIONS = (POSITION, ("xu", "yu", "zu"), ("xs", "ys", "zs"), ("xsu", "ysu", "zsu"))
IMAGE = ("ix", "iy", "iz")
QUATERNION = ("quatw", "quati", "quatj", "quatk")
DIAMETERS = ("shapex", "shapey", "shapez")
EXPONENT = ("exponent",)
ROUNDNESS = ("SuperquadricRoundness.Phi", "SuperquadricRoundness.Theta")  # OVITO's names
WIDTHS = {"diameter": 1.0, "radius": 2.0}  # of discs, over their diameter
PROPERTIES = (*QUATERNION, *DIAMETERS)  # in the order of a compute property/atom of seven
BLOCKS = ("block1", "block2")  # n1 and n2 of atom_style ellipsoid superellipsoid
_COUNTED = 200  # rows from which the number of digits is determined


class Frame(NamedTuple):
    """Columns of N particles, the box, and what the file states about them."""

    columns: Mapping[str, FloatArray]
    """Columns by their names in a dump, each (N,), in the order of the ids."""
    bounds: FloatArray
    """(3, 2) lower and upper ends."""
    tilt: FloatArray
    """(3,) xy, xz, yz."""
    said: Said = Said()
    step: int = 0
    time: float = 0.0
    others: Mapping[str, NDArray[Any]] = {}
    """Columns that are only kept."""
    boundary: str = "pp pp pp"


def whole(column: FloatArray) -> IntArray:
    """Return a column as integers; raise `ValueError` if it holds others."""
    if not (column == np.floor(column)).all():
        msg = "a column of integers holds other numbers, expected whole id, type and image"
        raise ValueError(msg)
    return column.astype(np.int64)


def columns_of(
    rows: Sequence[str], names: Sequence[str], wanted: Sequence[str]
) -> dict[str, FloatArray]:
    """Parse rows with column names; return the wanted columns in the order of the ids."""
    words = [row.split() for row in rows]
    for row in words:
        if len(row) != len(names):
            msg = f"row {' '.join(row)!r} has {len(row)} columns, expected {' '.join(names)!r}"
            raise ValueError(msg)
    picked = [names.index(name) for name in wanted]
    table = np.array([[row[i] for i in picked] for row in words], dtype=np.float64)
    table = table.reshape(len(rows), len(wanted))
    return dict(zip(wanted, table[table[:, wanted.index("id")].argsort()].T, strict=True))


def round_columns(columns: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return diameters and quaternions of discs from a column of their widths."""
    name = next(name for name in WIDTHS if name in columns)
    width = WIDTHS[name] * columns[name]
    if not (width > 0).all():
        msg = f"{name} holds {columns[name].min():g}, expected particles of positive widths, no points"
        raise ValueError(msg)
    zero = np.zeros(len(width))
    quaternion = zip(QUATERNION, (zero + 1, zero, zero, zero), strict=True)
    return dict.fromkeys(DIAMETERS, width) | dict(quaternion)


def digits_of(rows: Sequence[str], names: Sequence[str], place: Sequence[str] = POSITION) -> int:
    """Count the digits of coordinates in the first rows."""
    places = [names.index(name) for name in place]
    return most_digits([row.split()[k] for row in rows[:_COUNTED] for k in places])
