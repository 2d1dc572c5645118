"""States of a LAMMPS instance in this process: read as packings, and set from packings."""

from __future__ import annotations

import ctypes
import functools
import os
import warnings
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import IntArray
from jamshape.files.lammps_text import packing_of_columns
from jamshape.files.meaning import Wanted
from jamshape.lammps.module import info, one_at_a_time, require_open, run_command
from jamshape.lammps.plugin import PluginError, built_for, plugin_path
from jamshape.packing import Packing

NAME = "the LAMMPS instance"
_COMPUTE = "jamshape_living"
_PROPERTIES = ("quatw", "quati", "quatj", "quatk", "shapex", "shapey", "shapez")
_IMAGE_BITS = {4: (10, 12), 8: (21, 22)}  # of x and y, and of z, by the bytes of all
# Fixes whose forces or constraints are not those of particles on each other.
_HOLDING = ("wall", "freeze", "setforce", "spring", "move", "rigid", "addforce", "gravity", "indent", "lineforce", "planeforce")  # fmt: skip


@runtime_checkable
class Living(Protocol):
    """An object ``lammps.lammps``, or a session, which has one."""

    lmp: Any


def read_living(living: Living, wanted: Wanted) -> Packing:
    """Read the present state of a LAMMPS instance, in the order of its IDs.

    Shape, k_e, sides, law and exponents are those of its pair style, if it is one of ours; otherwise they are guessed as for
    files, with a warning.

    Parameters
    ----------
    living : lammps.lammps or Session
    wanted : Wanted
        Shape, where the pair style is another.

    Raises
    ------
    ValueError
        If it has several processes, no particles, or other atoms than ellipsoids.
    """
    lmp = _instance(living)
    with one_at_a_time():
        columns = _columns(lmp)
        lo, hi, xy, yz, xz, periodic, *_ = lmp.extract_box()
        boundary = " ".join("pp" if flag else "ff" for flag in periodic)
        bounds = np.column_stack([lo, hi])
        pair = _pair(lmp)
        _warn_of_fixes(lmp)
        step = int(lmp.extract_global("ntimestep"))
        dimension = int(lmp.extract_setting("dimension"))
    if wanted.dimension not in {None, dimension}:
        msg = f"{NAME} has dimension {dimension}, expected {wanted.dimension}; leave dimension out"
        raise ValueError(msg)
    box = bounds, np.array([xy, xz, yz])
    told = Wanted(dimension, wanted.shape)
    return packing_of_columns(NAME, columns, (box, boundary), pair, told).with_(step=step)


def write_living(packing: Packing, living: Living) -> None:
    """Set positions, orientations, images and box of the same particles in a LAMMPS instance; see `Packing.to_lammps`."""
    lmp = _instance(living)
    with one_at_a_time():
        library = _library(lmp)
        if library is None:
            msg = f"{NAME} has another version than the plugin was built for, expected the same; install jamshape again"
            raise ValueError(msg)
        _require_same(packing, lmp)
        _set_box(packing, lmp)
        rows = _rows_of(lmp, packing)
        offset, turns = packing.box.wrapped(packing.position)
        d = packing.dimension
        _atoms(lmp, "x")[:, :d] = (packing.box.lo + offset)[rows]
        images = np.zeros((packing.n, 3), np.int64)
        images[:, :d] = (packing.image + turns)[rows]
        _set_images(lmp, images)
        quaternions = np.ascontiguousarray(packing.quaternions[rows])
        library.jamshape_orient(
            lmp.lmp, quaternions.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        )


def _instance(living: Living) -> Any:
    """Return the object ``lammps.lammps`` of one process, with ellipsoids."""
    lmp: Any = living if hasattr(living, "extract_box") else living.lmp
    processes = require_open(lmp).extract_setting("world_size")
    if processes > 1:
        msg = (
            f"{NAME} has {processes} processes, expected one: write a data file in LAMMPS (write_data) and load that, or"
            " save the packing as a data file and read it there"
        )
        raise ValueError(msg)
    if lmp.get_natoms() < 1:
        msg = f"{NAME} has no atoms, expected particles; create or read them first"
        raise ValueError(msg)
    if not lmp.extract_atom("ellipsoid"):
        msg = f"{NAME} has atoms that are not ellipsoids, expected atom_style ellipsoid"
        raise ValueError(msg)
    return lmp


def _atoms(lmp: Any, name: str) -> NDArray[Any]:
    """Return a view of a property of all atoms."""
    n = lmp.extract_setting("nlocal")
    return np.asarray(lmp.numpy.extract_atom(name)[:n])


def _columns(lmp: Any) -> dict[str, NDArray[Any]]:
    """Read what dumps have as columns, in the order of the IDs."""
    run_command(lmp, f"compute {_COMPUTE} all property/atom {' '.join(_PROPERTIES)}")
    try:
        bodies = np.array(lmp.numpy.extract_compute(_COMPUTE, 1, 2)[: lmp.get_natoms()])
    finally:
        run_command(lmp, f"uncompute {_COMPUTE}")
    found = {"id": _atoms(lmp, "id"), "type": _atoms(lmp, "type")}
    found |= dict(zip(("x", "y", "z"), _atoms(lmp, "x").T, strict=True))
    found |= dict(zip(("ix", "iy", "iz"), _images(lmp).T, strict=True))
    found |= dict(zip(_PROPERTIES, bodies.T, strict=True))
    order = np.argsort(found["id"])
    return {name: column[order].astype(np.float64) for name, column in found.items()}


def _images(lmp: Any) -> IntArray:
    """(N, 3) images, which LAMMPS packs into one number."""
    packed = _atoms(lmp, "image").astype(np.int64)
    bits, last = _IMAGE_BITS[lmp.extract_setting("imageint")]
    places = ((0, bits), (bits, bits), (2 * bits, last))
    parts = [packed >> at & ((1 << width) - 1) for at, width in places]
    return np.column_stack(parts) - (1 << (bits - 1))


def _set_images(lmp: Any, images: IntArray) -> None:
    target = _atoms(lmp, "image")
    bits, _ = _IMAGE_BITS[lmp.extract_setting("imageint")]
    x, y, z = (images + (1 << (bits - 1))).T
    target[:] = (x | y << bits | z << (2 * bits)).astype(target.dtype)


def _library(lmp: Any) -> Any:
    """Return the plugin; None if there is none for this LAMMPS."""
    try:
        path = plugin_path()
        if built_for(path) != lmp.version():
            return None
    except PluginError:
        return None
    return _loaded(os.fspath(path))


@functools.cache
def _loaded(path: str) -> Any:
    library = ctypes.CDLL(path)
    library.jamshape_pair.argtypes, library.jamshape_pair.restype = (
        [ctypes.c_void_p],
        ctypes.c_char_p,
    )
    library.jamshape_orient.argtypes = [ctypes.c_void_p, ctypes.POINTER(ctypes.c_double)]
    library.jamshape_orient.restype = None
    return library


def _pair(lmp: Any) -> str:
    """Return the pair style as the plugin lists it; "" if it is not one of ours."""
    library = _library(lmp)
    return "" if library is None else str(library.jamshape_pair(lmp.lmp).decode())


def _warn_of_fixes(lmp: Any) -> None:
    """Warn of fixes that act on particles in other ways than contacts between them."""
    styles = [
        line.partition("style = ")[2].partition(",")[0].strip() for line in info(lmp, "fixes")
    ]
    found = sorted({style for style in styles if style.startswith(_HOLDING)})
    if found:
        said = (
            f"{NAME} has the fixes {', '.join(found)}: the packing has only the contacts of its particles, none of which"
            " is held; unfix what should not act"
        )
        warnings.warn(said, stacklevel=3)


def _require_same(packing: Packing, lmp: Any) -> None:
    """Refuse another number, dimension or IDs of particles."""
    dimension = int(lmp.extract_setting("dimension"))
    if (packing.n, packing.dimension) != (lmp.get_natoms(), dimension):
        msg = (
            f"{NAME} has {lmp.get_natoms()} atoms in {dimension}D, expected the {packing.n} particles in {packing.dimension}D"
            " of the packing; load the packing into a new instance"
        )
        raise ValueError(msg)
    _rows_of(lmp, packing)


def _rows_of(lmp: Any, packing: Packing) -> IntArray:
    """Return the rows of a packing in the order of LAMMPS's atoms."""
    ids, order = _atoms(lmp, "id"), np.argsort(packing.id)
    own = packing.id[order]
    if not np.array_equal(np.sort(ids), own):
        msg = f"{NAME} has atoms of other IDs than the packing, expected the same; load the packing into a new instance"
        raise ValueError(msg)
    return np.asarray(order[np.searchsorted(own, ids)])


def _set_box(packing: Packing, lmp: Any) -> None:
    lo, hi, xy, yz, xz, *_ = lmp.extract_box()
    box, d = packing.box, packing.dimension
    tilt = np.array([xy] if d == 2 else [xy, xz, yz])
    if all(map(np.array_equal, (lo[:d], hi[:d], tilt), (box.lo, box.lo + box.edges, box.tilt))):
        return
    if box.is_tilted and not lmp.extract_setting("triclinic"):
        run_command(lmp, "change_box all triclinic")
    ends = zip("xyz", box.lo, box.lo + box.edges, strict=False)
    words = [f"{name} final {low:.17g} {high:.17g}" for name, low, high in ends]
    if lmp.extract_setting("triclinic"):
        words += [
            f"{name} final {x:.17g}" for name, x in zip(("xy", "xz", "yz"), box.tilt, strict=False)
        ]
    run_command(lmp, f"change_box all {' '.join(words)} units box")
