"""The state of a packing, an immutable record."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import InitVar, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from jamshape.arguments import checked_fields
from jamshape.arrays import BoolArray, FloatArray, IntArray, LongArray, real_numbers
from jamshape.packing.box import Box, Lengths, number_of_tilts
from jamshape.packing.columns import as_columns, kept
from jamshape.packing.given import as_floats, as_integers
from jamshape.packing.rotation import UNIT_QUATERNION_TOLERANCE, across, body_axes
from jamshape.records import Record
from jamshape.shapes.shape import Interaction, Shape, power_of, stiffness_of
from jamshape.shapes.table import DEFAULT, shape_named

# Fields reset when one of these is replaced.
_REST_OF = {
    "position": ("position_rest",),
    "orientation": ("orientation_rest",),
    "box": ("edges_rest", "tilt_rest"),
}


@checked_fields
@dataclass(frozen=True, eq=False, kw_only=True)
class Packing(Record):
    """Particles in a periodic box: the record behind `jamshape.Packing`, whose docstring has the fields and errors.

    Examples
    --------
    >>> from jamshape.packing import Box, Packing
    >>> rod = Packing(
    ...     position=[[2, 5]], orientation=[0], diameters=[[5, 1, 1]], species=[1], id=[1],
    ...     box=Box(lo=[0, 0], edges=[10, 10]),
    ... )
    >>> rod.n, rod.dimension
    (1, 2)
    """

    position: FloatArray
    orientation: FloatArray
    diameters: FloatArray
    species: IntArray
    id: IntArray
    box: Box
    image: IntArray = field(default_factory=lambda: np.empty((0, 0), dtype=np.int64))
    shape_style: str = DEFAULT
    form: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    law: Interaction = field(default_factory=Interaction)
    step: int = 0
    time: float = 0.0
    position_rest: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    orientation_rest: FloatArray = field(default_factory=lambda: np.empty(0))
    edges_rest: FloatArray = field(default_factory=lambda: np.empty(0))
    tilt_rest: FloatArray = field(default_factory=lambda: np.empty(0))
    results: Mapping[str, Any] = field(default_factory=dict)
    file: Path | None = None
    columns: Mapping[str, Any] = field(default_factory=dict)
    if TYPE_CHECKING:

        @property
        def exponent(self) -> FloatArray:
            """(N,) exponents p of superellipsoids; ones for other shapes."""

    else:
        exponent: InitVar[FloatArray | None] = None

    def __post_init__(self, exponent: FloatArray | None) -> None:  # type: ignore[override]
        n = len(np.atleast_1d(real_numbers("position", self.position)))
        dimension = self.box.dimension
        if n == 0:
            msg = "packing has no particles, expected at least one"
            raise ValueError(msg)
        if real_numbers("image", self.image).size == 0:
            object.__setattr__(self, "image", np.zeros((n, dimension), dtype=np.int64))
        object.__setattr__(self, "form", _form_of(self, exponent, n))
        vector = (n, dimension)
        rotation = (n,) if dimension == 2 else (n, 4)
        rests = {"position_rest": vector, "orientation_rest": rotation, "edges_rest": (dimension,)}
        rests["tilt_rest"] = (number_of_tilts(dimension),)
        for name, shape in rests.items():
            if real_numbers(name, getattr(self, name)).size == 0:
                object.__setattr__(self, name, np.zeros(shape))
        floats = {"position": vector, "orientation": rotation, "diameters": (n, 3), **rests}
        for name, shape in floats.items():
            object.__setattr__(self, name, as_floats(name, getattr(self, name), shape))
        for name, shape in (("species", (n,)), ("id", (n,)), ("image", vector)):
            object.__setattr__(self, name, as_integers(name, getattr(self, name), shape))
        _check_labels(self)
        _check_shapes(self)
        object.__setattr__(self, "law", _checked_law(self.law, self.species))
        object.__setattr__(self, "columns", as_columns(self.columns, n))
        if self.file is not None:  # so that it stays valid when the working folder changes
            object.__setattr__(self, "file", self.file.absolute())

    @property
    def n(self) -> int:
        """Number of particles N."""
        return len(self.position)

    @property
    def dimension(self) -> int:
        """Number of dimensions, 2 or 3."""
        return self.box.dimension

    @property
    def shape(self) -> Shape:
        """Definition of the shape."""
        return shape_named(self.shape_style)

    def compiled(self, law: Interaction | None = None) -> Any:
        """Make the compiled object that evaluates contacts of these particles; under their own law by default."""
        sizes = (self.diameters, self.form)
        return self.shape.compiled(sizes, self.dimension, law or self.law, self.species)

    @cached_property
    def _bodies(self) -> Any:
        """The particles, whatever their interaction."""
        return self.compiled(Interaction())

    @property
    def half_length(self) -> FloatArray:
        """(N,) half lengths A of elongated particles, [length]."""
        return (self.diameters[:, 0] - self.diameters[:, 1]) / 2

    @property
    def radius(self) -> FloatArray:
        """(N,) radii R of elongated particles, [length]."""
        return self.diameters[:, 1] / 2

    @property
    def aspect_ratio(self) -> FloatArray:
        """(N,) ratios alpha = A / R of elongated particles."""
        return self.half_length / self.radius

    @property
    def quaternions(self) -> FloatArray:
        """(N, 4) quaternions w i j k, in 2D rotations about z."""
        if self.dimension == 3:
            return self.orientation
        half, zero = self.orientation / 2, np.zeros(self.n)
        return np.column_stack([np.cos(half), zero, zero, np.sin(half)])

    @property
    def axes(self) -> FloatArray:
        """(N, D) unit vectors along the body's x axis."""
        if self.dimension == 2:
            return np.column_stack([np.cos(self.orientation), np.sin(self.orientation)])
        return self.body_axes(0)

    def body_axes(self, k: int) -> FloatArray:
        """(N, D) unit vectors along the body's axis k."""
        if self.dimension == 2:
            cosine, sine = np.cos(self.orientation), np.sin(self.orientation)
            return np.column_stack([cosine, sine] if k == 0 else [-sine, cosine])
        return body_axes(self.orientation)[:, k]

    @property
    def symmetry_axis(self) -> IntArray:
        """(N,) body axis about which a particle may spin freely (0, 1, 2); -1 where there is none."""
        return np.asarray(self._bodies.symmetry_axis)

    @property
    def is_round(self) -> BoolArray:
        """(N,) whether the particle is a disc or a sphere, on which contacts exert no torque."""
        return np.asarray(self._bodies.rotation_length == 0)

    @property
    def outer_radius(self) -> FloatArray:
        """(N,) radii of the circumscribed spheres, [length]."""
        return np.asarray(self._bodies.outer_radius)

    @property
    def inner_radius(self) -> FloatArray:
        """(N,) radii of the inscribed spheres, [length] (R of rods, the shortest semi-axis)."""
        return np.asarray(self._bodies.inner_radius)

    @property
    def measures(self) -> FloatArray:
        """(N,) areas (volumes) of the particles, [length^D]."""
        return np.asarray(self._bodies.measure)

    @property
    def freedoms(self) -> IntArray:
        """(N,) degrees of freedom that contacts can resist, without free spins."""
        if self.dimension == 2:
            return np.where(self.is_round, 2, 3)
        return np.where(self.is_round, 3, np.where(self.symmetry_axis >= 0, 5, 6))

    @property
    def z_iso(self) -> float:
        """Isostatic contact number, twice the mean number of `freedoms`."""
        return 2 * float(self.freedoms.mean())

    @property
    def turning_axes(self) -> FloatArray:
        """(N, T, T) orthogonal unit vectors about which contacts can rotate particles, else zeros.

        T is 1 in the plane, 3 in space, where a body with an axis of symmetry spins about it freely.
        """
        if self.dimension == 2:
            return np.ones((self.n, 1, 1))
        axes = np.tile(np.eye(3), (self.n, 1, 1))
        for k in range(3):
            own = self.symmetry_axis == k
            axes[own, :2] = across(self.body_axes(k)[own])
            axes[own, 2] = 0.0
        return axes

    @property
    def directors(self) -> FloatArray:
        """(N, D) unit vectors along the axis that defines each particle's direction; NaN without one."""
        which = np.asarray(self._bodies.director)
        found = np.full((self.n, self.dimension), np.nan)
        for k in range(self.dimension):
            found[which == k] = self.body_axes(k)[which == k]
        return found

    @property
    def phi(self) -> float:
        """Packing fraction, the sum of areas (volumes) over that of the box."""
        return float(np.sum(self.measures)) / self.box.volume

    @property
    def has_rests(self) -> bool:
        """Whether coordinates are known beyond double precision."""
        return any(getattr(self, rest).any() for rests in _REST_OF.values() for rest in rests)

    def poses(self) -> tuple[LongArray, LongArray, LongArray]:
        """Position, orientation and box in full precision, as longdouble.

        The columns of the box matrix (D, D) are its cell vectors.
        """
        pairs = (
            (self.position, self.position_rest),
            (self.orientation, self.orientation_rest),
            (self.box.matrix, Lengths(self.edges_rest, self.tilt_rest).matrix),
        )
        position, orientation, cell = (np.longdouble(x) + rest for x, rest in pairs)
        return position, orientation, cell

    def with_poses(self, position: LongArray, orientation: LongArray, cell: LongArray) -> Self:
        """Return the packing with new `poses`, each number stored as a double and its low part."""
        doubles = [np.asarray(x, np.float64) for x in (position, orientation, cell)]
        rests = [
            np.asarray(x - double, np.float64)
            for x, double in zip((position, orientation, cell), doubles, strict=True)
        ]
        edges_rest, tilt_rest = Lengths.of(rests[2])
        return self.with_(
            position=doubles[0],
            orientation=doubles[1],
            box=Box.of(self.box.lo, doubles[2]),
            position_rest=rests[0],
            orientation_rest=rests[1],
            edges_rest=edges_rest,
            tilt_rest=tilt_rest,
        )

    def sorted_by_id(self) -> Self:
        """Return the same packing with its particles in the order of their IDs."""
        order = np.argsort(self.id)
        names = ["position", "orientation", "diameters", "form", "species", "id", "image"]
        names += ["position_rest", "orientation_rest"]
        columns = {name: column[order] for name, column in self.columns.items()}
        return self.with_(**{name: getattr(self, name)[order] for name in names}, columns=columns)

    def with_(self, **changes: Any) -> Self:
        """Return a packing with the named fields replaced, and without results and file; new poses are exact doubles.

        Other columns are kept, but with new poses, sizes or box only labels such as ``mol``.
        """
        changes.setdefault("columns", kept(self.columns, changes))
        if changes.get("shape_style", self.shape_style) != self.shape_style:
            changes.setdefault("form", np.empty((0, 0)))
        for name, rests in _REST_OF.items():
            for rest in rests if name in changes else ():
                changes.setdefault(rest, np.empty(0))
        unset: dict[str, Any] = {"results": {}, "file": None, "exponent": None}
        return dataclasses.replace(self, **(unset | changes))

    @property
    def to_store(self) -> dict[str, Any]:
        """Return the results without attributes of a run; a single frame cannot be continued as a run."""
        return {k: v for k, v in self.results.items() if k not in {"kind", "finished"}}


def _exponent(packing: Packing) -> FloatArray:
    """(N,) exponents p of superellipsoids; ones for other shapes."""
    if packing.shape.has_exponent and packing.form.shape[1] > 1:
        if packing.dimension == 2:
            return packing.form[:, 1] / 2
        msg = "a packing of bodies with two exponents has no p, expected one exponent each; use form, n1 and n2"
        raise ValueError(msg)
    return packing.form[:, 0] if packing.shape.has_exponent else np.ones(packing.n)


# Set behind the class, whose constructor takes an argument of this name.
setattr(Packing, "exponent", property(_exponent))  # noqa: B010


def _form_of(packing: Packing, exponent: FloatArray | None, n: int) -> FloatArray:
    """Return the form (N, K), of exponents (N,) if they are given, or raise a ValueError."""
    shape = shape_named(packing.shape_style)
    if exponent is not None and real_numbers("exponent", exponent).size:
        return shape.form_of_exponents(as_floats("exponent", exponent, (n,)))
    given = real_numbers("form", packing.form)
    if given.size == 0:
        return shape.form_of_exponents(np.ones(n))
    columns = given.shape[1] if given.ndim == 2 else 1
    return as_floats("form", packing.form, (n, columns))


def _check_labels(packing: Packing) -> None:
    if len(np.unique(packing.id)) != packing.n:
        msg = "an id occurs more than once, expected one for each particle"
        raise ValueError(msg)
    for name in ("species", "id"):
        if getattr(packing, name).min() < 1:
            msg = f"{name} holds {getattr(packing, name).min()}, expected numbers from 1"
            raise ValueError(msg)
    shape_named(packing.shape_style)
    if not np.isfinite(packing.time):
        msg = f"time is {packing.time}, expected a finite number"
        raise ValueError(msg)


def _checked_law(law: Interaction, species: IntArray) -> Interaction:
    """Return the constants of the contacts of particles of some species, or raise a ValueError."""
    try:
        k_e, sides, power = stiffness_of(law[0]), int(law[1]), power_of(law[2])
        is_law = (
            (isinstance(k_e, tuple) or 0 < k_e < np.inf)
            and sides in {1, 2}
            and sides == law[1]
            and len(law) == len(Interaction._fields)
        )
    except (TypeError, ValueError, LookupError):
        is_law = False
    if not is_law:
        msg = (
            f"law is {law!r}, expected Interaction(k_e, sides, power) with a positive k_e, or a symmetric table of them"
            " by species, sides 1 or 2, and a power of at least 2"
        )
        raise ValueError(msg)
    if isinstance(k_e, tuple) and len(k_e) < species.max():
        msg = (
            f"k_e of the law has {len(k_e)} rows and columns, expected one for each species up to {species.max()}, the"
            " largest of the packing"
        )
        raise ValueError(msg)
    return Interaction(k_e, sides, power)


def _check_shapes(packing: Packing) -> None:
    if not (packing.diameters > 0).all():
        msg = f"diameters hold {packing.diameters.min()}, expected positive lengths"
        raise ValueError(msg)
    shape = packing.shape
    shape.check_form(packing.form, packing.dimension)
    if not shape.fits(packing.diameters):
        wrong = next(d for d in packing.diameters if not shape.fits(d[None]))
        msg = f"diameters of a {shape.name} are {wrong.tolist()}, expected {shape.rule()}"
        raise ValueError(msg)
    if packing.dimension == 3:
        error = np.abs(np.linalg.norm(packing.orientation, axis=1) - 1).max()
        if error > UNIT_QUATERNION_TOLERANCE:
            msg = (
                f"the norm of a quaternion differs from 1 by {error:.2g}, expected unit quaternions"
            )
            raise ValueError(msg)
