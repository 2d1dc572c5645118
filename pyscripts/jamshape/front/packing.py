"""The public class of packings: with contacts, pressure, order, pictures and exports."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arguments import checked, checked_fields
from jamshape.arrays import BoolArray, real_numbers
from jamshape.contacts import Contacts
from jamshape.contacts.network import sum_forces
from jamshape.files.disk import PathLike, named
from jamshape.files.h5md import read_attributes, read_packing
from jamshape.files.outcomes import AT_REST, is_reached, shortfall
from jamshape.measures.order import cubatic, nematic, tetratic
from jamshape.packing import Box
from jamshape.packing import Packing as PackingLike
from jamshape.packing.plain import Bodies, box_of, unturned
from jamshape.shapes.shape import Interaction
from jamshape.shapes.table import shape_named

_SAME_PHI = 1e-6  # relative; more than any rounding, and than that of boxes in single precision

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from jamshape.front.modes import Modes
    from jamshape.lammps.living import Living


@checked_fields
@dataclass(frozen=True, eq=False, kw_only=True)
class Packing(PackingLike):
    """Particles in a periodic box, and everything that can be computed from them.

    Arrays are copied and made read-only; use `with_` to change one. `Packing.of` makes a packing from plain arrays
    and parameters of the shape. Contacts follow its law, ``packing.law``, which copies and files keep.

    Parameters
    ----------
    position : (N, D) array of float64, [length]
    orientation : (N,) or (N, 4) array of float64
        Angle of the body's x axis in radians in 2D, unit quaternion w i j k in 3D.
    diameters : (N, 3) array of float64, [length]
        Shape columns of LAMMPS: (2(A+R), 2R, 2R) for elongated particles, three equal ones for discs,
        (2a, 2b, 2c) for bodies with semi-axes a, b, c.
    species : (N,) array of int64
        LAMMPS types, from 1.
    id : (N,) array of int64
        LAMMPS IDs, from 1, each once.
    box : Box
    image : (N, D) array of int64, optional
        Periodic image counts; zeros by default.
    shape_style : str
        ``"spherocylinder"``, ``"superellipsoid"``, ``"dimer"``, ``"clump"`` or ``"spheropolygon"``.
    form : (N, K) array of float64, optional
        Numbers beside the diameters, for shapes that have some: the exponent of superellipsoids.
    exponent : (N,) array of float64, optional
        The form of superellipsoids, p of ``|x/a|^2p + |y/b|^2p + |z/c|^2p = 1``; ones by default.
    law : Interaction
        Constants of the contacts; by default k_e = 1 and two bonds side to side.
    step : int
    time : float, [time]
    position_rest : (N, D) array of float64, [length], optional
        Low-order part of the position in double-double precision; zeros by default. See `poses`.
    orientation_rest : array as `orientation`, of float64, optional
        Low-order part of the orientation.
    edges_rest : (D,) array of float64, [length], optional
        Low-order part of the edges.
    tilt_rest : (D (D - 1) / 2,) array of float64, [length], optional
        Low-order part of the tilt.
    results : mapping of str to number or str, optional
        Attributes of its file: how it was made and what was measured.
    file : Path, optional
        File it was read from.

    Raises
    ------
    ValueError
        If array shapes disagree, a number is not finite, a diameter is not positive, an exponent is not
        above 1/2, an ID occurs twice, the diameters do not fit the shape style, or the law is invalid.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> packing = js.make_packing(rods, n=16, u0=1e-8, file="packing.h5", progress=False)
    >>> packing.z, packing.results["outcome"]
    (5..., 'converged')
    >>> packing.contacts()
    <4... contacts of 16 particles: z = 5... bonds per particle, 0 rattlers left out>
    >>> rod_and_disc = js.Packing(
    ...     position=[[2, 5], [8, 5]], orientation=[0, 0], diameters=[[5, 1, 1], [1, 1, 1]],
    ...     species=[1, 2], id=[1, 2], box=js.Box(lo=[0, 0], edges=[10, 10]),
    ... )
    >>> round(rod_and_disc.phi, 4)
    0.0557
    """

    @classmethod
    @checked
    def of(
        cls,
        shape: str,
        position: ArrayLike,
        orientation: ArrayLike | None = None,
        *,
        box: Box | ArrayLike,
        lo: ArrayLike | None = None,
        size: ArrayLike | None = None,
        diameters: ArrayLike | None = None,
        species: ArrayLike | None = None,
        id: ArrayLike | None = None,  # noqa: A002 - its name in LAMMPS
        image: ArrayLike | None = None,
        k_e: ArrayLike | None = None,
        sides: int | None = None,
        law: str | float | None = None,
        **parameters: ArrayLike,
    ) -> Self:
        """Make a packing from plain arrays, of a simulation or an experiment.

        Parameters
        ----------
        shape : str
            ``"spherocylinder"``, ``"superellipsoid"``, ``"dimer"``, ``"clump"`` or ``"spheropolygon"``.
        position : (N, D) array_like, [length]
        orientation : (N,) or (N, 4) array_like, optional
            Angle of the body's x axis in radians in 2D, unit quaternion w i j k in 3D. Only round particles need none.
        box : (D,) or (D, D) array_like, [length], or Box
            Edges, or the upper triangular matrix whose columns are the cell vectors.
        lo : (D,) array_like, [length], optional
            Lower corner of the box; zeros by default.
        size : float or (N,) array_like, [length], optional
            The unit of the shape's constructor: 2R of rods and dimers, the shortest semi-axis a of superellipsoids; 1
            by default.
        diameters : (N, 3) array_like, [length], optional
            As in LAMMPS, in place of size and parameters, but for an exponent p: (2(A+R), 2R, 2R) or (2a, 2b, 2c).
        species : (N,) array_like, optional
            LAMMPS types, from 1; ones by default.
        id : (N,) array_like, optional
            LAMMPS IDs; 1 to N by default.
        image : (N, D) array_like, optional
            Periodic image counts; zeros by default.
        k_e : float or (T, T) array_like, [energy], optional
            Stiffness of the contacts; 1 by default. A symmetric table has one for each pair of species, as ``pair_coeff I J``.
        sides : {1, 2}, optional
            Bonds of a side-to-side contact; 2 by default.
        law : str or float, optional
            ``"harmonic"`` (default), ``"hertz"``, or the power of the overlap in the energy of a contact, at least 2.
        **parameters : float or (N,) array_like
            All parameters of the shape, as its constructor has them: ``alpha`` of rods and dimers; ``p``, ``w1``,
            ``w2`` of superellipsoids, whose axes x, y, z are a, b, c with a/b = w1 <= 1 and c/b = w2 >= 1.

        Raises
        ------
        ValueError
            If a parameter or the orientation is missing, a parameter is unknown or out of its range, arrays have other
            shapes, or numbers are not finite.

        Examples
        --------
        Rods with a spine of 2 and a width of 0.5, and dimers of discs that just touch:

        >>> import jamshape as js
        >>> rods = js.Packing.of(
        ...     "spherocylinder", [[2, 5], [2, 5.4]], [0, 0.1], box=[10, 10], alpha=4, size=0.5
        ... )
        >>> rods
        <Packing of 2 spherocylinders in 2D: phi = 0.02...>
        >>> rods.contacts().pairs.tolist()
        [[0, 1]]
        >>> js.Packing.of("dimer", [[2, 5], [6, 5]], [0, 1.5], box=[10, 8], alpha=1).phi
        0.03926...

        Superellipsoids, in the plane with their axes a and b in it, in a tilted box, and ellipsoids in space:

        >>> superellipses = js.Packing.of(
        ...     "superellipsoid", [[2, 5], [6, 5]], [0, 0.7],
        ...     box=[[10, 3], [0, 8]], p=1.5, w1=[0.5, 0.6], w2=1, size=0.5,
        ... )
        >>> superellipses.diameters[0].tolist()
        [1.0, 2.0, 2.0]
        >>> ellipsoids = js.Packing.of(
        ...     "superellipsoid", [[2, 5, 1], [6, 5, 1]], [[1, 0, 0, 0]] * 2,
        ...     box=[10, 8, 8], diameters=[[1, 2, 3]] * 2,
        ... )
        >>> ellipsoids.S_2
        1.0
        """
        cell = box_of(box, lo)
        n = len(np.atleast_1d(real_numbers("position", position)))
        bodies = Bodies.of(shape_named(shape), n, size, diameters, parameters)
        packing = cls(
            position=position,  # type: ignore[arg-type]
            orientation=unturned(n, cell.dimension) if orientation is None else orientation,  # type: ignore[arg-type]
            diameters=bodies.diameters,  # type: ignore[arg-type]
            form=bodies.form,
            species=np.ones(n, np.int64) if species is None else species,  # type: ignore[arg-type]
            id=np.arange(1, n + 1) if id is None else id,  # type: ignore[arg-type]
            box=cell,
            image=np.empty(0) if image is None else image,  # type: ignore[arg-type]
            shape_style=shape,
            law=Interaction().but(k_e, sides, law),
        )
        if orientation is None and not packing.is_round.all():
            what = f"({n},) angles" if cell.dimension == 2 else f"({n}, 4) quaternions"
            msg = f"orientation is missing, expected {what} of particles that are not round"
            raise ValueError(msg)
        return packing

    @classmethod
    def read(cls, path: Path, frame: int = -1) -> Packing:
        """Read one frame of an H5MD file; errors as `jamshape.files.h5md.read_packing`."""
        packing = read_packing(path, frame)
        return public(packing, results_of(path, packing), path)

    @cached_property
    def _contacts(self) -> Contacts:
        return Contacts.of(self)

    def contacts(self) -> Contacts:
        """Find the contacts.

        Returns
        -------
        Contacts
            With ``pairs``, ``force``, ``z``, ``rattlers`` and all points of contact in ``network``.

        Raises
        ------
        CrossingError
            If the cores (spines or centres) of two particles cross.
        """
        return self._contacts

    @property
    def reached(self) -> bool:
        """Whether forces balance to the tolerance; True where the file does not say."""
        return "outcome" not in self.results or is_reached(self.results)

    @property
    def z(self) -> float:
        """Bonds per particle, rattlers excluded (Marschall & Teitel 2018, Sec. III C)."""
        return self._contacts.z

    @property
    def rattlers(self) -> BoolArray:
        """(N,) whether the particle is a rattler, not held in place by its contacts."""
        return self._contacts.rattlers

    @property
    def z_single(self) -> float:
        """Contacts per particle, rattlers excluded."""
        return self._contacts.z_single

    @property
    def z_bearing(self) -> float:
        """Bonds per particle with at least 1e-6 of the mean force, rattlers excluded."""
        return self._contacts.z_bearing

    @property
    def n_rattlers(self) -> int:
        """Number of rattlers."""
        return self._contacts.counts.n_rattlers

    @property
    def S_2(self) -> float:
        """Nematic order of the particles with a direction; NaN without any.

        Marschall & Teitel 2018, Eq. 16, in the plane; Yuan et al. 2019, Eq. 6, in space.
        """
        return nematic(self)

    @property
    def S_4(self) -> float:
        """Tetratic order in the plane (Marschall & Teitel 2018, Eq. 16); NaN in space."""
        return tetratic(self)

    @property
    def C_4(self) -> float:
        """Cubatic order in space (Yuan et al. 2019, Eq. 7), whose time grows as N^2; NaN in the plane."""
        return cubatic(self)

    @property
    def u(self) -> float:
        """Elastic energy over the box's area (volume), [energy / length^D]."""
        return float(self._contacts.energy.sum()) / self.box.volume

    @property
    def pressure(self) -> float:
        """-dU/dV under affine changes of the box, [energy / length^D]."""
        return sum_forces(self, self._contacts.network).pressure

    def modes(self, **how: Any) -> Modes:
        """Find the modes of vibration; arguments and errors as in `jamshape.modes`."""
        from jamshape.front.modes import modes  # noqa: PLC0415 - which knows packings

        return modes(self, **how)

    def plot(self, axes: Axes | None = None, **look: Any) -> Axes:
        """Draw the packing; arguments as in `jamshape.plot`."""
        from jamshape.front.pictures import plot  # noqa: PLC0415 - which knows packings

        return plot(self, axes, **look)

    @checked
    def save(self, path: str | Path) -> None:
        """Write the packing to a file; see `jamshape.save`."""
        from jamshape.front.files import save  # noqa: PLC0415 - which knows packings

        save(path, self)

    @checked
    def to_gsd(self, path: str | Path) -> None:
        """Write the packing as GSD for HOOMD-blue, OVITO and freud; needs the package gsd."""
        from jamshape.exchange.gsd import write_gsd  # noqa: PLC0415 - gsd may be missing

        write_gsd(path, self)

    def to_lammps(self, lmp: Living) -> None:
        """Set positions, orientations, images and box of the same particles, by their IDs, in a LAMMPS instance.

        Parameters
        ----------
        lmp : lammps.lammps or Session
            An instance in this process, such as the one that the packing was loaded from.

        Raises
        ------
        ValueError
            If it has other particles, or several processes.
        LammpsError
            If LAMMPS refuses the box.
        """
        from jamshape.lammps.living import write_living  # noqa: PLC0415 - LAMMPS may be missing

        write_living(self, lmp)

    def to_freud(self) -> Any:
        """Return arguments of freud's functions; see `jamshape.exchange.freud.to_freud`."""
        from jamshape.exchange.freud import to_freud  # noqa: PLC0415 - freud may be missing

        return to_freud(self)

    def to_ovito(self) -> Any:
        """Return an `ovito.data.DataCollection`; see `jamshape.exchange.ovito.to_ovito`."""
        from jamshape.exchange.ovito import to_ovito  # noqa: PLC0415 - ovito may be missing

        return to_ovito(self, self.rattlers)

    def to_mdanalysis(self) -> Any:
        """Return an `MDAnalysis.Universe`; see `jamshape.exchange.mdanalysis.to_mdanalysis`."""
        from jamshape.exchange.mdanalysis import (  # noqa: PLC0415 - MDAnalysis may be missing
            to_mdanalysis,
        )

        return to_mdanalysis(self)

    def __repr__(self) -> str:
        said = [f"phi = {self.phi:.6g}"]
        known = (("pressure", "pressure"), ("u", "u"), ("z", "z"), ("n_rattlers", "rattlers"))
        numbers = {name: self.results.get(key) for key, name in known}
        said += [f"{k} = {v:.4g}" for k, v in numbers.items() if _is_number(v)]
        if not self.reached:
            outcome = self.results["outcome"]
            unbalanced = f"{outcome}: forces do not balance"
            said.append(shortfall(self.results) if outcome in AT_REST else unbalanced)
        said += [f"in {named(self.file)}"] if self.file else []
        what = f"{self.n} {self.shape.name}s in {self.dimension}D"
        return f"<Packing of {what}: {', '.join(said)}>"

    def _repr_html_(self) -> str:
        from jamshape.front.pictures import html  # noqa: PLC0415 - only notebooks ask

        return html(self)


def public(
    packing: PackingLike, results: Mapping[str, Any] | None = None, file: PathLike | None = None
) -> Packing:
    """Return a packing of the library as one of the public class, which shares its arrays.

    Parameters
    ----------
    packing : Packing of the library, or the public one
    results, file
        New ones; by default its own.
    """
    if isinstance(packing, Packing) and results is None and file is None:
        return packing
    fields, read_only = packing.__getstate__()
    fields["results"] = packing.results if results is None else dict(results)
    fields["file"] = packing.file if file is None else Path(file).absolute()
    found = Packing.__new__(Packing)
    found.__setstate__((fields, read_only))
    return found


def results_of(path: Path, packing: PackingLike) -> dict[str, Any]:
    """Read the results stored with a packing; none, with a warning, if its particles were changed since.

    Errors are those of `read_packing`.
    """
    known = read_attributes(path)
    if "outcome" not in known or not _is_number(known.get("phi")):
        return known
    phi = float(known["phi"])
    if abs(phi - packing.phi) <= _SAME_PHI * packing.phi:
        return known
    said = (
        f"{path}: its attributes state phi = {phi:.8g} but its particles have phi = {packing.phi:.8g}; another program"
        " changed them, so the stored results are ignored"
    )
    warnings.warn(said, stacklevel=3)
    return {}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.number)
