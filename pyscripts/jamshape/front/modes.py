"""Modes of vibration of a packing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jamshape.arguments import checked
from jamshape.checks import Range, require_in, require_no_effect, require_one_of, require_other_file
from jamshape.files.disk import require_hdf5_name, settled
from jamshape.files.outcomes import warn_unless_reached
from jamshape.front.packing import Packing, public
from jamshape.front.reading import Held, packing_of
from jamshape.landscape import Landscape, State
from jamshape.vibration.ensembles import TOLD, of_packing, to_store
from jamshape.vibration.hessian import DynamicalMatrix, DynamicalMatrixOptions, dynamical_matrix
from jamshape.vibration.sparse_modes import lowest as lowest_modes
from jamshape.vibration.sparse_modes import near as modes_near
from jamshape.vibration.sparse_modes import with_translations
from jamshape.vibration.spectrum import METHODS, Spectrum, spectrum
from jamshape.vibration.table import (
    ModeTable,
    holds_modes,
    read_modes,
    read_moved,
    tabulate,
    write_modes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SPARSE = "sparse"
_LOWEST = Range(1, 10**6, "modes", whole=True)
_NEAR = Range(0.0, 1e6, "a frequency")
_LEAST_FORCE = Range(0.0, 100.0, "mean forces of a bond")

FEW = 20  # default number of modes of the sparse method


@dataclass(frozen=True, eq=False, kw_only=True)
class Modes(ModeTable):
    """Modes of a packing by ascending eigenvalue, with their properties; ``modes["participation"]`` looks up a column.

    ``modes["band"]`` is -1 for translations, 0 for the low band (held by the prestress at second order), 1 for the middle
    one (at first order), 2 for the high one (stretching of bonds) and 3 where bands do not separate.

    Parameters
    ----------
    columns, vectors, coordinates, singular_values, attributes
        See `jamshape.vibration.table.ModeTable`.
    about : mapping of str to number or str
        Properties of the packing.
    packing : Packing, optional
        None for modes that were read from a file without eigenvectors.
    file : Path, optional
        File they were read from.
    matrix : DynamicalMatrix, optional
        The matrix that was diagonalised; None for modes that were read from a file.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> packing = js.make_packing(rods, n=16, u0=1e-8, file="packing.h5", progress=False)
    >>> modes = js.modes(packing)
    >>> len(modes), len(modes.in_band("translation"))
    (48, 2)
    >>> modes
    <48 modes (... high) of 16 of 16 particles held by 4... bonds: z = 5...>
    >>> bulk = modes.moduli.bulk
    >>> bulk.bound < 1e-6 * bulk.relaxed
    True
    """

    about: dict[str, Any]
    packing: Packing | None = None
    file: Path | None = None
    matrix: DynamicalMatrix | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "file", settled(self.file))

    @classmethod
    def of(cls, table: ModeTable, about: dict[str, Any], **more: Any) -> Modes:
        """Make modes of a table, the properties of their packing, and what else is known of them."""
        return cls(
            **{one.name: getattr(table, one.name) for one in fields(ModeTable)}, about=about, **more
        )

    @classmethod
    def read(cls, path: Path) -> Modes:
        """Read modes from a file; errors as `read_modes`."""
        table, packing = read_modes(path), read_moved(path)
        known = dict(table.attributes)
        return cls.of(
            table, known, file=path, packing=packing and public(packing, of_packing(table))
        )

    @property
    def table(self) -> Modes:
        """The modes themselves, an old name."""
        return self

    @property
    def told(self) -> Modes:
        """The modes, with the properties of the packing among their attributes as in a file."""
        return replace(self, attributes=self.about | self.attributes)

    def plot(self, axes: Axes | None = None, **look: Any) -> Axes:
        """Draw the density of their frequencies; arguments as in `jamshape.plot`."""
        from jamshape.front.pictures import plot  # noqa: PLC0415 - which knows modes

        return plot(self, axes, **look)

    @checked
    def save(self, path: str | Path, *, vectors: bool = True) -> None:
        """Write the modes to an HDF5 file, with or without eigenvectors and packing, replacing modes in it.

        Raises
        ------
        ValueError
            If the file exists and holds anything else, such as the packing.
        """
        read = [self.packing.file] if self.packing and self.packing.file else []
        require_modes_file(Path(path), read)
        write_modes(path, self, self.about, vectors=vectors, packing=self.packing)

    def __repr__(self) -> str:
        known = [name for name in TOLD if self.has_band(name)]
        counts = ", ".join(f"{len(self.in_band(name))} {name}" for name in known)
        a = self.attributes
        of = f"{a['n_backbone']} of {a['n']} particles held by {a['n_bonds']} bonds"
        is_whole = len(self) == a["n_modes"]
        bands = f" ({counts or 'no bands'})" if is_whole else f" of {a['n_modes']}"
        why = f"; {a['why_no_bands']}" if is_whole and "why_no_bands" in a else ""
        why += f"; {self.imbalance}" if self.imbalance else ""
        return f"<{len(self)} modes{bands} of {of}: z = {a['z']:.4g}{why}>"

    def _repr_html_(self) -> str:
        from jamshape.front.pictures import html  # noqa: PLC0415 - only notebooks ask

        return html(self)


def require_modes_file(out: Path, read: Sequence[Path] = ()) -> None:
    """Refuse to overwrite anything but modes.

    Parameters
    ----------
    out : Path
        Output file.
    read : sequence of Path
        Input files.

    Raises
    ------
    ValueError
    """
    require_hdf5_name(out)
    require_other_file(out, read)
    if out.exists() and not holds_modes(out):
        msg = f"{out} exists and holds no modes, expected another output file; choose one or remove it"
        raise ValueError(msg)


@checked
def modes(
    packing: Held,
    *,
    lowest: int | None = None,
    near: float | None = None,
    method: str | None = None,
    rotation: str = "half_length",
    least_force: float = 0.0,
    force: bool = False,
) -> Modes:
    """Find the modes of vibration of a packing (Marschall & Teitel 2018, Sec. III D).

    Parameters
    ----------
    packing : Packing, run or path
        Packing at a minimum of its energy, as from `make_packing` or `minimise`, or anything that `load` reads, of which the
        last frame is taken; its law stays.
    lowest : int, optional
        Number of softest modes to find, by a sparse method; all by default. Translations are
        added, flagged, as in the whole spectrum.
    near : float, [sqrt(energy) / length], optional
        Frequency around which to find `lowest` (or 20) modes.
    method : {"projected", "refined", "plain", "first_order", "sparse"}, optional
        Method for the whole spectrum, by default ``projected``; or ``sparse``, the default where only some modes are
        requested, which finds 20 unless `lowest` is given. See `jamshape.vibration.spectrum.spectrum`.
    rotation : {"half_length", "radius"}
        Length by which rotations in radians are scaled.
    least_force : float
        Omit contacts weaker than this many mean bond forces; 1e-4 omits grazing contacts.
    force : bool
        Compute even if the packing is not at a minimum: second derivatives in that state, with the net forces
        in the ``repr`` and, as ``residual``, in ``table.attributes``.

    Returns
    -------
    Modes
        Signed eigenvalues with error bounds, participation, kind of motion and band;
        translations have the eigenvalue 0.

    Raises
    ------
    ValueError
        If a number is out of its range, or there is no such method.
    NotAtMinimumError
        If forces do not balance, unless `force` is given.

    Warns
    -----
    NotReachedWarning
        If forces balance well enough for modes, but not to the tolerance of the packing, unless `force` is given.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> packing = js.make_packing(rods, n=16, u0=1e-8, file="packing.h5", progress=False)
    >>> softest = js.modes(packing, lowest=4)
    >>> softest.omega[softest.vibrational].shape
    (4,)
    >>> len(softest), len(softest.in_band("translation"))
    (6, 2)
    """
    require_one_of("the method", method or _SPARSE, (*METHODS, _SPARSE))
    require_one_of("rotation", rotation, ("half_length", "radius"))
    require_in("least_force", least_force, _LEAST_FORCE)
    if lowest is not None:
        require_in("lowest", lowest, _LOWEST)
    if near is not None:
        require_in("near", near, _NEAR)
    if method != _SPARSE:
        require_no_effect("lowest", lowest, method=method)
        require_no_effect("near", near, method=method)
    measured = packing_of(packing)
    if not force and not measured.reached:
        warn_unless_reached(measured.results)
    landscape, state = Landscape(measured), State.of(measured)
    options = DynamicalMatrixOptions(rotation, least_force, force=force)
    matrix = dynamical_matrix(landscape, state, options)
    found = _found(matrix, method or next(iter(METHODS)), lowest, near)
    table = tabulate(landscape, state, matrix, found)
    asked = {"rotation": rotation, "least_force": least_force}
    about = to_store(measured.results, measured) | asked
    return Modes.of(table, about, packing=measured, matrix=matrix)


def _found(
    matrix: DynamicalMatrix, method: str, lowest: int | None, near: float | None
) -> Spectrum:
    """Find the requested modes and translations."""
    few = lowest or min(FEW, max(1, matrix.size - matrix.translations.shape[1]))
    if near is not None:
        return with_translations(matrix, modes_near(matrix, few, near**2))
    if method == _SPARSE or lowest:
        return with_translations(matrix, lowest_modes(matrix, few))
    return spectrum(matrix, method)
