"""Finished packings, and the systems to which they belong.

Packings belong to one system if shape, dimension, the shape's parameters, mixture, protocol, its sweeps and the law of contacts agree.
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
from jamshape.packing import Packing
from jamshape.shapes.table import shape_named


class System(NamedTuple):
    """Common settings of the packings of one point of a figure, apart from N and energy."""

    shape: str
    dimension: int
    parameters: tuple[tuple[str, float | str], ...]
    """Parameters of the shape by name; empty for a mixture, and if files lack some."""
    kinds: str = ""
    """Particles of a mixture."""
    protocol: str = ""
    """Name of the published protocol, or the way to jamming; empty for compressions in LAMMPS."""
    n_sweeps: int = 0
    """Monte Carlo sweeps."""
    law: str = ""
    """Law of contacts; empty for the harmonic one."""

    def number(self, name: str) -> float:
        """Look up a parameter; NaN if the shape does not have it."""
        value = dict(self.parameters).get(name)
        return value if isinstance(value, float) else math.nan

    def without(self, name: str) -> System:
        """Remove a parameter, so that the points of a curve over it compare equal."""
        return self._replace(parameters=tuple(p for p in self.parameters if p[0] != name))

    def report(self) -> dict[str, Any]:
        """Return a description for JSON: parameters by name, the last four if present."""
        told = {name: getattr(self, name) for name in ("kinds", "protocol", "n_sweeps", "law")}
        told = {name: value for name, value in told.items() if value}
        return {"shape": self.shape, "dimension": self.dimension, **dict(self.parameters), **told}


@dataclass(frozen=True)
class PackingFile:
    """A finished packing: its file and attributes."""

    path: Path
    attributes: dict[str, Any]
    style: tuple[str, int]
    """Name of the shape, and dimension."""

    @classmethod
    def read(cls, path: Path) -> PackingFile:
        """Read the attributes of a file; errors as `read_attributes`."""
        return cls(path, read_attributes(path), read_style(path))

    @property
    def reached(self) -> bool:
        """Whether it reached its goal, force balance."""
        return is_reached(self.attributes)

    def number(self, name: str) -> float:
        """Look up an attribute that is a number.

        Raises
        ------
        ValueError
            If it does not exist.
        """
        return number(self.attributes, name, f"{self.path}: has", "a packing of make_packing.py")

    def packing(self) -> Packing:
        """Read the particles."""
        return read_packing(self.path)

    def system(self) -> System:
        """Return the system that it is a sample of."""
        return system_of(self.attributes, *self.style)

    def contacts(self) -> Contacts:
        """Read the packing and find its contacts, under its own law, and its rattlers."""
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
    who : str
        Begin of the error message.
    expected : str
        End of the error message.

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
    """Return the system of a packing, from its attributes, shape style and dimension."""
    its = {parameter.name: parameter for parameter in shape_named(shape).parameters}
    own = shape_named(shape).told(attributes)
    known = tuple((name, its[name].read(value)) for name, value in own.items())
    kinds = str(attributes.get("kinds", ""))
    protocol = str(attributes.get("protocol", ""))
    sweeps = int(attributes.get("n_sweeps", 0))
    law = str(attributes.get("law", ""))
    return System(shape, dimension, known, kinds, protocol, sweeps, law)
