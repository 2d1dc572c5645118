"""Particles of a packing: mixtures of kinds of one shape."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arguments import checked, checked_fields
from jamshape.arrays import FloatArray, IntArray, real_numbers, whole_numbers
from jamshape.checks import RANGES, require_in, require_stated
from jamshape.shapes.shape import HARMONIC, Shape, law_text, power_of
from jamshape.shapes.table import DEFAULT, shape_named

OF_A_KIND = ("size", "share", "spread")
"""Numbers of a kind beside the parameters of its shape."""


class Sizes(NamedTuple):
    """Shapes of n particles."""

    diameters: FloatArray
    """(n, 3), [length], as in LAMMPS."""
    form: FloatArray
    """(n, K) further numbers, as in `Packing.form`."""
    species: IntArray
    """(n,) kinds, LAMMPS types, from 1."""


@checked_fields
@dataclass(frozen=True)
class Kind:
    """One kind of particles in a mixture.

    Parameters
    ----------
    parameters : mapping of str to float or str
        Parameters of the shape, such as alpha; the shape's defaults where missing.
    size : float
        Relative to the unit of length (2R, or the shortest semi-axis a).
    share : float
        Number fraction, up to normalisation.
    spread : float
        Standard deviation of the logarithm of the size; 0 for equal particles.

    Raises
    ------
    ValueError
        If a number is out of its range.

    Examples
    --------
    >>> from jamshape import Kind, Particles
    >>> discs, rods = Kind({"alpha": 0}, share=3), Kind({"alpha": 4}, size=1.4)
    >>> mixture = Particles.mixture("spherocylinder", [discs, rods])
    """

    parameters: Mapping[str, float | str] = field(default_factory=dict)
    size: float = 1.0
    share: float = 1.0
    spread: float = 0.0

    def __post_init__(self) -> None:
        require_stated(size=self.size, share=self.share, spread=self.spread)


@checked_fields
@dataclass(frozen=True)
class Particles:
    """A distribution of particles of one shape.

    Parameters
    ----------
    shape : Shape
    draw : callable
        ``draw(n, rng)`` returns the `Sizes` of n particles in any order; all randomness comes
        from the `numpy.random.Generator`.
    told : mapping
        Metadata for files.
    power : float
        Of the overlap in the energy of their contacts, as in `Interaction`.

    Examples
    --------
    >>> from jamshape.shapes.particles import Particles
    >>> rods = Particles.of("spherocylinder", alpha=4.0)
    >>> rods.told
    {'alpha': 4.0, 'size_ratio': 1.4}
    """

    shape: Shape
    draw: Callable[[int, np.random.Generator], Sizes]
    told: Mapping[str, Any]
    power: float = HARMONIC

    def __repr__(self) -> str:
        known = [f"{k}={v if isinstance(v, str) else format(v, 'g')}" for k, v in self.told.items()]
        return f"Particles({', '.join([repr(self.shape.name), *known])})"

    @property
    def identity(self) -> dict[str, Any]:
        """Return `told` with all that identifies the particles in a file; None for a law that is not to be there."""
        return {"law": None} | dict(self.told)

    def under(self, law: str | float) -> Particles:
        """Return the same particles with another law of their contacts.

        Parameters
        ----------
        law : str or float
            ``"harmonic"``, ``"hertz"``, or the power of the overlap in the energy of a contact, at least 2.

        Raises
        ------
        ValueError
            If it is none of these.
        """
        power = power_of(law)
        own = {"law": law_text(power)} if power != HARMONIC else {}
        told = {name: value for name, value in self.told.items() if name != "law"} | own
        return replace(self, told=told, power=power)

    @classmethod
    @checked
    def of(
        cls, shape: str | Shape = DEFAULT, size_ratio: float | None = None, **parameters: Any
    ) -> Particles:
        """Equal particles, or a 1:1 mixture of small and big ones with the same parameters.

        Parameters
        ----------
        shape : str or Shape
        size_ratio : float, optional
            Size ratio, at least 1; the default depends on the shape (1.4 for rods,
            Marschall & Teitel 2018, Sec. II; 1, equal particles, for superellipsoids).
        **parameters : float or str
            Parameters of the shape; its defaults where missing.

        Raises
        ------
        ValueError
            If the shape or a parameter is unknown, or a number is out of its range.
        """
        its = shape_named(shape) if isinstance(shape, str) else shape
        ratio = its.size_ratio if size_ratio is None else size_ratio
        require_stated(size_ratio=ratio)
        chosen = _with_defaults(its, parameters)
        sizes = [1.0] if ratio == 1 else [1.0, ratio]
        is_plain = its.size_ratio == 1 == ratio
        told = chosen | ({} if is_plain else {"size_ratio": ratio})
        return cls(its, _Mixture(its, [Kind(chosen, size) for size in sizes]), told)

    @classmethod
    @checked
    def mixture(cls, shape: str | Shape, kinds: Sequence[Kind]) -> Particles:
        """Mix kinds of one shape that may differ in all else, such as discs and rods.

        Raises
        ------
        ValueError
            If there is no kind, or a number is out of its range.
        """
        its = shape_named(shape) if isinstance(shape, str) else shape
        if not kinds:
            msg = "a mixture has no kinds, expected at least one"
            raise ValueError(msg)
        big, small = max(k.size for k in kinds), min(k.size for k in kinds)
        require_in("the largest size over the smallest", big / small, RANGES["size_ratio"])
        full = [
            Kind(_with_defaults(its, k.parameters, OF_A_KIND), k.size, k.share, k.spread)
            for k in kinds
        ]
        told = {"kinds": "; ".join(map(_text, full))}
        return cls(its, _Mixture(its, full), told)

    @classmethod
    @checked
    def given(
        cls,
        shape: str | Shape,
        diameters: ArrayLike,
        form: ArrayLike | None = None,
        species: ArrayLike | None = None,
    ) -> Particles:
        """Specify individual particles: (n, 3) diameters, (n, K) forms or (n,) exponents, and species from 1."""
        its = shape_named(shape) if isinstance(shape, str) else shape
        d = np.atleast_2d(real_numbers("diameters", diameters).astype(np.float64))
        p = real_numbers("form", np.ones(len(d)) if form is None else form).astype(np.float64)
        p = its.form_of_exponents(p) if p.ndim == 1 else p
        kinds = np.ones(len(d)) if species is None else whole_numbers("species", species)
        sizes = Sizes(d, p, kinds.astype(np.int64))
        return cls(its, _Given(sizes), {"kinds": "given one by one"})

    @classmethod
    def again(cls, shape: str, told: Mapping[str, Any]) -> Particles | None:
        """Make particles from their `told`; None if it does not describe them, as of those given one by one."""
        own = [parameter.name for parameter in shape_named(shape).parameters]
        law = told.get("law", HARMONIC)
        if "kinds" not in told:
            parameters = {name: told[name] for name in own if name in told}
            return cls.of(shape, told.get("size_ratio"), **parameters).under(law)
        kinds = [text for text in str(told["kinds"]).split("; ") if "=" in text]
        return (
            cls.mixture(shape, [parse_kind(text) for text in kinds]).under(law) if kinds else None
        )

    def sample(self, n: int, rng: np.random.Generator) -> Sizes:
        """Draw n particles.

        Raises
        ------
        ValueError
            If n < 1, or `draw` does not return n particles of the shape.
        """
        require_stated(n=n)
        sizes = self.draw(n, rng)
        if np.ndim(sizes.form) == 1:
            own = self.shape.form_of_exponents(np.asarray(sizes.form, np.float64))
            sizes = sizes._replace(form=own)
        columns = np.shape(sizes.form)[1:2]
        expected = {"diameters": (n, 3), "form": (n, *columns), "species": (n,)}
        for name, shape in expected.items():
            found = np.shape(getattr(sizes, name))
            if found != shape:
                msg = f"{name} of the mixture has shape {found}, expected {shape}"
                raise ValueError(msg)
        d = np.asarray(sizes.diameters, np.float64)
        valid = np.isfinite(d).all() and (d > 0).all() and self.shape.fits(d)
        if not valid:
            msg = f"a particle of the mixture is not a {self.shape.name}, expected {self.shape.rule()}"
            raise ValueError(msg)
        return Sizes(d, np.asarray(sizes.form, np.float64), np.asarray(sizes.species, np.int64))


def parse_kind(text: str) -> Kind:
    """Parse a kind from the command line, such as ``alpha=4,size=1.4,share=0.5``.

    Raises
    ------
    ValueError
        If the text has another format.
    """
    try:
        parts = (part.split("=") for part in text.split(","))
        numbers = {name.strip(): _number(value) for name, value in parts}
    except ValueError:
        msg = f"a kind is {text!r}, expected numbers by name such as alpha=4,size=1.4,share=0.5"
        raise ValueError(msg) from None
    own = {name: float(numbers.pop(name)) for name in OF_A_KIND if name in numbers}
    return Kind(numbers, **own)


def _number(text: str) -> Any:
    """Return a number, or the text of a parameter that is not a number; raise ValueError for empty ones."""
    with suppress(ValueError):
        return float(text)
    if not any(sign.isspace() or sign in "/." for sign in text.strip()):
        raise ValueError
    return text.strip()


def _text(kind: Kind) -> str:
    own = {"size": kind.size, "share": kind.share, "spread": kind.spread}
    return ",".join(
        f"{name}={value if isinstance(value, str) else repr(float(value))}"
        for name, value in (dict(kind.parameters) | own).items()
    )


def _with_defaults(
    shape: Shape, parameters: Mapping[str, Any], others: Sequence[str] = ()
) -> dict[str, Any]:
    """Complete and read the parameters of a shape, which may be given by their options; `others` are expected beside them."""
    known = {p.name: p.default for p in shape.parameters}
    by_option = {p.option: p.name for p in shape.parameters}
    given = {by_option.get(name, name): value for name, value in parameters.items()}
    for name in given:
        if name not in known:
            expected = ", ".join([*by_option, *others])
            msg = f"{name} is not a parameter of {shape.name}s, expected one of {expected}"
            raise ValueError(msg)
    chosen = known | given
    present = (p for p in shape.parameters if p in shape.needed or chosen[p.name] is not None)
    found = shape.reduced({p.name: p.read(chosen[p.name]) for p in present})
    for p in shape.parameters:
        if p.name in given and given[p.name] is not None and p.name not in found:
            replacing = " and ".join(q.option for q in shape.parameters if q not in shape.needed)
            msg = f"{p.option} is given beside {replacing}, which replace it, expected one or the other; leave {p.option} out"
            raise ValueError(msg)
    return found


@dataclass(frozen=True)
class _Mixture:
    """Draws particles of kinds by their shares. A class, because pickle rejects nested functions."""

    shape: Shape
    kinds: Sequence[Kind]

    def __call__(self, n: int, rng: np.random.Generator) -> Sizes:
        kinds = self.kinds
        species = np.repeat(np.arange(1, len(kinds) + 1), _numbers(n, [k.share for k in kinds]))
        diameters, form = np.empty((n, 3)), np.empty((n, 0))
        for number, kind in enumerate(kinds, 1):
            own = species == number
            size = np.full(int(own.sum()), kind.size)
            if kind.spread:
                size *= np.exp(kind.spread * rng.standard_normal(len(size)))
            diameters[own], its = self.shape.sizes(kind.parameters, size)
            form = self.shape.widened(form, its.shape[1])
            form[own] = self.shape.widened(its, form.shape[1])
        return Sizes(diameters, form, species)


@dataclass(frozen=True, eq=False)
class _Given:
    """Returns individually specified particles."""

    sizes: Sizes

    def __call__(self, n: int, rng: np.random.Generator) -> Sizes:
        del n, rng
        return self.sizes


def _numbers(n: int, shares: Sequence[float]) -> IntArray:
    """Divide n by shares; the rest goes to the largest remainders, the first of equal ones."""
    exact = n * np.asarray(shares) / np.sum(shares)
    whole: IntArray = np.floor(exact).astype(np.int64)
    left = n - int(whole.sum())
    order = np.argsort(-(exact - whole), kind="stable")
    whole[order[:left]] += 1
    return whole
