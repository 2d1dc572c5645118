"""Files of jamshape 0.1.0 and before, in today's format and under today's names.

Nothing else knows earlier formats. Their files have no checksums and no kind of a run. Before 0.1.0, the pressure was
called `p`, as was the exponent in files of bodies with axis ratios `w1` and `w2`, and protocols of Yuan et al. 2019 were
numbered.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from jamshape.exchange.gsd import LOG, opened_gsd
from jamshape.exchange.tools import tool
from jamshape.files import hdf5, layout
from jamshape.files.content import Content
from jamshape.files.disk import replacing
from jamshape.files.hdf5 import FileFormatError
from jamshape.files.signature import GSD, HDF5, format_of
from jamshape.files.vocabulary import FORMAT_VERSION, KIND, protocol_named, require_format
from jamshape.front.recorded import KINDS
from jamshape.old_names import VALUES
from jamshape.packing import Packing
from jamshape.protocols.approach import FOR_A_PACKING
from jamshape.protocols.make import MAKING
from jamshape.shapes.shape import Interaction
from jamshape.shapes.table import SHAPES
from jamshape.vibration.ensembles import PREFIX
from jamshape.vibration.table import (
    COUNTS,
    ERRORS,
    MODULI,
    PARTS,
    holds_modes,
    table_of,
    write_modes,
)

if TYPE_CHECKING:
    import h5py

_Value = TypeVar("_Value")

_UNSTATED = 2  # version of files of modes and GSD files without one

_MARKS = {
    "search_step": MAKING,
    "strict_search": MAKING,
    "retry_budget": MAKING,
    "loose_phi": MAKING,
    "stage": MAKING,
    "flow_steps": "slow compression",
    "restart_step": FOR_A_PACKING,
    "rate": FOR_A_PACKING,
    "of_packing": FOR_A_PACKING,
    "shear_steps": "quasistatic shear",
    "amplitude": "cyclic shear",
    "gdot": "shear",
    "finished": "compression",
}
"""Kinds of runs by attributes that only their files had; the first counts, and packings have none."""


class Converted(NamedTuple):
    """A file that was converted."""

    kind: str
    version: int
    """Format version before."""
    finished: bool = True


def convert(path: Path, out: Path) -> Converted | None:
    """Write a file in today's format; return None, without writing, for a file that has it.

    Parameters
    ----------
    path : Path
    out : Path
        File to write, which may be the same.

    Raises
    ------
    FileFormatError
        If it is not a file of jamshape, damaged, or of a later version.
    ImportError
        If it is a GSD file, and gsd is not installed.
    OSError
        If it cannot be read or written.
    """
    form = format_of(path)
    if form == GSD:
        return _gsd(path, out)
    if form == HDF5:
        return _modes(path, out) if holds_modes(path) else _particles(path, out)
    msg = (
        f"{path} has no format that jamshape converts, expected a packing, a run or modes in HDF5, or a GSD file;"
        " leave it out"
    )
    raise FileFormatError(msg)


def renamed(found: Mapping[str, _Value]) -> dict[str, _Value]:
    """Return attributes or observables under today's names, and with today's values.

    Examples
    --------
    >>> renamed({"alpha": 4.0, "p": 1e-8})
    {'alpha': 4.0, 'pressure': 1e-08}
    >>> renamed({"p": 1.5, "w1": 1.0, "pressure": 1e-6})
    {'exponent': 1.5, 'w1': 1.0, 'pressure': 1e-06}
    >>> renamed({"way": "quasistatic", "outcome": "corner"})
    {'protocol': 'quasistatic', 'outcome': 'kink'}
    """
    names = {"p": "exponent" if "w1" in found else "pressure", "way": "protocol"}
    now = {names.get(name, name): value for name, value in found.items()}
    return {name: _current(name, value) for name, value in now.items()}


def _current(name: str, value: Any) -> Any:
    if name == "protocol":
        return protocol_named(value)
    return VALUES.get(name, {}).get(value, value) if isinstance(value, str) else value


def _is_current(path: Path, version: int, creator: str) -> bool:
    """Whether a file has today's format; a later one is refused."""
    if version >= FORMAT_VERSION:
        require_format(path, version, creator)
    return version >= FORMAT_VERSION


# --- packings and runs ---------------------------------------------------------------------------


def _particles(path: Path, out: Path) -> Converted | None:
    with hdf5.reading(path) as file:
        layout.check_version_of_h5md(file)
        creator = hdf5.attributes_of(hdf5.require_item(file, "h5md/creator"))
        if creator.get("name") != layout.CREATOR:
            msg = f"{path} was written by {creator.get('name')}, expected a file of jamshape; leave it out"
            raise FileFormatError(msg)
        version = layout.version_of(file)
        if _is_current(path, version, str(creator.get("version"))):
            return None
        content = Content.of(out, file)
        has_law = "k_e" in hdf5.require_item(file, "particles/all").attrs
    if not has_law:
        law = Interaction.told(content.attributes)
        content.frames = [frame.with_(law=law) for frame in content.frames]
    content.attributes = _of_today(content.attributes, content.frames[0])
    content.columns = renamed(content.columns)
    with hdf5.written(out) as file:
        content.fill(file)
        attributes = file["h5md/creator"].attrs
        del attributes["origin"]  # bits are those of the machine that computed them
        if "origin" in creator:
            attributes["origin"] = np.bytes_(creator["origin"])
    known = content.attributes
    return Converted(known.get(KIND, "packing"), version, bool(known.get("finished", True)))


def _of_today(attributes: Mapping[str, Any], first: Packing) -> dict[str, Any]:
    """Return the attributes of a packing or a run under today's names, with what all runs state."""
    known = renamed(attributes)
    if {"phi_unjams", "phi_jams", "frames_minimised"} <= known.keys():
        known = {"frames_undecided": 0} | known
    kind = known.get(KIND) or next((_MARKS[mark] for mark in _MARKS if mark in known), None)
    if kind not in KINDS:
        return known
    if kind == "slow compression" and "gdot" in known:
        kind = "slow shear"
    usual = {"finished": False, "dimension": first.dimension, **first.law.stated()}
    return usual | known | {KIND: kind}


# --- modes ---------------------------------------------------------------------------------------


def _modes(path: Path, out: Path) -> Converted | None:
    with hdf5.readable(path), hdf5.Image(path, path.read_bytes()).open("r+") as file:
        group = hdf5.attributes_of(hdf5.require_item(file, "modes"))
        version = int(group.get("format_version", _UNSTATED))
        if _is_current(path, version, str(group.get("version"))):
            return None
        _complete(file)
        table, vectors = table_of(file), hdf5.has_item(file, "modes/vectors")
    known = _of_modes(table.attributes)
    known.setdefault("n_translations", int(table["is_translation"].sum()))
    write_modes(out, dataclasses.replace(table, attributes=known), {}, vectors=vectors)
    return Converted("modes", version)


def _complete(file: h5py.File) -> None:
    """Add the effect of rounding of overlaps, if not stated, and remove the rounding errors of translations."""
    is_translation = hdf5.require_dataset(file, "modes/is_translation")[()]
    if not hdf5.has_item(file, "modes/overlap_error"):
        hdf5.put(file, "modes/overlap_error", np.zeros(len(is_translation)))
    for name in ("eigenvalues", "omega", *ERRORS):
        column = hdf5.require_dataset(file, f"modes/{name}")
        column[...] = np.where(is_translation, 0.0, column[()])


def _of_modes(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes of modes under today's names; unknown bounds of moduli are infinite."""
    own = {name: value for name, value in attributes.items() if not name.startswith(PREFIX)}
    packing = renamed(
        {
            name.removeprefix(PREFIX): value
            for name, value in attributes.items()
            if name.startswith(PREFIX)
        }
    )
    if shape := packing.get("shape") or _shape_with(packing):
        packing["shape"] = shape
    packing = Interaction.told(packing).stated() | packing
    parts = (f"{name}_modulus_{part}" for name in MODULI for part in (*PARTS, "bound"))
    usual = dict.fromkeys(parts, np.inf) | dict.fromkeys(COUNTS, 0)
    return usual | own | {f"{PREFIX}{name}": value for name, value in packing.items()}


def _shape_with(known: Mapping[str, Any]) -> str | None:
    """Name the first shape whose parameters are all present."""
    for name, shape in SHAPES.items():
        if all(parameter.name in known for parameter in shape.needed):
            return name
    return None


# --- GSD -----------------------------------------------------------------------------------------


def _gsd(path: Path, out: Path) -> Converted | None:
    hoomd = tool("gsd.hoomd", "gsd")
    with opened_gsd(hoomd, path) as file:
        first = file[0].log if len(file) else {}
        if f"{LOG}shape_style" not in first:
            msg = f"{path} holds no log/jamshape of a packing, expected a file of jamshape; leave it out"
            raise FileFormatError(msg)
        version = int(first.get(f"{LOG}format_version", [_UNSTATED])[0])
        if _is_current(path, version, "?"):
            return None
        usual = {f"{LOG}law": np.array(Interaction(), np.float64)}
        stated = {f"{LOG}format_version": np.array([FORMAT_VERSION])}
        with replacing(out) as temporary, hoomd.open(str(temporary), "w") as new:
            for frame in file:
                frame.log = usual | frame.log | stated
                new.append(frame)
    return Converted("GSD file", version)
