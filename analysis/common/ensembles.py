"""Finished packings in folders, files and tables, grouped by the systems that they are samples of.

A sweep is a folder of files that `make_packing.py` or `sweep.py` wrote; several may be given together. Instead of
files a table may be given, with the attributes of a file in each line (`analysis/sample_tables.py`).
"""

from __future__ import annotations

import contextlib
import csv
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.files.ensembles import PackingFile, System
from jamshape.files.h5md import FileFormatError
from jamshape.measures.packing_summary import energy_onset
from jamshape.shapes.shape import Interaction
from jamshape.shapes.table import DEFAULT

# Suffixes of other files that may lie beside a packing.
OTHERS = (".run.h5", ".making.h5", ".modes.h5")

TABLE = ".csv"  # suffix of a table of packings
_STYLE = ("shape", "dimension")  # its columns that are not attributes

CONDITIONS = ("n", "size_ratio", "u0", "kappa")

# Parameters that agree in this many digits are equal.
_SAME = 1e-9

Groups = dict[System, list[PackingFile]]
Curve = dict[float, list[PackingFile]]
"""Samples by the value of a parameter."""


def read_groups(
    paths: Iterable[Path],
    *,
    needs: Sequence[str] = (),
    same: Sequence[str] = ("n",),
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


def distances(files: Sequence[PackingFile]) -> list[float]:
    """Return phi - phi_J of packings, from energy and pressure: the difference of both has few digits in a table."""
    powers = [Interaction.told(file.attributes).power for file in files]
    phi, u, pressure = ([f.number(name) for f in files] for name in ("phi", "u", "pressure"))
    onsets = map(energy_onset, phi, u, pressure, powers)
    return [at - onset for at, onset in zip(phi, onsets, strict=True)]


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
