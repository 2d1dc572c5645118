"""Options of a recipe."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import Any

from jamshape.files.vocabulary import read_protocol
from jamshape.minima import METHODS
from jamshape.protocols.defaults import PROTOCOLS, SETTINGS, WAYS
from jamshape.protocols.recipe import SEARCHES
from jamshape.shapes.command_line import add_particle_options

_CHOICES = {"search": tuple(SEARCHES), "minimiser": tuple(METHODS)}


def add_recipe_options(parser: ArgumentParser) -> None:
    """Add all options of a recipe."""
    add_particle_options(parser)
    group = parser.add_argument_group("how to make it")
    group.add_argument(
        "--dimension", type=int, choices=(2, 3), help="2 or 3 (that of the shape's paper)"
    )
    group.add_argument("--way", choices=tuple(WAYS), help="route to jamming (quasistatic)")
    group.add_argument(
        "--protocol", type=read_protocol, choices=tuple(PROTOCOLS),
        help="published protocol, in place of --way; 1 and 2 are short for the last two",
    )  # fmt: skip
    group.add_argument("--seed", type=int, help="random seed (1)")
    group.add_argument(
        "--strict", action="store_true",
        help="continue at the energy until no mode has a negative eigenvalue",
    )  # fmt: skip
    for one in SETTINGS:
        option = f"--{one.name.replace('_', '-')}"
        group.add_argument(
            option,
            type=one.kind,
            choices=_CHOICES.get(one.name),
            help=f"{one.meaning}{_usual(one.name)}",
        )


def _usual(name: str) -> str:
    """Format the defaults of a setting, of protocols if no way has it."""
    tables = WAYS | {k: v for k, v in PROTOCOLS.items() if v not in WAYS.values()}
    texts = []
    for way, table in tables.items():
        if (value := table.usual.get(name)) is not None:
            in_plane = table.in_plane.get(name, value)
            texts.append(
                f"{way} {_said(value)}" + f" or in 2D {_said(in_plane)}" * (in_plane != value)
            )
    return f" ({', '.join(texts)})" if texts else ""


def _said(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def settings_of(options: Namespace) -> dict[str, Any]:
    """Read the given settings of a recipe, except its particles, by the names of `recipe_for`."""
    names = ("dimension", "way", "seed", "protocol", "strict", *(one.name for one in SETTINGS))
    return {name: getattr(options, name) for name in names}
