"""Files of modes in folders, grouped by system and u0, and modes picked from a table."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from common.averages import mean
from common.ensembles import is_among, require_one_ensemble
from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.files.ensembles import number
from jamshape.files.h5md import FileFormatError
from jamshape.landscape import Landscape, State
from jamshape.measures.averages import Mean
from jamshape.packing import Packing
from jamshape.vibration.ensembles import TOLD, Key, key_of, of_packing
from jamshape.vibration.hessian import dynamical_matrix
from jamshape.vibration.spectrum import spectrum
from jamshape.vibration.table import ModeTable, read_modes, tabulate

# Common to all packings of a figure.
ENSEMBLE = ("n", "size_ratio")

# Modes that each band gains for each grazing bond that is left out, which a mode of the low band then no longer stretches.
BY_GRAZING = {"low": 1, "middle": 0, "high": -1}

Tables = dict[Key, list[ModeTable]]


def read_tables(paths: Iterable[Path]) -> Tables:
    """Read files of modes, and those in folders, by system and u0 in ascending order.

    Parameters
    ----------
    paths
        Folders, in which other files are skipped, and files, which must be of modes.py.

    Raises
    ------
    ValueError
        If there are none, a file holds no modes, or they belong to several ensembles.
    OSError
        If a file cannot be read.
    """
    paths = list(paths)
    tables = [table for path in paths for table in _tables(path)]
    if not tables:
        msg = f"{', '.join(map(str, paths))}: no modes, expected files of analysis/modes.py"
        raise ValueError(msg)
    require_one_ensemble([of_packing(table) for table in tables], ENSEMBLE)
    grouped: Tables = {}
    for table in sorted(tables, key=lambda t: (key_of(t), seed_of(t))):
        grouped.setdefault(key_of(table), []).append(table)
    return grouped


def _tables(path: Path) -> list[ModeTable]:
    """Read one file, or all files of modes in a folder."""
    if not path.is_dir():
        return [read_modes(path)]
    found = []
    for file in sorted(path.glob("*.h5")):
        try:
            found.append(read_modes(file))
        except (FileFormatError, OSError):
            continue  # packings, and files still being written
    return found


def seed_of(table: ModeTable) -> int:
    """Seed of a packing."""
    expected = "one of their packing, made by make_packing.py"
    return int(number(of_packing(table), "seed", "modes have", expected))


def selected(tables: Tables, name: str, asked: Sequence[float]) -> Tables:
    """Select curves by u0 or a parameter of the shape; all if no values are given.

    Raises
    ------
    ValueError
        If a value does not occur.
    """
    if not asked:
        return tables
    known = sorted({key.number(name) for key in tables})
    missing = [value for value in asked if not is_among(value, known)]
    if missing:
        there = ", ".join(f"{value:g}" for value in known)
        msg = f"no modes have {name} = {missing[0]:g}, expected one of {there}"
        raise ValueError(msg)
    return {key: of for key, of in tables.items() if is_among(key.number(name), asked)}


def n_of(tables: Tables) -> int:
    """Return the number of particles of the packings."""
    return every(tables)[0].coordinates.n_all


def every(tables: Tables) -> list[ModeTable]:
    """All tables in one list."""
    return [table for samples in tables.values() for table in samples]


def stable(table: ModeTable) -> BoolArray:
    """Select modes of definitely positive eigenvalue."""
    return np.asarray(~table["is_translation"] & (table["sign"] > 0))


def unstable(table: ModeTable) -> BoolArray:
    """Select modes of definitely negative eigenvalue."""
    return np.asarray(~table["is_translation"] & (table["sign"] < 0))


def fraction_of(table: ModeTable, name: str) -> float:
    """Fraction of all modes but translations in a band; NaN where bands do not separate."""
    return len(table.in_band(name)) / table.n_vibrational if table.has_band(name) else math.nan


def sizes(table: ModeTable) -> FloatArray:
    """Return sqrt(|lambda|) of all modes."""
    return np.asarray(np.sqrt(np.abs(table["eigenvalues"])))


def pooled(
    tables: Iterable[ModeTable],
    values: Callable[[ModeTable], FloatArray],
    chosen: Callable[[ModeTable], BoolArray],
) -> FloatArray:
    """Values of the chosen modes of all tables, concatenated."""
    return np.concatenate([np.asarray(values(t), np.float64)[chosen(t)] for t in tables])


def table_of(packing: Packing, modes: Path | None) -> ModeTable:
    """Read modes with their vectors from a file, or find those of the packing.

    Raises
    ------
    ValueError
        If the file has no vectors, or holds other particles.
    """
    if modes is None:
        return modes_of(packing)
    table = read_modes(modes)
    if not table.vectors.size:
        msg = f"{modes}: has no vectors, expected a file of modes.py --vectors"
        raise ValueError(msg)
    if table.coordinates.n_all != packing.n:
        msg = f"{modes}: has {table.coordinates.n_all} particles, expected {packing.n}"
        raise ValueError(msg)
    return table


class Wanted(NamedTuple):
    """Selection of modes."""

    numbers: Sequence[int] = ()
    """Rows of the table."""
    omegas: Sequence[float] = ()
    """Modes with the nearest frequencies, by ratio; negative ones are sought among modes of
    negative eigenvalue, at -sqrt(-lambda)."""
    per_band: Mapping[str, int] = {}
    """Default: numbers of modes of each band, evenly by rank. An empty band takes them
    from the next one, and all come from the whole spectrum where bands do not separate."""


def pick_modes(table: ModeTable, wanted: Wanted) -> list[int]:
    """Choose modes by number or frequency, or else typical ones of the bands.

    Raises
    ------
    ValueError
        If a mode does not exist.
    """
    n = len(table["omega"])
    wrong = [k for k in wanted.numbers if not 0 <= k < n]
    if wrong:
        msg = f"there is no mode {wrong[0]}, expected one from 0 to {n - 1}"
        raise ValueError(msg)
    chosen = [*wanted.numbers, *(_nearest(table, omega) for omega in wanted.omegas)]
    if chosen:
        return chosen
    if not all(map(table.has_band, TOLD)):
        return _evenly(table, table.vibrational, sum(wanted.per_band.values()))
    left = 0
    for name in TOLD:
        rows, count = table.in_band(name), wanted.per_band.get(name, 0) + left
        left = count if not len(rows) else 0
        chosen += _evenly(table, rows, count - left)
    return sorted(set(chosen))


def _evenly(table: ModeTable, rows: IntArray, count: int) -> list[int]:
    """Choose modes of some rows evenly by rank."""
    by_size = rows[np.argsort(sizes(table)[rows])]
    places = (np.arange(count) + 0.5) / max(count, 1) * len(rows)
    return [int(by_size[int(place)]) for place in places]


def _nearest(table: ModeTable, omega: float) -> int:
    rows = np.flatnonzero(stable(table) if omega > 0 else unstable(table))
    if not len(rows):
        kind = "positive" if omega > 0 else "negative"
        msg = f"no mode has a {kind} eigenvalue, expected one near omega = {omega:g}"
        raise ValueError(msg)
    distance = np.abs(np.log(sizes(table)[rows] / abs(omega))) if omega else sizes(table)[rows]
    return int(rows[np.argmin(distance)])


def band_means(samples: Sequence[ModeTable], name: str) -> dict[str, Mean]:
    """Average a column over the modes of each band, then over samples, skipping samples without."""
    found = {}
    for band in TOLD:
        parts = [table[name][table.in_band(band)] for table in samples]
        found[band] = mean([part.mean() for part in parts if len(part)])
    return found


def modes_of(packing: Packing) -> ModeTable:
    """Find the modes of a packing, with their vectors; errors as `dynamical_matrix`."""
    landscape, state = Landscape(packing), State.of(packing)
    matrix = dynamical_matrix(landscape, state)
    return tabulate(landscape, state, matrix, spectrum(matrix))
