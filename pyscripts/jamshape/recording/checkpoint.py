"""Checkpoints in HDF5: numbers and texts as attributes, arrays and bytes as datasets, dictionaries as groups."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.files import layout
from jamshape.packing import State
from jamshape.recording.driver import Checkpoint

if TYPE_CHECKING:
    import h5py

FORMAT = "format"
"""Attribute of a checkpoint: the version of what drivers store."""

_VERSION = 1  # raised with every change of what a driver stores

_KIND = "_kind"  # attribute of what is not a plain array or dictionary
_BYTES, _STATE, _LONG = "bytes", "state", "long"


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
            group[name].attrs[_KIND] = _STATE
        elif isinstance(value, bytes):
            layout.put(group, name, np.frombuffer(value, np.uint8)).attrs[_KIND] = _BYTES
        elif isinstance(value, np.ndarray) and value.ndim:
            _write_array(group, name, value)
        else:
            group.attrs[name] = value


def _write_array(group: h5py.Group, name: str, value: Any) -> None:
    """Write an array; extended precision as doubles and their low parts."""
    if value.dtype != np.longdouble or value.dtype == np.float64:
        layout.put(group, name, value)
        return
    double = value.astype(np.float64)
    both = np.stack([double, (value - double).astype(np.float64)])
    layout.put(group, name, both).attrs[_KIND] = _LONG


def read_checkpoint(group: h5py.Group) -> Checkpoint | None:
    """Read a checkpoint; return None for one of another version."""
    found = dict(_items(group))
    return found if found.pop(FORMAT, None) == _VERSION else None


def _items(group: h5py.Group) -> Iterator[tuple[str, Any]]:
    for name, value in group.attrs.items():
        if name != _KIND:
            yield name, layout.plain(value)
    for name in group:
        item = layout.require_item(group, name)
        kind = item.attrs.get(_KIND)
        if hasattr(item, "shape"):
            array = item[()]
            if kind == _LONG:
                array = np.longdouble(array[0]) + array[1]
            yield name, array.tobytes() if kind == _BYTES else array
        else:
            found = dict(_items(item))
            yield name, State.joined(**found) if kind == _STATE else found
