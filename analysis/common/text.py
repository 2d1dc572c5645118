"""Titles and legends of figures of packings and of compressions."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence, Sized
from typing import Any

from common.ensembles import conditions, n_of
from jamshape.drawing.text import (
    attribute_text,
    attributes_text,
    protocol_text,
    scientific,
    system_text,
    systems_text,
)
from jamshape.files.ensembles import PackingFile, System
from jamshape.measures.runs import Ensemble
from jamshape.shapes.shape import Shape
from jamshape.shapes.table import SHAPES, shape_named

_OF_ENSEMBLES = ("n", "size_ratio", "kappa")


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
    first += [attribute_text(name, known) for name in ("size_ratio",) if name in known]
    second = [count, *attributes_text(known)]
    if n := known["not_reached"]:
        second.append(
            f"with {n} of {counted(sum(map(len, groups.values())), 'packing')} not at rest"
        )
    return "\n".join([", ".join(first), ", ".join(second)])


def is_told_by_parameters(shape: Shape) -> bool:
    """Whether parameters alone identify it: it is the first shape with these."""
    names = [p.name for p in shape.parameters]
    alike = (s for s in SHAPES.values() if [p.name for p in s.parameters] == names)
    return next(alike).name == shape.name


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
        parts += [system.law]
        labels[system] = ", ".join(part for part in parts if part)
    return labels


def ensemble_labels(ensembles: Collection[Ensemble]) -> dict[Ensemble, str]:
    """Label ensembles of compressions by their differences, for a legend; always with N."""
    systems, differ = _differing(ensembles)
    labels = {}
    for e in ensembles:
        told = [attribute_text(name, e._asdict()) for name in differ]
        labels[e] = ", ".join([*told, *[systems[e.system]] * (len(systems) > 1)])
    return labels


def ensembles_title(ensembles: Collection[Ensemble]) -> str:
    """Describe the common settings of ensembles of compressions."""
    systems, differ = _differing(ensembles)
    first = next(iter(ensembles))
    told = [attribute_text(name, first._asdict()) for name in _OF_ENSEMBLES if name not in differ]
    return ", ".join([systems_text(systems), *told])


def _differing(ensembles: Collection[Ensemble]) -> tuple[dict[System, str], list[str]]:
    """Return labels of the systems, and names of the numbers in which ensembles differ, with N."""
    systems = system_labels({e.system: None for e in ensembles})
    several = [k for k in _OF_ENSEMBLES if len({getattr(e, k) for e in ensembles}) > 1]
    return systems, ["n"] * ("n" not in several) + several
