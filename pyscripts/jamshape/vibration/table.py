"""The whole analysis of one packing's modes as one table, and its HDF5 file.

::

    /modes          eigenvalues, omega, sign, solver_error, entry_error, overlap_error (0 of earlier versions),
                    state_error, is_translation, participation, parallel, perpendicular, rotation, of_round (k,); band (k,) as in `BANDS`;
                    vectors (n, k) if asked for
    /coordinates    particle, kind (n,), direction (n, D + T): see `jamshape.vibration.hessian.Coordinates`
    /singular_values
    /parameters     +every result that is one number, and what the packing and the method were
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.files import layout
from jamshape.files.disk import PathLike
from jamshape.files.h5md import FileFormatError
from jamshape.landscape import Landscape, State
from jamshape.vibration.elasticity import moduli
from jamshape.vibration.hessian import Coordinates, DynamicalMatrix
from jamshape.vibration.spectrum import Spectrum, state_error
from jamshape.vibration.statistics import bands, components, count, participation

if TYPE_CHECKING:
    import h5py

BANDS = {-1: "translation", 0: "low", 1: "middle", 2: "high", 3: "not told"}

# Of each eigenvalue, which together bound it.
_ERRORS = ("solver_error", "entry_error", "overlap_error")

_COLUMNS = (
    *("eigenvalues", "omega", "sign", *_ERRORS, "state_error"),
    *(
        "is_translation",
        "participation",
        "parallel",
        "perpendicular",
        "rotation",
        "of_round",
        "band",
    ),
)


@dataclass(frozen=True, eq=False)
class ModeTable:
    """Modes of a packing, by ascending eigenvalue, with what is known of each.

    Parameters
    ----------
    columns : dict of str to (k,) array
        Those under /modes of the file.
    vectors : (n, k) array of float64
        Unit columns; (n, 0) if they were not stored.
    coordinates : Coordinates
    singular_values : (min(m, n),) array of float64, or empty
    attributes : dict of str to number or str
    """

    columns: dict[str, NDArray[Any]]
    vectors: FloatArray
    coordinates: Coordinates
    singular_values: FloatArray
    attributes: dict[str, Any]

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column by name."""
        return self.columns[name]

    @property
    def bound(self) -> FloatArray:
        """(k,) bound of the error of each eigenvalue of the state as it is."""
        return np.asarray(np.sum([self[name] for name in _ERRORS], axis=0))

    def in_band(self, name: str) -> IntArray:
        """Rows of the modes of one band."""
        code = next(code for code, word in BANDS.items() if word == name)
        return np.flatnonzero(self["band"] == code)


def tabulate(
    landscape: Landscape, state: State, matrix: DynamicalMatrix, found: Spectrum
) -> ModeTable:
    """Measure everything of modes that were found: a whole spectrum, or a few.

    Parameters
    ----------
    landscape, state
        What the matrix is of.
    matrix : DynamicalMatrix
    found : Spectrum

    Returns
    -------
    ModeTable
        Of a few modes, bands and errors of the state are not told; nor are these errors where contacts
        were left out, without which the state is no minimum.
    """
    coordinates, k = matrix.coordinates, len(found.eigenvalues)
    whole = k == matrix.size
    band = np.full(k, 3)
    attributes: dict[str, Any] = {
        "method": found.method,
        "wall_seconds": found.wall_seconds,
        "n": coordinates.n_all,
        "n_backbone": matrix.n_particles,
        "n_modes": matrix.size,
        "n_bonds": matrix.n_bonds,
        "z": matrix.z,
        "residual": matrix.residual.largest,
        "bond_force": matrix.bond_force,
        "n_left_out": matrix.n_left_out,
    }
    if whole:
        band[found.is_translation] = -1
        for b in bands(matrix, found):
            band[b.modes] = {word: code for code, word in BANDS.items()}[b.name]
    if whole and len(found.singular_values):
        attributes |= count(matrix, found)._asdict()
    elastic = moduli(matrix)
    attributes |= {
        "bulk_modulus": elastic.bulk.relaxed,
        "pure_shear_modulus": elastic.pure_shear.relaxed,
        "simple_shear_modulus": elastic.simple_shear.relaxed,
        "pressure": elastic.pressure,
    }
    kinds = components(coordinates, state.packing(landscape.particles), found.vectors)
    settled = whole and not matrix.n_left_out
    error = state_error(landscape, state, matrix, found) if settled else np.full(k, np.nan)
    columns = {
        "participation": participation(coordinates, found.vectors),
        **kinds._asdict(),
        "state_error": error,
        "band": band,
    }
    columns |= {name: getattr(found, name) for name in _COLUMNS if name not in columns}
    return ModeTable(columns, found.vectors, coordinates, found.singular_values, attributes)


def write_modes(
    path: PathLike, table: ModeTable, attributes: Mapping[str, Any], *, vectors: bool
) -> None:
    """Write a table, replacing the file at `path` only when all is written.

    Parameters
    ----------
    path : path-like
    table : ModeTable
    attributes : mapping
        More to store, such as those of the packing.
    vectors : bool
        Whether to store the modes themselves.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    c = table.coordinates
    with layout.written(path) as file:
        for name in _COLUMNS:
            file[f"modes/{name}"] = table[name]
        if vectors:
            file["modes/vectors"] = table.vectors
        for name in ("particle", "kind", "direction"):
            file[f"coordinates/{name}"] = getattr(c, name)
        file["coordinates"].attrs.update({"n_all": c.n_all, "dimension": c.dimension})
        file["singular_values"] = table.singular_values
        file.create_group("parameters").attrs.update({**attributes, **table.attributes})


def read_modes(path: PathLike) -> ModeTable:
    """Read a table.

    Raises
    ------
    FileFormatError
        If the file is not one of `write_modes`.
    OSError
        If it cannot be opened.
    """
    try:
        with layout.hdf5().File(path, "r") as file:
            return _read(file)
    except (KeyError, RuntimeError) as error:
        msg = f"{path}: is no complete file of modes, expected one written by analysis/modes.py"
        raise FileFormatError(msg) from error


def holds_modes(path: PathLike) -> bool:
    """Whether an HDF5 file is one of `write_modes`, complete or not; errors as `read_modes`."""
    with layout.readable(path), layout.hdf5().File(path, "r") as file:
        return "modes" in file


def _read(file: h5py.File) -> ModeTable:
    group, of = file["modes"], file["coordinates"]
    stored_of = {name: group[name][()] for name in _COLUMNS if name in group}
    # Files of earlier versions do not tell what the rounding of overlaps changes.
    columns = {"overlap_error": np.zeros(len(stored_of["eigenvalues"]))} | stored_of
    if missing := set(_COLUMNS) - columns.keys():
        raise KeyError(*missing)
    particle, kind, direction = (of[name][()] for name in ("particle", "kind", "direction"))
    n_all, dimension = int(of.attrs["n_all"]), int(of.attrs["dimension"])
    coordinates = Coordinates(particle, kind, direction, n_all, dimension)
    stored = group["vectors"][()] if "vectors" in group else np.empty((coordinates.size, 0))
    attributes = {
        k: v.item() if hasattr(v, "item") else v for k, v in file["parameters"].attrs.items()
    }
    return ModeTable(columns, stored, coordinates, file["singular_values"][()], attributes)
