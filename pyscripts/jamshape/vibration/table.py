"""The complete analysis of a packing's modes as one table, and its HDF5 file.

::

    /modes          eigenvalues, omega, sign, solver_error, entry_error, overlap_error, state_error, is_translation, participation, parallel, perpendicular, rotation, of_round (k,); band (k,), see `BANDS`;
    vectors (n, k) if requested
    /particles/all  the packing, beside vectors: see `jamshape.files.h5md`
    /coordinates    particle, kind (n,), direction (n, D + T): see `jamshape.vibration.hessian.Coordinates`
    /singular_values
    /parameters     +every scalar result, and attributes of the packing and the method: for each modulus, and for the
    tensors B and C (see `jamshape.vibration.tensors`) as matrices, its value (NaN if undefined), _bound, _affine, _rounding,
    _of_state and, if needed, _reason; bordered_eigenvalue, _bound; is_stable_to_shear, if decided
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import FloatArray, IntArray
from jamshape.checks import require_one_of
from jamshape.files import hdf5
from jamshape.files.disk import PathLike
from jamshape.files.hdf5 import FileFormatError
from jamshape.files.layout import FrameReader, version, write_particles
from jamshape.files.vocabulary import FORMAT_VERSION, require_format
from jamshape.landscape import Landscape, State
from jamshape.packing import Packing
from jamshape.packing.box import COMPONENTS
from jamshape.vibration.elasticity import Moduli, moduli
from jamshape.vibration.hessian import LARGEST_RESIDUAL, Coordinates, DynamicalMatrix
from jamshape.vibration.spectrum import Spectrum, state_error
from jamshape.vibration.stability import Eigenvalue
from jamshape.vibration.statistics import bands, components, count, participation, why_no_bands
from jamshape.vibration.tensors import ElasticTensor, Modulus

if TYPE_CHECKING:
    import h5py

BANDS = {-1: "translation", 0: "low", 1: "middle", 2: "high", 3: "none"}
_TRANSLATION, _HIGH, _NONE = -1, 2, 3

MODULI = ("bulk", "pure_shear", "simple_shear")
TENSORS = ("B", "C")
AVERAGES = ("G_dc", "G_ac", "G_min", "G_max", "smallest")
"""Moduli of B that are stored beside it."""

COUNTS = ("n_floppy_left_out", "n_unsettled_left_out", "n_negative_modes")
"""Attributes with the counts of `Moduli`."""

_BORDERED = ("eigenvalue", "eigenvalue_bound")

PARTS = ("affine", "rounding", "of_state")
"""Ends of the names of attributes with parts of a `Modulus`."""

ERRORS = ("solver_error", "entry_error", "overlap_error")
"""Columns that contribute to the error bound of each eigenvalue."""

COLUMNS = (
    *("eigenvalues", "omega", "sign", *ERRORS, "state_error", "is_translation"),
    *("participation", "parallel", "perpendicular", "rotation", "of_round", "band"),
)
"""Data sets of a table of modes, /modes in its file."""

_REQUIRED = (
    *(f"modes/{name}" for name in COLUMNS),
    *(f"coordinates/{name}" for name in ("particle", "kind", "direction")),
    *("singular_values", "parameters"),
)


@dataclass(frozen=True, eq=False)
class ModeTable:
    """Modes of a packing, by ascending eigenvalue, with their properties.

    Parameters
    ----------
    columns : dict of str to (k,) array
        Data sets under /modes of the file.
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
        """Return a column by name; raises KeyError, with the names of all, if there is none."""
        if name not in self.columns:
            msg = f"{name} is not a column of modes, expected one of {', '.join(self.columns)}"
            raise KeyError(msg)
        return self.columns[name]

    def __len__(self) -> int:
        return len(self["eigenvalues"])

    @property
    def eigenvalues(self) -> FloatArray:
        """(k,) eigenvalues of the dynamical matrix, ascending, [energy / length^2]."""
        return self["eigenvalues"]

    @property
    def omega(self) -> FloatArray:
        """(k,) frequencies sign(lambda) sqrt(abs(lambda))."""
        return self["omega"]

    @property
    def participation(self) -> FloatArray:
        """(k,) participation ratios; in 2D 3 if x, y and rotation share equally, 1/N for one coordinate."""
        return self["participation"]

    @property
    def bound(self) -> FloatArray:
        """(k,) bound of the error of each eigenvalue of this state."""
        return np.asarray(np.sum([self[name] for name in ERRORS], axis=0))

    def in_band(self, name: str) -> IntArray:
        """Rows of the modes of a band: translation, low, middle or high.

        Empty where bands do not separate, as far above jamming; ``repr(modes)`` gives the reason.
        """
        require_one_of("band", name, BANDS.values())
        code = next(code for code, word in BANDS.items() if word == name)
        return np.flatnonzero(self["band"] == code)

    def has_band(self, name: str) -> bool:
        """Whether it is known which modes are in this band: not if bands do not separate or modes are few."""
        is_none = bool((self["band"] == _NONE).any())
        return not is_none or (name == BANDS[_HIGH] and len(self.in_band(name)) > 0)

    @property
    def vibrational(self) -> IntArray:
        """Rows of all modes but translations, which are flagged by ``modes["is_translation"]`` and have omega = 0."""
        return np.flatnonzero(~np.asarray(self["is_translation"], bool))

    @property
    def n_vibrational(self) -> int:
        """Number of modes of the packing without translations, whether or not they were found."""
        return int(self.attributes["n_modes"] - self.attributes["n_translations"])

    @property
    def imbalance(self) -> str:
        """Net forces of a state that is not at a minimum, in words; an empty text at a minimum."""
        residual = self.attributes["residual"]
        if residual <= LARGEST_RESIDUAL:
            return ""
        return f"not at a minimum: net forces up to {residual:.2g} of the mean bond force"

    @property
    def moduli(self) -> Moduli:
        """Elastic moduli."""
        a = self.attributes
        bulk, pure_shear, simple_shear = (_stored_modulus(a, f"{name}_modulus") for name in MODULI)
        D = self.coordinates.dimension
        B, C = (_stored_tensor(a, name, D) for name in TENSORS)
        bordered = Eigenvalue(*(float(a.get(f"bordered_{name}", np.nan)) for name in _BORDERED))
        counts = (int(a[name]) for name in COUNTS)
        return Moduli(bulk, pure_shear, simple_shear, a["pressure"], B, C, bordered, *counts)


def tabulate(
    landscape: Landscape, state: State, matrix: DynamicalMatrix, found: Spectrum
) -> ModeTable:
    """Measure all properties of modes: a whole spectrum, or a few.

    Parameters
    ----------
    landscape, state
        State of the matrix.
    matrix : DynamicalMatrix
    found : Spectrum

    Returns
    -------
    ModeTable
        Translations have the eigenvalue 0.
        A few modes have no bands and no state errors; these errors, and those of moduli, are also unknown
        if contacts were left out, since the state is then not a minimum.
    """
    found = found.with_exact_translations()
    coordinates, k = matrix.coordinates, len(found.eigenvalues)
    whole = k == matrix.size
    band = np.where(found.is_translation, _TRANSLATION, _NONE)
    attributes: dict[str, Any] = {
        "method": found.method,
        "wall_seconds": found.wall_seconds,
        "n": coordinates.n_all,
        "n_backbone": matrix.n_particles,
        "n_modes": matrix.size,
        "n_translations": matrix.translations.shape[1],
        "n_bonds": matrix.n_bonds,
        "z": matrix.z,
        "residual": matrix.residual.largest,
        "bond_force": matrix.bond_force,
        "n_left_out": matrix.n_left_out,
    }
    why = f"no bands: {len(found.vectors.T)} of {matrix.size} modes are known"
    if whole:
        for b in bands(matrix, found):
            band[b.modes] = {word: code for code, word in BANDS.items()}[b.name]
        why = why_no_bands(matrix, found)
    attributes |= {"why_no_bands": why} if why else {}
    if whole and len(found.singular_values):
        attributes |= count(matrix, found)._asdict()
    at = None if matrix.n_left_out else (landscape, state)
    attributes |= _to_store(_moduli(matrix, found, at))
    kinds = components(coordinates, state.packing(landscape.particles), found.vectors)
    error = state_error(*at, matrix, found) if whole and at else np.full(k, np.nan)
    columns = {
        "participation": participation(coordinates, found.vectors),
        **kinds._asdict(),
        "state_error": error,
        "band": band,
    }
    columns |= {name: getattr(found, name) for name in COLUMNS if name not in columns}
    return ModeTable(columns, found.vectors, coordinates, found.singular_values, attributes)


def _moduli(matrix: DynamicalMatrix, found: Spectrum, at: tuple[Landscape, State] | None) -> Moduli:
    """Compute moduli; if contacts were left out, mark their bounds as unknown."""
    elastic = moduli(matrix, found, at)
    if at is not None:
        return elastic
    why = f"the bound is unknown, as {matrix.n_left_out} contacts were left out"
    given = {name: getattr(elastic, name) for name in MODULI}
    known: dict[str, Any] = {name: m._replace(reason=m.reason or why) for name, m in given.items()}
    for name in TENSORS:
        tensor: ElasticTensor = getattr(elastic, name)
        known[name] = replace(tensor, reasons=tuple(one or why for one in tensor.reasons))
    return elastic._replace(**known)


def _to_store(elastic: Moduli) -> dict[str, Any]:
    """Spread moduli over attributes."""
    found: dict[str, Any] = {"pressure": elastic.pressure}
    counts = (elastic.n_floppy, elastic.n_unsettled, elastic.n_negative)
    found |= dict(zip(COUNTS, counts, strict=True))
    for name in MODULI:
        modulus: Modulus = getattr(elastic, name)
        found |= _parts(f"{name}_modulus", modulus)
        found |= {f"{name}_modulus_reason": modulus.reason} if modulus.reason else {}
    for name in TENSORS:
        tensor: ElasticTensor = getattr(elastic, name)
        why = zip(tensor.components, tensor.reasons, strict=True)
        found |= _parts(name, tensor)
        found |= {f"{name}_{component}_reason": reason for component, reason in why if reason}
    for name in AVERAGES:
        average: Modulus = getattr(elastic.B, name)
        found |= {f"B_{name}": average.relaxed, f"B_{name}_bound": average.bound}
    found |= {f"bordered_{k}": v for k, v in zip(_BORDERED, elastic.bordered, strict=True)}
    stable = elastic.is_stable_to_shear
    return found if stable is None else found | {"is_stable_to_shear": stable}


def _parts(key: str, modulus: Modulus | ElasticTensor) -> dict[str, Any]:
    """List value, bound and the parts of a modulus or tensor."""
    found = {key: modulus.relaxed, f"{key}_bound": modulus.bound}
    return found | {f"{key}_{part}": getattr(modulus, part) for part in PARTS}


def _stored_tensor(attributes: Mapping[str, Any], name: str, dimension: int) -> ElasticTensor:
    """Read a tensor; without any, as in files of earlier versions, it is undefined."""
    components = COMPONENTS[dimension]
    d = len(components)
    if name not in attributes:
        why = "the file has no elastic tensors; compute its modes again"
        nothing, unknown = np.full((d, d), np.nan), np.full((d, d), np.inf)
        return ElasticTensor.of((nothing, nothing, unknown, unknown), (why,) * d)
    keys = (name, *(f"{name}_{part}" for part in PARTS))
    arrays = [np.asarray(attributes[key], np.float64) for key in keys]
    reasons = tuple(str(attributes.get(f"{name}_{one}_reason", "")) for one in components)
    return ElasticTensor.of(arrays, reasons)


def _stored_modulus(attributes: Mapping[str, Any], key: str) -> Modulus:
    affine, rounding, of_state = (float(attributes[f"{key}_{p}"]) for p in PARTS)
    reason = str(attributes.get(f"{key}_reason", ""))
    return Modulus(float(attributes[key]), affine, rounding, of_state, reason)


def write_modes(
    path: PathLike,
    table: ModeTable,
    attributes: Mapping[str, Any],
    *,
    vectors: bool,
    packing: Packing | None = None,
) -> None:
    """Write a table; an existing file is replaced only when writing is complete.

    Parameters
    ----------
    path : path-like
    table : ModeTable
    attributes : mapping
        More to store, such as those of the packing.
    vectors : bool
        Whether to store the eigenvectors.
    packing : Packing, optional
        Stored beside eigenvectors, which move it.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    c = table.coordinates
    with hdf5.written(path) as file:
        for name in COLUMNS:
            hdf5.put(file, f"modes/{name}", table[name])
        hdf5.set_attributes(file["modes"], {"format_version": FORMAT_VERSION, "version": version()})
        if vectors:
            hdf5.put(file, "modes/vectors", table.vectors)
            if packing is not None:
                write_particles(file.create_group("particles/all"), [packing])
        for name in ("particle", "kind", "direction"):
            hdf5.put(file, f"coordinates/{name}", getattr(c, name))
        size = {"n_all": c.n_all, "dimension": c.dimension}
        hdf5.set_attributes(file["coordinates"], size)
        hdf5.put(file, "singular_values", table.singular_values)
        hdf5.set_attributes(file.create_group("parameters"), {**attributes, **table.attributes})


def read_modes(path: PathLike) -> ModeTable:
    """Read a table.

    Raises
    ------
    FileFormatError
        If the file is not one of `write_modes`.
    OSError
        If it cannot be opened.
    """
    with hdf5.reading(path) as file:
        if hdf5.has_item(file, "modes"):
            group = hdf5.require_item(file, "modes")
            creator = str(hdf5.attribute(group, "version", "0.1.0"))
            require_format(path, int(hdf5.attribute(group, "format_version", 2)), creator)
        return table_of(file)


def read_moved(path: PathLike) -> Packing | None:
    """Read the packing beside eigenvectors; None where there is none. Errors as `read_modes`."""
    with hdf5.reading(path) as file:
        return FrameReader(file).read(0) if hdf5.has_item(file, "particles/all") else None


def holds_modes(path: PathLike) -> bool:
    """Whether an HDF5 file was written by `write_modes`, complete or not; errors as `read_modes`."""
    with hdf5.reading(path) as file:
        return hdf5.has_item(file, "modes")


def table_of(file: h5py.File) -> ModeTable:
    """Read an open file."""
    if not all(hdf5.has_item(file, name) for name in _REQUIRED):
        msg = f"{file.filename}: is not a complete file of modes, expected one of jamshape modes"
        raise FileFormatError(msg)

    def read(name: str, *shape: int) -> NDArray[Any]:
        """Read a dataset of this shape, -1 for any extent."""
        dataset = hdf5.require_dataset(file, name)
        found = dataset.shape
        fits = len(found) == len(shape) and all(
            m in {n, -1} for n, m in zip(found, shape, strict=True)
        )
        if not fits:
            msg = f"{file.filename}: /{name} has shape {found}, expected {shape}; write it again"
            raise FileFormatError(msg)
        return np.asarray(dataset[()])

    size = hdf5.attributes_of(hdf5.require_item(file, "coordinates"))
    n_all, dimension = int(size["n_all"]), int(size["dimension"])
    particle = read("coordinates/particle", -1)
    n, k = len(particle), len(read("modes/eigenvalues", -1))
    kind, direction = (
        read("coordinates/kind", n),
        read("coordinates/direction", n, 3 * dimension - 3),
    )
    coordinates = Coordinates(particle, kind, direction, n_all, dimension)
    columns = {name: read(f"modes/{name}", k) for name in COLUMNS}
    stored = read("modes/vectors", n, k) if _has_column(file, "vectors") else np.empty((n, 0))
    is_impossible = dimension not in {2, 3} or (
        n and not 0 <= particle.min() <= particle.max() < n_all
    )
    if is_impossible:
        msg = f"{file.filename}: has coordinates of other particles, expected those of {n_all}; write it again"
        raise FileFormatError(msg)
    singular_values = read("singular_values", -1)
    return ModeTable(
        columns, stored, coordinates, singular_values, hdf5.attributes(file, "parameters")
    )


def _has_column(file: h5py.File, name: str) -> bool:
    return hdf5.has_item(file, f"modes/{name}")
