"""Interface of a shape: one object for each, listed in `jamshape.shapes.table`.

Geometry and energies are those of `lammps_plugin/contact/`; a `Shape` names them, defines the parameters
of a particle, and draws it.
"""

from __future__ import annotations

import importlib
import math
import sys
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import real_numbers
from jamshape.checks import RANGES, Range, require_in, said

if TYPE_CHECKING:
    from jamshape.arrays import FloatArray, IntArray
    from jamshape.shapes.mesh import SurfaceMesh
    from jamshape.shapes.solid import Solid


def in_name(number: float) -> str:
    """Format a number for a file name: with six digits if these suffice, else with all.

    Examples
    --------
    >>> in_name(4.0), in_name(1e6), in_name(1.0000001)
    ('4', '1e+06', '1.0000001')
    """
    short = f"{number:g}"
    return short if float(short) == number else repr(float(number))


class Parameter(NamedTuple):
    """A number that describes a particle beside its size, such as an aspect ratio; or a text, of subclasses."""

    name: str
    default: float | str | None
    """None for one that replaces others, and is left out where it is not given."""
    meaning: str
    option: str
    """Name on command lines and in file names."""
    allowed: Range | None
    """Allowed range, in which it was tested; None for texts."""

    def read(self, value: Any) -> float | str:
        """Return a value that is allowed, or raise a ValueError."""
        if self.allowed is not None:
            require_in(self.option, value, self.allowed)
        return float(value)

    def told(self, text: str) -> float | str:
        """Read a word of a command line, or raise a ValueError."""
        return self.read(text if self.allowed is None else float(text))

    @property
    def usual(self) -> str:
        """The default, for help."""
        if self.default is None:
            return "none"
        return self.default if isinstance(self.default, str) else f"{self.default:g}"

    @property
    def symbol(self) -> str:
        """TeX symbol, without dollars."""
        texts = {
            "alpha": r"\alpha",
            "exponent": "p",
            "w1": "w_1",
            "w2": "w_2",
            "n1": "n_1",
            "n2": "n_2",
        }
        return texts.get(self.name, self.name)


MOST_NUMBERS = 1024
"""Most numbers in the form of a particle."""


class Style(NamedTuple):
    """LAMMPS commands for the interactions of a packing."""

    types: IntArray
    """(N,) LAMMPS types of the particles."""
    commands: str
    """`pair_style` and `pair_coeff`, one a line."""


Stiffness: TypeAlias = float | tuple[tuple[float, ...], ...]
"""k_e of all contacts, or a symmetric (T, T) table by the species of the two particles, [energy]."""


def stiffness_of(k_e: ArrayLike) -> Stiffness:
    """Return k_e as a float, or as a table of tuples.

    Raises
    ------
    ValueError
        If it is neither a number nor a symmetric table of positive ones.

    Examples
    --------
    >>> stiffness_of([[1, 2], [2, 4]])
    ((1.0, 2.0), (2.0, 4.0))
    """
    try:
        found = real_numbers("k_e", k_e).astype(np.float64)
    except ValueError:  # another type
        found = np.empty(0)
    if found.ndim == 0:
        return float(found)
    is_square = found.ndim == 2 and found.size > 0 and found.shape[0] == found.shape[1]
    if not (is_square and (found == found.T).all() and ((found > 0) & (found < np.inf)).all()):
        msg = (
            f"k_e is {said(k_e)}, expected a positive number, or a symmetric table of them with a row and a column for"
            " each species"
        )
        raise ValueError(msg)
    return tuple(map(tuple, found.tolist()))


def stiffness_text(k_e: Stiffness) -> str:
    """Format k_e as one word, of which `stiffness_told` makes it again.

    Examples
    --------
    >>> stiffness_text(2.0), stiffness_text(((1.0, 2.0), (2.0, 4.0)))
    ('2.0', '1.0,2.0;2.0,4.0')
    """
    if isinstance(k_e, tuple):
        return ";".join(",".join(map(repr, row)) for row in k_e)
    return repr(float(k_e))


def stiffness_told(text: str) -> Stiffness:
    """Read k_e from `stiffness_text`; raises ValueError for any other text."""
    rows = [[float(word) for word in row.split(",")] for row in text.split(";")]
    return stiffness_of(rows if "," in text or ";" in text else rows[0][0])


def pair_coefficients(k_e: Stiffness, species: IntArray) -> list[str]:
    """Return the `pair_coeff` commands of k_e, for LAMMPS types of some (n_types,) species."""
    if not isinstance(k_e, tuple):
        return [f"pair_coeff * * {k_e!r}"]
    table = [[k_e[a - 1][b - 1] for b in species.tolist()] for a in species.tolist()]
    types = range(len(table))
    return [f"pair_coeff {i + 1} {j + 1} {table[i][j]!r}" for i in types for j in types[i:]]


def _types_of_forms(species: IntArray, form: FloatArray) -> tuple[IntArray, IntArray | None]:
    """Return the species of each LAMMPS type, and the (N,) types where a species of several forms needs one for each."""
    kinds = np.arange(1, species.max() + 1)
    if form.shape[1] == 0:
        return kinds, None
    rows, of = np.unique(np.column_stack([form, species]), axis=0, return_inverse=True)
    if len(rows) == len(np.unique(species)):
        return kinds, None
    return rows[:, -1].astype(np.int64), 1 + of.reshape(-1).astype(np.int64)


HARMONIC = 2.0
"""Power of the overlap in the energy of a harmonic contact, the smallest one."""

_NAMED_POWERS = {"harmonic": HARMONIC, "hertz": 2.5}
_GENERAL = "power"


def power_of(law: str | float) -> float:
    """Return the power A of a law of contacts, of which the energy of a bond is k_e / A times the overlap to the A.

    Parameters
    ----------
    law : str or float
        ``"harmonic"`` (2), ``"hertz"`` (5/2), a number of at least 2, or that number as text, with ``power`` before it as
        in LAMMPS.

    Raises
    ------
    ValueError
        If it is none of these.

    Examples
    --------
    >>> power_of("hertz"), power_of(3), power_of("power 3")
    (2.5, 3.0, 3.0)
    """
    if isinstance(law, str) and law in _NAMED_POWERS:
        return _NAMED_POWERS[law]
    try:
        power = float(law.removeprefix(_GENERAL) if isinstance(law, str) else law)
    except (TypeError, ValueError):
        power = float("nan")
    if not HARMONIC <= power < float("inf"):
        msg = (
            f"law is {said(law)}, expected harmonic, hertz or a power of the overlap of at least 2"
        )
        raise ValueError(msg)
    return power


def law_text(power: float) -> str:
    """Return the words of a law in LAMMPS's commands and in files, of which `power_of` makes the power again.

    Examples
    --------
    >>> law_text(2.5), law_text(3.0)
    ('hertz', 'power 3.0')
    """
    names = {of_name: name for name, of_name in _NAMED_POWERS.items()}
    return names.get(power, f"{_GENERAL} {power!r}")


class Interaction(NamedTuple):
    """Constants of the contacts: beside the particles, all that energy and forces of a packing depend on.

    Parameters
    ----------
    k_e : float or (T, T) array_like, [energy]
        Stiffness of a contact: one number, or a symmetric table by the species of the two particles, from 1 to T, as
        LAMMPS has it by type in ``pair_coeff I J k_e``. A packing keeps a table as a tuple of tuples.
    sides : {1, 2}
        Bonds of a side-to-side contact, for shapes that have both laws.
    power : float or str
        Power A of the overlap x in the energy of a bond, (k_e / A) x^A: 2 for harmonic contacts, 5/2 for those of Hertz, or
        another number of at least 2; or the name of a law, as `power_of` reads it.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Packing(
    ...     position=[[2, 5], [2.9, 5]], orientation=[0, 0], diameters=[[1, 1, 1]] * 2,
    ...     species=[1, 1], id=[1, 2], box=js.Box(lo=[0, 0], edges=[10, 10]),
    ... )
    >>> stiff = discs.with_(law=js.Interaction(k_e=2.0))
    >>> round(float(stiff.u / discs.u), 12)
    2.0

    Hertz's law, for an overlap x = 0.1:

    >>> hertz = discs.with_(law=js.Interaction(power="hertz"))
    >>> hertz.law.power, round(float(hertz.u / discs.u) / (2 / 2.5 * 0.1**0.5), 12)
    (2.5, 1.0)

    Contacts of two species, and between them:

    >>> mixed = discs.with_(species=[1, 2], law=js.Interaction(k_e=[[1, 3], [3, 2]]))
    >>> round(float(mixed.u / discs.u), 12)
    3.0
    """

    k_e: Stiffness = 1.0
    """[energy]"""
    sides: int = 2
    """Bonds of a side-to-side contact, 1 or 2, for shapes that have both laws."""
    power: float = HARMONIC
    """Power of the overlap in the energy of a bond."""

    @classmethod
    def told(cls, known: Mapping[str, Any]) -> Interaction:
        """Read the constants from a mapping by name; defaults where missing."""
        usual = cls()
        k_e, sides, power = (known.get(name, getattr(usual, name)) for name in cls._fields)
        return cls(stiffness_of(k_e), int(sides), power_of(power))

    def but(
        self,
        k_e: ArrayLike | None = None,
        sides: int | None = None,
        power: str | float | None = None,
    ) -> Interaction:
        """Replace the constants that are not None."""
        stiffness = self.k_e if k_e is None else stiffness_of(k_e)
        of_bond = self.power if power is None else power_of(power)
        return Interaction(stiffness, self.sides if sides is None else sides, of_bond)

    def root(self, energy: float) -> float:
        """Return the root of an energy that is linear in the overlaps, and so in phi - phi_J."""
        root: float = energy ** (1 / self.power)
        return math.sqrt(energy) if self.power == HARMONIC else root

    def over_harmonic(self, energy: float) -> float:
        """Return the energy of a contact over that of a harmonic one of the same overlap, which is given in units of k_e.

        Examples
        --------
        An overlap of 0.01, with the energies x^2 and (2 / 2.5) x^2.5 of two contacts:

        >>> round(1e-4 * Interaction(power=2.5).over_harmonic(1e-4) / 1e-5, 12)
        0.8
        """
        ratio: float = energy ** (self.power / 2 - 1)
        return 2 / self.power * ratio

    def overlap_of(self, energy: float) -> float:
        """Return the overlap of contacts of which two have this energy, in units of k_e."""
        return math.sqrt((self.power / 2 * energy) ** (2 / self.power))

    def range_of(self, name: str) -> Range:
        """Return the allowed targets ``u0`` or ``pressure``: those of harmonic contacts, of the same overlaps."""
        ends = (RANGES[name].low, RANGES[name].high)
        if name == "pressure":
            low, high = (end ** (self.power - 1) for end in ends)
        else:
            low, high = (end * self.over_harmonic(end) for end in ends)
        return RANGES[name]._replace(low=low, high=high)

    def overlap_over_harmonic(self, slope: float) -> float:
        """Return the overlap of a contact over that of a harmonic one of the same slope of the energy, in units of k_e."""
        ratio: float = max(slope, sys.float_info.min) ** (1 / (self.power - 1) - 1)
        return ratio

    def stated(self) -> dict[str, Any]:
        """Return the constants by name, as files state them: the power only where it is not that of harmonic contacts."""
        found = self._asdict()
        return found if self.power != HARMONIC else {k: found[k] for k in found if k != "power"}


class Shape(ABC):
    """A shape of particles."""

    name: ClassVar[str]
    """Name in files and on command lines."""
    parameters: ClassVar[tuple[Parameter, ...]]
    unit: ClassVar[str]
    """Length that equals 1 for a particle of size 1."""
    examples: ClassVar[tuple[Mapping[str, Any], ...]]
    """Parameters for tests, most typical first; together they take all code paths of its contacts."""
    dimensions: ClassVar[tuple[int, ...]] = (2, 3)
    """Dimensions that it exists in."""
    dimension: ClassVar[int] = 2
    """Default dimension of packings."""
    size_ratio: ClassVar[float] = 1.0
    """Default size ratio; 1 for equal particles."""
    families: ClassVar[tuple[str, ...]] = ()
    """Families of particles in the plane, but for round ones."""
    has_form: ClassVar[bool] = False
    """Whether a particle is given by more than diameters and an exponent."""
    has_exponent: ClassVar[bool] = False
    """Whether the form of a particle is an exponent."""
    stored: ClassVar[tuple[str, ...]] = ("form",)
    """Fields of a packing that files hold of each particle beside its diameters."""

    def __eq__(self, other: object) -> bool:
        """Return whether it is the same shape; true for copies and pickles."""
        return type(self) is type(other) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash(type(self))

    @property
    def needed(self) -> tuple[Parameter, ...]:
        """Parameters without those that replace others where they are given."""
        return tuple(p for p in self.parameters if p.default is not None)

    @property
    def compiled_name(self) -> str:
        """Name of its class in `jamshape._contact`, and of the function that makes particles."""
        return f"{self.name.capitalize()}s"

    def compiled(
        self,
        particles: tuple[FloatArray, FloatArray],
        dimension: int,
        law: Interaction,
        species: IntArray | None = None,
    ) -> Any:
        """Make the object of `jamshape._contact` that evaluates contacts of some particles.

        Parameters
        ----------
        particles : (N, 3) and (N, K) arrays of float64
            Diameters, [length], and further numbers of each (`Packing.form`).
        dimension : {2, 3}
        law : Interaction
        species : (N,) array of int64, optional
            From 1; needed if the law has a table of k_e.

        Raises
        ------
        ValueError
            If a particle does not have this shape, or the table has no row of its species.
        """
        # Imported here so that files can be read and written without the compiled module.
        contact = importlib.import_module("jamshape._contact")
        make = getattr(contact, self.compiled_name)
        if np.ndim(law.k_e):
            table = np.array(law.k_e, np.float64)
            return make(*particles, dimension, table, species, law.sides, law.power)
        return make(*particles, dimension, law.k_e, law.sides, law.power)

    def form_of_exponents(self, exponent: FloatArray) -> FloatArray:
        """Return the (N, K) form of (N,) exponents, all 1 for shapes without; the usual form, if there is one.

        Raises
        ------
        ValueError
            If another shape is given exponents.
        """
        if (exponent != 1).any():
            msg = f"a {self.name} has no exponent, expected none; leave it out"
            raise ValueError(msg)
        return np.empty((len(exponent), 0))

    def stored_of(self, form: FloatArray) -> tuple[str, ...]:
        """Return the fields of a packing with the (N, K) form that files hold of each particle beside its diameters."""
        is_exponent = self.has_exponent and form.shape[1] == 1
        return self.stored if is_exponent or not self.has_exponent else ("form",)

    def check_form(self, form: FloatArray, dimension: int) -> None:
        """Raise a ValueError unless the (N, K) form, beside diameters, is one of this shape."""
        del dimension
        if form.shape[1]:
            msg = f"form has {form.shape[1]} columns, expected none for a {self.name}; leave it out"
            raise ValueError(msg)

    @staticmethod
    def widened(form: FloatArray, columns: int) -> FloatArray:
        """Return (n, K) forms with zeros appended, which do not count, for forms of different lengths in one array."""
        return np.pad(form, ((0, 0), (0, max(0, columns - form.shape[1]))))

    @abstractmethod
    def fits(self, diameters: FloatArray) -> bool:
        """Whether (N, 3) diameters fit this shape."""

    def placed(self, diameters: FloatArray, dimension: int) -> tuple[FloatArray, IntArray]:
        """Reorder the axes of bodies to this shape's convention; other programs order them otherwise.

        Parameters
        ----------
        diameters : (N, 3) array of float64, [length]
        dimension : {2, 3}

        Returns
        -------
        (N, 3) array of float64, (N,) array of int64
            Diameters of the same bodies, and which of the given axes is now the first, after a
            rotation about one axis.
        """
        del dimension
        return diameters, np.zeros(len(diameters), np.int64)

    @abstractmethod
    def rule(self) -> str:
        """Describe its diameters, for messages."""

    @abstractmethod
    def sizes(
        self, parameters: Mapping[str, Any], size: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Convert parameters, numbers or (n,), and (n,) sizes to (n, 3) diameters and (n, K) forms.

        Raises
        ------
        ValueError
            If a parameter is out of its range.
        """

    def told(self, known: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters of a particle among known values; none unless they are complete."""
        own = {p.name: known[p.name] for p in self.parameters if p.name in known}
        complete = self.reduced({p.name: p.default for p in self.needed} | own)
        return own if own.keys() == complete.keys() else {}

    def reduced(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return parameters without those that others replace.

        Raises
        ------
        ValueError
            If they exclude each other.
        """
        return dict(parameters)

    @abstractmethod
    def parameters_of(
        self, diameters: FloatArray, form: FloatArray
    ) -> tuple[dict[str, Any], float]:
        """Return parameters and size of a particle from (3,) diameters and its (K,) form: the inverse of `sizes`."""

    def style(self, packing: Any, law: Interaction) -> Style:
        """Return the LAMMPS commands for a packing of this shape; forms are per type there."""
        types, form = packing.species, packing.form
        kinds, rows = _types_of_forms(types, form)
        if rows is not None:
            types = rows
        settings = "" if law.power == HARMONIC else f" law {law_text(law.power)}"
        lines = [f"pair_style {self.style_name(law)}{settings}", *pair_coefficients(law.k_e, kinds)]
        for k in np.unique(types) if form.shape[1] else ():
            row = kinds[k - 1] - 1
            own = law.k_e[row][row] if isinstance(law.k_e, tuple) else law.k_e
            numbers = " ".join(map(repr, form[types == k][0].tolist()))
            lines.append(f"pair_coeff {k} {k} {own!r} {numbers}")
        return Style(types, "\n".join(lines))

    def style_name(self, law: Interaction) -> str:
        """Return the name of the pair style, with the settings that other shapes do not have."""
        del law
        return f"{self.name}/harmonic"

    def described(
        self, diameters: FloatArray, form: FloatArray, dimension: int
    ) -> dict[str, float]:
        """Return descriptors of the first of (N, 3) diameters and (N, K) forms.

        The aspect ratio of the box around it; the roundness, its area (volume) over that of the circle (sphere) around
        it about its centre; and in the plane the asphericity, perimeter^2 / (4 pi area) (VanderWerf et al. 2018). All are
        1 for discs and spheres.
        """
        body = self.compiled((diameters[:1], form[:1]), dimension, Interaction())
        measure, reach = float(body.measure[0]), float(body.outer_radius[0])
        box, around = (
            diameters[0, :dimension],
            np.pi * (reach**2 if dimension == 2 else 4 / 3 * reach**3),
        )
        found = {"aspect_ratio": float(box.max() / box.min()), "roundness": measure / around}
        if dimension == 2:
            found["asphericity"] = self.perimeter(diameters[0], form[0]) ** 2 / (
                4 * np.pi * measure
            )
        return found

    @abstractmethod
    def perimeter(self, diameters: FloatArray, form: FloatArray) -> float:
        """Length of the boundary of a particle in the plane, from (3,) diameters and its (K,) form, [length]."""

    @abstractmethod
    def outline(self, diameters: FloatArray, form: FloatArray, points: int = 64) -> FloatArray:
        """(K, 2) vertices of a polygon around a particle in the plane, in body coordinates."""

    @abstractmethod
    def surface(self, diameters: FloatArray, form: FloatArray, level: int = 3) -> SurfaceMesh:
        """Cover a particle in space with triangles, in body coordinates."""

    @abstractmethod
    def solid(self, diameters: FloatArray, form: FloatArray) -> Solid:
        """Describe a particle for programs that do not know the shape."""

    def spine(self, diameters: FloatArray) -> float:
        """Half length of the line along the body's x that shows its direction; 0 for none."""
        del diameters
        return 0.0

    def family(self, parameters: Mapping[str, Any], dimension: int) -> str:
        """Name the family of shapes that particles of these parameters belong to, for a legend."""
        del parameters, dimension
        return f"{self.name}s"

    def label(self, parameters: Mapping[str, Any]) -> str:
        """Format parameters in TeX, for a legend."""
        known = (p for p in self.parameters if p.name in parameters)
        told = [f"{p.symbol}={parameters[p.name]:g}" for p in known]
        return f"${', '.join(told)}$"

    def stem(self, parameters: Mapping[str, Any]) -> str:
        """Return the stem of file names for packings of such particles."""
        numbers = [p.option + in_name(parameters[p.name]) for p in self.parameters]
        return "_".join([self.name, *numbers])


class FormedShape(Shape):
    """A shape of particles that are given by points, such as discs or corners, and a factor of their size."""

    unit = "s"
    size_ratio = 1.4
    has_form = True
    form_rule: ClassVar[str]
    """Describes the numbers of its form."""

    def form_of_exponents(self, exponent: FloatArray) -> FloatArray:
        """See `Shape.form_of_exponents`: there is no usual form."""
        msg = f"form of {len(exponent)} {self.name}s is missing, expected {self.form_rule} of each"
        raise ValueError(msg)

    def fits(self, diameters: FloatArray) -> bool:
        """See `Shape.fits`; proportions depend on the form, and are checked with it."""
        return bool((diameters > 0).all())

    def rule(self) -> str:
        """See `Shape.rule`."""
        return "those of the box around it"


ROUND = {2: "discs", 3: "spheres"}
"""Families of round particles by dimension."""

# Diameters that differ by less are equal up to rounding.
_ROUNDING = 1e-12


class ElongatedShape(Shape):
    """A shape of half length A along the body's x and radius R: diameters (2(A+R), 2R, 2R)."""

    parameters = (
        Parameter(
            "alpha", 4.0, "aspect ratio A/R, 0 for discs", "alpha",
            Range(1e-6, 100.0, "A / R", also=(0.0,)),
        ),
    )  # fmt: skip
    unit = "2R"
    size_ratio = 1.4
    stored = ("half_length", "radius")

    def fits(self, diameters: FloatArray) -> bool:
        """See `Shape.fits`."""
        long, short, other = diameters.T
        return bool(((short == other) & (long >= short)).all())

    def placed(self, diameters: FloatArray, dimension: int) -> tuple[FloatArray, IntArray]:
        """See `Shape.placed`: the long axis comes first; diameters within rounding count as equal."""
        low, middle, high = np.sort(diameters).T
        is_round = high - low <= _ROUNDING * high
        first = np.where(is_round, 0, diameters.argmax(axis=1))
        is_body = (middle - low <= _ROUNDING * high) | is_round
        # In the plane bodies rotate about z only.
        is_body &= (first < 2) | (dimension == 3)
        fits = (diameters[:, 1] == diameters[:, 2]) & (diameters[:, 0] >= diameters[:, 1])
        is_other = is_body & (~fits | (is_round & (high > low)))
        short = np.where(is_round, high, middle)
        as_named = np.column_stack([high, short, short])
        found = np.where(is_other[:, None], as_named, diameters)
        return found, np.where(is_other, first, 0)

    def rule(self) -> str:
        """See `Shape.rule`."""
        return "(2(A+R), 2R, 2R) with A >= 0"

    def sizes(
        self, parameters: Mapping[str, Any], size: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """See `Shape.sizes`."""
        radius = 0.5 * size
        half_length = parameters["alpha"] * radius
        long = 2 * (half_length + radius)
        return np.column_stack([long, 2 * radius, 2 * radius]), np.empty((len(size), 0))

    def parameters_of(
        self, diameters: FloatArray, form: FloatArray
    ) -> tuple[dict[str, Any], float]:
        """See `Shape.parameters_of`."""
        del form
        width = float(diameters[1])
        return {"alpha": float(diameters[0] - width) / width}, width

    def spine(self, diameters: FloatArray) -> float:
        """See `Shape.spine`."""
        return float(diameters[0] - diameters[1]) / 2
