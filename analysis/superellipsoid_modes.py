"""What the figures of modes of superellipsoids share: spectra kept in files, modes that are quartic."""

from __future__ import annotations

import contextlib
from argparse import ArgumentParser
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from superellipsoid_files import packing_of
from sweep_files import Sample

from jamshape.arrays import FloatArray, IntArray
from jamshape.files.h5md import FileFormatError
from jamshape.landscape import Landscape, State
from jamshape.vibration.energy_along import AlongModes, EnergyAlong, quartic_crossover
from jamshape.vibration.hessian import dynamical_matrix
from jamshape.vibration.spectrum import spectrum
from jamshape.vibration.table import ModeTable, read_modes, tabulate, write_modes

# What tells a packing from others.
_IDENTITY = ("phi", "u", "seed")

AMPLITUDES: FloatArray = np.geomspace(1e-5, 0.3, 37)  # in units of a


class QuarticCount(NamedTuple):
    """Contacts and quartic modes of a packing (Yuan et al. 2019, Sec. 3.2)."""

    n_contacts: int
    """N_c, without those of rattlers."""
    n_coordinates: int
    """d_f (N - N_r), without spins that no contact can drive."""
    n_quartic: int
    """N_q: modes below the gap of the spectrum, translations left out."""
    n_quartic_by_rank: int
    """The same from the rank of H: modes that contacts leave free to first order."""
    gap: float
    """Ratio of the eigenvalues on its two sides; 0 if there is no quartic mode."""
    n_negative: int

    @property
    def expected(self) -> int:
        """N_c of the paper: d_f (N - N_r) - N_q - 2."""
        return self.n_coordinates - self.n_quartic - 2

    @property
    def missing(self) -> int:
        """How far N_c is from the unit line; positive for too many contacts."""
        return self.n_contacts - self.expected


def modes_option(parser: ArgumentParser) -> None:
    """Add the option that says where spectra are kept."""
    where = "folder to keep spectra in (beside the packings)"
    parser.add_argument("--modes", type=Path, metavar="FOLDER", help=where)


def kept_modes(sample: Sample, folder: Path | None) -> ModeTable:
    """Read the modes of a packing, or find them and keep them for the next time, without vectors."""
    path = (folder or sample.path.parent) / f"{sample.path.stem}.modes.h5"
    with contextlib.suppress(FileFormatError, FileNotFoundError):
        table = read_modes(path)
        if all(table.attributes.get(f"packing_{k}") == sample.number(k) for k in _IDENTITY):
            return table
    table = found_modes(sample)
    path.parent.mkdir(parents=True, exist_ok=True)
    stored = {f"packing_{k}": v for k, v in sample.attributes.items()}
    write_modes(path, table, stored, vectors=False)
    return table


def found_modes(sample: Sample) -> ModeTable:
    """Find the modes of a packing, with their vectors."""
    packing = packing_of(sample)
    landscape, state = Landscape(packing), State.of(packing)
    try:
        matrix = dynamical_matrix(landscape, state)
    except ValueError as error:
        msg = f"{sample.path}: {error}"
        raise ValueError(msg) from error
    return tabulate(landscape, state, matrix, spectrum(matrix))


def by_size(table: ModeTable) -> IntArray:
    """Modes but translations, by ascending size of their eigenvalues."""
    rows = np.flatnonzero(~table["is_translation"])
    return np.asarray(rows[np.argsort(np.abs(table["eigenvalues"][rows]), kind="stable")])


def quartic_count(table: ModeTable) -> QuarticCount:
    """Count contacts and quartic modes."""
    below = len(table.in_band("low")) + len(table.in_band("middle"))
    size = np.abs(table["eigenvalues"][by_size(table)])
    return QuarticCount(
        n_contacts=int(table.attributes["n_bonds"]),
        n_coordinates=int(table.attributes["n_modes"]),
        n_quartic=below,
        n_quartic_by_rank=int(table.attributes["n_floppy"]),
        gap=float(size[below] / size[below - 1]) if 0 < below < len(size) else 0.0,
        n_negative=int((table["sign"] < 0).sum()),
    )


def along(sample: Sample, table: ModeTable, modes: list[int]) -> dict[int, EnergyAlong]:
    """Follow the energy along modes of a table with vectors."""
    walker = AlongModes(packing_of(sample), table.coordinates)
    return {mode: walker.energy(table.vectors[:, mode], AMPLITUDES) for mode in modes}


def followed(sample: Sample, each_side: int) -> dict[str, Any]:
    """Follow the energy along modes on both sides of the gap: which of them are quartic.

    Returns
    -------
    dict
        Numbers of modes followed below and above, of those that are quartic, and the crossovers.
    """
    table = found_modes(sample)
    n = quartic_count(table).n_quartic
    order = by_size(table)
    below, above = order[max(n - each_side, 0) : n].tolist(), order[n : n + each_side].tolist()
    energies = along(sample, table, below + above)
    delta = {mode: quartic_crossover(energy) for mode, energy in energies.items()}
    crossovers = [delta[mode] for mode in below]
    return {
        "followed_below": len(below),
        "quartic_below": int(np.isfinite(crossovers).sum()),
        "followed_above": len(above),
        "quartic_above": sum(bool(np.isfinite(delta[mode])) for mode in above),
    }
