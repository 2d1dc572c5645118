"""Content of any file, recognised by content and never by name."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.drawing.kinds import kinds_of
from jamshape.exchange.gsd import read_gsd
from jamshape.files.h5md import (
    FileFormatError,
    count_frames,
    read_attributes,
    read_creator,
    read_format_version,
    read_observables,
    read_origin,
    read_packing,
    read_particles,
    read_report,
)
from jamshape.files.lammps_text import read_data
from jamshape.files.meaning import NOTHING, Wanted
from jamshape.files.outcomes import is_reached, shortfall
from jamshape.files.signature import DATA, DUMP, GSD, HDF5, REFUSED, RESTART, SIGNATURES, format_of
from jamshape.files.vocabulary import ENSEMBLE, KIND
from jamshape.front.frames import frames
from jamshape.front.packing import Packing, public, results_of
from jamshape.front.recorded import KINDS, run_file
from jamshape.front.run import CyclicShearFile, QuasistaticShearFile
from jamshape.packing import Packing as PackingLike
from jamshape.vibration.ensembles import TOLD, count_of, of_packing
from jamshape.vibration.table import ModeTable, holds_modes, read_modes

_OF_CONTACTS = ("pressure", "u", "z", "z_single", "z_bearing")
_OF_A_STATE = ("box", "tilt", "step", "time")
_STATE = ("phi", *_OF_CONTACTS, "rattlers")
_MOST_CUBATIC = 2000  # particles whose cubatic order takes less than a second
_MADE = ("seed", "kappa", "u0", "protocol", "phi_start", "phi_end", "gdot",
         "amplitude", "period", "cycles", "flow", "strain_step", "strain_end", "hold_pressure", "box_time", "relaxation_time",
         "target_pressure", "target_phi", "box_yields", "tries", "outcome")  # fmt: skip


_SAME_COMMAND = "repeat the command that began it"
_OTHER_COMMAND = "repeat the command for {result}, which continues from this file"

# Suffixes of files beside an unfinished packing.
_ENDS = (".making.h5", ".run.h5")


def contents_of(path: Path, wanted: Wanted = NOTHING) -> dict[str, Any]:
    """Describe the content of a file.

    Parameters
    ----------
    path : Path
    wanted : Wanted
        Dimension and shape of a data or dump file that does not state them.

    Returns
    -------
    dict
        ``kind``, and known properties: name of the shape, numbers, ``kinds`` with the number
        of each, ``finished``, ``go_on`` with advice if not finished.

    Raises
    ------
    FileFormatError
        If it is damaged.
    ValueError
        If its format is unknown.
    OSError
        If it cannot be read.
    """
    found = format_of(path)
    if found in _TEXTS:
        return {"file": path, **_TEXTS[found](path, wanted)}
    if found in _READERS:
        told = {"file": path, **_READERS[found](path)}
        _require_told(told, wanted)
        return told
    if found in REFUSED:
        msg = f"{path} {REFUSED[found]}"
        raise FileFormatError(msg)
    msg = (
        f"{path} has no known format, expected a packing, a run or modes in HDF5, a data, dump"
        " or restart file of LAMMPS, or a GSD file"
    )
    raise ValueError(msg)


def _hdf5(path: Path) -> dict[str, Any]:
    return _modes(read_modes(path)) if holds_modes(path) else _particles(path)


def _particles(path: Path) -> dict[str, Any]:
    """Describe an H5MD file."""
    known = read_attributes(path)
    is_run = str(known.get(KIND)) in KINDS
    found: dict[str, Any] = {"kind": known[KIND] if is_run else "packing"}
    found |= _table(path) if known.get(KIND) == ENSEMBLE else _last_state(path, known)
    found |= _picked(known, _MADE) | {"finished": bool(known.get("finished", not is_run))}
    if "kappa" in found:
        found["kappa"] = np.ravel(found["kappa"])[-1].item()
    if "outcome" in known:
        found |= {"reached": is_reached(known), "shortfall": shortfall(known) or None}
    if is_run and "cycles" in known:
        found |= _last_cycle(path)
    found |= _cost(path, known)
    found |= {"format_version": read_format_version(path), "jamshape_version": read_creator(path)}
    found |= {"origin": origin} if (origin := read_origin(path)) else {}
    if not found["finished"]:
        found["go_on"] = _go_on(path, known)
    return found


def _last_state(path: Path, known: Mapping[str, Any]) -> dict[str, Any]:
    """Describe a packing, or the last frame of a run."""
    packing = read_packing(path)
    is_changed = bool(known) and not results_of(path, packing)
    state = _state(packing, {} if is_changed else _measured(path, known))
    return {**_of_packing(packing), **state, "frames": count_frames(path)}


def _table(path: Path) -> dict[str, Any]:
    """Describe the particles of an ensemble, which has no box of its own, and count its samples."""
    found = _of_packing(read_particles(path))
    own = {name: value for name, value in found.items() if name not in _OF_A_STATE}
    return own | {"samples": len(read_observables(path).get("seed", ()))}


def _of_packing(packing: PackingLike) -> dict[str, Any]:
    """Describe the particles and the box."""
    kinds = kinds_of(packing)
    numbers = range(kinds.of.max() + 1) if len(kinds.parameters) else ()
    rows = []
    for number in numbers:
        own = kinds.of == number
        row = packing.diameters[own][0], packing.form[own][0]
        parameters, size = packing.shape.parameters_of(*row)
        rows.append({**parameters, "size": size, "count": int(own.sum())})
    found = {"shape": packing.shape_style, "dimension": packing.dimension, "n": packing.n}
    found |= packing.law.stated()
    found |= {"kinds": rows, "unit": packing.shape.unit, "box": packing.box.edges.tolist()}
    found |= {"tilt": packing.box.tilt.tolist()} if packing.box.is_tilted else {}
    return found | ({"step": packing.step, "time": packing.time} if packing.step else {})


def _measured(path: Path, known: Mapping[str, Any]) -> dict[str, Any]:
    """Read the stored numbers of a state: the last ones of a run."""
    rows = {name: value for name, value in read_observables(path).items() if value.ndim == 1}
    found = {name: float(value[-1]) for name, value in rows.items() if len(value)}
    return _picked(found | dict(known) | {"rattlers": _rattlers(found, known)}, _STATE)


def _rattlers(found: Mapping[str, Any], known: Mapping[str, Any]) -> int | None:
    number = known.get("n_rattlers", found.get("rattlers"))
    return None if number is None else int(number)


def _state(packing: PackingLike, measured: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers of a state, computing missing ones from its contacts."""
    of, known = public(packing), dict(measured)
    known |= {"z_iso": of.z_iso} | _order(of)
    if all(name in measured for name in _STATE):
        return known
    found = {name: getattr(of, name) for name in _OF_CONTACTS}
    return found | {"phi": of.phi, "rattlers": of.n_rattlers} | known


def _order(packing: Packing) -> dict[str, float]:
    """Return the orders of a packing that are defined, unless they take long."""
    names = ["S_2", "S_4"] + ["C_4"] * (packing.n <= _MOST_CUBATIC)
    found = {name: getattr(packing, name) for name in names}
    return {name: value for name, value in found.items() if not math.isnan(value)}


def _last_cycle(path: Path) -> dict[str, Any]:
    """Describe the last whole cycle of a shear to and fro, if there is one."""
    run = run_file(path)
    if isinstance(run, CyclicShearFile | QuasistaticShearFile) and (last := run.cycles(first=-1)):
        return {"last_cycle": last[0]._asdict()}
    return {}


def _cost(path: Path, known: Mapping[str, Any]) -> dict[str, Any]:
    """Return the error reached and the time taken."""
    report = read_report(path)
    found: dict[str, Any] = {}
    if len(report.step):
        found = {"error": float(report.error[-1]), "wall_seconds": float(report.wall_seconds[-1])}
        found["rows"] = len(report.step)
    for name in ("wall_seconds", "flow_wall_seconds", "shear_wall_seconds"):
        found |= {"wall_seconds": float(known[name])} if name in known else {}
    return found | ({"error": float(known["residual"])} if "residual" in known else {})


def _go_on(path: Path, known: Mapping[str, Any]) -> str:
    """Advise how to continue an unfinished run."""
    kind = KINDS.get(name := str(known.get(KIND)))
    if name == ENSEMBLE:
        return f"js.resume({str(path)!r}) in Python"
    if kind and kind.plan_of is None:
        return _OTHER_COMMAND.format(result=_result_of(path))
    return _SAME_COMMAND


def _result_of(path: Path) -> Path:
    """Name the packing beside which a file lies."""
    for end in _ENDS:
        if path.name.endswith(end):
            return path.with_name(path.name.removesuffix(end))
    return Path("its packing")


def _modes(table: ModeTable) -> dict[str, Any]:
    """Describe modes."""
    known, own = of_packing(table), table.attributes
    found: dict[str, Any] = {"kind": "modes", "dimension": table.coordinates.dimension}
    found |= _picked(known, ("shape", "phi", "u", *_MADE))
    found |= _picked(own, ("n", "n_modes", "z", "pressure", "method", "wall_seconds"))
    found |= {"modes": len(table["eigenvalues"]), "rattlers": own["n"] - own["n_backbone"]}
    found |= _picked(own, ("bulk_modulus", "B_G_dc", "bordered_eigenvalue"))
    found |= {"is_stable_to_shear": table.moduli.is_stable_to_shear}
    found |= {"error": own["residual"], "vectors": table.vectors.shape[1] > 0}
    return found | {"bands": {name: count_of(table, name) for name in TOLD}, "finished": True}


def _require_told(told: Mapping[str, Any], wanted: Wanted) -> None:
    """Refuse a dimension or shape that differs from that stated in a file."""
    for name, asked in wanted._asdict().items():
        if asked and told.get(name, asked) != asked:
            msg = f"{told['file']} has {name} {told[name]}, expected --{name} to be the same; leave it out"
            raise ValueError(msg)


def _dump(path: Path, wanted: Wanted) -> dict[str, Any]:
    found = frames(path, dimension=wanted.dimension, shape=wanted.shape)
    return _text("LAMMPS dump", found[-1]) | {"frames": len(found)}


def _data(path: Path, wanted: Wanted) -> dict[str, Any]:
    return _text("LAMMPS data file", read_data(path, *wanted)) | {"frames": 1}


def _gsd(path: Path) -> dict[str, Any]:
    return _text("GSD file", read_gsd(path))


def _text(kind: str, packing: PackingLike) -> dict[str, Any]:
    return {"kind": kind, **_of_packing(packing), **_state(packing, {}), "finished": True}


def _restart(path: Path) -> dict[str, Any]:
    """Read the head of a restart file: numbered entries, the first of which are always these."""
    content = path.read_bytes()[len(SIGNATURES[RESTART]) :]
    entries: list[Any] = []
    at = 8  # after byte order and format version
    for kind in "siiiisqi":
        at += 4  # number of the entry
        if kind == "s":
            (length,) = struct.unpack_from("=i", content, at)
            entries.append(content[at + 4 : at + 3 + length].decode())
            at += 4 + length
        else:
            entries += struct.unpack_from(f"={kind}", content, at)
            at += struct.calcsize(f"={kind}")
    known = {"lammps": entries[0], "step": entries[6], "dimension": entries[7]}
    go_on = f"lmp -in DECK -var restart {path}, with all other settings as before"
    return {"kind": "LAMMPS restart file", **known, "finished": False, "go_on": go_on}


def _picked(known: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    return {name: known[name] for name in names if known.get(name) is not None}


_READERS: dict[str, Callable[[Path], dict[str, Any]]] = {HDF5: _hdf5, RESTART: _restart, GSD: _gsd}
_TEXTS: dict[str, Callable[[Path, Wanted], dict[str, Any]]] = {DUMP: _dump, DATA: _data}
