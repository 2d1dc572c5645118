"""Text in figures: numbers in TeX, names of systems, N and the number of samples."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from jamshape.files.ensembles import PackingFile, System
from jamshape.shapes.particles import parse_kind
from jamshape.shapes.table import shape_named

_NUMBERS = {"n": "N", "size_ratio": "R_b/R_s", "kappa": r"\kappa", "u0": "u_0",
            "phi": r"\phi", "gdot": r"\dot\gamma", "hold_pressure": "p_{yy}"}  # fmt: skip
_SMALL = frozenset({"u0", "kappa", "gdot", "hold_pressure"})


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


def attributes_text(known: Mapping[str, Any]) -> list[str]:
    r"""Format the energy density and the compression rate in a file, if present.

    Examples
    --------
    >>> attributes_text({"n": 64, "kappa": 2e-6})
    ['$\\kappa=2\\times 10^{-6}$']
    """
    return [attribute_text(name, known) for name in ("u0", "kappa") if name in known]


def attribute_text(name: str, known: Mapping[str, Any]) -> str:
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


def mixture_text(system: System) -> str:
    """Describe the kinds of a mixture by their known parameters, size and share."""
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


def ensemble_text(ensemble: Grouped, names: Iterable[str] = ("n", "kappa")) -> str:
    """Describe an ensemble of runs by its system and the numbers of these names."""
    told = [attribute_text(name, ensemble._asdict()) for name in names]
    return ", ".join([systems_text([ensemble.system]), *told])


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


def packing_text(file: PackingFile) -> str:
    """Describe one packing by its system, N, energy and seed, if known."""
    known = file.attributes
    told = [f"$N={known['n']}$"] if "n" in known else []
    told += attributes_text(known)
    told += [f"seed {known['seed']}"] if "seed" in known else []
    return f"{systems_text([file.system()])}\n{', '.join(told)}"
