"""Options of a recipe."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from functools import partial
from typing import Any

from jamshape.files.vocabulary import read_protocol
from jamshape.minima import METHODS
from jamshape.old_names import add_old_option, current
from jamshape.protocols.defaults import PROTOCOLS, SETTINGS
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
    kinds: dict[str, Any] = {"type": read_protocol, "choices": tuple(PROTOCOLS)}
    how = "route to jamming, or as published; 1 and 2 are short for the last two (quasistatic)"
    group.add_argument("--protocol", **kinds, help=how)
    add_old_option(parser, "--way", "--protocol", **kinds)
    group.add_argument("--seed", type=int, help="random seed (1)")
    group.add_argument(
        "--strict", action="store_true",
        help="continue at the energy until no mode has a negative eigenvalue",
    )  # fmt: skip
    for one in SETTINGS:
        option = f"--{one.name.replace('_', '-')}"
        group.add_argument(
            option,
            type=partial(current, one.name) if one.name in _CHOICES else one.kind,
            choices=_CHOICES.get(one.name),
            help=f"{one.meaning}{_usual(one.name)}",
        )


def _usual(name: str) -> str:
    """Format the defaults of a setting, once for protocols that share them."""
    texts, seen = [], []
    for protocol, table in PROTOCOLS.items():
        if table in seen:
            continue
        seen.append(table)
        if (value := table.usual.get(name)) is not None:
            in_plane = table.in_plane.get(name, value)
            texts.append(
                f"{protocol} {_said(value)}" + f" or in 2D {_said(in_plane)}" * (in_plane != value)
            )
    return f" ({', '.join(texts)})" if texts else ""


def _said(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def settings_of(options: Namespace) -> dict[str, Any]:
    """Read the given settings of a recipe, except its particles, by the names of `recipe_for`."""
    names = ("dimension", "seed", "protocol", "strict", *(one.name for one in SETTINGS))
    return {name: getattr(options, name) for name in names}
