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

import io
import os
import warnings
import weakref
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.files.dump_index import index_of
from jamshape.files.frames import row_of
from jamshape.files.h5md import FileFormatError, PathLike, read_packing, replacing
from jamshape.files.lammps_columns import (
    BLOCK_COMMENT,
    BLOCKS,
    DIAMETERS,
    EXPONENT,
    EXPONENT_COMMENT,
    FORM_COMMENT,
    IMAGE,
    POSITION,
    PROPERTIES,
    QUATERNION,
    ROUNDNESS,
    TITLE,
    Frame,
    whole,
)
from jamshape.files.lammps_data_text import data_frame, law_of_settings, said_by_pairs
from jamshape.files.lammps_dump_text import dump_frame
from jamshape.files.meaning import PLANE, Geometry, Said, Wanted, meaning_of, require_told
from jamshape.files.signature import DUMP, GSD, HDF5, REFUSED, format_of
from jamshape.files.unpacked import opened_plain
from jamshape.packing import Box, Packing, angle_from_quaternion
from jamshape.packing.columns import flat
from jamshape.shapes.shape import stiffness_text
from jamshape.shapes.table import SHAPES, shape_named

_NUMBERS_IN_LINE = 8
_ALIKE = 1e-9  # relative difference of exponents that rounding leaves


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
        has_both = packing.shape.has_exponent and packing.form.shape[1] == len(BLOCKS)
        if blocks or has_both:
            row += ["%.17g" if blocks else f"# {BLOCK_COMMENT}%.17g", "%.17g"]
            ellipsoids = np.column_stack([ellipsoids, _both_exponents(packing)])
        elif packing.shape.has_exponent:
            row += [f"# {EXPONENT_COMMENT}%.17g"]
            ellipsoids = np.column_stack([ellipsoids, packing.exponent])
        if packing.shape.has_form:
            row += [f"# {FORM_COMMENT}%d"]
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
        return packing.shape.widened(packing.form, len(BLOCKS))
    return np.full((packing.n, len(BLOCKS)), 2.0)


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
    columns |= dict(zip(POSITION, _padded(packing.position).T, strict=True))
    columns |= dict(zip(IMAGE, _padded(packing.image).astype(np.int64).T, strict=True))
    columns |= dict(zip(PROPERTIES, [*packing.quaternions.T, *packing.diameters.T], strict=True))
    if packing.shape.has_exponent and packing.form.shape[1] == len(BLOCKS):
        columns |= dict(zip(BLOCKS, packing.form.T, strict=True))
        columns |= dict(zip(ROUNDNESS, 2 / packing.form.T, strict=True))
    elif packing.shape.has_exponent:
        columns |= {"exponent": packing.exponent, **dict.fromkeys(ROUNDNESS, 1 / packing.exponent)}
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
    known = ("id", "type", *POSITION, *IMAGE, *PROPERTIES, *EXPONENT, *BLOCKS, *ROUNDNESS)
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
        return _packing(path, data_frame(text), Wanted(dimension, shape))
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
            read = dump_frame(lines, is_first=not self._is_told)
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
    title = f"{TITLE} # " + " ".join(f"{name}={value}" for name, value in told.items())
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


def _packing(path: PathLike, frame: Frame, wanted: Wanted) -> Packing:
    def stack(names: Sequence[str]) -> FloatArray:
        return np.column_stack([frame.columns[name] for name in names])

    exponent, others = _exponent(frame.columns), dict(frame.others)
    told = wanted.shape or frame.said.shape
    if told and not shape_named(told).has_exponent and (exponent == 1).all():
        exponent = np.empty(0)  # those of the ellipsoids in which LAMMPS holds any shape
    form = others.pop("form", frame.columns.get("form", np.empty((0, 0))))
    quaternion = stack(QUATERNION)
    there = Geometry(stack(POSITION), quaternion, stack(DIAMETERS), frame.bounds, frame.tilt)
    said = replace(frame.said, has_exponent=len(exponent) > 0, form=form)
    dimension, shape, law = meaning = meaning_of(path, there, said, wanted)
    quaternion = meaning.turned(quaternion)
    lo, hi = frame.bounds[:dimension].T
    has_image = set(IMAGE) <= set(frame.columns)
    packing = Packing(
        position=there.position[:, :dimension],
        orientation=angle_from_quaternion(quaternion) if dimension == 2 else quaternion,
        diameters=shape.diameters,
        species=whole(frame.columns["type"]),
        id=whole(frame.columns["id"]),
        image=whole(stack(IMAGE[:dimension])) if has_image else np.empty((0, 0), np.int64),
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
        said = said_by_pairs(shape, [row.split() for row in rows], 2, columns)
        said = replace(said, law={**said.law, **law_of_settings(style)})
    (bounds, tilt), boundary = box
    return _packing(name, Frame(columns, bounds, tilt, said, boundary=boundary), wanted)


def _require_closed(path: PathLike, packing: Packing, frame: Frame) -> None:
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
    if set(EXPONENT) <= set(columns):
        return columns["exponent"]
    for names, power in ((BLOCKS, 1), (ROUNDNESS, -1)):
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
