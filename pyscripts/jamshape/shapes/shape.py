"""What the library knows of a shape: one object for each, listed in `jamshape.shapes.table`.

Geometry and energies are those of `lammps_plugin/contact/`; what stands here names them, says which numbers
describe a particle, and draws it.
"""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from jamshape.checks import Range

if TYPE_CHECKING:
    from jamshape.arrays import FloatArray, IntArray
    from jamshape.shapes.mesh import SurfaceMesh
    from jamshape.shapes.solid import Solid


def in_name(number: float) -> str:
    """Write a number in the name of a file: with six digits if these are all, else with as many as it has.

    Examples
    --------
    >>> in_name(4.0), in_name(1e6), in_name(1.0000001)
    ('4', '1e+06', '1.0000001')
    """
    short = f"{number:g}"
    return short if float(short) == number else repr(float(number))


class Parameter(NamedTuple):
    """A number that describes a particle beside its size, such as an aspect ratio."""

    name: str
    default: float
    meaning: str
    option: str
    """Its name on command lines and in names of files."""
    allowed: Range
    """What users may ask for: the range in which it was tried."""

    @property
    def symbol(self) -> str:
        """In TeX, without dollars."""
        texts = {"alpha": r"\alpha", "exponent": "p", "w1": "w_1", "w2": "w_2"}
        return texts.get(self.name, self.name)


class Style(NamedTuple):
    """How LAMMPS is told of a packing's interactions."""

    types: IntArray
    """(N,) LAMMPS types of the particles."""
    commands: str
    """`pair_style` and `pair_coeff`, one a line."""


class Interaction(NamedTuple):
    """The constants of the contacts: what energy and forces of a packing depend on beside its particles.

    Parameters
    ----------
    k_e : float, [energy]
        Stiffness of a contact.
    sides : {1, 2}
        Bonds of a side-to-side contact, of shapes that have both laws.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Packing(
    ...     position=[[2, 5], [2.9, 5]], orientation=[0, 0], diameters=[[1, 1, 1]] * 2,
    ...     species=[1, 1], id=[1, 2], box=js.Box(lo=[0, 0], edges=[10, 10]),
    ... )
    >>> stiff = discs.with_(law=js.Interaction(k_e=2.0))
    >>> round(float(js.MeasuredPacking.of(stiff).u / js.MeasuredPacking.of(discs).u), 12)
    2.0
    """

    k_e: float = 1.0
    """[energy]"""
    sides: int = 2
    """Bonds of a side-to-side contact, 1 or 2, of shapes that have both laws."""

    @classmethod
    def told(cls, known: Mapping[str, Any]) -> Interaction:
        """Take the constants that a mapping holds under their names; the usual ones where it holds none."""
        usual = cls()
        k_e, sides = (known.get(name, getattr(usual, name)) for name in cls._fields)
        return cls(float(k_e), int(sides))

    def but(self, k_e: float | None = None, sides: int | None = None) -> Interaction:
        """Replace constants; those that are None stay."""
        return Interaction(self.k_e if k_e is None else k_e, self.sides if sides is None else sides)


class Shape(ABC):
    """A shape of particles."""

    name: ClassVar[str]
    """As files and command lines have it."""
    parameters: ClassVar[tuple[Parameter, ...]]
    unit: ClassVar[str]
    """The length that is 1 for a particle of size 1."""
    examples: ClassVar[tuple[Mapping[str, float], ...]]
    """Parameters that take all paths of its contacts between them, the most typical ones first: to test with."""
    dimension: ClassVar[int] = 2
    """Of packings, when nobody says."""
    size_ratio: ClassVar[float] = 1.0
    """Of mixtures, when nobody says; 1 for equal particles."""
    has_exponent: ClassVar[bool] = False

    def __eq__(self, other: object) -> bool:
        """Tell whether it is the same shape; copies and pickles of a shape are."""
        return type(self) is type(other) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash(type(self))

    @property
    def compiled_name(self) -> str:
        """Name of its class in `jamshape._contact`, and of the function that makes particles."""
        return f"{self.name.capitalize()}s"

    def compiled(
        self, particles: tuple[FloatArray, FloatArray], dimension: int, law: Interaction
    ) -> Any:
        """Make the object of `jamshape._contact` that knows the contacts of some particles.

        Parameters
        ----------
        particles : (N, 3) and (N,) arrays of float64
            Diameters, [length], and exponents.
        dimension : {2, 3}
        law : Interaction

        Raises
        ------
        ValueError
            If one of them is no such shape.
        """
        # Imported here so that reading and writing files needs no compiled module.
        contact = importlib.import_module("jamshape._contact")
        return getattr(contact, self.compiled_name)(*particles, dimension, law.k_e, law.sides)

    @abstractmethod
    def fits(self, diameters: FloatArray) -> bool:
        """Whether (N, 3) diameters can be those of this shape."""

    def placed(self, diameters: FloatArray, dimension: int) -> tuple[FloatArray, IntArray]:
        """Name the axes of bodies as this shape names them, where other programs have another order.

        Parameters
        ----------
        diameters : (N, 3) array of float64, [length]
        dimension : {2, 3}

        Returns
        -------
        (N, 3) array of float64, (N,) array of int64
            Diameters of the same bodies, and which of the axes that were given is now the first one, after a
            rotation about one axis.
        """
        del dimension
        return diameters, np.zeros(len(diameters), np.int64)

    @abstractmethod
    def rule(self) -> str:
        """Say what its diameters are."""

    @abstractmethod
    def sizes(
        self, parameters: Mapping[str, float], size: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Turn parameters and (n,) sizes into (n, 3) diameters and (n,) exponents.

        Raises
        ------
        ValueError
            If a parameter is out of its range.
        """

    @abstractmethod
    def parameters_of(
        self, diameters: FloatArray, exponent: float
    ) -> tuple[dict[str, float], float]:
        """Tell the parameters and the size of one particle, of (3,) diameters: the inverse of `sizes`."""

    def style(self, packing: Any, law: Interaction) -> Style:
        """Tell LAMMPS of a packing of this shape."""
        command = f"pair_style {self.name}/harmonic\npair_coeff * * {law.k_e!r}"
        return Style(packing.species, command)

    def described(self, diameters: FloatArray, exponent: FloatArray) -> dict[str, float]:
        """Give numbers that describe the first of (N, 3) diameters and (N,) exponents."""
        del diameters, exponent
        return {}

    @abstractmethod
    def outline(self, diameters: FloatArray, exponent: float, points: int = 64) -> FloatArray:
        """(K, 2) corners of a polygon around a particle in the plane, in body coordinates."""

    @abstractmethod
    def surface(self, diameters: FloatArray, exponent: float, level: int = 3) -> SurfaceMesh:
        """Cover a particle in space with triangles, in body coordinates."""

    @abstractmethod
    def solid(self, diameters: FloatArray, exponent: float) -> Solid:
        """Describe a particle to programs that do not know the shape."""

    def spine(self, diameters: FloatArray) -> float:
        """Half length of the line along the body's x that tells its direction; 0 for none."""
        del diameters
        return 0.0

    def label(self, parameters: Mapping[str, float]) -> str:
        """Write parameters in TeX, for a legend."""
        told = [f"{p.symbol}={parameters[p.name]:g}" for p in self.parameters]
        return f"${', '.join(told)}$"

    def stem(self, parameters: Mapping[str, float]) -> str:
        """Name files of packings of such particles."""
        numbers = [p.option + in_name(parameters[p.name]) for p in self.parameters]
        return "_".join([self.name, *numbers])


# Diameters that differ by less are alike, but for rounding.
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

    def fits(self, diameters: FloatArray) -> bool:
        """As `Shape.fits`."""
        long, short, other = diameters.T
        return bool(((short == other) & (long >= short)).all())

    def placed(self, diameters: FloatArray, dimension: int) -> tuple[FloatArray, IntArray]:
        """As `Shape.placed`: the long axis comes first, and diameters that differ by rounding are alike."""
        low, middle, high = np.sort(diameters).T
        is_round = high - low <= _ROUNDING * high
        first = np.where(is_round, 0, diameters.argmax(axis=1))
        is_body = (middle - low <= _ROUNDING * high) | is_round
        # In the plane bodies turn about z only.
        is_body &= (first < 2) | (dimension == 3)
        fits = (diameters[:, 1] == diameters[:, 2]) & (diameters[:, 0] >= diameters[:, 1])
        is_other = is_body & (~fits | (is_round & (high > low)))
        short = np.where(is_round, high, middle)
        as_named = np.column_stack([high, short, short])
        found = np.where(is_other[:, None], as_named, diameters)
        return found, np.where(is_other, first, 0)

    def rule(self) -> str:
        """As `Shape.rule`."""
        return "(2(A+R), 2R, 2R) with A >= 0"

    def sizes(
        self, parameters: Mapping[str, float], size: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """As `Shape.sizes`."""
        radius = 0.5 * size
        half_length = parameters["alpha"] * radius
        long = 2 * (half_length + radius)
        return np.column_stack([long, 2 * radius, 2 * radius]), np.ones(len(size))

    def parameters_of(
        self, diameters: FloatArray, exponent: float
    ) -> tuple[dict[str, float], float]:
        """As `Shape.parameters_of`."""
        del exponent
        width = float(diameters[1])
        return {"alpha": float(diameters[0] - width) / width}, width

    def spine(self, diameters: FloatArray) -> float:
        """As `Shape.spine`."""
        return float(diameters[0] - diameters[1]) / 2
