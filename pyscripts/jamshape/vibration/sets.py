"""Modes of a packing, and what a file of modes says of its packing: system, u0, bands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from jamshape.files.sets import System, system_of
from jamshape.files.vocabulary import renamed
from jamshape.packing import Packing
from jamshape.shapes.table import SHAPES
from jamshape.vibration.table import ModeTable

TOLD = ("low", "middle", "high")  # bands

_PREFIX = "packing_"  # of what the packing's file said


class Key(NamedTuple):
    """What the packings of one curve have in common."""

    system: System
    u0: float

    def number(self, name: str) -> float:
        """Look up u0 or a parameter of the shape; NaN if it has none of that name."""
        return self.u0 if name == "u0" else self.system.number(name)

    def report(self) -> dict[str, Any]:
        """Name it in JSON."""
        return self.system.report() | {"u0": self.u0}


def of_packing(table: ModeTable) -> dict[str, Any]:
    """Return what the packing's file said."""
    known = table.attributes.items()
    own = {name.removeprefix(_PREFIX): v for name, v in known if name.startswith(_PREFIX)}
    return renamed(own)


def to_store(attributes: Mapping[str, Any], packing: Packing) -> dict[str, Any]:
    """Return what a file of modes keeps of its packing: what that file said, the shape and the law."""
    known = dict(attributes) | {"shape": packing.shape_style, **packing.law._asdict()}
    return {f"{_PREFIX}{name}": value for name, value in known.items()}


def key_of(table: ModeTable) -> Key:
    """Tell system and u0 of a packing; 0 of the first jammed one, which was led to no energy."""
    known = of_packing(table)
    shape = known.get("shape") or _shape_with(known)
    u0 = float(known.get("u0", 0.0))
    return Key(system_of(known, shape, table.coordinates.dimension), u0)


def _shape_with(known: Mapping[str, Any]) -> str:
    """Name the first shape of which all parameters are told, as files of old do not name theirs."""
    for name, shape in SHAPES.items():
        if all(parameter.name in known for parameter in shape.parameters):
            return name
    msg = "modes do not tell the shape of their packing, expected modes of a packing of make_packing.py"
    raise ValueError(msg)


def count_of(table: ModeTable, name: str) -> int | None:
    """Count the modes of a band; None where bands are not apart."""
    return len(table.in_band(name)) if table.has_band(name) else None
