"""Checkpoints in HDF5: numbers and texts as attributes, arrays and bytes as datasets, dictionaries as groups."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.files.hdf5 import attributes_of, put, require_dataset, require_item, set_attributes
from jamshape.packing import State

if TYPE_CHECKING:
    import h5py

Checkpoint = dict[str, Any]
"""Numbers, texts, bytes, arrays, `State`s and dictionaries of these, by name; None is left out."""

FORMAT = "format"
"""Attribute of a checkpoint: the version of what drivers store."""

_VERSION = 1  # raised with every change of what a driver stores

_KIND = "_kind"  # attribute of what is not a plain array or dictionary
_BYTES, _STATE = "bytes", "state"


def write_checkpoint(group: h5py.Group, checkpoint: Mapping[str, Any]) -> None:
    """Write a checkpoint into an empty group."""
    _write(group, checkpoint)
    group.attrs[FORMAT] = _VERSION


def _write(group: h5py.Group, checkpoint: Mapping[str, Any]) -> None:
    for name, value in checkpoint.items():
        if value is None:
            continue
        if isinstance(value, Mapping):
            _write(group.create_group(name), value)
        elif isinstance(value, State):
            parts = dict(zip(("position", "orientation", "cell"), value.split, strict=True))
            _write(group.create_group(name), parts)
            _mark(group[name], _STATE)
        elif isinstance(value, bytes):
            _mark(put(group, name, np.frombuffer(value, np.uint8)), _BYTES)
        elif isinstance(value, np.ndarray) and value.ndim:
            put(group, name, value)
        else:
            set_attributes(group, {name: value})


def _mark(item: Any, kind: str) -> None:
    set_attributes(item, {_KIND: kind})


def read_checkpoint(group: h5py.Group) -> Checkpoint | None:
    """Read a checkpoint; return None for one of another version."""
    found = dict(_items(group))
    return found if found.pop(FORMAT, None) == _VERSION else None


def _items(group: h5py.Group) -> Iterator[tuple[str, Any]]:
    for name, value in attributes_of(group).items():
        if name != _KIND:
            yield name, value
    for name in group:
        item = require_item(group, name)
        kind = attributes_of(item).get(_KIND)
        if hasattr(item, "shape"):
            array = require_dataset(group, name)[()]
            yield name, array.tobytes() if kind == _BYTES else array
        else:
            found = dict(_items(item))
            yield name, State.joined(**found) if kind == _STATE else found
