"""Text in figures: numbers in TeX, names of systems, N and the number of samples."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence, Sized
from typing import Any, Protocol

import numpy as np

from jamshape.files.sets import PackingFile, System, conditions, n_of
from jamshape.measures.runs import Ensemble
from jamshape.shapes.particles import parse_kind
from jamshape.shapes.shape import Shape
from jamshape.shapes.table import SHAPES, shape_named

_NUMBERS = {"n": "N", "size_ratio": "R_b/R_s", "kappa": r"\kappa", "u0": "u_0",
            "phi": r"\phi", "gdot": r"\dot\gamma"}  # fmt: skip
_SMALL = frozenset({"u0", "kappa", "gdot"})
_OF_ENSEMBLES = ("n", "size_ratio", "kappa")


class Grouped(Protocol):
    """Common settings of runs that differ only in their seed: a system, and numbers by name."""

    @property
    def system(self) -> System:
        """Their particles."""

    def _asdict(self) -> dict[str, Any]: ...


def scientific(value: float) -> str:
    r"""Format a number >= 0 as a power of ten in TeX, without dollars, to two digits.

    Examples
    --------
    >>> scientific(9.9999e-16), scientific(2e-6)
    ('10^{-15}', '2\\times 10^{-6}')
    """
    if value == 0:
        return "0"
    factor, exponent = f"{value:.1e}".split("e")
    power = f"10^{{{int(exponent)}}}"
    return power if factor == "1.0" else rf"{float(factor):g}\times {power}"


def short(value: float) -> str:
    """Format a number in TeX, as a power of ten if it is small."""
    return f"{value:.2g}" if 0.01 <= value < 100 else scientific(value)


def counted(count: int, thing: str) -> str:
    """Format a number of things."""
    return f"{count} {thing}{'s' * (count != 1)}"


def range_text(counts: Iterable[int], thing: str) -> str:
    """Format a number of things that may vary."""
    known = sorted(set(counts))
    return counted(known[0], thing) if len(known) == 1 else f"{known[0]} to {known[-1]} {thing}s"


def samples_text(n: int, groups: Mapping[Any, Sized]) -> str:
    """Format N and the number of samples, for a legend."""
    many = range_text(map(len, groups.values()), "sample")
    return rf"$N={n}$, {many}" + " each" * (len(groups) > 1)


def conditions_text(groups: Mapping[Any, Sequence[PackingFile]], *, bars: bool = True) -> str:
    """Describe the packings of a figure on one line, and N, samples, energy and rate on the next.

    Only common values of energy density and compression rate are given. Bars are explained
    last, if they are drawn and there are several samples.
    """
    return _titled(groups, samples_text(n_of(groups), groups)) + bars_text(groups) * bars


def bars_text(groups: Mapping[Any, Sized]) -> str:
    """Explain error bars, on a line of its own, if there are several samples."""
    return "\nbars: standard error of the mean" * any(len(of) > 1 for of in groups.values())


def conditions_alone(groups: Mapping[Any, Sequence[PackingFile]]) -> str:
    """Return the same without the number of samples, for legends that give it for each curve."""
    return _titled(groups, f"$N={n_of(groups)}$")


def _titled(groups: Mapping[Any, Sequence[PackingFile]], count: str) -> str:
    known = conditions(groups)
    first = [systems_text(file.system() for of in groups.values() for file in of)]
    first += [_told(name, known) for name in ("size_ratio",) if name in known]
    second = [count, *attributes_text(known)]
    if n := known["not_reached"]:
        second.append(
            f"with {n} of {counted(sum(map(len, groups.values())), 'packing')} not at rest"
        )
    return "\n".join([", ".join(first), ", ".join(second)])


def attributes_text(known: Mapping[str, Any]) -> list[str]:
    r"""Format the energy density and the compression rate in a file, if present.

    Examples
    --------
    >>> attributes_text({"n": 64, "kappa": 2e-6})
    ['$\\kappa=2\\times 10^{-6}$']
    """
    return [_told(name, known) for name in ("u0", "kappa") if name in known]


def _told(name: str, known: Mapping[str, Any]) -> str:
    """Format a number with its symbol; the last one of successive rates."""
    value = float(np.ravel(known[name])[-1])
    if name == "u0" and value == 0:
        return "first jammed"
    return f"${_NUMBERS[name]}={scientific(value) if name in _SMALL else f'{value:g}'}$"


def systems_text(systems: Iterable[System]) -> str:
    """Describe systems: shape, dimension, and parameters or their ranges."""
    found = list(dict.fromkeys(systems))
    shapes, dimensions, protocols = (
        sorted({getattr(system, name) for system in found})
        for name in ("shape", "dimension", "protocol")
    )
    parts = [f"{' and '.join(f'{name}s' for name in shapes)} in "]
    parts[0] += " and ".join(f"{D}D" for D in dimensions)
    if len(found) == 1:
        parts.append(system_text(found[0]))
    elif len(shapes) == 1:
        parts += _ranges(found)
    parts += [protocol_text(found[0])] * (len(protocols) == 1 and protocols != [""])
    return ", ".join(filter(None, parts))


def _ranges(systems: Sequence[System]) -> list[str]:
    """Format the parameters of systems of one shape, or their ranges."""
    texts = []
    for parameter in shape_named(systems[0].shape).parameters:
        values = [system.number(parameter.name) for system in systems]
        low, high = min(values), max(values)
        if not any(map(math.isnan, values)):
            texts.append(f"${parameter.symbol}={low:g}$" + f" to ${high:g}$" * (low < high))
    return texts


def system_text(system: System) -> str:
    """Describe a system by its known parameters; a mixture by its kinds."""
    if system.kinds:
        return mixture_text(system)
    known = dict(system.parameters)
    return shape_named(system.shape).label(known) if known else ""


def is_told_by_parameters(shape: Shape) -> bool:
    """Whether parameters alone identify it: it is the first shape with these."""
    names = [p.name for p in shape.parameters]
    alike = (s for s in SHAPES.values() if [p.name for p in s.parameters] == names)
    return next(alike).name == shape.name


def mixture_text(system: System) -> str:
    """Describe the kinds of a mixture, as far as known, by parameters, size and share."""
    shape = shape_named(system.shape)
    try:
        kinds = [parse_kind(text) for text in system.kinds.split(";")]
        named = [shape.label(kind.parameters) for kind in kinds]
    except (ValueError, KeyError):  # individually specified particles
        return f"{system.shape}s {system.kinds}"
    total = sum(kind.share for kind in kinds)
    shares = [f"{100 * kind.share / total:.0f} %" for kind in kinds]
    sizes = [f"${shape.unit}={kind.size:g}$" for kind in kinds]
    return "; ".join(map(", ".join, zip(named, sizes, shares, strict=True)))


def system_labels(systems: Collection[System]) -> dict[System, str]:
    """Label systems by their differences, for a legend; always with parameters and nonstandard properties."""
    shapes, dimensions, protocols = (
        {getattr(system, name) for system in systems} for name in ("shape", "dimension", "protocol")
    )
    labels = {}
    for system in systems:
        shape = shape_named(system.shape)
        parts = [f"{shape.name}s"] * (len(shapes) > 1 or not is_told_by_parameters(shape))
        parts += [f"{system.dimension}D"] * (
            len(dimensions) > 1 or system.dimension != shape.dimension
        )
        parts += [system_text(system)]
        parts += [protocol_text(system)] * (len(protocols) > 1)
        labels[system] = ", ".join(part for part in parts if part)
    return labels


def ensemble_text(ensemble: Grouped, names: Iterable[str] = ("n", "kappa")) -> str:
    """Describe an ensemble of runs by its system and the numbers of these names."""
    told = [_told(name, ensemble._asdict()) for name in names]
    return ", ".join([systems_text([ensemble.system]), *told])


def ensemble_labels(ensembles: Collection[Ensemble]) -> dict[Ensemble, str]:
    """Label ensembles of compressions by their differences, for a legend; always with N."""
    systems, differ = _differing(ensembles)
    labels = {}
    for e in ensembles:
        told = [_told(name, e._asdict()) for name in differ]
        labels[e] = ", ".join([*told, *[systems[e.system]] * (len(systems) > 1)])
    return labels


def ensembles_title(ensembles: Collection[Ensemble]) -> str:
    """Describe the common settings of ensembles of compressions."""
    systems, differ = _differing(ensembles)
    first = next(iter(ensembles))
    told = [_told(name, first._asdict()) for name in _OF_ENSEMBLES if name not in differ]
    return ", ".join([systems_text(systems), *told])


def _differing(ensembles: Collection[Ensemble]) -> tuple[dict[System, str], list[str]]:
    """Return labels of the systems, and names of the numbers in which ensembles differ, with N."""
    systems = system_labels({e.system: None for e in ensembles})
    several = [k for k in _OF_ENSEMBLES if len({getattr(e, k) for e in ensembles}) > 1]
    return systems, ["n"] * ("n" not in several) + several


def onset_symbol(kappa: float) -> str:
    r"""Return the symbol of phi_J at a finite rate, which is less than that at slower rates.

    Examples
    --------
    >>> onset_symbol(2e-6)
    '\\phi_J(\\kappa=2\\times 10^{-6})'
    """
    return rf"\phi_J(\kappa={scientific(kappa)})"


def unit_text(systems: Iterable[System]) -> str:
    """Return the common unit of length of systems, in TeX without dollars."""
    units = {shape_named(system.shape).unit for system in systems}
    unit = units.pop() if len(units) == 1 else r"\mathrm{length}"
    return unit if len(unit) == 1 else f"({unit})"


def pressure_unit(systems: Collection[System]) -> str:
    """Return the unit of pressure and energy density in TeX, without dollars."""
    dimensions = {system.dimension for system in systems}
    power = dimensions.pop() if len(dimensions) == 1 else "D"
    return rf"[k_e/{unit_text(systems)}^{power}]"


def protocol_text(system: System) -> str:
    """Name the protocol of the packings of a system."""
    sweeps = f", {system.n_sweeps} sweeps" * (system.n_sweeps > 0)
    return f"{system.protocol}{sweeps}" if system.protocol else "dynamics"
