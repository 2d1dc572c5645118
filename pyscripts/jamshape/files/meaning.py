"""Meaning of a LAMMPS text file: dimension, shape and law, which its columns do not state.

The user or the file may state them; otherwise the most plausible one is assumed, with a warning of one
sentence. Decisions are robust to rounding: a plane holds all particles to within `_ROUNDING`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.files.disk import PathLike
from jamshape.packing import Packing
from jamshape.packing.given import as_floats
from jamshape.packing.rotation import product
from jamshape.shapes.shape import Interaction, Shape, stiffness_text
from jamshape.shapes.table import SHAPES, Fitted, fitted, shape_named

_ROUNDING = 1e-9  # of a length over a diameter, of a quaternion over its norm
PLANE = (-0.5, 0.5)  # extent in z of a two-dimensional system, LAMMPS's default
# Rotations w i j k that take the body's x to its axis k.
_FROM_X = np.array([[1, 0, 0, 0], [0.5**0.5, 0, 0, 0.5**0.5], [0.5**0.5, 0, -(0.5**0.5), 0]])
_EXACT, _FEW = 15, 5  # digits: full double precision; most in hand-written files


class Wanted(NamedTuple):
    """Meaning given by the user; None where unspecified."""

    dimension: int | None = None
    shape: str | None = None


NOTHING = Wanted()


@dataclass(frozen=True)
class Said:
    """Statements of a file beside its columns; None and "" where unspecified."""

    dimension: int | None = None
    shape: str = ""
    law: Mapping[str, Any] = field(default_factory=dict)
    """k_e, sides and power, if stated."""
    has_exponent: bool = False
    """Whether the file has exponents."""
    form: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    """(N, K) forms, as of clumps; empty if it has none."""
    digits: int = 0
    """Largest number of significant digits of a coordinate; 0 if not counted."""
    is_scaled: bool = False
    """Whether coordinates are in units of the box."""
    is_ours: bool = False
    """Whether sizes were written by us, exact to the last bit."""
    is_later: bool = False
    """Whether it is a frame after the first one, which needs no more warnings."""


class Geometry(NamedTuple):
    """Positions, orientations and sizes in a file."""

    position: FloatArray
    """(N, 3), [length]"""
    quaternion: FloatArray
    """(N, 4) w i j k of any norm."""
    diameters: FloatArray
    """(N, 3), [length]"""
    bounds: FloatArray
    """(3, 2) lower and upper ends of the box, [length]."""
    tilt: FloatArray
    """(3,) xy, xz, yz, [length]."""

    @property
    def size(self) -> float:
        """Smallest diameter."""
        return float(self.diameters.min())

    @property
    def is_flat(self) -> bool:
        """Whether everything lies in a plane of one z up to rounding."""
        z, q = self.position[:, 2], self.quaternion
        tilt = np.abs(self.tilt[1:]).max()
        is_level = bool((np.abs(z - z[0]) <= _ROUNDING * self.size).all())
        length = np.linalg.norm(q, axis=1, keepdims=True)
        is_upright = bool((np.abs(q[:, 1:3]) <= _ROUNDING * length).all())
        return is_level and is_upright and bool(tilt <= _ROUNDING * self.size)

    @property
    def is_at_zero(self) -> bool:
        """Whether the first particle is at z = 0, within the box."""
        low, high = self.bounds[2]
        return bool(abs(self.position[0, 2]) <= _ROUNDING * self.size and low <= 0 <= high)

    @property
    def is_usual_plane(self) -> bool:
        """Whether the box has the default height of two-dimensional systems."""
        return bool((np.abs(self.bounds[2] - PLANE) <= _ROUNDING).all())

    @property
    def is_thin(self) -> bool:
        """Whether particles would overlap their own images above."""
        low, high = self.bounds[2]
        return bool(high - low < self.size)

    @property
    def is_tall(self) -> bool:
        """Whether a body is longer along its z than along x and y."""
        return bool((self.diameters[:, 2] > self.diameters[:, :2].max(axis=1)).any())


class Meaning(NamedTuple):
    """Meaning of a file."""

    dimension: int
    shape: Fitted
    law: Interaction

    def turned(self, quaternion: FloatArray) -> FloatArray:
        """Reorder (N, 4) quaternions of bodies to the axes of the shape."""
        if not self.shape.first.any():
            return quaternion
        return product(quaternion, _FROM_X[self.shape.first])


def _takes(shape: Shape, form: FloatArray, dimension: int) -> bool:
    """Whether forms may be of a shape, or, without any, whether it needs none."""
    if not shape.has_form or not len(form):
        return shape.has_form == (len(form) > 0)
    try:
        shape.check_form(form, dimension)
    except ValueError:
        return False
    return True


def meaning_of(path: PathLike, there: Geometry, said: Said, wanted: Wanted) -> Meaning:
    """Determine dimension, shape and law of the particles of a file, with warnings where doubtful.

    The user's statements take precedence over those of the file.

    Parameters
    ----------
    path : path-like
        Path for warnings.
    there : Geometry
    said : Said
    wanted : Wanted

    Raises
    ------
    ValueError
        If particles do not fit the statements of the user or the file.
    """
    if not len(there.position):
        msg = "packing has no particles, expected at least one"
        raise ValueError(msg)
    for lengths in ("position", "diameters"):
        values = getattr(there, lengths)
        as_floats(lengths, values, values.shape)  # refuses NaN, before anything is decided by it
    dimension, why = _dimension(there, wanted.dimension or said.dimension)
    name = wanted.shape or said.shape
    able = [
        shape.name
        for shape in SHAPES.values()
        if shape.has_exponent >= said.has_exponent and _takes(shape, said.form, dimension)
    ]
    if name and shape_named(name).name not in able:
        has = "exponents" if said.has_exponent else "forms" if len(said.form) else "no forms"
        which = f"which a {name} needs" if has == "no forms" else f"which no {name} has"
        msg = f"the file has {has}, {which}, expected one of {', '.join(able)}"
        raise ValueError(msg)
    if name and said.is_ours:
        found = Fitted(name, there.diameters, np.zeros(len(there.diameters), np.int64))
    else:
        found = fitted([name] if name else able, there.diameters, dimension)
    law = Interaction.told(said.law)
    if said.is_later:
        return Meaning(dimension, found, law)
    if not name and len(able) > 1:
        doubt = "shape= and dimension= (--shape, --dimension)" if why else "shape= (--shape)"
        said_so = _of_shape(path, found.name, dimension, law)
        warnings.warn(f"{said_so}; give {doubt}, a shape of {', '.join(able)}", stacklevel=2)
    elif why:
        say = "give dimension= or --dimension if it is another"
        warnings.warn(f"{path} {why}: it is read as {dimension}D; {say}", stacklevel=2)
    if shape_named(found.name).has_exponent and not said.has_exponent:
        warnings.warn(
            f"{path} does not state the exponents of its particles: they are read as p = 1, ellipsoids; use"
            " packing.with_(exponent=...) for others",
            stacklevel=2,
        )
    if _FEW < said.digits < _EXACT:
        warnings.warn(_of_digits(path, there, said), stacklevel=2)
    return Meaning(dimension, found, law)


def require_told(path: PathLike, packing: Packing, wanted: Wanted) -> None:
    """Refuse a user's statement that differs from that of the file.

    Raises
    ------
    ValueError
    """
    for name, own in (("dimension", packing.dimension), ("shape", packing.shape_style)):
        asked = getattr(wanted, name)
        if asked and asked != own:
            msg = f"{path} has {name} {own}, expected {asked}; leave {name} out"
            raise ValueError(msg)


def _dimension(there: Geometry, told: int | None) -> tuple[int, str]:
    """Return the dimension, and why it is doubtful."""
    if told is not None:
        if told == 2 and not there.is_flat:
            msg = "a z, a rotation or a tilt out of the plane is not 0, expected a two-dimensional packing"
            raise ValueError(msg)
        return told, ""
    if not there.is_flat:
        return 3, ""
    if there.is_usual_plane and there.is_at_zero and not there.is_tall:
        return 2, ""
    is_plane = not there.is_tall and (there.is_at_zero or there.is_thin)
    low, high = there.bounds[2].tolist()
    why = f"does not state its dimension, has all particles in one plane and a box from {low:g} to {high:g} in z"
    return (2 if is_plane else 3), why


def _of_shape(path: PathLike, name: str, dimension: int, law: Interaction) -> str:
    bonds = {1: "one bond", 2: "two bonds"}[law.sides]
    k_e = stiffness_text(law.k_e).removesuffix(".0")
    return (
        f"{path} does not state the shape of its particles: they are read as {name}s in {dimension}D with"
        f" k_e = {k_e} and {bonds} side to side"
    )


def _of_digits(path: PathLike, there: Geometry, said: Said) -> str:
    unit = float(np.ptp(there.bounds, axis=1).max()) if said.is_scaled else 1.0
    largest = 0.5 if said.is_scaled else float(np.abs(there.position).max())
    off = unit * 0.5 * 10.0 ** (math.floor(math.log10(largest)) + 1 - said.digits)
    return (
        f"{path} has coordinates of {said.digits} digits, with errors up to {off:.1g},"
        f" {off / there.size:.1g} of the smallest diameter: overlaps of that size are lost;"
        " write them with 17 digits (dump_modify ... format float %.17g)"
    )


def most_digits(words: Sequence[str]) -> int:
    """Count the significant digits of the longest number.

    Examples
    --------
    >>> most_digits(["0.5", "-12.3456", "1.0e-07"])
    6
    """
    mantissas = (word.lower().partition("e")[0] for word in words)
    return max((len(m.replace(".", "").strip("+-").strip("0")) for m in mantissas), default=0)
