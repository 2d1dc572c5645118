"""Packings and runs in MDAnalysis, which supports only three dimensions.

Planar packings lie at z = 0 of a box of unit height. The file is H5MD like ours, with its particles under the name
that MDAnalysis expects, and with lengths in Angstrom and times in picoseconds: MDAnalysis supports no others,
and so takes our numbers unchanged.
"""

from __future__ import annotations

import atexit
import itertools
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.exchange.fields import in_space
from jamshape.exchange.tools import tool
from jamshape.files import layout
from jamshape.files.disk import PathLike
from jamshape.files.h5md import count_frames, read_packing
from jamshape.files.hdf5 import put, written
from jamshape.packing import Packing

if TYPE_CHECKING:
    import h5py

Source = Packing | Iterable[Packing] | PathLike

_HEIGHT = 1.0  # of planar boxes, [length]
_ELEMENTS = ("position", "box/edges")
_numbers = itertools.count()  # of temporary files
_GROUP = "particles/trajectory"  # with this name MDAnalysis needs no topology to count atoms


def to_mdanalysis(source: Source, path: PathLike | None = None) -> Any:
    """Convert packings for MDAnalysis.

    Parameters
    ----------
    source : Packing, iterable of Packing, or path of one of our H5MD files
        A run gives a trajectory of all its frames.
    path : path-like, optional
        Path of the trajectory for `write_mdanalysis`; by default in a temporary folder, until this process
        ends.

    Returns
    -------
    MDAnalysis.Universe
        One atom per particle, each a residue of its own, in the order of the packing: `ids` and `resids` are our IDs,
        `types` our species, `names` and `resnames` the shape, `radii` those of the circumscribed spheres,
        [length], `masses` the areas (volumes). `trajectory.ts.data` holds `orientation`, (N, 4) quaternions
        w i j k, and the step.

    Raises
    ------
    ImportError
        If MDAnalysis is not installed.
    FileFormatError, OSError
        As in `read_packing`.
    ValueError
        If there is no packing, or frames differ in their particles.

    Examples
    --------
    >>> from jamshape.exchange.mdanalysis import to_mdanalysis
    >>> from jamshape.protocols.random_start import random_packing
    >>> universe = to_mdanalysis(random_packing(n=8, phi=0.3, seed=1))
    >>> len(universe.atoms), float(universe.dimensions[2])
    (8, 1.0)
    """
    analysis = tool("MDAnalysis", "MDAnalysis")
    if path is None:
        path = _temporary_folder() / f"{next(_numbers)}.h5md"
    first = write_mdanalysis(path, source)
    universe = analysis.Universe.empty(
        first.n, n_residues=first.n, atom_resindex=np.arange(first.n), residue_segindex=None
    )
    for name, values in _topology(first).items():
        universe.add_TopologyAttr(name, values)
    universe.load_new(str(path), format="H5MD")
    return universe


def write_mdanalysis(path: PathLike, source: Source) -> Packing:
    """Write packings as a trajectory that ``MDAnalysis.Universe(path, format="H5MD")`` opens.

    Parameters
    ----------
    path : path-like
        Replaced only when writing is complete; the suffix ``.h5md`` selects the format in MDAnalysis.
    source : see `to_mdanalysis`

    Returns
    -------
    Packing
        The first frame.

    Raises
    ------
    FileFormatError, OSError, ValueError
        As in `to_mdanalysis`.
    """
    with written(path) as file:
        return _write(file, source)


@cache
def _temporary_folder() -> Path:
    """Make a folder that is removed when the process ends: MDAnalysis reopens a file for each loop over it."""
    folder = tempfile.mkdtemp(prefix="jamshape-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def _frames(source: Source) -> Iterator[Packing]:
    if isinstance(source, Packing):
        yield source
    elif isinstance(source, str | os.PathLike):
        yield from (read_packing(source, k) for k in range(count_frames(source)))
    else:
        yield from source


def _write(file: h5py.File, source: Source) -> Packing:
    """Write all frames and return the first one."""
    frames = _frames(source)
    first = next(frames, None)
    if first is None:
        msg = "there is no packing, expected at least one"
        raise ValueError(msg)
    rows, clocks = [], []
    for k, packing in enumerate(itertools.chain([first], frames)):
        _require_same(first, packing, k)
        rows.append(_values(packing))
        clocks.append((packing.step, packing.time))
    layout.write_metadata(file)
    group = file.create_group(_GROUP)
    clock = group.create_group("position")
    for name, column in zip(("step", "time"), zip(*clocks, strict=True), strict=True):
        put(clock, name, np.array(column))
    # MDAnalysis reads no strings of fixed length, though those of variable length have no checksum.
    clock["time"].attrs["unit"] = "ps"
    for name in rows[0]:
        element = (file if name == "observables/orientation" else group).require_group(name)
        put(element, "value", np.stack([row[name] for row in rows]))
        if element != clock:
            element["step"], element["time"] = clock["step"], clock["time"]
        if name in _ELEMENTS:
            element["value"].attrs["unit"] = "Angstrom"
    group["box"].attrs["dimension"] = 3
    group["box"].attrs["boundary"] = np.array([b"periodic"] * 3)
    return first


def _values(packing: Packing) -> dict[str, Any]:
    """Return the data of a frame; the box begins at 0, as in MDAnalysis."""
    # Always edge vectors as rows: frames with and without tilt have one layout.
    edges = _HEIGHT * np.eye(3)
    edges[: packing.dimension, : packing.dimension] = packing.box.matrix.T
    return {
        "position": in_space(packing.position - packing.box.lo),
        "box/edges": edges,
        "observables/orientation": packing.quaternions,
    }


def _require_same(first: Packing, packing: Packing, frame: int) -> None:
    for name in ("dimension", "id"):
        if not np.array_equal(getattr(first, name), getattr(packing, name)):
            msg = (
                f"frame {frame} differs from the first one in {name}, expected the same particles in"
                " the same order (Packing.sorted_by_id)"
            )
            raise ValueError(msg)


def _topology(packing: Packing) -> dict[str, Any]:
    n, name = packing.n, packing.shape_style
    return {
        "names": [name] * n,
        "types": packing.species.astype(str).tolist(),
        "ids": packing.id,
        "radii": packing.outer_radius,
        "masses": packing.measures,
        "resids": packing.id,
        "resnames": [name] * n,
        "segids": ["packing"],
    }
