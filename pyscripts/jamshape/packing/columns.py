"""Columns of a packing's particles that are not used here, only kept: molecules, energies, names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

_ROWS = 2  # most dimensions
MOST = 256
"""Largest width of a column."""

# Columns of LAMMPS that belong to particles, whatever their state.
_LABELS = {"mol", "element", "typelabel", "mass", "q"}
_OWN_LABELS = ("i_", "d_", "i2_", "d2_")  # of fix property/atom
_STATE = {"position", "orientation", "diameters", "form", "exponent", "box", "id"}


def as_columns(columns: Mapping[Any, Any], n: int) -> dict[str, NDArray[Any]]:
    """Return read-only copies of columns (N,) or (N, k) of numbers or texts, or raise a ValueError."""
    found = {}
    for name, values in columns.items():
        array = np.array(values)
        is_named = (
            isinstance(name, str) and name != "." and "/" not in name and name.split() == [name]
        )
        if not is_named or array.dtype.kind not in "biufU":
            msg = f"column {name!r} has dtype {array.dtype}, expected numbers or texts, and a name without spaces and '/'"
            raise ValueError(msg)
        if array.shape[:1] != (n,) or not 0 < array[:1].size <= MOST or array.ndim > _ROWS:
            msg = f"column {name!r} has shape {array.shape}, expected ({n},) or ({n}, k) with k up to {MOST}"
            raise ValueError(msg)
        array.flags.writeable = False
        found[name] = array
    return found


def kept(columns: Mapping[str, NDArray[Any]], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns that stay true when fields of a packing change: others describe the state before."""
    if not columns or not _STATE & changes.keys():
        return dict(columns)
    rows = next((changes[name] for name in ("position", "id") if name in changes), ())
    n = len(np.atleast_1d(np.asarray(rows)))
    return {
        name: column
        for name, column in columns.items()
        if (name in _LABELS or name.startswith(_OWN_LABELS)) and n in {0, len(column)}
    }


def flat(columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Split columns (N, k) into ``name[1]`` to ``name[k]``, as LAMMPS names them in dumps."""
    found: dict[str, NDArray[Any]] = {}
    for name, column in columns.items():
        many = column.ndim > 1
        found |= {f"{name}[{k}]": x for k, x in enumerate(column.T, 1)} if many else {name: column}
    return found


def joined(columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Join ``name[1]`` to ``name[k]``, if none is missing, to columns (N, k): the inverse of `flat`."""
    groups: dict[str, list[str]] = {}
    for name in columns:
        stem, _, number = name.removesuffix("]").partition("[")
        if number.isdecimal():
            groups.setdefault(stem, []).append(name)
    found = dict(columns)
    for stem, names in groups.items():
        parts = [f"{stem}[{k}]" for k in range(1, len(names) + 1)]
        if set(parts) == set(names) and stem not in columns:
            found[stem] = np.column_stack([found.pop(part) for part in parts])
    return found
