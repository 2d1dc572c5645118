"""LAMMPS data files and text dumps of ellipsoids.

Numbers are written with 17 significant digits and read back to the last bit. Two numbers of a
`Packing` may change in the last bit, since files hold others: an angle in 2D, converted
through its quaternion, and an edge of the box, computed from its upper end (exact
if the lower corner is 0 or half an edge below it). Dumps of a tilted box hold the bounds of
the surrounding cuboid, from which the box follows with similar rounding.

Neither format stores the shape and the law of contacts. In our data files the first line, which LAMMPS does
not read, states them with the dimension, and a comment behind each row of Ellipsoids its exponent. For other files
`jamshape.files.meaning` decides.

Dumps hold the exponent p twice: in a column ``exponent``, in full precision, and as 1/p in
``SuperquadricRoundness.Phi`` and ``.Theta``, with which OVITO draws the bodies. Two exponents n1 and n2 are in columns
``block1`` and ``block2``, and as 2/n1 and 2/n2 in these. Data files of LAMMPS from 2026 on may hold n1 and n2 behind
each row of Ellipsoids.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import os
import re
import warnings
import weakref
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.files.dump_index import index_of
from jamshape.files.frames import row_of
from jamshape.files.h5md import FileFormatError, PathLike, read_packing, replacing
from jamshape.files.meaning import (
    PLANE,
    Geometry,
    Said,
    Wanted,
    meaning_of,
    most_digits,
    require_told,
)
from jamshape.files.signature import DUMP, GSD, HDF5, REFUSED, format_of
from jamshape.files.unpacked import opened_plain
from jamshape.packing import Box, Lengths, Packing, angle_from_quaternion, cuboid_around
from jamshape.packing.columns import flat, joined
from jamshape.shapes.shape import Stiffness, power_of, stiffness_of, stiffness_text, stiffness_told
from jamshape.shapes.table import SHAPES, shape_named

_TITLE = "LAMMPS data file by jamshape"
_EXPONENT_COMMENT, _BLOCK_COMMENT, _FORM_COMMENT = "exponent=", "block=", "form="
_FORM = "# form "  # and its number, a colon and numbers, in one line or several
_NUMBERS_IN_LINE = 8
_POSITION = ("x", "y", "z")
# Positions in dumps: wrapped or not, and in units of the box.
_POSITIONS = (_POSITION, ("xu", "yu", "zu"), ("xs", "ys", "zs"), ("xsu", "ysu", "zsu"))
_IMAGE = ("ix", "iy", "iz")
_QUATERNION = ("quatw", "quati", "quatj", "quatk")
_DIAMETERS = ("shapex", "shapey", "shapez")
_EXPONENT = ("exponent",)
_ROUNDNESS = ("SuperquadricRoundness.Phi", "SuperquadricRoundness.Theta")  # OVITO's names
_WIDTHS = {"diameter": 1.0, "radius": 2.0}  # of discs, over their diameter
_PROPERTIES = (*_QUATERNION, *_DIAMETERS)  # in the order of a compute property/atom of seven
# Names of computes of several columns, with the columns.
_COMPUTES = {
    **dict.fromkeys(("q", "quat", "quaternion", "orient", "orientation", "body"), _PROPERTIES),
    **dict.fromkeys(("shape", "diameter", "diameters"), _DIAMETERS),
}
_DUMP_COLUMNS = ("id", "type", *_POSITION, *_QUATERNION, *_DIAMETERS)
_ATOMS = ("id", "type", "ellipsoidflag", "density", *_POSITION)
_SPHERES = ("id", "type", "diameter", "density", *_POSITION)
_ELLIPSOIDS = ("id", *_DIAMETERS, *_QUATERNION)
_BLOCKS = ("block1", "block2")  # n1 and n2 of atom_style ellipsoid superellipsoid
_ATOM_STYLE = "ellipsoid"
# Columns behind those of ellipsoids, by other styles in an atom style hybrid.
_HYBRID = {
    "atomic": (),
    **dict.fromkeys(("molecular", "bond", "angle"), ("mol",)),
    "charge": ("q",),
    "full": ("mol", "q"),
}
_ATOMS_OF_HYBRID = ("id", "type", "x", "y", "z", "ellipsoidflag", "density")
_PAIRS = {"Pair Coeffs": 1, "PairIJ Coeffs": 2}  # types in a row
_BOUNDARY = re.compile(r"(xy xz yz )?(pp|[fsm]{2})( (pp|[fsm]{2})){2}")
_ALIKE = 1e-9  # relative difference of exponents that rounding leaves
_COUNTED = 200  # rows from which the number of digits is determined
# TIMESTEP precedes TIME, which is its prefix.
_ITEM_ROWS = {"UNITS": 1, "TIMESTEP": 1, "TIME": 1, "NUMBER OF ATOMS": 1, "BOX BOUNDS": 3}


class _Frame(NamedTuple):
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


def write_data(
    path: PathLike, packing: Packing, density: float = 1.0, *, blocks: bool = False
) -> None:
    """Write a data file for ``atom_style ellipsoid``; `path` is replaced only when writing is complete.

    Parameters
    ----------
    path : path-like
    packing : Packing
        All particles, including discs, are written as ellipsoids. In 2D, z is 0 and the box reaches
        from -0.5 to 0.5 in z. Shape, law and exponents go along as comments.
    density : float, [mass / length^3]
        Mass density, from which LAMMPS computes masses.
    blocks : bool
        Write n1 and n2 behind each row of Ellipsoids, for ``atom_style ellipsoid superellipsoid`` of LAMMPS from 2026 on,
        2 and 2 for shapes without exponents; other atom styles and versions do not read such rows.

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
        file.write(_forms_text(packing) if packing.shape.has_form else "")
        file.write(_pairs_text(packing))
        file.write("\nAtoms # ellipsoid\n\n")
        np.savetxt(file, atoms, fmt=["%d"] * 3 + ["%.17g"] * 4 + ["%d"] * 3)
        file.write("\nEllipsoids\n\n")
        row = ["%d"] + ["%.17g"] * 7
        has_both = packing.shape.has_exponent and packing.form.shape[1] == len(_BLOCKS)
        if blocks or has_both:
            row += ["%.17g" if blocks else f"# {_BLOCK_COMMENT}%.17g", "%.17g"]
            ellipsoids = np.column_stack([ellipsoids, _both_exponents(packing)])
        elif packing.shape.has_exponent:
            row += [f"# {_EXPONENT_COMMENT}%.17g"]
            ellipsoids = np.column_stack([ellipsoids, packing.exponent])
        if packing.shape.has_form:
            row += [f"# {_FORM_COMMENT}%d"]
            ellipsoids = np.column_stack([ellipsoids, 1 + _forms(packing)[1]])
        np.savetxt(file, ellipsoids, fmt=row)


def write_dump(path: PathLike, packings: Packing | Iterable[Packing]) -> None:
    """Write a text dump as of ``dump custom`` with ``format float %.17g``; `path` is replaced only when writing is complete.

    Parameters
    ----------
    path : path-like
    packings : Packing or iterable of Packing
        Frames, with their steps, times and other columns. Shape and law are not in a dump.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    frames = [packings] if isinstance(packings, Packing) else packings
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        for packing in frames:
            _write_frame(file, packing)


def _both_exponents(packing: Packing) -> FloatArray:
    """Return n1 and n2 (N, 2), those of an ellipsoid if the shape has none."""
    if packing.shape.has_exponent:
        return packing.shape.widened(packing.form, len(_BLOCKS))
    return np.full((packing.n, len(_BLOCKS)), 2.0)


def _forms(packing: Packing) -> tuple[FloatArray, IntArray]:
    """Return different forms (k, K) and the row of each particle (N,)."""
    forms, of = np.unique(packing.form, axis=0, return_inverse=True)
    return forms, of.ravel()


def _forms_text(packing: Packing) -> str:
    """Return comments with the different forms, in lines that LAMMPS can read over."""
    lines = []
    for number, form in enumerate(_forms(packing)[0], 1):
        words = [f"{x:.17g}" for x in form]
        parts = (words[k : k + _NUMBERS_IN_LINE] for k in range(0, len(words), _NUMBERS_IN_LINE))
        lines += [f"# form {number}: {' '.join(part)}" for part in parts]
    return "\n".join(["", *lines, ""])


def _write_frame(file: TextIO, packing: Packing) -> None:
    lo, hi = (np.array([*ends, z][:3]) for ends, z in zip(packing.box.bounds, PLANE, strict=True))
    bounds, boundary = np.column_stack([lo, hi]), "pp pp pp"
    if packing.box.is_tilted:
        bounds = np.column_stack([bounds, [*packing.box.tilt.tolist(), 0.0, 0.0][:3]])
        boundary = f"xy xz yz {boundary}"
    columns: dict[str, NDArray[Any]] = {"id": packing.id, "type": packing.species}
    columns |= dict(zip(_POSITION, _padded(packing.position).T, strict=True))
    columns |= dict(zip(_IMAGE, _padded(packing.image).astype(np.int64).T, strict=True))
    columns |= dict(zip(_PROPERTIES, [*packing.quaternions.T, *packing.diameters.T], strict=True))
    if packing.shape.has_exponent and packing.form.shape[1] == len(_BLOCKS):
        columns |= dict(zip(_BLOCKS, packing.form.T, strict=True))
        columns |= dict(zip(_ROUNDNESS, 2 / packing.form.T, strict=True))
    elif packing.shape.has_exponent:
        columns |= {"exponent": packing.exponent, **dict.fromkeys(_ROUNDNESS, 1 / packing.exponent)}
    if packing.shape.has_form:
        columns |= flat({"form": packing.form})
    columns = flat(packing.columns) | columns
    columns = {name: columns[name] for name in sorted(columns, key=_place_in_row)}
    file.write(f"ITEM: TIME\n{packing.time:.17g}\n" if packing.time else "")
    file.write(f"ITEM: TIMESTEP\n{packing.step}\nITEM: NUMBER OF ATOMS\n{packing.n}\n")
    file.write(f"ITEM: BOX BOUNDS {boundary}\n")
    np.savetxt(file, bounds, fmt="%.17g")
    file.write(f"ITEM: ATOMS {' '.join(columns)}\n")
    formats = {"f": "{:.17g}", "U": "{}"}
    texts = [map(formats.get(x.dtype.kind, "{:d}").format, x.tolist()) for x in columns.values()]
    file.writelines(" ".join(row) + "\n" for row in zip(*texts, strict=True))


def _place_in_row(name: str) -> int:
    known = ("id", "type", *_POSITION, *_IMAGE, *_PROPERTIES, *_EXPONENT, *_BLOCKS, *_ROUNDNESS)
    return known.index(name) if name in known else len(known)


def read_data(path: PathLike, dimension: int | None = None, shape: str | None = None) -> Packing:
    """Read a data file of ``atom_style ellipsoid`` or ``sphere``, ours or from LAMMPS's ``write_data``.

    Parameters
    ----------
    path : path-like
    dimension : {2, 3}, optional
        By default that of the file, or else 2 if all particles have the same z and rotate about z;
        a warning reports doubtful cases.
    shape : str, optional
        A name of `jamshape.shapes.table.SHAPES`; by default that of the file, or else the first shape of
        that table that fits the diameters, with a warning.

    Returns
    -------
    Packing
        Rows in the order of the IDs, step and time 0.

    Raises
    ------
    FileFormatError
        If the file is truncated, is not of that style, does not hold a packing, or states another
        dimension or shape.
    OSError
        If the file cannot be opened.
    """
    with opened_plain(path) as file:
        text = file.read().decode(errors="replace").replace("\r\n", "\n")
    try:
        return _packing(path, _data_frame(text), Wanted(dimension, shape))
    except ValueError as error:
        msg = f"{path}: {error}"
        raise FileFormatError(msg) from error


class DumpFile:
    """The frames of a text dump, read one by one by their offsets in the file, which stays open.

    Parameters
    ----------
    path : path-like
        A ``dump custom`` with the columns ``id type x y z quatw quati quatj quatk shapex shapey shapez`` in any
        order, or positions ``xu yu zu``, ``xs ys zs`` or ``xsu ysu zsu``, optionally ``ix iy iz`` and
        ``exponent``; others are kept. Quaternions and shapes may come from a compute of their name, ``compute
        quatw all property/atom quatw`` and the column ``c_quatw``, and so on, or of several columns, ``c_q[1]``
        to ``c_q[4]`` and ``c_shape[1]`` to ``c_shape[3]``; the exponent from a variable. Without it, p is 1 over
        ``SuperquadricRoundness.Phi``, if present. Discs and spheres may have a ``diameter`` or ``radius`` alone.
    dimension, shape
        See `read_data`; those of the first frame apply to all.

    Raises
    ------
    FileFormatError
        If it is compressed and damaged.
    OSError
        If it cannot be opened.
    """

    def __init__(
        self, path: PathLike, dimension: int | None = None, shape: str | None = None
    ) -> None:
        self.path = Path(path)
        self._wanted = Wanted(dimension, shape)
        self._is_told = False
        self._file = opened_plain(path)
        weakref.finalize(self, self._file.close)
        self.index = index_of(self._file)

    def __reduce__(self) -> Any:
        return DumpFile, (self.path, *self._wanted)

    def __len__(self) -> int:
        """Count the complete frames."""
        return self.index.n_whole

    def warn_if_cut(self) -> None:
        """Warn that an incomplete last frame is left out."""
        if self.index.is_cut and len(self):
            said = f"{self.path}: the file ends within frame {len(self)}, which is left out; the frames before are complete"
            warnings.warn(said, stacklevel=4)

    def packing(self, frame: int) -> Packing:
        """Read a frame, counted from 0, with its particles in the order of their IDs.

        Raises
        ------
        FileFormatError
            If it is truncated or not of such a dump.
        """
        if frame and not self._is_told:
            self.packing(0)
        start, end = self.index.starts[frame : frame + 2]
        text = io.BytesIO(os.pread(self._file.fileno(), end - start, start))
        lines = io.TextIOWrapper(text, encoding="utf-8", errors="replace")
        try:
            read = _dump_frame(lines, is_first=not self._is_told)
            packing = _packing(self.path, read, self._wanted)
        except ValueError as error:
            msg = f"{self.path}: frame {frame}: {error}"
            raise FileFormatError(msg) from error
        self._wanted, self._is_told = Wanted(packing.dimension, packing.shape_style), True
        return packing


def read_any(
    path: PathLike, frame: int = -1, dimension: int | None = None, shape: str | None = None
) -> Packing:
    """Read one packing from an H5MD file, a text dump or a data file, distinguished by their content.

    Parameters
    ----------
    path : path-like
    frame : int
        Counted from 0 or, if negative, from the end.
    dimension, shape
        See `read_data`; an H5MD file states both itself.

    Raises
    ------
    FileFormatError
        If the file, as far as it was read, is damaged or has none of these formats.
    ValueError
        If the frame does not exist.
    OSError
        If the file cannot be opened.
    """
    found_format = format_of(path)
    if found_format in REFUSED:
        msg = f"{path} {REFUSED[found_format]}"
        raise FileFormatError(msg)
    if found_format == GSD:
        msg = f"{path} is a GSD file, expected H5MD, a dump or a data file; make one with jamshape export"
        raise FileFormatError(msg)
    if found_format == HDF5:
        packing = read_packing(path, frame)
        require_told(path, packing, Wanted(dimension, shape))
        return packing
    if found_format != DUMP:
        row_of(frame, 1, path)
        return read_data(path, dimension, shape)
    dump = DumpFile(path, dimension, shape)
    if not len(dump):
        return dump.packing(0)  # raises
    if frame < 0:
        dump.warn_if_cut()
    return dump.packing(row_of(frame, len(dump), path))


def _padded(vectors: FloatArray | IntArray) -> FloatArray:
    return np.pad(vectors.astype(np.float64), ((0, 0), (0, 3 - vectors.shape[1])))


def _header_text(packing: Packing) -> str:
    lo, hi = packing.box.lo, packing.box.lo + packing.box.edges
    bounds = [*zip(lo, hi, strict=True), PLANE][:3]
    sides = [f"{a:.17g} {b:.17g} {x}lo {x}hi" for x, (a, b) in zip("xyz", bounds, strict=True)]
    counts = [
        f"{packing.n} atoms",
        f"{packing.species.max()} atom types",
        f"{packing.n} ellipsoids",
    ]
    if packing.box.is_tilted:
        tilt = [*packing.box.tilt.tolist(), 0.0, 0.0][:3]
        sides.append(" ".join(f"{x:.17g}" for x in tilt) + " xy xz yz")
    told = {"shape": packing.shape_style, "dimension": packing.dimension, **packing.law.stated()}
    told["k_e"] = stiffness_text(packing.law.k_e)
    title = f"{_TITLE} # " + " ".join(f"{name}={value}" for name, value in told.items())
    return "\n".join([title, "", *counts, "", *sides, ""])


def _pairs_text(packing: Packing) -> str:
    """Return the section of a table of k_e for LAMMPS, if types of its pair style are the species."""
    if not isinstance(packing.law.k_e, tuple):
        return ""
    style = packing.shape.style(packing, packing.law)
    if not np.array_equal(style.types, packing.species):
        return ""
    name, *commands = (line.split()[1:] for line in style.commands.splitlines())
    rows = {tuple(row[:2]): " ".join(row) for row in commands}  # later ones hold exponents
    return "\n".join([f"\nPairIJ Coeffs # {name[0]}", "", *rows.values(), ""])


def _packing(path: PathLike, frame: _Frame, wanted: Wanted) -> Packing:
    def stack(names: Sequence[str]) -> FloatArray:
        return np.column_stack([frame.columns[name] for name in names])

    exponent, others = _exponent(frame.columns), dict(frame.others)
    told = wanted.shape or frame.said.shape
    if told and not shape_named(told).has_exponent and (exponent == 1).all():
        exponent = np.empty(0)  # those of the ellipsoids in which LAMMPS holds any shape
    form = others.pop("form", frame.columns.get("form", np.empty((0, 0))))
    quaternion = stack(_QUATERNION)
    there = Geometry(stack(_POSITION), quaternion, stack(_DIAMETERS), frame.bounds, frame.tilt)
    said = replace(frame.said, has_exponent=len(exponent) > 0, form=form)
    dimension, shape, law = meaning = meaning_of(path, there, said, wanted)
    quaternion = meaning.turned(quaternion)
    lo, hi = frame.bounds[:dimension].T
    has_image = set(_IMAGE) <= set(frame.columns)
    packing = Packing(
        position=there.position[:, :dimension],
        orientation=angle_from_quaternion(quaternion) if dimension == 2 else quaternion,
        diameters=shape.diameters,
        species=_whole(frame.columns["type"]),
        id=_whole(frame.columns["id"]),
        image=_whole(stack(_IMAGE[:dimension])) if has_image else np.empty((0, 0), np.int64),
        box=Box(lo=lo, edges=hi - lo, tilt=frame.tilt[: 1 if dimension == 2 else 3]),
        shape_style=shape.name,
        form=SHAPES[shape.name].form_of_exponents(exponent) if len(exponent) else form,
        law=law,
        step=frame.step,
        time=frame.time,
        columns=others,
    )
    _require_closed(path, packing, frame)
    return packing


def packing_of_columns(
    name: str,
    columns: dict[str, FloatArray],
    box: tuple[tuple[FloatArray, FloatArray], str],
    pair: str,
    wanted: Wanted,
) -> Packing:
    """Make a packing from what a dump has.

    Parameters
    ----------
    name : str
        Name of the source in messages.
    columns : dict of str to (N,) array
    box : (bounds, tilt), boundary
        As in a dump.
    pair : str
        Name and settings of a pair style of ours on one line, then its coefficients, a line for each pair of types; "" for
        others.
    wanted : Wanted

    Raises
    ------
    ValueError
        If they are not those of a packing.
    """
    said = Said()
    style, *rows = pair.splitlines() or [""]
    shape = style.partition("/")[0]
    if shape in SHAPES:
        said = _of_pairs(shape, [row.split() for row in rows], 2, columns)
        said = replace(said, law={**said.law, **_of_settings(style)})
    (bounds, tilt), boundary = box
    return _packing(name, _Frame(columns, bounds, tilt, said, boundary=boundary), wanted)


def _require_closed(path: PathLike, packing: Packing, frame: _Frame) -> None:
    """Refuse open boundaries that a particle could reach across; a periodic box has the same contacts otherwise."""
    ends = frame.boundary.split()[-3:][: packing.dimension]
    is_open = np.array([end != "pp" for end in ends])
    if not is_open.any():
        return
    heights = packing.box.heights(packing.position - packing.box.lo)
    gap = (packing.box.spacings - np.ptp(heights, axis=0))[is_open].min()
    widest = 2 * packing.outer_radius.max()
    if gap <= widest:
        msg = (
            f"box bounds are {frame.boundary!r} with a gap of {gap:.3g} between the particles and their images, expected"
            f" periodic ones (pp), or a gap above the largest diameter, {widest:.3g}; widen the box (change_box)"
        )
        raise ValueError(msg)
    if not frame.said.is_later:
        said = (
            f"{path} has the box bounds {frame.boundary!r}: it is read as periodic, with the same contacts, since no"
            " particle reaches across; forces of walls are not in it"
        )
        warnings.warn(said, stacklevel=2)


def _exponent(columns: Mapping[str, FloatArray]) -> FloatArray:
    """(N,) exponents p, or (N, 2) n1 and n2 if these differ; empty if the file has none."""
    if set(_EXPONENT) <= set(columns):
        return columns["exponent"]
    for names, power in ((_BLOCKS, 1), (_ROUNDNESS, -1)):
        if not set(names) <= set(columns):
            continue
        both = np.column_stack([columns[name] for name in names])
        if not (both > 0).all():
            what = "n1 and n2" if power > 0 else "2/n1 and 2/n2"
            msg = f"{' or '.join(names)} is not positive, expected {what} of each particle"
            raise ValueError(msg)
        one, two = both.T
        if (np.abs(one - two) <= _ALIKE * one).all():
            return np.asarray(one / 2 if power > 0 else 1 / one)
        return both if power > 0 else 2 / both
    return np.empty(0)


def _whole(column: FloatArray) -> IntArray:
    if not (column == np.floor(column)).all():
        msg = "a column of integers holds other numbers, expected whole id, type and image"
        raise ValueError(msg)
    return column.astype(np.int64)


def _columns(
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


def _data_frame(text: str) -> _Frame:
    if not text:
        msg = "the file is empty, expected a LAMMPS data file"
        raise ValueError(msg)
    if not text.endswith("\n"):
        msg = "the file ends within a line, expected a complete data file"
        raise ValueError(msg)
    sections = _sections(text)
    header = _header(sections[""].rows)
    if "atoms" not in header:
        msg = "the header has no line 'N atoms', expected a LAMMPS data file"
        raise ValueError(msg)
    n = int(header["atoms"][0])
    atom_rows = _numbered(_section(sections, "Atoms", n), sections.get("Atom Type Labels"))
    names = _atom_columns(sections["Atoms"].title, len(atom_rows[0].split()))
    columns = _columns(atom_rows, names, names)
    if "diameter" in columns:
        columns |= _round(columns)
    else:
        _require_ellipsoids(columns)
        rows = _section(sections, "Ellipsoids", n)
        ellipsoids = _ellipsoids(rows, sections["Ellipsoids"].comments)
        if not np.array_equal(columns["id"], ellipsoids["id"]):
            msg = "Atoms and Ellipsoids hold different ids, expected one ellipsoid for each atom"
            raise ValueError(msg)
        columns |= ellipsoids
    said = replace(_said(text, sections, columns), digits=_digits(atom_rows, names))
    others: dict[str, NDArray[Any]] = {"q": columns["q"]} if "q" in columns else {}
    others |= _form(text, columns)
    others |= {"mol": _whole(columns["mol"])} if "mol" in columns else {}
    return _Frame(columns, *_bounds(header), said, others=others)


def _round(columns: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return diameters and quaternions of discs from a column of their widths."""
    name = next(name for name in _WIDTHS if name in columns)
    width = _WIDTHS[name] * columns[name]
    if not (width > 0).all():
        msg = f"{name} holds {columns[name].min():g}, expected particles of positive widths, no points"
        raise ValueError(msg)
    zero = np.zeros(len(width))
    quaternion = zip(_QUATERNION, (zero + 1, zero, zero, zero), strict=True)
    return dict.fromkeys(_DIAMETERS, width) | dict(quaternion)


class _Section(NamedTuple):
    """Rows of a data file under a title."""

    title: str
    """Comment behind it, such as the atom style."""
    rows: list[str]
    """Rows without comments and blank lines."""
    comments: list[str]
    """Comments behind the rows."""


def _sections(text: str) -> dict[str, _Section]:
    """Return rows by the title of their section, '' for the header."""
    sections = {"": _Section("", [], [])}
    here = sections[""]
    for line in text.splitlines()[1:]:
        content, _, comment = (part.strip() for part in line.partition("#"))
        if content[:1].isalpha():
            here = sections.setdefault(content, _Section(comment, [], []))
        elif content:
            here.rows.append(content)
            here.comments.append(comment)
    return sections


def _numbered(rows: list[str], labels: _Section | None) -> list[str]:
    """Replace type labels by numbers, if the file has labels."""
    if labels is None:
        return rows
    numbers = {words[1]: words[0] for words in (row.split() for row in labels.rows)}
    words = [row.split() for row in rows]
    return [" ".join([id_, numbers.get(label, label), *rest]) for id_, label, *rest in words]


def _atom_columns(title: str, count: int) -> tuple[str, ...]:
    """Name the columns of Atoms by the atom style in its title."""
    style, *others = title.split() or [_ATOM_STYLE]
    if style in {_ATOM_STYLE, "sphere"}:
        names = _ATOMS if style == _ATOM_STYLE else _SPHERES
        return names if count == len(names) else (*names, *_IMAGE)
    what = "expected atoms of style ellipsoid or sphere; write the file from LAMMPS with atom_style ellipsoid"
    if style != "hybrid":
        msg = f"the section is titled 'Atoms # {title}', {what}"
        raise ValueError(msg)
    known = others[:1] == [_ATOM_STYLE] and set(others[1:]) <= set(_HYBRID)
    more = [column for name in others[1:] for column in _HYBRID[name]] if known else []
    plain = (*_ATOMS_OF_HYBRID, *more)
    if not known or count not in {len(plain), len(plain) + len(_IMAGE)}:
        msg = (
            f"the section is titled 'Atoms # {title}', which does not define its {count} columns, {what}, or"
            " name the styles of the hybrid in the title, ellipsoid first, such as"
            " 'Atoms # hybrid ellipsoid molecular'"
        )
        raise ValueError(msg)
    return plain if count == len(plain) else (*plain, *_IMAGE)


def _require_ellipsoids(atoms: Mapping[str, FloatArray]) -> None:
    """Refuse columns of another atom style, and atoms that are not ellipsoids."""
    if not ((atoms["ellipsoidflag"] == 1) & (atoms["density"] > 0)).all():
        msg = (
            "columns of Atoms are not those of atom_style ellipsoid, expected 1 as ellipsoidflag and a"
            " positive density in each row; name the atom style in the title, such as 'Atoms # ellipsoid'"
        )
        raise ValueError(msg)


def _ellipsoids(rows: Sequence[str], comments: Sequence[str]) -> dict[str, FloatArray]:
    """Read the section Ellipsoids, with exponents and forms if present."""
    has_blocks = len(rows[0].split()) == len(_ELLIPSOIDS) + len(_BLOCKS)
    names = (*_ELLIPSOIDS, *_BLOCKS) if has_blocks else _ELLIPSOIDS
    ours = {_EXPONENT_COMMENT: _EXPONENT, _BLOCK_COMMENT: _BLOCKS, _FORM_COMMENT: ("form",)}
    for beginning, more in ours.items():
        if all(comment.startswith(beginning) for comment in comments):
            told = [comment.removeprefix(beginning) for comment in comments]
            rows, names = [f"{a} {b}" for a, b in zip(rows, told, strict=True)], (*names, *more)
    return _columns(rows, names, names)


def _form(text: str, columns: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return the forms (N, K) of particles, if the file has them: from comments of ours, or coefficients of types."""
    forms: dict[int, list[float]] = {}
    for line in text.splitlines() if "form" in columns else ():
        if line.startswith(_FORM):
            number, _, words = line.removeprefix(_FORM).partition(":")
            forms.setdefault(int(number), []).extend(map(float, words.split()))
    return _form_rows(forms, columns["form"]) if forms else {}


def _form_rows(forms: Mapping[int, Sequence[float]], of: FloatArray) -> dict[str, FloatArray]:
    """Return forms (N, K) by their numbers (N,), shorter ones with zeros behind."""
    unknown = set(of.tolist()) - forms.keys()
    if unknown:
        msg = f"a particle has form {min(unknown):g}, expected one of the {len(forms)} forms that the file lists"
        raise ValueError(msg)
    width = max(map(len, forms.values()))
    rows = {number: [*row, *[0.0] * (width - len(row))] for number, row in forms.items()}
    return {"form": np.array([rows[int(number)] for number in of])}


def _said(text: str, sections: Mapping[str, _Section], columns: dict[str, FloatArray]) -> Said:
    """Collect the metadata of a data file; exponents of types go to the columns."""
    first = text.partition("\n")[0]
    if first.startswith(_TITLE) and "#" in first:
        words = dict(word.split("=", 1) for word in first.split("#")[1].split() if "=" in word)
        law: dict[str, Any] = {k: float(words[k]) for k in ("sides", "power") if k in words}
        law |= {"k_e": stiffness_told(words["k_e"])} if "k_e" in words else {}
        rows = sections["PairIJ Coeffs"].rows if "PairIJ Coeffs" in sections else []
        if not all(_is_of(law.get("k_e", 1.0), row.split()) for row in rows):
            msg = "PairIJ Coeffs differ from k_e in the first line, expected both to agree; change both"
            raise ValueError(msg)
        dimension = int(words["dimension"]) if "dimension" in words else None
        return Said(dimension, words.get("shape", ""), law, is_ours=True)
    for name, n_types in _PAIRS.items():
        shape = sections[name].title.partition("/")[0] if name in sections else ""
        if shape in SHAPES:
            return _of_pairs(shape, [row.split() for row in sections[name].rows], n_types, columns)
    return Said()


def _of_pairs(
    shape: str, rows: Sequence[Sequence[str]], n_types: int, columns: dict[str, FloatArray]
) -> Said:
    """Read the coefficients of our pair styles, as LAMMPS's `write_data` writes them."""
    k_e = _stiffness(rows, n_types)
    own = {int(row[0]): row for row in rows if len(set(row[:n_types])) == 1}
    if SHAPES[shape].has_exponent and not {*_EXPONENT, *_BLOCKS} & set(columns):
        usual = np.ones((1, 1))
        told = {kind: np.array([row[n_types + 1 :]], np.float64) for kind, row in own.items()}
        known = {kind: form if form.size else usual for kind, form in told.items()}
        width = max((form.shape[1] for form in known.values()), default=1)
        wide = [
            SHAPES[shape].widened(known.get(int(kind), usual), width)[0] for kind in columns["type"]
        ]
        columns |= dict(zip(_EXPONENT if width == 1 else _BLOCKS, np.array(wide).T, strict=True))
    if SHAPES[shape].has_form:
        forms = {kind: [float(x) for x in row[n_types + 1 :]] for kind, row in own.items()}
        columns |= _form_rows(forms, columns["type"])
    return Said(shape=shape, law={"k_e": k_e})


def _of_settings(style: str) -> dict[str, Any]:
    """Read the constants of contacts among the settings of a pair style of ours, ``sides one law power 3``."""
    own, _, law = style.partition(" law ")
    sides = {"sides": 1 if own.endswith("sides one") else 2}
    return sides | ({"power": power_of(law)} if law else {})


def _is_of(k_e: Stiffness, row: Sequence[str]) -> bool:
    """Return whether a row I J k_e agrees with known stiffnesses."""
    i, j = (int(kind) - 1 for kind in row[:2])
    if not isinstance(k_e, tuple):
        return float(row[2]) == k_e
    return max(i, j) < len(k_e) and float(row[2]) == k_e[i][j]


def _stiffness(rows: Sequence[Sequence[str]], n_types: int) -> Stiffness:
    """Return k_e from the rows of Pair Coeffs, which LAMMPS mixes for unlike types, or PairIJ Coeffs."""
    found = {tuple(map(int, row[:n_types])): float(row[n_types]) for row in rows}
    types = range(1, max(map(max, found), default=0) + 1)
    pairs = [(i, j) if n_types == 2 else (i,) for i in types for j in types[i - 1 :]]
    if not found or set(pairs) != set(found):
        msg = f"pair coefficients have {len(found)} rows for {len(types)} types, expected {len(set(pairs)) or 'some'}"
        raise ValueError(msg)
    if len(set(found.values())) == 1:
        return next(iter(found.values()))
    if n_types == 1:
        said = (
            "Pair Coeffs state k_e of equal types only: that of unlike ones is the geometric mean, as LAMMPS reads it; write"
            " the file with 'write_data FILE pair ij' to keep others"
        )
        warnings.warn(said, stacklevel=2)
        own = np.array([found[(i,)] for i in types])
        table = np.sqrt(np.multiply.outer(own, own))
        np.fill_diagonal(table, own)
        return stiffness_of(table)
    return stiffness_of([[found[min(i, j), max(i, j)] for j in types] for i in types])


def _digits(rows: Sequence[str], names: Sequence[str], place: Sequence[str] = _POSITION) -> int:
    """Count the digits of coordinates in the first rows."""
    places = [names.index(name) for name in place]
    return most_digits([row.split()[k] for row in rows[:_COUNTED] for k in places])


def _header(lines: Sequence[str]) -> dict[str, list[str]]:
    """Return numbers by the keyword that follows them on their line."""
    header = {}
    for line in lines:
        words = line.split()
        numbers = list(itertools.takewhile(lambda word: not word[0].isalpha(), words))
        header[" ".join(words[len(numbers) :])] = numbers
    return header


def _section(sections: Mapping[str, _Section], name: str, n: int) -> list[str]:
    rows = sections[name].rows if name in sections else []
    if len(rows) != n or n == 0:
        msg = f"section {name} has {len(rows)} rows for {n} atoms, expected one for each ellipsoid"
        raise ValueError(msg)
    return rows


def _bounds(header: Mapping[str, list[str]]) -> tuple[FloatArray, FloatArray]:
    bounds = [header.get(f"{x}lo {x}hi", []) for x in "xyz"]
    tilt = header.get("xy xz yz", ["0"] * 3)
    if any(len(ends) != 2 for ends in bounds) or len(tilt) != 3:
        msg = (
            "the header describes no box, expected 'xlo xhi', 'ylo yhi', 'zlo zhi', and 'xy xz yz' if"
            " it is tilted"
        )
        raise ValueError(msg)
    return np.array(bounds, dtype=np.float64), np.array(tilt, dtype=np.float64)


def _dump_frame(lines: TextIO, *, is_first: bool) -> _Frame:
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
    names = _plain_names(title.split()[2:])
    box = _dump_bounds(items["BOX BOUNDS"])
    columns, others = _dump_columns(names, rows)
    place = next(names for names in _POSITIONS if set(names) <= set(columns))
    said = Said(is_later=True)
    if is_first:
        said = Said(digits=_digits(rows, names, place), is_scaled=place in _POSITIONS[2:])
    step, time = int(items["TIMESTEP"][1]), float(items.get("TIME", ["", "0"])[1])
    boundary = items["BOX BOUNDS"][0]
    return _Frame(_placed(columns, place, box), *box, said, step, time, joined(others), boundary)


def _placed(
    columns: dict[str, FloatArray], place: Sequence[str], box: tuple[FloatArray, FloatArray]
) -> dict[str, FloatArray]:
    """Return columns with positions ``x y z`` from the columns `place`, and images if these are unwrapped."""
    if place == _POSITION:
        return columns
    bounds, tilt = box
    of = Box(bounds[:, 0], bounds[:, 1] - bounds[:, 0], tilt)
    position = np.column_stack([columns[name] for name in place])
    position = of.lo + of.vectors(position) if place in _POSITIONS[2:] else position
    found = dict(columns)
    if place in _POSITIONS[1::2]:
        _, image = of.wrapped(position)
        position = np.where(
            image.any(axis=1, keepdims=True), position - of.vectors(image), position
        )
        found |= dict(zip(_IMAGE, image.T.astype(np.float64), strict=True))
    return found | dict(zip(_POSITION, position.T, strict=True))


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
            not number and name in (*_PROPERTIES, *_EXPONENT, *_BLOCKS, *_WIDTHS)
        ) or name in _PROPERTIES
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
    place = next((own for own in _POSITIONS if set(own) <= set(names)), _POSITION)
    needed = ["id", "type", *place]
    if not set(_WIDTHS) & set(names) or set(_PROPERTIES) & set(names):
        needed += _PROPERTIES
    missing = [name for name in needed if name not in names]
    if missing:
        msg = (
            f"columns {' '.join(missing)!r} are missing, expected {' '.join(_DUMP_COLUMNS)!r}, or such as"
            " c_q[1] to c_q[4] and c_shape[1] to c_shape[3]"
        )
        raise ValueError(msg)
    optional = (
        *_IMAGE,
        *_EXPONENT,
        *_BLOCKS,
        *_ROUNDNESS,
        *(() if "shapex" in needed else _WIDTHS),
    )
    known = _columns(rows, names, [*needed, *(name for name in optional if name in names)])
    if "shapex" not in known:
        known |= _round(known)
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
