"""Ensembles of finished packings in folders and files, grouped by system.

A sweep is a folder of files that `make_packing.py` or `sweep.py` wrote; several may be given together. Packings
belong to one system if shape, dimension, the shape's parameters, mixture, protocol and its sweeps agree. A table
of attributes, one packing per line, may replace the files (`analysis/sample_tables.py`).
"""

from __future__ import annotations

import contextlib
import csv
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.contacts import Contacts, find_contacts, find_rattlers
from jamshape.files.h5md import (
    FileFormatError,
    read_attributes,
    read_observables,
    read_packing,
    read_style,
)
from jamshape.files.outcomes import is_reached
from jamshape.files.vocabulary import protocol_named
from jamshape.packing import Packing
from jamshape.shapes.table import DEFAULT, shape_named

# Suffixes of other files that may lie beside a packing.
OTHERS = (".run.h5", ".search.h5", ".path.h5", ".strict.h5", ".modes.h5")

TABLE = ".csv"  # suffix of a table of packings
_STYLE = ("shape", "dimension")  # its columns that are not attributes

CONDITIONS = ("n", "size_ratio", "u0", "kappa")

# Parameters that agree in this many digits are equal.
_SAME = 1e-9


class System(NamedTuple):
    """Common settings of the packings of one point of a figure, apart from N and energy."""

    shape: str
    dimension: int
    parameters: tuple[tuple[str, float], ...]
    """Parameters of the shape by name; empty for a mixture, and if files lack some."""
    kinds: str = ""
    """Particles of a mixture."""
    protocol: str = ""
    """Name of the published protocol, or the way to jamming; empty for compressions in LAMMPS."""
    n_sweeps: int = 0
    """Monte Carlo sweeps."""

    def number(self, name: str) -> float:
        """Look up a parameter; NaN if the shape does not have it."""
        return dict(self.parameters).get(name, math.nan)

    def without(self, name: str) -> System:
        """Remove a parameter, so that the points of a curve over it compare equal."""
        return self._replace(parameters=tuple(p for p in self.parameters if p[0] != name))

    def report(self) -> dict[str, Any]:
        """Return a description for JSON: parameters by name, the last three if present."""
        told = {name: getattr(self, name) for name in ("kinds", "protocol", "n_sweeps")}
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


Groups = dict[System, list[PackingFile]]
Curve = dict[float, list[PackingFile]]
"""Samples by the value of a parameter."""


def number(attributes: Mapping[str, Any], name: str, who: str, expected: str) -> float:
    """Look up an attribute that is a number.

    Parameters
    ----------
    attributes : mapping
    name : str
    who, expected : str
        Begin and end of the error message.

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
    names = [parameter.name for parameter in shape_named(shape).parameters]
    told = set(names) <= attributes.keys()
    known = tuple((name, float(attributes[name])) for name in names if told)
    kinds = str(attributes.get("kinds", ""))
    protocol = str(protocol_named(attributes.get("protocol", attributes.get("way", ""))))
    sweeps = int(attributes.get("n_sweeps", 0))
    return System(shape, dimension, known, kinds, protocol, sweeps)


def read_groups(
    paths: Iterable[Path], *, needs: Sequence[str] = (), same: Sequence[str] = ("n",)
) -> Groups:
    """Find the finished packings in folders and files, by system in ascending order, then by seed.

    They include packings that did not reach their goal (`PackingFile.reached`); averages are given with and
    without them (`measures.averages.mean_over`).

    Parameters
    ----------
    paths
        Folders, in which other files are skipped, and files, which must be packings.
    needs
        Numbers that every file must have, such as the parameters of the shapes in a figure.
    same
        Attributes in which all must agree.

    Raises
    ------
    ValueError
        If there are none, a file is not a packing or lacks a number, or they belong to several ensembles.
    OSError
        If a file cannot be read.
    """
    files = finished(list(paths))
    for file in files:
        for name in needs:
            file.number(name)
    require_one_ensemble([file.attributes for file in files], same)
    groups: Groups = {}
    systems = [(file.system(), file.number("seed"), file) for file in files]
    for system, _, file in sorted(systems, key=lambda row: row[:2]):
        groups.setdefault(system, []).append(file)
    return groups


def finished(paths: list[Path]) -> list[PackingFile]:
    """Find the finished packings in folders and files, at least one; arguments as `read_groups`."""
    files = [file for path in paths for file in _files(path)]
    if not files:
        places = ", ".join(map(str, paths))
        msg = f"{places}: no finished packing, expected files of sweep.py or make_packing.py"
        raise ValueError(msg)
    return files


def _files(path: Path) -> list[PackingFile]:
    """Read one file, the lines of a table, or the packings of a folder."""
    if path.suffix == TABLE:
        return read_table(path)
    if not path.is_dir():
        file = PackingFile.read(path)
        if "outcome" not in file.attributes:
            msg = f"{path}: has no attribute 'outcome', expected a packing of make_packing.py"
            raise ValueError(msg)
        return [file]
    # Runs and searches for a packing may still be written, and are then locked.
    places = [place for place in sorted(path.glob("*.h5")) if not place.name.endswith(OTHERS)]
    found = []
    for place in places:
        with contextlib.suppress(FileFormatError):  # files of other kinds
            found.append(PackingFile.read(place))
    return [file for file in found if "outcome" in file.attributes]


def read_table(path: Path) -> list[PackingFile]:
    """Read a table of packings, as `analysis/sample_tables.py` writes it.

    The file of a line is named beside the table, and is needed only for its particles.

    Raises
    ------
    ValueError
        If the table lacks a column, or a dimension is not a number.
    OSError
        If it cannot be read.
    """
    with path.open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    found = []
    for number_of, line in enumerate(lines, 2):
        if missing := [name for name in (*_STYLE, "file", "outcome") if not line.get(name)]:
            msg = f"{path}, line {number_of}: has no {missing[0]}, expected a table of sample_tables.py"
            raise ValueError(msg)
        known = {name: _read(text) for name, text in line.items() if text}
        shape, dimension = (known.pop(name) for name in _STYLE)
        found.append(PackingFile(path.parent / known.pop("file"), known, (shape, int(dimension))))
    return found


def _read(text: str) -> Any:
    """Read a cell, as a number if possible."""
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text


def require_one_ensemble(attributes: Sequence[Mapping[str, Any]], same: Sequence[str]) -> None:
    """Raise if attributes differ in one of these.

    Raises
    ------
    ValueError
    """
    for name in same:
        values = sorted({float(known[name]) for known in attributes if name in known})
        if len(values) > 1:
            found = " and ".join(f"{value:g}" for value in values)
            msg = f"{name} is {found}, expected one ensemble; select its files"
            raise ValueError(msg)


def n_of(groups: Mapping[Any, Sequence[PackingFile]]) -> int:
    """Return the number of particles of the first packing."""
    return int(next(iter(groups.values()))[0].number("n"))


def conditions(groups: Mapping[Any, Sequence[PackingFile]]) -> dict[str, Any]:
    """Return the common N, size ratio, energy and compression rate, and the number that did not reach their goal."""
    every = [file.attributes for files in groups.values() for file in files]
    values = {name: {known.get(name) for known in every} for name in CONDITIONS}
    shared = {name: of.pop() for name, of in values.items() if len(of) == 1 and None not in of}
    return shared | {"not_reached": n_not_reached(groups)}


def n_not_reached(groups: Mapping[Any, Sequence[PackingFile]]) -> int:
    """Count the packings that did not reach their goal."""
    return sum(not file.reached for files in groups.values() for file in files)


def of_paper(system: System) -> bool:
    """Whether Marschall & Teitel, PRE 97, 012905, studied it, whatever its parameters."""
    return system._replace(parameters=(), protocol="", n_sweeps=0) == System(DEFAULT, 2, ())


def only(groups: Groups, chosen: Callable[[System], bool]) -> Groups:
    """Select systems."""
    return {system: files for system, files in groups.items() if chosen(system)}


def curves_over(groups: Groups, name: str) -> dict[System, Curve]:
    """Split into curves over a parameter, each of systems that differ in nothing else."""
    curves: dict[System, Curve] = {}
    for system, files in groups.items():
        curves.setdefault(system.without(name), {})[system.number(name)] = files
    return curves


def one_curve(groups: Groups, name: str) -> tuple[System, Curve]:
    """Return the only curve over a parameter, and the common settings of its points.

    Raises
    ------
    ValueError
        If systems differ in something else, too.
    """
    curves = curves_over(groups, name)
    if len(curves) > 1:
        found = " and ".join(
            f"{s.shape}s in {s.dimension}D, protocol {s.protocol or 'none'}" for s in curves
        )
        msg = (
            f"packings are {found}, expected systems that differ in {name} only; select such files"
        )
        raise ValueError(msg)
    return next(iter(curves.items()))


class Choice(NamedTuple):
    """Selection of values of a parameter to draw."""

    asked: Sequence[float]
    """Values to draw, if not empty."""
    usual: Sequence[float]
    """Otherwise those of these that exist."""
    most: int
    """Otherwise this number of values, evenly."""


def choose(groups: Groups, name: str, which: Choice) -> Groups:
    """Select systems by a parameter.

    Raises
    ------
    ValueError
        If a requested value does not exist.
    """
    values = sorted({system.number(name) for system in groups})
    missing = [value for value in which.asked if not is_among(value, values)]
    if missing:
        known = ", ".join(f"{value:g}" for value in values)
        msg = f"no packing has {name} = {missing[0]:g}, expected one of {known}"
        raise ValueError(msg)
    wanted = which.asked or [value for value in which.usual if is_among(value, values)]
    if wanted:
        return only(groups, lambda system: is_among(system.number(name), wanted))
    spread = np.unique(np.linspace(0, len(groups) - 1, which.most).round().astype(int))
    return {system: groups[system] for k, system in enumerate(groups) if k in spread}


def is_among(value: float, others: Iterable[float]) -> bool:
    """Whether a number is one of others up to rounding."""
    return any(math.isclose(value, other, rel_tol=_SAME) for other in others)
