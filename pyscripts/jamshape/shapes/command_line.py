"""Options that specify particles, the same for every command and shape."""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from typing import Any

from jamshape.shapes.particles import Kind, Particles, parse_kind
from jamshape.shapes.shape import HARMONIC, Parameter, Shape, power_of
from jamshape.shapes.table import DEFAULT, SHAPES, shape_named


def add_particle_options(parser: ArgumentParser) -> None:
    """Add --shape, the parameters of all shapes, --size-ratio and --kind."""
    group = parser.add_argument_group("particles")
    group.add_argument("--shape", choices=SHAPES, help=f"({DEFAULT})")
    for option, known in _parameters().items():
        usual = ", ".join(f"{shape.name} {parameter.usual}" for shape, parameter in known)
        kind = str if isinstance(known[0][1].default, str) else float
        group.add_argument(f"--{option}", type=kind, help=f"{known[0][1].meaning} ({usual})")
    usual = ", ".join(f"{shape.name} {shape.size_ratio:g}" for shape in SHAPES.values())
    group.add_argument("--size-ratio", type=float, help=f"big over small, mixed 1:1 ({usual})")
    group.add_argument(
        "--law",
        type=_law,
        help="law of their contacts: harmonic, hertz or the power of the overlap in the energy (harmonic)",
    )
    group.add_argument(
        "--kind",
        type=_kind,
        action="append",
        default=[],
        metavar="NAME=NUMBER,...",
        help="one of the kinds of a mixture, such as alpha=0,size=1.4,share=0.3,spread=0.1 "
        "(spread: standard deviation of the logarithm of the size); may be given several times",
    )


_MEANING: dict[str, dict[str, Any]] = {
    "dimension": {"type": int, "choices": (2, 3), "help": "dimension of the file"},
    "shape": {"choices": SHAPES, "help": "shape of its particles"},
}


def add_meaning_options(parser: ArgumentParser, *names: str) -> None:
    """Add --dimension and --shape, or those of these names, for files that do not state them."""
    group = parser.add_argument_group("LAMMPS's data files and dumps without dimension and shape")
    for name in names or _MEANING:
        group.add_argument(f"--{name}", **_MEANING[name])


def particles_of(options: Namespace) -> Particles:
    """Read the particles from the options.

    Raises
    ------
    ValueError
        If an option does not belong to the shape, or is out of its range.
    """
    shape, given = _shape(options), _given(options)
    law = HARMONIC if options.law is None else options.law
    if options.kind:
        if given or options.size_ratio is not None:
            msg = "--kind excludes --size-ratio and a shape's parameters, expected a mixture's numbers in --kind"
            raise ValueError(msg)
        return Particles.mixture(shape, options.kind).under(law)
    return Particles.of(shape, options.size_ratio, **given).under(law)


def are_particles_given(options: Namespace) -> bool:
    """Whether any of the options of `add_particle_options` was given."""
    others = options.shape, options.size_ratio, options.law
    return bool(options.kind or _given(options)) or any(value is not None for value in others)


def particles_beside(options: Namespace) -> Particles | None:
    """Read the particles; None if there is a start and no particles were given."""
    return None if options.start and not are_particles_given(options) else particles_of(options)


def _shape(options: Namespace) -> Shape:
    return shape_named(options.shape or DEFAULT)


def _given(options: Namespace) -> dict[str, float]:
    """Collect the given parameters; raise unless all belong to the shape."""
    shape, found = _shape(options), {}
    own = {parameter.option: parameter.name for parameter in shape.parameters}
    for option in _parameters():
        value = getattr(options, option)
        if value is None:
            continue
        if option not in own:
            options_of_it = ", ".join(f"--{name}" for name in own)
            msg = f"--{option} does not apply to {shape.name}s, expected {options_of_it}"
            raise ValueError(msg)
        found[own[option]] = value
    return found


def _parameters() -> dict[str, list[tuple[Shape, Parameter]]]:
    """List the parameters of all shapes by their options, with the shapes that have them."""
    found: dict[str, list[tuple[Shape, Parameter]]] = {}
    for shape in SHAPES.values():
        for parameter in shape.parameters:
            found.setdefault(parameter.option, []).append((shape, parameter))
    return found


def _law(text: str) -> float:
    try:
        return power_of(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from None


def _kind(text: str) -> Kind:
    try:
        return parse_kind(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from None
