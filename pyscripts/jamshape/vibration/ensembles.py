"""System, energy and bands of the modes in a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from jamshape.files.ensembles import System, system_of
from jamshape.packing import Packing
from jamshape.vibration.table import ModeTable

TOLD = ("low", "middle", "high")  # bands

PREFIX = "packing_"
"""Prefix of the attributes that modes copy from the file of their packing."""


class Key(NamedTuple):
    """Common attributes of the packings of one curve."""

    system: System
    u0: float

    def number(self, name: str) -> float:
        """Look up u0 or a parameter of the shape; NaN if it has none of that name."""
        return self.u0 if name == "u0" else self.system.number(name)

    def report(self) -> dict[str, Any]:
        """Return a description for JSON."""
        return self.system.report() | {"u0": self.u0}


def of_packing(table: ModeTable) -> dict[str, Any]:
    """Return the attributes of the packing's file."""
    known = table.attributes.items()
    return {name.removeprefix(PREFIX): v for name, v in known if name.startswith(PREFIX)}


def to_store(attributes: Mapping[str, Any], packing: Packing) -> dict[str, Any]:
    """Return the attributes that a file of modes copies from its packing: those of its file, shape and law."""
    known = dict(attributes) | {"shape": packing.shape_style, **packing.law.stated()}
    return {f"{PREFIX}{name}": value for name, value in known.items()}


def key_of(table: ModeTable) -> Key:
    """Return system and u0 of a packing; 0 for a first jammed packing without a target energy.

    Raises
    ------
    ValueError
        If the modes do not state the shape of their packing.
    """
    known = of_packing(table)
    if "shape" not in known:
        msg = "modes do not state the shape of their packing, expected modes of a packing of make_packing.py"
        raise ValueError(msg)
    u0 = float(known.get("u0", 0.0))
    return Key(system_of(known, known["shape"], table.coordinates.dimension), u0)


def count_of(table: ModeTable, name: str) -> int | None:
    """Count the modes of a band; None where bands do not separate."""
    return len(table.in_band(name)) if table.has_band(name) else None
