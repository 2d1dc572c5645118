"""GSD files of the HOOMD schema, readable by HOOMD-blue, freud, OVITO, fresnel and MDAnalysis.

A frame is a packing in a box around 0, of height 0 in 2D. Every species is a type, or several if its
particles differ; `particles/type_shapes` describes each: a sphere, an ellipsoid, a union of spheres,
or else a mesh with vertices on the surface. (GSD can describe a rod as a polyhedron of two vertices with a rounding
radius, but OVITO reads that only along z, not along the axis of our rods.)

GSD uses single precision. So a frame also logs the whole packing under `log/jamshape` and
`log/particles/jamshape`, and is read back from there to the last bit. If another program has since changed the
single-precision numbers, these take precedence: see `jamshape.exchange.edited`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping
from functools import lru_cache, singledispatch
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray, IntArray
from jamshape.exchange.edited import as_edited
from jamshape.exchange.fields import alike, box_fields, centered, packing_of, particle_fields
from jamshape.exchange.tools import tool
from jamshape.files.disk import PathLike, replacing
from jamshape.files.frames import Form, row_of
from jamshape.files.hdf5 import FileFormatError
from jamshape.files.vocabulary import FORMAT_VERSION, require_format
from jamshape.packing import Packing
from jamshape.shapes.mesh import SurfaceMesh
from jamshape.shapes.shape import Interaction
from jamshape.shapes.solid import Balls, RoundedPolygon, Solid, Superquadric
from jamshape.shapes.table import shape_named

LOG = "jamshape/"
"""Prefix of the data of a packing in the log of a frame."""

_PARTICLES = "particles/jamshape/"
_COLUMNS = "columns/"

_FINE, _COARSE = 3, 1  # levels of meshes, so that files stay small
_FEW, _MANY = 8, 64  # numbers of types up to which meshes are fine and medium


def write_gsd(path: PathLike, packings: Packing | Iterable[Packing]) -> None:
    """Write packings as the frames of a GSD file; an existing file is replaced only when writing is complete.

    Parameters
    ----------
    path : path-like
    packings : Packing or iterable of Packing
        Frames, all in 2D or all in 3D; a run from `jamshape.load` is one. Of their other columns, numbers that all
        frames have are written.

    Raises
    ------
    ValueError
        If there is no packing, or dimensions differ.
    ImportError
        If gsd is not installed.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from jamshape.exchange.gsd import read_gsd, write_gsd
    >>> from jamshape.protocols.random_start import random_packing
    >>> packing = random_packing(n=8, phi=0.3, seed=1)
    >>> write_gsd("rods.gsd", packing)
    >>> bool((read_gsd("rods.gsd").position == packing.position).all())
    True
    """
    frames = [packings] if isinstance(packings, Packing) else list(packings)
    dimensions = sorted({packing.dimension for packing in frames})
    if len(dimensions) != 1:
        msg = f"the packings are in {dimensions} dimensions, expected one or more of one dimension"
        raise ValueError(msg)
    hoomd = tool("gsd.hoomd", "gsd")
    form = Form()
    columns = set(frames[0].columns)
    for packing in frames:
        form = form.joined(Form.of(packing))
        columns &= {name for name, x in packing.columns.items() if x.dtype.kind in "iuf"}
    if texts := {name for p in frames for name, x in p.columns.items() if x.dtype.kind == "U"}:
        said = f"{path} is a GSD file, which holds numbers: the columns {', '.join(sorted(texts))} are left out"
        warnings.warn(said, stacklevel=2)
    with replacing(path) as temporary, hoomd.open(str(temporary), "w") as file:
        for packing in frames:
            held = {name: x for name, x in packing.columns.items() if name in columns}
            file.append(_frame(hoomd, packing.with_(columns=held), form))


def read_gsd(path: PathLike, frame: int = -1) -> Packing:
    """Read one frame of a file from `write_gsd`, to the last bit.

    Positions, orientations and box that another program has changed since are read in single
    precision.

    Parameters
    ----------
    path : path-like
    frame : int
        Counted from 0 or, if negative, from the end.

    Raises
    ------
    FileFormatError
        If the file has another origin, or another program has changed the kinds of particles or their number.
    ValueError
        If the frame does not exist.
    ImportError
        If gsd is not installed.
    OSError
        If the file cannot be opened.
    """
    hoomd = tool("gsd.hoomd", "gsd")
    with opened_gsd(hoomd, path) as file:
        return _packing(path, hoomd, file[row_of(frame, len(file), path)])


def read_gsd_clock(path: PathLike) -> tuple[IntArray, FloatArray]:
    """Read steps (T,) and times (T,) of the frames; errors as `read_gsd`."""
    with opened_gsd(tool("gsd.hoomd", "gsd"), path) as file:
        chunks = (("configuration/step", 0), (f"log/{LOG}time", 0.0))
        step, time = (
            [file.file.read_chunk(k, name)[0] if file.file.chunk_exists(k, name) else otherwise
             for k in range(len(file))]
            for name, otherwise in chunks
        )  # fmt: skip
        return np.array(step, np.int64), np.array(time, np.float64)


def opened_gsd(hoomd: Any, path: PathLike) -> Any:
    """Open a GSD file for reading, or refuse it."""
    try:
        return hoomd.open(str(path), "r")
    except RuntimeError as error:
        msg = f"{path}: {error}, expected a GSD file; write it with write_gsd"
        raise FileFormatError(msg) from error


def _frame(hoomd: Any, packing: Packing, form: Form) -> Any:
    """Make a frame, with all fields of the other frames: GSD reads missing ones from the first."""
    seen, frame = centered(packing), hoomd.Frame()
    kinds = alike(packing, packing.species)
    frame.configuration.step = packing.step
    frame.configuration.dimensions = packing.dimension
    frame.configuration.box = seen.box
    frame.particles.N = packing.n
    frame.particles.position = seen.position
    frame.particles.image = seen.image
    frame.particles.orientation = packing.quaternions
    frame.particles.typeid = kinds.of
    species = packing.species[kinds.first]
    frame.particles.types = _names([str(k) for k in species])
    level = _FINE if len(species) <= _FEW else _COARSE + (len(species) <= _MANY)
    frame.particles.type_shapes = [_type_shape(_Body.of(packing, i, level)) for i in kinds.first]
    exact = {_PARTICLES + name: x for name, x in particle_fields(packing, rests=form.rests).items()}
    exact |= {f"{_PARTICLES}{_COLUMNS}{name}": x for name, x in packing.columns.items()}
    of_box = box_fields(packing, rests=form.rests, tilted=form.tilted)
    exact |= {LOG + name: x for name, x in of_box.items()}
    exact[LOG + "time"] = np.array([packing.time])
    exact[LOG + "format_version"] = np.array([FORMAT_VERSION])
    exact[LOG + "law"] = np.hstack([np.ravel(x) for x in packing.law.stated().values()])
    # As numbers: OVITO before 3.17 fails on texts.
    exact[LOG + "shape_style"] = np.frombuffer(packing.shape_style.encode(), np.uint8)
    frame.log = exact
    return frame


def _names(species: list[str]) -> list[str]:
    """Name types by their species, with a number if a species has several."""
    seen: dict[str, int] = {}
    names = []
    for name in species:
        seen[name] = seen.get(name, 0) + 1
        names.append(name if species.count(name) == 1 else f"{name}.{seen[name]}")
    return names


class _Body(NamedTuple):
    """Properties that determine the description of a body."""

    style: str
    diameters: tuple[float, ...]
    form: tuple[float, ...]
    is_round: bool
    level: int

    @classmethod
    def of(cls, packing: Packing, i: int, level: int) -> _Body:
        sizes = tuple(packing.diameters[i].tolist())
        is_round = bool(packing.is_round[i])
        return cls(packing.shape_style, sizes, tuple(packing.form[i].tolist()), is_round, level)


@lru_cache(maxsize=4096)  # frames of a run have the same particles
def _type_shape(body: _Body) -> dict[str, Any]:
    """Describe a particle in the terms of `particles/type_shapes`."""
    if body.is_round:
        return {"type": "Sphere", "diameter": body.diameters[0]}
    shape, diameters = shape_named(body.style), np.array(body.diameters)
    form = np.array(body.form)
    known = _described(shape.solid(diameters, form))
    return known or _mesh(shape.surface(diameters, form, body.level))


@singledispatch
def _described(solid: Solid) -> dict[str, Any]:
    """Describe a body exactly; empty if GSD cannot."""
    del solid
    return {}


@_described.register
def _(solid: Superquadric) -> dict[str, Any]:
    axes = dict(zip("abc", solid.semi_axes.tolist(), strict=True))
    return {"type": "Ellipsoid", **axes} if set(solid.roundness) == {1.0} else {}


@_described.register
def _(solid: Balls) -> dict[str, Any]:
    centers = solid.centers.tolist()
    diameters = (2 * solid.radii).tolist()
    return {"type": "SphereUnion", "diameters": diameters, "centers": centers}


@_described.register
def _(solid: RoundedPolygon) -> dict[str, Any]:
    vertices = solid.corners.tolist()
    return {"type": "Polygon", "rounding_radius": solid.radius, "vertices": vertices}


def _mesh(surface: SurfaceMesh) -> dict[str, Any]:
    corners = [[float(f"{x:.7g}") for x in corner] for corner in surface.vertices.tolist()]
    return {"type": "Mesh", "vertices": corners, "indices": surface.triangles.tolist()}


def _packing(path: PathLike, hoomd: Any, frame: Any) -> Packing:
    logged: Mapping[str, Any] = frame.log
    prefixes = (LOG, _PARTICLES)
    found = {
        name.removeprefix(prefix): value
        for name, value in logged.items()
        for prefix in prefixes
        if name.startswith(prefix)
    }
    try:
        style, time = bytes(found.pop("shape_style")).decode(), float(found.pop("time")[0])
        require_format(path, int(found.pop("format_version", [2])[0]), "0.1.0")
        columns = [name for name in found if name.startswith(_COLUMNS)]
        found["columns"] = {name.removeprefix(_COLUMNS): found.pop(name) for name in columns}
        n = math.isqrt(len(found["law"]) - 1)
        numbers, others = np.split(found["law"], [n * n])
        k_e = np.reshape(numbers, (n, n)) if n > 1 else numbers[0]
        told = dict(zip(Interaction._fields[1:], others.tolist(), strict=False))
        found["law"] = Interaction.told({"k_e": k_e, **told})
        packing = packing_of(found, style, int(frame.configuration.step), time)
        return as_edited(packing, _frame(hoomd, packing, Form.of(packing)), frame)
    except (KeyError, TypeError) as error:
        msg = f"{path}: holds no log/jamshape of a packing, expected a file of write_gsd"
        raise FileFormatError(msg) from error
    except FileFormatError:
        raise
    except ValueError as error:
        msg = f"{path}: {error}"
        raise FileFormatError(msg) from error
