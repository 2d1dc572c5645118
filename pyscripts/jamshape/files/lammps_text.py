"""LAMMPS data files and text dumps of ellipsoids.

Numbers are written with 17 significant digits and read back to the last bit. Two numbers of a
`Packing` are not among those of the files and may change in the last bit: an angle in 2D, which
goes through its quaternion, and an edge of the box, which goes through its upper end (and is
exact where the lower corner is 0 or half an edge below it). Dumps of a box with a tilt tell the bounds of
the cuboid around it, from which its own are found with as much rounding.

Neither format names the shape style: the first shape of `jamshape.shapes.table` that can have such
diameters, and an exponent where the file tells one, is taken; use ``packing.with_(shape_style=...)`` for
another one.

Dumps tell the exponent p twice: in a column ``exponent``, to all digits, and as 1/p in
``SuperquadricRoundness.Phi`` and ``.Theta``, which OVITO draws the bodies from. Data files tell none.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np

from jamshape.arrays import FloatArray, IntArray
from jamshape.files.h5md import FileFormatError, PathLike, read_packing, replacing
from jamshape.files.signature import DUMP, HDF5, format_of
from jamshape.packing import Box, Lengths, Packing, angle_from_quaternion, cuboid_around
from jamshape.shapes.table import guess_shape_style

_PLANE = (-0.5, 0.5)  # extent in z of a two-dimensional file
_POSITION = ("x", "y", "z")
_IMAGE = ("ix", "iy", "iz")
_QUATERNION = ("quatw", "quati", "quatj", "quatk")
_DIAMETERS = ("shapex", "shapey", "shapez")
_EXPONENT = ("exponent",)
_ROUNDNESS = ("SuperquadricRoundness.Phi", "SuperquadricRoundness.Theta")  # names that OVITO knows
_DUMP_COLUMNS = ("id", "type", *_POSITION, *_QUATERNION, *_DIAMETERS)
_ATOMS = ("id", "type", "ellipsoidflag", "density", *_POSITION)
_ELLIPSOIDS = ("id", *_DIAMETERS, *_QUATERNION)
# TIMESTEP stands before TIME because the one begins with the other.
_ITEM_ROWS = {"UNITS": 1, "TIMESTEP": 1, "TIME": 1, "NUMBER OF ATOMS": 1, "BOX BOUNDS": 3}


class _Frame(NamedTuple):
    columns: Mapping[str, FloatArray]
    """Under the names of a dump's columns, each (N,), in the order of the ids."""
    bounds: FloatArray
    """(3, 2) lower and upper ends."""
    tilt: FloatArray
    """(3,) xy, xz, yz."""
    step: int = 0
    time: float = 0.0


def write_data(path: PathLike, packing: Packing, density: float = 1.0) -> None:
    """Write a data file for ``atom_style ellipsoid``, replacing `path` only when all is written.

    Parameters
    ----------
    path : path-like
    packing : Packing
        Every particle, discs too, is written as an ellipsoid. In 2D, z is 0 and the box reaches
        from -0.5 to 0.5 in z.
    density : float, [mass / length^3]
        LAMMPS makes the mass of it.

    Raises
    ------
    ValueError
        If the density is not a positive number.
    OSError
        If the file cannot be written.
    """
    if not 0 < density < np.inf:
        msg = f"density is {density}, expected a positive number"
        raise ValueError(msg)
    one = np.ones(packing.n)
    position, image = _padded(packing.position), _padded(packing.image)
    atoms = np.column_stack([packing.id, packing.species, one, density * one, position, image])
    ellipsoids = np.column_stack([packing.id, packing.diameters, packing.quaternions])
    with replacing(path) as temporary, temporary.open("w", encoding="ascii") as file:
        file.write(_header_text(packing))
        file.write("\nAtoms # ellipsoid\n\n")
        np.savetxt(file, atoms, fmt=["%d"] * 3 + ["%.17g"] * 4 + ["%d"] * 3)
        file.write("\nEllipsoids\n\n")
        np.savetxt(file, ellipsoids, fmt=["%d"] + ["%.17g"] * 7)


def read_data(path: PathLike, dimension: int | None = None) -> Packing:
    """Read a data file of ``atom_style ellipsoid``, ours or one of LAMMPS's ``write_data``.

    Parameters
    ----------
    path : path-like
    dimension : {2, 3, None}
        None takes 2 if all z are 0, all quaternions are rotations about z and the box reaches
        from -0.5 to 0.5 in z, and 3 otherwise.

    Returns
    -------
    Packing
        Rows in the order of the IDs, step and time 0.

    Raises
    ------
    FileFormatError
        If the file is cut short, is not of that style, or what it holds is not a packing.
    OSError
        If the file cannot be opened.
    """
    text = Path(path).read_text(encoding="utf-8", errors="replace")
    try:
        return _packing(_data_frame(text), dimension)
    except ValueError as error:
        msg = f"{path}: {error}"
        raise FileFormatError(msg) from error


def iter_dump(path: PathLike, dimension: int | None = None) -> Iterator[Packing]:
    """Read the frames of a text dump one by one.

    Parameters
    ----------
    path : path-like
        Of ``dump custom`` with the columns ``id type x y z quatw quati quatj quatk shapex shapey
        shapez`` in any order, ``ix iy iz`` and ``exponent`` if wanted, and others, which are ignored.
        Quaternions and shapes may come from a compute of their name, ``compute quatw all
        property/atom quatw`` and the column ``c_quatw``, and so on; the exponent from a variable.
        Without it, p is 1 over ``SuperquadricRoundness.Phi``, if that is there.
    dimension : {2, 3, None}
        As in `read_data`.

    Yields
    ------
    Packing
        Rows in the order of the IDs; time 0 unless ``dump_modify time yes`` wrote it.

    Raises
    ------
    FileFormatError
        If a frame is cut short or is not such a dump, after the frames before it.
    OSError
        If the file cannot be opened.
    """
    with Path(path).open(encoding="utf-8", errors="replace") as lines:
        for number in itertools.count():
            title = lines.readline()
            if not title:
                return
            try:
                packing = _packing(_dump_frame(title, lines), dimension)
            except ValueError as error:
                msg = f"{path}: frame {number}: {error}"
                raise FileFormatError(msg) from error
            yield packing


def read_dump(path: PathLike, dimension: int | None = None) -> list[Packing]:
    """Read all frames of a text dump; see `iter_dump`."""
    return list(iter_dump(path, dimension))


def read_any(path: PathLike, frame: int = -1) -> Packing:
    """Read one packing from an H5MD file, a text dump or a data file, told by their content.

    Parameters
    ----------
    path : path-like
    frame : int
        From 0; negative ones count from the end.

    Raises
    ------
    FileFormatError
        If the file, as far as it was read, is damaged or none of the three.
    ValueError
        If there is no such frame.
    OSError
        If the file cannot be opened.
    """
    found_format = format_of(path)
    if found_format == HDF5:
        return read_packing(path, frame)
    frames = iter_dump(path) if found_format == DUMP else iter([read_data(path)])
    if frame >= 0:
        found = list(itertools.islice(frames, frame, frame + 1))
    else:
        last = deque(frames, maxlen=-frame)
        found = [last[0]] if len(last) == -frame else []
    if not found:
        msg = f"{path}: has no frame {frame}, expected one from the file"
        raise ValueError(msg)
    return found[0]


def _padded(vectors: FloatArray | IntArray) -> FloatArray:
    return np.pad(vectors.astype(np.float64), ((0, 0), (0, 3 - vectors.shape[1])))


def _header_text(packing: Packing) -> str:
    lo, hi = packing.box.lo, packing.box.lo + packing.box.edges
    bounds = [*zip(lo, hi, strict=True), _PLANE][:3]
    sides = [f"{a:.17g} {b:.17g} {x}lo {x}hi" for x, (a, b) in zip("xyz", bounds, strict=True)]
    counts = [
        f"{packing.n} atoms",
        f"{packing.species.max()} atom types",
        f"{packing.n} ellipsoids",
    ]
    if packing.box.is_tilted:
        tilt = [*packing.box.tilt.tolist(), 0.0, 0.0][:3]
        sides.append(" ".join(f"{x:.17g}" for x in tilt) + " xy xz yz")
    return "\n".join(["LAMMPS data file by jamshape", "", *counts, "", *sides, ""])


def _packing(frame: _Frame, dimension: int | None) -> Packing:
    def stack(names: Sequence[str]) -> FloatArray:
        return np.column_stack([frame.columns[name] for name in names])

    quaternion, diameters = stack(_QUATERNION), stack(_DIAMETERS)
    flat = not (frame.columns["z"].any() or quaternion[:, 1:3].any() or frame.tilt[1:].any())
    if dimension is None:
        dimension = 2 if flat and tuple(frame.bounds[2]) == _PLANE else 3
    if dimension == 2 and not flat:
        msg = "a z, a rotation or a tilt out of the plane is not 0, expected a two-dimensional packing"
        raise ValueError(msg)
    lo, hi = frame.bounds[:dimension].T
    has_image = set(_IMAGE) <= set(frame.columns)
    exponent = _exponent(frame.columns)
    return Packing(
        position=stack(_POSITION[:dimension]),
        orientation=angle_from_quaternion(quaternion) if dimension == 2 else quaternion,
        diameters=diameters,
        species=_whole(frame.columns["type"]),
        id=_whole(frame.columns["id"]),
        image=_whole(stack(_IMAGE[:dimension])) if has_image else np.empty((0, 0), np.int64),
        box=Box(lo=lo, edges=hi - lo, tilt=frame.tilt[: 1 if dimension == 2 else 3]),
        shape_style=guess_shape_style(diameters, has_exponent=len(exponent) > 0),
        exponent=exponent,
        step=frame.step,
        time=frame.time,
    )


def _exponent(columns: Mapping[str, FloatArray]) -> FloatArray:
    """(N,) exponents; empty if the file tells none."""
    if set(_EXPONENT) <= set(columns):
        return columns["exponent"]
    if not set(_ROUNDNESS) <= set(columns):
        return np.empty(0)
    phi, theta = (columns[name] for name in _ROUNDNESS)
    if not ((phi > 0) & (phi == theta)).all():
        msg = f"{' and '.join(_ROUNDNESS)} differ or are not positive, expected both to be 1/p"
        raise ValueError(msg)
    return np.asarray(1 / phi)


def _whole(column: FloatArray) -> IntArray:
    if not (column == np.floor(column)).all():
        msg = "a column of integers holds other numbers, expected whole id, type and image"
        raise ValueError(msg)
    return column.astype(np.int64)


def _columns(
    rows: Sequence[str], names: Sequence[str], wanted: Sequence[str]
) -> dict[str, FloatArray]:
    """Parse rows under names; return the wanted columns in the order of the ids."""
    words = [row.split() for row in rows]
    for row in words:
        if len(row) != len(names):
            msg = f"row {' '.join(row)!r} has {len(row)} columns, expected {' '.join(names)!r}"
            raise ValueError(msg)
    picked = [names.index(name) for name in wanted]
    table = np.array([[row[i] for i in picked] for row in words], dtype=np.float64)
    table = table.reshape(len(rows), len(wanted))
    return dict(zip(wanted, table[table[:, wanted.index("id")].argsort()].T, strict=True))


def _data_frame(text: str) -> _Frame:
    if not text.endswith("\n"):
        msg = "the file ends within a line, expected a complete data file"
        raise ValueError(msg)
    sections = _sections(text)
    header = _header(sections[""])
    if "atoms" not in header:
        msg = "the header has no line 'N atoms', expected a LAMMPS data file"
        raise ValueError(msg)
    n = int(header["atoms"][0])
    atom_rows, ellipsoid_rows = (_section(sections, name, n) for name in ("Atoms", "Ellipsoids"))
    names = _ATOMS if len(atom_rows[0].split()) == len(_ATOMS) else (*_ATOMS, *_IMAGE)
    atoms = _columns(atom_rows, names, names)
    ellipsoids = _columns(ellipsoid_rows, _ELLIPSOIDS, _ELLIPSOIDS)
    if not np.array_equal(atoms["id"], ellipsoids["id"]):
        msg = "Atoms and Ellipsoids hold different ids, expected one ellipsoid for each atom"
        raise ValueError(msg)
    return _Frame({**atoms, **ellipsoids}, *_bounds(header))


def _sections(text: str) -> dict[str, list[str]]:
    """Rows under their section's title, comments and blank lines removed; the header's is ''."""
    sections: dict[str, list[str]] = {"": []}
    rows = sections[""]
    for line in text.splitlines()[1:]:
        content = line.partition("#")[0].strip()
        if content[:1].isalpha():
            rows = sections.setdefault(content, [])
        elif content:
            rows.append(content)
    return sections


def _header(lines: Sequence[str]) -> dict[str, list[str]]:
    """Numbers under the keyword that follows them on their line."""
    header = {}
    for line in lines:
        words = line.split()
        numbers = list(itertools.takewhile(lambda word: not word[0].isalpha(), words))
        header[" ".join(words[len(numbers) :])] = numbers
    return header


def _section(sections: Mapping[str, list[str]], name: str, n: int) -> list[str]:
    rows = sections.get(name, [])
    if len(rows) != n or n == 0:
        msg = f"section {name} has {len(rows)} rows for {n} atoms, expected one for each ellipsoid"
        raise ValueError(msg)
    return rows


def _bounds(header: Mapping[str, list[str]]) -> tuple[FloatArray, FloatArray]:
    bounds = [header.get(f"{x}lo {x}hi", []) for x in "xyz"]
    tilt = header.get("xy xz yz", ["0"] * 3)
    if any(len(ends) != 2 for ends in bounds) or len(tilt) != 3:
        msg = (
            "the header describes no box, expected 'xlo xhi', 'ylo yhi', 'zlo zhi', and 'xy xz yz' of"
            " one with a tilt"
        )
        raise ValueError(msg)
    return np.array(bounds, dtype=np.float64), np.array(tilt, dtype=np.float64)


def _dump_frame(title: str, lines: TextIO) -> _Frame:
    items: dict[str, list[str]] = {}
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
    columns = _dump_columns([_plain_name(name) for name in title.split()[2:]], rows)
    step, time = int(items["TIMESTEP"][1]), float(items.get("TIME", ["", "0"])[1])
    return _Frame(columns, *_dump_bounds(items["BOX BOUNDS"]), step, time)


def _plain_name(column: str) -> str:
    """`quatw` for `c_quatw`, the only name that a LAMMPS before ``dump_modify colname`` can give."""
    name = column[2:] if column[:2] in {"c_", "f_", "v_"} else column
    return name if name in (*_QUATERNION, *_DIAMETERS, *_EXPONENT) else column


def _take(lines: TextIO, n: int) -> list[str]:
    rows = list(itertools.islice(lines, n))
    if len(rows) < n or not all(row.endswith("\n") for row in rows):
        msg = "the file ends within the frame, expected a complete one; leave the frame out"
        raise ValueError(msg)
    return rows


def _dump_columns(names: Sequence[str], rows: Sequence[str]) -> dict[str, FloatArray]:
    missing = [name for name in _DUMP_COLUMNS if name not in names]
    if missing:
        msg = f"columns {' '.join(missing)!r} are missing, expected {' '.join(_DUMP_COLUMNS)!r}"
        raise ValueError(msg)
    others = [name for name in (*_IMAGE, *_EXPONENT, *_ROUNDNESS) if name in names]
    return _columns(rows, names, [*_DUMP_COLUMNS, *others])


def _dump_bounds(item: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    boundary, *rows = item
    if boundary not in {"pp pp pp", "xy xz yz pp pp pp"}:
        msg = f"box bounds are {boundary!r}, expected 'pp pp pp', periodic, or 'xy xz yz pp pp pp'"
        raise ValueError(msg)
    is_tilted = boundary.startswith("xy")
    columns = np.array([row.split() for row in rows], dtype=np.float64)
    if columns.shape != (3, 2 + is_tilted):
        msg = f"box bounds {boundary!r} have rows of {columns.shape[1]} numbers, expected {2 + is_tilted}"
        raise ValueError(msg)
    if not is_tilted:
        return columns, np.zeros(3)
    # LAMMPS tells the cuboid around the box.
    around, tilt = columns[:, :2], columns[:, 2]
    return around - np.transpose(cuboid_around(Lengths(np.zeros(3), tilt).matrix)), tilt
