"""Quartic modes of packings at first contact (Yuan et al., Soft Matter (2019), Sec. 3.2), with cached spectra."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from common.energy_along import AlongModes, EnergyAlong, quartic_crossover
from common.mode_tables import modes_of
from jamshape.arrays import FloatArray, IntArray
from jamshape.files.h5md import FileFormatError
from jamshape.files.sets import PackingFile
from jamshape.vibration.sets import of_packing, to_store
from jamshape.vibration.table import ModeTable, read_modes, write_modes

KEPT = "folder to keep spectra in (beside the packings)"

# Attributes that identify a packing.
_IDENTITY = ("phi", "u", "seed")

AMPLITUDES: FloatArray = np.geomspace(1e-5, 0.3, 37)  # in the unit of length


class QuarticCount(NamedTuple):
    """Contacts and quartic modes of a packing."""

    n_contacts: int
    """N_c, without those of rattlers."""
    n_coordinates: int
    """d_f (N - N_r), without free spins."""
    n_quartic: int
    """N_q: modes below the gap of the spectrum, without translations; from the rank if there is no gap."""
    n_quartic_by_rank: int
    """The same from the rank of H: modes that contacts leave free to first order."""
    gap: float
    """Ratio of the eigenvalues on its two sides; 0 without quartic modes."""
    n_negative: int
    n_translations: int
    """D: rigid translations."""

    @property
    def expected(self) -> int:
        """N_c of the paper: d_f (N - N_r) - N_q - (D - 1)."""
        return self.n_coordinates - self.n_quartic - self.n_translations + 1

    @property
    def missing(self) -> int:
        """Deviation of N_c from the unit line; positive for too many contacts."""
        return self.n_contacts - self.expected


def kept_modes(file: PackingFile, folder: Path | None) -> ModeTable:
    """Read the cached modes of a packing, or compute and cache them, without vectors."""
    path = (folder or file.path.parent) / f"{file.path.stem}.modes.h5"
    with contextlib.suppress(FileFormatError, FileNotFoundError):
        table = read_modes(path)
        known = of_packing(table)
        if all(known.get(name) == file.number(name) for name in _IDENTITY):
            return table
    table = found_modes(file)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_modes(path, table, to_store(file.attributes, file.packing()), vectors=False)
    return table


def found_modes(file: PackingFile) -> ModeTable:
    """Find the modes of a packing, with their vectors.

    Raises
    ------
    ValueError
        If it is not at a minimum, or has no modes; the message names the file.
    """
    try:
        return modes_of(file.packing())
    except ValueError as error:
        msg = f"{file.path}: {error}"
        raise ValueError(msg) from error


def by_size(table: ModeTable) -> IntArray:
    """Modes without translations, by ascending magnitude of their eigenvalues."""
    rows = np.flatnonzero(~table["is_translation"])
    return np.asarray(rows[np.argsort(np.abs(table["eigenvalues"][rows]), kind="stable")])


def quartic_count(table: ModeTable) -> QuarticCount:
    """Count contacts and quartic modes."""
    n_floppy = int(table.attributes["n_floppy"])
    is_apart = table.has_band("high")
    below = table.n_vibrational - len(table.in_band("high")) if is_apart else n_floppy
    size = np.abs(table["eigenvalues"][by_size(table)])
    return QuarticCount(
        n_contacts=int(table.attributes["n_bonds"]),
        n_coordinates=int(table.attributes["n_modes"]),
        n_quartic=below,
        n_quartic_by_rank=n_floppy,
        gap=float(size[below] / size[below - 1]) if 0 < below < len(size) else 0.0,
        n_negative=int((table["sign"] < 0).sum()),
        n_translations=table.coordinates.dimension,
    )


def along(file: PackingFile, table: ModeTable, modes: list[int]) -> dict[int, EnergyAlong]:
    """Follow the energy along modes of a table with vectors."""
    walker = AlongModes(file.packing(), table.coordinates)
    return {mode: walker.energy(table.vectors[:, mode], AMPLITUDES) for mode in modes}


def followed(file: PackingFile, each_side: int) -> dict[str, Any]:
    """Follow the energy along modes on both sides of the gap: which of them are quartic.

    Returns
    -------
    dict
        Numbers of modes followed below and above, and of quartic ones among them.
    """
    table = found_modes(file)
    n = quartic_count(table).n_quartic
    order = by_size(table)
    below, above = order[max(n - each_side, 0) : n].tolist(), order[n : n + each_side].tolist()
    energies = along(file, table, below + above)
    quartic = {mode: bool(np.isfinite(quartic_crossover(e))) for mode, e in energies.items()}
    return {
        "followed_below": len(below),
        "quartic_below": sum(quartic[mode] for mode in below),
        "followed_above": len(above),
        "quartic_above": sum(quartic[mode] for mode in above),
    }
