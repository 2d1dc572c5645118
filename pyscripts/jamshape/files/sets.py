"""Finished packings by what their files say, and the systems that they are samples of.

Packings are of one system where shape, dimension, the shape's parameters, mixture, protocol and its sweeps agree.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.contacts import Contacts, find_contacts, find_rattlers
from jamshape.files.h5md import (
    read_attributes,
    read_observables,
    read_packing,
    read_style,
)
from jamshape.files.outcomes import is_reached
from jamshape.files.vocabulary import protocol_named
from jamshape.packing import Packing
from jamshape.shapes.table import shape_named


class System(NamedTuple):
    """What the packings of one point of a figure have in common, but for N and energy."""

    shape: str
    dimension: int
    parameters: tuple[tuple[str, float], ...]
    """Those of the shape, by name; none of a mixture, and none where files do not tell all."""
    kinds: str = ""
    """The particles of a mixture."""
    protocol: str = ""
    """The published one, by name, or the way to jamming; none of compressions in LAMMPS."""
    n_sweeps: int = 0
    """Of Monte Carlo."""

    def number(self, name: str) -> float:
        """Look up a parameter; NaN where the shape has none of that name."""
        return dict(self.parameters).get(name, math.nan)

    def without(self, name: str) -> System:
        """Leave out a parameter: what the points of a curve over it have in common."""
        return self._replace(parameters=tuple(p for p in self.parameters if p[0] != name))

    def report(self) -> dict[str, Any]:
        """Name it in JSON: parameters by their names, the last three where there are any."""
        told = {name: getattr(self, name) for name in ("kinds", "protocol", "n_sweeps")}
        told = {name: value for name, value in told.items() if value}
        return {"shape": self.shape, "dimension": self.dimension, **dict(self.parameters), **told}


@dataclass(frozen=True)
class PackingFile:
    """One finished packing: its file and what is said of it there."""

    path: Path
    attributes: dict[str, Any]
    style: tuple[str, int]
    """Name of the shape, and dimension."""

    @classmethod
    def read(cls, path: Path) -> PackingFile:
        """Read what a file says; errors as `read_attributes`."""
        return cls(path, read_attributes(path), read_style(path))

    @property
    def reached(self) -> bool:
        """Whether it reached its goal: forces that balance."""
        return is_reached(self.attributes)

    def number(self, name: str) -> float:
        """Look up an attribute that is a number.

        Raises
        ------
        ValueError
            If there is none.
        """
        return number(self.attributes, name, f"{self.path}: has", "a packing of make_packing.py")

    def packing(self) -> Packing:
        """Read the particles."""
        return read_packing(self.path)

    def system(self) -> System:
        """Tell what it is a sample of."""
        return system_of(self.attributes, *self.style)

    def contacts(self) -> Contacts:
        """Read the packing and find its contacts, by its own law, and its rattlers."""
        packing = self.packing()
        network = find_contacts(packing)
        observables = read_observables(self.path)
        if "rattler_ids" not in observables:
            return Contacts(packing, network, find_rattlers(packing, network))
        return Contacts(packing, network, np.isin(packing.id, observables["rattler_ids"][-1]))


def number(attributes: Mapping[str, Any], name: str, who: str, expected: str) -> float:
    """Look up an attribute that is a number.

    Parameters
    ----------
    attributes : mapping
    name : str
    who, expected : str
        Begin and end of the sentence, if there is none.

    Raises
    ------
    ValueError
    """
    value = np.asarray(attributes.get(name, "missing"))
    if value.ndim or value.dtype.kind not in "biuf":
        msg = f"{who} no number {name!r}, expected {expected}"
        raise ValueError(msg)
    return float(value)


def system_of(attributes: Mapping[str, Any], shape: str, dimension: int) -> System:
    """Tell what a packing is a sample of, by its attributes, shape style and dimension."""
    names = [parameter.name for parameter in shape_named(shape).parameters]
    told = set(names) <= attributes.keys()
    known = tuple((name, float(attributes[name])) for name in names if told)
    kinds = str(attributes.get("kinds", ""))
    protocol = str(protocol_named(attributes.get("protocol", attributes.get("way", ""))))
    sweeps = int(attributes.get("n_sweeps", 0))
    return System(shape, dimension, known, kinds, protocol, sweeps)
