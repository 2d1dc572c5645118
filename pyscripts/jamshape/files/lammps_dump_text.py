"""The text of frames of LAMMPS dumps: items, columns and names of computes."""

from __future__ import annotations

import contextlib
import itertools
import re
from collections.abc import Sequence
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import FloatArray
from jamshape.files.lammps_columns import (
    BLOCKS,
    DIAMETERS,
    EXPONENT,
    IMAGE,
    POSITION,
    POSITIONS,
    PROPERTIES,
    QUATERNION,
    ROUNDNESS,
    WIDTHS,
    Frame,
    columns_of,
    digits_of,
    round_columns,
)
from jamshape.files.meaning import PLANE, Said
from jamshape.packing import Box, Lengths, cuboid_around
from jamshape.packing.columns import joined

# Names of computes of several columns, with the columns.
_COMPUTES = {
    **dict.fromkeys(("q", "quat", "quaternion", "orient", "orientation", "body"), PROPERTIES),
    **dict.fromkeys(("shape", "diameter", "diameters"), DIAMETERS),
}
_DUMP_COLUMNS = ("id", "type", *POSITION, *QUATERNION, *DIAMETERS)
_BOUNDARY = re.compile(r"(xy xz yz )?(pp|[fsm]{2})( (pp|[fsm]{2})){2}")
# TIMESTEP precedes TIME, which is its prefix.
_ITEM_ROWS = {"UNITS": 1, "TIMESTEP": 1, "TIME": 1, "NUMBER OF ATOMS": 1, "BOX BOUNDS": 3}


def dump_frame(lines: TextIO, *, is_first: bool) -> Frame:
    """Parse a frame; raise `ValueError` if it is incomplete. The first frame of a dump also states the digits of its coordinates."""
    items: dict[str, list[str]] = {}
    title = lines.readline()
    while not title.startswith("ITEM: ATOMS "):
        keyword = next((k for k in _ITEM_ROWS if title.startswith(f"ITEM: {k}")), None)
        if keyword is None:
            msg = f"a line reads {title.strip()!r}, expected an 'ITEM:' line of an atom dump"
            raise ValueError(msg)
        arguments = title.removeprefix(f"ITEM: {keyword}").strip()
        items[keyword] = [arguments, *_take(lines, _ITEM_ROWS[keyword])]
        (title,) = _take(lines, 1)
    missing = {"TIMESTEP", "NUMBER OF ATOMS", "BOX BOUNDS"} - items.keys()
    if missing:
        msg = f"items {sorted(missing)} are missing before the atoms, expected an atom dump"
        raise ValueError(msg)
    rows = _take(lines, int(items["NUMBER OF ATOMS"][1]))
    if rest := lines.readline().strip():
        msg = f"a line reads {rest!r}, expected an 'ITEM:' line of an atom dump"
        raise ValueError(msg)
    box = _dump_bounds(items["BOX BOUNDS"])
    names, rows = _with_z(_plain_names(title.split()[2:]), rows, box[0])
    columns, others = _dump_columns(names, rows)
    place = next(names for names in POSITIONS if set(names) <= set(columns))
    said = Said(is_later=True)
    if is_first:
        said = Said(digits=digits_of(rows, names, place), is_scaled=place in POSITIONS[2:])
    step, time = int(items["TIMESTEP"][1]), float(items.get("TIME", ["", "0"])[1])
    boundary = items["BOX BOUNDS"][0]
    return Frame(_placed(columns, place, box), *box, said, step, time, joined(others), boundary)


def _with_z(names: list[str], rows: list[str], bounds: FloatArray) -> tuple[list[str], list[str]]:
    """Add z = 0 and its image where a dump of a box in the plane leaves them out."""
    known = set(names)
    if (bounds[2] != PLANE).any() or any(set(place) <= known for place in POSITIONS):
        return names, rows
    flat = [
        place for place in (*POSITIONS, IMAGE) if {*place[:2]} <= known and place[2] not in known
    ]
    values = "".join(" 0.5" if place in POSITIONS[2:] else " 0" for place in flat)
    return [*names, *(place[2] for place in flat)], [f"{row.rstrip()}{values}" for row in rows]


def _placed(
    columns: dict[str, FloatArray], place: Sequence[str], box: tuple[FloatArray, FloatArray]
) -> dict[str, FloatArray]:
    """Return columns with positions ``x y z`` from the columns `place`, and images if these are unwrapped."""
    if place == POSITION:
        return columns
    bounds, tilt = box
    of = Box(bounds[:, 0], bounds[:, 1] - bounds[:, 0], tilt)
    position = np.column_stack([columns[name] for name in place])
    position = of.lo + of.vectors(position) if place in POSITIONS[2:] else position
    found = dict(columns)
    if place in POSITIONS[1::2]:
        _, image = of.wrapped(position)
        position = np.where(
            image.any(axis=1, keepdims=True), position - of.vectors(image), position
        )
        found |= dict(zip(IMAGE, image.T.astype(np.float64), strict=True))
    return found | dict(zip(POSITION, position.T, strict=True))


def _plain_names(columns: Sequence[str]) -> list[str]:
    """Replace names of computes, the only possible ones before ``dump_modify colname``: `quatw` for `c_quatw` or `c_q[1]`."""
    found = []
    for column in columns:
        name, _, number = column.removeprefix(column[:2]).removesuffix("]").partition("[")
        of = _COMPUTES.get(name, ())
        is_ours = column[:2] in {"c_", "f_", "v_"}
        if is_ours and number.isdecimal() and 0 < int(number) <= len(of):
            name = of[int(number) - 1]
        is_known = (
            not number and name in (*PROPERTIES, *EXPONENT, *BLOCKS, *WIDTHS)
        ) or name in PROPERTIES
        found.append(name if is_ours and is_known else column)
    return found


def _take(lines: TextIO, n: int) -> list[str]:
    rows = list(itertools.islice(lines, n))
    if len(rows) < n or not all(row.endswith("\n") for row in rows):
        msg = "the file ends within the frame, expected a complete one; remove the frame"
        raise ValueError(msg)
    return rows


def _dump_columns(
    names: Sequence[str], rows: Sequence[str]
) -> tuple[dict[str, FloatArray], dict[str, NDArray[Any]]]:
    """Parse the columns of a frame: those known here, and others."""
    place = next((own for own in POSITIONS if set(own) <= set(names)), POSITION)
    needed = ["id", "type", *place]
    if not set(WIDTHS) & set(names) or set(PROPERTIES) & set(names):
        needed += PROPERTIES
    missing = [name for name in needed if name not in names]
    if missing:
        msg = (
            f"columns {' '.join(missing)!r} are missing, expected {' '.join(_DUMP_COLUMNS)!r}, or such as"
            " c_q[1] to c_q[4] and c_shape[1] to c_shape[3]"
        )
        raise ValueError(msg)
    widths = () if "shapex" in needed else WIDTHS
    optional = (*IMAGE, *EXPONENT, *BLOCKS, *ROUNDNESS, *widths)
    known = columns_of(rows, names, [*needed, *(name for name in optional if name in names)])
    if "shapex" not in known:
        known |= round_columns(known)
    return known, _others(rows, names, set(known))


def _others(rows: Sequence[str], names: Sequence[str], known: set[str]) -> dict[str, NDArray[Any]]:
    """Parse columns of whole numbers, numbers or texts, in the order of the ids."""
    places = [k for k, name in enumerate(names) if name not in known]
    if not places:
        return {}
    words = [row.split() for row in rows]
    order = np.argsort(np.array([int(row[names.index("id")]) for row in words]))
    found: dict[str, NDArray[Any]] = {}
    for k in places:
        column = np.array([row[k] for row in words])[order]
        for kind in (np.int64, np.float64):
            with contextlib.suppress(ValueError, OverflowError):
                column = column.astype(kind)
                break
        found[names[k]] = column
    return found


def _dump_bounds(item: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    boundary, *rows = item
    if not _BOUNDARY.fullmatch(boundary):
        msg = (
            f"box bounds are {boundary!r}, expected 'pp pp pp' or 'xy xz yz pp pp pp'; write the dump with"
            " dump_modify triclinic/general no"
        )
        raise ValueError(msg)
    is_tilted = boundary.startswith("xy")
    columns = np.array([row.split() for row in rows], dtype=np.float64)
    if columns.shape != (3, 2 + is_tilted):
        msg = f"box bounds {boundary!r} have rows of {columns.shape[1]} numbers, expected {2 + is_tilted}"
        raise ValueError(msg)
    if not is_tilted:
        return columns, np.zeros(3)
    # LAMMPS writes the bounds of the surrounding cuboid.
    around, tilt = columns[:, :2], columns[:, 2]
    return around - np.transpose(cuboid_around(Lengths(np.zeros(3), tilt).matrix)), tilt
